"""What notebook 03 holds against the paper's conclusions on matching."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from stereolib.base import Bools, Floats
from stereolib.matching import KnownView, Score, disparity_to_depth, score
from stereolib.rig import RectifiedRig

#: A map with up to so many bad pixels serves, %; so many points more or less decide (`matching.smallest_window`'s too).
SERVES_PCT = 5.0


def disparities_fall(distances_mm: Sequence[float], windows_px: Sequence[float]) -> dict[str, float]:
    """By how much the disparities needed fall as an object moves away, and whether that is a trend.

    Parameters
    ----------
    distances_mm : (N,) float, mm
    windows_px : (N,) float, px
        The smallest window that works at each, as of `matching.smallest_window`.

    Returns
    -------
    dict
        ``falls_px``: from the nearest distance to the farthest; ``rank``: Spearman's rank correlation of window and
        distance, 0 if all windows are alike.

    Examples
    --------
    >>> disparities_fall([500, 700, 1000], [160, 112, 80])
    {'falls_px': 80.0, 'rank': -1.0}
    """
    from scipy.stats import rankdata

    order = np.argsort(distances_mm)
    windows = np.asarray(windows_px, float)[order]
    place, height = np.arange(len(windows)) - (len(windows) - 1) / 2, rankdata(windows)
    height -= height.mean()
    spread = np.sqrt((place**2).sum() * (height**2).sum())
    rank = place @ height / spread if spread else 0.0
    return {"falls_px": float(windows[0] - windows[-1]), "rank": float(rank)}


def relative_depth(view: KnownView, relative_px: Floats, expected_px: Floats) -> dict[str, float]:
    """What is lost when the laser's distance stands in for the matcher's absolute one.

    Parameters
    ----------
    view : KnownView
        With the regions ``"cube"`` and ``"edge"``.
    relative_px : (H, W) float, px
        A map that is right but for an offset that nobody knows.
    expected_px : (H, W) float, px
        What the laser leads to expect, `matching.ExpectedDisparity.near_px`.

    Returns
    -------
    dict
        ``lengths_pct``: the offset is taken from the laser at the edge; by how many per cent lengths on the cube then
        are off in the median, ``100 |Z / Z_true - 1|`` (lengths are pixels times Z / f).
    """
    cube, edge = view.regions["cube"], view.regions["edge"]
    anchored = relative_px - np.nanmedian((relative_px - expected_px)[edge])
    off = np.abs(np.asarray(view.truth_px)[cube] / anchored[cube] - 1)
    return {"lengths_pct": 100 * float(np.nanmedian(off))}


def cut_window(views: Sequence[KnownView], wide_px: Sequence[Floats], narrow_px: Sequence[Floats]) -> dict[str, float]:
    """What it costs on the object to search only between the laser's two depths.

    Parameters
    ----------
    views : sequence of KnownView
        With the region ``"cube"``.
    wide_px, narrow_px : sequence of (H, W) float, px
        Their disparity by a window that holds the cube in all of them, and by the one cut to the laser's depths.

    Returns
    -------
    dict
        ``points``: bad pixels of the cube by the narrow window less those by the wide one, in the worst view, points.
    """
    cubes = [(view.truth_px, view.regions["cube"]) for view in views]
    wide, narrow = ([score(d, *at) for d, at in zip(some, cubes, strict=True)] for some in (wide_px, narrow_px))
    return {"points": max(points_lost(*both)["points"] for both in zip(wide, narrow, strict=True))}


def block_choice(
    good_light: Mapping[str, Sequence[float]], dim_light: Mapping[str, Sequence[float]]
) -> dict[str, float]:
    """What it costs to take the block that another texture asks for.

    Parameters
    ----------
    good_light, dim_light : mapping of texture to (blocks,) float, %
        Bad pixels with each block, from the smallest to the largest.

    Returns
    -------
    dict
        ``good_light_points``, ``dim_light_points``: the block that a texture asks for is the smallest with at most
        `SERVES_PCT` points more bad pixels than its best one; of all pairs of textures the most that one loses with
        the other's block, points.

    Examples
    --------
    >>> block_choice({"fine": [0, 0]}, {"fine": [2, 1], "coarse": [40, 10]})
    {'good_light_points': 0.0, 'dim_light_points': 30.0}
    """

    def dearest(bad_pct: Mapping[str, Sequence[float]]) -> float:
        bad = np.array(list(bad_pct.values()), float)
        above = bad - bad.min(axis=1, keepdims=True)
        asked = (above <= SERVES_PCT).argmax(axis=1)
        return float((bad[:, asked] - np.diag(bad[:, asked])[:, None]).max())

    return {"good_light_points": dearest(good_light), "dim_light_points": dearest(dim_light)}


def points_lost(better: Score, worse: Score) -> dict[str, float]:
    """How many points of a hundred more bad pixels one map has than another.

    Parameters
    ----------
    better, worse : Score
        Of the same pixels; which is better is the claim.

    Returns
    -------
    dict
        ``points``: difference of the two `bad2_pct`.
    """
    return {"points": worse.bad2_pct - better.bad2_pct}


def one_colour(by_contrast: Mapping[float, Score], faint: float = 0.05) -> dict[str, float]:
    """How many points more bad pixels an object of one colour has than the one of the strongest texture.

    Parameters
    ----------
    by_contrast : mapping of the texture's contrast to Score
        With no contrast at all (0) and with a faint one.
    faint : float
        Its contrast.

    Returns
    -------
    dict
        ``none_points``, ``faint_points``: difference of the `bad2_pct`.
    """
    textured = by_contrast[max(by_contrast)]
    lost = {"none_points": by_contrast[0.0], "faint_points": by_contrast[faint]}
    return {name: points_lost(textured, worse)["points"] for name, worse in lost.items()}


def surfaces_gain(objects: Sequence[Score], floors: Sequence[Score]) -> dict[str, float]:
    """What the recommended surfaces gain over others.

    Parameters
    ----------
    objects, floors : sequence of Score
        Of the matt, textured object or floor, then of others in its place.

    Returns
    -------
    dict
        ``object_points``, ``floor_points``: bad pixels more with the best of the others, points.

    Examples
    --------
    >>> good, bad = score([[5.0, 5.0]], [[5.0, 5.0]]), score([[5.0, 9.0]], [[5.0, 5.0]])
    >>> surfaces_gain([good, bad, bad], [bad, good])
    {'object_points': 50.0, 'floor_points': -50.0}
    """
    gains = (min(o.bad2_pct for o in others) - first.bad2_pct for first, *others in (objects, floors))
    return dict(zip(("object_points", "floor_points"), gains, strict=True))


def factors_of_fig4(on_cube: Mapping[str, Score]) -> dict[str, float]:
    """What texture and light each change on the cube of Fig. 4.

    Parameters
    ----------
    on_cube : mapping of condition to Score
        With ``"texture"`` (in good light), ``"plain"`` and ``"poor_light"``.

    Returns
    -------
    dict
        ``texture_points``, ``light_points``: bad pixels more without the one, without the other.
    """
    best = on_cube["texture"]
    lost = {"texture_points": on_cube["plain"], "light_points": on_cube["poor_light"]}
    return {name: points_lost(best, worse)["points"] for name, worse in lost.items()}


def captions_of_fig4(printed: str) -> dict[str, int]:
    """Count what the captions of Fig. 4 tell apart.

    Parameters
    ----------
    printed : str
        Label and content of each caption, ``"4(a) texture, good light; 4(b) ..."``.

    Returns
    -------
    dict
        ``labels``: different labels; ``contents``: different contents.

    Examples
    --------
    >>> captions_of_fig4("4(a) light; 4(b) dark; 4(b) light")
    {'labels': 2, 'contents': 2}
    """
    captions = re.findall(r"4\((\w)\) ([^;]+)", printed)
    return {"labels": len({label for label, _ in captions}), "contents": len({content for _, content in captions})}


def share_within_cm(
    disparity_px: Floats, truth_mm: Floats, on_object: Bools, rectified: RectifiedRig, tolerance_mm: float = 10.0
) -> float:
    """How much of an object a map gives right to a centimetre, the unit in which the paper measures.

    Parameters
    ----------
    disparity_px : (H, W) float, px
    truth_mm : (H, W) float, mm
        True depth.
    on_object : (H, W) bool
        All of it that the left camera sees, seen by the right one or not.
    rectified : RectifiedRig
    tolerance_mm : float, mm

    Returns
    -------
    float, %
        NaN if the object touches the picture's border: part of it may be cut off.
    """
    if on_object[[0, -1]].any() or on_object[:, [0, -1]].any():
        return float("nan")
    depth = disparity_to_depth(disparity_px, rectified.f_px, rectified.baseline_mm)
    return 100 * float((np.abs(depth - truth_mm)[on_object] <= tolerance_mm).mean())


def recommended_distance(shares_pct: Mapping[float, float], recommended_cm: float = 75) -> dict[str, float]:
    """How the recommended distance compares with the best one and with the farthest.

    Parameters
    ----------
    shares_pct : mapping of cm to %
        `share_within_cm` over the distance; NaN where the object is cut.
    recommended_cm : float, cm
        One of them.

    Returns
    -------
    dict
        ``behind_points``: the best distance's share less the recommended one's; ``farther_points``: the recommended
        one's less that of the farthest distance.

    Examples
    --------
    >>> recommended_distance({50: 80.0, 75: 99.0, 100: 90.0})
    {'behind_points': 0.0, 'farther_points': 9.0}
    """
    shares = {cm: np.nan_to_num(share) for cm, share in shares_pct.items()}
    there = shares[recommended_cm]
    return {
        "behind_points": float(max(shares.values()) - there),
        "farther_points": float(there - shares[max(shares)]),
    }


def nearest_that_serves_cm(shares_pct: Mapping[float, float]) -> float:
    """The nearest distance at which at most 5 % of an object are missing or wrong.

    Parameters
    ----------
    shares_pct : mapping of cm to %
        As for `recommended_distance`.

    Returns
    -------
    float, cm
        NaN if none serves.

    Examples
    --------
    >>> nearest_that_serves_cm({50: 80.0, 55: 96.0, 60: 99.0})
    55.0
    """
    serving = [cm for cm, share in shares_pct.items() if share >= 100 - SERVES_PCT]
    return float(min(serving)) if serving else float("nan")


def distance_over_scale(shares_pct: Mapping[float, Mapping[float, float]]) -> dict[str, float]:
    """By how much the nearest distance that serves grows with the object.

    Parameters
    ----------
    shares_pct : mapping of edge in cm to a mapping of distance in cm to %
        `share_within_cm` of cubes of several sizes.

    Returns
    -------
    dict
        ``rises_cm``: from the smallest cube to the largest.
    """
    nearest = {cm: nearest_that_serves_cm(shares) for cm, shares in shares_pct.items()}
    return {"rises_cm": nearest[max(nearest)] - nearest[min(nearest)]}
