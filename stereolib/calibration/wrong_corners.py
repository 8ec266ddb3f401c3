"""Single corners that a detector put elsewhere: found by what all others say, named, and left out."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from stereolib.base import Bools, Float32, Float64
from stereolib.calibration.board_poses import boards_before
from stereolib.calibration.board_views import BoardViews
from stereolib.calibration.bundle_adjustment import project_with_derivatives
from stereolib.calibration.solve import calibrate_camera

_MANY = 8.0  # times the median distance, which is 1.18 sigma: of a million honest corners none
_LEAST_PX = 0.02  # corners that a detector finds are never better: a median below it is no measure
_WHOLE_VIEW = 0.15  # share of wrong corners from which on the view is wrong, or its pose, and no single corner
_ROUNDS = 4  # of fitting and looking anew; most sets settle in two


class CornerOff(NamedTuple):
    """A corner, its place on the board, counted from 1, where it was found, and where all others expect it, px."""

    pair: str
    side: str
    column: int
    row: int
    found_px: tuple[float, float]
    expected_px: tuple[float, float]

    @property
    def off_px(self) -> float:
        """How far apart these are."""
        return float(np.hypot(*np.subtract(self.found_px, self.expected_px)))

    def __str__(self) -> str:
        where = "at {:.0f} {:.0f}".format(*self.found_px)
        return f"{self.pair} {self.side} (column {self.column}, row {self.row}, {where}): {self.off_px:.1f} px"


def corners_off(views: BoardViews, side: str, expected_px: Float64, chosen: Bools) -> list[CornerOff]:
    """List chosen corners of one side with where they were expected, the farthest off first.

    Parameters
    ----------
    views : BoardViews
    side : "left" | "right"
    expected_px : (n, corners, 2) float64, px
    chosen : (n, corners) bool

    Returns
    -------
    list of CornerOff
    """
    found = views.left_px if side == "left" else views.right_px
    listed = []
    for k, at in zip(*np.nonzero(chosen), strict=True):
        row, column = divmod(int(at), views.board.columns)
        places = [(float(x), float(y)) for x, y in (found[k, at], expected_px[k, at])]
        listed.append(CornerOff(views.names[k], side, column + 1, row + 1, *places))
    return sorted(listed, key=lambda corner: -corner.off_px)


def without_wrong_corners(views: BoardViews, model: str = "brown3") -> tuple[BoardViews, tuple[CornerOff, ...]]:
    """Leave out single corners that are off by many times what is usual.

    Each camera is calibrated by itself, and every corner held against what the others say of it. A view with many such
    corners is left as it is: it is wrong as a whole.

    Parameters
    ----------
    views : BoardViews
    model : str
        A name of `LENS_MODELS`.

    Returns
    -------
    views : BoardViews
        NaN for what is left out.
    wrong : tuple of CornerOff
        The farthest off first.

    Raises
    ------
    ValueError
        As `calibrate_camera`.
    """
    kept, wrong = [], list[CornerOff]()
    for side, found in (("left", views.left_px), ("right", views.right_px)):
        off, expected = _wrong(views, found, model)
        kept.append(np.where(off[..., None], np.float32(np.nan), found))
        wrong += corners_off(views, side, expected, off)
    by_distance = tuple(sorted(wrong, key=lambda corner: -corner.off_px))
    return replace(views, left_px=kept[0], right_px=kept[1]), by_distance


def _wrong(views: BoardViews, found_px: Float32, model: str) -> tuple[Bools, Float64]:
    """Which corners of one camera are wrong, and where all that are not expect each."""
    wrong: Bools = np.zeros(found_px.shape[:2], bool)
    for _ in range(_ROUNDS):
        kept = np.where(wrong[..., None], np.float32(np.nan), found_px)
        camera = calibrate_camera(views.board, kept, views.size, model=model).camera
        points = boards_before(views.board.points_mm, kept, camera)[2]
        expected = project_with_derivatives(camera, points)[0]
        off = np.linalg.norm(found_px - expected, axis=2)
        usual = np.maximum(np.nanmedian(off, axis=1, keepdims=True), max(float(np.nanmedian(off)), _LEAST_PX))
        before, wrong = wrong, off > _MANY * usual
        wrong[wrong.mean(axis=1) > _WHOLE_VIEW] = False
        if np.array_equal(before, wrong):
            break
    return wrong, expected
