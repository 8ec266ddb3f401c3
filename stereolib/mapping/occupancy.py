"""Which parts of the floor are free, which are taken and which nobody saw: a grid, by following every beam."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.base import Float64, Floats, Ints, UInt8, counted, set_frozen
from stereolib.mapping.stations import Station
from stereolib.measurement import MeasuredObject

FREE, UNKNOWN, OCCUPIED = 254, 205, 0  # grey levels of ROS's map_server
_MOST_CELLS = 25e6  # bytes of memory, several times; a hall of 100 m by 100 m at 20 mm
_RIM_MM = 100.0  # of unknown cells around everything
_BEAMS_AT_ONCE = 500  # bounds the memory of their crossings


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """Cells of the floor in the laser's plane.

    Attributes
    ----------
    cells : (rows, columns) uint8
        `FREE`, `OCCUPIED` or `UNKNOWN`; row 0 is the one with the smallest y, column 0 that with the smallest x.
    origin_mm : (2,) float64
        The corner of cell (0, 0) with the smallest x and y.
    resolution_mm : float
        Side of a cell.
    """

    cells: UInt8
    origin_mm: Float64
    resolution_mm: float

    def __post_init__(self) -> None:
        set_frozen(self, cells=np.asarray(self.cells, np.uint8), origin_mm=np.asarray(self.origin_mm, float))

    def at(self, points_mm: Floats) -> UInt8:
        """Look up the cells of points.

        Parameters
        ----------
        points_mm : (N, 2) array

        Returns
        -------
        (N,) uint8
            `UNKNOWN` outside the grid.

        Examples
        --------
        >>> grid = OccupancyGrid(np.array([[FREE, OCCUPIED]]), np.zeros(2), 20.0)
        >>> grid.at(np.array([[10.0, 10.0], [30.0, 10.0], [50.0, 10.0]]))
        array([254,   0, 205], dtype=uint8)
        """
        column, row = np.floor((np.asarray(points_mm, float) - self.origin_mm) / self.resolution_mm).astype(int).T
        rows, columns = self.cells.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        levels = np.full(len(row), UNKNOWN, np.uint8)
        levels[inside] = self.cells[row[inside], column[inside]]
        return levels


def occupancy_grid(
    stations: Sequence[Station],
    *,
    objects: Sequence[MeasuredObject] = (),
    resolution_mm: float = 20.0,
    least_share: float = 0.1,
) -> OccupancyGrid:
    """Follow the beams of all scans over the floor.

    Parameters
    ----------
    stations : sequence of Station
    objects : sequence of MeasuredObject
        In the map; their outlines are taken, also those that the beams pass over.
    resolution_mm : float
        Side of a cell.
    least_share : float
        A cell is taken if at least this share of the beams that reach it end in it: others pass it at its corner.

    Returns
    -------
    OccupancyGrid

    Raises
    ------
    ValueError
        If there is no reading, a cell has no side, or the grid would have more than 25 million cells.

    Notes
    -----
    A beam frees every cell that its line crosses, but the one it ends in. The crossings are found exactly: its ends
    and every point where it meets a line of the grid, in order, have the cells' centres between them.
    """
    laser = [np.broadcast_to(s.to_map(s.laser_mm), s.scan_mm.shape) for s in stations]
    if not sum(map(len, laser)):
        raise ValueError(f"{counted(len(stations), 'station')} without a single reading: no grid: give their scans")
    if not resolution_mm > 0:
        raise ValueError(f"a cell needs a positive side in mm, got {resolution_mm}")
    start, end = np.concatenate(laser), np.concatenate([s.to_map(s.scan_mm) for s in stations])
    both = np.concatenate([start, end])
    origin = np.floor((both.min(axis=0) - _RIM_MM) / resolution_mm) * resolution_mm
    columns, rows = (np.ceil((both.max(axis=0) + _RIM_MM - origin) / resolution_mm)).astype(int)
    if rows * columns > _MOST_CELLS:
        raise ValueError(f"cells of {resolution_mm:g} mm make {columns} x {rows} of them: take larger ones")
    passed, ended = np.zeros(rows * columns, int), np.zeros(rows * columns, int)
    a, b = (start - origin) / resolution_mm, (end - origin) / resolution_mm
    for group in np.array_split(np.arange(len(a)), max(1, len(a) // _BEAMS_AT_ONCE)):
        cells, last = _crossed(a[group], b[group], columns)
        passed += np.bincount(cells, minlength=len(passed))
        ended += np.bincount(last, minlength=len(ended))
    grid = np.full(rows * columns, UNKNOWN, np.uint8)
    grid[passed > 0] = FREE
    grid[(ended > 0) & (ended >= least_share * (ended + passed))] = OCCUPIED
    grid = grid.reshape(rows, columns)
    for each in objects:
        if len(each.outline_mm) > 1 and np.isfinite(each.outline_mm).all():
            corners = np.floor((each.outline_mm - origin) / resolution_mm).astype(np.int32)
            cv2.fillPoly(grid, [cv2.convexHull(corners)], OCCUPIED)
    return OccupancyGrid(grid, origin, float(resolution_mm))


def _crossed(a: Float64, b: Float64, columns: int) -> tuple[Ints, Ints]:
    """Cells that the lines a to b (N, 2), in cells, cross before their last one, and the last ones (N,)."""
    way = b - a
    most = int(np.ceil(np.abs(way)).max()) + 1
    shares = [np.zeros((len(a), 1)), np.ones((len(a), 1))]
    for axis in (0, 1):
        forward = np.where(way[:, axis] > 0, 1.0, -1.0)
        first = np.where(forward > 0, np.floor(a[:, axis]) + 1, np.ceil(a[:, axis]) - 1)
        lines = first[:, None] + forward[:, None] * np.arange(most)
        step = np.where(way[:, axis] == 0, np.inf, way[:, axis])
        shares.append(np.clip((lines - a[:, axis, None]) / step[:, None], 0, 1))
    t = np.sort(np.concatenate(shares, axis=1), axis=1)
    middle, long = (t[:, 1:] + t[:, :-1]) / 2, np.diff(t, axis=1) > 1e-9
    column, row = (np.floor(a[:, k, None] + middle * way[:, k, None]).astype(int) for k in (0, 1))
    last = np.floor(b).astype(int)
    index, final = row * columns + column, last[:, 1] * columns + last[:, 0]
    return index[long & (index != final[:, None])], final
