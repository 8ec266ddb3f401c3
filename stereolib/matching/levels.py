"""Pictures made ready to be matched: of one exposure, of one mean and deviation everywhere, in half size."""

from __future__ import annotations

from typing import Any, cast

import cv2
import numpy as np

from stereolib.base import Float32, UInt8

_WINDOW_PX = 15  # over which mean and deviation are made alike
_LEAST_DEVIATION, _DEVIATION = 3.0, 40.0  # grey levels: less is noise, and stays small; what is given
_SHADE_PX, _SHADE_PRIOR = 31, 0.3  # px of the half size; share of a window that counts as matched and alike beforehand
_MOST_SHADE = 20.0  # grey levels: what differs by more is a wrong match


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
    size = rough_px.shape[::-1]
    first, second = (np.asarray(cv2.resize(side, size, interpolation=cv2.INTER_AREA)) for side in (left, right))
    columns, rows = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in size))
    at = columns - rough_px
    known = at > 0  # not where it is NaN
    seen = cv2.remap(second, np.where(known, at, -1), rows, cv2.INTER_LINEAR)
    off = np.atleast_3d(cv2.subtract(first, seen, dtype=cv2.CV_32F)).clip(-_MOST_SHADE, _MOST_SHADE)
    off *= known[..., None]
    window = (_SHADE_PX, _SHADE_PX)
    share = cv2.blur(known.astype(np.float32), window) + np.float32(_SHADE_PRIOR)
    shade = np.atleast_3d(cv2.blur(off, window)) / share[..., None]
    whole = cv2.resize(shade, left.shape[1::-1], interpolation=cv2.INTER_LINEAR).reshape(left.shape)
    return np.asarray(cv2.subtract(left, whole, dtype=cv2.CV_8U))


def halved(image: UInt8, moved_px: int = 0) -> Float32:
    """Make a picture half as large without rounding, after moving it to the left.

    Parameters
    ----------
    image : (H, W) or (H, W, C) uint8
    moved_px : {0, 1}
        Columns.

    Returns
    -------
    (ceil(H / 2), ceil(W / 2), C) float32, grey levels
        Means of four pixels; its border is repeated where an edge is odd, or where nothing is left after moving.
    """
    height, width = image.shape[:2]
    spare = height % 2, width % 2 + moved_px
    roomy: Any = cv2.copyMakeBorder(image, 0, spare[0], 0, spare[1], cv2.BORDER_REPLICATE)[:, moved_px:]
    size = (width + 1) // 2, (height + 1) // 2
    small = cv2.resize(cast(Any, roomy[:, : 2 * size[0]]).astype(np.float32), size, interpolation=cv2.INTER_AREA)
    return np.atleast_3d(small)
