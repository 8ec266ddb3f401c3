"""The four pictures that the bench shows of a state."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from stereolib.base import Float64, Floats, UInt8
from stereolib.laser import points_mm
from stereolib.measurement import OBJECT_RGB, Measurement, draw_objects
from stereolib.notebook import chain
from stereolib.notebook.knobs import State
from stereolib.paper import HeightResult
from stereolib.plotting import LASER, PAPER, TRUTH, color_disparity, color_error
from stereolib.virtual import recordings

WIDTH = 560  # of a shown picture, px
_GAP, _BAR, _LABELS = 6, 14, 60  # beside it: nothing, a colour bar, its numbers, px
_ERROR_PX = 4.0  # where the colours of an error end
_AHEAD_MM, _FAR_MM = (-150.0, 2050.0), 4000.0  # what is seen from above; beyond its sides
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
    disparity = _disparity(state)
    return [_left(state), disparity, _error(state), _above(state, disparity.shape)]


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
    picture = draw_objects(measured, sizes=False) if isinstance(measured, Measurement) else chain.pair(state)[0].copy()
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
    scale = 2 if state.half else 1
    picture = color_disparity(scale * chain.filtered(state), *state.colors_px)
    return _with_bar(_fitted(picture), *state.colors_px, is_error=False)


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
        _write(shown, "nobody knows the truth of this pair", (20, 40), 18)
    return shown


def _above(state: State, shape: tuple[int, ...]) -> UInt8:
    """The laser's readings, the true footprint, and the measured one, in a picture of the others' shape."""
    picture = np.full(shape, 252, np.uint8)
    has_rig, has_scan = chain.rectified_rig(state) is not None, chain.scan(state) is not None
    if not (has_rig or has_scan):
        _write(picture, "no calibration and no laser: no mm", (20, 40), 18)
        return picture
    for mm in np.arange(-2000.0, 2001.0, 500.0):
        _line(picture, np.array([[mm, -_FAR_MM], [mm, _FAR_MM]]), (225, 225, 225))
        _line(picture, np.array([[-_FAR_MM, mm], [_FAR_MM, mm]]), (225, 225, 225))
    eye = np.array([[0.0, 0.0], [2000.0, 840.0], [2000.0, -840.0]])
    if has_rig:
        _line(picture, eye[[1, 0, 2]], (190, 190, 190))
    seen_by = " and ".join(["cameras"] * has_rig + ["laser"] * has_scan)
    _write(picture, seen_by, _placed(picture, eye[:1])[0] + [12, 6], 16)
    for outline in true_outlines(state):
        _line(picture, np.vstack([outline, outline[:1]]), _bgr(TRUTH), 1)
    measured = None if state.half else chain.measured(state)
    if isinstance(measured, Measurement):
        for k, entry in enumerate(measured.objects):
            color = OBJECT_RGB[k % len(OBJECT_RGB)][::-1]
            _line(picture, np.vstack([entry.outline_mm, entry.outline_mm[:1]]), color, 2)
    if has_scan:
        for u, v in _placed(picture, points_of(state)):
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
    turn = chain.scan(state)
    assert turn is not None
    points = points_mm(turn)
    return np.asarray(points[np.isfinite(points).all(axis=1)])


def true_outlines(state: State) -> list[Float64]:
    """Where the boxes stand, mm forward and to the left of the left camera's foot.

    Parameters
    ----------
    state : State

    Returns
    -------
    list of (4, 2) float64
    """
    truth, T_here_world = chain.true_scene(state), np.eye(4)
    if state.source.startswith("room/"):  # its scene is that of the whole walk
        T_here_world = np.linalg.inv(recordings.setup("pitched")) @ chain.pose(state)
    outlines = []
    for box in truth.boxes[1:] if truth else ():
        half = np.array(box.size_mm[:2]) / 2
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
        T = T_here_world @ box.T_world_box
        outlines.append(corners @ T[:2, :2].T + T[:2, 3])
    return outlines


def _placed(picture: UInt8, points_mm: Floats) -> Floats:
    """Pixels in the view from above: forward is up."""
    height, width = picture.shape[:2]
    scale = height / (_AHEAD_MM[1] - _AHEAD_MM[0])
    return np.column_stack([width / 2 - points_mm[:, 1] * scale, (_AHEAD_MM[1] - points_mm[:, 0]) * scale])


def _line(picture: UInt8, points_mm: Floats, color: Sequence[int], thick: int = 1) -> None:
    placed = np.rint(_placed(picture, points_mm)).astype(np.int32)
    cv2.polylines(picture, [placed], False, color, thick, cv2.LINE_AA)


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
        _write(labels, f"{low + share * (high - low):g}", (7, int(np.clip(row + 6, 15, height - 3))), 18)
    return np.hstack([picture, np.full((height, _GAP, 3), 255, np.uint8), bar, labels])


def _write(picture: UInt8, text: str, at: Sequence[int], size_px: int) -> None:
    """Write, in OpenCV 5 with the one of its fonts whose noughts are not crossed out."""
    place, color = (int(at[0]), int(at[1])), (40, 40, 40)
    if hasattr(cv2, "FontFace"):
        cv2.putText(picture, text, place, color, cv2.FontFace("uni"), size_px)
    else:
        cv2.putText(picture, text, place, _FONT, size_px / 30, color, 1, cv2.LINE_AA)
