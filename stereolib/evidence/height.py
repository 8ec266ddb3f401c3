"""What notebook 06 holds against the paper's way to a height."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stereolib.base import Bools, Float64, Floats
from stereolib.matching import SGBMParams
from stereolib.paper import (
    CubeView,
    HeightResult,
    PixelBox,
    height_by_maximum,
    heights_over_tolerances,
    paper_setup,
    printed_value,
)

_MM_PER_CM = 10.0
_EDGE_PX = SGBMParams().block_size // 2 + 1  # columns beside the near edge that still are it: half a block, and one
_TOP_ROWS = 3  # of the edge, in which the first row is looked for: an edge is found to a pixel or two
_LEVELS = 255  # steps of a map that is shown as a picture of 8 bits
_STEP_PX = 1 / 16  # of SGBM's disparities
_ROWS = 2.0  # an edge is found to a pixel or two
_HALF_CM = 0.5  # half of the last digit of the cube's printed size: what counts as right
_SAME_CM = 0.25  # two rows at the printed scale: what counts as the same reading


@dataclass(frozen=True, eq=False)
class ThresholdCurve:
    """What the paper's recipe reads on one map over all thresholds.

    Attributes
    ----------
    below_px : (N,) float64, px
        Thresholds, as far as they are below the map's largest disparity above the constant; the first is 0.
    reading_cm : (N,) float64, cm
    whole_px : float, px
        From here on the mask reaches the top of the near edge, to two rows; NaN if never.
    whole_cm : float, cm
        What the thresholds from there to `until_px` read: their median.
    until_px : float, px
        The last threshold that reads, to two rows, the same as that one.
    right_px : (first, last), px
        Thresholds that read the cube's printed size to half a centimetre; NaN if none does.
    right_steps : int
        How many do.
    """

    below_px: Float64
    reading_cm: Float64
    whole_px: float
    whole_cm: float
    until_px: float
    right_px: tuple[float, float]
    right_steps: int


def edge_mask(view: CubeView, shape: tuple[int, int]) -> Bools:
    """Pixels of the cube's near edge, by geometry.

    Parameters
    ----------
    view : CubeView
    shape : (rows, columns)

    Returns
    -------
    (H, W) bool
        Half a block of the matcher and one column to either side, from the edge's top to its foot.

    Examples
    --------
    >>> from stereolib.paper import paper_rig, solve_pitch
    >>> view = solve_pitch(paper_rig().rectify(), paper_setup())
    >>> int(edge_mask(view, (480, 640)).any(axis=1).sum())
    325
    """
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    beside = np.abs(columns - view.column) <= _EDGE_PX
    return np.asarray(beside & (rows >= view.top_row) & (rows < view.foot_row - 0.5))


def whole_edge_tolerance_px(disparity_px: Floats, view: CubeView) -> float:
    """Tolerance from which on the paper's mask reaches the top of the near edge.

    Parameters
    ----------
    disparity_px : (H, W) float, px
    view : CubeView
        Where the edge is.

    Returns
    -------
    float, px
        Below the largest disparity above the constant; NaN if the top of the edge has no disparity.
    """
    edge = edge_mask(view, disparity_px.shape)
    edge[int(np.ceil(view.top_row)) + _TOP_ROWS :] = False
    at_top = np.where(edge & np.isfinite(disparity_px), disparity_px, -np.inf).max()
    largest = _strict(disparity_px).threshold_px
    return float(max(largest - at_top, 0.0)) if np.isfinite(at_top) else np.nan


def whole_edge_reading_cm(disparity_px: Floats, view: CubeView) -> float:
    """What the paper's recipe reads with the best of all thresholds that mark the near edge up to its top.

    Parameters
    ----------
    disparity_px : (H, W) float, px
    view : CubeView

    Returns
    -------
    float, cm
        Of all readings the one nearest to the cube's printed size; NaN if no threshold marks the top.
    """
    least = whole_edge_tolerance_px(disparity_px, view)
    if not np.isfinite(least):
        return np.nan
    tolerances = np.linspace(least, _strict(disparity_px).threshold_px, _LEVELS)
    readings = _readings_cm(disparity_px, tolerances)
    return float(readings[np.abs(readings - _side_cm()).argmin()])


def steady_reading_cm(disparity_px: Floats) -> float:
    """What most thresholds make of the paper's recipe, so that no truth has to choose one.

    Parameters
    ----------
    disparity_px : (H, W) float, px

    Returns
    -------
    float, cm
        Of the 256 thresholds of an 8-bit picture of the map, from its maximum to 0, the largest group that reads the
        same to two rows: its median.

    Examples
    --------
    >>> disparity = np.full((480, 640), 20.0)
    >>> disparity[147:427, 300] = 100.0
    >>> round(steady_reading_cm(disparity), 2)
    32.48
    """
    readings = _readings_cm(disparity_px, _tolerances_of_8_bits(disparity_px))
    alike = np.abs(readings[:, None] - readings) <= _SAME_CM
    return float(np.median(readings[alike[alike.sum(axis=1).argmax()]]))


def threshold_curve(disparity_px: Floats, view: CubeView, *, step_px: float = _STEP_PX) -> ThresholdCurve:
    """What the paper's recipe reads at every threshold, from the maximum of a map down to nothing.

    Parameters
    ----------
    disparity_px : (H, W) float, px
    view : CubeView
        Where the edge is.
    step_px : float, px
        Between two thresholds: a step of SGBM's disparities.

    Returns
    -------
    ThresholdCurve
    """
    largest = _strict(disparity_px).threshold_px
    below = np.arange(0, largest, step_px)
    readings, whole = _readings_cm(disparity_px, below), whole_edge_tolerance_px(disparity_px, view)
    at_whole = readings[below >= whole][:1]
    same = (below >= whole) & (np.abs(readings - at_whole) <= _SAME_CM) if at_whole.size else below < 0
    right = below[np.abs(readings - _side_cm()) <= _HALF_CM]
    return ThresholdCurve(
        below_px=below,
        reading_cm=readings,
        whole_px=whole,
        whole_cm=float(np.median(readings[same])) if same.any() else np.nan,
        until_px=float(below[same].max()) if same.any() else np.nan,
        right_px=(float(right.min()), float(right.max())) if right.size else (np.nan, np.nan),
        right_steps=len(right),
    )


def tuned_threshold_px(disparity_px: Floats) -> float:
    """The threshold with which the paper's recipe comes nearest to the known size of the cube.

    Parameters
    ----------
    disparity_px : (H, W) float, px
        Of the printed cube.

    Returns
    -------
    float, px
        As a disparity, of all in steps of 1/16 px.
    """
    largest = _strict(disparity_px).threshold_px
    below = np.arange(0, largest, _STEP_PX)
    return float(largest - below[np.abs(_readings_cm(disparity_px, below) - _side_cm()).argmin()])


def threshold_elsewhere(
    threshold_px: float, same_cube: Iterable[Floats], others: Mapping[float, Floats]
) -> dict[str, float]:
    """What a threshold is worth where it was not found.

    Parameters
    ----------
    threshold_px : float, px
        As a disparity (`tuned_threshold_px`).
    same_cube : iterable of (H, W) float, px
        Maps of recordings of the printed cube, at the same place, by the same camera.
    others : mapping of cm to (H, W) float, px
        Maps of cubes of other heights there.

    Returns
    -------
    dict
        ``apart_cm``: by how much its readings of `same_cube` differ at most; ``other_cm``: how far the recipe is off
        at most for the others.
    """
    reads = [reading_at_threshold_cm(d, threshold_px) for d in same_cube]
    others_off = [abs(reading_at_threshold_cm(d, threshold_px) - height) for height, d in others.items()]
    return {"apart_cm": float(np.ptp(reads)), "other_cm": float(np.max(others_off))}


def reading_at_threshold_cm(disparity_px: Floats, threshold_px: float) -> float:
    """What the paper's recipe reads at one threshold, with the printed constant and scale.

    Parameters
    ----------
    disparity_px : (H, W) float, px
    threshold_px : float, px

    Returns
    -------
    float, cm
        0 if nothing reaches the threshold.
    """
    tolerance = _strict(disparity_px).threshold_px - threshold_px
    return float(_readings_cm(disparity_px, [tolerance])[0]) if tolerance >= 0 else 0.0


def recipe_over_setups(
    families: Mapping[str, Iterable[CubeView]], within_px: float
) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    """What the paper's recipe reads over set-ups whose rectangle has the printed width, when it marks the whole edge.

    Parameters
    ----------
    families : mapping of str to iterable of CubeView
    within_px : float, px
        How far a rectangle may be from the printed width.

    Returns
    -------
    off_cm : dict
        By family, how far its best reading is from the printed size; NaN if no set-up has the width.
    span_cm : dict
        By family, least and largest reading.
    """
    scale, side_cm = printed_value("scale.cm_per_px"), _side_cm()
    off, span = {}, {}
    for name, views in families.items():
        fitting = fitting_setups(views, within_px)
        readings = np.array([scale * view.edge_rows for view in fitting]) if fitting else np.array([np.nan])
        off[name] = float(np.abs(readings - side_cm).min())
        span[name] = float(readings.min()), float(readings.max())
    return off, span


def fitting_setups(views: Iterable[CubeView], within_px: float) -> list[CubeView]:
    """Set-ups whose bounding rectangle has the printed width.

    Parameters
    ----------
    views : iterable of CubeView
    within_px : float, px

    Returns
    -------
    list of CubeView
    """
    return [view for view in views if abs(view.box_px - printed_value("scale.width_px")) <= within_px]


def largest_on_edge(maps: Mapping[str, tuple[Floats, CubeView]]) -> dict[str, float]:
    """How many of the largest disparities lie on the near edge.

    Parameters
    ----------
    maps : mapping of str to (disparity_px, view)

    Returns
    -------
    dict
        By name with ``_pct`` behind it: of as many of the largest disparities above the constant as the edge has
        pixels, and of those that equal the least of them, the share that lies on the edge.
    """
    share = {}
    for name, (disparity_px, view) in maps.items():
        edge, largest = edge_mask(view, disparity_px.shape), _strict(disparity_px)
        above = np.sort(np.nan_to_num(disparity_px[: largest.foot_row], nan=0.0), axis=None)
        marked = np.zeros_like(edge)
        marked[: largest.foot_row] = disparity_px[: largest.foot_row] >= above[-edge.sum()]
        share[f"{name}_pct"] = 100 * float(edge[marked].mean())
    return share


def indices_named(printed: str) -> dict[str, int]:
    """Count which indices of a pixel a sentence names.

    Parameters
    ----------
    printed : str

    Returns
    -------
    dict
        ``indices``: how many different ones.

    Examples
    --------
    >>> indices_named("the column index of a pixel; elsewhere its row index")
    {'indices': 2}
    """
    return {"indices": len(set(re.findall(r"(\w+) index", printed)))}


def mask_on_edge(disparity_px: Floats, view: CubeView) -> dict[str, float]:
    """How much of what the recipe marks lies on the near edge (Fig. 7).

    Parameters
    ----------
    disparity_px : (H, W) float, px
    view : CubeView

    Returns
    -------
    dict
        ``strict_pct`` of the strict maximum; ``whole_pct`` of the least mask that reaches the edge's top.
    """
    edge = edge_mask(view, disparity_px.shape)
    tolerances = {"strict": 0.0, "whole": whole_edge_tolerance_px(disparity_px, view)}
    masks = {name: _marked(disparity_px, tolerance) for name, tolerance in tolerances.items()}
    return {f"{name}_pct": 100 * float(edge[mask].mean()) if mask.any() else np.nan for name, mask in masks.items()}


def top_found(maps: Mapping[str, tuple[Floats, CubeView]]) -> dict[str, float]:
    """How often the recipe's first row is the top of the near edge (Fig. 8): rows alone, no scale.

    Parameters
    ----------
    maps : mapping of str to (disparity_px, view)

    Returns
    -------
    dict
        By name with ``_pct`` behind it: of the 256 thresholds of an 8-bit picture of the map, from its maximum to 0,
        those at which the first marked row is the edge's top to two pixels.
    """
    found = {}
    for name, (disparity_px, view) in maps.items():
        readings = _readings_cm(disparity_px, _tolerances_of_8_bits(disparity_px))
        top_row = _strict(disparity_px).foot_row - readings / printed_value("scale.cm_per_px")
        found[f"{name}_pct"] = 100 * float((np.abs(top_row - view.top_row) <= _ROWS).mean())
    return found


def floor_disturbs(here: Floats, on_floor: Bools, view: CubeView, farther: Floats) -> dict[str, float]:
    """What the floor does to the largest disparity.

    Parameters
    ----------
    here : (H, W) float, px
        Disparities at the printed distance.
    on_floor : (H, W) bool
        What is floor there.
    view : CubeView
        Where the edge is.
    farther : (H, W) float, px
        Of the same cube at another distance.

    Returns
    -------
    dict
        ``floor_px``: by how much the floor's largest disparity exceeds the near edge's; ``floor_pct``: of the strict
        maximum of the whole picture, nothing cut off, the share on the floor; ``moved_cm``: by how much the reading
        changes at the other distance, the constant and the threshold kept.
    """
    edge = here[edge_mask(view, here.shape)]
    all_rows = height_by_maximum(here, printed_value("scale.cm_per_px"), 0)
    threshold = _strict(here).threshold_px - whole_edge_tolerance_px(here, view)
    moved = reading_at_threshold_cm(farther, threshold) - reading_at_threshold_cm(here, threshold)
    return {
        "floor_px": float(np.nanmax(here[on_floor]) - np.nanmax(edge)),
        "floor_pct": 100 * float(on_floor[all_rows.mask].mean()),
        "moved_cm": abs(moved),
    }


def box_spread(boxes: Mapping[str, Sequence[PixelBox]]) -> dict[str, float]:
    """By how much the rectangle's height varies over exposures of one scene.

    Parameters
    ----------
    boxes : mapping of str to sequence of PixelBox

    Returns
    -------
    dict
        By name with ``_px`` behind it: the highest less the lowest.
    """
    return {f"{name}_px": float(np.ptp([box.height for box in same])) for name, same in boxes.items()}


def _strict(disparity_px: Floats, tolerance_px: float = 0.0) -> HeightResult:
    return height_by_maximum(
        disparity_px,
        printed_value("scale.cm_per_px"),
        printed_value("height.constant_rows"),
        tolerance_px=tolerance_px,
    )


def _side_cm() -> float:
    return paper_setup().side_mm / _MM_PER_CM


def _tolerances_of_8_bits(disparity_px: Floats) -> Float64:
    return _strict(disparity_px).threshold_px * np.arange(_LEVELS + 1) / _LEVELS


def _marked(disparity_px: Floats, tolerance_px: float) -> Bools:
    if not np.isfinite(tolerance_px):
        return np.zeros(np.shape(disparity_px), bool)
    return np.asarray(_strict(disparity_px, tolerance_px).mask)


def _readings_cm(disparity_px: Floats, tolerances_px: Float64 | Sequence[float]) -> Float64:
    scale, constant = printed_value("scale.cm_per_px"), printed_value("height.constant_rows")
    return heights_over_tolerances(disparity_px, scale, constant, tolerances_px) / _MM_PER_CM
