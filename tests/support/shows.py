"""Small shows of a board held before the virtual rig, rendered once for all tests."""

from __future__ import annotations

from functools import cache

import numpy as np

from stereolib.virtual import camera_emulator

BOARD = ("--board", "9x6", "--square-mm", "25")


@cache
def small_show(places: int = 8, seed: int = 3) -> camera_emulator.Show:
    """Pictures of 320 x 240 px, ten a second: half a second in each place, two pictures on the way."""
    return camera_emulator.show_boards(places, np.random.default_rng(seed), scale=0.5, held_s=0.6)
