"""Small shows of a board held before the virtual rig, rendered once for all tests; shows as files."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from stereolib.base import write_atomic
from stereolib.paper import paper_rig
from stereolib.virtual import camera_emulator

BOARD = ("--board", "9x6", "--square-mm", "25")


@cache
def small_show(places: int = 8, seed: int = 3) -> camera_emulator.Show:
    """Pictures of 320 x 240 px, ten a second: half a second in each place, two pictures on the way."""
    rig = camera_emulator.scaled_rig(paper_rig(), 0.5)
    return camera_emulator.show_boards(places, np.random.default_rng(seed), rig, held_s=0.6)


def write_show(folder: Path | str, show: camera_emulator.Show) -> tuple[str, str]:
    """Write a show as numbered pictures; their patterns, as ``stereolib capture`` takes them."""
    for side, pictures in (("left", show.left), ("right", show.right)):
        for k, picture in enumerate(pictures):
            write_atomic(Path(folder) / f"{side}_{k:04d}.jpg", picture)
    return str(Path(folder) / "left_%04d.jpg"), str(Path(folder) / "right_%04d.jpg")
