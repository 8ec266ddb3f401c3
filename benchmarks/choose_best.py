"""Choose the settings of the pipeline "best" and of its rival on the virtual rig alone.

``python benchmarks/choose_best.py``

The procedure was settled on these scenes alone, before its result met any photograph:

1. Begin with the first value of every knob, the simplest one.
2. Go through the knobs in their order, `p2` and `edge` as one because each undoes the other. Try all values of one,
   the others held. Take the first value in the list whose mean bad-2 over the scenes of `CHOSEN_ON` is within
   `PLATEAU` of the least: on a plateau the simpler one wins. The mean is the geometric one, so that a scene of 5 %
   counts as much as one of 50 %.
3. Again, until a whole round changes nothing.

The file was measured when the cost was seen in full size alone. The knob ``blur_from_grey``, a blur of noisy pictures,
came out at 1.0 then, since it rescues the darkest scenes; but it reads fine texture as noise, and a map jumped where
the estimate passed the limit. The costs of smaller sizes do what it did, without a limit; the knob stays here as one
that was tried, and is no part of the library.

How often the size is halved, how much of the smaller size's cost is taken, at which contrast it is half of that, and
what a match outside the right picture costs, came later, and with them the penalty, the edges, the block and the colour
are chosen anew, in the same way: all else held, `coarse_share` and `contrast` as one, by both measures that the
pipeline is judged by (bad-1 of what both cameras see and bad-2 of all), on the scenes of `CHOSEN_ON` and the training
scenes of ``layered_pairs.py``; the simplest value of each comes first. An infinite contrast is a share that is the same
everywhere. Their lines are in ``results/choose_coarse.csv``. Tried on the same scenes, and no better: noise told part
by part, or by a single picture's finest detail; colour in the smaller sizes; distances to ranges between pixels; other
census windows. The sums now have 8 bits: windows and penalties of the grid that need more are refused, if the first
file is ever begun anew. Tried on every second one of these scenes and not taken: a second pass over 16 disparities, the
right picture warped by the first map; at its best it took the mean from 3.56 to 3.52 %. The lines of what was tried and
not taken, here and below, were not kept. ``choose_best.csv``, ``choose_coarse.csv`` and ``choose_paths.csv`` were
measured with the code of their time: they are gone through again, but a run that lacks lines of theirs would mix two
matchers, or two ways to fill.

Later the right view got sums along paths of its own, and then paths of both views went along rows and columns alone,
and the penalty fell by the channel that steps most. All knobs but the census were chosen anew for that, in the same
way, but from where they stood: the first value of each is the one chosen before, and another has to gain more than the
plateau. This and all that follows was measured on the ``hard`` scenes of ``layered_pairs.py``, too; the lines are in
``results/choose_paths.csv``. On the same scenes, with the settings of before, eight paths are 0.9 % worse than four; on
every second one four paths are 1.8 % worse with steps of grey than with those of the channels. Tried there, and no
better: costs averaged over neighbours of like colour before they are summed up; a path along rows that counts twice; a
penalty that falls by another law, or later where there is noise; a difference of colour that does not mind where
between two pixels a thing stands.

How holes are filled was changed last, but is chosen first of what follows the matching: `fill_around.fill_from_around`,
from ``AROUND``, what speaks against all surfaces but the first choice, a thousand first, which leaves it out, and how
much colours may differ. Before, a hole took the surface to one of its four sides whose colour it had, level, or stayed
with its row's. Along eight and sixteen rays, as planes, with what the right view rules out and with neighbours that
choose together, every third scene came out better one step after the other, and again when small islands, which had
kept their disparities whatever was around, became guesses that neighbours may overrule. Its other constants were set by
hand then, on those scenes. The lines are in ``results/choose_around.csv``.

What the right view keeps is surer, so small patches are not removed; but what is wrong in them shall not spread: below
which size they count as holes with a guess, the surest first, and the median's edge are chosen from ``TIDIED``, by both
measures; their lines are in ``results/choose_tidied.csv``. Small patches removed, at their best 5 x 5 px, were within
the plateau, but spread nonsense on glossy things.

Then came `surfaces.choose_surface`, from ``SURFACE``: infinitely sure leaves it out; and last the planes of
`plane_smoothing`, from ``PLANES``: windows of one pixel leave all as it is, and with an infinite detail it counts for
nothing. The wider the windows, the more it has to: these two are one knob. Planes change what is off by less than a
pixel, so bad-1/2 of what both cameras see counts beside the other two. The ``hard`` scenes were made for these two
steps: on real pairs (Aloe and Cones, which were looked at, and the motorcycle) planes had taken relief for noise, and
colours had misled where things share them. That the two knobs are one came then, too: one at a time, they would give
windows of 11 pixels and no use of detail. Their lines are in ``results/choose_surface.csv`` and
``results/choose_planes.csv``. When `choose_surface` came, what had been chosen before had been chosen without it; the
knobs of ``PATHS`` are now chosen with it, and with holes filled as they were then, those of ``AROUND``, ``TIDIED`` and
``PLANES`` with all that is not tried, as it is in the library. The planes are left out wherever they are not what is
tried.

The rival's settings are chosen by the first two measures on the same scenes, whole, from ``RIVAL``, its penalties as
one; its lines are in ``results/choose_rival.csv``, `rivals.CHOSEN` is what came out. ``check_px`` is OpenCV's own
left-right check, -1 none: what was tried before it could be left out stands there with 1, as which OpenCV took -1.
It sees grey: colours, its penalties three times as large, took the mean of every second scene from 6.00 to 5.98 %,
which is within the plateau.

Every setting tried becomes a line of its file as soon as it is measured; called again, the script goes on from there.
The defaults of `CensusSGM` and the constants of `pipelines` are copied from what it prints; a test goes through the
files by the same procedure and holds them equal. No photograph is read here.
"""

from __future__ import annotations

import csv
import itertools
import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from common import RESULTS
from joblib import Parallel, delayed
from layered_pairs import layered_set
from rivals import both_sides
from tqdm import tqdm
from virtual_pairs import CHOSEN_ON, Pair, bad_pct, cluttered, recorded

from stereolib.matching import (
    CensusSGM,
    EvenPair,
    SGMResult,
    choose_surface,
    even_out,
    fill_from_around,
    pipelines,
    seen_by_both,
    smooth_by_planes,
)
from stereolib.rig import to_grey

GRID: dict[str, tuple[Any, ...]] = {
    "census_px": ((5, 5), (5, 7), (7, 7), (7, 9)),
    "block_size": (1, 3, 5),
    "p1": (10, 20, 40),
    "p2": (60, 120, 240, 480),
    "edge": (1000.0, 16.0, 4.0),
    "color_weight": (0.0, 0.25, 0.5, 1.0),
    "color_cap": (20.0, 10.0, 40.0),
    "blur_from_grey": (math.inf, 2.0, 1.0, 0.5),
    "speckle_px": (1, 5, 11, 21),
    "median_px": (3, 5),
}
KNOBS = [("p2", "edge") if name == "p2" else (name,) for name in GRID if name != "edge"]
COARSE: dict[str, tuple[Any, ...]] = {
    "halvings": (0, 1, 2, 3),
    "coarse_share": (0.5, 0.75),
    "contrast": (math.inf, 5.0, 3.5),
    "outside_cost": (16, 20),
    "block_size": (1, 3),
    "p2": (90, 120),
    "edge": (8.0, 5.0),
    "color_weight": (1.0, 0.8),
    "color_cap": (20.0, 15.0),
}
COARSE_KNOBS = [
    ("halvings",), ("coarse_share", "contrast"), ("outside_cost",), ("block_size",), ("p2", "edge"), ("color_weight",),
    ("color_cap",),
]  # fmt: skip
PATHS: dict[str, tuple[Any, ...]] = {
    "halvings": (3, 2),
    "coarse_share": (0.75, 0.5),
    "contrast": (5.0, 3.5, 7.0),
    "outside_cost": (16, 20, 24),
    "block_size": (1, 3),
    "p1": (20, 15),
    "p2": (90, 120, 150),
    "edge": (5.0, 6.0, 8.0),
    "color_weight": (1.0, 0.7, 0.5),
    "color_cap": (20.0, 15.0),
}
PATHS_KNOBS = [
    ("halvings",), ("coarse_share", "contrast"), ("outside_cost",), ("block_size",), ("p1",), ("p2", "edge"),
    ("color_weight",), ("color_cap",),
]  # fmt: skip
AROUND: dict[str, tuple[Any, ...]] = {"other": (1000.0, 3.0, 2.4, 1.7, 1.2, 0.8), "unlike": (12.0, 8.0, 16.0)}
AROUND_KNOBS = [tuple(AROUND)]
TIDIED: dict[str, tuple[Any, ...]] = {"rim_px": (21, 11, 5, 1), "median_px": (3, 5)}
TIDIED_KNOBS = [(name,) for name in TIDIED]
SURFACE: dict[str, tuple[Any, ...]] = {"sure": (math.inf, 4.0, 3.0, 2.5, 2.0, 1.5, 1.0), "unlike": (8.0, 4.0, 12.0)}
SURFACE_KNOBS = [(name,) for name in SURFACE]
PLANES: dict[str, tuple[Any, ...]] = {
    "size_px": (1, 11, 17, 25),
    "rough_px": (0.2, 0.1, 0.4),
    "most_px": (1.0, 0.5, 1.5, 2.0),
    "half_detail": (math.inf, 8.0, 4.0, 2.0),
}
PLANES_KNOBS = [("size_px", "half_detail"), ("rough_px",), ("most_px",)]
RIVAL: dict[str, tuple[Any, ...]] = {
    "block_size": (1, 3, 5, 7, 9),
    "p1_times": (8, 12, 16),
    "p2_times": (32, 24, 20),
    "speckle_px": (1, 5, 11, 21),
    "median_px": (3, 5),
    "pre_filter_cap": (63, 31, 15),
    "check_px": (1, -1),
}
RIVAL_KNOBS = [("block_size",), ("p1_times", "p2_times"), ("speckle_px",), ("median_px",), ("pre_filter_cap",)]
RIVAL_KNOBS += [("check_px",)]
PLATEAU = 1.01  # times the least
MIDDLE = (120, 360)  # the rows that were matched for the first file: half the time
FILE, COARSE_FILE = RESULTS / "choose_best.csv", RESULTS / "choose_coarse.csv"
PATHS_FILE, AROUND_FILE = RESULTS / "choose_paths.csv", RESULTS / "choose_around.csv"
TIDIED_FILE = RESULTS / "choose_tidied.csv"
SURFACE_FILE, PLANES_FILE = RESULTS / "choose_surface.csv", RESULTS / "choose_planes.csv"
RIVAL_FILE = RESULTS / "choose_rival.csv"
Setting = dict[str, Any]
AS_IT_IS: Setting = {"size_px": 1}  # of the planes
Measure = Callable[[Any, Setting], float]  # of a pair, or of what was matched in it


@dataclass(frozen=True, eq=False)
class Matched:
    """A virtual pair, and what the matcher finds in it before anything is filled."""

    pair: Pair
    even: EvenPair
    found: SGMResult

    @classmethod
    def of(cls, pair: Pair, params: CensusSGM | None = None) -> Matched:
        cv2.setNumThreads(1)
        even = even_out(pair.left, pair.right)
        return cls(pair, even, pipelines.match_best(even, pair.num_disparities, params))

    @property
    def name(self) -> str:
        return self.pair.name

    def filled(self, **steps: Any) -> np.ndarray:
        """The dense map by some steps; the planes are left out if they are none of these."""
        cv2.setNumThreads(1)
        steps = {"planes": partial(smooth_by_planes, **AS_IT_IS)} | steps
        return pipelines.fill_matched(self.found, self.even, pipelines.FillSteps(**steps)).disparity_px


def measure(pair: Pair, setting: Setting) -> float:
    """Bad-2 of "best" with some settings, %."""
    cv2.setNumThreads(1)
    own = {name: setting[name] for name in ("blur_from_grey", "speckle_px", "median_px")}
    params = CensusSGM(pair.num_disparities, **{k: v for k, v in setting.items() if k not in own})
    blur, own["rim_px"], sides = own.pop("blur_from_grey"), own.pop("speckle_px"), (pair.left, pair.right)
    noise = max(noise_grey(side) for side in sides)
    if noise >= blur:
        sides = tuple(cv2.GaussianBlur(side, (0, 0), noise) for side in sides)
    found = pipelines.match_best(even_out(*sides), pair.num_disparities, params)
    return bad_pct(Matched(pair, even_out(pair.left, pair.right), found).filled(**own), pair.truth_px, 2)


def measure_coarse(pair: Pair, setting: Setting) -> float:
    """Both measures, from whole pairs."""
    return both_measures(Matched.of(pair, CensusSGM(**setting)).filled(), pair)


def measure_around(matched: Matched, setting: Setting) -> float:
    """Both measures, of how holes are filled."""
    return both_measures(matched.filled(around=partial(fill_from_around, **setting)), matched.pair)


def measure_tidied(matched: Matched, setting: Setting) -> float:
    """Both measures, of what counts as a hole and of the median."""
    return both_measures(matched.filled(**setting), matched.pair)


def measure_surface(matched: Matched, setting: Setting) -> float:
    """Both measures, of which surface pixels beside steps go to."""
    return both_measures(matched.filled(surface=partial(choose_surface, **setting)), matched.pair)


def measure_planes(matched: Matched, setting: Setting) -> float:
    """Geometric mean of bad-1/2 and bad-1 of what both cameras see and bad-2 of all, %; of the last step."""
    disparity, truth = matched.filled(planes=partial(smooth_by_planes, **setting)), matched.pair.truth_px
    fine = max(bad_pct(disparity, truth, 0.5, seen_by_both(truth)), 0.01)
    return float(np.cbrt(fine * both_measures(disparity, matched.pair) ** 2))


def measure_rival(pair: Pair, setting: Setting) -> float:
    """Both measures of the rival."""
    cv2.setNumThreads(1)
    return both_measures(both_sides(pair.left, pair.right, pair.num_disparities, setting), pair)


def both_measures(disparity_px: np.ndarray, pair: Pair) -> float:
    """Geometric mean of bad-1 of what both cameras see and bad-2 of all, %."""
    bad = bad_pct(disparity_px, pair.truth_px, 1, seen_by_both(pair.truth_px)), bad_pct(disparity_px, pair.truth_px, 2)
    return statistics.geometric_mean(max(one, 0.01) for one in bad)


def noise_grey(image: np.ndarray) -> float:
    """A picture's noise where it is flattest, grey levels: the tenth percentile over blocks of 16 x 16 px.

    J. Immerkaer, Fast noise variance estimation, doi:10.1006/cviu.1996.0060 (its mask; the median of each block).
    """
    mask = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
    edges = np.abs(cv2.filter2D(to_grey(image).astype(np.float32), -1, mask))
    rows, columns = (n // 16 for n in edges.shape)
    blocks = edges[: 16 * rows, : 16 * columns].reshape(rows, 16, columns, 16)
    return float(np.percentile(np.median(blocks, axis=(1, 3)), 10) / 0.6745 / 6)


def key_of(row: Setting, grid: dict[str, tuple[Any, ...]] = GRID) -> str:
    """A setting as text, whether it comes from the grid or from the file."""
    return "|".join(str(row[name]) for name in grid)


class Tried:
    """Every setting tried and its mean share of bad pixels, kept in a file."""

    def __init__(
        self, path: Path, pairs: Sequence[Pair | Matched], grid: dict[str, tuple[Any, ...]], measure: Measure
    ) -> None:
        self.path, self.pairs, self.grid, self.measure = path, pairs, grid, measure
        self.columns = [*grid, "mean", *(pair.name for pair in pairs)]
        self.known: dict[str, float] = {}
        if not path.exists():
            path.write_text(",".join(self.columns) + "\n", encoding="utf-8")
        with path.open(encoding="utf-8", newline="") as stream:
            reader = csv.DictReader(stream)
            if reader.fieldnames != self.columns:
                raise ValueError(f"{path} was made with other knobs or scenes: move it away")
            self.known = {key_of(row, grid): float(row["mean"]) for row in reader}
        self.bar = tqdm(desc="settings", initial=len(self.known), unit="setting")

    def mean(self, setting: Setting) -> float:
        key = key_of(setting, self.grid)
        if key not in self.known:
            bad = Parallel(n_jobs=2)(delayed(self.measure)(pair, setting) for pair in self.pairs)
            mean = round(statistics.geometric_mean(bad), 3)
            with self.path.open("a", encoding="utf-8", newline="") as stream:
                csv.writer(stream, lineterminator="\n").writerow(
                    [*(str(setting[name]) for name in self.grid), mean, *(f"{x:.2f}" for x in bad)]
                )
            self.known[key] = mean
            self.bar.set_postfix_str(f"{mean:.2f} % bad")
            self.bar.update()
        return self.known[key]


def choose(
    mean: Callable[[Setting], float],
    grid: dict[str, tuple[Any, ...]] = GRID,
    knobs: Sequence[tuple[str, ...]] = KNOBS,
) -> Setting:
    """The settings, by the procedure above; `mean` gives the share of bad pixels of one."""
    setting: Setting = {name: values[0] for name, values in grid.items()}
    while True:
        before = dict(setting)
        for names in knobs:
            if names == ("color_cap",) and not setting.get("color_weight", 1):
                continue  # it caps nothing
            tries = [dict(zip(names, one, strict=True)) for one in itertools.product(*(grid[name] for name in names))]
            means = [mean({**setting, **one}) for one in tries]
            setting |= next(one for one, bad in zip(tries, means, strict=True) if bad <= min(means) * PLATEAU)
        if setting == before:
            return setting


if __name__ == "__main__":
    seeds, names = CHOSEN_ON
    scenes = [pair for seed in seeds for pair in cluttered(seed)] + [recorded(name) for name in names]
    print(choose(Tried(FILE, [pair.rows(*MIDDLE) for pair in scenes], GRID, measure).mean))
    every = scenes + layered_set("training")
    print(choose(Tried(COARSE_FILE, every, COARSE, measure_coarse).mean, COARSE, COARSE_KNOBS))
    every += layered_set("hard")
    print(choose(Tried(PATHS_FILE, every, PATHS, measure_coarse).mean, PATHS, PATHS_KNOBS))
    matched = Parallel(n_jobs=2)(delayed(Matched.of)(pair) for pair in tqdm(every, desc="matching", unit="pair"))
    print(choose(Tried(AROUND_FILE, matched, AROUND, measure_around).mean, AROUND, AROUND_KNOBS))
    print(choose(Tried(TIDIED_FILE, matched, TIDIED, measure_tidied).mean, TIDIED, TIDIED_KNOBS))
    print(choose(Tried(SURFACE_FILE, matched, SURFACE, measure_surface).mean, SURFACE, SURFACE_KNOBS))
    print(choose(Tried(PLANES_FILE, matched, PLANES, measure_planes).mean, PLANES, PLANES_KNOBS))
    print(choose(Tried(RIVAL_FILE, every, RIVAL, measure_rival).mean, RIVAL, RIVAL_KNOBS))
