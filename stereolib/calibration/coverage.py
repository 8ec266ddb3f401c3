"""What a set of boards covers: image, distance and tilt, and what is missing, by name."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.base import Bools, Float64, Floats, Ints
from stereolib.calibration.board_views import BoardViews

_CELL_PX = 20  # side of a cell: well below a board's square in most pictures
_REGION_SHARE = 0.08  # a ninth of the image with less of it covered counts as not seen
_THIRD_SHARE = 0.02  # a third of one camera's image with less of it covered counts as not seen
_SPREAD = 1.2  # farthest over nearest board: with less the focal length hangs on the tilts alone
_FULL_SPREAD = 1.5  # scores 1
_TILT_DEG = 10.0  # boards tilted by less count as parallel to the image
_FULL_TILT_DEG = 20.0  # scores 1
_LITTLE_IMAGE = 0.2  # share of the images: a lens that was seen on less is a guess elsewhere
#: How what boards leave out begins, and what mends it: what leaves the focal length open stands first.
_REMEDIES = {
    "all boards fronto-parallel": "",  # says it itself
    "no boards": ": add such pictures",
    "all boards at one distance": ": hold some nearer and some farther away",
    "no views": ": hold the board there in some pictures",
}
_ROWS, _COLUMNS = ("upper", "middle", "lower"), ("left", "centre", "right")


@dataclass(frozen=True)
class Coverage:
    """Scores of a set of boards from 0 to 1, and what is missing in words.

    Attributes
    ----------
    image : float
        Share of both images' area that boards reached.
    distance, tilt : float
        Share of the spread that a good set has.
    missing : tuple of str
        What no board covers, as ``"no views in the lower right"``.
    """

    image: float
    distance: float
    tilt: float
    missing: tuple[str, ...]

    @property
    def advice(self) -> tuple[str, ...]:
        """What is missing, each kind with its remedy; while pairs are taken and in the verdict alike."""
        kinds = ((kind, [text for text in self.missing if text.startswith(kind)]) for kind in _REMEDIES)
        said = [f"{'; '.join(texts)}{_REMEDIES[kind]}" for kind, texts in kinds if texts]
        if self.image < _LITTLE_IMAGE:
            said.append(f"the boards cover only {100 * self.image:.0f} % of the images: hold them nearer")
        return tuple(said)

    def __str__(self) -> str:
        return (
            "; ".join(self.advice)
            or f"nothing more is needed (boards were seen in {100 * self.image:.0f} % of the images)"
        )


def judge_coverage(views: BoardViews, turns: Float64, shifts: Float64) -> Coverage:
    """Judge what a set of boards covers.

    Parameters
    ----------
    views : BoardViews
    turns, shifts : (n, 3, 3) and (n, 3) float64, mm
        Poses of the boards in the left camera.

    Returns
    -------
    Coverage

    Notes
    -----
    Distance: a farthest board at 1.5 times the nearest scores 1. Tilt: boards turned by 20 degrees and more about both
    axes score 1; the angle is that of the board's normal with the optical axis, because boards parallel to the image
    leave the focal length open.
    """
    masks = [boards_per_cell(corners, views.size) > 0 for corners in (views.left_px, views.right_px)]
    missing = _regions(masks)
    missing += _one_sided(masks, missing)
    centres = shifts + turns @ views.board.points_mm.mean(axis=0)
    near, far = float(centres[:, 2].min()), float(centres[:, 2].max())
    if far < _SPREAD * near:
        missing.append(f"all boards at one distance ({near:.0f} to {far:.0f} mm)")
    normal = turns[:, :, 2] * np.sign(turns[:, 2:, 2])
    about = np.degrees(np.abs(np.arctan2(normal[:, :2], normal[:, 2:])))  # about the vertical, the horizontal axis
    vertical, horizontal = (float(np.sort(angles)[-max(2, len(angles) // 5)]) for angles in about.T)
    if max(vertical, horizontal) < _TILT_DEG:
        most = f"hardly one tilted by more than {max(vertical, horizontal):.0f} degrees"
        missing.append(f"all boards fronto-parallel ({most}): tilt some by 20 to 40, both ways")
    elif vertical < _TILT_DEG:
        missing.append("no boards turned about the vertical axis (left or right side nearer)")
    elif horizontal < _TILT_DEG:
        missing.append("no boards tilted about the horizontal axis (upper or lower edge nearer)")
    tilt = np.mean(np.minimum(1, np.array([vertical, horizontal]) / _FULL_TILT_DEG))
    distance = min(1.0, (far / near - 1) / (_FULL_SPREAD - 1))
    return Coverage(float(np.mean(masks)), float(distance), float(tilt), tuple(missing))


def boards_per_cell(corners_px: Floats, size: tuple[int, int]) -> Ints:
    """Count how many boards cover each cell of 20 x 20 px.

    Parameters
    ----------
    corners_px : (n, corners, 2) array
        NaN where not found.
    size : (width, height), px

    Returns
    -------
    (height / 20, width / 20) int

    Examples
    --------
    >>> corners = np.array([[[0.0, 0], [40, 0], [40, 20], [0, 20]]])
    >>> boards_per_cell(corners, (80, 40))
    array([[1, 1, 0, 0],
           [0, 0, 0, 0]])
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


def _one_sided(masks: list[Bools], known: list[str]) -> list[str]:
    """Upright thirds that one camera alone never saw a board in."""
    return [
        f"no views in the {name} third of the {side} image"
        for side, mask in zip(("left", "right"), masks, strict=True)
        for name, part in zip(_COLUMNS, np.array_split(mask, 3, axis=1), strict=True)
        if part.mean() < _THIRD_SHARE and not any(name in text or "outside" in text for text in known)
    ]


def _regions(masks: list[Bools]) -> list[str]:
    """Ninths of the image that no board reaches in either camera; a whole third is named as one.

    In either, because a board near the left rim of the left image is out of the right camera's sight.
    """
    ninths = [[np.array_split(band, 3, axis=1) for band in np.array_split(mask, 3)] for mask in masks]
    empty = np.all([[[part.mean() < _REGION_SHARE for part in row] for row in mask] for mask in ninths], axis=0)
    if not empty[1, 1] and empty[[0, 2]].all() and empty[1, [0, 2]].any():
        return ["no views outside the centre"]
    missing = []
    for thirds, lines in ((_ROWS, empty), (_COLUMNS, empty.T)):
        missing += [f"no views in the {name} third" for name, line in zip(thirds, lines, strict=True) if line.all()]
    alone = np.argwhere(empty & ~empty.all(axis=1, keepdims=True) & ~empty.all(axis=0))
    names = ("centre" if i == j == 1 else f"{_ROWS[i]} {_COLUMNS[j]}" for i, j in alone)
    return missing + [f"no views in the {name}" for name in names]
