"""Which outline in the scan is which object in the pictures, though nobody knows exactly where the laser stands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stereolib.base import Float64
from stereolib.laser import Footprint
from stereolib.measurement.laser_on_floor import LaserOnFloor

_MAY_HAVE_MOVED = (60.0, np.radians(6.0))  # mm and rad, beyond what its calibration leaves open
_SAME_DISTANCE = 0.25  # scan and pair show the same object up to this relative difference
_LEAST_SPAN_RAD = 0.02  # an outline counts as so wide at least
_OVERLAP = 0.3  # share of the narrower one's bearings that both have in common
_WITHIN = 0.5  # share of a region's bearings that lie within an outline, of which it is then a piece


@dataclass(frozen=True)
class Place:
    """Where something stands, seen from below the left camera.

    Attributes
    ----------
    right_rad, left_rad : float
        Bearings of its ends; beyond pi for what stands straight behind.
    near_mm, far_mm : float
        Distances of its nearest and of its farthest part that is seen.
    """

    right_rad: float
    left_rad: float
    near_mm: float
    far_mm: float

    @classmethod
    def of(cls, points_mm: Float64) -> Place:
        """Of points on the floor.

        Parameters
        ----------
        points_mm : (N, 2) float64

        Returns
        -------
        Place

        Examples
        --------
        >>> Place.of(np.array([[500.0, 0.0], [500.0, 500.0]])).far_mm.__round__(3)
        707.107
        """
        bearings, distances = np.arctan2(points_mm[:, 1], points_mm[:, 0]), np.linalg.norm(points_mm, axis=1)
        if np.ptp(bearings) > np.pi:  # it stands behind, where bearings jump by a turn
            bearings = bearings % (2 * np.pi)
        return cls(*(float(v) for v in (bearings.min(), bearings.max(), distances.min(), distances.max())))

    @property
    def span_rad(self) -> float:
        """How wide it looks."""
        return self.left_rad - self.right_rad

    def overlap(self, other: Place, slack_rad: float = 0.0) -> float:
        """Share of the narrower one's bearings that both have in common.

        Parameters
        ----------
        other : Place
        slack_rad : float
            By which one of them may be turned.

        Returns
        -------
        float
            At most 1; negative where they are apart.
        """
        common = min(self.left_rad, other.left_rad) - max(self.right_rad, other.right_rad) + slack_rad
        widths = (max(place.span_rad, _LEAST_SPAN_RAD) for place in (self, other))
        return min(common / min(widths), 1.0)


@dataclass(frozen=True)
class Pairs:
    """Numbers of objects in the pictures and of outlines in the scan.

    Attributes
    ----------
    both, pieces : tuple of (picture, scan)
        One object, and what is a piece of such an outline.
    pictured, scanned : tuple of int
        What only one of them shows.
    warnings : tuple of str
    """

    both: tuple[tuple[int, int], ...]
    pictured: tuple[int, ...]
    scanned: tuple[int, ...]
    warnings: tuple[str, ...]
    pieces: tuple[tuple[int, int], ...] = ()


def pair_up(
    pictured: Sequence[Place],
    footprints: Sequence[Footprint],
    laser: LaserOnFloor,
    *,
    boxes: Sequence[bool] | None = None,
) -> Pairs:
    """Pair objects by bearing and distance, the most alike first.

    Parameters
    ----------
    pictured : sequence of Place
    footprints : sequence of Footprint
    laser : LaserOnFloor
        Where it was calibrated; it may have moved by 60 mm and 6 degrees.
    boxes : sequence of bool, optional
        Which objects the pictures alone show as boxes; by default all.

    Returns
    -------
    Pairs

    Notes
    -----
    Two are one object if their distances differ by less than a quarter and their bearings overlap, give or take what
    the laser may have moved. Of all such pairs that which differs least, ``distance / 25 % + bearing / slack``, is
    taken first. Where nothing stands alone nothing is said, nor of an outline that is an object of the pictures: what
    these show behind or above it the scan cannot see; nor of what the pictures do not show as a box: it may be matched
    by chance. A piece of such an outline is no object of its own; a box is a piece only of what the pictures show as a
    box, too.
    """
    scanned = [Place.of(laser.points_mm(footprint.segment.points_mm)) for footprint in footprints]
    all_pairs = [(i, j) for i in range(len(pictured)) for j in range(len(scanned))]
    unlike = {(i, j): _unlikeness(pictured[i], scanned[j]) for i, j in all_pairs}
    both = list[tuple[int, int]]()
    for i, j in sorted(all_pairs, key=lambda pair: unlike[pair]):
        if np.isfinite(unlike[i, j]) and i not in {a for a, _ in both} and j not in {b for _, b in both}:
            both.append((i, j))
    is_box = [True] * len(pictured) if boxes is None else boxes
    alone = [i for i in range(len(pictured)) if i not in {a for a, _ in both}]
    rest = [j for j in range(len(scanned)) if j not in {b for _, b in both}]
    sure = [(i, j) for i, j in all_pairs if alone and is_box[i] and j in rest]
    warnings = [_said_of(pictured[i], scanned[j]) for i, j in sure]
    may_be = [(i, j) for i in alone for whole, j in both if is_box[whole] or not is_box[i]]
    pieces = [(i, j) for i, j in may_be if _is_piece(pictured[i], scanned[j])]
    alone = [i for i in alone if i not in {piece for piece, _ in pieces}]
    return Pairs(tuple(both), tuple(alone), tuple(rest), tuple(text for text in warnings if text), tuple(pieces))


def _slack_rad(scanned: Place) -> float:
    """By how much bearings of an outline in the scan may be off."""
    shift_mm, turn_rad = _MAY_HAVE_MOVED
    return float(turn_rad + shift_mm / scanned.near_mm)


def _difference(seen: Place, scanned: Place) -> float:
    """Of both distances, as a share."""
    return abs(seen.near_mm - scanned.near_mm) / scanned.near_mm


def _unlikeness(seen: Place, scanned: Place) -> float:
    """How unlike distances and bearings are, in what is allowed of either; infinite if they are not of one object."""
    slack, off = _slack_rad(scanned), _difference(seen, scanned)
    if seen.overlap(scanned, slack) <= _OVERLAP or off > _SAME_DISTANCE:
        return np.inf
    middle = abs(seen.left_rad + seen.right_rad - scanned.left_rad - scanned.right_rad) / 2
    return off / _SAME_DISTANCE + middle / slack


def _said_of(seen: Place, scanned: Place) -> str:
    """What to say of two things in one direction at different distances; empty of others."""
    if seen.overlap(scanned) <= _OVERLAP or _difference(seen, scanned) <= _SAME_DISTANCE:
        return ""
    why = f"the scan shows something at {scanned.near_mm:.0f} mm and the pair at {seen.near_mm:.0f} mm"
    return f"in one direction {why}: were they taken at the same time, by this rig? They are not combined"


def _is_piece(seen: Place, whole: Place) -> bool:
    """What the pictures show is a piece of an outline that the scan shows whole."""
    within = (1 - _SAME_DISTANCE) * whole.near_mm < seen.near_mm < (1 + _SAME_DISTANCE) * whole.far_mm
    return within and seen.overlap(whole) > _WITHIN
