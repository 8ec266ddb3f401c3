"""The virtual scenes on which the settings of the pipelines are chosen, and others on which they are checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from stereolib import paper
from stereolib.virtual import Webcam, clutter_scene, recordings, render_pair, render_truth

Array = np.ndarray
#: Seeds of cluttered scenes, and recordings of the cube. No scene is in both sets.
CHOSEN_ON = ((1, 2, 3, 4, 5), ("conditions/texture", "conditions/poor_light", "series/medium_500", "series/fine_800",
                               "series/coarse_1000"))  # fmt: skip
CHECKED_ON = ((6, 7, 8, 9, 10), ("conditions/glare", "conditions/plain", "conditions/level", "series/fine_600",
                                 "series/medium_900", "series/coarse_700"))  # fmt: skip
#: And those on which the deviations are found: what fails is rare and differs from scene to scene.
#: How many more was settled with the shares of `CHECKED_ON` in view: for these the latter are no blind test.
DEVIATIONS_ON = ((*CHOSEN_ON[0], *range(11, 21)), CHOSEN_ON[1])
LIGHTS = (1.0, 0.05, 0.02)  # share of a well-lit room's light: the webcam's noise from invisible to coarse
ROWS_OFF_PX = 0.25  # standard deviation of what a real calibration leaves between the rows
COLUMNS_OFF_PX = 0.06  # and between the columns, at the least: what the committed boards' calibration leaves in rows


@dataclass(frozen=True, eq=False)
class Pair:
    """Rectified pictures (H, W, 3) uint8 and the true disparity (H, W), px."""

    name: str
    left: Array
    right: Array
    truth_px: Array

    @property
    def num_disparities(self) -> int:
        """The search window that holds all of it."""
        return int(-(-(np.nanmax(self.truth_px) + 2) // 16) * 16)

    def rows(self, first: int, last: int) -> Pair:
        """Some rows of it."""
        return Pair(self.name, *(a[first:last].copy() for a in (self.left, self.right, self.truth_px)))


def as_calibrated(pairs: Sequence[Pair]) -> list[Pair]:
    """The same pictures, their columns off by a plane: no calibration is the true one, and no match can tell.

    A deviation is to hold that error, too.
    """
    found = []
    for k, pair in enumerate(pairs):
        height, width = pair.truth_px.shape
        x, y = np.meshgrid(np.linspace(-1, 1, width), np.linspace(-1, 1, height))
        level, along, down = np.random.default_rng([k, 6]).normal(0, COLUMNS_OFF_PX / np.sqrt(1 + 2 / 3), 3)
        found.append(replace(pair, truth_px=(pair.truth_px + level + along * x + down * y).astype(np.float32)))
    return found


def cluttered(seed: int, lights: tuple[float, ...] = LIGHTS) -> list[Pair]:
    """A cluttered scene in several lights, rectified about as well as rigs are: the right camera is turned a little."""
    scene, where, rng = clutter_scene(seed), recordings.setup("bench"), np.random.default_rng([seed, 5])
    true = render_truth(scene, recordings.rectified(), where).disparity_px
    sides = render_pair(scene, paper.paper_rig(), where, samples=2, light_samples=1)
    found = []
    for light in lights:
        rectified = recordings.rectified()
        pitch, roll = rng.normal(0, ROWS_OFF_PX, 2) / (rectified.f_px, rectified.size[0] / 2)
        turned = replace(rectified, R2=cv2.Rodrigues(np.array([pitch, 0.0, roll]))[0] @ rectified.R2)
        found.append(Pair(f"{seed}@{light:g}", *turned.rectify(*(Webcam().shoot(light * s, rng) for s in sides)), true))
    return found


def rig_set(chosen: tuple[tuple[int, ...], tuple[str, ...]]) -> list[Pair]:
    """All pairs of a set."""
    seeds, names = chosen
    return [pair for seed in seeds for pair in cluttered(seed)] + [recorded(name) for name in names]


def recorded(name: str) -> Pair:
    """A recording of the cube, rectified with the true rig."""
    pair = recordings.rectified().rectify(*recordings.load_pair(name))
    return Pair(name, *pair, recordings.load_truth(name).disparity_px)


def bad_pct(disparity_px: Array, truth_px: Array, limit_px: float, where: Array | None = None) -> float:
    """Share of the pixels of known truth that are off by more than a limit or not returned; all, or those `where`."""
    known = np.isfinite(truth_px) if where is None else np.isfinite(truth_px) & where
    return 100 * float((~(np.abs(disparity_px - truth_px)[known] <= limit_px)).mean())
