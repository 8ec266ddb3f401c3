"""What notebook 08 holds against the title and the outlook of the paper."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from stereolib.base import Float64
from stereolib.measurement import MeasuredObject

_MM_PER_CM = 10.0


def map_of_boxes(
    places_mm: ArrayLike, sizes_mm: ArrayLike, true_places_mm: ArrayLike, true_sizes_mm: ArrayLike
) -> dict[str, float]:
    """Hold the boxes of a map against those that stand in the room.

    Parameters
    ----------
    places_mm : (n, 2) array_like, mm
        Of the boxes in the map.
    sizes_mm : (n, 3) array_like, mm
        Their length, width and height; NaN is unknown.
    true_places_mm, true_sizes_mm : (m, 2) and (m, 3) array_like, mm

    Returns
    -------
    dict
        ``boxes``, how many of the room's stand in the map, with all sizes and the nearest to a place of their own;
        ``place_mm, height_mm``, the largest error of a place and of a height among them.

    Examples
    --------
    >>> map_of_boxes([[3, 4]], [[10, 10, 9]], [[0, 0], [900, 0]], [[10, 10, 10], [10, 10, 10]])
    {'boxes': 1.0, 'place_mm': 5.0, 'height_mm': 1.0}
    """
    places, sizes, true_places, true_sizes = (
        np.asarray(v, np.float64) for v in (places_mm, sizes_mm, true_places_mm, true_sizes_mm)
    )
    whole = np.isfinite(sizes).all(axis=1)
    if not whole.any():
        return {"boxes": 0.0, "place_mm": np.nan, "height_mm": np.nan}
    apart = np.linalg.norm(places[whole][:, None] - true_places, axis=2)
    own = apart.argmin(axis=1)
    heights = np.abs(sizes[whole][:, 2] - true_sizes[own, 2])
    return {
        "boxes": float(len(set(own.tolist()))),
        "place_mm": float(apart.min(axis=1).max()),
        "height_mm": float(heights.max()),
    }


def volume_and_surface(sizes_mm: ArrayLike, true_sizes_mm: ArrayLike) -> dict[str, float]:
    """Hold volumes and surfaces (four sides and the top) of boxes against the truth.

    Parameters
    ----------
    sizes_mm, true_sizes_mm : (n, 3) array_like, mm
        Length, width and height, box by box.

    Returns
    -------
    dict
        ``volume_pct, surface_pct``: the largest error of a single box; NaN if a size is unknown.

    Examples
    --------
    >>> volume_and_surface([[101, 100, 100]], [[100, 100, 100]])
    {'volume_pct': 1.0, 'surface_pct': 0.6}
    """
    ours, true = (np.asarray(v, np.float64).reshape(-1, 3) for v in (sizes_mm, true_sizes_mm))
    volume = 100 * np.abs(ours.prod(axis=1) / true.prod(axis=1) - 1)
    surface = 100 * np.abs(_surface(ours) / _surface(true) - 1)
    return {"volume_pct": round(float(volume.max()), 9), "surface_pct": round(float(surface.max()), 9)}


def _surface(sizes_mm: Float64) -> Float64:
    length, width, height = sizes_mm.T
    return np.asarray(2 * (length + width) * height + length * width)


def rms_of_scores(errors: ArrayLike, deviations: ArrayLike) -> float:
    """Root mean square of errors in their stated standard deviations: 1 where those are right, less where too wide.

    Parameters
    ----------
    errors, deviations : array_like

    Returns
    -------
    float

    Examples
    --------
    >>> rms_of_scores([1.0, -1.0], [2.0, 2.0])
    0.5
    """
    return float(np.sqrt(np.mean((np.asarray(errors, np.float64) / np.asarray(deviations, np.float64)) ** 2)))


def distances_to_boxes(places_mm: ArrayLike, outlines_mm: ArrayLike) -> Float64:
    """Tell how far boxes are from places on the floor: from each place to the nearest point of each outline.

    Parameters
    ----------
    places_mm : (n, 2) array_like, mm
        Outside the boxes.
    outlines_mm : (m, c, 2) array_like, mm
        Corners, one after the other.

    Returns
    -------
    (n, m) float64, mm

    Examples
    --------
    >>> distances_to_boxes([[0, 0], [15, 25]], [[[10, -5], [20, -5], [20, 5], [10, 5]]]).tolist()
    [[10.0], [20.0]]
    """
    starts = np.asarray(outlines_mm, np.float64)
    sides = np.roll(starts, -1, axis=1) - starts
    to_place = np.asarray(places_mm, np.float64)[:, None, None, :] - starts
    share = np.clip((to_place * sides).sum(axis=-1) / (sides**2).sum(axis=-1), 0.0, 1.0)
    return np.asarray(np.linalg.norm(to_place - share[..., None] * sides, axis=-1).min(axis=-1))


def distance_errors(
    cube_mm: ArrayLike, true_cube_mm: ArrayLike, boxes_mm: ArrayLike, true_boxes_mm: ArrayLike
) -> dict[str, float]:
    """Hold distances to the paper's cube and to the boxes of a map against the truth.

    Parameters
    ----------
    cube_mm, true_cube_mm, boxes_mm, true_boxes_mm : array_like, mm
        As `distances_to_boxes` gives them; NaN is unknown.

    Returns
    -------
    dict
        ``cube_mm, boxes_mm``: the largest errors.

    Examples
    --------
    >>> distance_errors([701], [700], [[500, 802]], [[500, 800]])
    {'cube_mm': 1.0, 'boxes_mm': 2.0}
    """
    off = [np.subtract(ours, true) for ours, true in ((cube_mm, true_cube_mm), (boxes_mm, true_boxes_mm))]
    return {name: float(np.abs(each).max()) for name, each in zip(("cube_mm", "boxes_mm"), off, strict=True)}


def nearest_object(objects: Sequence[MeasuredObject]) -> MeasuredObject:
    """Find the measured object that is nearest.

    Parameters
    ----------
    objects : sequence of MeasuredObject

    Returns
    -------
    MeasuredObject

    Raises
    ------
    ValueError
        If there is none.
    """
    if not objects:
        raise ValueError("no object was measured")
    return min(objects, key=lambda thing: float(np.hypot(*thing.position_mm)))


def sizes_of_nearest(objects: Sequence[MeasuredObject]) -> Float64:
    """Length, width and height of the nearest measured object.

    Parameters
    ----------
    objects : sequence of MeasuredObject

    Returns
    -------
    (3,) float64, cm
        NaN where unknown, or if there is no object.
    """
    if not objects:
        return np.full(3, np.nan)
    return np.asarray(nearest_object(objects).size_mm, np.float64) / _MM_PER_CM
