"""The map in space: a small renderer that is fast enough to be turned with sliders.

Prisms, walls and points in perspective, far things first (the painter's algorithm). Walls between the eye and the room
are left open, so that one looks in.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from stereolib.mapping.assemble import Map
from stereolib.mapping.files import Cloud, Solid

Array = np.ndarray
_LIGHT = np.array([0.35, -0.55, 0.76])
_SHIFT = 3  # fractional bits of cv2's coordinates


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
    size : (width, height)
    zoom : float
        Focal length over the picture's width.
    """

    def __init__(
        self, target_mm: Array, azimuth_deg: float, elevation_deg: float, distance_mm: float, size: tuple[int, int],
        zoom: float = 1.25,
    ) -> None:  # fmt: skip
        a, e = np.radians(azimuth_deg), np.radians(elevation_deg)
        forward = np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), -np.sin(e)])
        right = np.array([np.sin(a), -np.cos(a), 0.0])
        self.axes = np.stack([right, np.cross(forward, right), forward])  # right, down, forward
        self.place_mm = np.asarray(target_mm, float) - distance_mm * forward
        self.f_px, self.centre_px = zoom * size[0], np.array(size) / 2

    def fit(self, points_mm: Array, size: tuple[int, int], rim_px: float = 16.0) -> None:
        """Zoom and shift so that points (N, 3) mm just fill a picture."""
        pixels = self.project(points_mm)[0]
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        scale = float(((np.array(size) - 2 * rim_px) / (high - low)).min())
        self.centre_px = np.array(size) / 2 - scale * ((low + high) / 2 - self.centre_px)
        self.f_px *= scale

    def project(self, points_mm: Array) -> tuple[Array, Array]:
        """Pixels (N, 2) and depths (N,) of points (N, 3) mm."""
        seen = (np.asarray(points_mm, float).reshape(-1, 3) - self.place_mm) @ self.axes.T
        depth = np.maximum(seen[:, 2], 1.0)
        return seen[:, :2] / depth[:, None] * self.f_px + self.centre_px, seen[:, 2]


def view_map(
    found: Map,
    made: Sequence[Solid],
    *,
    azimuth_deg: float = 35.0,
    elevation_deg: float = 35.0,
    points: Cloud | None = None,
    size: tuple[int, int] = (900, 600),
) -> Array:
    """Picture of a map from any side.

    Parameters
    ----------
    found : Map
        Its stations and the extent of its readings.
    made : sequence of Solid
        From `stereolib.map_files.solids`.
    azimuth_deg, elevation_deg : float
        Of the eye: see `Eye`.
    points : Cloud, optional
        Drawn instead of the solids' faces; the solids are then outlines.
    size : (width, height)

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
    low, high = _extent(found, made)
    middle = np.append((low + high) / 2, 120.0)
    eye = Eye(middle, azimuth_deg, elevation_deg, 1.75 * float(np.linalg.norm(high - low)), size)
    ground = np.array([[x, y, 0.0] for x in (low[0], high[0]) for y in (low[1], high[1])])
    tops = [np.pad(s.outline_mm, ((0, 0), (0, 1)), constant_values=s.height_mm) for s in made]
    eye.fit(np.concatenate([ground, *tops]), size)
    picture = np.full((size[1], size[0], 3), 255, np.uint8)
    _floor(picture, eye, low, high)
    walls = [solid for solid in made if solid.name.startswith("wall")]
    things = [solid for solid in made if not solid.name.startswith("wall")]
    for wall in _far_first(walls, eye):
        front, back = wall.outline_mm[:2], wall.outline_mm[2:]
        looks_in = (eye.place_mm[:2] - front[0]) @ (front.mean(axis=0) - back.mean(axis=0)) > 0
        _panel(picture, eye, front, wall.height_mm, wall.color_rgb, filled=looks_in)
    for k, station in enumerate(found.stations, start=1):
        _station(picture, eye, station.pose, str(k))
    if points is not None:
        _points(picture, eye, points)
    for solid in _far_first(things, eye):
        _solid(picture, eye, solid, filled=points is None)
    for solid in _far_first(things, eye):
        top = np.append(solid.outline_mm.mean(axis=0), solid.height_mm)
        _text(picture, solid.name, eye.project(top)[0][0], 0.7)
    return picture


def _extent(found: Map, made: Sequence[Solid]) -> tuple[Array, Array]:
    corners = [solid.outline_mm for solid in made] + [station.pose[None, :2] for station in found.stations]
    everything = np.concatenate(corners)
    return everything.min(axis=0), everything.max(axis=0)


def _far_first(some: Sequence[Solid], eye: Eye) -> list[Solid]:
    flat = eye.axes[2, :2]
    return sorted(some, key=lambda solid: -float((solid.outline_mm.mean(axis=0) - eye.place_mm[:2]) @ flat))


def _polygon(picture: Array, pixels: Array, fill: Array | None, edge: Array | None) -> None:
    corners = np.rint(np.clip(pixels, -4000, 4000) * 2**_SHIFT).astype(np.int32)
    if fill is not None:
        cv2.fillConvexPoly(picture, corners, _bgr(fill), cv2.LINE_AA, _SHIFT)
    if edge is not None:
        cv2.polylines(picture, [corners], True, _bgr(edge), 1, cv2.LINE_AA, _SHIFT)


def _bgr(rgb: Array) -> tuple[float, float, float]:
    r, g, b = (float(c) for c in np.clip(rgb, 0, 255))
    return b, g, r


def _floor(picture: Array, eye: Eye, low: Array, high: Array, step: float = 500.0) -> None:
    square = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    _polygon(picture, eye.project(np.pad(square, ((0, 0), (0, 1))))[0], np.full(3, 246.0), None)
    for axis in (0, 1):
        for at in np.arange(np.ceil(low[axis] / step) * step, high[axis], step):
            line = np.zeros((2, 3))
            line[:, axis], line[:, 1 - axis] = at, (low[1 - axis], high[1 - axis])
            strong = np.full(3, 150.0 if at == 0 else 215.0)
            _polygon(picture, eye.project(line)[0], None, strong)
    _text(picture, "grid: 0.5 m", np.array([76.0, picture.shape[0] - 16.0]), 0.45)


def _panel(picture: Array, eye: Eye, ends: Array, height: float, rgb: Sequence[int], *, filled: bool) -> None:
    corners = np.array([[*ends[0], 0], [*ends[1], 0], [*ends[1], height], [*ends[0], height]])
    normal = np.array([ends[1][1] - ends[0][1], ends[0][0] - ends[1][0], 0.0])
    shade = 0.82 + 0.18 * abs(float(normal @ _LIGHT)) / max(float(np.linalg.norm(normal)), 1e-9)
    pixels = eye.project(corners)[0]
    _polygon(
        picture, pixels if filled else pixels[:2], shade * np.array(rgb) + 30 if filled else None, np.full(3, 130.0)
    )


def _solid(picture: Array, eye: Eye, solid: Solid, *, filled: bool) -> None:
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


def _points(picture: Array, eye: Eye, points: Cloud) -> None:
    """Points as dots of 2 x 2 pixels, the far ones first."""
    pixels, depth = eye.project(points.points_mm)
    column, row = np.rint(pixels).astype(int).T
    height, width = picture.shape[:2]
    inside = np.flatnonzero((depth > 1) & (column >= 0) & (row >= 0) & (column < width - 1) & (row < height - 1))
    inside = inside[np.argsort(-depth[inside], kind="stable")]
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        picture[row[inside] + dy, column[inside] + dx] = points.colors_rgb[inside, ::-1]


def _station(picture: Array, eye: Eye, pose: Array, name: str) -> None:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    arrow = np.array([[90.0, 0], [-60, 50], [-60, -50]]) @ np.array([[c, s], [-s, c]]) + pose[:2]
    _polygon(picture, eye.project(np.pad(arrow, ((0, 0), (0, 1))))[0], np.full(3, 40.0), None)
    behind = np.array([pose[0] - 130 * c, pose[1] - 130 * s, 0.0])
    _text(picture, name, eye.project(behind)[0][0], 0.5)


def _text(picture: Array, text: str, at: Array, scale: float) -> None:
    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)
    x, y = int(at[0] - width / 2), int(at[1] + height / 2)
    for color, thick in (((255, 255, 255), 4), ((20, 20, 20), 1)):
        cv2.putText(picture, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, scale, color, thick, cv2.LINE_AA)
