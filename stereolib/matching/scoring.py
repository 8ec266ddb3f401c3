"""How good a disparity map is, measured against the truth."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.matching.disparity import compute_disparity
from stereolib.matching.sgbm import SGBMParams
from stereolib.rig import to_grey

Array = np.ndarray


def check_mask(where: Array, shape: tuple[int, ...], name: str = "where") -> Array:
    """Refuse what is no (H, W) bool (ValueError): 0 and 255 or 0 and 1 would be taken for numbers, or for indices."""
    found = np.asarray(where)
    if found.shape != shape or found.dtype != bool:
        raise ValueError(
            f"{name} must be a mask {shape} of bool, got {found.shape} of {found.dtype}; make one by a comparison, for "
            f"example mask > 0"
        )
    return found


@dataclass(frozen=True)
class Score:
    """Quality of a disparity map over the pixels looked at.

    ``bad1_pct``, ``bad2_pct``, ``bad4_pct``: share off by more than 1, 2, 4 px, unreturned pixels counted as bad.
    ``density_pct``: share returned. ``bias_px``, ``rms_px``: mean and root mean square error of the returned pixels
    that are within 4 px. ``mean_all_px``, ``rms_all_px``: mean absolute and root mean square error of all returned
    pixels. ``locking_px``: by how much matches are drawn to whole pixels (see Notes of `score`).
    """

    bad1_pct: float
    bad2_pct: float
    bad4_pct: float
    density_pct: float
    bias_px: float
    rms_px: float
    mean_all_px: float
    rms_all_px: float
    locking_px: float


def score(disparity_px: Array, truth_px: Array, where: Array | None = None) -> Score:
    """Compare a disparity map with the truth.

    Parameters
    ----------
    disparity_px : (H, W) float, NaN where not returned
    truth_px : (H, W) float, NaN where unknown (not looked at)
    where : (H, W) bool, optional
        Pixels to look at, for example `virtual.Truth.visible`.

    Raises
    ------
    ValueError
        If the shapes differ, the mask is no mask, or nothing is left to look at.

    Notes
    -----
    Sub-pixel bias: interpolated matches keep to whole pixels, so that the error ``e`` swings with the true
    disparity's fraction. Its amplitude is that of the first harmonic over the n pixels within 4 px,
    ``locking = 2 / n |sum e exp(2 pi i d_true)|``.

    References
    ----------
    Shimizu and Okutomi, "Precise sub-pixel estimation on area-based matching", ICCV 2001.
    """
    disparity, truth = np.asarray(disparity_px, float), np.asarray(truth_px, float)
    if disparity.shape != truth.shape:
        raise ValueError(f"disparity and truth must have one shape, got {[disparity.shape, truth.shape]}")
    looked = np.isfinite(truth) if where is None else np.isfinite(truth) & check_mask(where, truth.shape)
    if not looked.any():
        raise ValueError("no pixel with a known truth is left to look at: the truth is NaN or the mask is empty there")
    error = disparity[looked] - truth[looked]
    returned = np.isfinite(error)
    off = np.where(returned, np.abs(error), np.inf)
    good, known = error[off <= 4], error[returned]
    swing = good @ np.exp(2j * np.pi * truth[looked][off <= 4])
    return Score(
        bad1_pct=100 * float((off > 1).mean()),
        bad2_pct=100 * float((off > 2).mean()),
        bad4_pct=100 * float((off > 4).mean()),
        density_pct=100 * float(returned.mean()),
        bias_px=float(good.mean()) if good.size else float("nan"),
        rms_px=float(np.sqrt((good**2).mean())) if good.size else float("nan"),
        mean_all_px=float(np.abs(known).mean()) if known.size else float("nan"),
        rms_all_px=float(np.sqrt((known**2).mean())) if known.size else float("nan"),
        locking_px=float(2 * abs(swing) / good.size) if good.size else float("nan"),
    )


@dataclass(frozen=True)
class Repair:
    """What a filter did to a disparity map, over the pixels looked at.

    ``holes_pct``: share of pixels without a disparity before. ``filled_pct``: share of those that have one after.
    ``wrong2_pct``, ``wrong3_pct``: share of the filled pixels off by more than 2, 3 px. ``shift_px``: mean change of
    the pixels that were right before (within 2 px). NaN where there is no such pixel.
    """

    holes_pct: float
    filled_pct: float
    wrong2_pct: float
    wrong3_pct: float
    shift_px: float


def repair(before_px: Array, after_px: Array, truth_px: Array, where: Array) -> Repair:
    """Compare a disparity map before and after a filter such as `smoothing.dilate`.

    Parameters
    ----------
    before_px, after_px : (H, W) float, NaN where there is no disparity
    truth_px : (H, W) float, NaN where unknown (not looked at)
    where : (H, W) bool
        Pixels to look at.

    Raises
    ------
    ValueError
        If the shapes differ, the mask is no mask, or nothing is left to look at.
    """
    shapes = [np.shape(array) for array in (before_px, after_px, truth_px)]
    if len(set(shapes)) > 1:
        raise ValueError(f"maps before and after and the truth must have one shape, got {shapes}")
    looked = check_mask(where, shapes[0]) & np.isfinite(truth_px)
    if not looked.any():
        raise ValueError("no pixel with a known truth is left to look at: the truth is NaN or the mask is empty there")
    before, after, truth = (np.asarray(array, float)[looked] for array in (before_px, after_px, truth_px))
    hole = np.isnan(before)
    filled, right = hole & np.isfinite(after), np.abs(before - truth) <= 2
    off = np.abs(after - truth)[filled]
    return Repair(
        holes_pct=_percent(hole),
        filled_pct=_percent(np.isfinite(after[hole])),
        wrong2_pct=_percent(off > 2),
        wrong3_pct=_percent(off > 3),
        shift_px=float(np.nanmean((after - before)[right])) if right.any() else float("nan"),
    )


def overreach_px(disparity_px: Array, truth_px: Array, on_object: Array, step_px: float = 20.0) -> float:
    """By how many pixels an object reaches over its right border into the background, mean over rows.

    In each row, the pixels right of the object's last one are counted as long as their disparity is nearer to the
    object's than to the background's. The right border is taken because both cameras see what is behind it. Only
    upright stretches count, where it moves by at most 1 px from row to row: there a row crosses the border squarely.

    Parameters
    ----------
    disparity_px, truth_px : (H, W) float
    on_object : (H, W) bool
        The true object.
    step_px : float
        Rows count whose background lies at least so far behind the object. The floor beside its foot must not: take
        more than twice what the background's disparity changes by under a filter's kernel.

    Raises
    ------
    ValueError
        If the object is no mask of the map's shape, or no row has such a border.
    """
    on_object = check_mask(on_object, np.shape(truth_px), "on_object")
    width, rows = on_object.shape[1], np.flatnonzero(on_object.any(axis=1))
    last = width - 1 - on_object[rows, ::-1].argmax(axis=1)
    upright = np.abs(np.gradient(last.astype(float))) <= 1 if len(last) > 1 else np.array([True])
    rows, last = rows[upright & (last < width - 1)], last[upright & (last < width - 1)]
    near, far = truth_px[rows, last], truth_px[rows, last + 1]
    clear = near - far >= step_px
    if not clear.any():
        raise ValueError(f"no row where the object stands {step_px:g} px before what is right of it")
    rows, last, border = rows[clear], last[clear], ((near + far) / 2)[clear]
    right = np.arange(width) > last[:, None]
    taken = disparity_px[rows] > border[:, None]  # False for NaN
    reached = np.where(right & ~taken, np.arange(width), width).min(axis=1) - last - 1
    return float(reached.mean())


def beside_jumps(truth_px: Array, visible: Array, *, reach_px: int = 8, step_px: float = 4.0) -> tuple[Array, Array]:
    """Background beside the borders of nearer things, and the disparity from which it counts as theirs.

    Returns
    -------
    where : (H, W) bool
        Visible pixels with something at least `step_px` nearer within `reach_px` columns.
    border_px : (H, W) float
        Half way between the two disparities.
    """
    visible = check_mask(visible, np.shape(truth_px), "visible")
    truth = np.where(np.isfinite(truth_px), truth_px, -np.inf).astype(np.float32)
    nearest = cv2.dilate(truth, np.ones((1, 2 * reach_px + 1), np.uint8))
    with np.errstate(invalid="ignore"):
        where = visible & np.isfinite(truth_px) & (nearest - truth >= step_px)
    return where, np.where(where, (nearest + truth) / 2, np.nan)


def fattening_px(disparity_px: Array, truth_px: Array, visible: Array, *, reach_px: int = 8) -> float:
    """By how many pixels nearer things are too wide, mean over all their borders that both cameras see behind.

    Parameters
    ----------
    disparity_px, truth_px : (H, W) float
    visible : (H, W) bool
        Pixels that the right camera sees too.
    reach_px : int
        The widest rim that is told.

    Returns
    -------
    float
        ``reach`` times the share of `beside_jumps` whose disparity is nearer to the nearer thing's; holes are none.
        NaN if there is no such border. Unlike `overreach_px` it needs no object, and works on photographs.
    """
    where, border = beside_jumps(truth_px, visible, reach_px=reach_px)
    return reach_px * float((disparity_px[where] > border[where]).mean()) if where.any() else float("nan")


def near_edge(truth_px: Array, on_object: Array, half_width_px: int = 3) -> Array:
    """Pixels of the object around its nearest column in each row: the vertical edge whose height is wanted.

    Returns
    -------
    (H, W) bool
    """
    on_object = check_mask(on_object, np.shape(truth_px), "on_object")
    nearest = np.where(on_object, truth_px, -np.inf).argmax(axis=1)[:, None]
    return on_object & (np.abs(np.arange(on_object.shape[1]) - nearest) <= half_width_px)


def smallest_window(
    left: Array, right: Array, truth_px: Array, where: Array, *, limit_pct: float = 5.0, widest: int = 192
) -> int:
    """The fewest disparities, from 0 on, at which `where` has at most `limit_pct` bad pixels (2 px).

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        Rectified.
    truth_px, where : (H, W)
        See `score`.
    widest : int, px
        The last window tried.

    Raises
    ------
    ValueError
        If no window up to `widest` does.
    """
    for count in range(16, widest + 1, 16):
        disparity = compute_disparity(left, right, SGBMParams(count), whole=True)
        if score(disparity, truth_px, where).bad2_pct <= limit_pct:
            return count
    raise ValueError(f"even {widest} disparities leave more than {limit_pct:g} % bad pixels: it is not the window")


def correlation_length_px(image: Array, where: Array) -> float:
    """Size of a texture along the rows: the shift at which its correlation with itself falls to 1/e.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
    where : (H, W) bool
        The textured surface.

    Raises
    ------
    ValueError
        If there is nothing to see: an empty mask, or one grey value only.
    """
    grey = to_grey(image).astype(float)
    where = check_mask(where, grey.shape)
    if not where.any() or np.ptp(grey[where]) == 0:
        raise ValueError("no texture to measure: the mask is empty or the surface has one grey value")
    grey = np.where(where, grey - grey[where].mean(), 0.0)
    limit = image.shape[1] // 2
    weight = np.array([(where[:, k:] & where[:, : image.shape[1] - k]).sum() for k in range(limit)])
    product = np.array([(grey[:, k:] * grey[:, : image.shape[1] - k]).sum() for k in range(limit)])
    correlation = product / np.maximum(weight, 1)
    correlation /= correlation[0]
    below = int((correlation < np.exp(-1)).argmax())
    step = correlation[below - 1] - correlation[below]
    return float(below - 1 + (correlation[below - 1] - np.exp(-1)) / step)


def _percent(share: Array) -> float:
    return 100 * float(share.mean()) if share.size else float("nan")
