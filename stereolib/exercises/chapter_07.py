"""Exercises on chapter 07: scales, depths, and where a camera stands."""

from __future__ import annotations

from typing import Any

import numpy as np

from stereolib.exercises.answers import Number
from stereolib.exercises.function_answers import Function
from stereolib.exercises.tasks import Task, drawn, task


@task(
    "Read a scale off a figure",
    "measure the scale of a picture on a thing of known size",
    minutes=6,
    start="scale_cm = None  # centimetres a pixel",
    hints=(
        "Run `task.picture()`. Read the columns of the left and of the right side corner, on the floor.",
        "The cube stands edge-on: between these corners lies its diagonal, 30 cm times the root of 2.",
    ),
    has_picture=True,
)
def _read_scale(rng: np.random.Generator) -> Task:
    from stereolib.paper import paper_setup
    from stereolib.virtual import recordings

    setup = paper_setup()
    others_mm = [mm for mm in recordings.DISTANCES_MM if mm >= 600 and mm != setup.distance_mm]
    name = f"series/medium_{int(rng.choice(others_mm))}"
    truth = recordings.load_truth(name)
    columns = np.flatnonzero((truth.box == 1).any(axis=0))
    width_px, side_cm = float(columns[-1] - columns[0]), setup.side_mm / 10
    scale = side_cm * np.sqrt(2) / width_px

    def draw() -> tuple[Any, str]:
        from stereolib.plotting import panels, plot_image

        left, _ = recordings.rectified().rectify(*recordings.load_pair(name))
        figure, axes = panels(1, width_in=7.5, aspect=0.8)
        plot_image(left, axes[0], f"the cube of {side_cm:g} cm (virtual rig)")
        axes[0].set_xticks(range(0, 641, 40))
        axes[0].grid(axis="x", alpha=0.5)
        return figure, "A picture of the cube, seen edge-on, with lines every forty columns."

    mistakes = {
        "You took the side of the cube. From corner to corner it is the diagonal.": side_cm / width_px,
        "You turned the fraction round: these are pixels a centimetre.": width_px / (side_cm * np.sqrt(2)),
        "You took half of the diagonal, as a radius.": scale / 2,
        "These are mm; cm are asked for.": 10 * scale,
    }
    question = (
        f"The cube of {side_cm:g} cm stands edge-on, at a distance that is not told. **How many centimetres is a pixel "
        "worth at its side corners on the floor?** An error of 3 % is allowed. (The corners above are deeper: the "
        "camera looks up a little.)"
    )
    return Task(question, {"side_cm": side_cm}, Number(float(scale), "cm", 0.03, mistakes), draw)


@task(
    "Which depth has this scale?",
    "see that a scale is a depth",
    minutes=5,
    start="depth_mm = None  # the depth, in mm",
    hints=("A pixel at the depth Z is worth Z / f.", "Z = s f. The scale is in cm per pixel, the depth in mm."),
)
def _depth_of_scale(rng: np.random.Generator) -> Task:
    f_px, scale = drawn(rng, 600, 900, 5), drawn(rng, 0.08, 0.25, 0.004)
    depth_mm = 10 * scale * f_px
    mistakes = {
        "You divided by f. The depth is Z = s f.": 10 * scale / f_px,
        "You divided f by the scale. The depth is Z = s f.": f_px / scale,
        "This is in cm; mm are asked for.": scale * f_px,
    }
    question = (
        f"Someone measured a scale of {scale:g} cm per pixel with a camera of $f$ = {f_px:g} px. "
        "**At which depth does it hold, in mm?**"
    )
    return Task(question, {"f_px": f_px, "s_cm": scale}, Number(depth_mm, "mm", 0.005, mistakes))


@task(
    "A box edge-on",
    "find the width that a camera sees of a turned box",
    minutes=5,
    start="width_px = None  # width between the side corners, in pixels",
    hints=(
        "A square box that stands edge-on shows its diagonal.",
        "The diagonal is the side times the root of 2, and w = f L / Z.",
    ),
)
def _edge_on(rng: np.random.Generator) -> Task:
    side_mm, Z_mm, f_px = drawn(rng, 150, 400, 10), drawn(rng, 700, 1500, 10), drawn(rng, 600, 900, 10)
    width = f_px * side_mm * np.sqrt(2) / Z_mm
    mistakes = {
        "You took the side. Edge-on, the diagonal is seen.": f_px * side_mm / Z_mm,
        "You took half of the diagonal, as a radius.": width / 2,
        "You took the side twice. The diagonal is the root of 2 times the side.": 2 * f_px * side_mm / Z_mm,
        "You turned the fraction round: the depth stands below.": Z_mm / (f_px * side_mm * np.sqrt(2)),
        "This is the width in mm. How many pixels does it cover?": side_mm * np.sqrt(2),
    }
    question = (
        f"A square box with sides of {side_mm:g} mm stands edge-on; its side corners are {Z_mm:g} mm deep. $f$ = "
        f"{f_px:g} px. **How wide is it in the picture, in pixels?**"
    )
    given = {"side_mm": side_mm, "Z_mm": Z_mm, "f_px": f_px}
    return Task(question, given, Number(float(width), "px", 0.005, mistakes))


@task(
    "In which row is the foot?",
    "tell where the floor appears in a tilted camera",
    minutes=12,
    start="rows = None  # rows from the foot down to the lower border, in pixels",
    hints=(
        "The ray to the foot points down from the level by arctan(h / D). The camera is pitched up by θ.",
        "v = cy + f tan(arctan(h / D) + θ), and H - v rows are below it. Turn degrees into radians.",
    ),
    points=2,
)
def _foot(rng: np.random.Generator) -> Task:
    H, cy, f_px = 480.0, drawn(rng, 215, 245), drawn(rng, 650, 800, 5)
    h_mm, D_mm, pitch_deg = drawn(rng, 60, 150, 5), drawn(rng, 750, 1100, 10), drawn(rng, 1, 5, 0.5)
    down, pitch = np.arctan(h_mm / D_mm), np.radians(pitch_deg)

    def rows(angle: float) -> float:
        return float(H - cy - f_px * np.tan(angle))

    right = rows(down + pitch)
    mistakes = {
        "The sign of the pitch is wrong: a camera that looks up sees the foot lower down.": rows(down - pitch),
        "You left out the pitch.": rows(down),
        "You took the pitch in degrees as radians.": rows(down + pitch_deg),
        "This is the row of the foot. Count from there to the lower border.": H - right,
        "You left out the principal point.": right + cy,
        "You turned the fraction round: it is arctan(h / D).": rows(np.arctan(D_mm / h_mm) + pitch),
    }
    question = (
        f"A camera stands {h_mm:g} mm above the floor, pitched up by {pitch_deg:g} degrees, with $f$ = {f_px:g} px, "
        f"$c_y$ = {cy:g} px and pictures of {H:g} rows. A box stands on the floor {D_mm:g} mm ahead. **How many rows "
        "lie between its foot and the lower border?** Half a row more or less is allowed."
    )
    given = {"h_mm": h_mm, "D_mm": D_mm, "pitch_deg": pitch_deg, "f_px": f_px, "cy": cy, "H": H}
    return Task(question, given, Number(right, "px", 0.0, mistakes, off=0.5))


def _fit(depth_mm: Any, scale_cm: Any) -> float:
    from stereolib.paper import fit_focal_length_px

    return fit_focal_length_px(depth_mm, scale_cm)


@task(
    "Fit the relation yourself",
    "find a focal length by least squares",
    minutes=15,
    start=(
        "def fit_f(depth_mm, scale_cm):\n"
        '    """The focal length, in pixels, for which s = Z / f fits best; depths in mm, scales in cm per pixel."""\n'
        "    ..."
    ),
    hints=(
        "Let a = 1 / f. Then s = a Z is a line through the origin: one unknown. Bring both to one unit first.",
        "Least squares gives a = sum(Z s) / sum(Z Z). So f = sum(Z Z) / sum(Z s).",
    ),
    points=3,
)
def _write_fit(rng: np.random.Generator) -> Task:
    def inputs(rng: np.random.Generator) -> tuple[Any, ...]:
        depth_mm = rng.uniform(400, 1800, 8)
        return depth_mm, depth_mm / 10 / rng.uniform(600, 900) * rng.uniform(0.95, 1.05, 8)

    def with_offset(Z: Any, s: Any) -> float:
        return float(1 / np.polyfit(Z, 10 * s, 1)[0])

    answer = Function(
        _fit,
        inputs,
        rules={
            "It is far from Z / s of the measurements, with both in one unit.": lambda out, Z, s: bool(
                0.8 < out * np.mean(10 * s / Z) < 1.25
            )
        },
        mistakes={
            "The depth is in mm and the scale in cm: your result is 10 times too large.": lambda Z, s: 10 * _fit(Z, s),
            "The depth is in mm and the scale in cm: your result is 10 times too small.": lambda Z, s: _fit(Z, s) / 10,
            "You averaged Z / s. Least squares weighs far scales more.": lambda Z, s: float(np.mean(Z / (10 * s))),
            "You fitted a line with an offset. The relation goes through the origin.": with_offset,
            "This is 1 / f.": lambda Z, s: 1 / _fit(Z, s),
            "You exchanged what is fitted: the scales have the errors, not the depths.": lambda Z, s: float(
                np.sum(10 * s * Z) / np.sum((10 * s) ** 2)
            ),
        },
        off=1e-3,  # what iterates ends near the right one, not at it
    )
    question = (
        "**Write a function `fit_f(depth_mm, scale_cm)`** that returns the focal length for which $s = Z / f$ has the "
        "smallest sum of squared errors of $s$. It is tried on random measurements."
    )
    return Task(question, {}, answer)


RECIPES = (_read_scale, _depth_of_scale, _edge_on, _foot, _write_fit)
