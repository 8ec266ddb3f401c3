"""Calibration as the paper does it: each camera on its own, then the pair (section II.B)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from stereolib.base import Bools, Float32, Float64, Floats
from stereolib.calibration.board_views import BoardViews, check_corners
from stereolib.calibration.boards import Board
from stereolib.calibration.bundle_adjustment import RigFit, fit_rig
from stereolib.calibration.lens_models import LENS_MODELS
from stereolib.rig import Camera, RectifiedRig, StereoRig, one_opencv_thread

_MIN_VIEWS = 3  # of a board: two leave the centre of the image open
_SAME_PX = 2.0  # boards whose corners differ by less were held still: a hand moves them farther
_SCALE_STEP_PX = 20  # spacing of the pixels that are asked how rectification moves them
_STEPS = 200  # to where OpenCV stops by itself
_LONG_LENS_STEPS = 30  # lenses of more than eight coefficients creep along a flat valley, and a step is slow
_LONG_LENS = 8
_LEAST_CHANGE = 1e-10  # of the parameters, relative: OpenCV's other end


@dataclass(frozen=True, eq=False)
class CameraCalibration:
    """One camera: the lens, its standard deviations, and how well the corners fit.

    Attributes
    ----------
    camera : Camera
    std : (4 + n,) float64
        Of fx fy cx cy (px) and of the n coefficients.
    rms_px : float
        Over all corners.
    view_rms_px : (views,) float64
    """

    camera: Camera
    std: Float64
    rms_px: float
    view_rms_px: Float64


@dataclass(frozen=True, eq=False)
class StereoCalibration:
    """The calibrated pair, and what it began from.

    Attributes
    ----------
    left, right : CameraCalibration
        The two single calibrations.
    fit : RigFit
        The joint problem, linearised at the rig: `rig_covariance` and `diagnose` go on from it.
    """

    left: CameraCalibration
    right: CameraCalibration
    fit: RigFit

    @property
    def rig(self) -> StereoRig:
        """The calibrated rig."""
        return self.fit.rig

    @property
    def rms_px(self) -> float:
        """Rms distance of found and predicted corners over both cameras."""
        return self.fit.rms_px


def calibrate_camera(
    board: Board, corners_px: Floats, size: tuple[int, int], *, model: str = "brown3"
) -> CameraCalibration:
    """Calibrate one camera (Zhang's method, `cv2.calibrateCamera`).

    Parameters
    ----------
    board : Checkerboard or Charuco
    corners_px : (views, corners, 2) array
        NaN where a corner was not found.
    size : (width, height), px
    model : str
        A name of `LENS_MODELS`.

    Returns
    -------
    CameraCalibration

    Raises
    ------
    ValueError
        Fewer than 3 views, all views alike, corners outside the pictures, a view with fewer than four of them or all
        on one line, or an unknown model.
    """
    count, flags = _model(model)
    views = len(corners_px)
    check_corners(board, corners_px, size, [f"view {k + 1}" for k in range(views)])
    if views < _MIN_VIEWS:
        why = f"{views} views of the board are too few: at least {_MIN_VIEWS} with different tilts are needed"
        raise ValueError(f"{why}, and 15 to 30 give a trustworthy lens")
    seen_px = corners_px[:, np.isfinite(corners_px).any(axis=(0, 2))]
    if (np.nanmax(seen_px, axis=0) - np.nanmin(seen_px, axis=0)).max() < _SAME_PX:
        raise ValueError(f"all {views} views show the board in the same place: move and tilt it between pictures")
    until = _until(_STEPS if count <= _LONG_LENS else _LONG_LENS_STEPS)
    with one_opencv_thread():
        rms, K, dist, _, _, std, _, view_rms = cv2.calibrateCameraExtended(
            *_lists(board, corners_px), size, None, None, flags=flags, criteria=until
        )
    if not np.isfinite(rms):
        raise ValueError(f"the calibration of {views} views did not converge: are they all tilted the same way?")
    camera = Camera(K, np.ravel(dist)[:count], size)
    return CameraCalibration(camera, np.ravel(std)[: 4 + count], float(rms), np.ravel(view_rms))


def calibrate_stereo(views: BoardViews, *, model: str = "brown3", fixed: bool = False) -> StereoCalibration:
    """Calibrate both cameras on their own, then the pair, all parameters together.

    The single calibrations are the start; the joint step refines them along with R and T, which ties the two
    lenses together where the paper's second step would keep the first one's errors.

    Parameters
    ----------
    views : BoardViews
        From `find_in_pairs` or `find_in_files`.
    model : str
        A name of `LENS_MODELS`.
    fixed : bool
        Keep the single lenses and find R and T alone, as the paper does.

    Returns
    -------
    StereoCalibration

    Raises
    ------
    ValueError
        As `calibrate_camera`; or if left and right are the same, or exchanged (the right camera would stand left).

    Notes
    -----
    R and T come from `cv2.stereoCalibrate` with the lenses fixed. It must be told the model's flags again: without
    them it reads only k1 k2 p1 p2 k3 of a longer lens and drops the rest in silence. The joint step is `fit_rig`,
    which meets `cv2.stereoCalibrate`'s minimum in a tenth of its time with up to five coefficients, and goes below it
    with more, whose minimum lies far along a flat valley; `RigFit.converged` says whether it was reached. OpenCV runs
    on one thread, so that the same corners always give the same rig.
    """
    if len(views) and np.array_equal(views.left_px, views.right_px, equal_nan=True):
        raise ValueError("left and right have the same corners: both are the same pictures. Give each camera's own")
    both = views.left_px, views.right_px
    left, right = (calibrate_camera(views.board, corners, views.size, model=model) for corners in both)
    R, T = _relative(views, left.camera, right.camera, _model(model)[1])
    if T[0] > abs(T[1]):
        why = f"the right camera comes out {T[0]:.0f} mm to the LEFT of the left one: the two image sets are exchanged"
        raise ValueError(
            f"{why}; swap them (or both cameras hang upside down: turn all pictures by 180 degrees; or mirror)"
        )
    return StereoCalibration(left, right, fit_rig(views, StereoRig(left.camera, right.camera, R, T), free=not fixed))


def _relative(views: BoardViews, left: Camera, right: Camera, flags: int) -> tuple[Float64, Float64]:
    """R and T (mm) with both lenses fixed, by `cv2.stereoCalibrate`."""
    shared = np.isfinite(views.left_px) & np.isfinite(views.right_px)
    points, first = _lists(views.board, np.where(shared, views.left_px, np.nan))
    _, second = _lists(views.board, np.where(shared, views.right_px, np.nan))
    dists = [np.pad(camera.dist, (0, max(0, 5 - camera.dist.size)))[None] for camera in (left, right)]
    lenses = left.K.copy(), dists[0], right.K.copy(), dists[1]
    flags |= cv2.CALIB_FIX_INTRINSIC
    stereo: Any = cv2.stereoCalibrate  # whose type stubs do not allow for vectors
    until = _until(_STEPS)
    with one_opencv_thread():
        _, _, _, _, _, R, T, *_ = stereo(points, first, second, *lenses, views.size, flags=flags, criteria=until)
    return R, T.ravel()


def epipolar_errors_px(rectified: RectifiedRig, views: BoardViews) -> Float64:
    """Subtract the row of each corner in the rectified right image from that in the left one: 0 for a perfect rig.

    Parameters
    ----------
    rectified : RectifiedRig
    views : BoardViews

    Returns
    -------
    (views, corners) float64, px
    """
    sides = (views.left_px, "left"), (views.right_px, "right")
    left, right = (rectified.rectify_points(np.reshape(corners, (-1, 2)), side)[:, 1] for corners, side in sides)
    return np.reshape(left - right, (len(views), -1))


def rectified_scale(rectified: RectifiedRig) -> tuple[float, float]:
    """Measure how much rectification magnifies, and what it leaves of the pictures.

    Parameters
    ----------
    rectified : RectifiedRig

    Returns
    -------
    magnification : float
        Rectified pixels for a pixel of a picture, along one direction: the median over what is left of it.
    left : float
        Share of the picture that the rectified one shows, 0 to 1. Of both cameras the worse.
    """
    width, height = rectified.size
    steps = (
        np.arange(_SCALE_STEP_PX // 2, width, _SCALE_STEP_PX),
        np.arange(_SCALE_STEP_PX // 2, height, _SCALE_STEP_PX),
    )
    grid = np.stack(np.meshgrid(*steps), -1).reshape(-1, 2)
    asked, found = np.concatenate([grid, grid + np.array([1, 0]), grid + np.array([0, 1])]), []
    for side in ("left", "right"):
        at, right, below = rectified.rectify_points(asked, side).reshape(3, -1, 2)
        (a, b), (c, d) = (right - at).T, (below - at).T
        shown = np.all((at >= 0) & (at <= np.array([width, height]) - 1), axis=1) & np.isfinite(a * d - b * c)
        scale = float(np.sqrt(np.median(np.abs(a * d - b * c)[shown]))) if shown.any() else np.inf
        found.append((scale, float(shown.mean())))
    return max(scale for scale, _ in found), min(share for _, share in found)


def _model(name: str) -> tuple[int, int]:
    if name not in LENS_MODELS:
        raise ValueError(f"unknown lens model {name!r}; choose one of {', '.join(LENS_MODELS)}")
    return LENS_MODELS[name]


def _until(steps: int) -> tuple[int, int, float]:
    """Criteria of an optimiser of OpenCV."""
    return (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, steps, _LEAST_CHANGE)


def _lists(board: Board, corners_px: Floats) -> tuple[list[Float32], list[Float32]]:
    """Board points and corners of each view as OpenCV takes them, without the corners that are NaN."""
    known: Bools = np.asarray(np.isfinite(corners_px).all(axis=-1))
    points = [board.points_mm[at] for at in known]
    return points, [c[at].astype(np.float32).reshape(-1, 1, 2) for c, at in zip(corners_px, known, strict=True)]
