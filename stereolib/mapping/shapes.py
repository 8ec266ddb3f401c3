"""What a map is drawn and written as: its objects and walls as prisms, its pictures as coloured points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.base import Float64, Floats, UInt8, set_frozen
from stereolib.mapping.assemble import Map
from stereolib.mapping.stations import Station
from stereolib.measurement import OBJECT_RGB, Floor, check_disparity_map, pixel_rays

WALL_RGB = (190, 190, 190)
_WALL_MM = 20.0  # how thick walls are drawn, away from the room: a scan does not tell
_THIN_MM = 2.0  # what was not measured is drawn so thin or flat: seen, and taken for no size


@dataclass(frozen=True, eq=False)
class Solid:
    """An upright prism of the map: an object, or a wall.

    Attributes
    ----------
    name : str
    outline_mm : (N, 2) float64
        Convex, counter-clockwise.
    height_mm : float
    color_rgb : (3,) int
    known : bool
        All three sizes were measured; else what was not is drawn thin or flat.
    """

    name: str
    outline_mm: Float64
    height_mm: float
    color_rgb: tuple[int, int, int]
    known: bool = True


@dataclass(frozen=True, eq=False)
class Cloud:
    """Coloured points.

    Attributes
    ----------
    points_mm : (N, 3) float64
        x forward, y left, z up.
    colors_rgb : (N, 3) uint8
    """

    points_mm: Float64
    colors_rgb: UInt8

    def __post_init__(self) -> None:
        set_frozen(self, points_mm=np.asarray(self.points_mm, float), colors_rgb=np.asarray(self.colors_rgb, np.uint8))
        if self.points_mm.shape != self.colors_rgb.shape or self.points_mm.shape[1:] != (3,):
            shapes = f"{self.points_mm.shape} and {self.colors_rgb.shape}"
            raise ValueError(f"a cloud has as many colours as points, both (N, 3); got {shapes}")


def map_solids(room: Map, *, wall_height_mm: float = 500.0) -> list[Solid]:
    """Make upright prisms of the objects and walls of a map.

    Parameters
    ----------
    room : Map
    wall_height_mm : float
        A scan does not tell how high a wall is: drawn so high.

    Returns
    -------
    list of Solid
        The objects by their names, then ``"wall 1"``, ...
    """
    solids = []
    for k, (name, measured) in enumerate(zip(room.names, room.measured, strict=True)):
        outline = measured.outline_mm[np.isfinite(measured.outline_mm).all(axis=1)]
        if len(outline) < 2:
            continue
        if len(outline) == 2:  # a face: a sheet
            along = np.diff(outline, axis=0)[0]
            side = _THIN_MM * np.array([-along[1], along[0]]) / max(float(np.linalg.norm(along)), 1e-9)
            outline = np.concatenate([outline - side, outline[::-1] + side])
        hull = cv2.convexHull(outline.astype(np.float32))[:, 0].astype(float)
        area = np.sum(hull[:, 0] * np.roll(hull[:, 1], -1) - hull[:, 1] * np.roll(hull[:, 0], -1))
        height = float(measured.size_mm[2]) if np.isfinite(measured.size_mm[2]) else _THIN_MM
        known = bool(np.isfinite(measured.size_mm).all())
        solids.append(Solid(name, hull if area > 0 else hull[::-1], height, OBJECT_RGB[k % len(OBJECT_RGB)], known))
    for k, wall in enumerate(room.walls, start=1):
        back = wall.ends_mm - _WALL_MM * wall.normal
        outline = np.concatenate([wall.ends_mm, back[::-1]])
        solids.append(Solid(f"wall {k}", outline, wall_height_mm, WALL_RGB))
    return solids


def colored_cloud(
    disparity_px: Floats,
    left: UInt8,
    floor: Floor | None,
    *,
    pose: Sequence[float] | Float64 = (0.0, 0.0, 0.0),
    step: int = 3,
    max_mm: float = 3000.0,
) -> Cloud:
    """Make coloured points of a pair, in the floor's frame or in the map.

    Parameters
    ----------
    disparity_px : (H, W) float, px
        Of the rectified left image, NaN where invalid.
    left : (H, W) or (H, W, 3) uint8
        The rectified left image, grey or blue-green-red.
    floor : Floor or None
        Tells which way is up.
    pose : (x_mm, y_mm, yaw_rad)
        Of the station's floor frame in the map.
    step : int
        Every so many pixels of every so many rows.
    max_mm : float
        Points farther ahead are left out.

    Returns
    -------
    Cloud

    Raises
    ------
    ValueError
        If no floor was seen, or image, disparity and rig differ in size.
    """
    if floor is None:
        raise ValueError("no floor was seen in this pair: nothing tells which way is up in its cloud")
    disparity = check_disparity_map(disparity_px, floor.rectified)[::step, ::step]
    if left.shape[:2] != floor.rectified.size[::-1]:
        raise ValueError(f"the image has shape {left.shape}, the disparity {disparity_px.shape}: rectify it first")
    row, column = np.nonzero(np.isfinite(disparity) & (disparity > 0))
    rays = pixel_rays(float(step) * column, float(step) * row, floor.rectified)
    depth = floor.rectified.f_px * floor.rectified.baseline_mm / disparity[row, column].astype(float)
    points = depth[:, None] * rays @ floor.axes.T + [0.0, 0.0, floor.camera_height_mm]
    near = points[:, 0] < max_mm
    here = Station(np.asarray(pose, float), ())
    points[:, :2] = here.to_map(points[:, :2])
    color = left if left.ndim == 3 else cv2.cvtColor(left, cv2.COLOR_GRAY2BGR)
    colors = color[::step, ::step][row, column][:, ::-1]
    return Cloud(points[near], colors[near])


def join_clouds(clouds: Sequence[Cloud]) -> Cloud:
    """Join several clouds of one frame.

    Parameters
    ----------
    clouds : sequence of Cloud

    Returns
    -------
    Cloud

    Raises
    ------
    ValueError
        If there is none.

    Examples
    --------
    >>> one = Cloud(np.zeros((2, 3)), np.zeros((2, 3), np.uint8))
    >>> len(join_clouds([one, one, one]).points_mm)
    6
    """
    if not clouds:
        raise ValueError("no cloud was given, so that there is nothing to join: make them with `colored_cloud`")
    return Cloud(np.concatenate([c.points_mm for c in clouds]), np.concatenate([c.colors_rgb for c in clouds]))
