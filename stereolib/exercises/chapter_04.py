"""Exercises on chapter 04: dilation by hand, what it costs, the filter itself."""

from __future__ import annotations

from typing import Any

import numpy as np

from stereolib.base import Float64, Floats
from stereolib.exercises.answers import Number
from stereolib.exercises.function_answers import Function
from stereolib.exercises.tasks import Task, drawn, task

_MAP_SHAPE = 6, 9  # rows and columns of the maps that are dilated by hand


def _small_map(rng: np.random.Generator) -> Float64:
    """An object before a wall, both with values that vary, with holes."""
    values = rng.integers(1, 5, _MAP_SHAPE).astype(float)
    values[1:5, 2:7] = rng.integers(6, 13, (4, 5))
    values[rng.random(_MAP_SHAPE) < 0.12] = np.nan
    return values


def _window(values: Float64, row: int, column: int) -> Float64:
    return values[row - 1 : row + 2, column - 1 : column + 2]


def _drawing(values: Float64, title: str) -> Any:
    """Return what draws a small map with its numbers."""

    def draw() -> tuple[Any, str]:
        from stereolib.plotting import panels, plot_cells

        figure, axes = panels(1, width_in=6, aspect=0.7)
        plot_cells(values, axes[0], title)
        axes[0].set_xticks(range(values.shape[1]))
        axes[0].set_yticks(range(values.shape[0]))
        axes[0].tick_params(labelbottom=True, labelleft=True)
        axes[0].set(xlabel="column", ylabel="row")
        return figure, "A small disparity map as cells with their numbers; holes are grey and empty."

    return draw


@task(
    "Dilate one pixel by hand",
    "dilate a disparity map by hand",
    minutes=4,
    start="value = None  # value of the pixel after the dilation",
    hints=(
        "Run `task.picture()` and look at the 3 x 3 pixels around the one that is asked for.",
        "Dilation writes down the largest of the nine. Holes take no part.",
    ),
    has_picture=True,
)
def _dilate_one(rng: np.random.Generator) -> Task:
    values = _small_map(rng)
    row, column = int(rng.integers(1, 5)), int(rng.integers(1, 8))
    around = _window(values, row, column)
    mistakes = {
        "This is the smallest of the nine, which is erosion.": float(np.nanmin(around)),
        "This is the value before. Look at its neighbours too.": float(np.nan_to_num(values[row, column])),
        "This is the mean of the nine.": float(np.nanmean(around)),
        "You exchanged row and column.": float(np.nanmax(_window(values, min(column, 4), min(row, 7)))),
        "You looked only at the row.": float(np.nanmax(values[row, column - 1 : column + 2], initial=0.0)),
    }
    question = (
        "The picture shows a small disparity map, `task.given.values`. Rows and columns count from 0. It is dilated "
        f"with a window of 3 x 3 pixels. **Which value has the pixel in row {row}, column {column} afterwards?**"
    )
    number = Number(float(np.nanmax(around)), "", 0.0, mistakes, off=0.01)
    given = {"values": values, "row": row, "column": column}
    return Task(question, given, number, _drawing(values, "the map"))


@task(
    "And eroded again: closing",
    "close a disparity map by hand",
    minutes=8,
    start="closed = None  # value of the pixel after closing",
    hints=(
        "Closing is dilation, then erosion: the smallest of the nine *dilated* values around the pixel.",
        "Dilate the nine pixels around it one by one, then take the smallest of these nine results.",
    ),
)
def _close_one(rng: np.random.Generator) -> Task:
    values = _small_map(rng)
    grown = _slow_dilate(values, 3)
    row, column = int(rng.integers(2, 4)), int(rng.integers(2, 7))
    closed = float(np.nanmin(_window(grown, row, column)))
    mistakes = {
        "This is the dilated value. The second step is missing.": float(grown[row, column]),
        "You eroded first and dilated then, which is opening.": float(
            np.nanmax(_window(-_slow_dilate(-values, 3), row, column))
        ),
        "You eroded the map itself. Erode the dilated one.": float(np.nanmin(_window(values, row, column))),
        "You dilated twice.": float(np.nanmax(_window(grown, row, column))),
    }
    question = (
        "`task.given.values` is another small map (print it). It is closed with a window of 3 x 3 pixels: dilated, "
        f"then eroded. **Which value has the pixel in row {row}, column {column} afterwards?** Count from 0."
    )
    given = {"values": values, "row": row, "column": column}
    return Task(question, given, Number(closed, "", 0.0, mistakes, off=0.01))


@task(
    "How much wider?",
    "say what a window does to the width of a thing",
    minutes=5,
    start="wider_mm = None  # how much wider it seems, in mm",
    hints=(
        "A window reaches half of its size, without the middle, to either side.",
        "Both borders of the thing move outwards. A pixel at the depth Z is worth Z / f.",
    ),
)
def _wider(rng: np.random.Generator) -> Task:
    size, Z_mm, f_px = drawn(rng, 5, 25, 2), drawn(rng, 500, 1500, 50), drawn(rng, 600, 900, 10)
    reach_mm = (size - 1) / 2 * Z_mm / f_px
    mistakes = {
        "You moved one border only. The window reaches over both.": reach_mm,
        "You took the whole window for each side. It reaches half of it.": 4 * reach_mm,
        "You counted the pixel in the middle too: a window of 3 reaches 1 pixel.": size * Z_mm / f_px,
        "These are pixels. A pixel is worth Z / f.": size - 1,
        "A pixel is worth Z / f, not f / Z.": (size - 1) * f_px / Z_mm,
    }
    question = (
        f"A map is dilated with a window of {size:g} x {size:g} pixels. A box stands before a far wall, at a depth of "
        f"{Z_mm:g} mm; $f$ = {f_px:g} px. **How much wider does it seem, in mm?** Take straight borders."
    )
    given = {"size_px": size, "Z_mm": Z_mm, "f_px": f_px}
    return Task(question, given, Number(2 * reach_mm, "mm", 0.005, mistakes))


@task(
    "How much nearer?",
    "say what dilation does to a depth",
    minutes=6,
    start="nearer_mm = None  # how much nearer it seems, in mm",
    hints=(
        "The shift makes the disparity larger. Compute the depth before and after.",
        "nearer = f B / d - f B / (d + shift).",
    ),
)
def _nearer(rng: np.random.Generator) -> Task:
    f_px, B_mm = drawn(rng, 600, 900, 10), drawn(rng, 80, 160, 5)
    d_px, shift_px = drawn(rng, 20, 60), drawn(rng, 1, 4, 0.25)
    before, after = f_px * B_mm / d_px, f_px * B_mm / (d_px + shift_px)
    mistakes = {
        "This is the depth afterwards. How much less is it than before?": after,
        "This is the depth before.": before,
        "A larger disparity is a smaller depth: it is f B / (d + shift).": f_px * B_mm / (d_px - shift_px) - before,
        "This is the depth of the shift alone: subtract two depths.": f_px * B_mm / shift_px,
        "It is off by the baseline: nothing but the two depths counts.": before - after + B_mm,
    }
    question = (
        f"Dilation shifts the disparity of a face from $d$ = {d_px:g} px to {d_px + shift_px:g} px ($f$ = {f_px:g} px, "
        f"$B$ = {B_mm:g} mm). **How much nearer does the face seem, in mm?** Give a positive number."
    )
    given = {"f_px": f_px, "B_mm": B_mm, "d_px": d_px, "shift_px": shift_px}
    return Task(question, given, Number(before - after, "mm", mistakes=mistakes))


def _dilated(disparity_px: Any, size_px: int) -> Floats:
    from stereolib.matching import dilate

    return dilate(disparity_px, size_px)


def _slow_dilate(values: Any, size_px: int, pick: Any = np.fmax, fill: float = np.nan) -> Float64:
    """Dilation by moving the map over itself; another pick makes another filter."""
    reach = size_px // 2
    padded = np.pad(np.asarray(values, float), reach, constant_values=fill)
    rows, columns = np.shape(values)
    moved = [padded[v : v + rows, u : u + columns] for v in range(size_px) for u in range(size_px)]
    return np.asarray(pick.reduce(moved))


@task(
    "Write the dilation yourself",
    "write the paper's filter, with holes",
    minutes=25,
    start=(
        "def dilate_map(disparity_px, size_px):\n"
        '    """Each pixel takes the largest disparity in the square window around it; holes are NaN."""\n'
        "    ..."
    ),
    hints=(
        "Pad the map with NaN by half of the window, so that the border has neighbours as well.",
        "`np.lib.stride_tricks.sliding_window_view` gives all windows; `np.nanmax` over their axes passes over holes. "
        "A window of holes alone stays NaN.",
    ),
    points=3,
)
def _write_dilate(rng: np.random.Generator) -> Task:
    def inputs(rng: np.random.Generator) -> tuple[Any, ...]:
        values = np.round(rng.uniform(-20, 60, (12, 16)), 2)
        values[rng.random(values.shape) < 0.15] = np.nan
        values[7:, 9:] = np.nan
        return values.astype(np.float32), int(rng.choice([3, 5]))

    answer = Function(
        _dilated,
        inputs,
        rules={
            "No value may become smaller.": lambda out, d, k: bool(np.all(out[np.isfinite(d)] >= d[np.isfinite(d)])),
            "Only windows without any value stay NaN.": lambda out, d, k: bool(
                (np.isnan(out) == np.isnan(_dilated(d, k))).all()
            ),
        },
        mistakes={
            "You take the smallest value: that is erosion.": lambda d, k: _slow_dilate(d, k, np.fmin),
            "A hole spreads: np.max gives NaN where one value is NaN.": lambda d, k: _slow_dilate(d, k, np.maximum),
            "A hole counts as 0. It must take no part, since disparities may be negative.": lambda d, k: _slow_dilate(
                np.nan_to_num(d), k
            ),
            "Outside of the map there is nothing, not 0.": lambda d, k: _slow_dilate(d, k, fill=0.0),
            "The window is too small: it reaches half of size_px to either side.": lambda d, k: _dilated(d, k - 2),
            "The window is too large: size_px is its whole edge.": lambda d, k: _dilated(d, 2 * k + 1),
        },
    )
    question = (
        "**Write a function `dilate_map(disparity_px, size_px)`** that dilates a map with holes (NaN). The window is "
        "square, and its edge `size_px` is odd. It is tried on random maps."
    )
    return Task(question, {}, answer)


RECIPES = (_dilate_one, _close_one, _wider, _nearer, _write_dilate)
