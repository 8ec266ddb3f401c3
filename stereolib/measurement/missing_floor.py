"""Why no floor is seen in a pair: which of the causes it is, by the pictures themselves, and what helps."""

from __future__ import annotations

from enum import Enum

import cv2
import numpy as np

from stereolib.base import Float32, UInt8
from stereolib.matching import SGBMParams, compute_disparity
from stereolib.measurement.floor import Floor, FloorLimits, fit_floor
from stereolib.measurement.plane_alignment import CannotMeasure
from stereolib.measurement.views import Views
from stereolib.rig import RectifiedRig, to_grey

_DARK, _BRIGHT = 12, 252  # grey levels: darker shows nothing but noise, brighter is white
_MOST_LOST = 0.4  # share of the lower half that may be so dark or so bright
_TEXTURE = 3.0  # grey levels: deviation over a few pixels, below which there is nothing to match
_LEAST_TEXTURE = 0.2  # share of the lower half that must have more
_LEAST_MATCHED = 0.5  # share of what has texture that both cameras then show alike
_BETTER = 1.3  # so much more is matched with the cause taken away
_LEAST_NEAR = 0.1  # share of the lower half that is nearer than the window
_SHIFTS = range(-6, 7)  # rows of the quarter size
_LIMITS, _HIGHER = FloorLimits(), FloorLimits(camera_height_mm=5000.0)
_WINDOW, _WIDE = 64, 128  # disparities of the quarter size that `Views` searches, and all that are tried


#: What helps where no floor is seen.
FLOOR_BY_HAND = "; where height and pitch are known, give the floor by hand (--floor; in Python, floor_from_pose)"


class NoFloor(Enum):
    """Causes, with what to do."""

    DARK = "the pictures are too dark below: light the floor, or expose longer"
    BRIGHT = "the pictures are white below: expose shorter, or take the glare away"
    PLAIN = "the floor has no texture: put something patterned on it, or light it from the side"
    ROWS = "the rows of the two pictures disagree by about {:.0f} px: calibrate again, or see that both are of this rig"
    NEAR = "what is near reaches beyond the search window: step back until nothing is nearer than {:.0f} mm"
    GLOSSY = (
        "the floor has texture, but both cameras see it differently: it shines (take the light away from behind it, or "
        "cover it), or the pictures are not of one moment or not left one first"
    )
    HIGH = (
        "the camera stands {:.0f} mm above it: stand it lower, a floor is looked for up to "
        f"{_LIMITS.camera_height_mm:.0f} mm below"
    )
    UNSEEN = (
        "nothing below the camera is a plane: step back or tilt the camera down, "
        f"by {np.degrees(_LIMITS.tilt_rad):.0f} degrees at most, until both cameras see a free part of the floor; if "
        "the pictures are upside down, as of a rig that hangs on its head, turn both by 180 degrees and exchange them, "
        "those of the boards, too"
    )


def find_floor(views: Views, rectified: RectifiedRig) -> Floor:
    """Find the floor of a pair, or say why there is none.

    Parameters
    ----------
    views : Views
    rectified : RectifiedRig

    Returns
    -------
    Floor

    Raises
    ------
    CannotMeasure
        "no floor", with its cause and the remedy.
    """
    try:
        return fit_floor(views.disparity_px, rectified, pair=views.pair)
    except CannotMeasure:
        cause, value = why_no_floor(views, rectified)
        raise CannotMeasure("no floor", cause.value.format(value) + FLOOR_BY_HAND) from None


def why_no_floor(views: Views, rectified: RectifiedRig) -> tuple[NoFloor, float]:
    """Tell why a pair shows no floor.

    Parameters
    ----------
    views : Views
    rectified : RectifiedRig

    Returns
    -------
    cause : NoFloor
    value : float
        Rows, px, or the nearest distance that can be matched, mm, or the camera's height, mm; NaN of the other causes.

    Notes
    -----
    The first that holds, of the lower half of the pictures: too dark, too bright, plain; then, matched in quarter size,
    more agrees after a shift of rows; much is nearer than the search window; less than half of what has texture agrees;
    there is a floor, but the camera stands too high above it.
    """
    grey = [to_grey(image) for image in (views.left, views.right)]
    below = [image[image.shape[0] // 2 :] for image in grey]
    if max(float(np.mean(image < _DARK)) for image in below) > _MOST_LOST:
        return NoFloor.DARK, np.nan
    if max(float(np.mean(image > _BRIGHT)) for image in below) > _MOST_LOST:
        return NoFloor.BRIGHT, np.nan
    quarter = [np.asarray(cv2.resize(image, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)) for image in grey]
    wide = min(_WIDE, (quarter[0].shape[1] - 8) // 16 * 16)
    if wide < 16:  # SGBM matches no fewer disparities
        return NoFloor.UNSEEN, np.nan
    textured = _deviation(quarter[0])[quarter[0].shape[0] // 2 :] > _TEXTURE
    if textured.mean() < _LEAST_TEXTURE:
        return NoFloor.PLAIN, np.nan
    found = {shift: _matched(quarter, shift, wide)[textured] for shift in _SHIFTS}
    shares = {shift: float(np.isfinite(disparity).mean()) for shift, disparity in found.items()}
    best = max(_SHIFTS, key=lambda shift: shares[shift])
    if shares[best] > max(_LEAST_MATCHED, _BETTER * shares[0]):
        return NoFloor.ROWS, 4.0 * best + views.rows.offset_px
    if np.mean(found[0] > _WINDOW - 2) > _LEAST_NEAR:
        return NoFloor.NEAR, rectified.f_px * rectified.baseline_mm / (4 * _WINDOW)
    if shares[0] < _LEAST_MATCHED:
        return NoFloor.GLOSSY, np.nan
    try:
        return NoFloor.HIGH, fit_floor(views.disparity_px, rectified, limits=_HIGHER).camera_height_mm
    except CannotMeasure:
        return NoFloor.UNSEEN, np.nan


def _deviation(grey: UInt8) -> Float32:
    """Local standard deviation."""
    mean = cv2.blur(grey.astype(np.float32), (5, 5))
    return np.asarray(np.sqrt(np.maximum(cv2.sqrBoxFilter(grey, cv2.CV_32F, (5, 5)) - mean**2, 0)))


def _matched(quarter: list[UInt8], shift: int, wide: int) -> Float32:
    """Disparities of the lower half with the right picture's rows shifted up."""
    params = SGBMParams(num_disparities=wide, mode="3way", speckle_window_size=25)
    disparity = compute_disparity(quarter[0], np.roll(quarter[1], -shift, axis=0), params, whole=True)
    return np.asarray(disparity[disparity.shape[0] // 2 :])
