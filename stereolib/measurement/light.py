"""Light at places between a picture's pixels, which edges are located in."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import cv2
import numpy as np

from stereolib.base import Float32, Float64, UInt8
from stereolib.rig import to_light

_LEVELS = to_light(np.arange(256, dtype=np.uint8)[None])[0]


@dataclass(frozen=True, eq=False)
class RawPicture:
    """A picture as a camera gave it, rectified as light where it is looked at.

    A rectified picture lies between the pixels of the raw one. Interpolated in grey levels, a blurred edge moves to its
    brighter side, by some hundredths of a pixel: what is darker than its surroundings would come out too large.

    Attributes
    ----------
    grey : (H, W) or (H, W, 3) uint8
    maps : two arrays
        Of `cv2.remap`, as `RectifiedRig.maps` has them.
    warp : (2, 3) float64
        From places of the picture whose rows are corrected into the rectified one (`RowOffset.warp`).
    """

    grey: UInt8
    maps: tuple[Any, Any]
    warp: Float64

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the picture."""
        return self.grey.shape

    @cached_property
    def _light(self) -> Float32:
        return to_light(self.grey)

    def places(self, x: Float32, y: Float32) -> tuple[Float32, Float32]:
        """Where places lie in the rectified picture, before its rows were corrected.

        Parameters
        ----------
        x, y : (M, N) float32

        Returns
        -------
        x, y : (M, N) float32
            Inside it.
        """
        height, width = self.grey.shape[:2]
        (a, b, c), (d, e, f) = self.warp.astype(np.float32)
        return np.clip(a * x + b * y + c, 0, width - 1), np.clip(d * x + e * y + f, 0, height - 1)

    def light(self, part: tuple[slice, slice]) -> Float32:
        """Rectify a part.

        Parameters
        ----------
        part : (rows, columns)
            Slices.

        Returns
        -------
        (h, w) or (h, w, 3) float32
        """
        where, between = (table[part] for table in self.maps)
        return np.asarray(cv2.remap(self._light, where, between, cv2.INTER_LINEAR))


#: A rectified picture, the light that made it, or one that is rectified where it is looked at.
Picture: TypeAlias = UInt8 | Float32 | RawPicture
#: Left and right one; None for one that is not looked at.
Light: TypeAlias = tuple[Picture | None, Picture | None]


def grey_step(light: float) -> float:
    """By how much light differs from one grey level to the next.

    Parameters
    ----------
    light : float, 0..1
        As `stereolib.rig.to_light` has it.

    Returns
    -------
    float

    Examples
    --------
    >>> round(grey_step(0.22), 4)
    0.0038
    """
    return float(np.interp(light, _LEVELS[:-1], np.diff(_LEVELS)))


def light_at(picture: Picture, x: Float32, y: Float32) -> Float32:
    """Light at places inside a picture; made of no more of it than they lie in.

    Parameters
    ----------
    picture : (H, W, 3) or (H, W) uint8 or float32, or RawPicture
        Rectified, or its light (`stereolib.rig.to_light`).
    x, y : (M, N) float32

    Returns
    -------
    (M, N, 3) or (M, N) float32
    """
    if isinstance(picture, RawPicture):
        x, y = picture.places(x, y)
    left, top = int(x.min()), int(y.min())
    part = slice(top, int(y.max()) + 2), slice(left, int(x.max()) + 2)
    shown: Any = picture.light(part) if isinstance(picture, RawPicture) else picture[part]
    light = to_light(shown) if shown.dtype == np.uint8 else shown
    return np.asarray(cv2.remap(light, x - left, y - top, cv2.INTER_LINEAR))
