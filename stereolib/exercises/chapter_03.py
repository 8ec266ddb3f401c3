"""Exercises on chapter 03: costs, paths, the share of bad pixels, the left-right check."""

from __future__ import annotations

from typing import Any

import numpy as np

from stereolib.base import Float64, Floats, Ints
from stereolib.exercises.answers import Array, Number
from stereolib.exercises.function_answers import Function
from stereolib.exercises.tasks import Task, drawn, table, task

_TRIED = 128  # disparities in a cost curve
_CLEAR = 6  # answers of the census by which its one dip is deeper than all else


def _census_costs(left: Any, right: Any, row: int, column: int) -> Ints:
    """Answers that differ between one left pixel and each of its candidates, over 7 x 7 pixels."""
    around = slice(row - 3, row + 4)

    def answers(picture: Any, at: int) -> Any:
        return picture[around, at - 3 : at + 4] < picture[row, at]

    asked = answers(left, column)
    return np.array([np.sum(asked != answers(right, column - d)) for d in range(_TRIED)])


@task(
    "Read a match off its cost curve",
    "find the disparity of a pixel in the curve of its costs",
    minutes=5,
    start="disparity_px = None  # the disparity that fits best, in pixels",
    hints=(
        "Run `task.picture()`. A low cost means that both pixels fit well together.",
        "Find the deepest point of the curve and read off its place on the axis below.",
    ),
    has_picture=True,
)
def _read_cost(rng: np.random.Generator) -> Task:
    from stereolib.rig import to_grey
    from stereolib.virtual import recordings

    left, right = map(to_grey, recordings.rectified().rectify(*recordings.load_pair("conditions/texture")))
    truth = recordings.load_truth("conditions/texture")
    rows, columns = np.nonzero(truth.visible & (truth.box == 1) & (np.arange(left.shape[1]) > _TRIED + 3))
    while True:
        k = int(rng.integers(len(rows)))
        costs = _census_costs(left, right, int(rows[k]), int(columns[k]))
        best = int(np.argmin(costs))
        others = np.delete(costs, slice(max(best - 3, 0), best + 4))
        is_true = abs(best - truth.disparity_px[rows[k], columns[k]]) < 1
        if is_true and others.min() >= costs[best] + _CLEAR:
            break

    def draw() -> tuple[Any, str]:
        from stereolib.plotting import panels, plot_curves

        figure, axes = panels(1, width_in=7.5, aspect=0.4)
        curve = {"": (np.arange(_TRIED), costs)}
        plot_curves(curve, axes[0], xlabel="disparity (px)", ylabel="cost (answers that differ)", marker="")
        axes[0].set_xticks(range(0, _TRIED, 10))
        return figure, "A curve of costs over disparities from 0 to 127 pixels. It is ragged and has one deep dip."

    mistakes = {
        "This is where the cost is highest. A low cost means a good match.": float(np.argmax(costs)),
        "This is the cost itself. Read the place of the dip on the axis below.": float(costs[best]),
        "You counted from the right end of the axis.": float(_TRIED - best),
    }
    question = (
        "The picture shows what each disparity would cost one pixel of the cube, by the census. **Which disparity is "
        "the match, in pixels?** Two pixels more or less are allowed."
    )
    return Task(question, {}, Number(float(best), "px", 0.0, mistakes, off=2.0), draw)


@task(
    "How many disparities?",
    "choose the number of disparities for the nearest thing in the scene",
    minutes=5,
    start="num_disparities = None  # a multiple of 16",
    hints=(
        "First the disparity of the nearest point: Z = f B / d, solved for d.",
        "Disparities are tried from 0 up to one less than `num_disparities`. That last one must not lie below d.",
    ),
)
def _count(rng: np.random.Generator) -> Task:
    f_px, B_mm, Z_mm = drawn(rng, 600, 900, 10), drawn(rng, 80, 160), drawn(rng, 400, 1200, 10)
    d_px = f_px * B_mm / Z_mm
    wanted = float(16 * np.ceil((d_px + 1) / 16))  # the last one tried is one less
    mistakes = {
        "This is the disparity itself. The matcher takes multiples of 16 only.": d_px,
        "This is the disparity, rounded. The matcher takes multiples of 16 only.": round(d_px),
        "The last disparity tried is one less than this: the nearest thing would be lost.": wanted - 16,
        "This is more than is needed, and costs time and columns at the left.": wanted + 16,
    }
    question = (
        f"The nearest thing in front of your rig ($f$ = {f_px:g} px, $B$ = {B_mm:g} mm) is {Z_mm:g} mm deep. "
        "**What is the smallest `num_disparities` that finds it?**"
    )
    given = {"f_px": f_px, "B_mm": B_mm, "Z_mm": Z_mm}
    return Task(question, given, Number(wanted, "", 0.0, mistakes, off=0.01))


@task(
    "The census by hand",
    "compute a matching cost of two pixels",
    minutes=8,
    start="cost = None  # how many answers differ",
    hints=(
        "For each of the eight neighbours ask: is it darker than the pixel in the middle? Do it in both squares.",
        "Write the eight answers of one square below those of the other, and count the places where they differ.",
    ),
)
def _census(rng: np.random.Generator) -> Task:
    left = rng.integers(40, 200, (3, 3))
    right = np.clip(left + rng.integers(-140, 141, (3, 3)), 0, 255)
    left[1, 1], right[1, 1] = rng.integers(60, 180, 2)
    answers = [(square < square[1, 1]).ravel() for square in (left, right)]
    differ = int(np.sum(answers[0] != answers[1]))
    darker = [int(each.sum()) for each in answers]
    mistakes = {
        "You counted the answers that agree. The cost counts those that differ.": 8 - differ,
        "You counted the middle as a neighbour too, and the answers that agree.": 9 - differ,
        "You added the differences of the grey values. The census only asks: darker or not?": float(
            np.abs(left - right).sum()
        ),
        "These are the darker neighbours of the left square alone.": darker[0],
        "These are the darker neighbours of the right square alone.": darker[1],
        "You subtracted the numbers of darker neighbours. Compare neighbour by neighbour.": abs(darker[0] - darker[1]),
        "You took the left middle for both squares. Each has its own.": int(
            np.sum((left < left[1, 1]) != (right < left[1, 1]))
        ),
        "You took the right middle for both squares. Each has its own.": int(
            np.sum((left < right[1, 1]) != (right < right[1, 1]))
        ),
    }
    question = (
        "Here are the grey values around a left pixel, and around its candidate in the right picture. **What does this "
        "match cost by the census of 3 x 3 pixels?** A neighbour answers yes if it is darker than the middle.\n\n"
        f"Left:\n\n{table(left)}\n\nRight:\n\n{table(right)}"
    )
    given = {"left": left, "right": right}
    return Task(question, given, Number(float(differ), "", 0.0, mistakes, off=0.01))


def _path(costs: Ints, p1: int, p2: int, *, less: bool = True, jumps: bool = True, steps: str = "both") -> Ints:
    """Sums along a path, one row a pixel; the last three leave out a part of the formula."""
    sums = costs.astype(float)
    for x in range(1, len(sums)):
        before = sums[x - 1]
        roomy = np.pad(before, 1, constant_values=np.inf)
        ways = [before]
        ways += [roomy[:-2] + p1] if steps in ("both", "up") else []
        ways += [roomy[2:] + p1] if steps in ("both", "down") else []
        ways += [np.full_like(before, before.min() + p2)] if jumps else []
        sums[x] += np.min(ways, axis=0) - (before.min() if less else 0)
    return sums


def _path_mistakes(costs: Ints, p1: int, p2: int) -> dict[str, Any]:
    """What the last pixel's prices become by each usual mistake."""

    def last(**parts: Any) -> Any:
        return _path(costs, p1, p2, **parts)[-1]

    return {
        "You did not take away the lowest sum of the pixel before.": last(less=False),
        "You left out the jump: from any disparity one may come for P2.": last(jumps=False),
        "You left out the step: from the next disparity one may come for P1.": last(steps="none"),
        "You took the step from the larger disparity only. It may come from the smaller one too.": last(steps="down"),
        "You took the step from the smaller disparity only. It may come from the larger one too.": last(steps="up"),
        "These are the pixel's own costs. The way there is missing.": costs[-1],
        "You exchanged P1 and P2.": _path(costs, p2, p1)[-1],
        "You read the table transposed: a row is a disparity, a column a pixel.": _path(costs.T, p1, p2)[-1],
    }


@task(
    "Three steps along a path",
    "carry the sums of semi-global matching from pixel to pixel",
    minutes=15,
    start="prices = None  # L of the last pixel: four numbers, at d = 0, 1, 2 and 3",
    hints=(
        "Begin with the first pixel: its sums are its costs. Then fill one column after the other.",
        "For each disparity take the cheapest of three ways: stay, step by 1 and pay P1, jump from the cheapest and "
        "pay P2. Add the pixel's own cost, and take away the lowest sum of the pixel before.",
    ),
    points=2,
)
def _walk(rng: np.random.Generator) -> Task:
    costs = rng.integers(0, 13, (4, 4))
    p1, p2 = 1 + int(rng.integers(3)), 4 + int(rng.integers(3))
    prices = _path(costs, p1, p2)[-1]
    question = (
        f"Four pixels follow each other on a path from left to right, with $P_1$ = {p1} and $P_2$ = {p2}. These are "
        "their costs, one row a disparity and one column a pixel:\n\n"
        f"{table(costs.T, [f'pixel {x}' for x in range(4)], [f'd = {k}' for k in range(4)])}\n\n"
        f"**What is $L$ of pixel 3 at each of the four disparities?** In each step take away the lowest "
        "sum of the pixel before."
    )
    given = {"costs": costs, "P1": p1, "P2": p2}
    return Task(question, given, Array(prices, mistakes=_path_mistakes(costs, p1, p2)))


@task(
    "How bad is this map?",
    "score a disparity map against the truth",
    minutes=8,
    start="bad2_pct = None  # share of bad pixels, in %",
    hints=(
        "A pixel is bad if it is off by more than 2 px. What about a pixel without a value?",
        "Count the holes as bad, and divide by all pixels whose truth is known.",
    ),
)
def _bad(rng: np.random.Generator) -> Task:
    truth = np.where(np.arange(8) < rng.integers(3, 6), 12.0, 30.0) + rng.integers(0, 2, (5, 8))
    found = truth + rng.choice([0.0, 0.5, -1.5, 1.75, 4.0, -9.0, np.nan], truth.shape, p=[0.3, *[0.1] * 4, 0.1, 0.2])
    off = np.abs(found - truth)
    bad, holes = float(np.nansum(off > 2)), float(np.isnan(off).sum())
    share = 100 * (bad + holes) / truth.size
    mistakes = {
        "You left out the holes. A pixel without a value is bad too.": 100 * bad / truth.size,
        "You divided by the pixels that have a value. Divide by all.": 100 * bad / (truth.size - holes),
        "These are the holes alone.": 100 * holes / truth.size,
        "This is the share of good pixels.": 100 - share,
        "This counts the pixels. In % it is a share of all of them.": bad + holes,
    }
    question = (
        "`task.given.found` is a small disparity map with holes (NaN), `task.given.truth` the true disparity. "
        "**What is its bad-2, in %?**"
    )
    return Task(question, {"found": found, "truth": truth}, Number(share, "%", 0.005, mistakes))


def _left_right(left_px: Any, right_px: Any, tolerance_px: float) -> Floats:
    from stereolib.matching import left_right_check

    return left_right_check(left_px, right_px, tolerance_px)


def _checked(
    left_px: Any, right_px: Any, tolerance_px: float, *, towards: int = -1, wraps: bool = False, keeps: bool = True
) -> Float64:
    """The check with a mistake in it: the wrong way, round the border, or what disagrees kept."""
    width = left_px.shape[1]
    target = np.arange(width) + towards * np.rint(np.nan_to_num(left_px)).astype(int)
    inside = np.isfinite(left_px) & (wraps | ((target >= 0) & (target < width)))
    other = np.take_along_axis(right_px, target % width, axis=1)
    agrees = inside & (np.abs(other - left_px) <= tolerance_px)
    return np.where(agrees if keeps else ~agrees, left_px, np.nan)


@task(
    "Write the left-right check yourself",
    "write the check that finds false matches and places that one camera sees",
    minutes=30,
    start=(
        "def check_both(left_px, right_px, tolerance_px):\n"
        '    """The left disparities with which the right map agrees, else NaN. Holes (NaN) stay holes."""\n'
        "    ..."
    ),
    hints=(
        "The partner of the left pixel in column u stands in the right picture in column u - d, rounded. Ask the right "
        "map what disparity it has there.",
        "Keep d if both differ by no more than the tolerance. Else write NaN: also where u - d is outside the picture, "
        "where d is NaN, and where the right map is NaN. Do not change `left_px` itself.",
    ),
    points=3,
)
def _write_check(rng: np.random.Generator) -> Task:
    def inputs(rng: np.random.Generator) -> tuple[Any, ...]:
        near = int(rng.integers(4, 9))
        left = np.full((5, 24), float(near))
        left[:, : int(rng.integers(8, 16))] = int(rng.integers(1, 4))
        right = np.full_like(left, np.nan)
        for row, column in np.ndindex(left.shape):
            if (to := column - int(left[row, column])) >= 0:
                right[row, to] = left[row, column]
        right[:, -near:] = near  # what the left picture does not show
        for each in (left, right):
            each[rng.random(left.shape) < 0.1] = np.nan
            each += rng.uniform(-0.3, 0.3, left.shape)
            each += rng.uniform(0.5, 6, left.shape) * (rng.random(left.shape) < 0.2)
        return left, right, float(rng.uniform(0.4, 3))

    def at_same_place(left_px: Any, right_px: Any, tolerance_px: float) -> Float64:
        return np.where(np.abs(right_px - left_px) <= tolerance_px, left_px, np.nan)

    def mistaken(**how: Any) -> Any:
        return lambda left_px, right_px, tolerance_px: _checked(left_px, right_px, tolerance_px, **how)

    answer = Function(
        _left_right,
        inputs,
        rules={
            "A hole must stay a hole.": lambda out, left, right, t: bool(np.isnan(out[np.isnan(left)]).all()),
            "What is kept must keep its value.": lambda out, left, right, t: bool(
                np.isnan(out)[out != left].all() and not np.any(out[np.isfinite(out)] != left[np.isfinite(out)])
            ),
            "You keep pixels that the right map does not confirm.": lambda out, left, right, t: bool(
                np.isnan(out[np.isnan(_left_right(left, right, t))]).all()
            ),
            "You delete pixels that the right map confirms.": lambda out, left, right, t: bool(
                np.isfinite(out[np.isfinite(_left_right(left, right, t))]).all()
            ),
        },
        mistakes={
            "The sign is wrong: the partner is d columns farther left, not right.": mistaken(towards=1),
            "Columns below 0 are taken from the other border, as numpy counts. They must be NaN.": mistaken(wraps=True),
            "You compare the same column in both maps. Follow the disparity first.": at_same_place,
            "You keep what disagrees and delete what agrees.": mistaken(keeps=False),
            "Your tolerance is always the same. Take `tolerance_px`.": lambda a, b, t: _left_right(a, b, 1.0),
            "A deleted pixel is NaN here, not 0.": lambda a, b, t: np.nan_to_num(_left_right(a, b, t)),
            "It returns which pixels agree. Return their disparities.": lambda a, b, t: np.isfinite(
                _left_right(a, b, t)
            ),
        },
    )
    question = (
        "**Write a function `check_both(left_px, right_px, tolerance_px)`** that keeps a left disparity if the right "
        "map has the same one at the partner, and returns NaN elsewhere. The partner's column is rounded, and the same "
        "means: apart by `tolerance_px` at most. Both maps hold positive disparities. It is tried on random maps with "
        "steps, holes and false matches."
    )
    return Task(question, {}, answer)


RECIPES = (_read_cost, _count, _census, _walk, _bad, _write_check)
