"""What a set of boards covers: image, distance and tilt, and what is missing, by name."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.calibration.boards import BoardViews

Array = np.ndarray
_CELL_PX = 20
_REGION_SHARE = 0.08  # a ninth of the image with less of it covered counts as not seen
_THIRD_SHARE = 0.02  # the same for a third of one camera's image
_SPREAD = 1.2  # farthest over nearest board
_TILT_DEG = 10.0
_ROWS, _COLUMNS = ("upper", "middle", "lower"), ("left", "centre", "right")


@dataclass(frozen=True)
class Coverage:
    """Scores from 0 to 1, and what is missing in words.

    ``image`` is the share of both images' area that boards reached, ``distance`` and ``tilt`` the share of the spread
    that a good set has; ``score`` is their mean. ``missing`` names parts, as ``"no views in the lower right"``.
    """

    image: float
    distance: float
    tilt: float
    missing: tuple[str, ...]

    @property
    def score(self) -> float:
        """Mean of the three, 0 to 1."""
        return (self.image + self.distance + self.tilt) / 3

    def __str__(self) -> str:
        parts = f"image {self.image:.0%}, distance {self.distance:.0%}, tilt {self.tilt:.0%}"
        return f"{parts}; " + ("; ".join(self.missing) or "no third of an image and no tilt is missing")


def measure(views: BoardViews, turns: Array, shifts: Array) -> Coverage:
    """Coverage of a set of boards.

    Parameters
    ----------
    turns (n, 3, 3), shifts (n, 3) mm : poses of the boards in the left camera

    Notes
    -----
    Distance: a farthest board at 1.5 times the nearest scores 1. Tilt: boards turned by 20 degrees and more about both
    axes score 1; the angle is that of the board's normal with the optical axis, because boards parallel to the image
    leave the focal length open.
    """
    masks = [covered(corners, views.size) for corners in (views.left_px, views.right_px)]
    missing = _regions([mask > 0 for mask in masks])
    missing += _one_sided([mask > 0 for mask in masks], missing)
    centres = shifts + turns @ views.board.points_mm.mean(axis=0)
    near, far = float(centres[:, 2].min()), float(centres[:, 2].max())
    if far < _SPREAD * near:
        missing.append(f"all boards at one distance ({near:.0f} to {far:.0f} mm)")
    normal = turns[:, :, 2] * np.sign(turns[:, 2:, 2])
    about = np.degrees(np.abs(np.arctan2(normal[:, :2], normal[:, 2:])))  # about the vertical, the horizontal axis
    vertical, horizontal = (float(np.sort(angles)[-max(2, len(angles) // 5)]) for angles in about.T)
    if max(vertical, horizontal) < _TILT_DEG:
        missing.append(f"all boards fronto-parallel (hardly one tilted by more than {max(vertical, horizontal):.0f} "
                       f"degrees): tilt some by 20 to 40, both ways")  # fmt: skip
    elif vertical < _TILT_DEG:
        missing.append("no boards turned about the vertical axis (left or right side nearer)")
    elif horizontal < _TILT_DEG:
        missing.append("no boards tilted about the horizontal axis (upper or lower edge nearer)")
    tilt = np.mean(np.minimum(1, np.array([vertical, horizontal]) / 20))
    image = float(np.mean([mask > 0 for mask in masks]))
    return Coverage(image, float(min(1.0, (far / near - 1) / 0.5)), float(tilt), tuple(missing))


def tilts_rad(turns: Array) -> Array:
    """Angle between each board's normal and the optical axis. (n,)."""
    return np.arccos(np.clip(np.abs(turns[:, 2, 2]), 0, 1))


def covered(corners_px: Array, size: tuple[int, int]) -> Array:
    """How many boards cover each cell of 20 x 20 px. (height / 20, width / 20) int.

    Parameters
    ----------
    corners_px : (n, corners, 2), NaN where not found
    size : (width, height), px
    """
    width, height = size
    cells = -(-width // _CELL_PX), -(-height // _CELL_PX)
    count = np.zeros(cells[::-1], int)
    for corners in np.asarray(corners_px, np.float32):
        hull = cv2.convexHull(corners[np.isfinite(corners).all(axis=1)])
        mask = np.zeros((height, width), np.uint8)
        cv2.fillConvexPoly(mask, np.rint(hull).astype(np.int32), 255)
        count += cv2.resize(mask, cells, interpolation=cv2.INTER_AREA) > 127
    return count


def _one_sided(masks: list[Array], known: list[str]) -> list[str]:
    """Upright thirds that one camera alone never saw a board in."""
    return [
        f"no views in the {name} third of the {side} image"
        for side, mask in zip(("left", "right"), masks, strict=True)
        for name, part in zip(_COLUMNS, np.array_split(mask, 3, axis=1), strict=True)
        if part.mean() < _THIRD_SHARE and not any(name in text or "outside" in text for text in known)
    ]


def _regions(masks: list[Array]) -> list[str]:
    """Ninths of the image that no board reaches in either camera; a whole third is named as one.

    In either, because a board near the left rim of the left image is out of the right camera's sight.
    """
    empty: Array = np.ones((3, 3), bool)
    for mask in masks:
        for i, band in enumerate(np.array_split(mask, 3, axis=0)):
            for j, part in enumerate(np.array_split(band, 3, axis=1)):
                empty[i, j] &= part.mean() < _REGION_SHARE
    if not empty[1, 1] and empty[[0, 2]].all() and empty[1, [0, 2]].any():
        return ["no views outside the centre"]
    found = []
    for names, lines in ((_ROWS, empty), (_COLUMNS, empty.T)):
        found += [f"no views in the {name} third" for name, line in zip(names, lines, strict=True) if line.all()]
    rows, columns = np.all(empty, axis=1, keepdims=True), np.all(empty, axis=0, keepdims=True)
    whole = empty & (rows | columns)
    for i, j in np.argwhere(empty & ~whole):
        name = "centre" if i == j == 1 else f"{_ROWS[i]} {_COLUMNS[j]}"
        found.append(f"no views in the {name}")
    return found
