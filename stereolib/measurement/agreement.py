"""How well both pictures agree over a surface that was predicted: how far a face goes on, and whether there is one."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from enum import Enum
from functools import cached_property

import cv2
import numpy as np

from stereolib.base import Bools, Float32, Float64, Floats, median, quantile
from stereolib.measurement.box import World
from stereolib.measurement.views import Views

_WINDOW = 5  # neighbouring lines that are compared together
_MARGIN = _WINDOW // 2  # lines by which a surface seems to go on for it
_LEAST_SEEN = 0.5  # share of a line that both pictures must show
_NEARER_PX, _NEARER = 2.0, 0.03  # what hides a surface has so much more disparity, px and share; what is behind, less
_FIRST, _SECOND = (0.8, 0.55), (0.55, 0.35)  # correlations from which on pictures agree, and up to which they do not
_OF_OWN, _LEAST_OWN = 0.85, (0.65, 0.425)  # share of a surface's own that suffices; the least of it, at first and again
_QUIET, _TYPICAL = 0.3, 0.75  # what has less than this share of a surface's typical contrast (a quantile) is plain
_MUDDY = 0.7  # so much where the surface was matched: there, noise and JPEG disagree
_NOISY, _NOISY_FARTHER = 2.0, 1.3  # of what noise has, as well; so much where something farther was matched
_COST = 0.2  # of a line that does not agree, in lines that do: so many must follow on a plain part
_DISAGREE = 3  # lines in a row that disagree end a surface
_AGAIN = 2.0  # but where it goes on beyond: so many lines that agree outweigh each that these three are moved on
_OTHER = 1.0  # and each where another surface was matched
_EVEN, _WEIGHT = 0.5, 1.0  # correlation that speaks neither for nor against a surface; logarithm of odds to a unit
_LEAST_POWER = 1e-12  # of two lines' slopes: a correlation of nothing with nothing is 0
_GOES_ON, _UNMATCHED, _ELSEWHERE = 1.0, -0.25, -2.0  # votes of lines past an end: a surface was matched, none, another
_FATTENED = 10.0  # votes that a surface gets beyond its end, as blocks of pixels are matched
_NEAR_RIM = 40  # lines: from where pictures disagree so near to a rim on, what is farther would have been matched
_HIDES = 2  # half of them hide it; so many, where all of them are nearer than any of the surface
_BESIDE = 12  # lines past an end that tell what is there
_SURFACE, _COVERS = 0.25, 0.5  # less than this share of a line's samples matched is no surface, or hides none


class Past(Enum):
    """What is where a surface seems to end."""

    OPEN = "it ends there"
    CUT = "the picture ends there"
    HIDDEN = "something nearer hides it there"


class Look(Enum):
    """How a surface is looked at: what its lines have to show."""

    FIRST = "its place is known"
    SECOND = "its place is only predicted"
    AGAIN = "its place is known, but both pictures may show it at slants of their own, and so less alike"


@dataclass(frozen=True)
class Reach:
    """How far a surface was followed.

    Attributes
    ----------
    last : int
        Number of the last line on which the pictures agree; -1: none.
    stop : int
        Number of the first line on which they disagree: in between all is too plain to tell.
    past : Past
    sure : int
        Number of the last line that has texture of its own; up to `last` it may be an edge's trace beside it.
    """

    last: int
    stop: int
    past: Past
    sure: int


@dataclass(frozen=True, eq=False)
class Agreement:
    """Both pictures compared along neighbouring lines of a surface.

    Attributes
    ----------
    fine, whole : (lines,) float64
        Correlation of the slopes along the rows, and of slopes and brightness together, each line with its neighbours:
        -1 to 1; NaN where a picture does not show it.
    contrast : (lines,) float64
        Root mean square slope in the weaker picture, made ready for comparing: an edge is in it for some pixels beside.
    relief : (lines,) float64
        Of the left picture as it is.
    predicted_px, matched_px : (lines,) float64
        Disparity of the surface, and the median one that was matched there; NaN where none was.
    covering_px : (lines,) float64
        The same where half of the line was matched, else NaN: less, as the floor at a foot, hides no end.
    noise : (lines,) float64
        What the pictures' noise has of `contrast` (`Views.slope_noise`).
    """

    fine: Float64
    whole: Float64
    contrast: Float64
    relief: Float64
    predicted_px: Float64
    matched_px: Float64
    covering_px: Float64
    noise: Float64

    def part(self, some: slice) -> Agreement:
        """Some of the lines.

        Parameters
        ----------
        some : slice
            Also backwards.

        Returns
        -------
        Agreement
        """
        return Agreement(*(getattr(self, each.name)[some] for each in fields(self)))

    def reach(self, known: int, look: Look = Look.FIRST, *, aside: bool = False) -> Reach:
        """Follow the surface from the first line on, over what is too plain to tell, until the pictures disagree.

        Parameters
        ----------
        known : int
            So many lines from the first on lie on the surface, mostly: they tell its contrast, and how alike the
            pictures show it.
        look : Look
        aside : bool
            Along a row something nearer may hide it; above and below, what seems to is a wrong match.

        Returns
        -------
        Reach

        Notes
        -----
        Lines agree from a correlation of 0.8 on and disagree below 0.55. As JPEG, noise and slants lower all of them,
        0.85 of the first ones' median suffices, but no less than 0.65; looked at again, 0.85 of their upper quartile
        (0.425 at least), and lines disagree below that. Where the place is only predicted it is 0.55 and 0.35. In
        between, and where the contrast is less than 0.3 of what is typical (0.7 where the surface was matched: there,
        noise and JPEG disagree) or than twice the noise, they tell nothing, unless they disagree and something farther
        was matched there, on more than 1.3 times the noise: over a plain part, what is behind is matched too. Three
        lines in a row that disagree, or one that a picture does not show, stop it; along a row not the former where the
        latter is at most 40 lines away, and nothing farther was matched in between: noise and JPEG disagree, too.

        Examples
        --------
        >>> alike, flat = np.array([1.0] * 6 + [0.0] * 6), np.ones(12)
        >>> Agreement(alike, alike, flat, flat, 50 * flat, 50 * flat, 50 * flat, 0 * flat).reach(4)
        Reach(last=3, stop=5, past=<Past.OPEN: 'it ends there'>, sure=3)
        """
        values, least, most = self._limits(known, look)
        good, bad = self._agrees(values, least, known), ~(values > most) & self._tells(known)
        shown, run = np.isfinite(values), np.zeros(len(values), bool)
        if len(values) >= _DISAGREE:
            run[: 1 - _DISAGREE] = np.convolve(bad, np.ones(_DISAGREE), "valid") == _DISAGREE
        rim = _first(~shown, len(values))
        gained = np.cumsum(good - _COST * ~good - _AGAIN * run - _OTHER * (aside & self._elsewhere & ~good))[:rim]
        last = int(np.argmax(gained)) if good[:rim].any() else -1
        stop = min(last + 1 + _first(run[last + 1 :], len(values)), rim)
        if aside and self._may_go_on_to(rim, stop):
            stop = rim
        cut = stop < len(values) and not shown[stop : stop + (_WINDOW if aside else _MARGIN)].all()
        hidden = self._is_hidden_beyond(last, aside=aside)
        past = Past.HIDDEN if hidden else Past.CUT if cut else Past.OPEN
        sure = int(np.flatnonzero((good & self._has_own(known))[: last + 1]).max(initial=min(last, 0)))
        last, sure = (max(at - _MARGIN, min(at, 0)) for at in (last, sure))
        return Reach(last, max(stop - 1, 0), past, sure)

    def _may_go_on_to(self, rim: int, stop: int) -> bool:
        """The picture ends there, near where the pictures disagree, and in between nothing farther was matched."""
        return rim < len(self.fine) and rim - stop <= _NEAR_RIM and not self._farther[stop:rim].any()

    def _is_hidden_beyond(self, last: int, *, aside: bool) -> bool:
        """Something nearer was matched beyond a line.

        Over what is plain the map drifts away from a surface: beside it, something nearer is nearer than the map was
        on it, too. And what is nearer than all of it hides it, also where the map shows no more than some of that.
        """
        room, beside = self._room_px[max(last, 0)], slice(last + 1 + _MARGIN, last + 1 + _BESIDE)
        on_it = self.covering_px[max(last - _BESIDE, 0) : max(last - _WINDOW, 0)]
        drifted = float(np.median(on_it)) if aside and len(on_it) else 0.0
        nearer = self.covering_px[beside] > max(float(self.predicted_px[max(last, 0)]), drifted) + room
        nearest = self.matched_px[beside] > self.predicted_px[: last + 1].max(initial=0.0) + room
        return bool(nearer.sum() > len(nearer) / 2 or (aside and nearer.sum() >= _HIDES and nearest.all()))

    def shows(self, known: int, look: Look = Look.FIRST) -> Bools:
        """Lines that speak for the surface, by texture of their own: beside an edge, its trace does so too.

        Parameters
        ----------
        known : int
        look : Look
            As for `reach`.

        Returns
        -------
        (lines,) bool
        """
        values, least, _ = self._limits(known, look)
        return np.asarray(self._agrees(values, least, known) & self._has_own(known))

    def _agrees(self, values: Float64, least: float, known: int) -> Bools:
        return np.asarray((values > least) & self._has(_QUIET, known))

    def _has_own(self, known: int) -> Bools:
        """Lines with texture of their own."""
        return np.asarray(self.relief > _QUIET * quantile(self.relief[: max(known, 1)], _TYPICAL))

    def _limits(self, known: int, look: Look) -> tuple[Float64, float, float]:
        """Correlations of lines, from which on they agree, and up to which they disagree."""
        if look is Look.SECOND:
            return self.whole, *_SECOND
        own = self.fine[: max(known, 1)]
        own = own[np.isfinite(own)]
        if not len(own):
            return self.fine, *_FIRST
        (least, most), (first, again) = _FIRST, _LEAST_OWN
        if look is Look.FIRST:
            return self.fine, min(least, max(_OF_OWN * median(own), first)), most
        typical = max(_OF_OWN * quantile(own, _TYPICAL), again)
        return self.fine, min(least, typical), min(most, typical)

    def carried_on(self, reach: Reach) -> Reach:
        """A reach that may end as far out as the disparity map has its surface going on, which only that can tell.

        Parameters
        ----------
        reach : Reach
            Along these lines.

        Returns
        -------
        Reach
            With a later `stop`, where past it ten lines or more speak for the surface: it was matched there. A line
            on which nothing was matched counts a quarter against it, one on which something else was, two.

        Examples
        --------
        >>> alike, flat = np.array([1.0] * 6 + [0.0] * 26), np.ones(32)
        >>> matched = np.array([50.0] * 24 + [20.0] * 8)
        >>> seen = Agreement(alike, alike, flat, flat, 50 * flat, matched, matched, 0 * flat)
        >>> seen.reach(4).stop, seen.carried_on(seen.reach(4)).stop
        (5, 23)
        """
        beyond = slice(reach.stop + 1, None)
        votes = np.where(self._matches, _GOES_ON, np.where(np.isnan(self.matched_px), _UNMATCHED, _ELSEWHERE))
        gained = np.cumsum(votes[beyond])
        if reach.past is not Past.OPEN or gained.max(initial=0.0) < _FATTENED:
            return reach
        return replace(reach, stop=reach.stop + 1 + int(gained.argmax()))

    def evidence(self) -> Float64:
        """How much each line speaks for lying on the surface, as a logarithm of odds; 0 where it is too plain to tell.

        Returns
        -------
        (lines,) float64
        """
        n = len(self.whole)
        tells = (self._has(_QUIET, n) & (self.whole > _EVEN)) | self._tells(n)
        return np.where(np.isfinite(self.whole) & tells, _WEIGHT * (self.whole - _EVEN), 0.0)

    def votes(self, known: int) -> Float64:
        """Whether each line speaks for the surface (1), against it (-1), or is too plain, or too noisy, to tell (0).

        Parameters
        ----------
        known : int
            So many lines from the first on lie on the surface: they tell its contrast.

        Returns
        -------
        (lines,) float64
        """
        least, most = _SECOND
        tells = self._has(_QUIET, known) & (self.contrast > _NOISY * self.noise)
        return np.where(tells & (self.whole > least), 1.0, np.where(tells & (self.whole < most), -1.0, 0.0))

    def matched_share(self) -> float:
        """Of the lines on which anything was matched, the share on which the surface was; NaN where nothing was.

        Returns
        -------
        float
        """
        known = np.isfinite(self.matched_px)
        return float(self._matches[known].mean()) if known.any() else np.nan

    def _tells(self, known: int) -> Bools:
        """Lines that, where they disagree, speak against the surface."""
        textured = self._has(np.where(self._matches, _MUDDY, _QUIET), known) & (self.contrast > _NOISY * self.noise)
        return textured | (self._farther & (self.contrast > _NOISY_FARTHER * self.noise))

    def _has(self, share: float | Float64, known: int) -> Bools:
        """Lines of such a share of the contrast that is typical of the first ones, at least."""
        typical = np.sort(self.contrast[: max(known, 1)])
        return np.asarray(self.contrast >= share * typical[round(_TYPICAL * (len(typical) - 1))])

    @property
    def _room_px(self) -> Float64:
        """By so much a disparity may differ that was matched on the surface."""
        return _NEARER * self.predicted_px + _NEARER_PX

    @property
    def _matches(self) -> Bools:
        """Lines where the surface was matched."""
        return np.asarray(np.abs(self.matched_px - self.predicted_px) < self._room_px)

    @property
    def _elsewhere(self) -> Bools:
        """Lines where another surface was matched."""
        return np.asarray(np.abs(self.matched_px - self.predicted_px) >= self._room_px)

    @property
    def _farther(self) -> Bools:
        """Lines where something farther was matched."""
        return np.asarray(self.matched_px < self.predicted_px - self._room_px)


def _first(flags: Bools, none: int) -> int:
    """Number of the first that is true."""
    return int(np.argmax(flags)) if flags.any() else none


def agreement(views: Views, world: World, points_mm: Float64) -> Agreement:
    """Compare both pictures along lines of a surface.

    Parameters
    ----------
    views : Views
    world : World
        One, real.
    points_mm : (lines, samples, 3) float64
        In the world.

    Returns
    -------
    Agreement

    Notes
    -----
    ``sum a b / sqrt(sum a^2 sum b^2)`` over a line's samples and those of its two neighbours on either side, of what
    `AlignedPair` keeps of each picture: brightness without its slow part, and its slope along the rows.
    """
    return Samples.of(views, world, points_mm).agreement()


@dataclass(frozen=True, eq=False)
class Samples:
    """Both pictures at samples of a surface, along neighbouring lines.

    Attributes
    ----------
    left, right : (..., lines, samples, 2) float32
        Brightness and slope; 0 where a picture does not show it.
    slope : (..., lines, samples) float32
        Of the left picture as it is (`Views.slope`).
    inside : (..., lines, samples) bool
        Both show it.
    predicted_px, matched_px : (..., lines, samples) float32
        Disparity of the surface, and that which was matched there.
    noise : float
        Of the slopes in `left` and `right`.
    """

    left: Float32
    right: Float32
    slope: Float32
    inside: Bools
    predicted_px: Float32
    matched_px: Float32
    noise: float

    @classmethod
    def of(cls, views: Views, world: World, points_mm: Float64) -> Samples:
        """Look points of a surface up, (..., lines, samples, 3).

        Parameters
        ----------
        views : Views
        world : World
        points_mm : (..., lines, samples, 3) float64

        Returns
        -------
        Samples
        """
        shape, pair = points_mm.shape[:-1], views.pair.levels[1]
        (u, right_u, v, shift), inside = _projected(views, world, points_mm.reshape(-1, shape[-1], 3))
        shown = inside[..., None]
        a, b = (cv2.remap(p, x, v, cv2.INTER_LINEAR) * shown for p, x in zip(pair, (u, right_u), strict=True))
        matched = cv2.remap(views.disparity_px, u, v, cv2.INTER_NEAREST)
        slope = cv2.remap(views.slope, u, v, cv2.INTER_LINEAR) * inside
        a, b = (x.reshape(*shape, 2) for x in (a, b))
        inside, slope = inside.reshape(shape), np.asarray(slope.reshape(shape), np.float32)
        return cls(a, b, slope, inside, shift.reshape(shape), matched.reshape(shape), views.slope_noise)

    def part(self, some: slice) -> Samples:
        """Some of each line's samples.

        Parameters
        ----------
        some : slice

        Returns
        -------
        Samples
        """
        cut = {each: getattr(self, each)[..., some] for each in ("slope", "inside", "predicted_px", "matched_px")}
        return replace(self, left=self.left[..., some, :], right=self.right[..., some, :], **cut)

    @cached_property
    def sums(self) -> Float64:
        """Sums of ``a b``, ``a a`` and ``b b``, of brightness and slope each, of the slope's square, and how many show.

        Each line's with its neighbours': (..., lines, 8).
        """
        a, b = self.left, self.right
        own = np.empty((*self.inside.shape[:-1], 8), np.float64)
        for k, (x, y) in enumerate(((a, b), (a, a), (b, b))):
            own[..., 2 * k : 2 * k + 2] = np.einsum("...sk,...sk->...k", x, y)
        own[..., 6] = (self.slope * self.slope).sum(axis=-1)
        own[..., 7] = np.count_nonzero(self.inside, axis=-1)
        found = own.copy()
        for step in range(1, _MARGIN + 1):
            found[..., step:, :] += own[..., :-step, :]
            found[..., :-step, :] += own[..., step:, :]
        return found

    @cached_property
    def correlations(self) -> Float64:
        """Of brightness and slope; NaN where a picture does not show a line. (..., lines, 2)."""
        ab, aa, bb = (self.sums[..., 2 * k : 2 * k + 2] for k in range(3))
        found = ab / np.sqrt(np.maximum(aa * bb, _LEAST_POWER))
        seen = np.count_nonzero(self.inside, axis=-1)
        found[seen <= _LEAST_SEEN * self.inside.shape[-1]] = np.nan
        return np.asarray(found)

    def agreement(self) -> Agreement:
        """What the lines say of the surface.

        Returns
        -------
        Agreement
        """
        alike, (_, _, _, slope_a, _, slope_b, slope, n) = self.correlations, np.moveaxis(self.sums, -1, 0)
        n = np.maximum(n, 1)
        contrast, relief = np.sqrt(np.minimum(slope_a, slope_b) / n), np.sqrt(slope / n)
        shown, seen = np.where(self.inside, self.matched_px, np.nan), np.count_nonzero(self.inside, axis=1)
        whole, predicted = (alike[..., 0] + alike[..., 1]) / 2, self.predicted_px.sum(axis=1) / np.maximum(seen, 1)
        matched, covering = (_medians(shown, share * seen) for share in (_SURFACE, _COVERS))
        noise = np.full(len(whole), self.noise)
        return Agreement(alike[..., 1], whole, contrast, relief, predicted, matched, covering, noise)


def _projected(views: Views, world: World, points_mm: Float64) -> tuple[list[Float32], Bools]:
    """Left and right column, row and disparity of points (lines, samples, 3); whether both pictures show them."""
    (height, width), shape = views.left.shape[:2], points_mm.shape[:-1]
    axes, f = world.axes, float(world.focal)
    seen = axes.T @ points_mm.reshape(-1, 3).T - (float(world.camera_height) * axes[2])[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        zoom = f / seen[2]
        u, v, shift = seen[0] * zoom, seen[1] * zoom + world.centre_px[1], zoom * float(world.scale / f) + world.offset
        u += world.centre_px[0]
        right_u = u - shift
        inside = (seen[2] > 0) & (np.minimum(u, right_u) > 1) & (np.maximum(u, right_u) < width - 2)
        inside &= (v > 1) & (v < height - 2)
    found = [np.where(inside, c, 0.0).astype(np.float32).reshape(shape) for c in (u, right_u, v, shift)]
    return found, inside.reshape(shape)


def _medians(values: Floats, least: Float64) -> Float64:
    """Lower median of each row without its NaN; NaN where fewer than so many remain."""
    known = np.count_nonzero(values == values, axis=1)
    ordered = np.sort(values, axis=1)  # NaN last
    found = ordered[np.arange(len(known)), np.maximum(known - 1, 0) // 2]
    return np.asarray(np.where(known < least, np.nan, found), np.float64)
