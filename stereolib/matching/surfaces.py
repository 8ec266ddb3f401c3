"""Pixels beside steps go to the surface, in front or behind, whose colour they have."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from stereolib.base import Bools, Float32, Ints, UInt8
from stereolib.matching.compiled import compiled

STEP_PX = 2.0  # neighbours farther apart are two surfaces
_BESIDE_PX = 2  # so near a step a disparity is not trusted
_APART_PX, _GAP_PX = 3.0, 1.5  # surfaces nearer to each other, or with a smaller gap between, are taken for one
_GAP_SHARE = 0.52  # of all that disparities differ by around: between places, a single slope leaves up to a half of it
_REACH_PX, _EVERY_PX = 10, 5  # rows and columns around a pixel that are looked at
_LEAST = 0.01  # pixels of the same colour, so that none is no proof


class Surfaces(NamedTuple):
    """A map whose pixels beside steps were asked anew which surface they belong to.

    Parameters
    ----------
    disparity_px : (H, W) float32, px
    moved : (H, W) bool
        Pixels that were given to the other surface.
    """

    disparity_px: Float32
    moved: Bools


def choose_surface(
    disparity_px: Float32, kept: Bools, left: UInt8, *, unlike: float = 8.0, sure: float = 3.0
) -> Surfaces:
    """Give pixels beside steps, and those of holes, to the surface nearby that has their colour.

    Matching makes near surfaces too wide where the one behind is hidden from the other camera: what was matched goes
    back if at all. What fills a hole goes on in its row whatever it shows: it goes either way.

    Parameters
    ----------
    disparity_px : (H, W) float32, px
        Without holes.
    kept : (H, W) bool
        Where it was matched and not filled.
    left : (H, W) or (H, W, 3) uint8
        The rectified left picture.
    unlike : float
        Grey levels, root mean square of the channels: colours that differ by so much are hardly one.
    sure : float
        Logarithm of how many times more the other surface has to speak for itself. Both were chosen on virtual scenes
        by `benchmarks/choose_best.py`.

    Returns
    -------
    Surfaces
        A pixel that goes to the other surface gets the mean of that one's disparities, with the weights below; where
        no place votes for that one, the largest or the smallest disparity around.

    Raises
    ------
    ValueError
        If the picture or what was kept has another shape than the map, or the map is not of floats, or what was kept
        not of booleans.

    Notes
    -----
    Asked are holes and pixels within 2 px of a step of 2 px. Pixels that were matched and are not so near to a step may
    vote. The largest and the smallest disparity of those within 10 px have to be 3 px apart. Of them 5 x 5 places vote,
    for near if their disparity is beyond the middle of these two. The farthest near voter has to be more than 1.5 px
    from the nearest far one, and than 0.52 of what the two differ by: a steep surface is one. These limits were set by
    hand, with photographs in view.

    With ``w = exp(-|c - c_q|^2 / (2 unlike^2))``, c the colour (mean square of the channels), the near surface's vote
    is ``ln(sum_near w / sum_far w) - ln(n_near / n_far) / 2``, half-way from the weights' sums to their means (a
    hundredth is added to sums and numbers). Beyond `sure` against what the map says, the pixel changes, but for a
    matched one that the map calls far.

    Examples
    --------
    >>> left, disparity = np.full((40, 60), 50, np.uint8), np.full((40, 60), 10, np.float32)
    >>> left[:, 30:] = 200
    >>> disparity[:, 27:] = 30  # a near thing that was made 3 px too wide
    >>> found = choose_surface(disparity, np.ones(left.shape, bool), left)
    >>> found.disparity_px[20, [26, 27, 29, 30]], int(found.moved.sum())
    (array([10., 10., 10., 30.], dtype=float32), 120)
    """
    if not disparity_px.shape == kept.shape == left.shape[:2]:
        shapes = f"the picture has shape {left.shape[:2]}, what was kept {kept.shape}"
        raise ValueError(f"{shapes}, the disparity map {disparity_px.shape}")
    if disparity_px.dtype.kind != "f" or kept.dtype != bool:
        kinds = f"the disparity map is {disparity_px.dtype}, what was kept {kept.dtype}"
        raise ValueError(f"{kinds}: give float pixels and booleans")
    spread_px = cv2.morphologyEx(disparity_px, cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8))
    step = (spread_px > STEP_PX).astype(np.uint8)
    beside = cv2.dilate(step, np.ones((2 * _BESIDE_PX + 1,) * 2, np.uint8)) > 0
    voters = np.where(kept & ~beside, disparity_px, np.float32(-1))
    window = np.ones((2 * _REACH_PX + 1,) * 2, np.uint8)
    near, far = cv2.dilate(voters, window), cv2.erode(np.where(voters < 0, np.float32(np.inf), voters), window)
    y, x = np.nonzero((near - far > _APART_PX) & (beside | ~kept))
    moved, out = np.zeros(kept.shape, bool), disparity_px.copy()
    if not y.size:
        return Surfaces(out, moved)
    picture, ends, found = np.atleast_3d(left), np.array([near[y, x], far[y, x]]), np.empty((y.size, 4), np.float32)
    per_square = 1 / (2 * unlike**2 * picture.shape[2])
    _vote(voters, np.ascontiguousarray(picture), np.array([y, x]), ends, per_square, found)
    vote, near_px, far_px, gap_px = found.T
    is_near = disparity_px[y, x] > (ends[0] + ends[1]) / 2
    is_two = gap_px > np.maximum(_GAP_PX, _GAP_SHARE * (ends[0] - ends[1]))
    may_change = is_two & (is_near | ~kept[y, x])
    changes = may_change & (np.where(is_near, -vote, vote) > sure)
    moved[y, x] = changes
    out[moved] = np.where(is_near, far_px, near_px)[changes]
    return Surfaces(out, moved)


@compiled
def _vote(voters: Float32, left: UInt8, at: Ints, ends: Float32, per_square: float, found: Float32) -> None:
    """What speaks for the near surface at N pixels, the disparities of both, and the gap between: found (N, 4).

    `voters` are disparities, below 0 where nothing votes; `at` are rows and columns (2, N); `ends` (2, N) the largest
    and the smallest disparity around each, which stand for a surface that no place votes for; `per_square` is what a
    colour's weight falls by, in its exponent, for each square of its difference.
    """
    height, width, channels = left.shape
    for i in range(found.shape[0]):
        v, u, largest, smallest = at[0, i], at[1, i], ends[0, i], ends[1, i]
        near_weight = near_sum = far_weight = far_sum = near_count = far_count = 0.0
        nearer, farther = largest, smallest
        for y in range(v - _REACH_PX, v + _REACH_PX + 1, _EVERY_PX):
            for x in range(u - _REACH_PX, u + _REACH_PX + 1, _EVERY_PX):
                if not (0 <= y < height and 0 <= x < width and voters[y, x] >= 0):
                    continue
                square = 0.0
                for c in range(channels):
                    square += (float(left[y, x, c]) - float(left[v, u, c])) ** 2
                alike, level = np.exp(-per_square * square), voters[y, x]
                if level > (largest + smallest) / 2:
                    near_weight, near_sum, near_count = near_weight + alike, near_sum + alike * level, near_count + 1
                    nearer = min(nearer, level)
                else:
                    far_weight, far_sum, far_count = far_weight + alike, far_sum + alike * level, far_count + 1
                    farther = max(farther, level)
        vote = np.log((near_weight + _LEAST) / (far_weight + _LEAST))
        found[i, 0] = vote - np.log((near_count + _LEAST) / (far_count + _LEAST)) / 2
        found[i, 1] = near_sum / max(near_weight, 1e-9) if near_count else largest
        found[i, 2] = far_sum / max(far_weight, 1e-9) if far_count else smallest
        found[i, 3] = nearer - farther
