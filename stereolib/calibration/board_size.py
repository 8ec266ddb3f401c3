"""Calibrations in millimetres: boards that a rig has never seen, triangulated and held against their true size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolib.calibration.boards import Board, BoardViews
from stereolib.calibration.bundle_adjustment import Fit, moved
from stereolib.rig import StereoRig

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class SizeErrors:
    """Triangulated boards against the true one, per pair (n,), in per cent; NaN where too few corners were found.

    ``square_pct``: edges of the squares, both ways; ``board_pct``: the length over all along the longer side.
    """

    square_pct: Array
    board_pct: Array

    @property
    def square_error_pct(self) -> float:
        """Mean over the pairs of the amount by which the squares are wrong, whatever its sign."""
        return float(np.nanmean(np.abs(self.square_pct)))

    @property
    def board_error_pct(self) -> float:
        """The same of the board's longer side."""
        return float(np.nanmean(np.abs(self.board_pct)))


def triangulate(rig: StereoRig, left_px: Array, right_px: Array) -> Array:
    """Points seen at these pixels of the original, distorted images.

    Parameters
    ----------
    left_px, right_px : (N, 2) arrays, px

    Returns
    -------
    (N, 3) float64, mm, in the left camera's frame; NaN where a pixel is

    Notes
    -----
    With ``x = X/Z`` the ideal coordinates, least squares of ``X - x_l Z = 0``, ``Y - y_l Z = 0`` and the same of
    ``R X + T`` for the right camera: four equations a point, whose errors are pixels times Z/f.
    """
    left, right = rig.left.rays(left_px), rig.right.rays(right_px)
    A, b = np.zeros((len(left), 4, 3)), np.zeros((len(left), 4))
    A[:, 0, 0] = A[:, 1, 1] = 1
    A[:, :2, 2] = -left[:, :2]
    A[:, 2:] = rig.R[:2] - right[:, :2, None] * rig.R[2]
    b[:, 2:] = right[:, :2] * rig.T[2] - rig.T[:2]
    AT = A.transpose(0, 2, 1)
    return np.linalg.solve(AT @ A, AT @ b[..., None])[..., 0]


def leave_one_out(views: BoardViews, fitted: Fit) -> SizeErrors:
    """Size errors of every pair by a rig calibrated without it (`bundle.Fit.without_each`)."""
    errors = []
    for k, step in enumerate(fitted.without_each()):
        try:
            points = triangulate(moved(fitted.rig, step), views.left_px[k], views.right_px[k])
            errors.append(size_error(points, views.board))
        except ValueError:  # without this pair the rest does not hold a camera
            errors.append((np.nan, np.nan))
    return SizeErrors(*np.array(errors).T)


def size_error(points_mm: Array, board: Board) -> tuple[float, float]:
    """Edge of the squares and length of the longer side of a triangulated board, per cent off the truth.

    Parameters
    ----------
    points_mm : (corners, 3), NaN where not known

    Notes
    -----
    Length of all rows and columns of corners over the true length of the same ones, each taken from its first to its
    last known corner: the mean of single edges would count their noise, which only ever lengthens, as size.
    """
    shape = board.rows, board.columns, 3
    found, true = points_mm.reshape(shape), board.points_mm.astype(float).reshape(shape)
    true = np.where(np.isfinite(found), true, np.nan)  # the same corners on both
    rows, columns = ((_spans(a), _spans(b)) for a, b in ((found, true), (_turned(found), _turned(true))))
    longer = rows if board.columns >= board.rows else columns
    both = rows[0] + columns[0], rows[1] + columns[1]
    square_pct, board_pct = (100 * (a / b - 1) if b else np.nan for a, b in (both, longer))
    return square_pct, board_pct


def _turned(grid: Array) -> Array:
    return grid.transpose(1, 0, 2)


def _spans(grid: Array) -> float:
    """Sum over the rows of the distance between the first and the last known corner."""
    length = 0.0
    for row in grid:
        known = row[np.isfinite(row).all(axis=1)]
        length += float(np.linalg.norm(known[-1] - known[0])) if len(known) > 1 else 0.0
    return length
