"""What notebook 07 holds against the paper's relation of pixels and lengths."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from stereolib.base import Bools
from stereolib.evidence.height import fitting_setups
from stereolib.paper import CubeView, PixelBox, cm_per_px_at, fit_focal_length_px

_MM_PER_CM = 10.0
#: How well a rectangle's width is found: each of its two ends to a pixel.
ENDS_PX = 2.0


def width_tolerance_px(views: Iterable[CubeView]) -> float:
    """How far the printed digits let the cube's width stray, and the rectangle's two ends with it.

    Parameters
    ----------
    views : iterable of CubeView
        The set-up at the ends of its printed digits (`stereolib.paper.setups_in_print`).

    Returns
    -------
    float, px
        Half of the interval of widths, and a pixel for each end.
    """
    return float(np.ptp([view.width_px for view in views])) / 2 + ENDS_PX


def camera_heights_left(views: Iterable[CubeView], within_px: float = ENDS_PX) -> dict[str, float]:
    """Camera heights that the printed rows, distance and width leave.

    Parameters
    ----------
    views : iterable of CubeView
        Set-ups that have the printed rows.
    within_px : float, px
        How far a rectangle may be from the printed width.

    Returns
    -------
    dict
        ``lowest_cm`` and ``highest_cm`` of those whose rectangle has the printed width; NaN if none has.
    """
    heights = [view.camera_height_mm / _MM_PER_CM for view in fitting_setups(views, within_px)] or [np.nan]
    return {"lowest_cm": min(heights), "highest_cm": max(heights)}


def boxes_right(boxes: Mapping[str, Sequence[PixelBox]], width_px: float) -> dict[str, float]:
    """How often a bounding rectangle has the width between the cube's corners.

    Parameters
    ----------
    boxes : mapping of str to sequence of PixelBox
        Over exposures of one scene.
    width_px : float, px
        Between the corners.

    Returns
    -------
    dict
        By name with ``_pct`` behind it: the share within a pixel at each end.
    """
    return {
        f"{name}_pct": 100 * float(np.mean([abs(box_off_px(box, width_px)) <= ENDS_PX for box in same]))
        for name, same in boxes.items()
    }


def box_off_px(box: PixelBox, width_px: float) -> float:
    """By how much a rectangle is wider than what is between the cube's corners.

    Parameters
    ----------
    box : PixelBox
        It counts the pixels at both ends, one more than lies between them.
    width_px : float, px
        Between the corners.

    Returns
    -------
    float, px

    Examples
    --------
    >>> box_off_px(PixelBox(left=100, top=50, width=365, height=300), 363.9).__round__(1)
    0.1
    """
    return box.width - 1 - width_px


def one_scale(scale_cm_per_px: float, near_mm: ArrayLike, side_mm: float, f_px: float) -> dict[str, float]:
    """How many times too large one scale is at two depths.

    Parameters
    ----------
    scale_cm_per_px : float, cm/px
    near_mm : array_like, mm
        Depths along the near edge.
    side_mm : float, mm
        Depth of the side corners.
    f_px : float, px

    Returns
    -------
    dict
        ``near_times`` (mean along the edge) and ``side_times``.

    Examples
    --------
    >>> {name: round(times, 3) for name, times in one_scale(0.12, [700.0], 900.0, 750.0).items()}
    {'near_times': 1.286, 'side_times': 1.0}
    """
    near, side = (scale_cm_per_px / cm_per_px_at(depth, f_px) for depth in (near_mm, side_mm))
    return {"near_times": float(np.mean(near)), "side_times": float(side)}


def relation_error(depth_mm: ArrayLike, width_px: ArrayLike, true_cm: ArrayLike, fitted: Bools) -> dict[str, float]:
    """How well a focal length, fitted to some widths, gives the others.

    Parameters
    ----------
    depth_mm, width_px, true_cm : (N,) array_like
        Of each width its depth, its pixels and its length.
    fitted : (N,) bool
        Which ones the focal length of ``length per pixel = Z / f`` is fitted to.

    Returns
    -------
    dict
        ``worst_pct``: largest error of the lengths left out.
    """
    depth, width, true = (np.asarray(values, float) for values in (depth_mm, width_px, true_cm))
    f_px = fit_focal_length_px(depth[fitted], (true / width)[fitted])
    error = width * cm_per_px_at(depth, f_px) / true - 1
    return {"worst_pct": 100 * float(np.abs(error[~fitted]).max())}
