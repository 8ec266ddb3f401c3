"""Two webcams for those without: a board or a scene before a virtual rig, served as two streams, faults included.

The pictures of a show are rendered once; a camera sends the one that belongs to the present moment, again and again
from the beginning.
"""

from __future__ import annotations

import math
import secrets
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from stereolib.base import Float64
from stereolib.paper import paper_rig
from stereolib.rig import Camera, StereoRig, rigid
from stereolib.virtual.quick import render_quickly
from stereolib.virtual.recordings import BOARD, board_scene, setup
from stereolib.virtual.rendering import render_pair
from stereolib.virtual.staged import Staged
from stereolib.virtual.stereo_boards import draw_board_poses
from stereolib.virtual.webcam import Webcam

_BOUNDARY = "picture"
_SIDES = ("left", "right")
_POLL_S = 0.02
_MOST_PLACES, _MOST_FPS = 1000, 120.0  # more are rendered for hours
_MOVED = 1 / 3  # of the time that the board is held still: how long it then moves
_STILL_PICTURES = 10  # of a scene in which nothing moves: each has noise of its own


@dataclass(frozen=True)
class Show:
    """What both cameras see, picture after picture.

    Attributes
    ----------
    left, right : tuple of bytes
        JPEG files.
    rig : StereoRig
        The truth.
    fps : float
        Pictures a second.
    """

    left: tuple[bytes, ...]
    right: tuple[bytes, ...]
    rig: StereoRig
    fps: float


@dataclass(frozen=True)
class CameraFaults:
    """What goes wrong with a camera; times count from the first reader of either.

    Parameters
    ----------
    late_s : float
        Its pictures come so much later than they were taken.
    drop_rate : float
        Probability of each picture to be lost, 0..1.
    freeze_after_s : float
        From then on it sends nothing, but stays connected.
    unplug_after_s : float
        From then on it is gone.
    """

    late_s: float = 0.0
    drop_rate: float = 0.0
    freeze_after_s: float = np.inf
    unplug_after_s: float = np.inf

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not value >= 0 or (field.name == "drop_rate" and value > 1):
                limits = "0 to 1" if field.name == "drop_rate" else "0 or more, in seconds"
                raise ValueError(f"{field.name} must be {limits}, got {value}")


def show_boards(
    count: int,
    rng: np.random.Generator,
    rig: StereoRig | None = None,
    *,
    fps: float = 10.0,
    held_s: float = 1.0,
    progress: bool = False,
) -> Show:
    """Render somebody who holds a board before a rig, still in one place after the other.

    Parameters
    ----------
    count : int
        Places, as `stereo_boards.draw_board_poses` draws them.
    rng : numpy.random.Generator
        Draws the places and the webcams' noise.
    rig : StereoRig, optional
        Default: that of Table I. `scaled_rig` gives one of smaller pictures.
    fps : float
        Pictures a second.
    held_s : float
        How long the board is held still in a place, s; a third of it later it is in the next one.
    progress : bool
        Show a bar.

    Returns
    -------
    Show

    Raises
    ------
    ValueError
        If a number is out of range.
    """
    from tqdm.auto import tqdm

    if not 1 <= count <= _MOST_PLACES:
        raise ValueError(f"a show has 1 to {_MOST_PLACES} places, got {count}")
    _check_rate(fps)
    rig, webcam = rig or paper_rig(), Webcam()
    poses = draw_board_poses(count, rng, BOARD, rig, progress=progress)
    held, moved = max(1, round(held_s * fps)), max(1, round(held_s * fps * _MOVED))
    ways = list(zip(poses, [*poses[1:], poses[0]], strict=True))
    pairs = []
    for here, there in tqdm(ways, "rendering the show", unit="place", disable=not progress, leave=False):
        for step in range(moved + 1):
            seen = render_quickly(board_scene(_between(here, there, step / (moved + 1))), rig, setup("bench"))
            for _ in range(1 if step else held):
                pairs.append([webcam.encode(webcam.expose(side, rng)) for side in seen])
    left, right = zip(*pairs, strict=True)
    return Show(left, right, rig, fps)


def show_scene(staged: Staged, rng: np.random.Generator, rig: StereoRig | None = None, *, fps: float = 10.0) -> Show:
    """Render a scene in which nothing moves.

    Parameters
    ----------
    staged : Staged
    rng : numpy.random.Generator
        Draws the webcams' noise.
    rig : StereoRig, optional
        Default: that of Table I.
    fps : float
        Pictures a second.

    Returns
    -------
    Show

    Raises
    ------
    ValueError
        If there are too many pictures a second, or none.
    """
    _check_rate(fps)
    rig, webcam = rig or paper_rig(), Webcam()
    seen = render_pair(staged.scene, rig, staged.T_left_world)
    left, right = (tuple(webcam.encode(webcam.expose(side, rng)) for _ in range(_STILL_PICTURES)) for side in seen)
    return Show(left, right, rig, fps)


@contextmanager
def serve_cameras(
    show: Show,
    faults: Sequence[CameraFaults] = (CameraFaults(), CameraFaults()),
    *,
    bus_bytes_per_s: float = np.inf,
    seed: int = 0,
) -> Iterator[tuple[str, str]]:
    """Serve both cameras on this machine, each at an address of its own (MJPEG over HTTP).

    Parameters
    ----------
    show : Show
    faults : (CameraFaults, CameraFaults)
        Of the left and of the right camera.
    bus_bytes_per_s : float
        What the cable of both carries: as on USB, a camera that finds too little left sends nothing.
    seed : int
        Of the pictures that are lost.

    Yields
    ------
    left, right : str
        Addresses.
    """
    stage = _Stage(show.fps, bus_bytes_per_s)
    servers = []
    for k, (side, pictures, fault) in enumerate(zip(_SIDES, (show.left, show.right), faults, strict=True)):
        camera = _Camera(stage, pictures, fault, np.random.default_rng((seed, k)))
        server = ThreadingHTTPServer(("127.0.0.1", 0), camera.handler)
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, args=(_POLL_S,), daemon=True, name=f"{side} camera").start()
        servers.append(server)
    try:
        left, right = (f"http://127.0.0.1:{server.server_address[1]}/{stage.token}/{side}.mjpg" for server, side in
                       zip(servers, _SIDES, strict=True))  # fmt: skip
        yield left, right
    finally:
        stage.closed.set()
        for server in servers:
            server.shutdown()
            server.server_close()


def scaled_rig(rig: StereoRig, scale: float) -> StereoRig:
    """Give a rig whose pictures are larger or smaller.

    Parameters
    ----------
    rig : StereoRig
    scale : float
        0.1 to 4: 0.5 makes 320 x 240 px of 640 x 480.

    Returns
    -------
    StereoRig

    Raises
    ------
    ValueError
        If the scale is out of range.

    Examples
    --------
    >>> scaled_rig(paper_rig(), 0.5).left.size
    (320, 240)
    """
    if not 0.1 <= scale <= 4:
        raise ValueError(f"pictures have a scale of 0.1 to 4, got {scale:g}")
    left, right = (_scaled(camera, scale) for camera in (rig.left, rig.right))
    return StereoRig(left, right, rig.R, rig.T)


class _Stage:
    """What both cameras share: the show's clock, which the first reader starts, and the cable."""

    def __init__(self, fps: float, bus_bytes_per_s: float) -> None:
        self.fps, self.closed = fps, threading.Event()
        self.token = secrets.token_hex(8)  # in the addresses: who does not know them sees nothing
        self._left_bytes_per_s, self._lock, self._start_s = bus_bytes_per_s, threading.Lock(), math.nan

    def now_s(self) -> float:
        with self._lock:
            if math.isnan(self._start_s):
                self._start_s = time.monotonic()
            return time.monotonic() - self._start_s

    def reserve(self, bytes_per_s: float) -> bool:
        """Take a share of the cable, or give it back (negative); False if it has too little left."""
        with self._lock:
            if bytes_per_s > self._left_bytes_per_s:
                return False
            self._left_bytes_per_s -= bytes_per_s
            return True


class _Camera:
    """One camera: sends the picture of the moment to whoever asks."""

    def __init__(
        self, stage: _Stage, pictures: tuple[bytes, ...], faults: CameraFaults, rng: np.random.Generator
    ) -> None:
        self._stage, self._pictures, self._faults, self._rng = stage, pictures, faults, rng
        self._need_bytes_per_s = float(np.mean([len(picture) for picture in pictures])) * stage.fps

    @property
    def handler(self) -> type[BaseHTTPRequestHandler]:
        camera = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                if self.path.startswith(f"/{camera._stage.token}/"):
                    camera._answer(self)
                else:
                    self.send_error(403)

            def log_message(self, *_: Any) -> None:
                pass

        return Handler

    def _answer(self, reader: BaseHTTPRequestHandler) -> None:
        if self._stage.now_s() >= self._faults.unplug_after_s:
            reader.send_error(404)
            return
        reader.send_response(200)
        reader.send_header("Content-Type", f"multipart/x-mixed-replace; boundary={_BOUNDARY}")
        reader.end_headers()
        has_share = False
        try:
            for picture in self._sent():
                has_share = has_share or self._stage.reserve(self._need_bytes_per_s)
                head = f"--{_BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(picture)}\r\n\r\n"
                reader.wfile.write(head.encode() + picture + b"\r\n" if has_share and picture else b"")
                reader.wfile.flush()
                if not has_share and _has_left(reader):
                    return
        except OSError:  # the reader left
            pass
        finally:
            if has_share:
                self._stage.reserve(-self._need_bytes_per_s)

    def _sent(self) -> Iterator[bytes]:
        """The pictures at their moments; empty where one is lost."""
        faults, fps = self._faults, self._stage.fps
        k = math.ceil((self._stage.now_s() - faults.late_s) * fps)
        while True:
            due_s = k / fps + faults.late_s
            if self._stage.closed.wait(max(0.0, due_s - self._stage.now_s())) or due_s >= faults.unplug_after_s:
                return
            is_lost = k < 0 or due_s >= faults.freeze_after_s or self._rng.random() < faults.drop_rate
            yield b"" if is_lost else self._pictures[k % len(self._pictures)]
            k += 1


def _has_left(reader: BaseHTTPRequestHandler) -> bool:
    """Whether somebody who is sent nothing has closed the connection."""
    import select

    ready, _, _ = select.select([reader.connection], [], [], 0)
    return bool(ready) and reader.connection.recv(1) == b""


def _check_rate(fps: float) -> None:
    if not 0 < fps <= _MOST_FPS:
        raise ValueError(f"a show has up to {_MOST_FPS:g} pictures a second, got {fps:g}")


def _between(here: Float64, there: Float64, share: float) -> Float64:
    """A pose on the way."""
    turn = Slerp([0, 1], Rotation.from_matrix([here[:3, :3], there[:3, :3]]))(share).as_matrix()
    return rigid(turn, (1 - share) * here[:3, 3] + share * there[:3, 3])


def _scaled(camera: Camera, scale: float) -> Camera:
    K = camera.K.copy()
    K[:2] *= scale
    K[:2, 2] += (scale - 1) / 2  # the centre of the first pixel is 0
    width, height = camera.size
    return Camera(K, camera.dist, (round(width * scale), round(height * scale)))
