"""What a capture shows: both pictures with what is covered, the places of the boards, and what to do now."""

from __future__ import annotations

import math
from html import escape

import cv2
import numpy as np

from stereolib.base import Float32, UInt8, counted
from stereolib.calibration import BoardWatch, CaptureSession, CaptureState, boards_per_cell
from stereolib.notebook.live_link import LiveView

CAPTURE_TITLE = "stereolib capture: both cameras, live"
_TAKE, _FINISH = "take this pair", "enough"
CAPTURE_BUTTONS = {
    _TAKE: "Takes the next pair in which both cameras see the board, still or not.",
    _FINISH: "Ends here, with what was taken.",
}
_WIDTH = 560  # of a shown picture, px
_COVERED, _COVERED_SHARE = (90, 160, 0), 0.3  # blue, green, red
_READY, _WAITING, _NOW = (0, 160, 60), (0, 140, 230), (0, 60, 220)
_INK, _PAPER, _LINE = (40, 40, 40), 255, (210, 210, 210)
_CHART, _MARGIN = (560, 420), 46
_MOST_TILT_DEG = 50.0
_DISTANCE_ROW = 40  # of the chart, from below, px


def press(session: CaptureSession, name: str) -> None:
    """Do what a button of a capture's page does.

    Parameters
    ----------
    session : CaptureSession
    name : str
    """
    {_TAKE: session.take_now, _FINISH: session.finish}[name]()


def draw_capture(session: CaptureSession, state: CaptureState) -> LiveView:
    """Draw how a capture stands.

    Parameters
    ----------
    session : CaptureSession
    state : CaptureState

    Returns
    -------
    LiveView
        The left and the right picture, in green what boards covered; of a board the chart of their tilts and distances.
    """
    watch, images = session.watch, []
    for k, picture in enumerate(state.pair[:2]):
        shown = _small(picture)
        if watch is not None and state.look is not None:
            shown = _covered(shown, watch, k)
            is_ready = bool(state.name) or not state.look.advice
            _draw_board(shown, state.look.corners_px[k], watch, _READY if is_ready else _WAITING)
        images.append(shown)
    captions = ["left", "right"]
    if watch is not None:
        images.append(_chart(watch, state))
        captions = ["left; green: boards were here", "right", "tilt and distance of the boards, by a guessed lens"]
    return LiveView(tuple(images), tuple(captions), _said(session, state))


def _small(picture: UInt8) -> UInt8:
    scale = _WIDTH / picture.shape[1]
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(picture, None, fx=scale, fy=scale, interpolation=how), np.uint8)


def _covered(shown: UInt8, watch: BoardWatch, side: int) -> UInt8:
    """Tint what the boards taken covered."""
    views = watch.views
    cells = boards_per_cell((views.left_px, views.right_px)[side], watch.size) > 0
    mask = cv2.resize(cells.astype(np.uint8), shown.shape[1::-1], interpolation=cv2.INTER_NEAREST).astype(bool)
    tinted = shown.copy()
    tinted[mask] = np.rint((1 - _COVERED_SHARE) * shown[mask] + _COVERED_SHARE * np.array(_COVERED)).astype(np.uint8)
    return tinted


def _draw_board(shown: UInt8, corners_px: Float32 | None, watch: BoardWatch, color: tuple[int, int, int]) -> None:
    if corners_px is None:
        return
    known = corners_px[np.isfinite(corners_px).all(axis=1)] * (_WIDTH / watch.size[0])
    hull = np.rint(cv2.convexHull(known)).astype(np.int32)
    cv2.polylines(shown, [hull], True, color, 3, cv2.LINE_AA)
    for x, y in known:
        cv2.circle(shown, (round(float(x)), round(float(y))), 3, color, -1, cv2.LINE_AA)


def _chart(watch: BoardWatch, state: CaptureState) -> UInt8:
    """Tilts as a plane, distances as a line below: a dot for each pair taken, the board of now in red."""
    width, height = _CHART
    chart = np.full((height, width, 3), _PAPER, np.uint8)
    plane = np.array([[_MARGIN, 24], [width - 16, height - 2 * _DISTANCE_ROW - 30]])
    middle, half = plane.mean(axis=0), (plane[1] - plane[0]) / 2
    for degrees in (-40, -20, 0, 20, 40):
        x, y = np.rint(middle + half * degrees / _MOST_TILT_DEG).astype(int)
        cv2.line(chart, (x, plane[0, 1]), (x, plane[1, 1]), _LINE, 1)
        cv2.line(chart, (plane[0, 0], y), (plane[1, 0], y), _LINE, 1)
        _write(chart, f"{degrees}", (x - 10, plane[1, 1] + 16))
        _write(chart, f"{degrees}", (8, y + 5))
    _write(chart, "tilt (degrees): across about the vertical, up about the horizontal axis", (_MARGIN, 15))
    row = height - _DISTANCE_ROW
    away_mm = np.exp(watch.places[:, 2])
    now = None if state.look is None or state.look.place is None else state.look.place
    far = max([1000.0, *away_mm, *([] if now is None else [float(np.exp(now[2]))])]) * 1.1
    cv2.line(chart, (plane[0, 0], row), (plane[1, 0], row), _LINE, 1)
    _write(chart, f"distance (mm), 0 to {far:.0f}", (_MARGIN, row + 30))
    dots = [(place, _INK, 5) for place in watch.places] + ([] if now is None else [(now, _NOW, 8)])
    for place, color, radius in dots:
        tilt = np.clip(np.degrees(place[3:]) / _MOST_TILT_DEG, -1, 1)
        across = plane[0, 0] + (plane[1, 0] - plane[0, 0]) * np.exp(place[2]) / far
        for x, y in (middle + half * tilt, (across, row)):
            cv2.circle(chart, (round(float(x)), round(float(y))), radius, color, -1, cv2.LINE_AA)
    return chart


def _write(chart: UInt8, text: str, at: tuple[int, int]) -> None:
    cv2.putText(chart, text, (int(at[0]), int(at[1])), cv2.FONT_HERSHEY_SIMPLEX, 0.42, _INK, 1, cv2.LINE_AA)


def _said(session: CaptureSession, state: CaptureState) -> str:
    now = f"pair {state.name} is taken" if state.name else state.said
    lines = [f"<p class='stereolib-now{' stereolib-taken' * bool(state.name)}'>{escape(now)}</p>"]
    lines.append(f"<p>{state.taken} of {counted(session.wanted, 'pair')} taken</p>")
    if state.stuck:
        lines.append(f'<p>{escape(state.stuck)}. "{_FINISH}" ends it, with what was taken</p>')
    coverage = session.watch.coverage if session.watch is not None else None
    if coverage is not None:
        lines.append(f"<p>coverage: {escape(str(coverage))}</p>")
    rig = session.rig
    if not rig.recorded:
        rates = " and ".join("?" if math.isnan(rate) else f"{rate:.0f}" for rate in rig.rates_hz)
        dropped = f"; {counted(rig.dropped, 'pair')} too far apart dropped" if rig.dropped else ""
        skew = "" if math.isnan(rig.skew_p95_ms) else f"; skew {rig.skew_name}: 95 % up to {rig.skew_p95_ms:.0f} ms"
        lines.append(f"<p>{rates} pictures a second{escape(skew)}{dropped}</p>")
    return "".join(lines)
