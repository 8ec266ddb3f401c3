"""The recorded walk as a folder of recordings, named as `stereolib.mapping.list_stations` reads them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from stereolib.base import data_path, read_bytes, write_atomic
from stereolib.measurement import save_laser_pose
from stereolib.paper import paper_rig
from stereolib.virtual import walk
from stereolib.virtual.measured_walk import walk_laser

#: What `write_walk` writes.
WALK_FILES = (
    "calibration.json",
    "true_poses.csv",
    *(f"{name.split('/')[1]}_{part}" for name in walk.POSES for part in ("left.jpg", "right.jpg", "scan.bin")),
)


def write_walk(folder: Path) -> list[Path]:
    """Write the pairs and scans of the walk, the rig with its laser, and, under a name of its own, the true poses.

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
    calibration = save_laser_pose(paper_rig().save(folder / WALK_FILES[0]), walk_laser())
    rows = [f"{name[-1]},{x},{y},{np.degrees(yaw):.6f}" for name, (x, y, yaw) in walk.POSES.items()]
    poses = write_atomic(folder / WALK_FILES[1], "\n".join(("station,x_mm,y_mm,yaw_deg", *rows, "")))
    recorded = (write_atomic(folder / name, read_bytes(data_path(f"virtual/room/{name}"))) for name in WALK_FILES[2:])
    return [calibration, poses, *recorded]
