"""Pictures: read, refused by name where they are bad, and turned into grey levels or light."""

from __future__ import annotations

import re
import warnings
from io import BytesIO
from os import PathLike
from threading import Lock

import cv2
import numpy as np

from stereolib.base import Float32, UInt8, read_bytes

#: Kind, first bytes, end marker: decoders may fill the rest of a cut picture with grey and say nothing.
_ENDS = (("JPEG", b"\xff\xd8\xff", b"\xff\xd9"), ("PNG", b"\x89PNG", b"IEND"))
_LEAST_SIDE_PX = 2  # of a picture that is looked at in half size
MAX_MEGAPIXELS = 100.0  # no webcam comes near; a few kB can claim a thousand times as much
_GAMMA = 2.2  # of cameras' and screens' grey levels (sRGB, nearly)
_LIGHT = ((np.arange(256) / 255) ** _GAMMA).astype(np.float32)
_ORIENTATION, _AS_IT_IS, _TURNED, _ON_ITS_SIDE = 0x0112, 1, range(2, 9), range(5, 9)  # of EXIF
_WIDTH, _HEIGHT = 0x0100, 0x0101  # of TIFF
_FILTERING = Lock()  # warnings' filters belong to the whole process, pictures are read by several threads


def read_image(path: str | PathLike[str], *, grey: bool = False) -> UInt8:
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
        If the file is missing, no picture, cut short, larger than `MAX_MEGAPIXELS`, or has more than 8 bits a sample.
    """
    data = read_bytes(path)
    megapixels = _megapixels_of_header(data)
    for kind, start, end in _ENDS:
        if data.startswith(start) and end not in data[-64:] and not (kind == "JPEG" and _is_whole(data, megapixels)):
            why = f"{path}: the {kind} is cut short ({len(data)} bytes, no end marker)"
            raise ValueError(f"{why}: copy or record it again")
    if megapixels > MAX_MEGAPIXELS:
        why = f"{path}: the picture has {megapixels:.0f} megapixels, at most {MAX_MEGAPIXELS:.0f} are read"
        raise ValueError(f"{why}: scale it down")
    broken = not megapixels and any(data.startswith(start) for _, start, _ in _ENDS)  # OpenCV's decoders are talkative
    raw = np.frombuffer(b"" if broken else data, np.uint8)
    image = cv2.imdecode(raw, cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH) if raw.size else None
    if image is None:
        raise ValueError(f"{path}: not a readable image ({len(data)} bytes): save it as JPEG or PNG")
    if image.dtype != np.uint8:  # cutting off the low bits would lose a dark picture
        why = f"{path}: the picture has {image.dtype} samples, 8 bits are needed"
        raise ValueError(f"{why}: scale it to 0..255 and save it again")
    return to_grey(image) if grey else image  # by one formula, whatever the file's decoder would do


def image_size(path: str | PathLike[str]) -> tuple[int, int]:
    """Tell a picture's size from its first bytes, turned as its EXIF says.

    Parameters
    ----------
    path : path

    Returns
    -------
    (width, height), px

    Raises
    ------
    ValueError
        As `read_image`, which reads it whole where its header is not understood.
    """
    if header := _header(path):
        (width, height), orientation = header
        return (height, width) if orientation in _ON_ITS_SIDE else (width, height)
    height, width = read_image(path).shape[:2]
    return width, height


def image_orientation(path: str | PathLike[str]) -> int:
    """Tell how a picture is turned or mirrored as it is read, since its EXIF says how the camera was held.

    Parameters
    ----------
    path : path

    Returns
    -------
    int
        EXIF's number: 1 as it is, 3 by half a turn, 6 and 8 by a quarter; 1 where nothing is said, or nothing readable.
    """
    header = _header(path)
    return header[1] if header else _AS_IT_IS


def _header(path: str | PathLike[str]) -> tuple[tuple[int, int], int] | None:
    """Size as it is stored, px, and EXIF's orientation; None where a header is not understood."""
    from PIL import Image
    from PIL.TiffImagePlugin import TiffImageFile

    with _FILTERING, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            with Image.open(path) as image:
                # of a TIFF, `size` is turned already, or not: it depends on Pillow's version
                tags = image.tag_v2 if isinstance(image, TiffImageFile) else {}
                size = (int(tags[_WIDTH]), int(tags[_HEIGHT])) if tags else image.size
                told = image.getexif().get(_ORIENTATION, _AS_IT_IS)
                return size, int(told) if told in _TURNED else _AS_IT_IS
        except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):  # the third: damaged EXIF
            return None


def read_pair(left: str | PathLike[str], right: str | PathLike[str], *, grey: bool = False) -> tuple[UInt8, UInt8]:
    """Read a stereo pair.

    Parameters
    ----------
    left, right : path
    grey : bool
        Convert to grey.

    Returns
    -------
    left, right : (H, W, 3) or (H, W) uint8

    Raises
    ------
    ValueError
        As `read_image`; or the two differ in size, or are the same picture and not of one colour all over.
    """
    pair = read_image(left, grey=grey), read_image(right, grey=grey)
    check_pair(*pair, names=(str(left), str(right)))
    if np.array_equal(*pair) and np.ptp(pair[0]) > 0:
        why = "are the same picture, every disparity would be 0: give the left and the right camera's"
        raise ValueError(f"{left} and {right} {why}")
    return pair


def check_pair(left: UInt8, right: UInt8, names: tuple[str, str] = ("left", "right")) -> None:
    """Refuse a pair of different sizes, channels or types, one that is not 8-bit, or of a single row or column.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
    names : pair of str
        What the message calls them, for example their files.

    Raises
    ------
    ValueError
        If they are no pair; the text names the one that is wrong.

    Examples
    --------
    >>> check_pair(np.zeros((4, 6), np.uint8), np.zeros((4, 5), np.uint8))
    Traceback (most recent call last):
    ...
    ValueError: left is 6x4, right is 5x4: a stereo pair must have one size, set \
both cameras to one resolution
    """
    for name, image in zip(names, (left, right), strict=True):
        check_image(image, name)
        if min(image.shape[:2]) < _LEAST_SIDE_PX:
            size = f"{image.shape[1]}x{image.shape[0]}"
            raise ValueError(f"{name} is {size}: pictures of a single row or column cannot be matched")
    if left.shape[:2] != right.shape[:2]:
        sizes = [f"{image.shape[1]}x{image.shape[0]}" for image in (left, right)]
        remedy = "a stereo pair must have one size, set both cameras to one resolution"
        raise ValueError(f"{names[0]} is {sizes[0]}, {names[1]} is {sizes[1]}: {remedy}")
    if left.ndim != right.ndim:
        kinds = ["grey" if image.ndim == 2 else "colour" for image in (left, right)]
        raise ValueError(f"{names[0]} is {kinds[0]}, {names[1]} is {kinds[1]}: read both the same way")


def check_image(image: UInt8, name: str = "the picture") -> None:
    """Refuse what is no 8-bit picture.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
    name : str
        What the message calls it.

    Raises
    ------
    ValueError
        If it is none; the text says what came.

    Examples
    --------
    >>> check_image([[0, 255]])
    Traceback (most recent call last):
    ...
    ValueError: the picture: images must be uint8 arrays, got list; scale to 0..255 and convert first
    """
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8:
        kind = getattr(image, "dtype", type(image).__name__)
        raise ValueError(f"{name}: images must be uint8 arrays, got {kind}; scale to 0..255 and convert first")
    if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] != 3) or image.size == 0:
        raise ValueError(f"{name}: expected (H, W) grey or (H, W, 3) colour, got shape {image.shape}")


def to_light(image: UInt8) -> Float32:
    """Turn grey levels into the light that made them: cameras send it to the power 1 / 2.2.

    A blurred edge between light and dark stands right in light, not in grey levels.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8

    Returns
    -------
    float32, 0..1, shaped like `image`

    Raises
    ------
    ValueError
        If it is no picture of 8 bits.

    Examples
    --------
    >>> (100 * to_light(np.array([[0, 128, 255]], np.uint8))).round().tolist()
    [[0.0, 22.0, 100.0]]
    """
    check_image(image)
    return np.asarray(cv2.LUT(image, _LIGHT))


def to_grey(image: UInt8) -> UInt8:
    """Turn a picture into grey levels.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
        Grey, which comes back as it is, or blue-green-red.

    Returns
    -------
    (H, W) uint8

    Raises
    ------
    ValueError
        If it is no picture of 8 bits.

    Examples
    --------
    >>> to_grey(np.full((1, 1, 3), (0, 0, 255), np.uint8)).tolist()
    [[76]]
    """
    check_image(image)
    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))


def _megapixels_of_header(data: bytes) -> float:
    """Size that a picture's header claims, before anything is decoded; 0 of formats that Pillow does not know."""
    from PIL import Image

    with _FILTERING, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            width, height = Image.open(BytesIO(data)).size
            return width * height / 1e6
        except Image.DecompressionBombError as error:  # beyond Pillow's own limit it says the number of pixels only
            return int(re.findall(r"\d+", str(error))[0]) / 1e6
        except (OSError, ValueError):
            return 0.0


def _is_whole(data: bytes, megapixels: float) -> bool:
    """Whether a JPEG ends before its file does: cameras pad theirs, telephones append a film."""
    from PIL import Image

    if not 0 < megapixels <= MAX_MEGAPIXELS:
        return False
    with _FILTERING, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            Image.open(BytesIO(data[: data.rfind(_ENDS[0][2]) + 2])).load()  # zeros behind a cut would pass for grey
        except (OSError, ValueError, SyntaxError):
            return False
    return True
