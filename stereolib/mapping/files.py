"""The map as files that other programs open: PLY and GLB meshes, a coloured point cloud, ROS's occupancy grid.

Files are in metres: PLY with z up as ROS has it, GLB with y up as glTF prescribes. The same map makes the same bytes.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from stereolib.base import set_frozen, write_atomic
from stereolib.mapping.assemble import Map
from stereolib.mapping.occupancy import OccupancyGrid
from stereolib.mapping.stations import Station
from stereolib.measurement import Floor, check_disparity_map, pixel_rays

Array = np.ndarray
#: Colours of objects, red-green-blue: those of the figures, without the walls' grey.
COLORS = ((0, 114, 178), (213, 94, 0), (0, 158, 115), (204, 121, 167), (230, 159, 0), (86, 180, 233))
WALL_RGB = (190, 190, 190)
_DECIMALS_M = 6  # a micrometre: far below any deviation, far above what processors disagree about


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
    outline_mm: Array
    height_mm: float
    color_rgb: tuple[int, int, int]
    known: bool = True


@dataclass(frozen=True, eq=False)
class Cloud:
    """Coloured points: ``points_mm`` (N, 3) float64, x forward, y left, z up; ``colors_rgb`` (N, 3) uint8."""

    points_mm: Array
    colors_rgb: Array

    def __post_init__(self) -> None:
        set_frozen(self, points_mm=np.asarray(self.points_mm, float), colors_rgb=np.asarray(self.colors_rgb, np.uint8))
        if self.points_mm.shape != self.colors_rgb.shape or self.points_mm.shape[1:] != (3,):
            shapes = f"{self.points_mm.shape} and {self.colors_rgb.shape}"
            raise ValueError(f"a cloud has as many colours as points, both (N, 3); got {shapes}")


def solids(found: Map, *, wall_height_mm: float = 500.0, wall_thickness_mm: float = 20.0) -> list[Solid]:
    """Objects and walls as upright prisms.

    Parameters
    ----------
    found : Map
    wall_height_mm : float
        A scan does not tell how high a wall is: drawn so high.
    wall_thickness_mm : float
        Nor how thick; it grows away from the room.
    """
    made = []
    for k, (name, thing) in enumerate(zip(found.names, found.things, strict=True)):
        outline = thing.outline_mm[np.isfinite(thing.outline_mm).all(axis=1)]
        if len(outline) < 2:
            continue
        if len(outline) == 2:  # a face: a sheet
            along = np.diff(outline, axis=0)[0]
            side = 2.0 * np.array([-along[1], along[0]]) / max(float(np.linalg.norm(along)), 1e-9)
            outline = np.concatenate([outline - side, outline[::-1] + side])
        hull = cv2.convexHull(outline.astype(np.float32))[:, 0].astype(float)
        area = np.sum(hull[:, 0] * np.roll(hull[:, 1], -1) - hull[:, 1] * np.roll(hull[:, 0], -1))
        height = float(thing.size_mm[2])
        solid = hull if area > 0 else hull[::-1]
        known = bool(np.isfinite(thing.size_mm).all())
        made.append(Solid(name, solid, height if np.isfinite(height) else 2.0, COLORS[k % len(COLORS)], known))
    for k, wall in enumerate(found.walls, start=1):
        back = wall.ends_mm - wall_thickness_mm * wall.normal
        outline = np.concatenate([wall.ends_mm, back[::-1]])
        made.append(Solid(f"wall {k}", outline, wall_height_mm, WALL_RGB))
    return made


def cloud(
    disparity_px: Array,
    left: Array,
    floor: Floor | None,
    *,
    pose: Sequence[float] | Array = (0.0, 0.0, 0.0),
    step: int = 3,
    max_mm: float = 3000.0,
) -> Cloud:
    """Coloured points of a pair, in the floor's frame or in the map.

    Parameters
    ----------
    disparity_px : (H, W) float, px
        Of the rectified left image, NaN where invalid.
    left : (H, W) or (H, W, 3) uint8
        The rectified left image, grey or blue-green-red.
    floor : Floor
        Tells which way is up.
    pose : (x_mm, y_mm, yaw_rad)
        Of the station's floor frame in the map.
    step : int
        Every so many pixels of every so many rows.
    max_mm : float
        Points farther ahead are left out.

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


def joined(clouds: Sequence[Cloud]) -> Cloud:
    """Several clouds of one frame as one."""
    return Cloud(np.concatenate([c.points_mm for c in clouds]), np.concatenate([c.colors_rgb for c in clouds]))


def write_mesh(path: str | os.PathLike[str], made: Sequence[Solid], *, overwrite: bool = False) -> Path:
    """Write solids as a mesh: ``.glb`` (each with its name, y up) or ``.ply`` (one mesh, z up), metres.

    Raises
    ------
    ValueError
        If the path ends otherwise, there is no solid, or the file exists and `overwrite` is not set.
    """
    import trimesh

    path = _target(path, (".ply", ".glb"), overwrite)
    if not made:
        raise ValueError(f"{path.name}: the map is empty, there is nothing to write")
    meshes = []
    for solid in made:
        vertices, faces = _prism(solid)
        color = np.array([*solid.color_rgb, 255], np.uint8)
        meshes.append(trimesh.Trimesh(vertices, faces, vertex_colors=np.tile(color, (len(vertices), 1)), process=False))
    if path.suffix == ".ply":
        return write_atomic(path, trimesh.exchange.ply.export_ply(trimesh.util.concatenate(meshes)))
    scene = trimesh.Scene()
    y_up = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    for solid, mesh in zip(made, meshes, strict=True):
        material = trimesh.visual.material.PBRMaterial(
            name=solid.name,
            baseColorFactor=[*(c / 255 for c in solid.color_rgb), 1.0],
            metallicFactor=0.0,
            roughnessFactor=0.9,
        )
        mesh.visual = trimesh.visual.TextureVisuals(material=material)
        mesh.unmerge_vertices()  # flat faces: no normal is shared
        scene.add_geometry(mesh.apply_transform(y_up), node_name=solid.name, geom_name=solid.name)
    return write_atomic(path, scene.export(file_type="glb"))


def write_cloud(path: str | os.PathLike[str], points: Cloud, *, overwrite: bool = False) -> Path:
    """Write a coloured cloud as binary PLY, metres, z up. Raises as `write_mesh`."""
    path = _target(path, (".ply",), overwrite)
    if not len(points.points_mm):
        raise ValueError(f"{path.name}: the cloud has no point, there is nothing to write")
    row = np.zeros(len(points.points_mm), [("xyz", "<f4", 3), ("rgb", "u1", 3)])
    row["xyz"], row["rgb"] = (points.points_mm / 1000).round(_DECIMALS_M), points.colors_rgb
    fields = [f"property float {axis}" for axis in "xyz"] + [f"property uchar {c}" for c in ("red", "green", "blue")]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(row)}", *fields, "end_header", ""]
    return write_atomic(path, "\n".join(header).encode() + row.tobytes())


def write_grid(path: str | os.PathLike[str], grid: OccupancyGrid, *, overwrite: bool = False) -> tuple[Path, Path]:
    """Write a grid as ROS's map_server reads it: ``name.yaml``, and ``name.pgm`` beside it.

    Parameters
    ----------
    path : path
        Of the YAML file.
    grid : OccupancyGrid

    Returns
    -------
    (yaml, pgm) : paths

    Raises
    ------
    ValueError
        If the path does not end in ``.yaml``, or one of the files exists and `overwrite` is not set.

    Notes
    -----
    The picture's first row is the one with the largest y. An occupancy is ``(255 - grey) / 255``: 1 taken, 0.004 free,
    0.196 unknown, which lies between the two thresholds.
    """
    path = _target(path, (".yaml",), overwrite)
    picture = _target(path.with_suffix(".pgm"), (".pgm",), overwrite)
    rows, columns = grid.cells.shape
    write_atomic(picture, f"P5\n{columns} {rows}\n255\n".encode() + grid.cells[::-1].tobytes())
    x, y = grid.origin_mm / 1000
    lines = [
        f"image: {picture.name}", f"resolution: {grid.resolution_mm / 1000:.6f}", f"origin: [{x:.6f}, {y:.6f}, 0.0]",
        "negate: 0", "occupied_thresh: 0.65", "free_thresh: 0.196", "",
    ]  # fmt: skip
    return write_atomic(path, "\n".join(lines)), picture


def _prism(solid: Solid) -> tuple[Array, Array]:
    """Vertices (2 N, 3) in metres, z up, and triangles, seen from outside counter-clockwise."""
    n = len(solid.outline_mm)
    base = np.column_stack([solid.outline_mm, np.zeros(n)])
    vertices = (np.concatenate([base, base + np.array([0.0, 0.0, solid.height_mm])]) / 1000).round(_DECIMALS_M)
    i, j = np.arange(n), (np.arange(n) + 1) % n
    sides = np.concatenate([np.stack([i, j, j + n], axis=1), np.stack([i, j + n, i + n], axis=1)])
    k = np.arange(1, n - 1)
    zero = np.zeros_like(k)
    caps = np.concatenate([np.stack([zero, k + 1, k], axis=1), n + np.stack([zero, k, k + 1], axis=1)])
    return vertices, np.concatenate([sides, caps])


def _target(path: Any, endings: tuple[str, ...], overwrite: bool) -> Path:
    path = Path(path)
    if path.suffix not in endings:
        raise ValueError(
            f"{path.name}: this file must end in {' or '.join(endings)}, got {path.suffix or 'no ending'!r}"
        )
    if path.exists() and not overwrite:
        raise ValueError(f"{path} exists: choose another name, or pass overwrite=True to replace it")
    return path
