"""Pictures made ready to be matched: of one exposure, of one mean and deviation everywhere, in half size."""

from __future__ import annotations

from typing import Any, cast

import cv2
import numpy as np

from stereolib.base import Float32, UInt8

_WINDOW_PX = 15  # over which mean and deviation are made alike
_LEAST_DEVIATION, _DEVIATION = 3.0, 40.0  # grey levels: less is noise, and stays small; what is given


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
