"""What the sliders about matching and its filters draw (notebooks 03, 04, 09 to 11)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from stereolib import paper
from stereolib.base import Bools, Float64, Floats, Ints, UInt8
from stereolib.laser import AveragedScan
from stereolib.matching import (
    FilterCase,
    KnownView,
    SGBMParams,
    compute_disparity,
    compute_disparity_guided,
    expected_disparity,
    pixel_cost,
    score,
    score_repair,
    smooth,
)
from stereolib.measurement import Instrument


def draw_paths(
    sums: Callable[[int, int], Floats | Ints], truth_px: Floats, row: int, column: int, P1: int, P2: int
) -> tuple[UInt8, str]:
    """Notebook 03: one pixel's costs and its row's, summed along paths at other prices.

    Parameters
    ----------
    sums : callable
        Takes P1 and P2, returns the sums of a strip of pictures, (H, W, D), for the disparities 0, 1, 2, ...
    truth_px : (H, W) float, px
        True disparity of the strip, NaN where it is not asked for.
    row, column : int, px
        The pixel, in the strip.
    P1 : int
        Price of a step by one disparity from a pixel to the next.
    P2 : int
        Price of a larger step.

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    from stereolib.plotting import figure_to_image, panels, plot_pixel_cost, plot_row_cost

    volume = sums(P1, P2)
    figure, axes = panels(2, width_in=7, aspect=0.66, width_ratios=(1, 1.6))
    plot_pixel_cost(volume[row, column], truth_px[row, column], axes[0], f"pixel in column {column}")
    plot_row_cost(volume[row], truth_px[row], axes[1], f"its row, P1 = {P1}, P2 = {P2}")
    axes[1].axvline(column, color="0.5", lw=0.8)
    found, count = volume.argmin(axis=-1), volume.shape[-1]
    quality = score(found[:, count:], truth_px[:, count:])
    cheapest = f"cheapest at {found[row, column]} px, true {truth_px[row, column]:.1f} px"
    return figure_to_image(figure), f"{cheapest}; bad 2 in the strip: {quality.bad2_pct:.1f} %"


def draw_guided(distance_mm: int, margin_px: int, laser_off_mm: int) -> tuple[UInt8, str]:
    """Notebook 10: the cube matched around what the laser leads one to expect.

    Parameters
    ----------
    distance_mm : int
        To the cube: 500 to 1000, in hundreds.
    margin_px : int
        Searched to either side of the expectation.
    laser_off_mm : int
        By how much farther forward the laser is believed to stand than it does.

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    from stereolib.plotting import color_disparity
    from stereolib.virtual import recordings

    view, scan = _before_laser(distance_mm)
    believed = (float(laser_off_mm), 0.0, 0.0)
    expected = expected_disparity(scan, recordings.rectified(), recordings.setup(), believed)
    found = compute_disparity_guided(view.left, view.right, expected, margin_px=margin_px)
    quality = score(found, view.truth_px, view.regions["cube"])
    text = f"{2 * margin_px} disparities searched; bad 2 on the cube: {quality.bad2_pct:.1f} %"
    return np.hstack([color_disparity(expected.near_px, 0, 160), color_disparity(found, 0, 160)]), text


def draw_prices(P1: int, P2: int, condition: str = "texture", column: int = 330, row: int = 250) -> tuple[UInt8, str]:
    """Baked chapter 03: a map of OpenCV's matcher at other prices, and what each disparity costs one of its pixels.

    Parameters
    ----------
    P1 : int
        Price of a step by one disparity, for each pixel of the block; slanted surfaces pay it.
    P2 : int
        Price of a larger step, for each pixel of the block; edges pay it. It must be above P1.
    condition : str
        Which recording.
    column, row : int
        The pixel (px).

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    from stereolib.plotting import OURS, TRUTH, color_disparity, figure_to_image, panels

    _check_prices(P1, P2)
    left, right, truth_px, cube = _condition(condition)
    params = SGBMParams(128, p1=25 * P1, p2=25 * P2)
    found = compute_disparity(left, right, params)
    cost, true_px = pixel_cost(left, right, (column, row), params), truth_px[row, column]
    figure, axes = panels(1, 2, width_in=4.5, aspect=0.75)
    axes[0].imshow(color_disparity(found, 0, 160)[..., ::-1])
    axes[0].plot(column, row, "o", mfc="none", mec="white", ms=10, mew=2)
    axes[0].set(title=f"disparity, P1 = {P1}, P2 = {P2}", xlabel="column (px)", ylabel="row (px)")
    curves = (cost.matching, "0.5", "the blocks alone"), (cost.summed, OURS, "with the paths' sums")
    for values, color, name in curves:
        scaled = (values - values.min()) / max(1, np.ptp(values))
        axes[1].plot(cost.disparities_px, scaled, color=color, label=name)
    axes[1].axvline(true_px, color=TRUTH, ls="--", label="true disparity")
    axes[1].plot(cost.best_px, 0, "o", color=OURS)
    axes[1].set(title="costs of the ringed pixel", xlabel="disparity (px)", ylabel="cost (least 0, most 1)")
    axes[1].set_ylim(-0.05, 1.35)
    axes[1].legend(loc="upper center", ncols=2, fontsize=8)
    quality = score(found, truth_px, cube)
    text = f"bad 2 on the cube: {quality.bad2_pct:.1f} %; matched: {quality.density_pct:.0f} %; "
    return figure_to_image(figure), text + f"the ringed pixel is cheapest at {cost.best_px} px, true {true_px:.1f} px"


def draw_sgbm(
    condition: str, num_disparities: int, block_size: int, uniqueness_ratio: int, P1: int = 8, P2: int = 32
) -> tuple[UInt8, str]:
    """Notebook 03: one of Fig. 4's recordings, matched; bad settings are refused with the library's own words.

    Parameters
    ----------
    condition : str
        Which recording.
    num_disparities : int
        How many disparities are searched; so many columns at the left have no match.
    block_size : int
        Edge of the compared blocks (px); large ones blur edges.
    uniqueness_ratio : int
        By how much (%) the best match must beat the second.
    P1 : int
        Price of a step by one disparity, for each pixel of the block; slanted surfaces pay it.
    P2 : int
        Price of a larger step, for each pixel of the block; edges pay it. It must be above P1.

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    left, right, disparity_px, cube = _condition(condition)
    _check_prices(P1, P2)
    area = block_size**2
    params = SGBMParams(num_disparities, block_size, p1=P1 * area, p2=P2 * area, uniqueness_ratio=uniqueness_ratio)
    disparity = compute_disparity(left, right, params)
    quality = score(disparity, disparity_px, cube)
    text = f"bad 2 on the cube: {quality.bad2_pct:.1f} %; matched: {quality.density_pct:.0f} %; "
    return _picture_and_map(left, disparity, 128), text + f"columns lost at the left: {num_disparities}"


def draw_surface(distance_mm: float, contrast: float, scale_mm: float, light: float) -> tuple[UInt8, str]:
    """Notebook 03: the cube rendered and matched, one ray a pixel; only a new scene is rendered again.

    Parameters
    ----------
    distance_mm : float
        From the camera to the cube's near edge.
    contrast : float
        Of the cube's texture; 0 is a plain cube, which no matcher can match.
    scale_mm : float
        Size of the texture's spots.
    light : float
        Share of a well-lit room's; 0.012 is the paper's poor light.

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    from stereolib import virtual
    from stereolib.virtual import recordings

    lights, disparity_px, cube = _surface(distance_mm, contrast, scale_mm)
    rng, webcam = np.random.default_rng(4), virtual.Webcam()
    left, right = recordings.rectified().rectify(*(webcam.shoot(light * view, rng) for view in lights))
    disparity = compute_disparity(left, right, SGBMParams(192), whole=True)
    quality = score(disparity, disparity_px, cube)
    text = f"largest disparity of the cube {disparity_px[cube].max():.1f} px; "
    text += f"bad 2: {quality.bad2_pct:.1f} %; matched: {quality.density_pct:.0f} %"
    return _picture_and_map(left, disparity, 192), text


def _picture_and_map(left: UInt8, disparity_px: Floats, high: float) -> UInt8:
    """A left picture beside its disparity map, whose colours end at `high`."""
    from stereolib.plotting import figure_to_image, panels, plot_disparity, plot_image

    figure, axes = panels(2, width_in=7, aspect=0.75)
    plot_image(left, axes[0], "left picture")
    plot_disparity(disparity_px, axes[1], "its disparity map", high=high).axes.set_ylabel("")
    return figure_to_image(figure)


def draw_dilation(condition: str, method: str, size_px: int, with_truth: bool = True) -> tuple[UInt8, str]:
    """Notebook 04: the truth, one of Fig. 4's maps, and what a filter makes of it, with the errors on the cube.

    Parameters
    ----------
    condition : str
        Which recording.
    method : str
        Which filter.
    size_px : int
        Edge of the filter's window.
    with_truth : bool
        Whether the true map stands beside the others.

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    from stereolib.plotting import figure_to_image, plot_repairs

    left, _, truth_px, cube = _condition(condition)
    before, right_px = _both_maps(condition)
    after = smooth(before, method, size_px=size_px, image=left, right_px=right_px)
    done = score_repair(before, after, truth_px, cube)
    left_pct = score(after, truth_px, cube).bad2_pct
    text = f"wrong or missing: {left_pct:.1f} % of the cube; of its holes ({done.holes_pct:.0f} %) "
    text += f"{done.filled_pct:.0f} % are filled, {done.wrong2_pct:.0f} % of them wrongly; "
    text += f"good pixels move by {done.shift_px:+.2f} px"
    part = slice(90, 470), slice(118, 560)
    maps_px = {"as matched": before, method: after}
    figure = plot_repairs(maps_px, truth_px, cube, part, columns=len(maps_px) + with_truth, with_truth=with_truth)
    figure.set_dpi(110)
    return figure_to_image(figure), text


def draw_motorcycle(num_disparities: int, block_size: int, uniqueness_ratio: int) -> tuple[UInt8, str]:
    """Notebook 09: the real pair, matched.

    Parameters
    ----------
    num_disparities : int
        How many disparities are searched; near parts need many.
    block_size : int
        Edge of the compared blocks (px); large ones make near things wider.
    uniqueness_ratio : int
        By how much (%) the best match must beat the second.

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    from skimage.data import stereo_motorcycle

    from stereolib.plotting import color_disparity

    load: Any = stereo_motorcycle
    left, right, truth = load()
    left, right = left[..., ::-1].copy(), right[..., ::-1].copy()
    params = SGBMParams(num_disparities, block_size, uniqueness_ratio=uniqueness_ratio)
    disparity = compute_disparity(left, right, params, whole=True)
    quality = score(disparity, np.where(np.isfinite(truth), truth, np.nan))
    text = f"bad-2: {quality.bad2_pct:.1f} % of the pixels; returned: {quality.density_pct:.0f} % of the pixels"
    return np.hstack([left, color_disparity(disparity, 0, 70)]), text


def draw_own_pair(
    pair: tuple[UInt8, UInt8], instrument: Instrument, num_disparities: int, block_size: int, uniqueness_ratio: int
) -> tuple[UInt8, str]:
    """Notebook 11: an own pair, matched by the paper's matcher; near is bright.

    Parameters
    ----------
    pair : (left, right), (H, W, 3) uint8
        Rectified.
    instrument : Instrument
    num_disparities : int
        How many disparities are searched; near parts need many.
    block_size : int
        Edge of the compared blocks (px); large ones fill bare walls and blur edges.
    uniqueness_ratio : int
        By how much (%) the best match must beat the second.

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    from stereolib.plotting import color_disparity

    params = SGBMParams(num_disparities, block_size, uniqueness_ratio=uniqueness_ratio)
    disparity = compute_disparity(*pair, params, whole=True)
    rectified, matched = instrument.rectified, np.isfinite(disparity)
    nearest_mm = rectified.f_px * rectified.baseline_mm / (num_disparities - 1)  # the last one tried
    text = f"{100 * matched.mean():.0f} % of the pixels matched; nothing nearer than {nearest_mm:.0f} mm can be matched"
    return np.hstack([pair[0], color_disparity(disparity, 0, num_disparities)]), text


def _check_prices(P1: int, P2: int) -> None:
    """Refuse in the sliders' own numbers what the matcher would refuse in those of a whole block."""
    if not P1 < P2:
        raise ValueError(f"P2, the price of a larger step, must be above P1, got P1 {P1} and P2 {P2}")


@lru_cache(maxsize=4)
def _condition(name: str) -> tuple[UInt8, UInt8, Floats, Bools]:
    """Rectified pair of a condition of Fig. 4, true disparity, and the cube's pixels that both cameras see."""
    from stereolib.virtual import recordings

    left, right = recordings.rectified().rectify(*recordings.load_pair(f"conditions/{name}"))
    truth = recordings.load_truth(f"conditions/{name}")
    return left, right, truth.disparity_px, truth.visible & (truth.box == 1)


@lru_cache(maxsize=4)
def _both_maps(name: str) -> tuple[Floats, Floats]:
    """Disparity of both views of a condition of Fig. 4."""
    left, right, disparity_px, cube = _condition(name)
    both = FilterCase.from_pair((left, right), disparity_px, cube, cube)
    return both.left_px, both.right_px


@lru_cache(maxsize=6)
def _before_laser(distance_mm: int) -> tuple[KnownView, AveragedScan]:
    """The recorded cube of medium texture at a distance, and what the laser saw of it."""
    from stereolib.virtual import recordings

    view = recordings.view(f"series/medium_{distance_mm}")
    return view, recordings.scan(view.name)


@lru_cache(maxsize=2)
def _surface(distance_mm: float, contrast: float, scale_mm: float) -> tuple[tuple[Float64, Float64], Floats, Bools]:
    """Light that reaches both cameras from a textured cube, true disparity, and the cube's visible pixels."""
    from stereolib import virtual
    from stereolib.virtual import recordings

    surface = replace(virtual.CUBE_SURFACE, contrast=contrast, scale_mm=scale_mm)
    cube = virtual.cube_scene(distance_mm, cube=surface)
    lights = virtual.render_pair(cube, paper.paper_rig(), recordings.setup(), samples=1, light_samples=1)
    truth = virtual.render_truth(cube, recordings.rectified(), recordings.setup())
    return lights, truth.disparity_px, truth.visible & (truth.box == 1)
