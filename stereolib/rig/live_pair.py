"""Two live cameras as one: pairs of one moment, how far apart their moments are, and what two on one cable do."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stereolib.base import UInt8
from stereolib.rig.live_camera import CameraError, CameraWish, Frame, LiveCamera

_FIRST_S = 5.0  # in which a camera that works sends its first picture
_SILENT_S = 3.0  # and each later one
_APART_S = 10.0  # in which one pair at least must be of one moment
_NEARER = 0.5  # of the time between pictures: beyond it the next picture of the earlier camera is nearer
_KEPT = 10_000  # skews of so many pairs
_P95 = 95.0


class LivePair(NamedTuple):
    """Two pictures, (H, W, 3) uint8, and how far apart their moments are, ms; NaN from recordings."""

    left: UInt8
    right: UInt8
    skew_ms: float


class LiveRig:
    """Both cameras, opened; `pairs` gives what they see.

    Parameters
    ----------
    left, right : str
        Sources, as `LiveCamera` has them.
    wish : CameraWish, optional
    max_skew_ms : float
        Pairs farther apart are dropped and counted.

    Attributes
    ----------
    cameras : (LiveCamera, LiveCamera)
    dropped : int
        Pairs that were too far apart.
    skew_name : str
        What the skew is a difference of.

    Raises
    ------
    CameraError
        If a camera cannot be opened, or sends nothing; if each delivers alone and not both together, it says so.
    ValueError
        If both are the same, one is live and the other recorded, or their pictures differ in size.
    """

    def __init__(self, left: str, right: str, wish: CameraWish | None = None, *, max_skew_ms: float = 50.0) -> None:
        if not max_skew_ms > 0:
            raise ValueError(f"the longest skew must be more than 0 ms, got {max_skew_ms:g}")
        if _place(left) == _place(right):
            same = left if left == right else f"{left} and {right} are one camera: it"
            raise ValueError(f"{same} was given for both cameras: name the right one's, too")
        self.max_skew_ms, self.dropped, self._skews_ms = max_skew_ms, 0, deque[float](maxlen=_KEPT)
        self.cameras: tuple[LiveCamera, ...] = ()
        self._wish = wish
        try:
            self.cameras = (LiveCamera(left, "left", wish),)
            self.cameras += (self._open_beside(right),)
            self._check()
        except BaseException:
            self.close()
            raise

    @property
    def recorded(self) -> bool:
        """Both are files."""
        return all(camera.recorded for camera in self.cameras)

    @property
    def size(self) -> tuple[int, int]:
        """Of the pictures, (width, height), px."""
        return self.cameras[0].size

    @property
    def skew_name(self) -> str:
        """What the skew is a difference of."""
        by_drivers = all(camera.stamped for camera in self.cameras)
        return "by the drivers' time stamps" if by_drivers else "between the arrivals of both pictures"

    @property
    def skew_p95_ms(self) -> float:
        """95th percentile of the skews of all pairs, dropped ones too; NaN before the first and of recordings."""
        return float(np.percentile(self._skews_ms, _P95)) if self._skews_ms else math.nan

    @property
    def rates_hz(self) -> tuple[float, ...]:
        """Pictures a second that each camera delivers; NaN where not known."""
        return tuple(1 / camera.interval_s for camera in self.cameras)

    def pairs(self) -> Iterator[LivePair]:
        """Give pairs as they come, the newest of both cameras; those too far apart are dropped.

        Yields
        ------
        LivePair

        Raises
        ------
        CameraError
            If a camera falls silent or has gone, or no pair is of one moment.
        """
        near_s = time.monotonic()
        while (pair := self._recorded_pair() if self.recorded else self._live_pair()) is not None:
            if pair.skew_ms > self.max_skew_ms:
                self.dropped += 1
                if time.monotonic() - near_s > _APART_S:
                    raise CameraError(self._apart())
            else:
                yield pair
                near_s = time.monotonic()

    def close(self) -> None:
        """Let both cameras go."""
        for camera in self.cameras:
            camera.close()

    def _apart(self) -> str:
        ms = float(np.median(self._skews_ms))
        return (
            f"the pictures of both cameras are {ms:.0f} ms apart in half of the pairs, and for {_APART_S:g} s none was "
            f"within {self.max_skew_ms:g} ms: ask for more pictures a second (--fps), or allow it (--max-skew-ms "
            f"{math.ceil(2 * ms)}) where nothing moves"
        )

    def _open_beside(self, source: str) -> LiveCamera:
        """Open the right camera; if that fails while the left one runs, see whether it would go alone."""
        try:
            return LiveCamera(source, "right", self._wish)
        except CameraError:
            self.close()
            if not self.cameras[0].recorded and _delivers_alone(source, "right", self._wish):
                raise CameraError(_on_one_cable(f"the right camera ({source})")) from None
            raise

    def _check(self) -> None:
        left, right = self.cameras
        if left.recorded != right.recorded:
            raise ValueError(f"{left.source} and {right.source}: one is a file, the other live; they share no moment")
        if not self.recorded:
            self._wait_for_first()
        if left.size != right.size:
            sizes = [f"{camera.source} sends {camera.size[0]}x{camera.size[1]}" for camera in self.cameras]
            raise ValueError(f"{' and '.join(sizes)}: both must have one size, ask for it with size (--size)")

    def _wait_for_first(self) -> None:
        """See that both deliver; where one does not, try it alone to tell the cable from the camera."""
        silent = []
        for camera in self.cameras:
            camera.ask()
        until_s = time.monotonic() + _FIRST_S
        for camera in self.cameras:
            frame = _frame_or_none(camera, until_s - time.monotonic())
            if frame is None:
                silent.append(camera)
            else:
                camera.size = frame.image.shape[1], frame.image.shape[0]
        if not silent:
            return
        names = " and ".join(f"the {camera.name} camera ({camera.source})" for camera in silent)
        self.close()
        if all(_delivers_alone(camera.source, camera.name, self._wish) for camera in silent):
            raise CameraError(_on_one_cable(names))
        raise CameraError(f"{names} opens but sends no picture, alone either: unplug it and plug it in again")

    def _recorded_pair(self) -> LivePair | None:
        left, right = (camera.read() for camera in self.cameras)
        return LivePair(left.image, right.image, math.nan) if left and right else None

    def _live_pair(self) -> LivePair:
        for camera in self.cameras:
            camera.ask()
        frames = [_frame(camera) for camera in self.cameras]
        first = 0 if frames[0].at_s < frames[1].at_s else 1
        skew_s = frames[1 - first].at_s - frames[first].at_s
        if skew_s > _NEARER * self.cameras[first].interval_s:  # its next picture may be nearer
            self.cameras[first].ask()
            later = _frame(self.cameras[first])
            if abs(later.at_s - frames[1 - first].at_s) < skew_s:
                frames[first] = later
        skew_ms = 1000 * abs(frames[0].at_s - frames[1].at_s)
        self._skews_ms.append(skew_ms)
        return LivePair(frames[0].image, frames[1].image, skew_ms)


def _place(source: str) -> str:
    """One name for a source that may be written in several ways."""
    if "://" in source or "%" in source:
        return source
    return str(Path(f"/dev/video{source}" if source.isdecimal() else source).resolve())


def _frame(camera: LiveCamera) -> Frame:
    if (frame := camera.wait(_SILENT_S)) is None:
        why = "it froze, or its cable carries no more"
        raise CameraError(
            f"the {camera.name} camera ({camera.source}) has sent nothing for {_SILENT_S:g} s: {why}; plug it in again"
        )
    return frame


def _frame_or_none(camera: LiveCamera, timeout_s: float) -> Frame | None:
    try:
        return camera.wait(max(timeout_s, 0.0))
    except CameraError:
        return None


def _on_one_cable(names: str) -> str:
    return (
        f"{names} delivers alone, but nothing while both run: together they need more than their cable carries. Plug "
        f"one into another port (not the same hub), ask for MJPG (--code MJPG) or a smaller size (--size 640x480)"
    )


def _delivers_alone(source: str, name: str, wish: CameraWish | None) -> bool:
    try:
        alone = LiveCamera(source, name, wish)
    except CameraError:
        return False
    alone.ask()
    try:
        return _frame_or_none(alone, _FIRST_S) is not None
    finally:
        alone.close()
