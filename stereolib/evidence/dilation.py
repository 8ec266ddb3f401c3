"""What notebook 04 holds against the paper's claims on dilation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from stereolib.base import Bools, Floats
from stereolib.matching import Score, median_filter, score

_WRONG_PX = 2.0  # as bad-2 has it; also by how much a pixel deviates from those around it
_WORDS = {"hole": "hole", "below": "speck, too far", "above": "speck, too near", "alike": "patch"}


def noise_left(
    before_px: Mapping[str, Sequence[Floats]],
    after_px: Mapping[str, Sequence[Floats]],
    truth_px: Floats,
    where: Bools,
) -> dict[str, float]:
    """What a filter leaves of the bad pixels of some maps.

    Parameters
    ----------
    before_px, after_px : mapping of condition to sequence of (H, W) float, px
        Maps before and after the filter, in one order.
    truth_px : (H, W) float, px
    where : (H, W) bool
        Pixels to count over.

    Returns
    -------
    dict
        ``<condition>_pct``: the bad-2 of its maps after, in % of that before.
    """
    left = {}
    for name, before in before_px.items():
        bad = [sum(score(d, truth_px, where).bad2_pct for d in some) for some in (before, after_px[name])]
        left[f"{name}_pct"] = 100 * bad[1] / bad[0]
    return left


def plant_specks(
    truth_px: Floats, on_object: Bools, step_px: float, *, size_px: int = 3, every_px: int = 25
) -> tuple[Floats, Bools]:
    """Plant square specks into a perfect map, in a grid, well inside an object.

    Parameters
    ----------
    truth_px : (H, W) float, px
    on_object : (H, W) bool
    step_px : float, px
        By how much they stand out; NaN makes holes.
    size_px : int
        Their edge.
    every_px : int
        From one to the next; they keep half of it from the object's border.

    Returns
    -------
    map_px : (H, W) float
    planted : (H, W) bool
    """
    planted, margin = np.zeros(on_object.shape, bool), every_px // 2
    for row in range(margin, on_object.shape[0] - margin, every_px):
        for column in range(margin, on_object.shape[1] - margin, every_px):
            around = on_object[row - margin : row + margin + 1, column - margin : column + margin + 1]
            planted[row : row + size_px, column : column + size_px] = around.all()
    return np.where(planted, truth_px + step_px, truth_px), planted


def noise_kinds(disparity_px: Floats, truth_px: Floats, where: Bools, size_px: int = 9) -> dict[str, Bools]:
    """Sort the bad pixels of a map by how they stand to those around them.

    Parameters
    ----------
    disparity_px, truth_px : (H, W) float, px
    where : (H, W) bool
        Pixels to look at.
    size_px : int
        Odd edge of the window whose valid pixels' median is "around".

    Returns
    -------
    dict of (H, W) bool
        ``"hole"``; of the wrong ones (by more than 2 px) ``"below"`` and ``"above"`` what is around by more than 2 px,
        and ``"alike"``: wrong together with what is around.
    """
    around = median_filter(disparity_px, size_px)
    with np.errstate(invalid="ignore"):
        wrong = where & (np.abs(disparity_px - truth_px) > _WRONG_PX)
        below, above = wrong & (disparity_px < around - _WRONG_PX), wrong & (disparity_px > around + _WRONG_PX)
    hole = where & np.isnan(disparity_px) & np.isfinite(truth_px)
    return {"hole": hole, "below": below, "above": above, "alike": wrong & ~below & ~above}


def kind_shares(kinds: Mapping[str, Bools]) -> dict[str, float]:
    """What the bad pixels of a map are, in words.

    Parameters
    ----------
    kinds : mapping of str to (H, W) bool
        From `noise_kinds`.

    Returns
    -------
    dict of str to float, %
        A speck is ``"too far"`` if it is below what is around it; a ``"patch"`` is wrong together with that.

    Examples
    --------
    >>> kind_shares({"hole": np.array([True] * 3), "below": ~np.zeros(1, bool), "above": ~np.ones(1, bool)})
    {'hole': 75.0, 'speck, too far': 25.0, 'speck, too near': 0.0}
    """
    every = sum(int(mask.sum()) for mask in kinds.values())
    return {_WORDS[kind]: 100 * int(mask.sum()) / every for kind, mask in kinds.items()}


def right_pct(disparity_px: Floats, truth_px: Floats, where: Bools) -> float:
    """Share of some pixels that are right within 2 px.

    Parameters
    ----------
    disparity_px, truth_px : (..., H, W) float, px
        NaN is not right.
    where : (..., H, W) bool

    Returns
    -------
    float, %
        NaN if there are none.

    Examples
    --------
    >>> right_pct(np.array([[5.0, 9.0, np.nan, 5.0]]), np.full((1, 4), 5.0), np.ones((1, 4), bool))
    50.0
    """
    with np.errstate(invalid="ignore"):
        right = np.abs(disparity_px - truth_px)[where] <= _WRONG_PX
    return 100 * float(right.mean()) if right.size else float("nan")


def filled_out(
    found: Mapping[str, Mapping[str, Bools]], after_px: Mapping[str, Floats], truth_px: Floats
) -> dict[str, float]:
    """Whether a filter fills out the pixels that deviate from those around them.

    Parameters
    ----------
    found : mapping of condition to `noise_kinds`
        Of the matcher's maps before the filter.
    after_px : mapping of condition to (H, W) float, px
        Some of these maps after it.
    truth_px : (H, W) float, px

    Returns
    -------
    dict
        ``deviating_pct``: share of the bad pixels of all maps that are holes, below or above what is around;
        ``<condition>_pct``: of those of one map, the share that is right afterwards.
    """
    deviating = {name: kinds["hole"] | kinds["below"] | kinds["above"] for name, kinds in found.items()}
    count = sum(int(mask.sum()) for mask in deviating.values())
    alike = sum(int(kinds["alike"].sum()) for kinds in found.values())
    right = {f"{name}_pct": right_pct(after, truth_px, deviating[name]) for name, after in after_px.items()}
    return {"deviating_pct": 100 * count / (count + alike)} | right


def behind_exposures(
    matched: Mapping[str, Score], filtered: Mapping[str, Score], averaged: Mapping[str, Score]
) -> dict[str, float]:
    """What a filter leaves beside the mean of several exposures.

    Parameters
    ----------
    matched, filtered, averaged : mapping of light to Score
        Of one exposure as matched, of the same filtered, and of the mean of several.

    Returns
    -------
    dict
        ``<light>_points``: bad pixels that the filter leaves more than the mean does, points; then
        ``<light>_gain_points``: what it takes off the exposure as matched.

    Examples
    --------
    >>> one, mean = score([[5.0, 9.0]], [[5.0, 5.0]]), score([[5.0, 5.0]], [[5.0, 5.0]])
    >>> behind_exposures({"dim": one}, {"dim": one}, {"dim": mean})
    {'dim_points': 50.0, 'dim_gain_points': 0.0}
    """
    behind = {f"{light}_points": one.bad2_pct - averaged[light].bad2_pct for light, one in filtered.items()}
    return behind | {f"{light}_gain_points": matched[light].bad2_pct - one.bad2_pct for light, one in filtered.items()}


def pixels_unlike(one: Floats, other: Floats) -> dict[str, float]:
    """Count the pixels in which two maps differ.

    Parameters
    ----------
    one, other : (H, W) float

    Returns
    -------
    dict
        ``unlike_px``.

    Examples
    --------
    >>> pixels_unlike(np.array([1.0, 2.0]), np.array([1.0, 3.0]))
    {'unlike_px': 1}
    """
    return {"unlike_px": int((one != other).sum())}
