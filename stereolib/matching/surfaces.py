"""Pixels beside steps go to the surface, in front or behind, whose colour they have."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from stereolib.base import Bools, Float32, Ints, UInt8

STEP_PX = 2.0  # neighbours farther apart are two surfaces
_BESIDE_PX = 2  # so near a step a disparity is not trusted
_APART_PX, _GAP_PX = 3.0, 1.5  # surfaces nearer to each other, or with a smaller gap between, are taken for one
_GAP_SHARE = 0.52  # of all that disparities differ by around: between places, a single slope leaves up to a half of it
_AROUND_PX = np.arange(-10, 11, 5)  # rows and columns around a pixel that are looked at
_NO_COLOUR = 1e4  # of what does not vote: like none
_AT_ONCE = 2**13  # pixels: so many stay in the processor's cache
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
    disparity_px: Float32, kept: Bools, left: UInt8, *, unlike: float = 8.0, sure: float = 2.0
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
    spread_px = cv2.morphologyEx(disparity_px, cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8))
    step = (spread_px > STEP_PX).astype(np.uint8)
    beside = cv2.dilate(step, np.ones((2 * _BESIDE_PX + 1,) * 2, np.uint8)) > 0
    voters = np.where(kept & ~beside, disparity_px, np.float32(-1))
    reach = int(_AROUND_PX[-1])
    window = np.ones((2 * reach + 1,) * 2, np.uint8)
    near, far = cv2.dilate(voters, window), cv2.erode(np.where(voters < 0, np.float32(np.inf), voters), window)
    y, x = np.nonzero((near - far > _APART_PX) & (beside | ~kept))
    moved, out = np.zeros(kept.shape, bool), disparity_px.copy()
    if not y.size:
        return Surfaces(out, moved)
    ends = near[y, x], far[y, x]
    vote, near_px, far_px, gap_px = _vote(voters, np.atleast_3d(left), (y, x), ends, unlike)
    is_near = disparity_px[y, x] > (ends[0] + ends[1]) / 2
    is_two = gap_px > np.maximum(_GAP_PX, _GAP_SHARE * (ends[0] - ends[1]))
    may_change = is_two & (is_near | ~kept[y, x])
    changes = may_change & (np.where(is_near, -vote, vote) > sure)
    moved[y, x] = changes
    out[moved] = np.where(is_near, far_px, near_px)[changes]
    return Surfaces(out, moved)


def _vote(
    voters: Float32, left: UInt8, at: tuple[Ints, Ints], ends: tuple[Float32, Float32], unlike: float
) -> tuple[Float32, Float32, Float32, Float32]:
    """What speaks for the near surface at some pixels, the disparities of both, and the gap between; (N,) each.

    `voters` are disparities, below 0 where nothing votes; `ends` the largest and the smallest around each pixel, which
    stand for a surface that no place votes for.
    """
    reach = int(_AROUND_PX[-1])
    rim = ((reach, reach), (reach, reach))
    levels = np.pad(voters, rim, constant_values=-1).ravel()
    colours = [np.pad(channel, rim).ravel().astype(np.float32) for channel in np.moveaxis(left, -1, 0)]
    colours[0][levels < 0] = _NO_COLOUR
    width = voters.shape[1] + 2 * reach
    offsets = (_AROUND_PX[:, None] * width + _AROUND_PX).ravel()
    scale = np.float32(-1 / (2 * unlike**2 * len(colours)))
    found = [np.zeros((4, 0), np.float32)]
    for part in np.array_split(np.arange(len(at[0])), max(len(at[0]) // _AT_ONCE, 1)):
        places, (largest, smallest) = (at[0][part] + reach) * width + at[1][part] + reach, (end[part] for end in ends)
        limit = (largest + smallest) / 2
        own = [channel[places] for channel in colours]
        own[0] = left[..., 0][at[0][part], at[1][part]].astype(np.float32)
        near, every = np.zeros((2, 3, len(part)), np.float32)  # of each: weights, their sum with disparities, number
        nearer, farther = largest.copy(), smallest.copy()
        for there in (places + offset for offset in offsets):
            level, square = levels[there], np.zeros_like(limit)
            for channel, mine in zip(colours, own, strict=True):
                off = channel[there] - mine
                square += off * off
            alike, is_near = np.exp(scale * square), level > limit
            near_alike = alike * is_near
            every += alike, alike * level, level >= 0
            near += near_alike, near_alike * level, is_near
            np.minimum(nearer, np.where(is_near, level, largest), out=nearer)
            np.maximum(farther, np.where(is_near, smallest, level), out=farther)
        far = every - near
        vote = np.log((near[0] + _LEAST) / (far[0] + _LEAST)) - np.log((near[2] + _LEAST) / (far[2] + _LEAST)) / 2
        both = (
            np.where(side[2] > 0, side[1] / np.maximum(side[0], np.float32(1e-9)), end)
            for side, end in ((near, largest), (far, smallest))
        )
        found.append(np.array([vote, *both, nearer - farther], np.float32))
    vote, near_px, far_px, gap_px = np.concatenate(found, axis=1)
    return vote, near_px, far_px, gap_px
