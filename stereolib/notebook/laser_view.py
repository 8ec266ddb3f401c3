"""What the live laser shows: its readings from above, and how the line does."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import cv2
import numpy as np

from stereolib.base import UInt8
from stereolib.laser import RPM_LIMITS, LaserScan, LiveTurn, points_mm
from stereolib.notebook.live_link import LiveView

LASER_TITLE = "stereolib lrf live: the laser, from above"
END = "end"
LASER_BUTTONS = {END: "Ends the command that reads the sensor."}
_SIZE, _MIDDLE = 640, 320  # of the picture, px
_INK, _RING, _GREEN, _OLD = (40, 40, 40), (215, 215, 215), (115, 158, 0), (205, 225, 180)
_RING_MM = 1000.0
_FAR_SHARE, _FARTHEST_MM = 98.0, 6000.0  # percentile of the readings that is inside the picture


def draw_turns(recent: Sequence[LiveTurn]) -> LiveView:
    """Draw the last turns, the newest darkest; forward is up, angles run counter-clockwise.

    Parameters
    ----------
    recent : sequence of LiveTurn
        One at least, the newest last.

    Returns
    -------
    LiveView
    """
    now = recent[-1]
    far_mm = _far_mm([turn.scan for turn in recent])
    chart = np.full((_SIZE, _SIZE, 3), 255, np.uint8)
    scale = (_MIDDLE - 10) / far_mm
    for radius_mm in np.arange(_RING_MM, far_mm + 1, _RING_MM):
        cv2.circle(chart, (_MIDDLE, _MIDDLE), round(float(radius_mm * scale)), _RING, 1, cv2.LINE_AA)
        at = (_MIDDLE + 4, _MIDDLE - round(float(radius_mm * scale)) + 14)
        cv2.putText(chart, f"{radius_mm / 1000:.0f} m", at, cv2.FONT_HERSHEY_SIMPLEX, 0.45, _INK, 1, cv2.LINE_AA)
    for turn in recent:
        _dots(chart, turn.scan, scale, _GREEN if turn is now else _OLD)
    nose = np.array([[0, -9], [6, 7], [-6, 7]]) + _MIDDLE
    cv2.fillConvexPoly(chart, nose.astype(np.int32), _INK, cv2.LINE_AA)
    return LiveView((chart,), ("forward is up",), _said(now))


def laser_line(turn: LiveTurn) -> str:
    """Say how the laser does, in one line.

    Parameters
    ----------
    turn : LiveTurn

    Returns
    -------
    str
    """
    seen = np.isfinite(turn.scan.ranges_mm).mean()
    rate = "" if np.isnan(turn.rate_hz) else f"{turn.rate_hz:.1f} turns a second, "
    rpm = "speed not told" if np.isnan(turn.scan.speed_rpm) else f"{turn.scan.speed_rpm:.0f} rpm"
    lost = f"{turn.packets_lost} packets lost ({turn.lost_share:.1%}), {turn.bad_checksums} damaged"
    return f"{rpm}, {rate}{lost}, {seen:.0%} of the beams with a reading, {turn.turns} turns"


def _far_mm(scans: Sequence[LaserScan]) -> float:
    ranges = np.concatenate([scan.ranges_mm for scan in scans])
    seen = ranges[np.isfinite(ranges)]
    far = np.percentile(seen, _FAR_SHARE) if len(seen) else _RING_MM
    return float(min(np.ceil(far / _RING_MM) * _RING_MM, _FARTHEST_MM))


def _dots(chart: UInt8, scan: LaserScan, scale: float, color: tuple[int, int, int]) -> None:
    for x, y in points_mm(scan) * scale:
        cv2.circle(chart, (round(float(_MIDDLE - y)), round(float(_MIDDLE - x))), 2, color, -1, cv2.LINE_AA)


def _said(turn: LiveTurn) -> str:
    (low, high), rpm = RPM_LIMITS, turn.scan.speed_rpm
    html = f"<p class='stereolib-now'>{escape(laser_line(turn))}</p>"
    if rpm < low or rpm > high:
        advice = f"the sensor needs {low:.0f} to {high:.0f} rpm: change the motor's supply so that it makes about 300"
        html += f"<p class='stereolib-refused'>{advice}</p>"
    return html
