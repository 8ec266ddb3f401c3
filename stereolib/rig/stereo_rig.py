"""The pair of cameras, and the pair after rectification."""

from __future__ import annotations

import json
import reprlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Float64, UInt8, as_rows, finite_array, read_json, set_frozen, write_atomic
from stereolib.rig.camera import Camera
from stereolib.rig.images import check_image
from stereolib.rig.transforms import skew

_FORMAT = "stereolib.rig/1"
_MOST_OF_R = 2.0  # what is no rotation is said below; beyond this it may overflow
_ROTATION_ATOL = 1e-6  # of R R' - 1: a float32 rotation passes, one printed with four digits does not
#: Lenses stand farther apart: a shorter T is in metres, or of one camera twice. Even endoscopes have some millimetres.
_LEAST_BASELINE_MM = 1.0
_MOST_BASELINE_MM = 1e7  # ten kilometres
_SAME_PX = 1e-6  # what differs by less was rounded
_REMEDY = "`stereolib calibrate` makes a rig file (calibration.json)"
RemapTables = tuple[npt.NDArray[np.int16], npt.NDArray[np.uint16]]


@dataclass(frozen=True, eq=False)
class StereoRig:
    """Two cameras; ``x_right = R x_left + T`` in millimetres (OpenCV's convention, CONVENTIONS.md).

    Attributes
    ----------
    left, right : Camera
        Of one size.
    R : (3, 3) array_like
        Rotation from the left camera's frame into the right one's.
    T : (3,) array_like, mm
        Left optical centre in the right camera's frame.

    Raises
    ------
    ValueError
        If R is no rotation, T not three finite numbers or shorter than a millimetre, or the cameras' sizes differ.
    """

    left: Camera
    right: Camera
    R: Float64
    T: Float64

    def __post_init__(self) -> None:
        set_frozen(self, R=finite_array(self.R, (3, 3), "R", most=_MOST_OF_R))
        T = finite_array(self.T, None, "T", most=_MOST_BASELINE_MM)
        set_frozen(self, T=finite_array(T.ravel(), (3,), "T"))
        if np.abs(self.R @ self.R.T - np.eye(3)).max() > _ROTATION_ATOL or np.linalg.det(self.R) < 0:
            raise ValueError("R is not a rotation: R R^T differs from 1. Printed matrices must be re-orthonormalised")
        if self.baseline_mm < _LEAST_BASELINE_MM:
            why = f"T is {self.baseline_mm:.3g} mm long, and no two lenses stand so near"
            raise ValueError(f"{why}: give it in millimetres (metres times 1000)")
        if self.left.size != self.right.size:
            raise ValueError(f"the cameras' images differ in size: {self.left.size} and {self.right.size}")

    @property
    def baseline_mm(self) -> float:
        """Distance of the optical centres, ``|T|``, mm."""
        return float(np.linalg.norm(self.T))

    @property
    def E(self) -> Float64:
        """Essential matrix ``skew(T) R``: ``x_right^T E x_left = 0`` for ideal coordinates. (3, 3), mm."""
        return np.asarray(skew(self.T) @ self.R)

    @property
    def F(self) -> Float64:
        """Fundamental matrix ``K_R^-T E K_L^-1``, not normalised: ``u_right^T F u_left = 0``. (3, 3)."""
        return np.asarray(np.linalg.inv(self.right.K).T @ self.E @ np.linalg.inv(self.left.K))

    def rectify(self, alpha: float = 0.0, *pictures: object) -> RectifiedRig:
        """Turn both cameras so that rows agree (Bouguet's method, `cv2.stereoRectify`).

        Parameters
        ----------
        alpha : float
            0 keeps only pixels that exist in both (the image is magnified), 1 keeps all.
        *pictures : object
            Refused: `RectifiedRig.rectify` turns pictures.

        Returns
        -------
        RectifiedRig

        Raises
        ------
        ValueError
            If alpha is no number or out of range, pictures are given, the cameras look away from each other, or the
            right camera does not stand to the right of the left one.

        Examples
        --------
        >>> camera = Camera([[700, 0, 320], [0, 700, 240], [0, 0, 1]], [], (640, 480))
        >>> rectified = StereoRig(camera, camera, np.eye(3), np.array([-90.0, 0.0, 0.0])).rectify()
        >>> round(rectified.f_px), round(rectified.baseline_mm)
        (700, 90)
        """
        if pictures or not isinstance(alpha, int | float | np.integer | np.floating):
            why = "StereoRig.rectify takes alpha, a number, and makes the RectifiedRig"
            raise ValueError(f"{why}: rig.rectify().rectify(left, right) turns pictures")
        if not 0 <= alpha <= 1:
            raise ValueError(f"alpha must lie between 0 (only valid pixels) and 1 (all pixels), got {alpha}")
        if self.R[2, 2] <= 0:
            angle = f"R turns their view by {np.degrees(np.arccos(max(self.R[2, 2], -1.0))):.0f} degrees"
            raise ValueError(f"the cameras look away from each other ({angle}): calibrate again, both the same way up")
        if not -self.T[0] > abs(self.T[1]):
            why = "the right camera must stand to the right of the left one (T along -x), got"
            T = ", ".join(f"{value:.1f}" for value in self.T)
            remedy = "swap the cameras, or, if one stands above the other, turn all pictures by a quarter"
            raise ValueError(f"{why} T = ({T}) mm: {remedy}")
        lenses = self.left.K, self.left.dist, self.right.K, self.right.dist
        R1, R2, P1, P2, Q, *_ = cv2.stereoRectify(
            *lenses, self.left.size, self.R, self.T[:, None], flags=cv2.CALIB_ZERO_DISPARITY, alpha=alpha
        )
        return RectifiedRig(self, R1, R2, P1, P2, Q)

    def save(self, path: str | PathLike[str], *, calibration: Mapping[str, object] | None = None) -> Path:
        """Write the rig as JSON (format ``stereolib.rig/1``), every digit kept.

        Parameters
        ----------
        path : path
        calibration : mapping, optional
            How the rig was calibrated, kept under this name for people and other programs; `load` does not need it.

        Returns
        -------
        Path
            Where it was written.

        Raises
        ------
        ValueError
            If `calibration` holds what JSON does not, such as NaN.
        """
        rig: dict[str, object] = {"format": _FORMAT}
        for side, camera in (("left", self.left), ("right", self.right)):
            rig[side] = {"K": camera.K.tolist(), "dist": camera.dist.tolist(), "size": list(camera.size)}
        rig |= {"R": self.R.tolist(), "T_mm": self.T.tolist()}
        if calibration is not None:
            rig["calibration"] = dict(calibration)
        return write_atomic(path, json.dumps(rig, indent=1, allow_nan=False) + "\n")

    @classmethod
    def load(cls, path: str | PathLike[str]) -> StereoRig:
        """Read what `save` wrote.

        Parameters
        ----------
        path : path

        Returns
        -------
        StereoRig

        Raises
        ------
        ValueError
            If there is no such file, or it is no rig; the text names the file and what is wrong with it.
        """
        try:
            entries = read_json(path)
        except ValueError as error:
            text = str(error)
            raise ValueError(f"{text}{' ' if text.endswith('?') else '; '}{_REMEDY}") from error
        try:
            if not isinstance(entries, Mapping):
                raise ValueError("it holds no named entries")
            if entries["format"] != _FORMAT:
                raise ValueError(f"its format is {entries['format']!r}, expected {_FORMAT!r}")
            left, right = (Camera(c["K"], c["dist"], tuple(c["size"])) for c in (entries["left"], entries["right"]))
            return cls(left, right, entries["R"], entries["T_mm"])
        except (ValueError, LookupError, TypeError, OverflowError) as error:
            why = f"it has no {error}" if isinstance(error, KeyError) else error
            raise ValueError(f"{path} is not a rig file of stereolib: {why}; {_REMEDY}") from error


def calibration_notes(path: str | PathLike[str]) -> Mapping[str, Any]:
    """Read what a rig file says of its calibration, as `StereoRig.save` got it.

    Parameters
    ----------
    path : path

    Returns
    -------
    mapping
        Empty where it says nothing.

    Raises
    ------
    ValueError
        If it is no rig file, or what it says is no table of named entries.
    """
    entries = read_json(path)
    notes = entries.get("calibration") if isinstance(entries, Mapping) else entries
    if notes is not None and not isinstance(notes, Mapping):
        what = f'its entry "calibration" holds no named entries but {reprlib.repr(notes)}'
        raise ValueError(f"{path}: {what}: take it out, or calibrate again")
    return notes or {}


@dataclass(frozen=True, eq=False)
class RectifiedRig:
    """A rig after rectification: rows agree, and ``depth = f B / disparity``.

    Attributes
    ----------
    rig : StereoRig
        The cameras as they are.
    R1, R2 : (3, 3) array_like
        Turn points of each camera's frame into its rectified frame.
    P1, P2 : (3, 4) array_like, px
        Project points of the rectified left frame, mm, into both rectified images.
    Q : (4, 4) array_like
        Maps ``(u, v, disparity, 1)`` to homogeneous millimetres.

    Raises
    ------
    ValueError
        If a matrix has another shape or is not finite, or P1 and P2 differ before their last column.
    """

    rig: StereoRig
    R1: Float64
    R2: Float64
    P1: Float64
    P2: Float64
    Q: Float64

    def __post_init__(self) -> None:
        shapes = {"R1": (3, 3), "R2": (3, 3), "P1": (3, 4), "P2": (3, 4), "Q": (4, 4)}
        set_frozen(self, **{name: finite_array(getattr(self, name), shape, name) for name, shape in shapes.items()})
        if (off_px := np.abs(self.P1[:, :3] - self.P2[:, :3]).max()) > _SAME_PX:
            why = f"P1 and P2 differ by {off_px:.3g} px before their last column, and depth = f B / disparity needs one"
            remedy = "rectify with StereoRig.rectify, or cv2.stereoRectify(flags=cv2.CALIB_ZERO_DISPARITY)"
            raise ValueError(f"{why} focal length and centre for both: {remedy}")

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the images, rectified or not, px."""
        return self.rig.left.size

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
    def maps(self) -> tuple[RemapTables, RemapTables]:
        """Fixed-point lookup maps of `cv2.remap` for the left and the right image, computed once."""
        sides = (self.rig.left, self.R1, self.P1), (self.rig.right, self.R2, self.P2)
        left, right = (cv2.initUndistortRectifyMap(c.K, c.dist, R, P, self.size, cv2.CV_16SC2) for c, R, P in sides)
        return left, right

    def check_size(self, image: UInt8, side: str) -> None:
        """Refuse an image of another size than the calibrated one.

        Parameters
        ----------
        image : (H, W) or (H, W, 3) uint8
        side : str
            ``"left"`` or ``"right"``, for the message.

        Raises
        ------
        ValueError
            If its size is another.
        """
        if image.shape[1::-1] != self.size:
            sizes = f"{image.shape[1]}x{image.shape[0]}, the calibration is for {self.size[0]}x{self.size[1]}"
            turned = ": it lies on its side, or its EXIF says so" if image.shape[:2] == self.size else ""
            raise ValueError(f"the {side} image is {sizes}{turned}: use images of that size or calibrate again")

    def rectify(self, left: UInt8, right: UInt8) -> tuple[UInt8, UInt8]:
        """Undistort and rectify a pair of images.

        Parameters
        ----------
        left, right : (H, W) or (H, W, 3) uint8

        Returns
        -------
        left, right : uint8, shaped as they came
            Black where a camera saw nothing.

        Raises
        ------
        ValueError
            If an image is no picture of 8 bits or not of the calibrated size, or one is grey and the other in colour.
        """
        for side, image in (("left", left), ("right", right)):
            check_image(image, f"the {side} image")
            self.check_size(image, side)
        if left.ndim != right.ndim:
            raise ValueError(f"one image is grey, the other in colour (shapes {left.shape}, {right.shape})")
        pair = [cv2.remap(i, *m, cv2.INTER_LINEAR) for i, m in zip((left, right), self.maps, strict=True)]
        return pair[0], pair[1]

    def rectify_points(self, pixels: npt.ArrayLike, side: str) -> Float64:
        """Rectified pixels of raw pixels.

        Parameters
        ----------
        pixels : (N, 2) array_like, px
        side : "left" | "right"
            The camera that took the image.

        Returns
        -------
        (N, 2) float64, px
            NaN where the lens folds over.

        Raises
        ------
        ValueError
            If `side` is another word, or the pixels are not rows of two.

        Examples
        --------
        Pinholes side by side see the same rows already: nothing moves.

        >>> camera = Camera([[700, 0, 320], [0, 700, 240], [0, 0, 1]], [], (640, 480))
        >>> rectified = StereoRig(camera, camera, np.eye(3), np.array([-90.0, 0.0, 0.0])).rectify()
        >>> rectified.rectify_points([[320.0, 240.0]], "left").round(6)
        array([[320., 240.]])
        """
        if side not in ("left", "right"):
            raise ValueError(f'side must be "left" or "right", got {side!r}')
        camera, R, P = (self.rig.left, self.R1, self.P1) if side == "left" else (self.rig.right, self.R2, self.P2)
        xyz = camera.rays(pixels) @ R.T
        return np.asarray(xyz[:, :2] / xyz[:, 2:] @ P[:2, :2].T + P[:2, 2])

    def triangulate(self, pixels: npt.ArrayLike, disparity_px: npt.ArrayLike) -> Float64:
        """Points of rectified left pixels by their disparity.

        Parameters
        ----------
        pixels : (N, 2) array_like, px
        disparity_px : (N,) array_like, px
            NaN or <= 0 gives NaN.

        Returns
        -------
        (N, 3) float64, mm, in the rectified left camera's frame

        Raises
        ------
        ValueError
            If the pixels are not rows of two, or the disparities are not as many.

        Notes
        -----
        ``Z = f B / d``, ``X = (u - cx) B / d``, ``Y = (v - cy) B / d`` (section II.C, with B for the paper's T).
        """
        uv, disparity = as_rows(pixels, 2, "pixels"), np.asarray(disparity_px, float).ravel()
        if len(uv) != len(disparity):
            raise ValueError(f"each pixel needs its disparity, got {len(uv)} pixels and {disparity.size} disparities")
        per_px = self.baseline_mm / np.where((disparity > 0) & np.isfinite(disparity), disparity, np.nan)
        xy = (uv - self.P1[:2, 2]) * per_px[:, None]
        return np.column_stack([xy, self.f_px * per_px])
