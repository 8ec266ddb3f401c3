"""What a click on the bench finds: depth and height there, a length, and what each disparity costs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolib.base import Float64, Floats, UInt8
from stereolib.matching import pixel_cost
from stereolib.measurement import SurfacePoint, measure_between
from stereolib.notebook import chain
from stereolib.notebook.knobs import State
from stereolib.plotting import OURS, PAPER, TRUTH, figure_to_image, panels
from stereolib.rig import RectifiedRig

_INTERVAL = 1.96
_AROUND_PX = 7  # half the window in which disparities scatter around a click
_STRIP_PX = 20  # rows above and below a clicked one
_NEAR_PX = 8.0  # of disparity: farther off is another surface
_LEAST_STD_PX = 1 / 16  # OpenCV's steps


@dataclass(frozen=True, eq=False)
class Found:
    """What a click finds.

    Attributes
    ----------
    pixel : (column, row)
    disparity_px, std_px : float
        NaN where nothing was matched.
    true_px : float
        NaN where nobody knows.
    point_mm, ray : (3,) float64
        In the rectified left camera's frame; the ray has depth 1. NaN without a calibration.
    depth_std_mm : float
    height_mm : float
        Above the floor; NaN where none was found.
    """

    pixel: tuple[int, int]
    disparity_px: float
    std_px: float
    true_px: float
    point_mm: Float64
    ray: Float64
    depth_std_mm: float
    height_mm: float

    @property
    def text(self) -> str:
        """A sentence."""
        where = f"column {self.pixel[0]}, row {self.pixel[1]}"
        true = "" if np.isnan(self.true_px) else f" (true: {self.true_px:.1f})"
        if np.isnan(self.disparity_px):
            return f"{where}: no disparity was found here{true}"
        said = f"{where}: disparity {self.disparity_px:.2f} ± {_INTERVAL * self.std_px:.2f} px{true}"
        if np.isfinite(self.depth_std_mm):
            said += f", depth {self.point_mm[2]:.0f} ± {_INTERVAL * self.depth_std_mm:.0f} mm"
        if np.isfinite(self.height_mm):
            said += f", {self.height_mm:z.0f} mm above the floor"
        column = self.pixel[0] - self.disparity_px
        return f"{said}. Its partner lies on row {self.pixel[1]} of the right picture, in column {column:.1f}"


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
    The deviation of the disparity is the scatter of those around it about a plane, and at least a sixteenth pixel,
    OpenCV's step; that of the depth is ``Z^2 / (f B)`` times as large.
    """
    map_px, rectified, (u, v) = chain.filtered(state), chain.rectified_rig(state), pixel
    d, std = float(map_px[v, u]), _scatter_px(map_px, pixel)
    point, ray, depth_std, height = np.full(3, np.nan), np.full(3, np.nan), np.nan, np.nan
    if rectified is not None and d > 0:
        fB = rectified.f_px * rectified.baseline_mm
        ray = np.linalg.inv(rectified.P1[:, :3]) @ [u, v, 1.0]
        point, depth_std = ray * fB / d, fB / d**2 * std
        attempt = chain.ground_plane(state)
        if attempt is not None and attempt.floor is not None:
            height = float(attempt.floor.height_mm(np.array(float(u)), np.array(float(v)), np.array(d)))
    known = chain.known(state)
    true = float(known.disparity_px[v, u]) if known else np.nan
    return Found(pixel, d, std, true, point, ray, float(depth_std), height)


def _scatter_px(map_px: Floats, pixel: tuple[int, int]) -> float:
    u, v = pixel
    rows, columns = (slice(max(0, at - _AROUND_PX), at + _AROUND_PX + 1) for at in (v, u))
    window = map_px[rows, columns]
    y, x = np.nonzero(np.isfinite(window) & (np.abs(window - map_px[v, u]) < _NEAR_PX))
    if len(x) < 6:
        return float("nan")
    plane = np.column_stack([x, y, np.ones(len(x))])
    left = window[y, x] - plane @ np.linalg.lstsq(plane, window[y, x], rcond=None)[0]
    return float(max(1.4826 * np.median(np.abs(left)), _LEAST_STD_PX))


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
    first, second = (SurfacePoint(np.array(at.pixel, float), at.disparity_px, at.std_px) for at in (one, other))
    between = measure_between(first, second, rectified)
    if np.isnan(between.std_mm):
        return ""
    return f"{between.length_mm:.1f} ± {_INTERVAL * between.std_mm:.1f} mm between the last two clicks"


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
    strip.plot(u - cost.best_px, v, "o", mfc="none", mec=OURS, ms=10, mew=2, label="its match")
    strip.set(xlabel="column (px)", ylabel="row (px)", title="the right picture around the same row")
    strip.legend(fontsize=8)
    return [figure_to_image(curve_figure), figure_to_image(strip_figure)]
