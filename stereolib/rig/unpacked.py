"""Pairs that are no two files yet: pictures side by side, and videos, cut into files beside their source, once."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from stereolib.base import UInt8, check_name, write_atomic
from stereolib.rig.images import read_image, to_grey

VIDEOS = (".mp4", ".avi", ".mkv", ".mov", ".webm", ".mjpeg", ".mjpg", ".m4v")
FOLDER = ".stereolib_pairs"
_FRAMES = 60  # taken of a video, at most, if nothing else is asked
_RUN = 15  # frames of which one is taken, where a video does not tell its length
_OTHER_LENGTH = 0.05  # share by which two videos that ran together may differ in length
WIDE = 2.2  # width over height from which a picture is two side by side; panoramas aside, no camera's is
_BLURRED = 0.3  # share of the median sharpness below which a frame is left out
_DONE = "done"


def unpack_halves(files: Sequence[Path]) -> list[tuple[Path, Path]]:
    """Cut pictures with both sides beside each other into their halves.

    Parameters
    ----------
    files : sequence of Path
        Pictures of even width, the left side at the left.

    Returns
    -------
    list of (Path, Path)
        PNG files in a folder ``.stereolib_pairs`` beside each; those that are there already are not cut again.

    Raises
    ------
    ValueError
        If a picture cannot be read or its width is odd.
    """
    pairs = []
    for file in files:
        halves = _places(_kept([file]), file.stem)
        if not all(half.is_file() for half in halves):
            _write(halves, _halves(read_image(file), file))
        pairs.append(halves)
    return pairs


def unpack_videos(videos: Sequence[Path], every: int | None = None) -> list[tuple[Path, Path]]:
    """Take sharp frames out of a video for each camera, or out of one that shows both sides beside each other.

    Frames of the same number are taken for one moment. Of each run of `every` frames the sharpest pair is kept (the
    variance of the Laplacian, the lower one of both sides); pairs with less than 0.3 of the median of it are left out.

    Parameters
    ----------
    videos : sequence of one or two Path
    every : int, optional
        Frames in a run; without it, as many as leave at most 60 pairs, where its length is known.

    Returns
    -------
    list of (Path, Path)
        PNG files named by their frame, in a folder ``.stereolib_pairs`` beside the first video; a second call finds
        them there.

    Raises
    ------
    ValueError
        If a video cannot be read, two differ in length by more than 5 %, or a single one is not 2.2 times as wide as
        high.
    """
    if every is not None and every < 1:
        raise ValueError(f"every {every} frames cannot be taken: expected 1 or more")
    for video in videos:
        check_name(video)
        if not video.is_file():
            raise ValueError(f"{video}: no such file")
    folder = _kept(videos, every)
    if not (folder / _DONE).is_file():
        _cut(videos, every, folder)
    return [_places(folder, name) for name in (folder / _DONE).read_text(encoding="utf-8").split()]


def _cut(videos: Sequence[Path], every: int | None, folder: Path) -> None:
    from tqdm.auto import tqdm

    captures = [cv2.VideoCapture(str(video)) for video in videos]
    try:
        lengths = [int(capture.get(cv2.CAP_PROP_FRAME_COUNT)) for capture in captures]
        if bad := [video for video, capture in zip(videos, captures, strict=True) if not capture.isOpened()]:
            raise ValueError(f"{bad[0]}: not a readable video: save it as MP4 or AVI (MJPG)")
        if min(lengths) > 0 and max(lengths) - min(lengths) > _OTHER_LENGTH * max(lengths):
            said = " and ".join(f"{video.name} has {n}" for video, n in zip(videos, lengths, strict=True))
            raise ValueError(f"{said} frames: videos of one recording start and end together; cut them alike")
        run = every or (math.ceil(min(lengths) / _FRAMES) if min(lengths) > 0 else _RUN)
        sharpness: dict[str, float] = {}
        frames = enumerate(tqdm(_frames(captures, videos), "frames", min(lengths), delay=2, leave=False, disable=None))
        best, best_sharp, name = None, -1.0, ""
        for k, pair in frames:
            if k % run == 0 and best is not None:
                _write(_places(folder, name), best)
                sharpness[name], best, best_sharp = best_sharp, None, -1.0
            if (sharp := min(cv2.Laplacian(to_grey(side), cv2.CV_64F).var() for side in pair)) > best_sharp:
                best, best_sharp, name = pair, sharp, f"{k:06d}"
        if best is not None:
            _write(_places(folder, name), best)
            sharpness[name] = best_sharp
    finally:
        for capture in captures:
            capture.release()
    if not sharpness:
        raise ValueError(f"{videos[0]}: no frame of it can be read: save it as MP4 or AVI (MJPG)")
    usual = float(np.median(list(sharpness.values())))
    write_atomic(folder / _DONE, "\n".join(name for name, sharp in sharpness.items() if sharp >= _BLURRED * usual))


def _frames(captures: Sequence[cv2.VideoCapture], videos: Sequence[Path]) -> Iterator[tuple[UInt8, UInt8]]:
    while True:
        frames = [frame for there, frame in (capture.read() for capture in captures) if there]
        if len(frames) < len(captures):
            return
        yield _halves(frames[0], videos[0]) if len(frames) == 1 else (frames[0], frames[1])


def _halves(picture: UInt8, source: Path) -> tuple[UInt8, UInt8]:
    height, width = picture.shape[:2]
    if width < WIDE * height or width % 2:
        raise ValueError(
            f"{source} is {width}x{height}: pictures with both sides beside each other are at least {WIDE:g} times as "
            f"wide as high, and of even width. Is it one camera's? Then name the other one's, too"
        )
    return picture[:, : width // 2], picture[:, width // 2 :]


def _kept(sources: Sequence[Path], *asked: object) -> Path:
    """The folder of what was cut out of these files, as they are now."""
    now = [(source.name, (state := source.stat()).st_size, state.st_mtime_ns) for source in sources]
    return sources[0].parent / FOLDER / hashlib.sha256(repr((now, asked)).encode()).hexdigest()[:16]


def _places(folder: Path, name: str) -> tuple[Path, Path]:
    return folder / f"{name}_left.png", folder / f"{name}_right.png"


def _write(places: tuple[Path, Path], pair: tuple[UInt8, UInt8]) -> None:
    for place, side in zip(places, pair, strict=True):
        write_atomic(place, cv2.imencode(".png", side)[1].tobytes())
