"""The recorded walk as a folder of recordings, named as `stereolib.mapping.list_stations` reads them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np

from stereolib.base import data_path, read_bytes, work_folder, write_atomic
from stereolib.measurement import save_laser_pose
from stereolib.paper import paper_rig
from stereolib.virtual import laser_boards, recordings, walk
from stereolib.virtual.lidar import VirtualLidar
from stereolib.virtual.measured_walk import walk_laser
from stereolib.virtual.rendering import render
from stereolib.virtual.webcam import Webcam

_BOARDS = tuple(f"laser/{k:02d}" for k in range(1, len(laser_boards.POSES) + 1))
_BOARD_MM = 180.0  # of its centre above the floor
_SEED = 18  # of the boards' noise

#: What `write_walk` writes.
WALK_FILES = (
    "calibration.json",
    "true_poses.csv",
    *(f"{name.split('/')[1]}_{part}" for name in walk.POSES for part in ("left.jpg", "right.jpg", "scan.bin")),
    *(f"{name}.{kind}" for name in _BOARDS for kind in ("jpg", "bin")),
)


def write_walk(folder: Path) -> list[Path]:
    """Write the pairs and scans of the walk, the rig with its laser, and, under a name of its own, the true poses.

    In the folder ``laser`` are boards that the left camera and the laser saw at once.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    list of Path
        Of `WALK_FILES`, in their order.

    Raises
    ------
    OSError
        If they cannot be written.
    """
    with work_folder() as work:  # in its place it has its laser from the first moment
        rig = save_laser_pose(paper_rig().save(work / WALK_FILES[0]), walk_laser())
        calibration = write_atomic(folder / WALK_FILES[0], read_bytes(rig))
    rows = [f"{name[-1]},{x},{y},{np.degrees(yaw):.6f}" for name, (x, y, yaw) in walk.POSES.items()]
    poses = write_atomic(folder / WALK_FILES[1], "\n".join(("station,x_mm,y_mm,yaw_deg", *rows, "")))
    recorded = (
        write_atomic(folder / name, read_bytes(data_path(f"virtual/room/{name}")))
        for name in WALK_FILES[2 : -2 * len(_BOARDS)]
    )
    return [calibration, poses, *recorded, *_write_boards(folder)]


def _write_boards(folder: Path) -> Iterator[Path]:
    return (write_atomic(folder / name, data) for name, data in _boards())


@cache
def _boards() -> tuple[tuple[str, bytes], ...]:
    """Names and contents of the boards' files: rendering them takes seconds, another folder has the same."""
    from tqdm.auto import tqdm

    sensor, rng = VirtualLidar(height_mm=walk.LASER_HEIGHT_MM), np.random.default_rng(_SEED)
    made = list[tuple[str, bytes]]()
    boards = tuple(zip(_BOARDS, laser_boards.POSES, strict=True))
    for name, pose in tqdm(boards, "boards", unit="board", leave=False, disable=None):
        scene = laser_boards.board_scene(pose, _BOARD_MM)
        light = render(scene, paper_rig().left, recordings.setup(), samples=1, light_samples=1)
        made.append((f"{name}.jpg", Webcam().encode(Webcam().expose(light, rng))))
        made.append((f"{name}.bin", sensor.scan(scene, recordings.LASER_POSE, rng, turns=5)))
    return tuple(made)
