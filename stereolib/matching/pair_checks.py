"""What is wrong with a pair: not rectified, exchanged, of two moments, nothing to see."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import cv2
import numpy as np

from stereolib.base import Float32, Float64, UInt8
from stereolib.matching.levels import halved
from stereolib.matching.sgbm import SGBMParams, match_pair
from stereolib.rig import check_pair, to_grey

_KEYPOINTS = 300  # at most, in each picture
_LEAST_MATCHES = 50  # that tell something of a pair's rows
_OFF_ROWS = 0.15  # of the image's height: matches whose rows differ by more are mistaken
_DOUBTFUL = 0.6  # share of unmatched pixels from which on exchanged sides are suspected
_LENS_COVERED = 6  # grey levels that 98 of 100 pixels lie within: a sensor's noise in the dark, or full white
_OFF_PLANE_PX = (6.0, 3.0, 2.0)  # from the plane through the rows' offsets, round by round
_TOGETHER_PX = 2.0  # of row offset, within which points moved together
_LEAST_MOVED, _MOST_OTHERS = 12, 1.0  # points that moved together, and mistaken ones beside each of them


Exchanged: TypeAlias = Callable[[], tuple[UInt8, UInt8]]


def check_rectified(left: UInt8, right: UInt8, limit_px: float = 1.0, *, exchanged: Exchanged | None = None) -> float:
    """Refuse a pair whose rows do not agree, or whose sides are exchanged.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
    limit_px : float
        Largest root mean square of the vertical offset, px.
    exchanged : callable, optional
        Makes the pair as it is if left and right were exchanged, each picture rectified as the other camera's; default:
        ``right, left``.

    Returns
    -------
    float
        The offset's root mean square, px; NaN where too little can be matched to tell.

    Raises
    ------
    ValueError
        If the rows differ by more than `limit_px` rms (the text tells the rms), or left and right are exchanged.
    """
    check_pair(left, right)
    a, b, off_px = _matched_points(left, right)
    kept = np.abs(off_px) < _OFF_PLANE_PX[-1]
    a, b = a[kept], b[kept]
    backward = bool(a.size) and float(np.median(a[:, 0] - b[:, 0])) < 0
    if not a.size or backward:  # else the points say already which side is which
        other = exchanged() if exchanged else (right, left)
        check_sides(to_grey(left), to_grey(right), (to_grey(other[0]), to_grey(other[1])))
    offsets = b[:, 1] - a[:, 1]
    rms = float(np.sqrt((offsets**2).mean())) if offsets.size else float("nan")
    if rms > limit_px:
        rows = f"over {offsets.size} matched points the rows differ by {rms:.1f} px rms"
        limit = f"(median {np.median(offsets):+.1f} px), at most {limit_px:g} px is allowed"
        advice = "Rectify it with its calibration (RectifiedRig.rectify)"
        sides = "; x_left - x_right is mostly negative, as if left and right were exchanged" * backward
        raise ValueError(f"the pair is not rectified: {rows} {limit}{sides}. {advice}")
    return rms


def moved_between(left: UInt8, right: UInt8) -> str:
    """Tell whether a part of a pair shows another moment: its points lie together off their rows.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        Rectified.

    Returns
    -------
    str
        What was seen, where, and what it may be; empty where nothing was. What moved along the rows alone passes for
        another depth, and nothing in a pair tells it.

    Notes
    -----
    Points of both pictures are matched by their looks. Those off the rows of all others by more than 2 px are mistaken,
    and lie at any offset, unless at least 12 of them, and most of them, have one and the same.

    Examples
    --------
    >>> noise = np.random.default_rng(0).integers(0, 256, (240, 320, 3), np.uint8)
    >>> moved_between(noise, noise)
    ''
    """
    check_pair(left, right)
    a, _, off_px = _matched_points(left, right)
    off = np.abs(off_px) > _OFF_PLANE_PX[-1]
    together = [off & (off_px >= first) & (off_px < first + _TOGETHER_PX) for first in off_px[off]]
    group = max(together, key=np.count_nonzero, default=off)
    count = int(group.sum())
    if count < _LEAST_MOVED or off.sum() - count > _MOST_OTHERS * count:
        return ""
    rows, (column, row) = float(np.median(off_px[group])), np.median(a[group], axis=0)
    where = f"{count} of {len(a)} matched points, around column {column:.0f} and row {row:.0f}"
    which = f"lie {abs(rows):.0f} px too {'low' if rows > 0 else 'high'} in right"
    return f"{where}, {which}: something moved between the two pictures, unless a pattern that repeats was mistaken"


def check_matchable(left: UInt8, right: UInt8, names: tuple[str, str] = ("left", "right")) -> None:
    """Refuse a pair in which nothing can be matched, as one picture shows nothing.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
    names : (str, str)
        What the message calls the two.

    Raises
    ------
    ValueError
        If one is of a single grey value or little more, or they are no pair.

    Examples
    --------
    >>> check_matchable(np.zeros((4, 4), np.uint8), np.eye(4, dtype=np.uint8) * 255)
    Traceback (most recent call last):
    ...
    ValueError: left has one grey value, 0: there is nothing to match; take it again, the lens free
    """
    check_pair(left, right, names)
    only = {name: _only_greys(i) for name, i in zip(names, (left, right), strict=True)}
    if blind := [f"{name} has {greys}" for name, greys in only.items() if greys]:
        why = "there is nothing to match; take it again, the lens free"
        raise ValueError(f"{' and '.join(blind)}: {why}")


def is_doubtful(disparity_px: Float32) -> bool:
    """Tell whether so little was matched that `check_sides` should look at the pair.

    Parameters
    ----------
    disparity_px : (H, W) float32, px
        NaN where nothing was matched.

    Returns
    -------
    bool

    Examples
    --------
    >>> is_doubtful(np.array([[np.nan, np.nan, 4.0]], np.float32))
    True
    """
    return float(np.isnan(disparity_px).mean()) > _DOUBTFUL


def check_sides(left: UInt8, right: UInt8, exchanged: tuple[UInt8, UInt8] | None = None) -> None:
    """Refuse a pair that matches clearly better the other way round; looked at in half size.

    Parameters
    ----------
    left, right : (H, W) uint8
    exchanged : pair of (H, W) uint8, optional
        The pair the other way round, where each picture is rectified as the other camera's; default: ``right, left``.

    Raises
    ------
    ValueError
        If left and right are exchanged.
    """
    ways = [[halved(image) for image in way] for way in ((left, right), exchanged or (right, left))]
    width = ways[0][0].shape[1]
    params = SGBMParams(num_disparities=max(16, width // 5 // 16 * 16))
    if width < 2 * params.num_disparities:
        return  # too narrow to tell
    matched = [np.isfinite(match_pair(a, b, params)).mean() for a, b in ways]
    if matched[1] > max(0.3, 2 * matched[0]):  # chance matches in noise prove nothing
        why = "matches run the other way (x_left - x_right is negative); swap the images"
        unless = "unless both cameras hang upside down (turn the pictures by 180 degrees) or mirror (switch it off)"
        raise ValueError(f"left and right are exchanged: {why}, {unless}")


def _only_greys(image: UInt8) -> str:
    """The grey values of a picture that shows nothing; empty of others."""
    grey = to_grey(image)
    low, high = (int(value) for value in np.percentile(grey, (1, 99)))
    if high - low >= _LENS_COVERED:
        return ""
    return f"one grey value, {low}" if np.ptp(grey) == 0 else f"grey values from {low} to {high} alone"


def _matched_points(left: UInt8, right: UInt8) -> tuple[Float64, Float64, Float64]:
    """Points (n, 2) of the left and of the right picture that look alike, px, and how far each is off its row, (n,) px.

    SIFT keypoints of the pictures in half size, matched both ways. The rows' offset changes slowly over the image: a
    plane through it, fitted three times over, is what the rows are; matches further than 2 px from it are mistaken, or
    moved. Too few on the plane are none at all.
    """
    sift, none = cv2.SIFT.create(nfeatures=_KEYPOINTS), (np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
    points, looks = zip(*(sift.detectAndCompute(halved(to_grey(i)), None) for i in (left, right)), strict=True)
    if min(map(len, points)) < _LEAST_MATCHES:
        return none
    pairs = cv2.BFMatcher(cv2.NORM_L2, crossCheck=True).match(*looks)
    a = 2 * np.array([points[0][pair.queryIdx].pt for pair in pairs])
    b = 2 * np.array([points[1][pair.trainIdx].pt for pair in pairs])
    offset, likely = b[:, 1] - a[:, 1], np.abs(b[:, 1] - a[:, 1]) < _OFF_ROWS * left.shape[0]
    at = np.column_stack([np.ones(len(a)), a / left.shape[1]])
    plane = np.array([np.median(offset[likely]) if likely.any() else 0.0, 0.0, 0.0])
    for limit in _OFF_PLANE_PX:
        kept = likely & (np.abs(offset - at @ plane) < limit)
        if kept.sum() < max(_LEAST_MATCHES, 0.2 * likely.sum()):
            return none  # chance matches prove nothing
        plane = np.linalg.lstsq(at[kept], offset[kept], rcond=None)[0]
    return a[likely], b[likely], (offset - at @ plane)[likely]
