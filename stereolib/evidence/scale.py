"""What notebook 07 holds against the paper's relation of pixels and lengths."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from stereolib.base import Bools, UInt8
from stereolib.evidence.height import fitting_setups
from stereolib.paper import CubeView, PixelBox, canny_bounding_box, cm_per_px_at, fit_focal_length_px

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
        ``lowest_cm`` and ``highest_cm`` of those whose rectangle has the printed width; ``gap_from_cm`` and
        ``gap_to_cm``, the lowest and the highest in between that has not. NaN where there is none.
    """
    views = list(views)
    fit = {view.camera_height_mm for view in fitting_setups(views, within_px)}
    lowest, highest = (min(fit), max(fit)) if fit else (np.nan, np.nan)
    out = {view.camera_height_mm for view in views if lowest < view.camera_height_mm < highest} - fit
    heights_mm = {"lowest": lowest, "highest": highest, "gap_from": min(out, default=np.nan)}
    heights_mm["gap_to"] = max(out, default=np.nan)
    return {f"{name}_cm": mm / _MM_PER_CM for name, mm in heights_mm.items()}


def height_off_cm(views: Iterable[CubeView], height_mm: float, within_px: float = ENDS_PX) -> dict[str, float]:
    """How far a camera height is from the nearest one that has the printed rows, distance and width.

    Parameters
    ----------
    views : iterable of CubeView
        Set-ups that have the printed rows, some of them at this height.
    height_mm : float, mm
    within_px : float, px
        How far a rectangle may be from the printed width.

    Returns
    -------
    dict
        ``off_cm``: 0 if it fits itself; NaN if none does.
    """
    off = [abs(view.camera_height_mm - height_mm) / _MM_PER_CM for view in fitting_setups(views, within_px)]
    return {"off_cm": min(off, default=np.nan)}


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


def boxes_at_best_setting(
    pictures: Mapping[str, Sequence[UInt8]], width_px: float, settings: Iterable[tuple[int, float]]
) -> tuple[dict[str, float], dict[str, tuple[int, float]]]:
    """How often the rectangle around the brightness's edges has the right width, Canny's filter set as well as can be.

    Parameters
    ----------
    pictures : mapping of str to sequence of (H, W, 3) uint8
        Exposures of one scene.
    width_px : float, px
        Between the cube's corners.
    settings : iterable of (blur_px, high)
        Side of the Gaussian, and the filter's upper threshold; the lower one is a third of it.

    Returns
    -------
    share : dict
        By name with ``_pct`` behind it: the share within a pixel at each end, at the setting that has the most.
    chosen : dict
        By name, that setting.
    """
    share, chosen, every = {}, {}, list(settings)
    for name, same in pictures.items():
        tried = {one: [_is_right(picture, width_px, *one) for picture in same] for one in every}
        chosen[name] = max(tried, key=lambda one: sum(tried[one]))
        share[f"{name}_pct"] = 100 * float(np.mean(tried[chosen[name]]))
    return share, chosen


def _is_right(picture: UInt8, width_px: float, blur_px: int, high: float) -> bool:
    try:
        box = canny_bounding_box(picture, blur_px=blur_px, thresholds=(high / 3, high))
    except ValueError:  # no edge at all
        return False
    return abs(box_off_px(box, width_px)) <= ENDS_PX


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


def one_scale(scale_cm_per_px: float, near_mm: ArrayLike, side_mm: ArrayLike, f_px: float) -> dict[str, float]:
    """How many times too large one scale is along two upright edges.

    Parameters
    ----------
    scale_cm_per_px : float, cm/px
    near_mm : array_like, mm
        Depths of the near edge's ends.
    side_mm : array_like, mm
        Depths of a side edge's ends, first of the corner at which the width is counted.
    f_px : float, px

    Returns
    -------
    dict
        ``corner_times`` (at that corner), ``side_times`` and ``near_times`` (mean along the edges).

    Examples
    --------
    >>> {name: round(times, 3) for name, times in one_scale(0.12, [700.0], [900.0, 960.0], 750.0).items()}
    {'corner_times': 1.0, 'side_times': 0.969, 'near_times': 1.286}
    """
    near, side = (np.atleast_1d(scale_cm_per_px / cm_per_px_at(depth, f_px)) for depth in (near_mm, side_mm))
    return {"corner_times": float(side[0]), "side_times": float(side.mean()), "near_times": float(near.mean())}


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
