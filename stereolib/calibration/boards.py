"""Calibration boards: checkerboards, with markers or without."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np

from stereolib.base import Float32

_LEAST_EDGE_MM = 1.0  # no camera sees smaller squares or markers at a distance: metres were given
_MOST_EDGE_MM = 1e6  # a kilometre: no board has larger squares
_ASPECTS = (0.8, 1.25)  # printers stretch by a per cent, so that anything beyond is a slip


@dataclass(frozen=True)
class Checkerboard:
    """A checkerboard, counted in inner corners.

    Parameters
    ----------
    columns, rows : int
        Inner corners: a board of 10 x 7 squares has 9 x 6.
    square_mm : float
        Edge of a square, the mean of both if a printer stretched them.
    aspect : float
        Height of a square over its width, 1 unless measured: printers stretch by a per cent.

    Examples
    --------
    >>> Checkerboard(9, 6, 25.0).points_mm[:2]
    array([[ 0.,  0.,  0.],
           [25.,  0.,  0.]], dtype=float32)
    """

    columns: int
    rows: int
    square_mm: float
    aspect: float = 1.0

    def __post_init__(self) -> None:
        _check_counted(self.columns, self.rows)
        if self.columns < 3 or self.rows < 3:
            raise ValueError(f"a checkerboard needs at least 3x3 inner corners, got {self.columns}x{self.rows}")
        if self.columns == self.rows:
            why = f"a board of {self.columns}x{self.rows} inner corners looks the same after a quarter turn"
            raise ValueError(f"{why}: use one with different numbers of columns and rows")
        _check_edge(self.square_mm, "square")
        if not _ASPECTS[0] < self.aspect < _ASPECTS[1]:
            raise ValueError(f"a square's height over its width must be near 1, got {self.aspect}")

    @property
    def points_mm(self) -> Float32:
        """Corners on the board, row by row from the upper left. (columns * rows, 3) float32, mm, z = 0."""
        width = 2 * self.square_mm / (1 + self.aspect)
        return _grid(self.columns, self.rows, width, width * self.aspect).copy()


@dataclass(frozen=True)
class Charuco:
    """A checkerboard with an ArUco marker in every white square: the corners carry numbers.

    It may leave the image in part, lie upside down, or be square: no corner can be taken for another.

    Parameters
    ----------
    columns, rows : int
        Inner corners, as of a `Checkerboard`.
    square_mm, marker_mm : float
        Edges of a square and of a marker.
    dictionary : str
        A name of `cv2.aruco`, without ``DICT_``.
    legacy : bool
        Printed with OpenCV before 4.6, whose boards with an even number of rows begin with a marker.
    """

    columns: int
    rows: int
    square_mm: float
    marker_mm: float
    dictionary: str = "5X5_100"
    legacy: bool = False

    def __post_init__(self) -> None:
        _check_counted(self.columns, self.rows)
        if self.columns < 2 or self.rows < 2:
            raise ValueError(f"a ChArUco board needs at least 2x2 inner corners, got {self.columns}x{self.rows}")
        _check_edge(self.square_mm, "square")
        if not 0 < self.marker_mm < self.square_mm < np.inf:
            why = "a marker must be smaller than its square, both in mm"
            raise ValueError(f"{why}, got {self.marker_mm} and {self.square_mm}")
        _check_edge(self.marker_mm, "marker")
        if not hasattr(cv2.aruco, f"DICT_{self.dictionary}"):
            raise ValueError(f"unknown ArUco dictionary {self.dictionary!r}; one is called 5X5_100")
        needed = (self.columns + 1) * (self.rows + 1) // 2
        if needed > (there := len(cv2.aruco.getPredefinedDictionary(self._number).bytesList)):
            board = f"a board of {self.columns}x{self.rows} inner corners"
            raise ValueError(f"{board} needs {needed} markers, {self.dictionary} has {there}: choose a larger one")

    @property
    def points_mm(self) -> Float32:
        """Corners on the board, row by row from the upper left. (columns * rows, 3) float32, mm, z = 0."""
        return _grid(self.columns, self.rows, self.square_mm, self.square_mm).copy()

    @property
    def _number(self) -> int:
        return int(getattr(cv2.aruco, f"DICT_{self.dictionary}"))

    @property
    def printed(self) -> Any:
        """The board as `cv2.aruco` has it, for example to print it with its ``generateImage``."""
        dictionary = cv2.aruco.getPredefinedDictionary(self._number)
        squares = self.columns + 1, self.rows + 1
        board = cv2.aruco.CharucoBoard(squares, float(self.square_mm), float(self.marker_mm), dictionary)
        board.setLegacyPattern(self.legacy)
        return board


Board = Checkerboard | Charuco


def _check_counted(columns: int, rows: int) -> None:
    if not all(isinstance(n, int | np.integer) for n in (columns, rows)):
        raise ValueError(f"inner corners are counted in whole numbers, got {columns!r} x {rows!r}")


def _check_edge(edge_mm: float, what: str) -> None:
    if not 0 < edge_mm <= _MOST_EDGE_MM:
        most = f"{_MOST_EDGE_MM:g} at most"
        raise ValueError(f"the {what}'s edge must be a positive number of mm, got {edge_mm}; {most}")
    if edge_mm < _LEAST_EDGE_MM:
        meant = f"for {edge_mm:g} m that is {1000 * edge_mm:g}"
        raise ValueError(f"the {what}'s edge was given as {edge_mm:g}, but millimetres are expected: {meant}")


@lru_cache(maxsize=32)
def _grid(columns: int, rows: int, width_mm: float, height_mm: float) -> Float32:
    grid = np.zeros((columns * rows, 3), np.float32)
    grid[:, :2] = np.mgrid[:columns, :rows].T.reshape(-1, 2) * (width_mm, height_mm)
    return grid
