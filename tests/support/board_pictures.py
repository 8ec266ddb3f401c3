"""Pictures of boards as printers and hands make them: narrow outer squares, no margin, a sheet that bends, a webcam."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.base import Float64, UInt8
from stereolib.calibration import BoardViews, Checkerboard, find_in_pairs
from stereolib.rig import Camera, StereoRig, rigid
from stereolib.virtual.recordings import BOARD
from support.corners import draw_poses

_SAMPLES = 3  # rays of a pixel, each way
_BLACK, _WHITE, _BEHIND = 25.0, 215.0, 110.0  # grey values
_WARP_ROUNDS = 3  # of the ray's way to a sheet that bends by less than a hundredth of its size


@dataclass(frozen=True)
class Print:
    """A checkerboard as it came out of the printer.

    Attributes
    ----------
    board : Checkerboard
    rim : float
        Width of the outermost squares, as a share of the inner ones'.
    margin : float
        Paper around them, as a share of a square.
    bent_mm : float
        How far the middle of the sheet stands out before its left and right end; its corners are twisted by as much.
    """

    board: Checkerboard = BOARD
    rim: float = 1.0
    margin: float = 1.0
    bent_mm: float = 0.0

    @property
    def half_mm(self) -> Float64:
        """Half the extent of the corners, x and y."""
        return np.asarray(np.abs(self.board.points_mm[:, :2]).max(axis=0) / 2, float)

    def height_mm(self, x: Float64, y: Float64) -> Float64:
        """How far the sheet stands out."""
        a, b = x / self.half_mm[0], y / self.half_mm[1]
        return self.bent_mm * (0.5 - a**2 + 0.5 * a * b)

    def grey(self, x: Float64, y: Float64) -> Float64:
        """Brightness of the sheet, and of what is behind it."""
        square = np.array([self.board.points_mm[1, 0], self.board.points_mm[self.board.columns, 1]], float)
        dark, inked, paper = np.zeros(x.shape, bool), np.ones(x.shape, bool), np.ones(x.shape, bool)
        for at, half, edge in zip((x, -y), self.half_mm, square, strict=True):  # rows run down
            dark ^= (np.floor((at + half) / edge).astype(int) & 1).astype(bool)
            beyond = (np.abs(at) - half) / edge
            inked &= beyond < self.rim
            paper &= beyond < self.rim + self.margin
        return np.where(inked & dark, _BLACK, np.where(paper, _WHITE, _BEHIND))


@dataclass(frozen=True)
class Photo:
    """What the camera does to a picture: blur (standard deviation, px), noise (grey levels), JPEG's quality."""

    blur_px: float = 0.6
    noise: float = 2.0
    jpeg: int = 90

    def taken(self, seen: Float64, rng: np.random.Generator) -> UInt8:
        """Take it."""
        rows, columns = np.mgrid[-1 : 1 : seen.shape[0] * 1j, -1 : 1 : seen.shape[1] * 1j]
        slope = rng.uniform(-0.15, 0.15, 2)
        lit = seen * (0.85 + slope[0] * columns + slope[1] * rows)
        soft = cv2.GaussianBlur(lit, (0, 0), self.blur_px)
        noisy = np.clip(soft + rng.normal(0, self.noise, soft.shape), 0, 255).astype(np.uint8)
        sent = cv2.imencode(".jpg", noisy, [cv2.IMWRITE_JPEG_QUALITY, self.jpeg])[1]
        return np.asarray(cv2.imdecode(sent, cv2.IMREAD_GRAYSCALE), np.uint8)


def look(camera: Camera, T_camera_board: Float64, sheet: Print) -> Float64:
    """Render a sheet: where a ray meets the bent surface, and how bright it is there. (H, W) float64."""
    (width, height), far = camera.size, sheet.half_mm + (sheet.rim + sheet.margin) * sheet.board.square_mm
    rim = np.array([[a * far[0], b * far[1], 0.0] for a in np.linspace(-1, 1, 9) for b in np.linspace(-1, 1, 9)])
    where = camera.project(rim @ T_camera_board[:3, :3].T + T_camera_board[:3, 3])
    (u0, v0) = np.clip(np.floor(where.min(axis=0)) - 4, 0, None).astype(int)
    (u1, v1) = np.minimum(np.ceil(where.max(axis=0)) + 5, [width, height]).astype(int)
    u, v = np.meshgrid(np.arange(u0, u1), np.arange(v0, v1))
    rays = camera.rays(np.column_stack([u.ravel(), v.ravel()]), clamp=True) @ T_camera_board[:3, :3]
    eye = -T_camera_board[:3, :3].T @ T_camera_board[:3, 3]
    z = np.zeros(len(rays))
    for _ in range(_WARP_ROUNDS if sheet.bent_mm else 1):
        x, y = (eye[k] + rays[:, k] * (z - eye[2]) / rays[:, 2] for k in (0, 1))
        z = np.where(np.maximum(np.abs(x) / far[0], np.abs(y) / far[1]) < 2, sheet.height_mm(x, y), 0.0)
    # between pixels the sheet's coordinates are all but linear
    finer = u.shape[1] * _SAMPLES, u.shape[0] * _SAMPLES
    fine = [cv2.resize(at.reshape(u.shape), finer, interpolation=cv2.INTER_LINEAR) for at in (x, y)]
    grey = cv2.resize(sheet.grey(*fine), u.shape[::-1], interpolation=cv2.INTER_AREA)
    seen = np.full((height, width), _BEHIND)
    seen[v0:v1, u0:u1] = grey
    return seen


def photographed(
    rig: StereoRig, poses: Sequence[Float64], sheet: Print, photo: Photo, rng: np.random.Generator
) -> list[tuple[UInt8, UInt8]]:
    """Take pairs of a sheet at poses ``T_left_board``, as `draw_poses` gives them."""
    moves = (rig.left, np.eye(4)), (rig.right, rigid(rig.R, rig.T))
    pairs = [[photo.taken(look(camera, M @ T, sheet), rng) for camera, M in moves] for T in poses]
    return [(left, right) for left, right in pairs]


def found_views(
    rig: StereoRig, pairs: int, sheet: Print, photo: Photo, rng: np.random.Generator
) -> tuple[BoardViews, list[Float64]]:
    """Find a sheet in pairs of it; the poses are those of the pairs in which it was found."""
    poses = draw_poses(rig, pairs, rng, sheet.board)
    names = [f"{k:02d}" for k in range(pairs)]
    views = find_in_pairs(photographed(rig, poses, sheet, photo, rng), sheet.board, names, progress=False)
    return views, [poses[int(name)] for name in views.names]
