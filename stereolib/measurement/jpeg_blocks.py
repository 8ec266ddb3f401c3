"""What JPEG adds to a picture: blocks of eight pixels, whose rims are no edges of anything."""

from __future__ import annotations

import cv2
import numpy as np

from stereolib.base import Float32, Floats, UInt8
from stereolib.rig import to_grey

_BLOCK_PX = 8
_RAMP = (0.5, 0.3, 0.15, 0.05)  # of a step, that pixels on either side of a rim take, the next one first
_MOST = 20.0  # grey levels: larger steps are edges
_LEAST = 0.05  # grey levels, by which rims step more than others: less is none


def without_blocks(picture: UInt8) -> UInt8:
    """Take the steps off that JPEG leaves at its blocks' rims, as webcams send every picture.

    Parameters
    ----------
    picture : (H, W) or (H, W, 3) uint8
        As a camera gave it: blocks begin at its corner.

    Returns
    -------
    (H, W) or (H, W, 3) uint8

    Notes
    -----
    At a rim brightness steps by ``e`` more than the mean of the slopes on either side. Where ``|e|``, 20 at most, has
    the mean ``a`` at rims and ``b`` half-way between them, ``s = sqrt(a^2 - b^2)`` is JPEG's share. A step loses
    ``e (1 - (e / 2 s)^2)^2`` (Tukey's biweight), none beyond ``2 s``, over four pixels on either side: edges remain,
    and a picture without blocks stays as it is.

    Examples
    --------
    >>> row = np.repeat([100, 104, 101, 105], 8).astype(np.uint8)
    >>> without_blocks(np.tile(row, (32, 1)))[0, 4:12].tolist()
    [100, 100, 101, 101, 103, 103, 104, 104]
    """
    grey = to_grey(picture).astype(np.float32)
    off = np.zeros_like(grey)
    found = [_take_off(grey, off), _take_off(grey.T, off.T)]
    if not any(found):
        return picture
    steps = off if picture.ndim == 2 else cv2.merge([off] * 3)
    return np.asarray(cv2.add(picture, steps, dtype=cv2.CV_8U), np.uint8)


def _take_off(grey: Float32, off: Float32) -> bool:
    """Add to `off` what takes the steps between columns off; whether there are any."""
    if grey.shape[1] < 2 * _BLOCK_PX:
        return False
    steps = _steps(grey, _BLOCK_PX)
    rim, between = (float(np.minimum(np.abs(e), _MOST).mean()) for e in (steps, _steps(grey, _BLOCK_PX // 2)))
    if rim - between < _LEAST:
        return False
    share = steps / (2 * np.sqrt(rim * rim - between * between))
    steps *= np.maximum(1 - share * share, 0.0) ** 2
    for k, part in enumerate(_RAMP):
        _at(off, _BLOCK_PX - 1 - k)[:] += part * steps
        _at(off, _BLOCK_PX + k)[:] -= part * steps
    return True


def _steps(grey: Float32, first: int) -> Floats:
    """By how much columns, every eighth, step more than the mean of the slopes before and after. (H, columns)."""
    before, last, here, after = (_at(grey, first + k) for k in (-2, -1, 0, 1))
    return np.asarray(1.5 * (here - last) - 0.5 * (after - before))


def _at(grey: Float32, column: int) -> Float32:
    """Every eighth column from one on; as many as there are rims inside."""
    rims = grey.shape[1] // _BLOCK_PX - 1
    return grey[:, column : column + _BLOCK_PX * (rims - 1) + 1 : _BLOCK_PX]
