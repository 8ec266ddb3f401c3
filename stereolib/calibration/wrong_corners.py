"""Single corners that a detector put elsewhere: found by what all others say, named, and left out."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from stereolib.base import Bools, Float32, Float64
from stereolib.calibration.boards import BoardViews
from stereolib.calibration.bundle_adjustment import board_poses, project_with_derivatives
from stereolib.calibration.solve import calibrate_camera

_MANY = 8.0  # times the median distance, which is 1.18 sigma: of a million honest corners none
_LEAST_PX = 0.02  # corners that a detector finds are never better: a median below it is no measure
_WHOLE_VIEW = 0.15  # share of wrong corners from which on the view is wrong, or its pose, and no single corner
_ROUNDS = 4  # of fitting and looking anew; most sets settle in two


class WrongCorner(NamedTuple):
    """A corner that stands where no other corner lets it stand: its place on the board, counted from 1, and in px."""

    pair: str
    side: str
    column: int
    row: int
    x_px: float
    y_px: float
    off_px: float

    def __str__(self) -> str:
        place = f"column {self.column}, row {self.row}, at {self.x_px:.0f} {self.y_px:.0f}"
        return f"{self.pair} {self.side} ({place}): {self.off_px:.1f} px"


def without_wrong_corners(views: BoardViews, model: str = "brown3") -> tuple[BoardViews, tuple[WrongCorner, ...]]:
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
    wrong : tuple of WrongCorner
        The farthest off first.

    Raises
    ------
    ValueError
        As `calibrate_camera`.
    """
    left, left_off = _cleaned(views, views.left_px, model)
    right, right_off = _cleaned(views, views.right_px, model)
    wrong = []
    sides = ("left", left, views.left_px, left_off), ("right", right, views.right_px, right_off)
    for side, kept, found, off in sides:
        for k, at in zip(*np.nonzero(np.isnan(kept[..., 0]) & np.isfinite(found[..., 0])), strict=True):
            row, column = divmod(int(at), views.board.columns)
            x, y = found[k, at].tolist()
            wrong.append(WrongCorner(views.names[k], side, column + 1, row + 1, x, y, float(off[k, at])))
    found_wrong = tuple(sorted(wrong, key=lambda corner: -corner.off_px))
    return replace(views, left_px=left, right_px=right), found_wrong


def _cleaned(views: BoardViews, found_px: Float32, model: str) -> tuple[Float32, Float64]:
    """Corners of one camera, NaN for the wrong ones, and the distance of each from what the others say of it."""
    wrong: Bools = np.zeros(found_px.shape[:2], bool)
    for _ in range(_ROUNDS):
        kept = np.where(wrong[..., None], np.float32(np.nan), found_px)
        camera = calibrate_camera(views.board, kept, views.size, model=model).camera
        turns, shifts = board_poses(views.board.points_mm, kept, camera)
        points = views.board.points_mm @ turns.transpose(0, 2, 1) + shifts[:, None]
        off = np.linalg.norm(found_px - project_with_derivatives(camera, points)[0], axis=2)
        usual = np.maximum(np.nanmedian(off, axis=1, keepdims=True), max(float(np.nanmedian(off)), _LEAST_PX))
        before, wrong = wrong, off > _MANY * usual
        wrong[wrong.mean(axis=1) > _WHOLE_VIEW] = False
        if np.array_equal(before, wrong):
            break
    return np.where(wrong[..., None], np.float32(np.nan), found_px), off
