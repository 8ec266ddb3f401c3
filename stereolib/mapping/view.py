"""The map in space: a small renderer that is fast enough to be turned with sliders.

Prisms, walls and points in perspective, far things first (the painter's algorithm). Walls between the eye and the room
are left open, so that one looks in.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from stereolib.base import Float64, UInt8, as_rows, direction
from stereolib.mapping.assemble import Map
from stereolib.mapping.shapes import Cloud, Solid
from stereolib.mapping.stations import Station, station_names

_LIGHT = np.array([0.35, -0.55, 0.76])  # towards it: over the shoulder, so that the sides differ
_SHIFT = 3  # fractional bits of cv2's coordinates
_ZOOM = 1.25  # focal length over the picture's width, before the map is made to fill it
_RIM_PX = 16.0  # left free around the map
_AWAY = 1.75  # distance of the eye over the map's diagonal: perspective that is seen and does not distort
_TARGET_MM = 120.0  # height of the point that the eye looks at, about an object's middle
_GRID_MM = 500.0
_ARROW_MM = np.array([[90.0, 0], [-60, 50], [-60, -50]])  # a station's, looking along +x
_LABEL_MM = 130.0  # behind the station


class Eye:
    """A perspective camera that looks at a point from some direction.

    Parameters
    ----------
    target_mm : (3,) array
    azimuth_deg : float
        Where the eye looks: 0 along the map's +x, 90 along its +y.
    elevation_deg : float
        Above the floor, 0 to 90.
    distance_mm : float
    size : (width, height), px
    """

    def __init__(
        self, target_mm: Float64, azimuth_deg: float, elevation_deg: float, distance_mm: float, size: tuple[int, int]
    ) -> None:
        a, e = np.radians(azimuth_deg), np.radians(elevation_deg)
        forward = np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), -np.sin(e)])
        right = np.array([np.sin(a), -np.cos(a), 0.0])
        self.axes = np.stack([right, np.cross(forward, right), forward])  # right, down, forward
        self.place_mm = np.asarray(target_mm, float) - distance_mm * forward
        self.f_px, self.centre_px = _ZOOM * size[0], np.array(size) / 2

    def fill(self, points_mm: Float64, size: tuple[int, int]) -> None:
        """Zoom and shift so that points just fill a picture.

        Parameters
        ----------
        points_mm : (N, 3) float64
        size : (width, height), px
        """
        pixels = self.project(points_mm)[0]
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        scale = float(((np.array(size) - 2 * _RIM_PX) / (high - low)).min())
        self.centre_px = np.array(size) / 2 - scale * ((low + high) / 2 - self.centre_px)
        self.f_px *= scale

    def project(self, points_mm: Float64) -> tuple[Float64, Float64]:
        """Project points into the picture.

        Parameters
        ----------
        points_mm : (N, 3) float64

        Returns
        -------
        pixels, depths_mm : (N, 2) and (N,) float64
        """
        turned = (as_rows(points_mm, 3, "points_mm") - self.place_mm) @ self.axes.T
        depth = np.maximum(turned[:, 2], 1.0)
        return turned[:, :2] / depth[:, None] * self.f_px + self.centre_px, turned[:, 2]


def view_map(
    room: Map,
    solids: Sequence[Solid],
    *,
    azimuth_deg: float = 35.0,
    elevation_deg: float = 35.0,
    points: Cloud | None = None,
    size: tuple[int, int] = (900, 600),
) -> UInt8:
    """Draw a map from any side.

    Parameters
    ----------
    room : Map
        Its stations are drawn.
    solids : sequence of Solid
        From `map_solids`.
    azimuth_deg, elevation_deg : float
        Where the eye looks, 0 along the map's +x, 90 along its +y, and how far above the floor it stands.
    points : Cloud, optional
        Drawn instead of the solids' faces; the solids are then outlines.
    size : (width, height), px

    Returns
    -------
    (H, W, 3) uint8, blue-green-red

    Raises
    ------
    ValueError
        If the elevation is not between 0 and 90 degrees.
    """
    if not 0 < elevation_deg <= 90:
        raise ValueError(f"the eye stands above the floor, at an elevation up to 90 degrees; got {elevation_deg:g}")
    low, high = _extent(room, solids)
    middle = np.append((low + high) / 2, _TARGET_MM)
    eye = Eye(middle, azimuth_deg, elevation_deg, _AWAY * float(np.linalg.norm(high - low)), size)
    ground = np.array([[x, y, 0.0] for x in (low[0], high[0]) for y in (low[1], high[1])])
    tops = [np.pad(s.outline_mm, ((0, 0), (0, 1)), constant_values=s.height_mm) for s in solids]
    eye.fill(np.concatenate([ground, *tops]), size)
    picture = np.full((size[1], size[0], 3), 255, np.uint8)
    _floor(picture, eye, low, high)
    walls = [solid for solid in solids if solid.name.startswith("wall")]
    objects = [solid for solid in solids if not solid.name.startswith("wall")]
    for wall in _far_first(walls, eye):
        front, back = wall.outline_mm[:2], wall.outline_mm[2:]
        looks_in = (eye.place_mm[:2] - front[0]) @ (front.mean(axis=0) - back.mean(axis=0)) > 0
        _panel(picture, eye, front, wall.height_mm, wall.color_rgb, filled=looks_in)
    for station, name in zip(room.stations, station_names(room.stations), strict=True):
        _station(picture, eye, station, name)
    if points is not None:
        _points(picture, eye, points)
    for solid in _far_first(objects, eye):
        _solid(picture, eye, solid, filled=points is None)
    for solid in _far_first(objects, eye):
        top = np.append(solid.outline_mm.mean(axis=0), solid.height_mm)
        _text(picture, solid.name, eye.project(top)[0][0], 0.7)
    return picture


def _extent(room: Map, solids: Sequence[Solid]) -> tuple[Float64, Float64]:
    corners = [solid.outline_mm for solid in solids] + [station.pose[None, :2] for station in room.stations]
    everything = np.concatenate(corners)
    return everything.min(axis=0), everything.max(axis=0)


def _far_first(some: Sequence[Solid], eye: Eye) -> list[Solid]:
    flat = eye.axes[2, :2]
    return sorted(some, key=lambda solid: -float((solid.outline_mm.mean(axis=0) - eye.place_mm[:2]) @ flat))


def _polygon(picture: UInt8, pixels: Float64, fill: Float64 | None, edge: Float64 | None) -> None:
    corners = np.rint(np.clip(pixels, -4000, 4000) * 2**_SHIFT).astype(np.int32)
    if fill is not None:
        cv2.fillConvexPoly(picture, corners, _bgr(fill), cv2.LINE_AA, _SHIFT)
    if edge is not None:
        cv2.polylines(picture, [corners], True, _bgr(edge), 1, cv2.LINE_AA, _SHIFT)


def _bgr(rgb: Float64) -> tuple[float, float, float]:
    r, g, b = (float(c) for c in np.clip(rgb, 0, 255))
    return b, g, r


def _floor(picture: UInt8, eye: Eye, low: Float64, high: Float64) -> None:
    square = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    _polygon(picture, eye.project(np.pad(square, ((0, 0), (0, 1))))[0], np.full(3, 246.0), None)
    for axis in (0, 1):
        for at in np.arange(np.ceil(low[axis] / _GRID_MM) * _GRID_MM, high[axis], _GRID_MM):
            line = np.zeros((2, 3))
            line[:, axis], line[:, 1 - axis] = at, (low[1 - axis], high[1 - axis])
            strong = np.full(3, 150.0 if at == 0 else 215.0)
            _polygon(picture, eye.project(line)[0], None, strong)
    _text(picture, "grid: 0.5 m", np.array([76.0, picture.shape[0] - 16.0]), 0.45)


def _panel(picture: UInt8, eye: Eye, ends: Float64, height: float, rgb: Sequence[int], *, filled: bool) -> None:
    corners = np.array([[*ends[0], 0], [*ends[1], 0], [*ends[1], height], [*ends[0], height]])
    normal = np.array([ends[1][1] - ends[0][1], ends[0][0] - ends[1][0], 0.0])
    shade = 0.82 + 0.18 * abs(float(normal @ _LIGHT)) / max(float(np.linalg.norm(normal)), 1e-9)
    pixels = eye.project(corners)[0]
    fill = shade * np.array(rgb) + 30 if filled else None
    _polygon(picture, pixels if filled else pixels[:2], fill, np.full(3, 130.0))


def _solid(picture: UInt8, eye: Eye, solid: Solid, *, filled: bool) -> None:
    """Faces that look at the eye; of a convex prism none of them hides another."""
    base, rgb = solid.outline_mm, np.array(solid.color_rgb, float)
    n, up = len(base), np.array([0.0, 0.0, solid.height_mm])
    low = np.pad(base, ((0, 0), (0, 1)))
    faces = [np.stack([low[k], low[(k + 1) % n], low[(k + 1) % n] + up, low[k] + up]) for k in range(n)]
    for face in [*faces, low + up]:
        normal = np.cross(face[1] - face[0], face[2] - face[1])
        if normal @ (eye.place_mm - face[0]) <= 0:
            continue
        shade = 0.62 + 0.38 * max(float(normal @ _LIGHT) / max(float(np.linalg.norm(normal)), 1e-9), 0.0)
        edge = 0.45 * rgb if solid.known else np.array([200.0, 0, 0])
        _polygon(picture, eye.project(face)[0], shade * rgb + 20 if filled else None, edge if filled else 0.8 * rgb)


def _points(picture: UInt8, eye: Eye, points: Cloud) -> None:
    """Points as dots of 2 x 2 pixels, the far ones first."""
    pixels, depth = eye.project(points.points_mm)
    column, row = np.rint(pixels).astype(int).T
    height, width = picture.shape[:2]
    inside = np.flatnonzero((depth > 1) & (column >= 0) & (row >= 0) & (column < width - 1) & (row < height - 1))
    inside = inside[np.argsort(-depth[inside], kind="stable")]
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        picture[row[inside] + dy, column[inside] + dx] = points.colors_rgb[inside, ::-1]


def _station(picture: UInt8, eye: Eye, station: Station, name: str) -> None:
    arrow = np.pad(station.to_map(_ARROW_MM), ((0, 0), (0, 1)))
    _polygon(picture, eye.project(arrow)[0], np.full(3, 40.0), None)
    behind = np.append(station.pose[:2] - _LABEL_MM * direction(station.pose[2]), 0.0)
    _text(picture, name, eye.project(behind)[0][0], 0.5)


def _text(picture: UInt8, text: str, at: Float64, scale: float) -> None:
    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)
    x, y = int(at[0] - width / 2), int(at[1] + height / 2)
    for color, thick in (((255, 255, 255), 4), ((20, 20, 20), 1)):
        cv2.putText(picture, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, scale, color, thick, cv2.LINE_AA)
