"""Small shows of a board held before the virtual rig, rendered once for all tests."""

from __future__ import annotations

from functools import cache

import numpy as np

from stereolib.paper import paper_rig
from stereolib.virtual import camera_emulator

BOARD = ("--board", "9x6", "--square-mm", "25")


@cache
def small_show(places: int = 8, seed: int = 3) -> camera_emulator.Show:
    """Pictures of 320 x 240 px, ten a second: half a second in each place, two pictures on the way."""
    rig = camera_emulator.scaled_rig(paper_rig(), 0.5)
    return camera_emulator.show_boards(places, np.random.default_rng(seed), rig, held_s=0.6)
