"""What a check of a calibration says: what has moved, what that does, and what these pairs cannot tell."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from stereolib.base import plus_minus
from stereolib.calibration.findings import ERROR_PCT
from stereolib.calibration.movement import MOVEMENTS, Moved

if TYPE_CHECKING:
    from stereolib.calibration.fresh_check import CalibrationCheck

#: What a verdict allows.
CHECK_MEANINGS = {
    "still good": "measure with it",
    "usable": "sizes and depths to a few per cent; calibrate again for more",
    "recalibrate": "do not measure with it, calibrate again",
    "no verdict": "a board that is not flat is no ruler: glue it onto something flat and take it again",
}
_TIED, _OPEN_PX = 0.95, 0.1  # correlation of two movements, and what they leave open, px: then nothing tells them apart
_OTHER_PCT, _OTHER_ROWS = 10.0, 0.006  # of squares; share of the picture's width: no knock does so much and is not seen
_TURNS, _POSES = 3, 6  # movements of the right camera: turns, then shifts; behind them those of focus
#: What each movement is called where it is one of several that explain the same.
_LIKE = {
    "tilt": "a tilt of the right camera",
    "yaw": "a turn of the right camera about the vertical axis",
    "roll": "a roll of the right camera",
    "baseline": "a change of the baseline or of the square's edge",
    "rise": "a shift of the right camera up or down",
    "advance": "a shift of the right camera forwards or back",
    "left focus": "another focus of the left lens",
    "right focus": "another focus of the right lens",
    "both focus": "another focus of both lenses",
}
#: Each movement in words; which way, and what comes out too large or small, for a positive and a negative one.
_MOVED = {
    "tilt": "rows: the right camera has tilted {way} by {degrees}: rows off by {rows:.2f} px",
    "yaw": "depths: the right camera has turned {way} about the vertical axis by {degrees}: depths at {at:.0f} mm come "
    "out {depth:.1f} % too {too}",
    "roll": "rows: the right camera has rolled {way} by {degrees}: rows change by {width:.2f} px from side to side",
    "baseline": "scale: boards come out {share} too {too}: the cameras stand {mm} {way} than calibrated, or the "
    "square's edge is {other:.2f} mm and not {edge:g} mm",
    "rise": "rows: the right camera has moved {way} by {mm}",
    "advance": "scale: the right camera has moved {way} by {mm}",
    "left focus": "focus: the left lens's focal length is {percent} {way} than calibrated",
    "right focus": "focus: the right lens's focal length is {percent} {way} than calibrated",
    "both focus": "focus: the focal length of both lenses is {percent} {way} than calibrated: depths come out too "
    "{too}",
}
_WAYS = {
    "tilt": (("down", ""), ("up", "")),
    "yaw": (("inwards", "large"), ("outwards", "small")),
    "roll": (("anticlockwise", ""), ("clockwise", "")),
    "baseline": (("farther apart", "small"), ("nearer together", "large")),
    "rise": (("up", ""), ("down", "")),
    "advance": (("forwards", ""), ("back", "")),
    "left focus": (("longer", ""), ("shorter", "")),
    "right focus": (("longer", ""), ("shorter", "")),
    "both focus": (("longer", "small"), ("shorter", "large")),
}


def check_findings(check: CalibrationCheck, bent: str) -> Iterator[str]:
    """Yield what is wrong, causes first; ``bent`` says how the board is bent, if it is."""
    is_other = check.sizes.square_error_pct > _OTHER_PCT or check.row_rms_px > _OTHER_ROWS * check.views.size[0]
    if is_other:
        yield "this is far more than a knock does: is the calibration of these cameras, and are the squares as told?"
    elif bent:
        yield bent
    else:
        yield from (_moved_text(check, moved) for moved in check.movement.named)
    over = [str(limited) for limited in check.checks if limited.level]
    yield from over
    if not (is_other or bent or check.movement.named):
        explained = "the calibration's own deviations and the corners' noise explain that: nothing has moved for sure"
        yield explained if over else "nothing has moved that these pairs can tell"


def check_notes(check: CalibrationCheck) -> Iterator[str]:
    """Yield what these pairs, or this calibration file, leave open."""
    if check.record.outer_px is None:
        yield "the calibration does not say which boards made it: whether these are fresh cannot be checked"
    if not check.record.whole:
        yield "the calibration states no deviations, or each by itself: what it could not know is not told apart well"
    if check.board_pct.std > ERROR_PCT[0]:
        yield f"the size of the board is sure to {check.board_pct.std:.2f} % only: take more pairs, and nearer ones"
    correlation = np.abs(check.movement.correlation)
    for a, name in enumerate(MOVEMENTS[:_TURNS]):
        b = _TURNS + int(correlation[a, _TURNS:_POSES].argmax())
        if correlation[a, b] > _TIED and check.rig.right.K[0, 0] * check.movement.std[a] > _OPEN_PX:
            yield f"{_LIKE[name]} and {_LIKE[MOVEMENTS[b]]} can hardly be told apart here"
    if check.movement.std[_POSES:].max() > ERROR_PCT[1] / 100:
        yield "another focus of both lenses can hardly be seen here: tilt the board by 20 to 40 degrees"
    if len(check.views) == 1:
        yield "one pair shows one place of the picture at one distance: a few more, near and far, tell more"


def _moved_text(check: CalibrationCheck, moved: Moved) -> str:
    """One movement in words, with what it does, and what would look alike."""
    rig, value, distance = check.rig, abs(moved.value), float(np.median(check.distance_mm))
    edge, longer = check.views.board.square_mm, 1 + moved.value / rig.baseline_mm
    share = 100 / rig.baseline_mm
    way, too = _WAYS[moved.what][moved.value < 0]
    text = _MOVED[moved.what].format(
        way=way,
        too=too,
        degrees=f"{plus_minus(*np.degrees([value, moved.std]))} degrees",
        mm=f"{plus_minus(value, moved.std)} mm",
        percent=f"{plus_minus(100 * value, 100 * moved.std)} %",
        share=f"{plus_minus(share * value / longer, share * moved.std / longer**2)} %",
        rows=rig.right.K[1, 1] * value,
        width=rig.right.size[0] * value,
        at=distance,
        depth=distance * value * share,
        edge=edge,
        other=edge / longer,
    )
    alike = [_LIKE[name] for name in moved.alike]
    return text + f" (as well explained by {' or '.join(alike)})" * bool(alike)
