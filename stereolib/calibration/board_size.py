"""Calibrations judged in millimetres: boards that a rig has never seen, triangulated and held against their size."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stereolib.base import Float64, Floats
from stereolib.calibration.board_views import BoardViews
from stereolib.calibration.boards import Board, Checkerboard
from stereolib.calibration.bundle_adjustment import RigFit, fit_rig, moved_rig
from stereolib.rig import StereoRig

_PARALLEL = 1e-15  # square of an angle: a line of sight so near the other's direction meets it beyond all measure
_TRIED_STRETCH = 0.01  # of a square's height: the secant's step
_STRETCH = 0.003  # of a square's height: printers do that, and it costs less than the limits
_STRETCH_SHARE = 0.1  # of the residuals (of its root) that a stretch must explain to be named


@dataclass(frozen=True, eq=False)
class SizeErrors:
    """Sizes of triangulated boards against the true one, per pair; NaN where too few corners were found.

    Attributes
    ----------
    square_pct : (n,) float64, %
        Edges of the squares, both ways.
    board_pct : (n,) float64, %
        The length over all along the longer side.
    """

    square_pct: Float64
    board_pct: Float64

    @property
    def square_error_pct(self) -> float:
        """Mean over the pairs of the amount by which the squares are wrong, whatever its sign."""
        return float(np.nanmean(np.abs(self.square_pct)))

    @property
    def board_error_pct(self) -> float:
        """Mean over the pairs of the amount by which the board's longer side is wrong, whatever its sign."""
        return float(np.nanmean(np.abs(self.board_pct)))


def triangulate(rig: StereoRig, left_px: Floats, right_px: Floats) -> Float64:
    """Triangulate points from their pixels in the original, distorted images.

    Parameters
    ----------
    rig : StereoRig
    left_px, right_px : (N, 2) arrays, px

    Returns
    -------
    (N, 3) float64, mm
        In the left camera's frame; NaN where a pixel is, and where two lines of sight are parallel. Where they part, so
        that they would meet behind the cameras, z is negative: wrong matches, or another rig.

    Notes
    -----
    With ``x = X/Z`` the ideal coordinates, least squares of ``X - x_l Z = 0``, ``Y - y_l Z = 0`` and the same for
    ``R X + T`` in the right camera: four equations a point, whose errors are pixels times Z/f.

    Examples
    --------
    >>> from stereolib.rig import Camera
    >>> camera = Camera([[700, 0, 320], [0, 700, 240], [0, 0, 1]], [], (640, 480))
    >>> rig = StereoRig(camera, camera, np.eye(3), [-90.0, 0, 0])
    >>> triangulate(rig, np.array([[390.0, 240.0]]), np.array([[320.0, 240.0]])).round(6)
    array([[ 90.,   0., 900.]])
    """
    left, right = rig.left.rays(left_px), rig.right.rays(right_px)
    A, b = np.zeros((len(left), 4, 3)), np.zeros((len(left), 4))
    A[:, 0, 0] = A[:, 1, 1] = 1
    A[:, :2, 2] = -left[:, :2]
    A[:, 2:] = rig.R[:2] - right[:, :2, None] * rig.R[2]
    b[:, 2:] = right[:, :2] * rig.T[2] - rig.T[:2]
    AT = A.transpose(0, 2, 1)
    normal = np.where(np.isfinite(A).all(axis=(1, 2), keepdims=True), AT @ A, 0.0)
    met = np.linalg.det(normal) > _PARALLEL
    points = np.linalg.solve(np.where(met[:, None, None], normal, np.eye(3)), AT @ b[..., None])[..., 0]
    return np.asarray(np.where(met[:, None], points, np.nan))


def left_out_size_errors(views: BoardViews, fitted: RigFit) -> SizeErrors:
    """Measure every pair's board by a rig calibrated without it (`RigFit.without_each`).

    Parameters
    ----------
    views : BoardViews
    fitted : RigFit
        Of these views.

    Returns
    -------
    SizeErrors
    """
    errors = []
    for k, step in enumerate(fitted.without_each()):
        try:
            points = triangulate(moved_rig(fitted.rig, step), views.left_px[k], views.right_px[k])
            errors.append(board_size_error_pct(points, views.board))
        except ValueError:  # without this pair the rest does not hold a camera
            errors.append((np.nan, np.nan))
    return SizeErrors(*np.array(errors).T)


def board_size_error_pct(points_mm: Floats, board: Board) -> tuple[float, float]:
    """Tell by how much a triangulated board is larger than the true one.

    Parameters
    ----------
    points_mm : (corners, 3) array
        NaN where not known.
    board : Checkerboard or Charuco

    Returns
    -------
    square_pct, board_pct : float, %
        Of the squares' edges, and of the length of the longer side.

    Notes
    -----
    Length of all rows and columns of corners over the true length of the same ones, each taken from its first to its
    last known corner: the mean of single edges would count their noise, which only ever lengthens, as size.

    Examples
    --------
    >>> from stereolib.calibration import Checkerboard
    >>> board = Checkerboard(9, 6, 25.0)
    >>> [round(error, 3) for error in board_size_error_pct(1.01 * board.points_mm, board)]
    [1.0, 1.0]
    """
    shape = board.rows, board.columns, 3
    measured, true = points_mm.reshape(shape), board.points_mm.astype(float).reshape(shape)
    true = np.where(np.isfinite(measured), true, np.nan)  # the same corners on both
    rows, columns = ([_spans(grid.swapaxes(0, axis)) for grid in (measured, true)] for axis in (0, 1))
    longer = rows if board.columns >= board.rows else columns
    both = rows[0] + columns[0], rows[1] + columns[1]
    square_pct, board_pct = (100 * (a / b - 1) if b else np.nan for a, b in (both, longer))
    return square_pct, board_pct


def board_stretch(views: BoardViews, fitted: RigFit) -> tuple[float, float] | None:
    """Find out whether a checkerboard's squares are as high as they were said to be.

    Parameters
    ----------
    views : BoardViews
    fitted : RigFit
        Of these views.

    Returns
    -------
    (stretch, std) or None
        What is to be added to the board's aspect, and its standard deviation; None where nothing speaks for it.

    Notes
    -----
    The residuals of a second fit, with squares 1 % higher, give the height that fits best: a secant step of
    Gauss-Newton in which all other parameters follow. Its deviation is the jackknife's.
    """
    board = views.board
    if not isinstance(board, Checkerboard):
        return None
    stretched = replace(views, board=replace(board, aspect=board.aspect + _TRIED_STRETCH))
    before = fitted.residuals_px
    change = np.where(fitted.known[..., None], fit_rig(stretched, fitted.rig).residuals_px - before, 0.0)
    along, length = (before * change).sum(axis=(1, 2, 3)), (change**2).sum(axis=(1, 2, 3))
    stretch = -_TRIED_STRETCH * float(along.sum() / max(length.sum(), 1e-30))
    if abs(stretch) < _STRETCH or along.sum() ** 2 < _STRETCH_SHARE * length.sum() * (before**2).sum():
        return None
    others = -_TRIED_STRETCH * (along.sum() - along) / (length.sum() - length)
    return stretch, float(np.sqrt((len(others) - 1) * np.var(others)))


def _spans(grid: Floats) -> float:
    """Sum over the rows of the distance between the first and the last known corner."""
    known = np.asarray(np.isfinite(grid).all(axis=2))
    first, last = known.argmax(axis=1), known.shape[1] - 1 - known[:, ::-1].argmax(axis=1)
    row = np.flatnonzero(known.any(axis=1))
    return float(np.linalg.norm(grid[row, last[row]] - grid[row, first[row]], axis=1).sum())
