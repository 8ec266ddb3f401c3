"""Calibration as the paper does it: each camera on its own, then the pair (section II.B)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from stereolib.calibration import bundle_adjustment
from stereolib.calibration.boards import Board, BoardViews
from stereolib.rig import Camera, RectifiedRig, StereoRig, distort

Array = np.ndarray

#: Lens models by name, shortest first: (number of coefficients, OpenCV flags). Table I is ``brown3``; ``brown2`` is all
#: that Kalibr's files hold.
LENS_MODELS: dict[str, tuple[int, int]] = {
    "pinhole": (
        0,
        cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3,
    ),
    "brown2": (4, cv2.CALIB_FIX_K3),
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
#: Long lenses creep along a flat valley, and a step is slow.
_FEW_STEPS = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 1e-10)


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
    """The pair: the rig, the two single calibrations it began from, and the fit per pair ``view_rms_px`` (n, 2).

    ``fit`` is the joint problem, linearised at the rig: `uncertainty` and `diagnosis` go on from it.
    """

    rig: StereoRig
    left: CameraCalibration
    right: CameraCalibration
    rms_px: float
    view_rms_px: Array
    fit: bundle_adjustment.Fit


def calibrate_camera(
    board: Board, corners_px: Array, size: tuple[int, int], *, model: str = "brown3"
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
    if (np.nanmax(corners_px, axis=0) - np.nanmin(corners_px, axis=0)).max() < 2:
        raise ValueError(f"all {views} views show the board in the same place: move and tilt it between pictures")
    points, images = _lists(board, corners_px)
    rms, K, dist, _, _, std, _, view_rms = cv2.calibrateCameraExtended(
        points, images, size, None, None, flags=flags, criteria=_CRITERIA if count <= 8 else _FEW_STEPS
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
        From `targets.find_in_pairs` or `detection.find_in_files`.
    model : str
        A name of `LENS_MODELS`.
    fixed : bool
        Keep the single lenses and find R and T alone, as the paper does.

    Raises
    ------
    ValueError
        As `calibrate_camera`; or if left and right are the same, or exchanged (the right camera would stand left).

    Notes
    -----
    R and T come from `cv2.stereoCalibrate` with the lenses fixed. It must be told the model's flags again: without
    them it reads only k1 k2 p1 p2 k3 of a longer lens and drops the rest in silence. The joint step is `bundle.fit`,
    which meets `cv2.stereoCalibrate`'s minimum in a tenth of its time (in a hundredth with 14 coefficients).
    """
    left, right = (
        calibrate_camera(views.board, corners, views.size, model=model) for corners in (views.left_px, views.right_px)
    )
    R, T = _relative(views, left.camera, right.camera, _model(model)[1])
    if T[0] > abs(T[1]):
        raise ValueError(
            f"the right camera comes out {T[0]:.0f} mm to the LEFT of the left one: the two image sets are "
            f"exchanged; swap them (or both cameras hang upside down: turn all pictures by 180 degrees)"
        )
    fit = bundle_adjustment.fit(views, StereoRig(left.camera, right.camera, R, T), free=not fixed)
    return StereoCalibration(fit.rig, left, right, fit.rms_px, fit.pair_rms_px, fit)


def _relative(views: BoardViews, left: Camera, right: Camera, flags: int) -> tuple[Array, Array]:
    """R and T (mm) with both lenses fixed, by `cv2.stereoCalibrate`."""
    stereo: Any = cv2.stereoCalibrate  # whose type stubs do not allow for vectors
    shared = np.isfinite(views.left_px) & np.isfinite(views.right_px)
    points, first = _lists(views.board, np.where(shared, views.left_px, np.nan))
    _, second = _lists(views.board, np.where(shared, views.right_px, np.nan))
    flags |= cv2.CALIB_FIX_INTRINSIC
    lenses = left.K.copy(), _padded(left.dist), right.K.copy(), _padded(right.dist)
    _, _, _, _, _, R, T, *_ = stereo(points, first, second, *lenses, views.size, flags=flags, criteria=_CRITERIA)
    return R, T.ravel()


def view_errors_px(camera: Camera, board: Board, corners_px: Array) -> Array:
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
    for k, (turn, shift) in enumerate(zip(*bundle_adjustment.poses(board.points_mm, corners_px, camera), strict=True)):
        errors[k] = corners_px[k] - camera.project(board.points_mm @ turn.T + shift)
    return errors


@dataclass(frozen=True)
class Fold:
    """Where a lens folds over inside the image: ``pixels`` of it have no direction, from ``radius_px`` outwards."""

    where: str
    pixels: int
    radius_px: float
    share: float

    def __str__(self) -> str:
        return f"folds over in the {self.where}, {self.radius_px:.0f} px and more from the centre"


def fold_inside(camera: Camera) -> Fold | None:
    """Whether a lens folds over inside its image, and where; None when it does not.

    A radial polynomial that fits the boards may turn back where none was seen: ``d(r g)/dr <= 0``. What the image
    shows there has no inverse.
    """
    if not np.isfinite(camera.fold_radius):
        return None
    width, height = camera.size
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    angle = np.linspace(0, 2 * np.pi, 361)
    ring, _ = distort(camera.fold_radius * np.column_stack([np.cos(angle), np.sin(angle)]), camera.dist)
    radius = np.hypot((u - camera.K[0, 2]) / camera.K[0, 0], (v - camera.K[1, 2]) / camera.K[1, 1])
    outside = radius > 0.97 * np.hypot(*ring.T).min()  # within, every pixel has a direction
    lost = np.zeros((height, width), bool)
    lost[outside] = ~np.isfinite(camera.rays(np.column_stack([u[outside], v[outside]]))[:, 0])
    if not lost.any():
        return None
    corners = (
        (f"{row} {column}", int(part.sum()))
        for row, band in zip(("upper", "lower"), np.array_split(lost, 2), strict=True)
        for column, part in zip(("left", "right"), np.array_split(band, 2, axis=1), strict=True)
    )
    where = " and ".join(f"{name} corner ({count} px)" for name, count in corners if count)
    far = np.hypot(u - camera.K[0, 2], v - camera.K[1, 2])[lost].min()
    return Fold(where, int(lost.sum()), float(far), float(lost.mean()))


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


def _lists(board: Board, corners_px: Array) -> tuple[list[Array], list[Array]]:
    """Board points and corners of each view as OpenCV takes them, without the corners that are NaN."""
    seen = np.isfinite(corners_px).all(axis=-1)
    points = [board.points_mm[at] for at in seen]
    return points, [np.float32(c[at]).reshape(-1, 1, 2) for c, at in zip(corners_px, seen, strict=True)]


def _padded(dist: Array) -> Array:
    return np.pad(dist, (0, max(0, 5 - dist.size)))[None].copy()
