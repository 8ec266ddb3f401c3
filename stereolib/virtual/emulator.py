"""An XV-11 for those without one: packets played at their true rate onto a port, faults included.

A schedule is an iterator of ``(due_s, bytes)``: `replay` makes one from a recording, `emulate` from
the virtual rig, `with_faults` spoils one, and `serve` plays it. A pseudo-terminal takes bytes as
fast as they are written, whatever its baud rate, so the pace is kept here.
"""

from __future__ import annotations

import os
import select
import socket
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, fields, replace
from typing import Literal, TypeAlias

import numpy as np

from stereolib.laser import BAUD, NOMINAL_RPM, PACKETS_PER_TURN, RPM_LIMITS, decode, encode
from stereolib.virtual.lidar import VirtualLidar
from stereolib.virtual.scene import Scene

Schedule: TypeAlias = Iterator[tuple[float, bytes]]
_LINE_BYTES_PER_S = BAUD / 10  # 8N1: a start bit, eight bits, a stop bit
_BATCH_S = 0.01  # what is due within this time is written at once
_BACKLOG_S = 0.1  # of the line: a longer batch is written though nothing waits
_GRACE_S, _LINGER_S = 0.2, 0.2  # pyserial empties the buffer just after opening; and at the end
_RUN_OUT_S = 2.0  # in which a motor without current falls to 1/e of its speed
_TURNS_AT_ONCE = 25  # cast together


def replay(data: bytes) -> Schedule:
    """Schedule a recording: each packet at the time its motor speed tells, bytes in no packet as they fit.

    Packets take ``60 / (90 rpm)`` s, but not less than the line needs for the bytes.

    Parameters
    ----------
    data : bytes
        A recording.

    Yields
    ------
    due_s : float
    data : bytes

    Examples
    --------
    >>> from stereolib.laser import Readings
    >>> packets = encode(Readings.build([0, 1, 2], np.full((3, 4), 500)))
    >>> [(float(due_s.__round__(4)), len(data)) for due_s, data in replay(packets)]
    [(0.0, 22), (0.0022, 22), (0.0044, 22)]
    """
    readings = decode(data)
    rpm = np.where(readings.speed_rpm > 0, readings.speed_rpm, NOMINAL_RPM)
    packet_s = np.append(0.0, 60.0 / rpm / PACKETS_PER_TURN)
    begins = np.append(0, readings.offset)
    due_s = 0.0
    for begin, end, least_s in zip(begins, np.append(begins[1:], len(data)), packet_s, strict=True):
        if end > begin:
            yield due_s, data[begin:end]
            due_s += max((end - begin) / _LINE_BYTES_PER_S, least_s)


def emulate(
    scene: Scene,
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
    *,
    lidar: VirtualLidar | None = None,
    rng: np.random.Generator,
    seconds: float = np.inf,
) -> Schedule:
    """Schedule the virtual rig's laser, turning in a scene (for ever, if no time is given).

    Parameters
    ----------
    scene : Scene
    pose : (x_mm, y_mm, yaw_rad)
        Where the sensor stands.
    lidar : VirtualLidar, optional
    rng : numpy.random.Generator
    seconds : float
        Length of the schedule, s.

    Yields
    ------
    due_s : float
    data : bytes
    """
    sensor, due_s = lidar or VirtualLidar(), 0.0
    while True:
        for packet_due_s, packet in replay(sensor.scan(scene, pose, rng, turns=_TURNS_AT_ONCE)):
            if due_s + packet_due_s >= seconds:
                return
            yield due_s + packet_due_s, packet
        due_s += packet_due_s + 60.0 / sensor.speed_rpm / PACKETS_PER_TURN


@dataclass(frozen=True)
class Faults:
    """What goes wrong on the way.

    Parameters
    ----------
    bit_error_rate, lost_byte_rate : float
        Probability for each bit to flip and for each byte to be lost, 0..1.
    stall_every_s, stall_s : float
        Every so often the line is silent for so long; what was due then is lost.
    spin_down_after_s : float
        From then on the motor runs out (to 1/e in 2 s); below 180 rpm the sensor is silent.
    disconnect_after_s : float
        Then the port goes away.
    """

    bit_error_rate: float = 0.0
    lost_byte_rate: float = 0.0
    stall_every_s: float = np.inf
    stall_s: float = 0.0
    spin_down_after_s: float = np.inf
    disconnect_after_s: float = np.inf

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not value >= 0 or (field.name.endswith("rate") and value > 1):
                limits = "0 to 1" if field.name.endswith("rate") else "0 or more, in seconds"
                raise ValueError(f"{field.name} must be {limits}, got {value}")
        if self.stall_every_s <= 0:
            raise ValueError("stall_every_s must be more than 0, in seconds")


def with_faults(schedule: Schedule, faults: Faults, rng: np.random.Generator) -> Schedule:
    """Spoil a schedule; it ends where the port is to be disconnected.

    Parameters
    ----------
    schedule : iterator of (due_s, bytes)
    faults : Faults
    rng : numpy.random.Generator
        Draws the flipped bits and lost bytes.

    Yields
    ------
    due_s : float
    data : bytes
    """
    late_s = 0.0
    for on_time_s, data in schedule:
        due_s = on_time_s + late_s
        if due_s >= faults.disconnect_after_s:
            return
        if due_s >= faults.spin_down_after_s:
            slower = float(np.exp((faults.spin_down_after_s - due_s) / _RUN_OUT_S))
            readings = decode(data)
            rpm = readings.speed_rpm * slower
            silent = len(rpm) == 0 or rpm[-1] < RPM_LIMITS[0]
            data = b"" if silent else encode(replace(readings, speed_rpm=rpm))
            if not silent:
                late_s += (1 / slower - 1) * 60.0 / NOMINAL_RPM / PACKETS_PER_TURN
        if due_s % faults.stall_every_s > faults.stall_every_s - faults.stall_s:
            continue
        values = np.frombuffer(data, np.uint8)
        flips = rng.random((len(values), 8)) < faults.bit_error_rate
        values = values ^ np.packbits(flips, axis=1)[:, 0]
        yield due_s, values[rng.random(len(values)) >= faults.lost_byte_rate].tobytes()


class Served:
    """A schedule being played; `port` is what to open.

    It starts when the first reader opens the port. Bytes that the reader does not fetch in time are
    dropped, as by a UART, and counted in `dropped`.

    Parameters
    ----------
    schedule : iterable of (due_s, bytes)
    link : pseudo-terminal or socket
        What it is played on; `serve` makes one.
    """

    def __init__(self, schedule: Iterable[tuple[float, bytes]], link: _Pty | _Socket) -> None:
        self.port, self.sent, self.dropped = link.port, 0, 0
        self._link, self._schedule, self._stop = link, schedule, threading.Event()
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="lidar emulator", daemon=True)
        self._thread.start()

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait for the end of the schedule.

        Parameters
        ----------
        timeout_s : float, optional
            Longest wait, s.

        Returns
        -------
        bool
            False if the end has not come by then.

        Raises
        ------
        Exception
            What the schedule raised, if that was its end.
        """
        self._thread.join(timeout_s)
        if self._error is not None:
            raise self._error
        return not self._thread.is_alive()

    def close(self) -> None:
        """Stop playing and take the port away."""
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            if not self._link.wait(self._stop):
                return
            start_s, due_s, waiting = time.monotonic(), 0.0, bytearray()
            for due_s, data in self._schedule:
                if start_s + due_s > time.monotonic() + _BATCH_S:
                    self._send(waiting)
                    if self._stop.wait(start_s + due_s - time.monotonic()):
                        return
                waiting += data
                if len(waiting) > _LINE_BYTES_PER_S * _BACKLOG_S:
                    self._send(waiting)
            self._send(waiting)
            self._stop.wait(_LINGER_S)  # let the reader fetch the last bytes
        except Exception as error:
            self._error = error  # for `wait`: nobody sees what a thread ends with
        finally:
            self._link.close()

    def _send(self, waiting: bytearray) -> None:
        sent = self._link.send(bytes(waiting)) if waiting else 0
        self.sent += sent
        self.dropped += len(waiting) - sent
        waiting.clear()


@contextmanager
def serve(schedule: Iterable[tuple[float, bytes]], link: Literal["auto", "pty", "socket"] = "auto") -> Iterator[Served]:
    """Play a schedule on a new port: ``with serve(replay(data)) as served: print(served.port)``.

    Parameters
    ----------
    schedule : iterable of (due_s, bytes)
    link : {"auto", "pty", "socket"}
        A pseudo-terminal, or a TCP socket of this machine (``socket://127.0.0.1:n``), which
        "auto" takes where there are no pseudo-terminals.

    Yields
    ------
    Served

    Raises
    ------
    ValueError
        For a link that does not exist here.
    """
    if link not in ("auto", "pty", "socket"):
        raise ValueError(f'link must be "auto", "pty" or "socket", got {link!r}')
    has_pty = hasattr(os, "openpty")
    if link == "pty" and not has_pty:
        raise ValueError('this system has no pseudo-terminals; use link="socket"')
    served = Served(schedule, _Pty() if has_pty and link != "socket" else _Socket())
    try:
        yield served
    finally:
        served.close()
    served.wait()


class _Pty:
    """A pseudo-terminal in raw mode; the reader opens `port`."""

    def __init__(self) -> None:
        self._master, self._slave = os.openpty()
        self.port = os.ttyname(self._slave)
        os.close(self._slave)  # so that a reader's coming can be seen
        self._slave = -1
        os.set_blocking(self._master, False)

    def wait(self, stop: threading.Event) -> bool:
        import tty

        poll = select.poll()
        poll.register(self._master, 0)  # tells only of a hang-up: nobody has the port open
        while any(event & select.POLLHUP for _, event in poll.poll(0)):
            if stop.wait(0.01):
                return False
        self._slave = os.open(self.port, os.O_RDWR | os.O_NOCTTY)  # keeps it up between readers
        tty.setraw(self._slave)
        return not stop.wait(_GRACE_S)

    def send(self, data: bytes) -> int:
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        for handle in (self._slave, self._master):
            if handle >= 0:
                os.close(handle)
        self._slave = self._master = -1


class _Socket:
    """A TCP server on the loopback interface, for one reader at a time."""

    def __init__(self) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.settimeout(0.02)
        self._client: socket.socket | None = None
        self.port = f"socket://127.0.0.1:{self._server.getsockname()[1]}"

    def wait(self, stop: threading.Event) -> bool:
        while not stop.is_set():
            with suppress(TimeoutError):
                self._client, _ = self._server.accept()
                self._client.setblocking(False)
                return not stop.wait(_GRACE_S)
        return False

    def send(self, data: bytes) -> int:
        if self._client is None:
            self._server.setblocking(False)
            with suppress(BlockingIOError):
                self._client, _ = self._server.accept()
                self._client.setblocking(False)
            return 0
        try:
            return self._client.send(data)
        except BlockingIOError:
            return 0
        except OSError:  # the reader left
            self._client.close()
            self._client = None
            return 0

    def close(self) -> None:
        for end in (self._client, self._server):
            if end is not None:
                end.close()
