"""Exercises on chapter 01: the camera matrix, the unknowns, the pair, the lens."""

from __future__ import annotations

from typing import Any

import numpy as np

from stereolib.base import Float64
from stereolib.exercises.answers import Array, Number
from stereolib.exercises.function_answers import Function
from stereolib.exercises.tasks import Task, drawn, task


@task(
    "Read the moves off a figure",
    "make a standard deviation of the moves of a parameter",
    minutes=12,
    start="std_px = None  # standard deviation of the focal length, in pixels",
    hints=(
        "Run `task.picture()`, which shows `task.given.moves_px`. Each dot is one pair left out.",
        "It is the jackknife: the moves less their mean, squared and added, times (n - 1) / n, then the root.",
    ),
    points=2,
    has_picture=True,
)
def _jackknife(rng: np.random.Generator) -> Task:
    n = int(drawn(rng, 12, 30))
    moves_px = np.round(rng.normal(0, drawn(rng, 0.02, 0.1, 0.01), n), 3)
    off = moves_px - moves_px.mean()
    std_px = float(np.sqrt((n - 1) / n * np.sum(off**2)))

    def draw() -> tuple[Any, str]:
        from stereolib.plotting import panels, plot_curves

        figure, axes = panels(1, width_in=7.5, aspect=0.3)
        dots = {"": (np.arange(1, n + 1), moves_px)}
        plot_curves(dots, axes[0], xlabel="pair left out", ylabel="move (px)", joined=False)
        axes[0].axhline(0, color="0.5", lw=1)
        return figure, "Dots around a line at zero: how far the focal length moves when each of the pairs is left out."

    mistakes = {
        "You averaged the squares. Fits that share nearly all pictures must be added: the jackknife.": float(
            np.sqrt(np.mean(off**2))
        ),
        "You divided by n - 1. The factor of the jackknife is (n - 1) / n.": float(np.std(moves_px, ddof=1)),
        "You left out the factor (n - 1) / n.": float(np.sqrt(np.sum(off**2))),
        "You counted the moves from zero. Take away their mean first.": float(
            np.sqrt((n - 1) / n * np.sum(moves_px**2))
        ),
        "This is the square of it: take the root.": std_px**2,
        "This is the half-width of the interval. The standard deviation is asked for.": 1.96 * std_px,
        "This is the largest move.": float(np.abs(moves_px).max()),
    }
    question = (
        f"A focal length was found from {n} pairs of a board. Each pair was left out in turn, and the focal length "
        "moved as the picture and `task.given.moves_px` show. **What is its standard deviation, in pixels?**"
    )
    return Task(question, {"moves_px": moves_px}, Number(std_px, "px", 0.005, mistakes), draw)


@task(
    "From a direction to a pixel",
    "use a camera matrix",
    minutes=5,
    start="pixel = None  # (column, row), in pixels",
    hints=(
        "Write the direction as (x', y', 1) and multiply K by it.",
        "u = fx x' + cx and v = fy y' + cy. Give both as (u, v).",
    ),
)
def _project(rng: np.random.Generator) -> Task:
    fx, fy = drawn(rng, 600, 800), drawn(rng, 600, 800)
    cx, cy = drawn(rng, 290, 350), drawn(rng, 200, 260)
    X, Y, Z = drawn(rng, 60, 200, 5), drawn(rng, -150, -40, 5), drawn(rng, 500, 900, 10)
    pixel = np.array([fx * X / Z + cx, fy * Y / Z + cy])
    mistakes = {
        "You left out the principal point.": pixel - (cx, cy),
        "Row and column are exchanged: the column comes first.": pixel[::-1],
        "You did not divide by the depth first.": np.array([fx * X + cx, fy * Y + cy]),
        "The sign of y is wrong: rows count downwards, and so does Y.": np.array([pixel[0], cy - fy * Y / Z]),
        "fx and fy are exchanged.": np.array([fy * X / Z + cx, fx * Y / Z + cy]),
    }
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    question = (
        f"A camera has $f_x$ = {fx:g}, $f_y$ = {fy:g}, $c_x$ = {cx:g}, $c_y$ = {cy:g} px and no distortion. A point is "
        f"{X:g} mm to the right, {-Y:g} mm above the axis ($Y$ = {Y:g} mm) and {Z:g} mm ahead. "
        "**Which pixel (column, row) is it?**"
    )
    return Task(question, {"K": K, "point_mm": np.array([X, Y, Z])}, Array(pixel, "px", 0.002, mistakes))


@task(
    "How many unknowns?",
    "count what a calibration has to find",
    minutes=5,
    start="unknowns = None  # how many numbers",
    hints=(
        "What belongs to each camera, what to the pair, and what to each board?",
        "Two cameras with four numbers of K and the lens each; three angles and a shift of the pair; as many a board.",
    ),
)
def _unknowns(rng: np.random.Generator) -> Task:
    boards, lens = int(drawn(rng, 8, 40)), int(rng.choice([4, 5, 8]))
    right = 2 * (4 + lens) + 6 + 6 * boards
    mistakes = {
        "You counted one camera. There are two.": right - (4 + lens),
        "You left out the turn and shift between the cameras.": right - 6,
        "You counted three numbers a board. It has a turn and a shift, three each.": right - 3 * boards,
        "You counted each board twice. Both cameras see the same board in the same place.": right + 6 * boards,
        "You counted nine numbers for a turn. Three angles settle it.": right + 6 + 6 * boards,
        "You left out the boards. Nobody knows how they were held.": right - 6 * boards,
        "You left out the lenses.": right - 2 * lens,
    }
    question = (
        f"Two cameras take {boards} pairs of pictures of a board. Each lens has {lens} coefficients, and $K$ has no "
        "skew. **How many unknown numbers does the calibration find?**"
    )
    given = {"boards": boards, "lens": lens}
    return Task(question, given, Number(float(right), "", 0.0, mistakes, off=0.01))


@task(
    "The ruler was wrong",
    "say what a wrong size of the squares does",
    minutes=5,
    start="baseline_mm = None  # what the calibration finds, in mm",
    hints=(
        "Pictures give ratios alone: the only length that a calibration knows is the size of the squares.",
        "All lengths are wrong by the same factor: the believed size over the true size.",
    ),
)
def _ruler(rng: np.random.Generator) -> Task:
    true_mm, believed_mm = drawn(rng, 20, 40, 0.5), drawn(rng, 20, 40, 0.5)
    B_mm = drawn(rng, 60, 200)
    found_mm = B_mm * believed_mm / true_mm
    mistakes = {
        "It is the other way round: squares believed too small make all lengths too small.": B_mm
        * true_mm
        / believed_mm,
        "This is the true baseline. The calibration cannot find it: its ruler is wrong.": B_mm,
        "It is off by the baseline: the whole length is asked for, not the error.": found_mm - B_mm,
        "Lengths scale by a factor: nothing is added.": B_mm + believed_mm - true_mm,
    }
    question = (
        f"The squares of a board are {true_mm:g} mm wide, but you believe them to be {believed_mm:g} mm. The true "
        f"baseline is {B_mm:g} mm. **Which baseline does the calibration find, in mm?**"
    )
    given = {"true_mm": true_mm, "believed_mm": believed_mm, "B_mm": B_mm}
    return Task(question, given, Number(found_mm, "mm", 0.004, mistakes))


@task(
    "The essential matrix",
    "make E of a turn and a shift",
    minutes=10,
    start="E = None  # a 3 x 3 array",
    hints=(
        "The chapter has the matrix of the cross product with T. `skew` of `stereolib.rig` makes it too.",
        "E = [T]x R, in this order.",
    ),
)
def _essential(rng: np.random.Generator) -> Task:
    from stereolib.rig import skew

    T = np.array([drawn(rng, -120, -60), drawn(rng, -9, 9), drawn(rng, -15, 15)])
    R, _ = np.linalg.qr(np.eye(3) + rng.uniform(-0.15, 0.15, (3, 3)))
    R = np.round(R * np.sign(np.diag(R)), 4)
    E = skew(T) @ R
    mistakes = {
        "The order is reversed: E = [T]x R.": R @ skew(T),
        "You multiplied by the transpose of R.": skew(T) @ R.T,
        "You multiplied the numbers one by one. Use the matrix product, @.": skew(T) * R,
        "This is [T]x alone.": skew(T),
    }
    question = (
        "`task.given.R` and `task.given.T` (mm) lead from the left camera to the right one: $P_r = R P_l + T$. "
        "**What is the essential matrix?**"
    )
    return Task(question, {"R": R, "T": T}, Array(E, "", 0.002, mistakes))


def _bend(xy: Any, dist: Any) -> Float64:
    from stereolib.rig import distort

    return distort(xy, dist)[0]


def _bent(xy: Any, dist: Any, *, square: int = 2, tangential: bool = True, by_radius: bool = False) -> Float64:
    """The lens formula with a mistake in it."""
    k1, k2, p1, p2, k3 = dist
    x, y = np.asarray(xy, float).T
    r2 = x**2 + y**2
    s = np.sqrt(r2) if by_radius else r2
    g = 1 + k1 * s + k2 * s**2 + k3 * s**3
    p1, p2 = (p1, p2) if tangential else (0.0, 0.0)
    bent = x * g + 2 * p1 * x * y + p2 * (r2 + 2 * x**square), y * g + p1 * (r2 + 2 * y**square) + 2 * p2 * x * y
    return np.stack(bent, -1)


@task(
    "Write the lens formula yourself",
    "write what a lens does to a direction",
    minutes=25,
    start=(
        "def bend(xy, dist):\n"
        '    """Bent directions (N, 2) of straight ones (N, 2); dist: k1, k2, p1, p2, k3, in this order."""\n'
        "    ..."
    ),
    hints=(
        "r² = x² + y² first, then g, then the two lines of the formula in the chapter.",
        "`x, y = xy.T` gives all x and all y; `np.stack([x2, y2], axis=-1)` puts the results together.",
    ),
    points=3,
)
def _write_bend(rng: np.random.Generator) -> Task:
    def inputs(rng: np.random.Generator) -> tuple[Any, ...]:
        return rng.uniform(-0.5, 0.5, (20, 2)), rng.uniform(-1, 1, 5) * (0.5, 0.5, 0.05, 0.05, 0.5)

    def paper_order(xy: Any, dist: Any) -> Float64:
        return _bend(xy, np.asarray(dist)[[0, 1, 3, 4, 2]])

    answer = Function(
        _bend,
        inputs,
        mistakes={
            "The order is that of Table I. Here p1 and p2 come before k3.": paper_order,
            "p1 and p2 are exchanged.": lambda xy, d: _bend(xy, np.asarray(d)[[0, 1, 3, 2, 4]]),
            "Two squares are lost, as in the paper's print: it is r² + 2x², and r² + 2y².": lambda xy, d: _bent(
                xy, d, square=1
            ),
            "The tangential part (p1, p2) is missing.": lambda xy, d: _bent(xy, d, tangential=False),
            "You took r where r² is meant.": lambda xy, d: _bent(xy, d, by_radius=True),
            "x and y are exchanged.": lambda xy, d: _bend(xy, d)[:, ::-1],
            "It returns the moves. Return the bent directions.": lambda xy, d: _bend(xy, d) - xy,
        },
    )
    question = (
        "**Write a function `bend(xy, dist)`** that returns the directions behind the lens. `xy` holds one direction "
        "$(x', y')$ a row. It is tried on random directions and lenses."
    )
    return Task(question, {}, answer)


RECIPES = (_jackknife, _project, _unknowns, _ruler, _essential, _write_bend)
