"""The pair of cameras, and the pair after rectification."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike

from stereolib.base import finite_array, set_frozen, write_atomic
from stereolib.rig.camera import Camera

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class StereoRig:
    """Two cameras; ``x_right = R x_left + T`` in millimetres (OpenCV's convention, CONVENTIONS.md)."""

    left: Camera
    right: Camera
    R: Array
    T: Array

    def __post_init__(self) -> None:
        set_frozen(self, R=finite_array(self.R, (3, 3), "R"), T=finite_array(np.ravel(self.T), (3,), "T"))
        if np.abs(self.R @ self.R.T - np.eye(3)).max() > 1e-6 or np.linalg.det(self.R) < 0:
            raise ValueError("R is not a rotation: R R^T differs from 1. Printed matrices must be re-orthonormalised")
        if self.left.size != self.right.size:
            raise ValueError(f"the cameras' images differ in size: {self.left.size} and {self.right.size}")

    @property
    def baseline_mm(self) -> float:
        """Distance of the optical centres, ``|T|``, mm."""
        return float(np.linalg.norm(self.T))

    @property
    def E(self) -> Array:
        """Essential matrix ``skew(T) R``: ``x_right^T E x_left = 0`` for ideal coordinates. (3, 3), mm."""
        return skew(self.T) @ self.R

    @property
    def F(self) -> Array:
        """Fundamental matrix ``K_R^-T E K_L^-1``, not normalised: ``u_right^T F u_left = 0``. (3, 3)."""
        return np.linalg.inv(self.right.K).T @ self.E @ np.linalg.inv(self.left.K)

    def rectify(self, alpha: float = 0.0) -> RectifiedRig:
        """Turn both cameras so that rows agree (Bouguet's method, `cv2.stereoRectify`).

        Parameters
        ----------
        alpha : float
            0 keeps only pixels that exist in both (the image is magnified), 1 keeps all.

        Raises
        ------
        ValueError
            If alpha is out of range, or the right camera does not stand to the right of the left one.
        """
        if not 0 <= alpha <= 1:
            raise ValueError(f"alpha must lie between 0 (only valid pixels) and 1 (all pixels), got {alpha}")
        if not -self.T[0] > abs(self.T[1]):
            x, y, z = self.T
            raise ValueError(
                f"the right camera must stand to the right of the left one (T along -x), got T = ({x:.1f}, {y:.1f}, "
                f"{z:.1f}) mm: swap the cameras, or, if one stands above the other, turn all pictures by a quarter"
            )
        R1, R2, P1, P2, Q, *_ = cv2.stereoRectify(
            self.left.K, self.left.dist, self.right.K, self.right.dist, self.left.size, self.R, self.T[:, None],
            flags=cv2.CALIB_ZERO_DISPARITY, alpha=alpha,
        )  # fmt: skip
        return RectifiedRig(self, R1, R2, P1, P2, Q)

    def save(self, path: str | PathLike[str], *, calibration: Mapping[str, object] | None = None) -> Path:
        """Write the rig as JSON (format ``stereolib.rig/1``), every digit kept.

        Parameters
        ----------
        path : path
        calibration : mapping, optional
            How the rig was found, kept under this name for people and other programs; `load` does not need it.

        Raises
        ------
        ValueError
            If `calibration` holds what JSON does not, such as NaN.
        """
        cameras = {
            side: {"K": c.K.tolist(), "dist": c.dist.tolist(), "size": list(c.size)}
            for side, c in (("left", self.left), ("right", self.right))
        }
        rig = {
            "format": "stereolib.rig/1",
            **cameras,
            "R": self.R.tolist(),
            "T_mm": self.T.tolist(),
            **({} if calibration is None else {"calibration": dict(calibration)}),
        }
        return write_atomic(path, json.dumps(rig, indent=1, allow_nan=False) + "\n")

    @classmethod
    def load(cls, path: str | PathLike[str]) -> StereoRig:
        """Read what `save` wrote; ValueError names the file and what is wrong with it."""
        try:
            rig = json.loads(Path(path).read_text(encoding="utf-8"))
            if rig["format"] != "stereolib.rig/1":
                raise ValueError(f"its format is {rig['format']!r}, expected 'stereolib.rig/1'")
            left, right = (Camera(c["K"], c["dist"], tuple(c["size"])) for c in (rig["left"], rig["right"]))
            return cls(left, right, rig["R"], rig["T_mm"])
        except (ValueError, LookupError, TypeError, OverflowError) as error:
            why = f"it has no {error}" if isinstance(error, KeyError) else error
            raise ValueError(f"{path} is not a rig file of stereolib: {why}") from error


@dataclass(frozen=True, eq=False)
class RectifiedRig:
    """A rig after rectification: rows agree, and ``depth = f B / disparity``.

    ``R1, R2`` turn points of each camera's frame into its rectified frame, ``P1, P2`` project them, ``Q`` maps
    ``(u, v, disparity, 1)`` to homogeneous millimetres.
    """

    rig: StereoRig
    R1: Array
    R2: Array
    P1: Array
    P2: Array
    Q: Array
    size: tuple[int, int] = field(init=False)

    def __post_init__(self) -> None:
        for name, shape in (
            ("R1", (3, 3)),
            ("R2", (3, 3)),
            ("P1", (3, 4)),
            ("P2", (3, 4)),
            ("Q", (4, 4)),
        ):
            set_frozen(self, **{name: finite_array(getattr(self, name), shape, name)})
        set_frozen(self, size=self.rig.left.size)

    @property
    def f_px(self) -> float:
        """Focal length of both rectified images, px."""
        return float(self.P1[0, 0])

    @property
    def baseline_mm(self) -> float:
        """Distance of the optical centres, mm."""
        return float(-self.P2[0, 3] / self.P2[0, 0])

    @cached_property
    def left(self) -> Camera:
        """The rectified left camera: a pinhole without distortion."""
        return Camera(self.P1[:, :3], np.zeros(0), self.size)

    @cached_property
    def maps(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Fixed-point lookup maps of `cv2.remap` for the left and the right image, computed once."""
        return tuple(  # type: ignore[return-value]
            cv2.initUndistortRectifyMap(c.K, c.dist, R, P, self.size, cv2.CV_16SC2)
            for c, R, P in ((self.rig.left, self.R1, self.P1), (self.rig.right, self.R2, self.P2))
        )

    def rectify(self, left: Array, right: Array) -> tuple[Array, Array]:
        """Undistort and rectify a pair of images.

        Parameters
        ----------
        left, right : (H, W) or (H, W, 3) uint8

        Raises
        ------
        ValueError
            If an image is not of the calibrated size, or one is grey and the other in colour.
        """
        for side, image in (("left", left), ("right", right)):
            if image.shape[1::-1] != self.size:
                raise ValueError(
                    f"the {side} image is {image.shape[1]}x{image.shape[0]}, the calibration is for "
                    f"{self.size[0]}x{self.size[1]}: use images of that size or calibrate again"
                )
        if left.ndim != right.ndim:
            raise ValueError(f"one image is grey, the other in colour (shapes {left.shape}, {right.shape})")
        pair = [cv2.remap(i, *m, cv2.INTER_LINEAR) for i, m in zip((left, right), self.maps, strict=True)]
        return pair[0], pair[1]

    def rectify_points(self, pixels: Array, side: str) -> Array:
        """Rectified pixels of raw pixels (N, 2) of the ``"left"`` or ``"right"`` image; NaN where the lens folds."""
        if side not in ("left", "right"):
            raise ValueError(f'side must be "left" or "right", got {side!r}')
        camera, R, P = (self.rig.left, self.R1, self.P1) if side == "left" else (self.rig.right, self.R2, self.P2)
        xyz = camera.rays(pixels) @ R.T
        return xyz[:, :2] / xyz[:, 2:] @ P[:2, :2].T + P[:2, 2]

    def triangulate(self, pixels: Array, disparity_px: Array) -> Array:
        """Points of rectified left pixels by their disparity.

        Parameters
        ----------
        pixels : (N, 2) array, px
        disparity_px : (N,) array
            NaN or <= 0 gives NaN.

        Returns
        -------
        (N, 3) float64, mm, in the rectified left camera's frame

        Notes
        -----
        ``Z = f B / d``, ``X = (u - cx) B / d``, ``Y = (v - cy) B / d`` (section II.C, with B for the paper's T).
        """
        pixels, disparity = np.asarray(pixels, float).reshape(-1, 2), np.asarray(disparity_px, float).ravel()
        per_px = self.baseline_mm / np.where(disparity > 0, disparity, np.nan)
        xy = (pixels - self.P1[:2, 2]) * per_px[:, None]
        return np.column_stack([xy, self.f_px * per_px])


def pose_left_world(pitch_rad: float, height_mm: float) -> Array:
    """Pose ``T_left_world`` of a left camera above the world's origin, looking along +x.

    Parameters
    ----------
    pitch_rad : float
        Angle of the optical axis above the horizontal.
    height_mm : float
        Height of the optical centre above the floor.

    Returns
    -------
    (4, 4) float64
        Maps homogeneous world points (x forward, y left, z up, mm) into the left camera (x right, y down, z forward).
    """
    c, s = np.cos(pitch_rad), np.sin(pitch_rad)
    R = np.array([[0.0, -1.0, 0.0], [s, 0.0, -c], [c, 0.0, s]])
    return rigid(R, -R @ [0.0, 0.0, height_mm])


def rigid(R: Array, t: ArrayLike) -> Array:
    """Homogeneous (4, 4) transform of a rotation (3, 3) and a translation (3,)."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, np.ravel(t)
    return T


def skew(t: Array) -> Array:
    """Matrix of the cross product: ``skew(t) @ x == np.cross(t, x)``. (3, 3)."""
    x, y, z = np.ravel(t)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
