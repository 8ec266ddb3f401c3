"""The map as files that other programs open: PLY and GLB meshes, coloured points, ROS's occupancy grid.

Files are in metres: PLY with z up as ROS has it, GLB with y up as glTF prescribes. The same map makes the same bytes.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from stereolib.base import Float64, Ints, write_atomic
from stereolib.mapping.occupancy import OccupancyGrid
from stereolib.mapping.shapes import Cloud, Solid

_DECIMALS_M = 6  # a micrometre: far below any deviation, far above what processors disagree about


def write_mesh(path: str | os.PathLike[str], solids: Sequence[Solid], *, overwrite: bool = False) -> Path:
    """Write solids as a mesh: ``.glb`` (each with its name, y up) or ``.ply`` (one mesh, z up), metres.

    Parameters
    ----------
    path : path
    solids : sequence of Solid
    overwrite : bool
        Replace a file that is there.

    Returns
    -------
    Path

    Raises
    ------
    ValueError
        If the path ends otherwise, there is no solid, or the file exists and `overwrite` is not set.
    """
    import trimesh

    path = _target(path, (".ply", ".glb"), overwrite)
    if not solids:
        raise ValueError(f"{path.name}: the map is empty, there is nothing to write")
    meshes = []
    for solid in solids:
        vertices, faces = _prism(solid)
        color = np.array([*solid.color_rgb, 255], np.uint8)
        meshes.append(trimesh.Trimesh(vertices, faces, vertex_colors=np.tile(color, (len(vertices), 1)), process=False))
    if path.suffix == ".ply":
        return write_atomic(path, trimesh.exchange.ply.export_ply(trimesh.util.concatenate(meshes)))
    scene: Any = trimesh.Scene()
    visual: Any = trimesh.visual  # untyped
    y_up = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    for solid, mesh in zip(solids, meshes, strict=True):
        material = visual.material.PBRMaterial(
            name=solid.name,
            baseColorFactor=[*(c / 255 for c in solid.color_rgb), 1.0],
            metallicFactor=0.0,
            roughnessFactor=0.9,
        )
        mesh.visual = visual.TextureVisuals(material=material)
        mesh.unmerge_vertices()  # flat faces: no normal is shared
        scene.add_geometry(mesh.apply_transform(y_up), node_name=solid.name, geom_name=solid.name)
    return write_atomic(path, scene.export(file_type="glb"))


def write_cloud(path: str | os.PathLike[str], points: Cloud, *, overwrite: bool = False) -> Path:
    """Write coloured points as binary PLY, metres, z up.

    Parameters
    ----------
    path : path
        Ends in ``.ply``.
    points : Cloud
    overwrite : bool
        Replace a file that is there.

    Returns
    -------
    Path

    Raises
    ------
    ValueError
        If the path ends otherwise, there is no point, or the file exists and `overwrite` is not set.
    """
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
    overwrite : bool
        Replace files that are there.

    Returns
    -------
    yaml, pgm : Path

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
    image = yaml.safe_dump({"image": picture.name}, allow_unicode=True, width=np.inf)  # quoted where it must be
    x, y = grid.origin_mm / 1000
    text = (
        f"{image}resolution: {grid.resolution_mm / 1000:.6f}\norigin: [{x:.6f}, {y:.6f}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return write_atomic(path, text), picture


def _prism(solid: Solid) -> tuple[Float64, Ints]:
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


def _target(path: str | os.PathLike[str], endings: tuple[str, ...], overwrite: bool) -> Path:
    path = Path(path)
    if path.suffix not in endings:
        ending = path.suffix or "no ending"
        raise ValueError(f"{path.name}: this file must end in {' or '.join(endings)}, got {ending!r}")
    if path.exists() and not overwrite:
        raise ValueError(f"{path} exists: choose another name, or pass overwrite=True to replace it")
    return path
