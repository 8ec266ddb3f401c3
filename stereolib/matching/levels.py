"""Pictures made ready to be matched: of one exposure, of one mean and deviation everywhere, smaller; their noise."""

from __future__ import annotations

import cv2
import numpy as np

from stereolib.base import Float32, UInt8

_WINDOW_PX = 15  # over which mean and deviation are made alike
_LEAST_DEVIATION, _DEVIATION = 3.0, 40.0  # grey levels: less is noise, and stays small; what is given
_SHADE_PX, _SHADE_PRIOR = 31, 0.3  # px of the half size; share of a window that counts as matched and alike beforehand
_MOST_SHADE = 20.0  # grey levels: what differs by more is a wrong match
_BLOCK_PX, _LEAST_BLOCKS, _QUIETEST_PCT = 8, 10, 10  # of the half size, that tell the noise
_NORMAL_MEAN = 0.798  # of a normal law's absolute values, in its deviations
_NOISE, _LEAST_NOISE = 1.0, 0.5  # grey levels: where nothing tells it; about what rounding leaves


def levelled(image: UInt8 | Float32) -> Float32:
    """Give all parts of a picture the same mean and deviation, so that exposures no longer differ.

    Parameters
    ----------
    image : (H, W) or (H, W, C) uint8 or float32, grey levels

    Returns
    -------
    float32, shaped like `image`, grey levels
        Of mean 0 and, where there is more than noise, of one deviation over windows of 15 px.
    """
    window = (_WINDOW_PX, _WINDOW_PX)
    mean = cv2.blur(image, window, dst=None).astype(np.float32)
    square = cv2.sqrBoxFilter(image, cv2.CV_32F, window)
    spread = cv2.sqrt(np.maximum(square - cv2.blur(image.astype(np.float32), window) ** 2, 0) + _LEAST_DEVIATION**2)
    return np.asarray(cv2.divide(image - mean, spread, scale=_DEVIATION), np.float32)


def evened(left: UInt8, right: UInt8) -> UInt8:
    """Give the right picture the left one's mean and deviation, which exposure may have changed.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8

    Returns
    -------
    uint8, shaped like `right`
    """
    gain = float(left.std()) / max(float(right.std()), 1.0)
    return np.asarray((gain * (right - np.float32(right.mean())) + left.mean()).round().clip(0, 255).astype(np.uint8))


def shaded(left: UInt8, right: UInt8, rough_px: Float32) -> UInt8:
    """Give the left picture the right one's brightness part by part: surfaces shine, lenses darken corners differently.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        Of one exposure (`evened`), their rows corrected (`RowOffset.correct`): they are compared pixel by pixel.
    rough_px : (H / 2, W / 2) float32, px of the half size
        A rough match of them, as `find_rows` gives it; NaN where nothing was matched.

    Returns
    -------
    uint8, shaped like `left`

    Notes
    -----
    In half size, ``L'(u) = L(u) - sum e / (n + 0.3 N)`` over windows of N = 31 x 31 px, of which n were matched, with
    ``e = L(u) - R(u - d)`` up to 20 grey levels: no pixel changes by more than 20 / 1.3 = 15.4. A difference that both
    pictures keep over a whole window is no depth; the prior holds it to none where little was matched.

    Examples
    --------
    >>> left = np.full((200, 200), 100, np.uint8)
    >>> int(shaded(left, left + np.uint8(13), np.full((100, 100), 5, np.float32))[100, 100])
    110
    """
    off = _differences(left, right, rough_px)
    known = np.isfinite(off[..., 0])
    off = np.where(known[..., None], off, 0).clip(-_MOST_SHADE, _MOST_SHADE)
    window = (_SHADE_PX, _SHADE_PX)
    share = cv2.blur(known.astype(np.float32), window) + np.float32(_SHADE_PRIOR)
    shade = np.atleast_3d(cv2.blur(off, window)) / share[..., None]
    whole = cv2.resize(shade, left.shape[1::-1], interpolation=cv2.INTER_LINEAR).reshape(left.shape)
    return np.asarray(cv2.subtract(left, whole, dtype=cv2.CV_8U))


def noise_grey(left: UInt8, right: UInt8, rough_px: Float32) -> float:
    """Tell the noise of a pair from how its matched pixels differ: a single picture's fine texture looks like noise.

    Parameters
    ----------
    left, right, rough_px
        As those of `shaded`.

    Returns
    -------
    float, grey levels
        Standard deviation of one pixel's noise, mean of the channels, where the pictures agree best; at least 0.5. One
        grey level where too little was matched.

    Notes
    -----
    In half size, the mean of ``|e(y) - e(y + 1)| / 0.798`` with ``e = L(u) - R(u - d)`` over blocks of 8 x 8 px, of
    which it takes the tenth percentile. e has the noise of two pictures, the difference that of two rows, and the mean
    of four pixels half of theirs: together one pixel's.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> texture = rng.uniform(50, 200, (200, 210))
    >>> seen = [(texture[:, k : k + 200] + rng.normal(0, 4, (200, 200))).astype(np.uint8) for k in (0, 10)]
    >>> 2.5 < noise_grey(*seen, np.full((100, 100), 5, np.float32)) < 4.5
    True
    """
    off = _differences(left, right, rough_px).mean(axis=2)
    rows, columns = (off.shape[0] - 1) // _BLOCK_PX, off.shape[1] // _BLOCK_PX
    between = np.abs(np.diff(off, axis=0))[: rows * _BLOCK_PX, : columns * _BLOCK_PX]
    blocks = between.reshape(rows, _BLOCK_PX, columns, _BLOCK_PX).transpose(0, 2, 1, 3).reshape(-1, _BLOCK_PX**2)
    blocks = blocks[np.isfinite(blocks).all(axis=1)]
    if len(blocks) < _LEAST_BLOCKS:
        return _NOISE
    return max(float(np.percentile(blocks.mean(axis=1), _QUIETEST_PCT)) / _NORMAL_MEAN, _LEAST_NOISE)


def _differences(left: UInt8, right: UInt8, rough_px: Float32) -> Float32:
    """Left less right picture in half size, (H / 2, W / 2, C) grey levels; NaN where nothing was matched."""
    size = rough_px.shape[::-1]
    halves = (cv2.resize(side.astype(np.float32), size, interpolation=cv2.INTER_AREA) for side in (left, right))
    first, second = (np.atleast_3d(np.asarray(half)) for half in halves)
    columns, rows = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in size))
    at = columns - rough_px
    known = at > 0  # not where it is NaN
    seen = cv2.remap(second, np.where(known, at, -1), rows, cv2.INTER_LINEAR)
    off = first - np.atleast_3d(seen)
    off[~known] = np.nan
    return np.asarray(off)


def halved(image: UInt8) -> UInt8:
    """Make a picture half as large.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8

    Returns
    -------
    (H / 2, W / 2) or (H / 2, W / 2, 3) uint8
        Means of squares of four pixels.
    """
    return np.asarray(cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
