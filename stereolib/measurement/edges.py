"""Straight edges to a fraction of a pixel: the one of many parallel lines along which both pictures have an edge."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np

from stereolib.base import Bools, Float32, Float64, Floats, Ints, median
from stereolib.measurement.light import Light, grey_step, light_at

#: Neighbouring lines are so far apart in the picture, px.
STEP_PX = 0.25
#: An edge whose place is known so well was seen along its whole line: it is there, and straight.
SHARP_PX = 0.5
#: An interval over its standard deviation.
UNIFORM = float(np.sqrt(12.0))
_SPAN_PX = 1.5  # lines are compared at this distance from each other: the width of a webcam's edge
_SAMPLES = 96  # of each line
_GROUPS = 8  # of samples, each located by itself: their scatter is the edge's
_LEAST_SAMPLES = 8
_APART, _BESIDE = 6, 16  # which is looked at so many lines from it, over so many
_LEAST = 1e-3  # of a difference: what is less is none
_NONE = np.zeros(1)
_K = np.arange(-2.0, 3.0)  # samples about a peak's highest one: half a pixel either way
_BEND, _SLOPE, _ = np.linalg.pinv(np.vander(_K, 3))  # give those of the parabola that fits them best
_LEAST_BEND = 1e-9
_FLOOR = 0.016  # least standard deviation of an edge, of its width: what blur and staircase do to all of it alike


@dataclass(frozen=True)
class Peak:
    """Where an edge was found among parallel lines.

    Attributes
    ----------
    position_px, std_px : float
        Its place across, and its standard deviation.
    contrast : float
        How much the edge stands out: its difference over the median one.
    rivals_px : float
        Part of `std_px`: how far other peaks lie, which may be the edge as well.
    log_odds : (lines,) float64
        Of each line to be the edge, against the likeliest one.
    is_outermost : bool
        It is the last line that was looked at: the edge may lie beyond.
    """

    position_px: float
    std_px: float
    contrast: float
    rivals_px: float
    log_odds: Float64 = field(default_factory=lambda: np.zeros(0), repr=False, compare=False)
    is_outermost: bool = False


@dataclass(frozen=True, eq=False)
class ParallelLines:
    """Lines in a picture, `STEP_PX` apart, where the left one has them, and how far to the left the right one.

    Attributes
    ----------
    ends_px : (lines, 2, 2) float64
    shift_px : (lines, 2) float64
        Disparity at both ends; along a straight line in space it is linear in the pixel.
    off_px : (lines,) float64
        Their places across.
    """

    ends_px: Float64
    shift_px: Float64
    off_px: Float64

    def some(self, kept: Bools) -> ParallelLines:
        """Those of a mask (lines,)."""
        return ParallelLines(self.ends_px[kept], self.shift_px[kept], self.off_px[kept])


class Powers(NamedTuple):
    """How the odds of two lines follow from what they show.

    Attributes
    ----------
    strength : float
        Power of the ratio of their strengths.
    step : float
        Power of the ratio of the texture's strengths on both sides of a line.
    """

    strength: float
    step: float


def locate_edge(light: Light, lines: ParallelLines, belief: Float64, powers: Powers) -> Peak | None:
    """Find the one of many parallel lines along which the pictures have an edge.

    Parameters
    ----------
    light : (left, right), each (H, W, 3) or (H, W) uint8 or float32, RawPicture or None
        Rectified pictures, or their light (`stereolib.rig.to_light`); None for one that is not looked at.
    lines : ParallelLines
    belief : (lines,) float64
        How likely each of them is the edge, before the pictures are looked at.
    powers : Powers

    Returns
    -------
    Peak or None
        None where fewer than 8 samples lie inside either picture.

    Notes
    -----
    ``E(k) = mean over samples and colours of |I(k + m) - I(k - m)|`` of the light I, 2 m steps being 1.5 px; its
    geometric mean over both pictures and eight groups of samples, so that what only one of them, or a part of the line,
    shows is none. On a texture neighbouring lines resemble each other, across an outline they do not, and often one
    side of it has more texture than the other: the odds of two lines are a power of their strengths' ratio, times one
    of E's beside them, larger over smaller, times their belief's. To each E a grey level is added for that, in light:
    what steps by less tells nothing. A parabola refines the likeliest.

    A lens blurs light, what a webcam does to its picture afterwards blurs grey levels, and the same edge stands
    elsewhere in light than in grey levels, of which the root of light is near enough: the wider the blur and the larger
    the step, the farther, and what is darker than its surroundings comes out too large or too small. Nobody knows how
    much of the blur is whose: the edge lies anywhere between both places, ``(a + b) / 2``, with
    ``|a - b| / sqrt(12)`` in its deviation. The rest of that comes from eight groups of samples, each located by
    itself, from the edge's width, and from rival peaks.
    """
    half = max(1, round(_SPAN_PX / 2 / STEP_PX))
    seen = _light_along(light, lines)
    if not seen:
        return None
    groups = _differences(seen, half)
    middle = lines.off_px[half:-half]
    strength = _mean(groups)
    told = strength + _grey_level(seen)
    likely = powers.strength * np.log(told) + powers.step * _steps(told) + np.log(belief[half:-half])
    best = int(likely.argmax())
    log_odds = np.pad(likely - likely[best], half, mode="edge")
    start = max(best - 3 * half, 0)
    best = start + int(strength[start : best + 3 * half + 1].argmax())  # the prior chooses the peak, it moves none
    first, last = max(best - 2 * half, 0), best + 2 * half + 1
    own = middle[first] + STEP_PX * _highest(groups[first:last])
    beside = max(best - len(_K) // 2, 0)
    in_light = middle[beside] + STEP_PX * _highest(strength[beside : best + len(_K) // 2 + 1, None])[0]
    grey = _mean(_differences([np.sqrt(values[first : last + 2 * half]) for values in seen], half))
    in_grey = middle[first] + STEP_PX * _highest(grey[:, None])[0]
    scatter = 1.48 * median(np.abs(own - median(own))) / (_GROUPS / 1.57) ** 0.5
    blur = (in_grey - in_light) / UNIFORM
    others = rivals(likely - likely[best], middle - middle[best], strength)
    std = float(np.sqrt(scatter**2 + blur**2 + (_FLOOR * _width_px(strength, best)) ** 2 + others**2))
    contrast = float(told[best] / median(told))
    is_outermost = best in (0, len(strength) - 1)
    return Peak(float(in_light + in_grey) / 2, std, contrast, others, log_odds, is_outermost)


def _light_along(light: Light, lines: ParallelLines) -> list[Float32]:
    """Light at places along the lines, in either picture that shows them: (lines, values) each."""
    share = ((np.arange(_SAMPLES, dtype=np.float32) + 0.5) / _SAMPLES)[None]

    def along(ends: Float64) -> Float32:
        a, b = ends.astype(np.float32).T[..., None]
        return np.asarray(a + (b - a) * share)

    u, v, shift = along(lines.ends_px[..., 0]), along(lines.ends_px[..., 1]), along(lines.shift_px)
    found: list[Float32] = []
    for picture, x in zip(light, (u, u - shift), strict=True):
        if picture is None:
            continue
        height, width = picture.shape[:2]
        first, last = (np.array([c[k] for c in (x, v)]) for k in (0, -1))  # between them lie all others
        limits = np.array([[width - 2], [height - 2]])
        inside = np.all((np.minimum(first, last) > 1) & (np.maximum(first, last) < limits), axis=0)
        if (count := np.count_nonzero(inside)) < _LEAST_SAMPLES:
            continue
        mine, y = (x, v) if count == _SAMPLES else (x[:, inside], v[:, inside])
        found.append(light_at(picture, mine, y).reshape(len(x), -1))
    return found


def _differences(seen: list[Float32], half: int) -> Float32:
    """How much neighbouring lines differ, in all pictures that show them: (lines - 2 half, groups)."""
    differences = [cv2.absdiff(values[2 * half :], values[: -2 * half]) for values in seen]
    first, *second = (cv2.resize(each, (_GROUPS, len(each)), interpolation=cv2.INTER_AREA) for each in differences)
    return np.asarray(np.sqrt(first * second[0]) if second else first)


def _grey_level(seen: list[Float32]) -> float:
    """One grey level, as light, where the lines lie: JPEG leaves less of the noise that would hide faint steps."""
    return grey_step(max(float(np.mean([values.mean() for values in seen])), _LEAST))


def _mean(groups: Float32) -> Float64:
    """The geometric mean over groups of samples."""
    return np.asarray(np.exp(np.log(np.maximum(groups, _LEAST)).mean(axis=1)))


def _width_px(strength: Float64, best: int) -> float:
    """Full width of a peak at half its height."""
    below = np.flatnonzero(strength < strength[best] / 2)
    left, right = below[below < best].max(initial=-1), below[below > best].min(initial=len(strength))
    return STEP_PX * float(right - left - 1)


def _steps(strength: Float64) -> Float64:
    """Size of the step in texture at each line: ``|log(E before / E after)|`` of their means; 0 near either end."""
    total = np.concatenate([_NONE, np.cumsum(strength)])
    first, last, count, shown = _beside(len(strength))
    means = np.maximum((total[last] - total[first]) / count, _LEAST)
    return np.where(shown, np.abs(np.log(means[0] / means[1])), 0.0)


@lru_cache(maxsize=256)
def _beside(n: int) -> tuple[Ints, Ints, Ints, Bools]:
    """Lines before and after each of n: first, one after the last, count, (2, n) each; whether both are enough."""
    at = np.arange(n)
    first, last = np.clip([[at - _APART - _BESIDE, at + _APART + 1], [at - _APART, at + _APART + 1 + _BESIDE]], 0, n)
    count = last - first
    return first, last, np.maximum(count, 1), count.min(axis=0) > _APART


def rivals(log_odds: Float64, off: Float64, height: Float64) -> float:
    """How far other peaks lie from one, each with its odds: the root of the mean square.

    Parameters
    ----------
    log_odds, off : (N,) float64
        Against that peak, and where they are from it, in any unit.
    height : (N,) float64
        The curve whose peaks are meant.

    Returns
    -------
    float
        In the unit of `off`.
    """
    inner = height[1:-1]
    peaks = 1 + np.flatnonzero((inner > height[:-2]) & (inner >= height[2:]))
    weight = np.exp(log_odds[peaks])
    return float(np.sqrt((weight * off[peaks] ** 2).sum() / max(weight.sum(), 1.0)))


def _highest(values: Floats) -> Float64:
    """Where each column (N, k) is highest, by the parabola that fits it and two samples on either side best: (k,).

    Between a picture's pixels light is interpolated, so that a peak has corners, and is flat for some samples at the
    top: the parabola through three of them errs by up to an eighth of a pixel.
    """
    columns, at = np.arange(values.shape[1]), values.argmax(axis=0)
    reach = len(_K) // 2
    inside = (at >= reach) & (at < len(values) - reach)
    around = values[np.clip(at + np.arange(-reach, reach + 1)[:, None], 0, len(values) - 1), columns]
    offset = _SLOPE @ around / np.maximum(-2 * (_BEND @ around), _LEAST_BEND)
    return np.asarray(at + np.where(inside, np.clip(offset, -reach, reach), 0.0))
