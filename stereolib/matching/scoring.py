"""How good a disparity map is, and what a filter made of it, measured against the truth."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Bools, Floats

RIM_PX = 8  # the widest rim around a nearer surface that `fattening_px` tells
_JUMP_PX = 4.0  # disparities farther apart belong to two surfaces
_WITHIN_PX = 4  # farther off is a mismatch: it tells nothing of a match's precision


def check_mask(where: npt.ArrayLike, shape: tuple[int, ...], name: str = "where") -> Bools:
    """Refuse what is no mask: 0 and 255 or 0 and 1 would be taken for numbers, or for indices.

    Parameters
    ----------
    where : (H, W) bool
    shape : (int, int)
        The shape it must have.
    name : str
        What the message calls it.

    Returns
    -------
    (H, W) bool

    Raises
    ------
    ValueError
        If it has another shape or type.
    """
    mask = np.asarray(where)
    if mask.shape != shape or mask.dtype != bool:
        got = f"got {mask.shape} of {mask.dtype}; make one by a comparison, for example mask > 0"
        raise ValueError(f"{name} must be a mask {shape} of bool, {got}")
    return mask


@dataclass(frozen=True)
class Score:
    """Quality of a disparity map over the pixels looked at.

    Parameters
    ----------
    bad1_pct, bad2_pct, bad4_pct : float, %
        Share off by more than 1, 2, 4 px, unreturned pixels counted as bad.
    density_pct : float, %
        Share returned.
    bias_px, rms_px : float
        Mean and root mean square error of the returned pixels that are within 4 px.
    mean_all_px, rms_all_px : float
        Mean absolute and root mean square error of all returned pixels.
    locking_px : float
        By how much matches are drawn to whole pixels (see Notes of `score`).
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

    @property
    def scatter_px(self) -> float:
        """Standard deviation of the errors within 4 px, px."""
        return float(np.sqrt(max(self.rms_px**2 - self.bias_px**2, 0.0)))


def score(disparity_px: npt.ArrayLike, truth_px: npt.ArrayLike, where: Bools | None = None) -> Score:
    """Score a disparity map against the truth.

    Parameters
    ----------
    disparity_px : (H, W) float, NaN where not returned
    truth_px : (H, W) float, NaN where unknown (not looked at)
    where : (H, W) bool, optional
        Pixels to look at, for example those that the right camera sees too.

    Returns
    -------
    Score

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

    Examples
    --------
    >>> quality = score([[10.0, 13.0, np.nan, 10.5]], [[10.0, 10.0, 10.0, 10.0]])
    >>> quality.bad2_pct, quality.density_pct, quality.mean_all_px
    (50.0, 75.0, 1.1666666666666667)
    """
    disparity, truth = np.asarray(disparity_px, float), np.asarray(truth_px, float)
    looked = _looked_at(where, disparity, truth)
    error = disparity[looked] - truth[looked]
    returned = np.isfinite(error)
    off = np.where(returned, np.abs(error), np.inf)
    within = off <= _WITHIN_PX
    good, known = error[within], error[returned]
    swing = good @ np.exp(2j * np.pi * truth[looked][within])
    bad1, bad2, bad4 = (_percent(off > limit_px) for limit_px in (1, 2, 4))
    bias_px, (rms_px, rms_all_px) = _mean(good), (float(np.sqrt(_mean(e**2))) for e in (good, known))
    locking_px = float(2 * abs(swing) / good.size) if good.size else float("nan")
    return Score(bad1, bad2, bad4, _percent(returned), bias_px, rms_px, _mean(np.abs(known)), rms_all_px, locking_px)


@dataclass(frozen=True)
class RepairScore:
    """What a filter did to a disparity map, over the pixels looked at; NaN where there is no pixel of a kind.

    Parameters
    ----------
    holes_pct : float, %
        Share of pixels without a disparity before.
    filled_pct : float, %
        Share of those that have one after.
    wrong2_pct, wrong3_pct : float, %
        Share of the filled pixels that are off by more than 2, 3 px.
    shift_px : float
        Mean change of the pixels that were right before (within 2 px).
    """

    holes_pct: float
    filled_pct: float
    wrong2_pct: float
    wrong3_pct: float
    shift_px: float


def score_repair(before_px: Floats, after_px: Floats, truth_px: Floats, where: Bools) -> RepairScore:
    """Compare a disparity map before and after a filter such as `dilate` with the truth.

    Parameters
    ----------
    before_px, after_px : (H, W) float, NaN where there is no disparity
    truth_px : (H, W) float, NaN where unknown (not looked at)
    where : (H, W) bool
        Pixels to look at.

    Returns
    -------
    RepairScore

    Raises
    ------
    ValueError
        If the shapes differ, the mask is no mask, or nothing is left to look at.
    """
    looked = _looked_at(where, before_px, after_px, truth_px)
    before, after, truth = (np.asarray(array, float)[looked] for array in (before_px, after_px, truth_px))
    hole = np.isnan(before)
    filled, right = hole & np.isfinite(after), np.abs(before - truth) <= 2
    off, moved = np.abs(after - truth)[filled], (after - before)[right]
    shift_px = float(np.nanmean(moved)) if moved.size else float("nan")
    filled_pct = _percent(np.isfinite(after[hole]))
    return RepairScore(_percent(hole), filled_pct, _percent(off > 2), _percent(off > 3), shift_px)


def overreach_px(disparity_px: Floats, truth_px: Floats, on_object: Bools, step_px: float = 20.0) -> float:
    """Measure by how many pixels an object reaches over its right border into the background, mean over rows.

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

    Returns
    -------
    float, px

    Raises
    ------
    ValueError
        If the object is no mask of the map's shape, or no row has such a border.
    """
    disparity_px, truth_px = np.asarray(disparity_px), np.asarray(truth_px)
    on_object = check_mask(on_object, truth_px.shape, "on_object")
    width, rows = on_object.shape[1], np.flatnonzero(on_object.any(axis=1))
    last = width - 1 - on_object[rows, ::-1].argmax(axis=1)
    moves = np.abs(np.diff(last, prepend=last[:1], append=last[-1:]))
    upright = np.maximum(moves[:-1], moves[1:]) <= 1
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


def beside_jumps(truth_px: Floats, visible: Bools) -> tuple[Bools, Floats]:
    """Find the background beside the borders of nearer surfaces, and the disparity from which it counts as theirs.

    Parameters
    ----------
    truth_px : (H, W) float, px
    visible : (H, W) bool
        Pixels that the right camera sees too.

    Returns
    -------
    where : (H, W) bool
        Visible pixels with a surface at least 4 px nearer within `RIM_PX` columns.
    border_px : (H, W) float, px
        Half way between the two disparities.
    """
    visible = check_mask(visible, np.shape(truth_px), "visible")
    truth = np.where(np.isfinite(truth_px), truth_px, -np.inf).astype(np.float32)
    nearest = cv2.dilate(truth, np.ones((1, 2 * RIM_PX + 1), np.uint8))
    with np.errstate(invalid="ignore"):
        where = visible & np.isfinite(truth_px) & (nearest - truth >= _JUMP_PX)
    return where, np.where(where, (nearest + truth) / 2, np.nan)


def fattening_px(disparity_px: Floats, truth_px: Floats, visible: Bools) -> float:
    """Measure by how many pixels nearer surfaces are too wide, mean over their borders that both cameras see behind.

    Parameters
    ----------
    disparity_px, truth_px : (H, W) float
    visible : (H, W) bool
        Pixels that the right camera sees too.

    Returns
    -------
    float, px
        `RIM_PX` times the share of `beside_jumps` whose disparity is nearer to the nearer surface's; holes are none.
        NaN if there is no such border. Unlike `overreach_px` it needs no object, and works on photographs.
    """
    where, border = beside_jumps(truth_px, visible)
    return RIM_PX * float((disparity_px[where] > border[where]).mean()) if where.any() else float("nan")


def _looked_at(where: Bools | None, *maps_px: Floats) -> Bools:
    """Mask of the pixels `where` the truth, the last of the maps, is known."""
    shapes = [np.shape(one) for one in maps_px]
    if len(set(shapes)) > 1:
        raise ValueError(f"disparity and truth must have one shape, got {shapes}")
    known = np.isfinite(maps_px[-1])
    looked = known if where is None else known & check_mask(where, known.shape)
    if not looked.any():
        raise ValueError("no pixel with a known truth is left to look at: the truth is NaN or the mask is empty there")
    return looked


def _mean(values: Floats | Bools) -> float:
    return float(values.mean()) if values.size else float("nan")


def _percent(share: Bools) -> float:
    return 100 * _mean(share)
