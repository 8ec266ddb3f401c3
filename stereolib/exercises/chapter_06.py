"""Exercises on chapter 06: the paper's recipe, its scale, and the height from the floor."""

from __future__ import annotations

from typing import Any

import numpy as np

from stereolib.base import Float64
from stereolib.exercises.answers import Number
from stereolib.exercises.function_answers import Function
from stereolib.exercises.tasks import Task, drawn, task


@task(
    "Read a height off the recipe's figure",
    "apply the paper's recipe to a figure",
    minutes=5,
    start="height_cm = None  # what the recipe reads, in cm",
    hints=(
        "Run `task.picture()`. The arrow runs from the first marked row down to the cut; read both rows off the axis.",
        "Each row counts 0.116 cm: subtract the upper row from the lower one and multiply.",
    ),
    has_picture=True,
)
def _read_height(rng: np.random.Generator) -> Task:
    from stereolib.paper import height_by_maximum, paper_setup, printed_value
    from stereolib.virtual import recordings

    scale = printed_value("scale.cm_per_px")
    others_mm = [mm for mm in recordings.DISTANCES_MM if mm != paper_setup().distance_mm]
    name = f"series/medium_{int(rng.choice(others_mm))}"
    truth = recordings.load_truth(name)
    disparity = np.asarray(truth.disparity_px)
    foot_row = int(np.flatnonzero((truth.box == 1).any(axis=1))[-1])
    tolerance_px, cut = drawn(rng, 5, 20, 0.25), int(len(disparity) - foot_row + drawn(rng, 0, 10))
    read = height_by_maximum(disparity, scale, cut, tolerance_px=tolerance_px)

    def draw() -> tuple[Any, str]:
        from stereolib.plotting import panels, plot_height

        left, _ = recordings.rectified().rectify(*recordings.load_pair(name))
        figure, axes = panels(1, width_in=5.5, aspect=0.8)
        plot_height(left, read, axes[0], "marked pixels (virtual rig)")
        return figure, "A picture of the cube with marked pixels. An arrow runs from the first marked row to the cut."

    mistakes = {
        "These are rows, not centimetres: each row counts 0.116 cm.": float(read.height_px),
        "You counted from the top of the picture to the first marked row.": scale * read.top_row,
        "You counted from the top of the picture to the cut.": scale * read.foot_row,
        "You divided by 0.116 instead of multiplying.": read.height_px / scale,
    }
    question = (
        f"The recipe was tried on a cube at another distance, with a threshold of {tolerance_px:g} px and {cut} rows "
        "cut off. **What height does it read, in cm?** Half a centimetre more or less is allowed. (Do not wonder at "
        "the result: the recipe was made for one distance.)"
    )
    return Task(question, {"cut_rows": cut}, Number(read.height_mm / 10, "cm", 0.0, mistakes, off=0.5), draw)


@task(
    "How wrong is one scale?",
    "find by how much a fixed scale errs at another depth",
    minutes=8,
    start="error_pct = None  # by how many % the scale is too large (positive) or too small (negative)",
    hints=(
        "What is a pixel worth at that depth? Compare the fixed scale with it.",
        "The true scale is Z / f. The error in % is 100 (s f / Z - 1). Mind the units: s is in cm per pixel.",
    ),
)
def _scale(rng: np.random.Generator) -> Task:
    f_px, Z_mm = drawn(rng, 650, 850, 5), drawn(rng, 500, 1300, 10)
    scale = drawn(rng, 0.08, 0.18, 0.002)
    ratio = 10 * scale * f_px / Z_mm
    mistakes = {
        "You compared the other way round: by how much is the fixed scale off, seen from the true one?": 100
        * (1 / ratio - 1),
        "This is the ratio in %. Take away the 100 % at which the scale would be right.": 100 * ratio,
        "The scale is in cm and the depth in mm: bring both to one unit.": 100 * (ratio / 10 - 1),
    }
    question = (
        f"A rig with $f$ = {f_px:g} px uses the fixed scale $s$ = {scale:g} cm per pixel. An edge stands at a depth of "
        f"{Z_mm:g} mm. **By how many % is the scale too large there?** If it is too small, the answer is negative."
    )
    given = {"f_px": f_px, "Z_mm": Z_mm, "s_cm": scale}
    return Task(question, given, Number(100 * (ratio - 1), "%", 0.01, mistakes, off=0.1))


@task(
    "A camera's height from three places on the floor",
    "find how high the camera stands, from the disparity of the floor",
    minutes=15,
    start="camera_mm = None  # height of the camera above the floor, in mm",
    hints=(
        "Three places give three equations for the three numbers in π: π · (u, v, 1) = d.",
        "Then n = Kᵀ π / (f B), and the camera stands 1 / |n| above the floor. K is `task.given.K`.",
    ),
    points=2,
)
def _camera(rng: np.random.Generator) -> Task:
    f_px, B_mm, up_mm = drawn(rng, 600, 850, 5), drawn(rng, 70, 120), drawn(rng, 250, 600, 5)
    K = np.array([[f_px, 0, 320.0], [0, f_px, 240.0], [0, 0, 1]])
    pitch, roll = np.radians(drawn(rng, -20, -9)), np.radians(drawn(rng, 3, 8) * float(rng.choice([-1, 1])))
    down = np.array([np.sin(roll), np.cos(roll) * np.cos(pitch), -np.cos(roll) * np.sin(pitch)])
    places = np.array([[150.0, 430], [520, 445], [drawn(rng, 250, 400), 390]])
    corners = np.column_stack([places, np.ones(3)])
    d_px = np.round(f_px * B_mm / up_mm * corners @ np.linalg.inv(K).T @ down, 3)
    plane = np.linalg.solve(corners, d_px)

    def height_mm(normal: Float64) -> float:
        return f_px * B_mm / float(np.linalg.norm(normal))

    camera_mm = height_mm(K.T @ plane)
    mistakes = {
        "You turned the fraction round: the height is 1 / |n|.": 1 / camera_mm,
        "You left out f B: n = Kᵀ π / (f B).": camera_mm / (f_px * B_mm),
        "You left out the camera matrix: n = Kᵀ π / (f B).": height_mm(plane),
        "You took K where its transpose is needed.": height_mm(K @ plane),
        "You took the inverse of K. It is Kᵀ π, not K⁻ᵀ π.": height_mm(np.linalg.inv(K).T @ plane),
        "You took only the part of n that points down. The length of n has three parts.": height_mm((K.T @ plane)[1:2]),
        "Row and column are exchanged: a place is (column, row).": height_mm(
            K.T @ np.linalg.solve(corners[:, [1, 0, 2]], d_px)
        ),
        "This is the mean of Y at the three places. It is the height only of a camera that is level.": float(
            np.mean((places[:, 1] - K[1, 2]) * B_mm / d_px)
        ),
        "It is off by the baseline: nothing is added.": camera_mm + B_mm,
    }
    where = "; ".join(f"{d:.3f} px at ({u:.0f}, {v:.0f})" for (u, v), d in zip(places, d_px, strict=True))
    question = (
        f"A rig has $f$ = {f_px:g} px, $B$ = {B_mm:g} mm and the principal point (320, 240). Three places on the floor "
        f"have these disparities (column, row): {where}. **How high above the floor is the camera, in mm?**"
    )
    given = {"f_px": f_px, "B_mm": B_mm, "K": K, "places_px": places, "d_px": d_px}
    return Task(question, given, Number(camera_mm, "mm", mistakes=mistakes))


@task(
    "A height from the floor",
    "measure a height with the plane of the floor",
    minutes=8,
    start="height_mm = None  # height of the top above the floor, in mm",
    hints=(
        "You need the camera's height and two disparities of the same pixel: of the thing, and of the floor behind it.",
        "h = h_cam (1 - d_floor / d).",
    ),
)
def _height(rng: np.random.Generator) -> Task:
    camera_mm, d_px = drawn(rng, 80, 500, 5), drawn(rng, 70, 110, 0.5)
    floor_px = drawn(rng, 5, 50, 0.5) * float(rng.choice([-1, 1]))
    height_mm = camera_mm * (1 - floor_px / d_px)
    mistakes = {
        "You turned the fraction round: the disparity of the thing stands below.": camera_mm * (1 - d_px / floor_px),
        "This is how far the top is below the camera. Its height above the floor is asked for.": camera_mm
        * floor_px
        / d_px,
        "The sign of d_floor is wrong.": camera_mm * (1 + floor_px / d_px),
        "It is off by the camera's height: h_cam is already in the formula.": height_mm + camera_mm,
        "You left out the camera's height.": 1 - floor_px / d_px,
    }
    question = (
        f"Your camera stands {camera_mm:g} mm above the floor. The top of a box has a disparity of {d_px:g} px. In "
        f"the same pixel the plane of the floor has {floor_px:g} px (negative if the ray never meets the floor). "
        "**How tall is the box, in mm?**"
    )
    given = {"camera_mm": camera_mm, "d_px": d_px, "d_floor_px": floor_px}
    return Task(question, given, Number(height_mm, "mm", mistakes=mistakes))


@task(
    "How sure is it?",
    "make an interval of the parts of an error",
    minutes=8,
    start="half_mm = None  # half-width of the 95 % interval, in mm",
    hints=(
        "Parts that do not depend on each other add as squares.",
        "The standard deviation is the root of the sum of squares. The interval reaches 1.96 of these to either side.",
    ),
)
def _interval(rng: np.random.Generator) -> Task:
    parts = {name: drawn(rng, 0.05, 0.6, 0.01) for name in ("edges", "floor", "calibration")}
    values = np.array(list(parts.values()))
    std_mm = float(np.sqrt(np.sum(values**2)))
    mistakes = {
        "This is the standard deviation. The interval reaches 1.96 times as far.": std_mm,
        "You added the parts. Independent errors add as squares.": 1.96 * float(values.sum()),
        "You added the parts, and forgot the 1.96.": float(values.sum()),
        "You forgot the root.": 1.96 * std_mm**2,
        "For 95 % the factor is 1.96, not 2.": 2 * std_mm,
        "This is the whole width. One side is asked for.": 2 * 1.96 * std_mm,
    }
    listing = ", ".join(f"{name} {value:g} mm" for name, value in parts.items())
    question = (
        f"The standard deviation of a height has three independent parts: {listing}. **How far does the 95 % interval "
        "reach to either side, in mm?**"
    )
    return Task(question, {"parts_mm": values}, Number(1.96 * std_mm, "mm", mistakes=mistakes))


def _recipe(disparity_px: Any, tolerance_px: float, cut_rows: int, cm_per_px: float) -> float:
    from stereolib.paper import height_by_maximum

    return height_by_maximum(disparity_px, cm_per_px, cut_rows, tolerance_px=tolerance_px).height_mm / 10


def _mistaken(
    *,
    cuts: bool = True,
    below_px: float | None = None,
    first: bool = True,
    from_top: bool = False,
    to_mark: bool = False,
) -> Any:
    """The recipe with a mistake in it."""

    def recipe_cm(disparity_px: Any, tolerance_px: float, cut_rows: int, cm_per_px: float) -> float:
        foot = len(disparity_px) - cut_rows
        above = disparity_px[:foot] if cuts else disparity_px
        below = tolerance_px if below_px is None else below_px
        rows = np.flatnonzero((above >= np.nanmax(above) - below).any(axis=1))
        row = rows[0] if first else rows[-1]
        foot = rows[-1] if to_mark else foot
        return float(cm_per_px * (row if from_top else foot - row))

    return recipe_cm


@task(
    "Write the paper's recipe yourself",
    "write the height method of the paper, and see how little it looks at",
    minutes=25,
    start=(
        "def recipe_cm(disparity_px, tolerance_px, cut_rows, cm_per_px):\n"
        '    """The height in cm by the four steps of the chapter; holes of the map are NaN."""\n'
        "    ..."
    ),
    hints=(
        "Cut off the lowest rows first, then look for the largest disparity; `np.nanmax` passes over holes.",
        "Mark what is at least the largest less the tolerance. The first row with a mark is the top, the cut the foot.",
    ),
    points=3,
)
def _write_recipe(rng: np.random.Generator) -> Task:
    def inputs(rng: np.random.Generator) -> tuple[Any, ...]:
        disparity: Float64 = rng.uniform(10, 30, (40, 30))
        top, column, cut = int(rng.integers(5, 20)), int(rng.integers(5, 25)), int(rng.integers(4, 9))
        rows = np.arange(top, 40 - cut)
        edge = 60 - rng.uniform(4, 24) * np.abs(rows - rows.mean()) / len(rows)  # nearest in the middle
        disparity[rows, column] = edge
        disparity[40 - cut :] = rng.uniform(62, 90)  # the floor in front is nearer
        disparity[rng.random(disparity.shape) < 0.1] = np.nan
        disparity[rows[[0, -1]], column] = edge[[0, -1]]
        return disparity, float(rng.uniform(1, 9)), cut, float(rng.uniform(0.08, 0.2))

    answer = Function(
        _recipe,
        inputs,
        rules={
            "The result must be finite: pass over the holes with np.nanmax.": lambda out, *_: bool(np.isfinite(out)),
            "It must be a whole number of rows times the scale.": lambda out, d, t, cut, s: bool(
                abs(out / s - round(out / s)) < 1e-6
            ),
        },
        mistakes={
            "The floor in front is nearer than the cube: cut the lowest rows off before you look for the "
            "largest.": _mistaken(cuts=False),
            "You take only the largest disparity itself. All down to the tolerance below it count.": _mistaken(
                below_px=0.0
            ),
            "Your tolerance is always the same. Take `tolerance_px`.": _mistaken(below_px=5.0),
            "You count down to the last mark. Count down to the cut.": _mistaken(to_mark=True),
            "You take the last marked row. The top is the first one.": _mistaken(first=False),
            "You count from the top of the picture. Count from the cut up to the top of the cube.": _mistaken(
                from_top=True
            ),
            "This is in mm; cm are asked for.": lambda d, t, cut, s: 10 * _recipe(d, t, cut, s),
            "These are rows. Multiply by the scale.": lambda d, t, cut, s: _recipe(d, t, cut, s) / s,
            "You count from the lower border. The foot is at the cut.": lambda d, t, cut, s: (
                _recipe(d, t, cut, s) + s * cut
            ),
        },
    )
    question = (
        "**Write a function `recipe_cm(disparity_px, tolerance_px, cut_rows, cm_per_px)`** that returns the height in "
        "cm by the four steps of the chapter. It is tried on random maps with holes and a floor in front."
    )
    return Task(question, {}, answer)


RECIPES = (_read_height, _scale, _camera, _height, _interval, _write_recipe)
