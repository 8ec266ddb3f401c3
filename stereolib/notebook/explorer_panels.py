"""What the bench shows of a state: four pictures, the line of results, and what a click finds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import cv2
import numpy as np

from stereolib.base import Float64, Floats, UInt8
from stereolib.matching import pixel_cost
from stereolib.measurement import OBJECT_RGB, MeasuredObject, Measurement, SurfacePoint, draw_objects, measure_between
from stereolib.notebook import chain
from stereolib.notebook.knobs import BEST, State
from stereolib.paper import HeightResult
from stereolib.plotting import LASER, OURS, PAPER, REFUSED, TRUTH, color_disparity, color_error, figure_to_image, panels
from stereolib.rig import RectifiedRig

WIDTH = 560  # of a shown picture, px
_BAR, _LABELS = 14, 60  # widths of a colour bar and of its numbers, px
_ERROR_PX = 4.0  # where the colours of an error end
_AHEAD_MM, _ASIDE_MM = (-150.0, 2050.0), (-1250.0, 1250.0)  # what is seen from above
_INTERVAL = 1.96
_AROUND_PX = 7  # half the window in which disparities scatter around a click
_STRIP_PX = 20  # rows above and below a clicked one
_LEAST_STD_PX = 1 / 16  # OpenCV's steps
_NOT_CALIBRATED = "the laser's pose is not known"  # on the bench it never is
_FONT = cv2.FONT_HERSHEY_SIMPLEX
#: Captions of the four pictures.
CAPTIONS = ("left picture", "disparity (px)", "disparity less the truth (px)", "from above (grid: 0.5 m)")


def _bgr(color: str) -> tuple[int, int, int]:
    return int(color[5:7], 16), int(color[3:5], 16), int(color[1:3], 16)


def draw_panels(state: State) -> list[UInt8]:
    """Draw the four pictures of a state, named in `CAPTIONS`.

    Parameters
    ----------
    state : State
        Of half size: the preview, without what measuring the box in the pictures takes.

    Returns
    -------
    list of (H, W, 3) uint8, blue-green-red
    """
    return [_left(state), _disparity(state), _error(state), _above(state)]


def scale_of(state: State) -> float:
    """Shown pixels for each pixel of the pair.

    Parameters
    ----------
    state : State

    Returns
    -------
    float
    """
    width: int = chain.pair(state)[0].shape[1]
    return WIDTH / width


def _left(state: State) -> UInt8:
    """The left picture with what the recipe counted, and in full size with the objects that both sensors measured."""
    measured = None if state.half else chain.measured(state)
    picture = draw_objects(measured) if isinstance(measured, Measurement) else chain.pair(state)[0].copy()
    picture = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR) if picture.ndim == 2 else picture
    read = chain.recipe(state)
    if isinstance(read, HeightResult):
        picture[read.mask] = _bgr(PAPER)
    shown = _fitted(picture)
    if isinstance(read, HeightResult):
        scale = scale_of(state)
        for row in (read.top_row, read.foot_row):
            cv2.line(shown, (0, round(scale * row)), (WIDTH, round(scale * row)), _bgr(PAPER), 1)
        at = round(scale * read.column), round(scale * read.top_row)
        cv2.circle(shown, at, 7, (255, 255, 255), 3, cv2.LINE_AA)
        cv2.circle(shown, at, 7, _bgr(PAPER), 2, cv2.LINE_AA)
    return shown


def _disparity(state: State) -> UInt8:
    most = state.min_disparity + state.num_disparities
    scale = 2 if state.half else 1
    picture = color_disparity(scale * chain.filtered(state), max(0, state.min_disparity), most)
    return _with_bar(_fitted(picture), max(0, state.min_disparity), most, is_error=False)


def _error(state: State) -> UInt8:
    """The map less the truth where both cameras see it; grey: unknown, or seen by one camera alone."""
    truth = chain.known(state)
    shape = chain.pair(state)[0].shape
    scale = 2 if state.half else 1
    error = np.full(shape[:2], np.nan)
    if truth is not None:
        error = np.where(truth.visible, scale * (chain.filtered(state) - truth.disparity_px), np.nan)
    picture = color_error(error, _ERROR_PX)
    shown = _with_bar(_fitted(picture), -_ERROR_PX, _ERROR_PX, is_error=True)
    if truth is None:
        _write(shown, "nobody knows the truth of this pair", (20, 40))
    return shown


def _above(state: State) -> UInt8:
    """The laser's readings, the true footprint, and the measured one."""
    height = round(WIDTH * (_AHEAD_MM[1] - _AHEAD_MM[0]) / (_ASIDE_MM[1] - _ASIDE_MM[0]))
    picture = np.full((height, WIDTH, 3), 252, np.uint8)
    for mm in np.arange(-1000.0, 2001.0, 500.0):
        _line(picture, np.array([[mm, _ASIDE_MM[0]], [mm, _ASIDE_MM[1]]]), (225, 225, 225))
        _line(picture, np.array([[_AHEAD_MM[0], mm], [_AHEAD_MM[1], mm]]), (225, 225, 225))
    eye = np.array([[0.0, 0.0], [2000.0, 840.0], [2000.0, -840.0]])
    _line(picture, eye[[1, 0, 2]], (190, 190, 190))
    _write(picture, "cameras and laser", _placed(eye[:1])[0] + [10, 18], 0.6)
    for outline in _true_outlines(state):
        _line(picture, np.vstack([outline, outline[:1]]), _bgr(TRUTH), 1)
    measured = None if state.half else chain.measured(state)
    if isinstance(measured, Measurement):
        for k, entry in enumerate(measured.objects):
            color = OBJECT_RGB[k % len(OBJECT_RGB)][::-1]
            _line(picture, np.vstack([entry.outline_mm, entry.outline_mm[:1]]), color, 2)
    if chain.scan(state) is not None:
        for u, v in _placed(points_of(state)):
            cv2.circle(picture, (int(u), int(v)), 2, _bgr(LASER), -1, cv2.LINE_AA)
    return picture


def points_of(state: State) -> Float64:
    """The laser's readings where the program believes them, mm forward and to the left.

    Parameters
    ----------
    state : State

    Returns
    -------
    (N, 2) float64
    """
    from stereolib.laser import points_mm

    turn = chain.scan(state)
    assert turn is not None
    points = points_mm(turn)
    return np.asarray(points[np.isfinite(points).all(axis=1)])


def _true_outlines(state: State) -> list[Float64]:
    truth = chain.true_scene(state)
    outlines = []
    for box in truth.boxes[1:] if truth else ():
        half = np.array(box.size_mm[:2]) / 2
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
        outlines.append(corners @ box.T_world_box[:2, :2].T + box.T_world_box[:2, 3])
    return outlines


def _placed(points_mm: Floats) -> Floats:
    """Pixels in the view from above: forward is up."""
    scale = WIDTH / (_ASIDE_MM[1] - _ASIDE_MM[0])
    return np.column_stack([(_ASIDE_MM[1] - points_mm[:, 1]) * scale, (_AHEAD_MM[1] - points_mm[:, 0]) * scale])


def _line(picture: UInt8, points_mm: Floats, color: Sequence[int], thick: int = 1) -> None:
    cv2.polylines(picture, [np.rint(_placed(points_mm)).astype(np.int32)], False, color, thick, cv2.LINE_AA)


def _fitted(picture: UInt8) -> UInt8:
    """A picture in the size in which it is shown; no colour that is not in it."""
    height = round(picture.shape[0] * WIDTH / picture.shape[1])
    return np.asarray(cv2.resize(picture, (WIDTH, height), interpolation=cv2.INTER_NEAREST))


def _with_bar(picture: UInt8, low: float, high: float, *, is_error: bool) -> UInt8:
    height = picture.shape[0]
    ramp = np.linspace(high, low, height)[:, None].repeat(_BAR, axis=1)
    bar = color_error(ramp, high) if is_error else color_disparity(ramp, low, high)
    labels = np.full((height, _LABELS, 3), 255, np.uint8)
    for share in np.linspace(0, 1, 5):
        row = round((1 - share) * (height - 1))
        cv2.line(labels, (0, row), (4, row), (60, 60, 60), 1)
        _write(labels, f"{low + share * (high - low):g}", (7, int(np.clip(row + 6, 14, height - 3))), 0.6)
    return np.hstack([picture, np.full((height, 6, 3), 255, np.uint8), bar, labels])


def _write(picture: UInt8, text: str, at: Sequence[int], size: float = 0.5) -> None:
    cv2.putText(picture, text, (int(at[0]), int(at[1])), _FONT, size, (40, 40, 40), 1, cv2.LINE_AA)


def result_line(state: State) -> str:
    """What each method reads, beside each other, in HTML.

    Parameters
    ----------
    state : State
        Of half size, the methods that need the full pictures show dots.

    Returns
    -------
    str
    """
    truth, read = chain.true_scene(state), chain.recipe(state)
    true_mm = truth.boxes[1].size_mm if truth and len(truth.boxes) == 2 else None
    recipe = f"{read.height_mm / 10:.1f} cm high" if isinstance(read, HeightResult) else f"nothing: {read}"
    cells = [
        ("truth", TRUTH, " x ".join(f"{mm / 10:.1f}" for mm in true_mm) + " cm" if true_mm else "unknown"),
        ("the paper's recipe", PAPER, recipe),
    ]
    if state.half:
        cells += [("ground plane", OURS, "…"), ("laser and pair", OURS, "…")]
    else:
        cells += [("ground plane", OURS, _plane_text(state)), ("laser and pair", OURS, _fused_text(state))]
    cells.append(("map on the box" if truth else "map", REFUSED, _quality_text(state)))
    parts = "".join(f'<div><b style="color:{color}">{name}</b>{escape(text)}</div>' for name, color, text in cells)
    warned = "".join(f'<p class="stereolib-warnings">{escape(text)}</p>' for text in _warnings(state))
    return f'<div class="stereolib-result">{parts}</div>{warned}'


def _warnings(state: State) -> list[str]:
    """What the measurement says of the rig, without what the bench knows itself, and what takes long."""
    if state.half and state.matcher == BEST:
        return [f'half size for now: the matcher "{BEST}" computes the full one for some seconds …']
    measured = None if state.half else chain.measured(state)
    texts = measured.warnings if isinstance(measured, Measurement) else ()
    return [text for text in texts if not text.startswith(_NOT_CALIBRATED)]


def _plane_text(state: State) -> str:
    attempt = chain.ground_plane(state)
    if attempt is None:
        return "needs a calibration"
    if attempt.refused:
        return f"refused: {attempt.refused}"
    return f"{attempt.height_mm / 10:.2f} ± {_INTERVAL * attempt.std_mm / 10:.2f} cm high (95 %)"


def _fused_text(state: State) -> str:
    measured = chain.measured(state)
    if not isinstance(measured, Measurement):
        return f"refused: {measured}"
    whole = [entry for entry in measured.objects if np.isfinite(entry.size_mm).any()]
    if not whole:
        return "nothing was measured"
    return "; ".join(_sizes(entry) for entry in whole[:3])


def _sizes(entry: MeasuredObject) -> str:
    parts = [
        f"{size / 10:.2f} ± {_INTERVAL * std / 10:.2f}" if np.isfinite(size) else "?"
        for size, std in zip(entry.size_mm, entry.std_mm, strict=True)
    ]
    return " x ".join(parts) + " cm"


def _quality_text(state: State) -> str:
    quality = chain.quality(state)
    matched = 100 * np.isfinite(chain.filtered(state)).mean()
    if quality is None:
        return f"{matched:.0f} % of the pixels have a disparity"
    bad = quality.bad1_pct if state.half else quality.bad2_pct  # a pixel of the half size is two
    return f"bad 2: {bad:.1f} %, matched: {quality.density_pct:.1f} %"


@dataclass(frozen=True, eq=False)
class Found:
    """What a click finds.

    Attributes
    ----------
    pixel : (column, row)
    disparity_px, std_px : float
        NaN where nothing was matched.
    point_mm, ray : (3,) float64
        In the rectified left camera's frame; the ray has depth 1. NaN without a calibration.
    depth_std_mm : float
    height_mm : float
        Above the floor; NaN where none was found.
    """

    pixel: tuple[int, int]
    disparity_px: float
    std_px: float
    point_mm: Float64
    ray: Float64
    depth_std_mm: float
    height_mm: float

    @property
    def text(self) -> str:
        """A sentence."""
        where = f"column {self.pixel[0]}, row {self.pixel[1]}"
        if np.isnan(self.disparity_px):
            return f"{where}: no disparity was found here"
        said = f"{where}: disparity {self.disparity_px:.2f} ± {_INTERVAL * self.std_px:.2f} px"
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
    return Found(pixel, d, std, point, ray, float(depth_std), height)


def _scatter_px(map_px: Floats, pixel: tuple[int, int]) -> float:
    u, v = pixel
    rows, columns = (slice(max(0, at - _AROUND_PX), at + _AROUND_PX + 1) for at in (v, u))
    window = map_px[rows, columns]
    y, x = np.nonzero(np.isfinite(window) & (np.abs(window - map_px[v, u]) < 2 * _ERROR_PX))
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
