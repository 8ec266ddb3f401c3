"""Exercises on chapter 08: poses, corners, weights, lines."""

from __future__ import annotations

from typing import Any

import numpy as np

from stereolib.base import Float64
from stereolib.exercises.answers import Array, Number
from stereolib.exercises.function_answers import Function
from stereolib.exercises.tasks import Task, drawn, task


@task(
    "Read a corner off a scan",
    "find where two faces meet in a scan",
    minutes=6,
    start="corner_mm = None  # (forward, left), in mm",
    hints=(
        "Run `task.picture()`. The readings lie on two straight lines; lay a ruler on each.",
        "Read the point where both lines cross. Mind the axes: forward goes up, left goes to the left.",
    ),
    has_picture=True,
)
def _read_corner(rng: np.random.Generator) -> Task:
    corner = np.array([drawn(rng, 700, 1300, 10), drawn(rng, 100, 400, 10) * float(rng.choice([-1, 1]))])
    turn = np.radians(drawn(rng, 30, 60))
    arms = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    along = np.arange(40, 300, 20)[:, None]
    points = np.concatenate([corner + along * arm for arm in arms]) + rng.normal(0, 2, (2 * len(along), 2))

    def draw() -> tuple[Any, str]:
        from stereolib.plotting import LASER, panels

        figure, axes = panels(1, width_in=7, aspect=0.8)
        axes[0].plot(points[:, 1], points[:, 0], "o", color=LASER, ms=5)
        axes[0].set(xlabel="left (mm)", ylabel="forward (mm)", aspect="equal")
        axes[0].margins(0.2)  # so that the corner itself is inside
        axes[0].invert_xaxis()
        axes[0].grid(alpha=0.4)
        return figure, "Readings of a laser from above: two straight rows of dots that would meet in a corner."

    mistakes = {
        "Forward and left are exchanged.": corner[::-1],
        "The sign of left is wrong: it grows towards the left.": corner * (1, -1),
    }
    question = (
        "The picture shows the readings on two faces of a box, from above; `task.given.points_mm` has them as "
        "(forward, left). **Where is the corner, (forward, left) in mm?** 30 mm more or less are allowed: take a ruler."
    )
    near = 30.0 / float(np.abs(corner).max())
    return Task(question, {"points_mm": points}, Array(corner, "mm", near, mistakes), draw)


def _turn(angle: float) -> Float64:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@task(
    "From the station into the map",
    "move a place from a station's view into the map",
    minutes=8,
    start="p_mm = None  # (x, y) in the map, in mm",
    hints=("p = t + R(ψ) q.", "R = [[cos ψ, -sin ψ], [sin ψ, cos ψ]], with ψ in radians. Turn q first, then add t."),
)
def _into_map(rng: np.random.Generator) -> Task:
    t = np.array([drawn(rng, -900, 900, 10), drawn(rng, -900, 900, 10)])
    q = np.array([drawn(rng, 800, 1500, 10), drawn(rng, 150, 500, 10)])
    psi_deg = drawn(rng, 20, 160) * float(rng.choice([-1, 1]))
    R = _turn(np.radians(psi_deg))
    mistakes = {
        "It is turned the wrong way: R is transposed.": t + R.T @ q,
        "You left out the station's place t.": R @ q,
        "You left out the turn.": t + q,
        "You added first and turned then. Turn q, then add t.": R @ (t + q),
        "You gave degrees to numpy's functions, which take radians.": t + _turn(psi_deg) @ q,
        "You subtracted t.": R @ q - t,
    }
    question = (
        f"A station stands at $t$ = ({t[0]:g}, {t[1]:g}) mm and looks in the direction $ψ$ = {psi_deg:g} degrees. It "
        f"sees a box at $q$ = ({q[0]:g}, {q[1]:g}) mm. **Where is the box in the map, (x, y) in mm?**"
    )
    given = {"t_mm": t, "q_mm": q, "psi_deg": psi_deg}
    return Task(question, given, Array(t + R @ q, "mm", 0.004, mistakes))


@task(
    "Two looks at one length",
    "join two measurements of different quality",
    minutes=6,
    start="length_mm = None  # the joined length, in mm",
    hints=(
        "The surer one counts more: its weight is one over the square of its standard deviation.",
        "(w1 L1 + w2 L2) / (w1 + w2).",
    ),
)
def _joined(rng: np.random.Generator) -> Task:
    lengths, sigmas = _two_looks(rng)
    w = 1 / sigmas**2
    right = float(w @ lengths / w.sum())
    mistakes = {
        "This is the plain mean. The surer one counts more.": float(lengths.mean()),
        "You took 1 / σ as the weight. It is 1 / σ².": float(1 / sigmas @ lengths / np.sum(1 / sigmas)),
        "You gave the larger weight to the less sure one.": float(sigmas**2 @ lengths / np.sum(sigmas**2)),
        "You forgot to divide by the sum of the weights.": float(w @ lengths),
    }
    question = (
        f"One station measures a length of {lengths[0]:g} ± {sigmas[0]:g} mm, another one {lengths[1]:g} ± "
        f"{sigmas[1]:g} mm (standard deviations). **What is the best length of both, in mm?** Give it to 0.1 mm."
    )
    given = {"lengths_mm": lengths, "stds_mm": sigmas}
    return Task(question, given, Number(right, "mm", 0.0, mistakes, off=0.1))


def _two_looks(rng: np.random.Generator) -> tuple[Float64, Float64]:
    """Two lengths that differ, and standard deviations that differ as well."""
    first = drawn(rng, 200, 500)
    lengths = np.array([first, first + drawn(rng, 4, 9) * float(rng.choice([-1, 1]))])
    return lengths, rng.permutation([drawn(rng, 0.5, 1.5, 0.1), drawn(rng, 2.5, 5, 0.1)])


@task(
    "How sure are both together?",
    "tell how sure a joined measurement is",
    minutes=5,
    start="std_mm = None  # standard deviation of the joined length, in mm",
    hints=("Weights add. The weight is 1 / σ².", "σ = 1 / √(w1 + w2): it is smaller than each of the two."),
)
def _joined_std(rng: np.random.Generator) -> Task:
    _, sigmas = _two_looks(rng)
    std_mm = float(1 / np.sqrt(np.sum(1 / sigmas**2)))
    mistakes = {
        "You added the squares, as for a sum. Two measurements of one thing make it surer.": float(
            np.sqrt(np.sum(sigmas**2))
        ),
        "This is the mean of both.": float(sigmas.mean()),
        "This is that of the plain mean. The surer one counts more.": float(np.hypot(*sigmas)) / 2,
        "You forgot the root.": std_mm**2,
        "This is the sum of the weights.": std_mm**-2,
        "This is the better of the two. Both together are surer.": float(sigmas.min()),
        "You took 1 / σ as the weight. It is 1 / σ².": float(1 / np.sum(1 / sigmas)),
    }
    question = (
        f"Two stations measure the same length with standard deviations of {sigmas[0]:g} and {sigmas[1]:g} mm. "
        "**What is the standard deviation of both together, in mm?**"
    )
    return Task(question, {"stds_mm": sigmas}, Number(std_mm, "mm", 0.005, mistakes))


def _fit_line(points_mm: Any) -> Float64:
    """n (two numbers) and c of the line, with c positive."""
    points = np.asarray(points_mm, float)
    middle = points.mean(axis=0)
    n = np.linalg.svd(points - middle)[2][-1]
    n = n * (np.sign(n @ middle) or 1.0)
    return np.array([*n, n @ middle])


def _by_polyfit(points_mm: Any) -> Float64:
    """The line by least squares along the second axis only, as polyfit fits it."""
    slope, start = np.polyfit(points_mm[:, 0], points_mm[:, 1], 1)
    line = np.array([-slope, 1.0, start]) / np.hypot(slope, 1)
    return np.asarray(line * np.sign(line[2]))


def _along(points_mm: Any) -> Float64:
    middle = points_mm.mean(axis=0)
    n = np.linalg.svd(points_mm - middle)[2][0]
    n = n * (np.sign(n @ middle) or 1.0)
    return np.array([*n, n @ middle])


@task(
    "Fit a line yourself",
    "fit a wall to the readings of a scan",
    minutes=20,
    start=(
        "def fit_wall(points_mm):\n"
        '    """n1, n2 and c of the best line n · x = c through points (N, 2); |n| = 1 and c > 0."""\n'
        "    ..."
    ),
    hints=(
        "The best line goes through the mean of the points, and n is the direction in which they scatter least.",
        "`np.linalg.svd(points - mean)[2][-1]` is n; c is n · mean. If c is negative, change the sign of both.",
    ),
    points=3,
)
def _write_line(rng: np.random.Generator) -> Task:
    def inputs(rng: np.random.Generator) -> tuple[Any, ...]:
        n = np.array([np.cos(angle := rng.uniform(0, 2 * np.pi)), np.sin(angle)])
        along = np.array([-n[1], n[0]])
        where = rng.uniform(200, 600, (30, 1))
        return (rng.uniform(800, 2000) * n + where * along + rng.normal(0, 25, (30, 1)) * n,)

    answer = Function(
        _fit_line,
        inputs,
        rules={
            "|n| must be 1.": lambda line, points: bool(np.isclose(np.hypot(*line[:2]), 1)),
            "c must be positive: change the sign of n and c where it is not.": lambda line, points: bool(line[2] > 0),
            "The line must go through the mean of the points.": lambda line, points: bool(
                np.isclose(line[:2] @ points.mean(axis=0), line[2])
            ),
        },
        mistakes={
            "This n points along the line. Take the last singular vector, not the first.": _along,
            "polyfit counts errors along one axis only, and fails on upright walls. Use the SVD.": _by_polyfit,
            "The sign is wrong: c must be positive.": lambda points: -_fit_line(points),
            "You did not take away the mean before the SVD.": _through_origin,
            "n1 and n2 are exchanged.": lambda points: _fit_line(points)[[1, 0, 2]],
        },
    )
    question = (
        "**Write a function `fit_wall(points_mm)`** that returns the three numbers n1, n2, c of the line that has the "
        "smallest sum of squared distances to the points. It is tried on random walls."
    )
    return Task(question, {}, answer)


def _through_origin(points_mm: Any) -> Float64:
    n = np.linalg.svd(points_mm)[2][-1]
    c = n @ points_mm.mean(axis=0)
    return np.asarray(np.array([*n, c]) * np.sign(c))


RECIPES = (_read_corner, _into_map, _joined, _joined_std, _write_line)
