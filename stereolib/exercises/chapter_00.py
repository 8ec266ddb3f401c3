"""Exercises on chapter 00: from two pictures to a depth and a length."""

from __future__ import annotations

from typing import Any

import numpy as np

from stereolib.base import Float64
from stereolib.exercises.answers import Choice, Number
from stereolib.exercises.function_answers import Function
from stereolib.exercises.tasks import Task, drawn, task

_CENTRE_PX = 320.0, 240.0  # principal point of every rig here


@task(
    "Read a disparity off two pictures",
    "find the disparity of one point in a pair of pictures",
    minutes=5,
    start="disparity_px = None  # the disparity of the ringed point, in pixels",
    hints=(
        "Run `task.picture()`. Both rings show the same point of the cube; a text beside each gives its column.",
        "The disparity is the column in the left picture less the column in the right one.",
    ),
    has_picture=True,
)
def _read_disparity(rng: np.random.Generator) -> Task:
    from stereolib.virtual import recordings

    truth = recordings.load_truth("conditions/texture")
    rows, columns = np.nonzero(truth.visible & (truth.box == 1))
    k = int(rng.integers(len(rows)))
    row, column = int(rows[k]), int(columns[k])
    disparity_px = float(truth.disparity_px[row, column])

    def draw() -> tuple[Any, str]:
        from stereolib.plotting import panels, plot_pair

        figure, axes = panels(2, width_in=7.5)
        pictures = recordings.rectified().rectify(*recordings.load_pair("conditions/texture"))
        plot_pair(pictures, ([(column, row)], [(column - disparity_px, row)]), axes)
        return figure, "Two pictures of a cube. A ring in each shows the same point, with its column and row beside it."

    right_column = column - disparity_px
    mistakes = {
        "You added the two columns: the disparity is their difference.": column + right_column,
        "This is the column in the left picture. Subtract the one in the right picture.": float(column),
        "This is the column in the right picture. Subtract it from the one in the left picture.": right_column,
        "This is the row, which is the same in both pictures. The disparity lies along the row.": float(row),
    }
    question = (
        "The picture shows a cube of the virtual rig, seen by the left and by the right camera. One point is ringed in "
        "both. **What is its disparity, in pixels?** An error of one pixel is allowed."
    )
    return Task(question, {}, Number(disparity_px, "px", 0.0, mistakes, off=1.01), draw)


@task(
    "From a disparity to a depth",
    "turn a disparity into a depth",
    minutes=5,
    start="depth_mm = None  # the depth, in mm",
    hints=(
        "Look at the formula under *Depth in three lines*: three of its four letters are given.",
        "Z = f B / d. With f and d in pixels the pixels cancel, and Z has the unit of B.",
    ),
)
def _depth(rng: np.random.Generator) -> Task:
    f_px, B_mm, d_px = drawn(rng, 550, 950, 10), drawn(rng, 60, 240, 5), drawn(rng, 30, 110, 0.5)
    depth_mm = f_px * B_mm / d_px
    mistakes = {
        "You turned the fraction round: the disparity stands below.": d_px / (f_px * B_mm),
        "You multiplied by the disparity: it stands below the line.": f_px * B_mm * d_px,
        "You left out the focal length.": B_mm / d_px,
        "You left out the baseline.": f_px / d_px,
        "It is off by the baseline: nothing is added to Z = f B / d.": depth_mm + B_mm,
        "It is off by the baseline: nothing is taken away from Z = f B / d.": depth_mm - B_mm,
    }
    question = (
        f"Your rig has a focal length of $f$ = {f_px:g} px and a baseline of $B$ = {B_mm:g} mm. A point has a "
        f"disparity of $d$ = {d_px:g} px. **How deep is it, in mm?**"
    )
    return Task(question, {"f_px": f_px, "B_mm": B_mm, "d_px": d_px}, Number(depth_mm, "mm", mistakes=mistakes))


def _place(left: Any, right: Any, f_px: float, B_mm: float, centre: Any) -> Float64:
    """X, Y, Z in mm of a point that has these pixels in both pictures."""
    Z = f_px * B_mm / (left[0] - right[0])
    return np.array([(left[0] - centre[0]) * Z / f_px, (left[1] - centre[1]) * Z / f_px, Z])


@task(
    "A length from four clicks",
    "measure the length of an edge that is not parallel to the picture",
    minutes=15,
    start="length_mm = None  # the length of the edge, in mm",
    hints=(
        "Each end needs its own depth first. Then find X and Y of each end, with the formula of the pinhole.",
        "X = (column - cx) Z / f, Y = (row - cy) Z / f. The length is the distance of the two points in space.",
    ),
    points=2,
)
def _length(rng: np.random.Generator) -> Task:
    f_px, B_mm, side_mm = drawn(rng, 600, 900, 10), drawn(rng, 80, 160, 5), drawn(rng, 150, 400, 10)
    near_mm, tilt, turn = drawn(rng, 600, 900, 10), np.radians(drawn(rng, 30, 45)), np.radians(drawn(rng, 25, 45))
    foot = np.array([drawn(rng, -90, -20), side_mm / 3, near_mm])
    lean = np.array([np.sin(tilt) * np.sin(turn), -np.cos(tilt), np.sin(tilt) * np.cos(turn)])
    ends_mm = np.array([foot + side_mm * lean, foot])
    columns = _CENTRE_PX[0] + f_px * ends_mm[:, 0] / ends_mm[:, 2]
    rows = _CENTRE_PX[1] + f_px * ends_mm[:, 1] / ends_mm[:, 2]
    left = np.round(np.stack([columns, rows], -1), 1)
    right = np.round(np.stack([columns - f_px * B_mm / ends_mm[:, 2], rows], -1), 1)
    top, bottom = (_place(*pixels, f_px, B_mm, _CENTRE_PX) for pixels in zip(left, right, strict=True))
    length_mm = float(np.linalg.norm(top - bottom))
    uncentred = (_place(*pixels, f_px, B_mm, (0, 0)) for pixels in zip(left, right, strict=True))
    pixels_px, (dX, dY, dZ) = float(np.linalg.norm(left[0] - left[1])), np.abs(top - bottom)
    mistakes = {
        "You took the depth of the foot for both ends. Each end has its own.": pixels_px * bottom[2] / f_px,
        "You took the depth of the top for both ends. Each end has its own.": pixels_px * top[2] / f_px,
        "You took the mean of both depths for both ends. Each end has its own.": pixels_px
        * (top[2] + bottom[2])
        / (2 * f_px),
        "You left out the principal point: count columns and rows from there.": float(
            np.linalg.norm(next(uncentred) - next(uncentred))
        ),
        "You left out X. The ends differ sideways too.": float(np.hypot(dY, dZ)),
        "You left out Y. The ends differ in height too.": float(np.hypot(dX, dZ)),
        "You left out Z. The ends differ in depth too.": float(np.hypot(dX, dY)),
        "This is only the difference in height (Y).": float(dY),
        "This is only the difference in depth (Z).": float(dZ),
        "This is the square of the length: take the root.": length_mm**2,
        "These are pixels, not millimetres.": pixels_px,
        "These are rows, not millimetres.": float(left[1, 1] - left[0, 1]),
    }
    question = (
        f"An edge leans away and to the right. Its rig has $f$ = {f_px:g} px, $B$ = {B_mm:g} mm and the principal "
        f"point ({_CENTRE_PX[0]:g}, {_CENTRE_PX[1]:g}). Its upper end is at {_pixel(left[0])} in the left picture and "
        f"at {_pixel(right[0])} in the right one, its foot at {_pixel(left[1])} and {_pixel(right[1])} (column, row). "
        "**How long is the edge, in mm?**"
    )
    given = {"f_px": f_px, "B_mm": B_mm, "centre_px": _CENTRE_PX}
    given |= {"top_left": left[0], "top_right": right[0], "foot_left": left[1], "foot_right": right[1]}
    return Task(question, given, Number(length_mm, "mm", mistakes=mistakes))


def _pixel(place: Float64) -> str:
    return f"({place[0]:.1f}, {place[1]:.1f})"


@task(
    "How far apart must the cameras stand?",
    "choose a baseline for the accuracy that is wanted",
    minutes=10,
    start="baseline_mm = None  # the baseline, in mm",
    hints=(
        "Look at *What is a pixel worth?* The worth of a pixel is given, and the baseline is asked for.",
        "Solve Z² / (f B) = worth for B. Mind that Z is in metres here.",
    ),
)
def _baseline(rng: np.random.Generator) -> Task:
    f_px, worth_mm, Z_m = drawn(rng, 600, 900, 10), drawn(rng, 4, 25), drawn(rng, 1.5, 4, 0.1)
    Z_mm = 1000 * Z_m
    baseline_mm = Z_mm**2 / (f_px * worth_mm)
    mistakes = {
        "You forgot the square: the worth grows with the depth times the depth.": Z_mm / (f_px * worth_mm),
        "Z is in metres, and you took it as millimetres.": Z_m**2 / (f_px * worth_mm),
        "This is the disparity at that depth, not a baseline.": Z_mm / worth_mm,
        "You took the inverse: solve Z² / (f B) = worth for B.": f_px * worth_mm / Z_mm**2,
    }
    question = (
        f"Your cameras have $f$ = {f_px:g} px. At a depth of {Z_m:g} m one pixel of disparity is to be worth "
        f"{worth_mm:g} mm. **Which baseline do they need, in mm?**"
    )
    given = {"f_px": f_px, "worth_mm": worth_mm, "Z_m": Z_m}
    number = Number(baseline_mm, "mm", 0.03, mistakes)  # holds the way by two depths a pixel apart, too
    return Task(question, given, number)


@task(
    "What moves the disparity?",
    "say which changes keep a disparity and which do not",
    minutes=3,
    start='change = None  # "first", "second" or "third"',
    hints=(
        "Only the product f B over Z counts.",
        "Work out by which factor each of the three changes f B / Z. One of the factors is 1.",
    ),
)
def _change(rng: np.random.Generator) -> Task:
    k = drawn(rng, 2, 5)
    changes = {
        f"stand {k:g} times as far away, with {k:g} times the baseline": "",
        f"stand {k:g} times as far away, with the focal length divided by {k:g}": (
            f"Both make the disparity smaller: together {k * k:g} times."
        ),
        f"take {k:g} times the baseline, and {k:g} times the focal length": (
            f"Both make the disparity larger: together {k * k:g} times."
        ),
    }
    order = [list(changes)[i] for i in rng.permutation(3)]
    places = dict(zip(("first", "second", "third"), order, strict=True))
    right = next(place for place, change in places.items() if not changes[change])
    wrong = {place: changes[change] for place, change in places.items() if place != right}
    listing = "\n".join(f"* {place}: {change};" for place, change in places.items())
    question = f"A box has some disparity. **Which of these leaves it as it is?**\n\n{listing.removesuffix(';')}."
    return Task(question, {}, Choice(right, wrong))


@task(
    "Write `place` yourself",
    "write the function that turns two pixels into a point",
    minutes=20,
    start=(
        "def place(left, right, f_px, B_mm, centre):\n"
        '    """X, Y, Z in mm of what has the pixels `left` and `right` (column, row); `centre`: principal point."""\n'
        "    ..."
    ),
    hints=(
        "First Z from the two columns. Then X and Y from the left pixel.",
        "Count the left pixel from the principal point, multiply by Z, divide by f. Return an array of three numbers.",
    ),
    points=3,
)
def _write_place(rng: np.random.Generator) -> Task:
    def inputs(rng: np.random.Generator) -> tuple[Any, ...]:
        left, d_px = rng.uniform((100, 0), (640, 480)), rng.uniform(10, 90)
        return left, left - (d_px, 0), rng.uniform(500, 1000), rng.uniform(50, 300), rng.uniform(200, 350, 2)

    def uncentred(left: Any, right: Any, f_px: float, B_mm: float, centre: Any) -> Float64:
        return _place(left, right, f_px, B_mm, (0.0, 0.0))

    def swapped(left: Any, right: Any, f_px: float, B_mm: float, centre: Any) -> Float64:
        return _place(right, left, f_px, B_mm, centre)

    def by_right(left: Any, right: Any, f_px: float, B_mm: float, centre: Any) -> Float64:
        return _place(left, right, f_px, B_mm, centre) - (B_mm, 0.0, 0.0)

    def negative(left: Any, right: Any, f_px: float, B_mm: float, centre: Any) -> Float64:
        return -_place(left, right, f_px, B_mm, centre)

    def transposed(left: Any, right: Any, f_px: float, B_mm: float, centre: Any) -> Float64:
        return _place(left, right, f_px, B_mm, centre)[[1, 0, 2]]

    answer = Function(
        _place,
        inputs,
        rules={
            "Z must be f B / d.": lambda P, left, right, f, B, c: bool(np.isclose(P[2], f * B / (left[0] - right[0]))),
            "X / Z must be the column, counted from the principal point, over f.": lambda P, left, right, f, B, c: bool(
                np.isclose(P[0] / P[2], (left[0] - c[0]) / f)
            ),
            "Y / Z must be the row, counted from the principal point, over f.": lambda P, left, right, f, B, c: bool(
                np.isclose(P[1] / P[2], (left[1] - c[1]) / f)
            ),
        },
        mistakes={
            "You count pixels from the corner of the picture; count them from the principal point.": uncentred,
            "Left and right are exchanged: the disparity comes out negative.": swapped,
            "X is off by the baseline: it is counted from the left camera, so take the left pixel.": by_right,
            "The sign is wrong: the disparity is left less right.": negative,
            "X and Y are exchanged: a pixel is (column, row), and columns belong to X.": transposed,
            "It is 10 times too small. Is it in mm?": lambda *given: _place(*given) / 10,
            "It is 1000 times too small. Is it in mm?": lambda *given: _place(*given) / 1000,
        },
    )
    question = (
        "**Write a function `place(left, right, f_px, B_mm, centre)`** that returns the point (X, Y, Z), in mm before "
        "the left camera, as an array of three numbers. It is tried on random pixels and rigs."
    )
    return Task(question, {}, answer)


RECIPES = (_read_disparity, _depth, _length, _baseline, _change, _write_place)
