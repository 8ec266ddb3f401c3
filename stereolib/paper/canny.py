"""Canny's edges and the bounding rectangle of an object (the paper's Fig. 9)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.base import Float32, UInt8
from stereolib.rig import check_pair, to_grey

_THRESHOLDS = 50.0, 150.0  # Canny's, on the gradient, grey levels; the paper prints none
_CLOSING_PX = 5  # side of the closing that joins broken edges
_SATURATION_GAIN = 4  # paints and wood are far from pure colours: a quarter of full saturation becomes 255


@dataclass(frozen=True)
class PixelBox:
    """An upright rectangle of pixels: columns ``left`` to ``left + width - 1``, rows likewise."""

    left: int
    top: int
    width: int
    height: int


def canny_edges(
    image: UInt8, *, blur_px: int = 5, channel: str = "grey", thresholds: tuple[float, float] = _THRESHOLDS
) -> UInt8:
    """Canny's edges of a picture.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
    blur_px : odd int
        Side of the Gaussian before; 1 is none.
    channel : "grey" | "saturation"
        Brightness, or saturation ``(max - min) / max`` of blue, green and red (times 4, where 255 is full). A pattern
        of light and dark fills the first with edges; the second does not see it, nor shading, and shows the outline
        of a coloured object. In poor light it is noise.
    thresholds : (low, high), grey levels
        On the gradient: an edge begins above the high one and is followed down to the low one.

    Returns
    -------
    (H, W) uint8, 255 on an edge, else 0

    Raises
    ------
    ValueError
        If the image is not uint8, `blur_px` is even, or the saturation of a grey image is asked for.

    Examples
    --------
    >>> image = np.zeros((40, 60), np.uint8)
    >>> image[:, 30:] = 200
    >>> np.flatnonzero(canny_edges(image)[20]).tolist()
    [29]
    """
    check_pair(image, image, names=("image", "image"))
    if blur_px < 1 or blur_px % 2 == 0:
        raise ValueError(f"blur_px must be odd and at least 1, got {blur_px}")
    return np.asarray(cv2.Canny(cv2.GaussianBlur(_channel(image, channel), (blur_px, blur_px), 0), *thresholds))


def canny_bounding_box(
    image: UInt8, *, blur_px: int = 5, channel: str = "grey", thresholds: tuple[float, float] = _THRESHOLDS
) -> PixelBox:
    """Bounding rectangle of the largest contour of Canny's edges (the paper's Fig. 9).

    Parameters
    ----------
    image, blur_px, channel, thresholds
        As for `canny_edges`.

    Returns
    -------
    PixelBox
        In pixels of the image; first and last edge pixel belong to it, so that it is one pixel wider than the
        distance between the edges. Its ends are good to about 1 px each.

    Raises
    ------
    ValueError
        As `canny_edges`; or no edge is found.

    Examples
    --------
    >>> image = np.zeros((80, 100), np.uint8)
    >>> image[20:60, 30:70] = 200
    >>> canny_bounding_box(image)
    PixelBox(left=29, top=19, width=41, height=41)
    """
    edges = canny_edges(image, blur_px=blur_px, channel=channel, thresholds=thresholds)
    edges = cv2.morphologyEx(edges, cv2.MORPH_CLOSE, np.ones((_CLOSING_PX, _CLOSING_PX), np.uint8))
    contours, _ = cv2.findContours(edges, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    if not contours:
        low, high = thresholds
        raise ValueError(f"no edge above {low:g} and {high:g} grey levels: blur less, or take another channel")
    boxes = [cv2.boundingRect(contour) for contour in contours]
    return PixelBox(*max(boxes, key=lambda box: box[2] * box[3]))


def _channel(image: UInt8, channel: str) -> UInt8:
    if channel not in ("grey", "saturation") or (channel == "saturation" and image.ndim == 2):
        raise ValueError(f'channel must be "grey", or "saturation" of a colour image; got {channel!r}, {image.shape}')
    if channel == "grey":
        return to_grey(image)
    high, low = (pick(image, axis=2).astype(np.float32) for pick in (np.max, np.min))
    gained: Float32 = np.clip(_SATURATION_GAIN * 255 * (high - low) / np.maximum(high, 1), 0, 255)
    return gained.astype(np.uint8)
