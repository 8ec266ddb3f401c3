"""One object seen from several places: each sighting brought into the map, and all of them fused.

A box is ``(x, y, yaw, a, b, height)``: its centre, the direction of its side a, and its sides. A station that saw two
faces tells all six; one that saw a single face tells where the middle of that side lies and how long it is, so that a
face from another side brings the depth that the first one hides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np

from stereolib.base import Float64, Ints, direction, turn_2d, wrap_rad
from stereolib.measurement import SIZE_NAMES, UNSURE_MM, WORST_STD, MeasuredObject, Reason, Why

_QUARTER = np.pi / 2
GATE = 4.0  # standard deviations: chance exceeds them once in 16000 times
MAX_SIZE_MM = 800.0  # deepest box that two opposite faces are taken to belong to
_STEPS = 6  # of Gauss-Newton; three reach rounding
_THIN_MM = 20.0  # two faces that lie nearer are one, seen twice
_RING = 24  # corners of a circle's outline
_BOX_ORDER = [0, 1, 2, 3, 4, 5]  # of values: x, y, yaw, length, width, height
_CIRCLE_ORDER = [0, 1, 2, 3, 3, 5]  # of a circle: the diameter is both
_TURNED_ORDER = [0, 1, 2, 4, 3, 5]  # of a box turned by a quarter: length and width change places
_NOBODY_SAW = dict(zip(SIZE_NAMES, (Reason.DEPTH_HIDDEN, Reason.DEPTH_HIDDEN, Reason.NOT_IN_PICTURE), strict=True))


@dataclass(frozen=True, eq=False)
class Sighting:
    """What one station tells of one object, in the map's frame.

    Attributes
    ----------
    station : int
        Its number, from 1.
    measured : MeasuredObject
        In the map's frame, its deviations without the station's own.
    values : (6,) float64
        x, y, yaw, length, width, height; mm and rad, NaN where unknown.
    covariance : (6, 6) float64
        Of `values`, with what is not known of the station's pose; 0 where a value is unknown.
    common : (6, m) float64
        What `values` are off for one standard deviation of each error that all stations share, as of their
        calibration; a part of `covariance`.
    from_mm : (2,) float64
        Where the station stands.
    name : str
        What the station is called.
    """

    station: int
    measured: MeasuredObject
    values: Float64
    covariance: Float64
    common: Float64
    from_mm: Float64
    name: str

    @classmethod
    def of(
        cls, station: int, visible: MeasuredObject, pose: Float64, pose_covariance: Float64, name: str = ""
    ) -> Sighting:
        """Bring an object from the floor frame of a station into the map.

        Parameters
        ----------
        station : int
        visible : MeasuredObject
            In the station's frame.
        pose : (x_mm, y_mm, yaw_rad)
        pose_covariance : (3, 3) array
        name : str
            What the station is called; its number if empty.

        Returns
        -------
        Sighting

        Notes
        -----
        ``p = t + R(yaw) q``; the covariance of (x, y, yaw) is ``R S R' + J C J'`` with ``J = d(p, yaw) / d pose``.
        """
        R = turn_2d(pose[2])
        lever = R @ visible.position_mm
        yaw = float(wrap_rad(visible.yaw_rad + pose[2], np.pi))
        covariance = np.zeros((6, 6))
        covariance[:2, :2] = R @ visible.position_covariance @ R.T
        covariance[2, 2] = visible.yaw_std_rad**2
        covariance[3:, 3:] = visible.covariance
        there = replace(
            visible,
            position_mm=pose[:2] + lever,
            position_covariance=covariance[:2, :2].copy(),
            yaw_rad=yaw,
            outline_mm=pose[:2] + visible.outline_mm @ R.T,
        )
        J = np.zeros((6, 3))
        J[:3] = [[1, 0, -lever[1]], [0, 1, lever[0]], [0, 0, 1]]
        values = np.array([*there.position_mm, yaw, *visible.size_mm])
        covariance = np.nan_to_num(covariance) + J @ pose_covariance @ J.T
        common = np.vstack([np.zeros_like(visible.common_mm), visible.common_mm])
        return cls(station, there, values, covariance, common, np.asarray(pose[:2], float), name or str(station))

    @property
    def spread_mm(self) -> float:
        """Root mean square deviation of the position, mm."""
        return float(np.sqrt(np.trace(self.covariance[:2, :2])))


@dataclass(frozen=True, eq=False)
class MapObject:
    """An object of the map.

    Attributes
    ----------
    fused : MeasuredObject
        In the map's frame.
    stations : tuple of int
        Whose sightings went into it.
    conflicts : tuple of str
        Sightings that disagree and were left out, each with both values.
    sightings : tuple of Sighting
        All of them.
    """

    fused: MeasuredObject
    stations: tuple[int, ...]
    conflicts: tuple[str, ...]
    sightings: tuple[Sighting, ...]


def merge_sightings(sightings: Sequence[Sighting]) -> MapObject:
    """Merge sightings of one object, weighting them by their inverse covariances.

    What fits the others with less than the probability of four standard deviations is left out and reported.

    Parameters
    ----------
    sightings : sequence of Sighting

    Returns
    -------
    MapObject

    Notes
    -----
    Least squares of ``(y - f(x) - C e)' (S - C C')^-1 (y - f(x) - C e)``, summed, plus ``e' e``, by Gauss-Newton: f
    tells what a station would see of the box x, and e are the errors that all stations share, in standard deviations,
    so that no number of sightings averages these away. Where chi square exceeds its degrees of freedom, what is not
    shared of the covariance grows by their ratio.
    """
    from scipy.special import chdtri, ndtr

    kept, dropped = _of_one_kind(sightings)
    most = [chdtri(max(n, 1), 2 * ndtr(-GATE)) for n in range(6 * len(kept) + 1)]  # chi square that chance leaves
    while (solved := _solve(kept)).chi2 > most[max(solved.freedom, 0)] and len(kept) > 1:
        rest = [_solve([s for s in kept if s is not out]) for out in kept]
        # What fits, tells most and fits best stays; of two alone, the surer one.
        doubt = [
            (r.chi2 > most[max(r.freedom, 0)], int(np.isnan(r.x).sum()), r.chi2 if len(kept) > 2 else -out.spread_mm)
            for out, r in zip(kept, rest, strict=True)
        ]
        dropped.append(kept.pop(min(range(len(kept)), key=doubt.__getitem__)))
    grown = solved.grown(max(1.0, solved.chi2 / solved.freedom) if solved.freedom > 0 else 1.0)
    fused = _without_vague(_fused(kept, grown))
    conflicts = tuple(_conflict(out, fused, grown) for out in dropped)
    return MapObject(fused, tuple(s.station for s in kept), conflicts, tuple(sightings))


def _of_one_kind(sightings: Sequence[Sighting]) -> tuple[list[Sighting], list[Sighting]]:
    """Sightings that can be fused, and those of another shape: what is round for one station is no box for another.

    An irregular outline goes with all; it tells the height.
    """
    kinds = [{"face": "box"}.get(s.measured.shape, s.measured.shape) for s in sightings]
    count = {kind: kinds.count(kind) for kind in ("box", "circle") if kind in kinds}
    if not count:
        return list(sightings), []
    most = max(count, key=count.__getitem__)
    fits = [kind in (most, "irregular") for kind in kinds]
    kept, others = ([s for s, f in zip(sightings, fits, strict=True) if f is kind] for kind in (True, False))
    return kept, others


def may_be_same(known: MapObject, other: Sighting) -> bool:
    """Find out whether a sighting may be of an object: a middle lies in an outline, or their faces make one box.

    Outlines are widened by four standard deviations of their places.

    Parameters
    ----------
    known : MapObject
    other : Sighting

    Returns
    -------
    bool
    """
    if known.fused.shape == other.measured.shape == "face":
        x, *_, chi2, freedom = _solve([*(s for s in known.sightings if s.station in known.stations), other])
        deep = np.all(np.isnan(x[3:5]) | (x[3:5] > _THIN_MM)) and np.nanmax(x[3:5]) < MAX_SIZE_MM
        return bool(chi2 < GATE**2 * max(freedom, 1) / 2 and deep)
    reach = GATE * float(np.hypot(other.spread_mm, np.sqrt(np.trace(np.nan_to_num(known.fused.position_covariance)))))
    pairs = (known.fused, other.measured), (other.measured, known.fused)
    return any(is_within(point.position_mm, outline.outline_mm, reach) for point, outline in pairs)


def is_within(point: Float64, outline: Float64, reach_mm: float) -> bool:
    """Tell whether a point lies in an outline or near it.

    Parameters
    ----------
    point : (2,) float64, mm
    outline : (N, 2) float64, mm
    reach_mm : float

    Returns
    -------
    bool
        Not where a coordinate is unknown.
    """
    if len(outline) < 3 or not (np.isfinite(point).all() and np.isfinite(outline).all()):
        return False
    hull = cv2.convexHull(outline.astype(np.float32))
    return cv2.pointPolygonTest(hull, (float(point[0]), float(point[1])), True) > -reach_mm


class _Solved(NamedTuple):
    """Best box (6,), NaN in what nobody saw, and the shared errors (m,); the covariance of both, chi square."""

    x: Float64
    errors: Float64
    covariance: Float64
    chi2: float
    freedom: int

    @property
    def common(self) -> Float64:
        """What the box is off for one standard deviation of each shared error. (6, m)."""
        return -self.covariance[:6, 6:]

    def grown(self, times: float) -> _Solved:
        """The same, with what is not shared of the box's covariance so many times as large."""
        shared, covariance = self.common @ self.common.T, self.covariance.copy()
        covariance[:6, :6] = times * (covariance[:6, :6] - shared) + shared
        return self._replace(covariance=covariance)


def _solve(sightings: Sequence[Sighting]) -> _Solved:
    """The box that fits all of them best."""
    x = _start(sightings)
    m = sightings[0].common.shape[1]
    errors, known = np.zeros(m), np.concatenate([np.isfinite(x), np.full(m, True)])
    of_known = np.ix_(known, known)
    N, chi2, rows = np.eye(6 + m), 0.0, 0
    for _ in range(_STEPS):
        N, g, chi2, rows = (
            np.diag([0.0] * 6 + [1.0] * m),
            np.concatenate([np.zeros(6), -errors]),
            float(errors @ errors),
            0,
        )
        for sighting in sightings:
            residual, J, weight, _ = _residual(sighting, x, errors)
            N += J.T @ weight @ J
            g += J.T @ weight @ residual
            chi2 += float(residual @ weight @ residual)
            rows += len(residual)
        step = np.zeros(6 + m)
        step[known] = np.linalg.lstsq(N[of_known], g[known], rcond=1e-12)[0]
        x, errors = x + step[:6], errors + step[6:]
    covariance = np.full(N.shape, np.nan)
    covariance[of_known] = np.linalg.pinv(N[of_known], rcond=1e-12, hermitian=True)
    return _Solved(x, errors, covariance, float(chi2), rows - int(known[:6].sum()))


def _start(sightings: Sequence[Sighting]) -> Float64:
    """A first box: the surest sighting of two faces, or what the faces together make."""
    whole = [s for s in sightings if s.measured.shape in ("box", "circle") and np.isfinite(s.values[:2]).all()]
    faces = [s for s in sightings if s.measured.shape == "face"]  # an irregular outline tells no direction
    first = min(whole or faces or sightings, key=lambda s: (np.isnan(s.values[3:]).sum(), s.spread_mm))
    x = first.values.copy()
    if first.measured.shape == "circle":
        x[4] = np.nan  # the same diameter once more
    if first.measured.shape == "face":
        x[2] = _outward(first)  # side a is the hidden depth
        x[3] = np.nan
        for other in faces:
            side = _side(other, x[2])
            if side % 2:
                x[3] = other.values[4] if np.isfinite(other.values[4]) else x[3]
            elif side == 2:
                x[3] = abs((first.values[:2] - other.values[:2]) @ direction(x[2]))
        if np.isfinite(x[3]):
            x[:2] -= x[3] / 2 * direction(x[2])
    for k in (3, 4, 5):
        if np.isnan(x[k]) and not (k == 4 and first.measured.shape == "circle"):
            known = [s.values[_order(s, x[2])][k] for s in sightings if s.measured.shape != "face" or k == 5]
            x[k] = next((value for value in known if np.isfinite(value)), x[k])
    return x


def _residual(sighting: Sighting, x: Float64, errors: Float64) -> tuple[Float64, Float64, Float64, Ints]:
    """What a sighting misses of the box, its Jacobian with box and shared errors, its weights, which values it knows.

    Its weights are those of what it does not share with the others.
    """
    order, faces = _order(sighting, x[2]), sighting.measured.shape == "face"
    expected, J = x.copy(), np.eye(6)
    if faces:
        side = _side(sighting, x[2])
        depth = 3 + side % 2
        if np.isfinite(x[depth]):  # the middle of that side
            out, across = direction(x[2] + side * _QUARTER), direction(x[2] + (side + 1) * _QUARTER)
            expected[:2] += x[depth] / 2 * out
            J[:2, depth], J[:2, 2] = out / 2, x[depth] / 2 * across
    y, S, C = sighting.values[order].copy(), sighting.covariance[np.ix_(order, order)], sighting.common[order]
    S = S - C @ C.T
    known = np.isfinite(y) & np.isfinite(expected)
    if sighting.measured.shape == "irregular":
        known[:5] = False  # its readings are those of the near side
    if faces:
        known[3 + side % 2] = False
        if np.isnan(sighting.values[4]):  # an end is hidden: only the line counts
            T = np.eye(6)
            T[:2, :2] = [direction(x[2] + side * _QUARTER), direction(x[2] + (side + 1) * _QUARTER)]
            y, expected, J, S, C = T @ np.nan_to_num(y), T @ np.nan_to_num(expected), T @ J, T @ S @ T.T, T @ C
            known[1] = False
    residual = y - expected - C @ errors
    residual[2] = wrap_rad(residual[2], _QUARTER)
    weight = np.linalg.inv(S[np.ix_(known, known)])
    J = np.where(np.isfinite(x), J[known], 0)
    return residual[known], np.hstack([J, C[known]]), weight, np.flatnonzero(known)


def _order(sighting: Sighting, yaw: float) -> Ints:
    """Which of its values are the box's: length and width change places where it is turned by a quarter."""
    if sighting.measured.shape == "face":  # its width lies across the way it faces
        swap = _side(sighting, yaw) % 2 == 1
    else:
        swap = bool(np.isfinite(sighting.values[2]) and round((sighting.values[2] - yaw) / _QUARTER) % 2)
    return np.array(_TURNED_ORDER if swap else _BOX_ORDER)


def _outward(sighting: Sighting) -> float:
    """Direction in which a face looks: at right angles to it, to where it was seen from. rad."""
    angle = sighting.values[2] + _QUARTER
    towards = sighting.from_mm - sighting.values[:2]
    return float(angle if direction(angle) @ towards > 0 else angle + np.pi)


def _side(sighting: Sighting, yaw: float) -> int:
    """Which side of a box a face is: 0 the one towards yaw, then counter-clockwise."""
    return round((_outward(sighting) - yaw) / _QUARTER) % 4


def _fused(kept: Sequence[Sighting], solved: _Solved) -> MeasuredObject:
    """The fused object: its length the longer side, its outline made from what is known."""
    x, covariance = solved.x, solved.covariance[:6, :6]
    shapes = [s.measured.shape for s in kept]
    if len(kept) == 1:
        S = kept[0].covariance
        return replace(kept[0].measured, position_covariance=S[:2, :2], yaw_std_rad=float(np.sqrt(S[2, 2])))
    shape = next(kind for kind in ("box", "circle", "face", "irregular") if kind in shapes)
    if shape == "face" and np.isfinite(x[3:5]).all():
        shape = "box"
    order, yaw = _BOX_ORDER, x[2]
    if shape == "face":
        yaw = x[2] + _QUARTER
    elif shape == "box" and np.nan_to_num(x[4], nan=-1) > np.nan_to_num(x[3], nan=-1):
        order, yaw = _TURNED_ORDER, x[2] + _QUARTER
    if shape == "circle":
        order = _CIRCLE_ORDER
    size, S, common = x[order][3:], covariance[np.ix_(order, order)], solved.common[order][3:]
    if shape == "circle":
        outline = x[:2] + x[3] / 2 * np.stack([direction(a) for a in np.arange(_RING) * np.pi / (_RING / 2)])
    elif shape == "irregular":
        outline = max((s.measured.outline_mm for s in kept if s.measured.shape == shape), key=len)
    else:
        along, across = (
            np.nan_to_num(size[0]) / 2 * direction(yaw),
            np.nan_to_num(size[1]) / 2 * direction(yaw + _QUARTER),
        )
        ends = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        outline = x[:2] + np.array([i * along + j * across for i, j in ends])
        if shape == "face":
            outline = x[:2] + size[1] / 2 * np.array([-direction(yaw), direction(yaw)])
    told = {name: why for s in kept for name, why in s.measured.reasons.items()}
    unknown = [name for name, value in zip(SIZE_NAMES, size, strict=True) if np.isnan(value)]
    wide = [name for name, variance in zip(SIZE_NAMES, np.diag(S)[3:], strict=True) if variance >= UNSURE_MM**2]
    round_ = shape == "circle"
    return MeasuredObject(
        shape=shape,
        size_mm=size,
        covariance=S[3:, 3:],
        position_mm=x[:2],
        position_covariance=S[:2, :2],
        yaw_rad=np.nan if round_ else float(wrap_rad(float(yaw), np.pi)),
        yaw_std_rad=np.nan if round_ else float(np.sqrt(S[2, 2])),
        outline_mm=outline,
        sources={f"station {s.name}": s.measured.sources["lines"] for s in kept if "lines" in s.measured.sources},
        reasons={name: told.get(name, Why(_NOBODY_SAW[name])) for name in unknown},
        unsure={name: why for s in kept for name, why in s.measured.unsure.items() if name in wide},
        common_mm=np.where(np.isnan(size)[:, None], 0.0, common),
    )


def _without_vague(found: MeasuredObject) -> MeasuredObject:
    """An object without sizes that are known too badly, as unsure stations and contradictions make them."""
    for name, value, std in zip(SIZE_NAMES, found.size_mm, found.std_mm, strict=True):
        if std > WORST_STD * value:
            found = found.without(name, Why(Reason.TOO_UNCERTAIN, f"{value:.0f} ± {std:.0f} mm"))
    return found


def _conflict(out: Sighting, fused: MeasuredObject, solved: _Solved) -> str:
    """Say by what a sighting differs most, with both values."""
    if "circle" in (out.measured.shape, fused.shape) and out.measured.shape != fused.shape:
        return f"station {out.name} sees a {out.measured.shape}, the others a {fused.shape}"
    x = solved.x
    residual, J, weight, which = _residual(out, x, solved.errors)
    S = np.linalg.inv(weight) + J @ np.nan_to_num(solved.covariance) @ J.T
    rows = np.flatnonzero(np.abs(J[:, :6]).max(axis=1) > 0)
    worst = int(rows[np.argmax(np.abs(residual[rows]) / np.sqrt(np.diag(S)[rows]))])
    k = int(which[worst])
    unit = 180 / np.pi if k == 2 else 1.0
    off, others, std = residual[worst] * unit, x[k] * unit, float(np.sqrt(S[worst, worst])) * unit
    if k < 2:
        what = f"it {abs(off):.0f} mm from where the others have it"
    else:
        name, unit_name = {2: ("its yaw", "degrees"), 5: ("its height", "mm")}.get(k, ("one of its sides", "mm"))
        what = f"{name} as {others + off:.0f} {unit_name}, the others as {others:.0f}"
    return f"station {out.name} sees {what}: {abs(off) / std:.1f} standard deviations apart, left out"
