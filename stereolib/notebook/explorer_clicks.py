"""What a click on the bench finds: depth and height there, a length, and what each disparity costs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stereolib.base import Float64, Floats, UInt8
from stereolib.matching import pixel_cost
from stereolib.measurement import SurfacePoint, measure_between
from stereolib.notebook import chain
from stereolib.notebook.knobs import FILTERS, State
from stereolib.plotting import OURS, PAPER, TRUTH, figure_to_image, panels
from stereolib.rig import RectifiedRig

_INTERVAL = 1.96
_AROUND_PX = 7  # half the window in which disparities scatter around a click
_STRIP_PX = 20  # rows above and below a clicked one
_LEAST_STD_PX = 1 / 8  # a step of OpenCV's to either side, and what all of a patch share
_MATCHED = 0.8  # share of the window that must be matched, and near
_UNLIKE_PX = 2.0  # farther off is another surface, or another match
_FILTERING = {"paper": "this matcher dilates its map, which moves disparities",
              "fast": "this matcher enlarges a map of half the size"}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Found:
    """What a click finds.

    Attributes
    ----------
    pixel : (column, row)
    disparity_px, std_px : float
        NaN where nothing was matched; the deviation also where none can be told.
    doubt : str
        Why there is no deviation; empty where there is one.
    true_px : float
        NaN where nobody knows.
    point_mm : (3,) float64
        In the rectified left camera's frame. NaN without a calibration.
    depth_std_mm : float
    height_mm : float
        Above the floor; NaN where none was found.
    """

    pixel: tuple[int, int]
    disparity_px: float
    std_px: float
    true_px: float
    point_mm: Float64
    depth_std_mm: float
    height_mm: float
    doubt: str = ""

    @property
    def text(self) -> str:
        """A sentence."""
        where = f"column {self.pixel[0]}, row {self.pixel[1]}"
        true = "" if np.isnan(self.true_px) else f" (true: {self.true_px:.1f})"
        if np.isnan(self.disparity_px):
            return f"{where}: no disparity was found here{true}"
        said = f"{where}: disparity {self.disparity_px:.2f}{_plus_minus(self.std_px, 2)} px{true}"
        if np.isfinite(self.point_mm[2]):
            said += f", depth {self.point_mm[2]:.0f}{_plus_minus(self.depth_std_mm, 0)} mm"
        if np.isfinite(self.height_mm):
            said += f", {self.height_mm:z.0f} mm above the floor"
        column = self.pixel[0] - self.disparity_px
        said += f". Its partner lies on row {self.pixel[1]} of the right picture, in column {column:.1f}"
        return f"{said}. No interval is told: {self.doubt}" if self.doubt else said


def _plus_minus(std: float, decimals: int) -> str:
    return f" ± {_INTERVAL * std:.{decimals}f}" if np.isfinite(std) else ""


def find(state: State, pixel: tuple[int, int]) -> Found:
    """Look a pixel up.

    Parameters
    ----------
    state : State
        Of full size.
    pixel : (column, row)
        Of the rectified left picture.

    Returns
    -------
    Found

    Notes
    -----
    The variance of the disparity is that of those around it about a plane, the squared difference from a second, rough
    matching of the pair, and an eighth of a pixel squared: matching errs over whole patches, which scatter does not
    show. That of the depth is ``(Z^2 / (f B))^2`` times as large. It is told where it holds the truth about as often as
    it says: not after a filter, not where the two matchings differ by more than 2 px, and not where less than four
    fifths of what is around was matched.
    """
    map_px, rectified, (u, v) = chain.filtered(state), chain.rectified_rig(state), pixel
    d, (std, doubt) = float(map_px[v, u]), _std_px(state, pixel)
    point, depth_std, height = np.full(3, np.nan), np.nan, np.nan
    if rectified is not None and d > 0:
        fB = rectified.f_px * rectified.baseline_mm
        ray = np.linalg.inv(rectified.P1[:, :3]) @ [u, v, 1.0]
        point, depth_std = ray * fB / d, fB / d**2 * std
        attempt = chain.ground_plane(state)
        if attempt is not None and attempt.floor is not None:
            height = float(attempt.floor.height_mm(np.array(float(u)), np.array(float(v)), np.array(d)))
    known = chain.known(state)
    true = float(known.disparity_px[v, u]) if known else np.nan
    return Found(pixel, d, std, true, point, float(depth_std), height, doubt)


def _std_px(state: State, pixel: tuple[int, int]) -> tuple[float, str]:
    """Deviation of the disparity at a pixel; NaN where it cannot be told, and why."""
    (u, v), map_px, (_, rough_px) = pixel, chain.filtered(state), chain.rows(state)
    if state.matcher in _FILTERING:
        return np.nan, _FILTERING[state.matcher]
    if state.filter != FILTERS[0]:
        before = replace(state, filter=FILTERS[0])
        d, (std, _) = float(chain.filtered(before)[v, u]), _std_px(before, pixel)
        known = "nothing was matched here" if np.isnan(d) else f"{d:.2f}{_plus_minus(std, 2)} px"
        return np.nan, f"the filter moves disparities; before it: {known}"
    rough = 2 * float(rough_px[min(v // 2, len(rough_px) - 1), min(u // 2, rough_px.shape[1] - 1)])
    found = "nothing" if np.isnan(rough) else f"{rough:.0f} px"
    if not abs(rough - map_px[v, u]) <= _UNLIKE_PX:
        return np.nan, f"a second, rough matching of the pair found {found} here"
    scatter, matched = _scatter_px(map_px, pixel)
    if matched < _MATCHED:
        return np.nan, "too little was matched around it"
    return float(np.sqrt(scatter**2 + (rough - map_px[v, u]) ** 2 + _LEAST_STD_PX**2)), ""


def _scatter_px(map_px: Floats, pixel: tuple[int, int]) -> tuple[float, float]:
    """Scatter about a plane around a pixel, and the share of the window that was matched near it."""
    u, v = pixel
    rows, columns = (slice(max(0, at - _AROUND_PX), at + _AROUND_PX + 1) for at in (v, u))
    window = map_px[rows, columns]
    y, x = np.nonzero(np.abs(window - map_px[v, u]) < _UNLIKE_PX)
    plane = np.column_stack([x, y, np.ones(len(x))])
    left = window[y, x] - plane @ np.linalg.lstsq(plane, window[y, x], rcond=None)[0]
    return float(1.4826 * np.median(np.abs(left))) if len(x) else np.nan, len(x) / window.size


def length_text(one: Found, other: Found, rectified: RectifiedRig | None) -> str:
    """Say how far two clicks lie apart.

    Parameters
    ----------
    one, other : Found
    rectified : RectifiedRig or None

    Returns
    -------
    str
        Empty where there is no calibration, one has no depth, or both are one.
    """
    if rectified is None or one.pixel == other.pixel or not min(one.disparity_px, other.disparity_px) > 0:
        return ""
    stds = np.nan_to_num([one.std_px, other.std_px])
    first, second = (
        SurfacePoint(np.array(at.pixel, float), at.disparity_px, std)
        for at, std in zip((one, other), stds, strict=True)
    )
    between = measure_between(first, second, rectified)
    std_mm = between.std_mm if stds.all() else np.nan  # of one end alone it would be too small
    return f"{between.length_mm:.1f}{_plus_minus(std_mm, 1)} mm between the last two clicks"


def draw_costs(state: State, found: Found) -> list[UInt8] | str:
    """Draw what each disparity costs a pixel, before and after the paths' sums, and its row of the right picture.

    Parameters
    ----------
    state : State
        Of full size.
    found : Found

    Returns
    -------
    two of (H, W, 3) uint8, blue-green-red, or str
        Why there are no costs.
    """
    left, right = chain.pair(state)
    try:
        cost = pixel_cost(left, right, found.pixel, state.sgbm)
    except ValueError as error:
        return str(error)
    truth, (u, v) = chain.known(state), found.pixel
    curve_figure, (curve,) = panels(1, width_in=4.8, aspect=0.75)
    curves = ((cost.matching, "0.5", "the blocks alone"), (cost.summed, OURS, "with the paths' sums"))
    for values, color, name in curves:
        scaled = (values - values.min()) / max(1, np.ptp(values))
        curve.plot(cost.disparities_px, scaled, color=color, lw=1.3, label=name)
    curve.plot(cost.best_px, 0, "o", color=OURS, ms=7, label=f"least sum: {cost.best_px} px")
    if truth is not None and np.isfinite(truth.disparity_px[v, u]):
        curve.axvline(truth.disparity_px[v, u], color=TRUTH, ls="--", lw=1.2, label="true disparity")
    curve.set(xlabel="disparity (px)", ylabel="cost (least 0, most 1)", title="what each disparity costs this pixel")
    curve.legend(fontsize=8)
    strip_figure, (strip,) = panels(1, width_in=4.8, aspect=0.75)
    rows = slice(max(0, v - _STRIP_PX), v + _STRIP_PX + 1)
    shown = right[rows]
    extent = (-0.5, right.shape[1] - 0.5, rows.start + len(shown) - 0.5, rows.start - 0.5)
    strip.imshow(shown[..., ::-1] if shown.ndim == 3 else shown, cmap="gray", aspect="auto", extent=extent)
    strip.axhline(v, color=PAPER, lw=1, label="its epipolar line")
    match = "its match" if np.isfinite(found.disparity_px) else "the least cost, which the matcher's checks refused"
    strip.plot(u - cost.best_px, v, "o", mfc="none", mec=OURS, ms=10, mew=2, label=match)
    strip.set(xlabel="column (px)", ylabel="row (px)", title="the right picture around the same row")
    strip.legend(fontsize=8)
    return [figure_to_image(curve_figure), figure_to_image(strip_figure)]
