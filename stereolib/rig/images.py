"""Reading pictures, and refusing bad ones by name."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import cv2
import numpy as np

Array = np.ndarray
#: Kind, first bytes, end marker: decoders may fill the rest of a cut picture with grey and say nothing.
_ENDS = (("JPEG", b"\xff\xd8\xff", b"\xff\xd9"), ("PNG", b"\x89PNG", b"IEND"))

_LIGHT = ((np.arange(256) / 255) ** 2.2).astype(np.float32)


def read_image(path: str | PathLike[str], *, grey: bool = False) -> Array:
    """Read one picture.

    Parameters
    ----------
    path : path of a JPEG, PNG or any other format of `cv2.imread`
    grey : bool
        Convert to grey.

    Returns
    -------
    (H, W, 3) uint8 blue-green-red, or (H, W) uint8

    Raises
    ------
    ValueError
        If the file is missing, no picture, cut short, or has more than 8 bits a sample.
    """
    path = Path(path)
    if not path.is_file():
        what = "is a folder; name one image in it" if path.is_dir() else "no such image file"
        raise ValueError(f"{path}: {what}")
    data = path.read_bytes()
    for kind, start, end in _ENDS:
        if data.startswith(start) and end not in data[-64:]:
            raise ValueError(
                f"{path}: the {kind} is cut short ({len(data)} bytes, no end marker): copy or record it again"
            )
    image = None
    if data:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH)
    if image is None:
        raise ValueError(f"{path}: not a readable image ({len(data)} bytes): save it as JPEG or PNG")
    if image.dtype != np.uint8:  # cutting off the low bits would lose a dark picture
        raise ValueError(f"{path}: the picture has {image.dtype} samples, 8 bits are needed: scale it to 0..255 and "
                         f"save it again")  # fmt: skip
    return to_grey(image) if grey else image  # by one formula, whatever the file's decoder would do


def read_pair(left: str | PathLike[str], right: str | PathLike[str], *, grey: bool = False) -> tuple[Array, Array]:
    """Read a stereo pair; ValueError if the sizes differ. See `read_image`."""
    pair = read_image(left, grey=grey), read_image(right, grey=grey)
    check_pair(*pair, names=(str(left), str(right)))
    return pair


def check_pair(left: Array, right: Array, names: tuple[str, str] = ("left", "right")) -> None:
    """Refuse a pair of different sizes, channels or types, or one that is not 8-bit.

    Raises
    ------
    ValueError
    """
    for name, image in zip(names, (left, right), strict=True):
        if not isinstance(image, np.ndarray) or image.dtype != np.uint8:
            kind = getattr(image, "dtype", type(image).__name__)
            raise ValueError(f"{name}: images must be uint8 arrays, got {kind}; scale to 0..255 and convert first")
        if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] != 3) or image.size == 0:
            raise ValueError(f"{name}: expected (H, W) grey or (H, W, 3) colour, got shape {image.shape}")
    if left.shape[:2] != right.shape[:2]:
        sizes = [f"{image.shape[1]}x{image.shape[0]}" for image in (left, right)]
        raise ValueError(f"{names[0]} is {sizes[0]}, {names[1]} is {sizes[1]}: a stereo pair must have one size")
    if left.ndim != right.ndim:
        kinds = ["grey" if image.ndim == 2 else "colour" for image in (left, right)]
        raise ValueError(f"{names[0]} is {kinds[0]}, {names[1]} is {kinds[1]}: read both the same way")


def to_light(image: Array) -> Array:
    """The light that made a picture, float32, 0..1: cameras send it to the power 1 / 2.2.

    A blurred edge between light and dark stands right in light, not in grey levels.
    """
    return np.asarray(cv2.LUT(image, _LIGHT))


def to_grey(image: Array) -> Array:
    """(H, W) uint8 of a grey or blue-green-red image."""
    return image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
