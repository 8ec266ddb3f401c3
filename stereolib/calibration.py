"""Calibration as the paper does it: each camera on its own, then the pair (section II.B)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from stereolib.rig import Camera, RectifiedRig, StereoRig
from stereolib.targets import BoardViews, Checkerboard

Array = np.ndarray

#: Lens models by name: (number of coefficients, OpenCV flags). Table I is ``brown3``.
LENS_MODELS: dict[str, tuple[int, int]] = {
    "pinhole": (
        0,
        cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3,
    ),
    "brown3": (5, 0),
    "rational8": (8, cv2.CALIB_RATIONAL_MODEL),
    "thin_prism12": (12, cv2.CALIB_RATIONAL_MODEL | cv2.CALIB_THIN_PRISM_MODEL),
    "tilted14": (
        14,
        cv2.CALIB_RATIONAL_MODEL | cv2.CALIB_THIN_PRISM_MODEL | cv2.CALIB_TILTED_MODEL,
    ),
}
_MIN_VIEWS = 3
_CRITERIA = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-10)


@dataclass(frozen=True, eq=False)
class CameraCalibration:
    """One camera: the lens, its standard deviations, and how well the corners fit.

    ``std`` is (4 + n,): of fx fy cx cy (px) and of the n coefficients. ``view_rms_px`` is (views,).
    """

    camera: Camera
    std: Array
    rms_px: float
    view_rms_px: Array


@dataclass(frozen=True, eq=False)
class StereoCalibration:
    """The pair: the rig, the two single calibrations it began from, and the fit per pair ``view_rms_px`` (n, 2)."""

    rig: StereoRig
    left: CameraCalibration
    right: CameraCalibration
    rms_px: float
    view_rms_px: Array


def calibrate_camera(
    board: Checkerboard, corners_px: Array, size: tuple[int, int], *, model: str = "brown3"
) -> CameraCalibration:
    """Calibrate one camera (Zhang's method, `cv2.calibrateCamera`).

    Parameters
    ----------
    corners_px : (views, corners, 2) array
    size : (width, height)
    model : str
        A name of `LENS_MODELS`.

    Raises
    ------
    ValueError
        Fewer than 3 views, all views alike, or an unknown model.
    """
    count, flags = _model(model)
    views = len(corners_px)
    if views < _MIN_VIEWS:
        raise ValueError(
            f"{views} views of the board are too few: at least {_MIN_VIEWS} with different tilts are needed, "
            f"and 15 to 30 give a trustworthy lens"
        )
    if np.ptp(np.asarray(corners_px, float), axis=0).max() < 2:
        raise ValueError(f"all {views} views show the board in the same place: move and tilt it between pictures")
    points = [board.points_mm] * views
    images = [np.float32(c).reshape(-1, 1, 2) for c in corners_px]
    rms, K, dist, _, _, std, _, view_rms = cv2.calibrateCameraExtended(
        points, images, size, None, None, flags=flags, criteria=_CRITERIA
    )
    if not np.isfinite(rms):
        raise ValueError(f"the calibration of {views} views did not converge: are they all tilted the same way?")
    camera = Camera(K, np.ravel(dist)[:count], size)
    return CameraCalibration(camera, np.ravel(std)[: 4 + count], float(rms), np.ravel(view_rms))


def calibrate_stereo(views: BoardViews, *, model: str = "brown3") -> StereoCalibration:
    """Calibrate both cameras on their own, then the pair, all parameters together.

    The single calibrations are the start; the joint step refines them along with R and T, which ties the two
    lenses together where the paper's second step would keep the first one's errors.

    Parameters
    ----------
    views : BoardViews
        From `targets.find_in_pairs`.

    Raises
    ------
    ValueError
        As `calibrate_camera`; or if left and right are exchanged (the right camera would stand left).
    """
    left, right = (
        calibrate_camera(views.board, corners, views.size, model=model) for corners in (views.left_px, views.right_px)
    )
    count, flags = _model(model)
    images = [[np.float32(c).reshape(-1, 1, 2) for c in corners] for corners in (views.left_px, views.right_px)]
    stereo: Any = cv2.stereoCalibrateExtended  # whose type stubs do not allow for vectors
    rms, K1, d1, K2, d2, R, T, *_, view_rms = stereo(
        [views.board.points_mm] * len(views), *images,
        left.camera.K.copy(), _padded(left.camera.dist), right.camera.K.copy(), _padded(right.camera.dist), views.size,
        np.eye(3), np.zeros((3, 1)), flags=flags | cv2.CALIB_USE_INTRINSIC_GUESS, criteria=_CRITERIA,
    )  # fmt: skip
    if T[0, 0] > 0:
        raise ValueError(
            f"the right camera comes out {T[0, 0]:.0f} mm to the LEFT of the left one: the two image sets are "
            f"exchanged; swap them"
        )
    first, second = (Camera(K, np.ravel(d)[:count], views.size) for K, d in ((K1, d1), (K2, d2)))
    return StereoCalibration(StereoRig(first, second, R, T), left, right, float(rms), np.asarray(view_rms))


def view_errors_px(camera: Camera, board: Checkerboard, corners_px: Array) -> Array:
    """How well a lens explains views that it may never have seen: each board is posed anew, the lens stays.

    Parameters
    ----------
    corners_px : (views, corners, 2) array

    Returns
    -------
    (views, corners, 2) float64, px
        Corner found minus corner predicted; its rms over views left out of the calibration is the hold-out error.
    """
    errors = np.empty(np.shape(corners_px))
    for k, corners in enumerate(np.asarray(corners_px, float)):
        _, turn, shift = cv2.solvePnP(board.points_mm, corners, camera.K, camera.dist)
        points = board.points_mm @ cv2.Rodrigues(turn)[0].T + shift.T
        errors[k] = corners - camera.project(points)
    return errors


def epipolar_errors_px(rectified: RectifiedRig, views: BoardViews) -> Array:
    """Row of each corner in the rectified left image minus its row in the right one: zero for a perfect rig.

    Returns
    -------
    (views, corners) float64, px
    """
    left, right = (
        rectified.rectify_points(np.reshape(corners, (-1, 2)), side)[:, 1]
        for corners, side in ((views.left_px, "left"), (views.right_px, "right"))
    )
    return (left - right).reshape(len(views), -1)


def _model(name: str) -> tuple[int, int]:
    if name not in LENS_MODELS:
        raise ValueError(f"unknown lens model {name!r}; choose one of {', '.join(LENS_MODELS)}")
    return LENS_MODELS[name]


def _padded(dist: Array) -> Array:
    return np.pad(dist, (0, max(0, 5 - dist.size)))[None].copy()
