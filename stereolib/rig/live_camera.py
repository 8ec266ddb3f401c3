"""One live camera: opened, its settings fixed, what it refused, and its newest picture.

A thread grabs without a pause, so that no old picture waits in a buffer; it decodes only what is asked for.
"""

from __future__ import annotations

import glob
import math
import os
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from stereolib.base import UInt8, listed

_OPEN_MS, _READ_MS = 4000, 3000  # for an address that does not answer
_CLOSE_S = 12.0  # a driver notices after ten that nothing comes
_FAILED_GRABS = 5  # in a row: drivers drop a picture now and then
_PAUSE_S = 0.05  # after a failed one
_SETTLED_S = 1.0  # for the automatic exposure, before it is fixed where it stands
_CLOSE_ENOUGH = 0.02  # share by which a setting may differ and count as taken
#: Of the backend V4L2 and the others: what switches the automatic exposure off.
_MANUAL = {"V4L2": 1.0}
_MANUAL_ELSEWHERE = 0.25
_STAMPED = ("V4L2",)  # whose drivers say when a picture was taken, all by one clock


class CameraError(OSError):
    """A camera cannot be opened, or gives no pictures; the text names the remedy."""


@dataclass(frozen=True)
class CameraWish:
    """What is asked of a camera; what it does not take is said in `LiveCamera.refused`.

    Parameters
    ----------
    size : (width, height), optional
        Of the pictures, px.
    fps : float, optional
        Pictures a second.
    exposure, focus, white_balance_k : float, optional
        In the driver's own units, kelvin for the last; without one, it is fixed where the automatic had it.
    fixed : bool
        Switch automatic exposure, focus and white balance off.
    code : str
        Four letters of the format on the cable: MJPG needs a tenth of what YUYV does.
    """

    size: tuple[int, int] | None = None
    fps: float | None = None
    exposure: float | None = None
    focus: float | None = None
    white_balance_k: float | None = None
    fixed: bool = True
    code: str = "MJPG"

    def __post_init__(self) -> None:
        if self.size is not None and not all(0 < edge <= 2**14 for edge in self.size):
            raise ValueError(f"a picture is 1x1 to 16384x16384 px, got {self.size[0]}x{self.size[1]}")
        if not all(map(math.isfinite, filter(None, (self.exposure, self.focus, self.white_balance_k)))):
            raise ValueError("exposure, focus and white balance are finite numbers, as the driver counts them")
        if self.fps is not None and not 0 < self.fps <= 1000:
            raise ValueError(f"pictures a second must be above 0 and at most 1000, got {self.fps:g}")
        if len(self.code) != 4 or not self.code.isascii():
            raise ValueError(f"a format has four letters, as MJPG or YUYV, got {self.code!r}")


class Frame(NamedTuple):
    """A picture, (H, W, 3) uint8, and when it was taken (where `LiveCamera.stamped`) or else came in, s."""

    image: UInt8
    at_s: float


class LiveCamera:
    """A camera, a stream, a video or numbered pictures: whatever `cv2.VideoCapture` opens.

    Parameters
    ----------
    source : str
        A number, a device (``/dev/video2``), an address (``http://...``), a video, or a pattern as ``left_%02d.png``.
    name : str
        What messages call it.
    wish : CameraWish, optional

    Attributes
    ----------
    refused : tuple of str
        What was asked and not taken, in words.
    size : (width, height), px
    recorded : bool
        It is a file: every picture comes in turn, none has a moment.
    stamped : bool
        The driver says when a picture was taken.
    grabbed : int
        Pictures that came so far.

    Raises
    ------
    CameraError
        If it cannot be opened.
    """

    def __init__(self, source: str, name: str, wish: CameraWish | None = None) -> None:
        self.source, self.name, wish = source, name, wish or CameraWish()
        self.recorded = "%" in source or Path(source).is_file()
        with _quiet():
            self._capture = _open(source)
            if not self._capture.isOpened():
                self._capture.release()
                raise CameraError(_why_not_open(source, name))
            self.backend = self._capture.getBackendName()
            self.stamped = self.backend in _STAMPED and not self.recorded
            self.refused = () if self.recorded else tuple(_asked(self._capture, wish, is_stream="://" in source))
        ends = (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
        self.size = int(self._capture.get(ends[0])), int(self._capture.get(ends[1]))
        self._first = self._first_of_file() if self.recorded else None
        self.grabbed, self._intervals = 0, deque[float](maxlen=30)
        self._last_s, self._opened_s = math.nan, time.monotonic()
        self._changed, self._is_wanted, self._is_stopped = threading.Condition(), False, False
        self._frame: Frame | None = None
        self._gone = ""
        self._thread: threading.Thread | None = None
        if not self.recorded:
            self._thread = threading.Thread(target=self._run, daemon=True, name=f"camera {name}")
            self._thread.start()

    @property
    def interval_s(self) -> float:
        """Median time between two pictures, s; NaN before the third."""
        with self._changed:
            return float(np.median(self._intervals)) if len(self._intervals) > 1 else math.nan

    def ask(self) -> None:
        """Ask for the next picture that comes in."""
        with self._changed:
            self._frame, self._is_wanted = None, True

    def wait(self, timeout_s: float) -> Frame | None:
        """Wait for the picture that was asked for.

        Parameters
        ----------
        timeout_s : float

        Returns
        -------
        Frame or None
            None if none came by then.

        Raises
        ------
        CameraError
            If the camera has gone.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._frame is not None or self._gone, timeout_s)
            if self._frame is None and self._gone:
                raise CameraError(self._gone)
            return self._frame

    def read(self) -> Frame | None:
        """Read the next picture of a recording.

        Returns
        -------
        Frame or None
            None at its end.
        """
        frame, self._first = self._first or self._next_of_file(), None
        self.grabbed += frame is not None
        return frame

    def close(self) -> None:
        """Let the camera go."""
        self._is_stopped = True
        if self._thread is None:
            self._capture.release()
        else:
            self._thread.join(_CLOSE_S)

    def _first_of_file(self) -> Frame:
        if (frame := self._next_of_file()) is None:
            self._capture.release()
            remedy = "name a video, pictures that can be opened, or a pattern of them, as left_%02d.png"
            raise CameraError(f"the {self.name} camera {self.source} shows no picture: {remedy}")
        self.size = frame.image.shape[1], frame.image.shape[0]
        return frame

    def _next_of_file(self) -> Frame | None:
        with _quiet():  # a pattern ends where a picture is missing
            is_there, image = self._capture.read()
        return Frame(np.asarray(image, np.uint8), math.nan) if is_there else None

    def _run(self) -> None:
        failed = 0
        try:
            while not self._is_stopped and failed < _FAILED_GRABS:
                if not self._capture.grab():
                    failed += 1
                    time.sleep(_PAUSE_S)
                    continue
                failed, at_s = 0, time.monotonic()
                with self._changed:
                    if self.grabbed:
                        self._intervals.append(at_s - self._last_s)
                    self._last_s, self.grabbed = at_s, self.grabbed + 1
                    if self._is_wanted:
                        self._retrieve(at_s)
        finally:
            with self._changed:
                never = "it opens but sends no picture" if not self.grabbed else "it was unplugged, or the stream ended"
                self._gone = self._gone or f"the {self.name} camera ({self.source}) has gone: {never}"
                self._changed.notify_all()
            self._capture.release()

    def _retrieve(self, at_s: float) -> None:
        is_there, image = self._capture.retrieve()
        if is_there:
            stamp_s = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000 if self.stamped else 0.0
            self._frame, self._is_wanted = Frame(np.asarray(image, np.uint8), stamp_s or at_s), False
            self._changed.notify_all()


def _open(source: str) -> cv2.VideoCapture:
    if source.isdecimal():
        return cv2.VideoCapture(int(source))
    if "://" in source:
        limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, _OPEN_MS, cv2.CAP_PROP_READ_TIMEOUT_MSEC, _READ_MS]
        return cv2.VideoCapture(source, cv2.CAP_FFMPEG, limits)
    return cv2.VideoCapture(source, cv2.CAP_IMAGES if "%" in source else cv2.CAP_ANY)


def _asked(capture: cv2.VideoCapture, wish: CameraWish, *, is_stream: bool) -> Iterator[str]:
    """Ask for all settings; those that were not taken, in words."""
    if not is_stream:
        capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*wish.code))
        if int(capture.get(cv2.CAP_PROP_FOURCC)) != cv2.VideoWriter.fourcc(*wish.code):
            yield f"the format {wish.code}"
    width, height = wish.size or (None, None)
    wanted = (
        ("the width", cv2.CAP_PROP_FRAME_WIDTH, width),
        ("the height", cv2.CAP_PROP_FRAME_HEIGHT, height),
        ("the rate", cv2.CAP_PROP_FPS, wish.fps),
    )
    for what, setting, value in wanted:
        if value is not None and (told := _set(capture, setting, value)):
            yield f"{what} {told}"
    if is_stream:
        if wish.fixed:
            yield "fixed exposure, focus and white balance: an address has no settings, fix them where it is served"
        return
    if wish.fixed:
        yield from _fixed(capture, wish)


def _fixed(capture: cv2.VideoCapture, wish: CameraWish) -> Iterator[str]:
    """Switch what is automatic off: where it stands after a second, or at the value asked for."""
    until_s = time.monotonic() + _SETTLED_S
    while time.monotonic() < until_s and capture.grab():
        pass
    manual = _MANUAL.get(capture.getBackendName(), _MANUAL_ELSEWHERE)
    knobs = (
        ("exposure", cv2.CAP_PROP_AUTO_EXPOSURE, manual, cv2.CAP_PROP_EXPOSURE, wish.exposure),
        ("focus", cv2.CAP_PROP_AUTOFOCUS, 0.0, cv2.CAP_PROP_FOCUS, wish.focus),
        ("white balance", cv2.CAP_PROP_AUTO_WB, 0.0, cv2.CAP_PROP_WB_TEMPERATURE, wish.white_balance_k),
    )
    for what, automatic, off, setting, asked in knobs:
        value = capture.get(setting) if asked is None else asked
        if _set(capture, automatic, off):
            yield f"a fixed {what}: it stays automatic"
        if (told := _set(capture, setting, value)) and asked is not None:
            yield f"the {what} {told}"


def _set(capture: cv2.VideoCapture, setting: int, value: float) -> str:
    """Ask for a value; what came of it if it was another one."""
    is_taken = capture.set(setting, value)
    now = capture.get(setting)
    if (is_taken or setting == cv2.CAP_PROP_FPS) and abs(now - value) <= _CLOSE_ENOUGH * max(abs(value), 1e-9):
        return ""
    return f"{value:g} (it stays at {now:g})" if now > 0 else f"{value:g}"


def _why_not_open(source: str, name: str) -> str:
    head = f"the {name} camera {source} cannot be opened"
    if "://" in source:
        return f"{head}: does the address open in a browser on this machine?"
    if "%" in source:
        return f"{head}: no picture of this pattern; numbers begin at 0 to 4, as left_%02d.png for left_01.png"
    if Path(source).is_dir():
        return f"{head}: it is a folder; stereolib calibrate reads pictures that are taken already"
    if Path(source).is_file():
        return f"{head}: not a readable video; save it as MP4 or AVI (MJPG)"
    if Path(source).suffix:
        return f"{head}: no such file; check its name and folder. It is also a number from 0 on, a device, an address"
    known = sorted(glob.glob("/dev/video*"))
    if (device := f"/dev/video{source}" if source.isdecimal() else source) in known and not os.access(device, os.R_OK):
        return f"{head}: no permission; join the group video (sudo usermod -a -G video $USER) and log in again"
    if device in known:
        return f"{head}: another program has it (fuser {device} names it), or it is a camera's second, silent device"
    there = f"cameras found: {listed(known)}" if known else "no camera was found; plug it in"
    return f"{head}: {there}. A source is a number from 0 on, a device, an address, a video or a pattern"


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep OpenCV from telling in its own words what is told here."""
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    log = cv2.utils.logging
    level = log.getLogLevel()
    log.setLogLevel(log.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        log.setLogLevel(level)
