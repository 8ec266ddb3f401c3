"""Exercises on chapter 02: epipolar lines, rows, the half-way turn."""

from __future__ import annotations

from typing import Any

import numpy as np

from stereolib.base import Float64
from stereolib.exercises.answers import Number
from stereolib.exercises.function_answers import Function
from stereolib.exercises.tasks import Task, drawn, task


@task(
    "Read an epipolar line off a figure",
    "find the row of a partner on its epipolar line",
    minutes=5,
    start="row = None  # row of the partner, in pixels",
    hints=(
        "Run `task.picture()`, or use the line's three numbers: a u + b v + c = 0.",
        "Put the column in for u and solve for v: v = -(a u + c) / b.",
    ),
    has_picture=True,
)
def _line(rng: np.random.Generator) -> Task:
    column, at = drawn(rng, 120, 520, 5), drawn(rng, 100, 380, 5)
    slope = drawn(rng, 0.02, 0.12, 0.005) * float(rng.choice([-1, 1]))
    a, b, c = (round(float(x), 4) for x in np.array([-slope, 1.0, slope * column - at]) * drawn(rng, 0.5, 2, 0.1))
    row = -(a * column + c) / b

    def draw() -> tuple[Any, str]:
        from stereolib.plotting import panels, plot_curves

        u = np.array([0.0, 640.0])
        figure, axes = panels(1, width_in=6, aspect=0.75)
        line = {"": (u, -(a * u + c) / b)}
        plot_curves(line, axes[0], xlabel="column (px)", ylabel="row (px)", marker="", xlim=(0, 640), ylim=(480, 0))
        axes[0].axvline(column, color="0.4", ls="--")
        axes[0].set_yticks(range(0, 481, 20))
        return figure, "A picture frame with a slightly tilted line across it, and a dashed upright line at one column."

    mistakes = {
        "The sign of c is wrong.": -(a * column - c) / b,
        "You left out c.": -a * column / b,
        "You left out a: the line is not level.": -c / b,
        "You solved for the column.": -(b * column + c) / a,
    }
    question = (
        f"A pixel of the left picture has the epipolar line $a u + b v + c = 0$ in the right one, with $a$ = {a:g}, "
        f"$b$ = {b:g}, $c$ = {c:g}. Its partner stands in column {column:g}. **In which row?** Two rows more or less "
        "are allowed."
    )
    return Task(question, {"line": (a, b, c), "column": column}, Number(row, "px", 0.0, mistakes, off=2.0), draw)


@task(
    "How much may a camera roll?",
    "turn a limit on rows into a limit on an angle",
    minutes=12,
    start="roll_deg = None  # the roll, in degrees",
    hints=(
        "A roll by an angle moves a pixel that stands x columns beside the centre by x times the angle (in radians).",
        "The rms of x over a picture that is w columns wide is w / √12. Then turn radians into degrees.",
    ),
)
def _roll(rng: np.random.Generator) -> Task:
    width, off_px = float(rng.choice([640, 800, 1024, 1280, 1920])), drawn(rng, 0.1, 2, 0.05)
    roll_rad = np.sqrt(12) * off_px / width
    mistakes = {
        "This is the angle in radians; degrees are asked for.": float(roll_rad),
        "You took the rms of x as the whole width. It is w / √12.": float(np.degrees(off_px / width)),
        "You took the rms of x as half the width. It is w / √12.": float(np.degrees(2 * off_px / width)),
        "You forgot the root: the rms is w / √12.": float(np.degrees(12 * off_px / width)),
        "You turned the fraction round.": float(np.degrees(width / np.sqrt(12) / off_px)),
    }
    question = (
        f"One camera of a pair is rolled about its axis. Its pictures are {width:g} px wide. **At which roll, in "
        f"degrees, do rows differ by {off_px:g} px rms?** Count the whole width of the picture."
    )
    given = {"width_px": width, "off_px": off_px}
    return Task(question, given, Number(float(np.degrees(roll_rad)), "degrees", mistakes=mistakes))


@task(
    "How far can you measure?",
    "find the distance up to which a depth is good enough",
    minutes=8,
    start="far_m = None  # the distance, in metres",
    hints=(
        "The error of the depth is Z² / (f B) times the error of the disparity.",
        "Solve for Z: the root of f B times the allowed error over the error of the disparity. Mind the metres.",
    ),
)
def _far(rng: np.random.Generator) -> Task:
    f_px, B_mm = drawn(rng, 600, 1200, 10), drawn(rng, 60, 250, 5)
    off_mm, off_px = drawn(rng, 10, 150, 5), float(rng.choice([0.0625, 0.125, 0.25, 0.5]))
    far_m = float(np.sqrt(f_px * B_mm * off_mm / off_px)) / 1000
    mistakes = {
        "You forgot the root.": (1000 * far_m) ** 2 / 1000,
        "You multiplied by the error of the disparity; divide by it.": float(np.sqrt(f_px * B_mm * off_mm * off_px))
        / 1000,
        "You left out the error of the disparity.": float(np.sqrt(f_px * B_mm * off_mm)) / 1000,
        "This is in mm; metres are asked for.": 1000 * far_m,
    }
    question = (
        f"A rig has $f$ = {f_px:g} px and $B$ = {B_mm:g} mm, and its disparities are good to {off_px:g} px. **Up to "
        f"which distance, in metres, is a depth good to {off_mm:g} mm?**"
    )
    given = {"f_px": f_px, "B_mm": B_mm, "off_mm": off_mm, "off_px": off_px}
    number = Number(far_m, "m", 0.03, mistakes)  # holds the way by two depths, too
    return Task(question, given, number)


@task(
    "Where do the axes cross?",
    "find where two cameras that are turned inwards look",
    minutes=6,
    start="crossing_mm = None  # from the cameras to the crossing, in mm",
    hints=(
        "Draw it from above: half of the baseline and half of the angle make a right triangle.",
        "crossing = (B / 2) / tan(angle / 2). `np.tan` takes radians.",
    ),
)
def _crossing(rng: np.random.Generator) -> Task:
    B_mm, toe_deg = drawn(rng, 60, 300, 5), drawn(rng, 3, 20, 0.5)
    half_rad = np.radians(toe_deg) / 2
    mistakes = {
        "You took the whole angle for each camera. It is shared by both.": float(B_mm / 2 / np.tan(2 * half_rad)),
        "You took the whole baseline with half of the angle.": float(B_mm / np.tan(half_rad)),
        "np.tan takes radians, and you gave it degrees.": float(B_mm / 2 / np.tan(toe_deg / 2)),
        "You multiplied by the tangent; divide by it.": float(B_mm / 2 * np.tan(half_rad)),
    }
    question = (
        f"Two cameras stand {B_mm:g} mm apart. They are turned towards each other, so that {toe_deg:g} degrees lie "
        "between their axes, half of it each. **How far ahead do the axes cross, in mm?**"
    )
    given = {"B_mm": B_mm, "toe_deg": toe_deg}
    return Task(question, given, Number(float(B_mm / 2 / np.tan(half_rad)), "mm", 0.004, mistakes))


@task(
    "A wrong baseline",
    "say what only the depths can show",
    minutes=5,
    start="depth_mm = None  # the depth that is read, in mm",
    hints=(
        "Z = f B / d. Which of the three does the mistake change?",
        "The disparity and f stay as they are, so the depth is wrong by the same factor as the baseline.",
    ),
)
def _wrong_baseline(rng: np.random.Generator) -> Task:
    B_mm, pct, Z_mm = drawn(rng, 60, 200), drawn(rng, 2, 9, 0.5) * float(rng.choice([-1, 1])), drawn(rng, 500, 2000, 10)
    factor = 1 + pct / 100
    mistakes = {
        "It is the other way round: a longer baseline makes larger depths.": Z_mm / factor,
        "This is the true depth. The wrong baseline changes what is read.": Z_mm,
        "This is the error alone. The depth that is read is asked for.": Z_mm * pct / 100,
        "It is off by the baseline: depths are wrong by a factor.": Z_mm + B_mm * pct / 100,
    }
    question = (
        f"A rig's true baseline is {B_mm:g} mm, but its calibration says {B_mm * factor:.2f} mm, and all else is "
        f"right. A wall is {Z_mm:g} mm deep. **Which depth does the rig read, in mm?**"
    )
    given = {"true_mm": B_mm, "calibrated_mm": round(B_mm * factor, 2), "Z_mm": Z_mm}
    return Task(question, given, Number(Z_mm * factor, "mm", 0.001, mistakes))


def _half(R: Any) -> Float64:
    U, _, Vt = np.linalg.svd(np.eye(3) + R)
    return np.asarray(U @ Vt)


@task(
    "Write the half-way turn yourself",
    "find the turn which, done twice, is a given turn",
    minutes=20,
    start='def half_turn(R):\n    """The turn H (3 x 3) with H @ H = R."""\n    ...',
    hints=(
        "The average of R and the identity looks half-way, but it is no turn. Which turn is nearest to it?",
        "`U, _, Vt = np.linalg.svd(...)`; then U @ Vt is the nearest turn.",
    ),
    points=3,
)
def _write_half(rng: np.random.Generator) -> Task:
    def inputs(rng: np.random.Generator) -> tuple[Any, ...]:
        axis = rng.normal(size=3)
        x, y, z = axis / np.linalg.norm(axis)
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        angle = rng.uniform(0.2, 1.5)
        return (np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross,)

    answer = Function(
        _half,
        inputs,
        rules={
            "It is no turn: H @ H.T must be the identity.": lambda H, R: bool(np.allclose(H @ H.T, np.eye(3))),
            "Done twice, it must be R.": lambda H, R: bool(np.allclose(H @ H, R)),
        },
        mistakes={
            "This is the average of R and the identity, which is no turn.": lambda R: (np.eye(3) + R) / 2,
            "It turns the other way: it is transposed.": lambda R: _half(R).T,
            "This is R itself.": lambda R: R,
            "You took the root of each number. A turn is halved as a whole.": lambda R: np.sqrt(np.abs(R)),
            "This is a quarter of the way: you halved twice.": lambda R: _half(_half(R)),
        },
    )
    question = "**Write a function `half_turn(R)`** that returns half of a turn. It is tried on random turns."
    return Task(question, {}, answer)


RECIPES = (_line, _roll, _far, _crossing, _wrong_baseline, _write_half)
