"""One reader and one writer of files: bounded on the way in, whole at any moment on the way out."""

from __future__ import annotations

import difflib
import errno
import os
import re
import secrets
import select
import stat
import time
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import Any

LIMIT_BYTES = 256 * 2**20  # any recording or picture of a rig is far smaller, any laptop's memory larger
TEXT_LIMIT_BYTES = 4 * 2**20  # a calibration is a few kB; a whole ledger some 100
SILENCE_S = 10.0  # a pipe that says nothing for so long has nobody at its other end
_POLL_S = 0.02
_ALIKE = 0.8  # of a file's name to that of one that is there, as `difflib` counts: less alike ones are not suggested
_LEFT = re.compile("[0-9a-f]{8}")  # how the name of a file that is being written ends


def read_bytes(path: str | PathLike[str], *, limit_bytes: int = LIMIT_BYTES, silence_s: float | None = None) -> bytes:
    """Read a regular file, or what a pipe delivers until it is closed.

    Parameters
    ----------
    path : path
    limit_bytes : int
        The most that is read, bytes.
    silence_s : float, optional
        The longest wait for a pipe's next byte, s; default: `SILENCE_S`.

    Returns
    -------
    bytes

    Raises
    ------
    ValueError
        If there is no such file, it is a folder or a device, holds more than `limit_bytes`, or is a pipe that
        says nothing for `silence_s`. The text names the file and the remedy.
    OSError
        If the system refuses, for example for want of permission.

    Examples
    --------
    >>> read_bytes("no/such/scan.bin")
    Traceback (most recent call last):
    ...
    ValueError: no/such/scan.bin: no such file; there is no folder no/such
    """
    path = Path(path)
    try:
        kind = path.stat()
    except (FileNotFoundError, NotADirectoryError):
        raise ValueError(f"{path}: no such file{_hint(path)}") from None
    except ValueError as error:  # a NUL in the name
        raise ValueError(f"{str(path)!r}: not the name of a file ({error})") from None
    if stat.S_ISDIR(kind.st_mode):
        raise ValueError(f"{path}: is a folder; name a file in it")
    if stat.S_ISFIFO(kind.st_mode):
        return _read_pipe(path, limit_bytes, SILENCE_S if silence_s is None else silence_s)
    if not stat.S_ISREG(kind.st_mode):
        raise ValueError(f"{path}: is a device, not a file; record from it into a file first")
    if kind.st_size > limit_bytes:
        raise ValueError(f"{path}: {_size(kind.st_size)}, at most {_size(limit_bytes)} are read; is it the right file?")
    with path.open("rb") as stream:
        return stream.read(limit_bytes)


def read_text(path: str | PathLike[str], *, limit_bytes: int = TEXT_LIMIT_BYTES) -> str:
    """Read a text file in UTF-8, with or without a byte order mark.

    Parameters
    ----------
    path : path
    limit_bytes : int
        The most that is read, bytes.

    Returns
    -------
    str
        With ``\\n`` at the end of lines.

    Raises
    ------
    ValueError
        As `read_bytes`; or it is not in UTF-8.
    """
    try:
        return read_bytes(path, limit_bytes=limit_bytes).decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise ValueError(
            f"{path}: not a text file in UTF-8 (byte {error.start} is 0x{error.object[error.start]:02x})"
        ) from None


def write_atomic(path: str | PathLike[str], data: bytes | str) -> Path:
    """Write a file beside its place and then move it there: readers see the old or the new one, whole.

    Parameters
    ----------
    path : path
        Folders above it are made. What a symbolic link points at is replaced, not the link. A device or a pipe
        (``/dev/null``) is written to, not replaced.
    data : bytes or str
        Text is written in UTF-8 as it stands.

    Returns
    -------
    Path
        Where it was written.

    Raises
    ------
    ValueError
        If `path` is a folder, or a pipe that nobody reads.
    OSError
        If the system refuses: no permission, no space. What stood there before is whole.
    """
    path = Path(path)
    payload = data.encode("utf-8") if isinstance(data, str) else data
    if path.is_dir():
        raise ValueError(f"{path}: is a folder; name a file to write")
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.exists() and not path.is_file():
        with os.fdopen(_open_to_write(path), "wb") as stream:
            stream.write(payload)
        return path
    target = Path(os.path.realpath(path))
    _sweep(target)
    temporary = _beside(target)
    try:
        descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        with os.fdopen(descriptor, "wb") as stream:
            held = hold(stream)
            stream.write(payload)
            stream.flush()
            if target.exists():
                os.chmod(temporary, stat.S_IMODE(target.stat().st_mode))
            if held:  # until it has its name: whoever sweeps leaves it alone
                os.replace(temporary, target)
        if not held:
            os.replace(temporary, target)
    except BaseException as error:
        temporary.unlink(missing_ok=True)
        if (
            isinstance(error, OSError) and error.errno is not None
        ):  # not the name beside it, nor none as when the disk is full
            error.filename = os.fspath(path)
        raise
    return path


def check_name(path: str | PathLike[str]) -> None:
    r"""Refuse a name that is no text: OpenCV crashes on it, and no figure can show it.

    Parameters
    ----------
    path : path

    Raises
    ------
    ValueError
        If it is not in UTF-8.

    Examples
    --------
    >>> check_name("left/01.png")
    >>> check_name("left/01\udcff.png")
    Traceback (most recent call last):
    ...
    ValueError: 'left/01\udcff.png': the name is not in UTF-8; rename it
    """
    try:
        os.fspath(path).encode("utf-8")
    except UnicodeEncodeError:
        raise ValueError(f"{os.fspath(path)!r}: the name is not in UTF-8; rename it") from None


def check_target(path: str | PathLike[str]) -> None:
    """Find out before long work whether a file can be written; nothing is made or left there.

    Parameters
    ----------
    path : path
        Where a file is to be written later; folders above it may be missing.

    Raises
    ------
    ValueError
        If it is a folder, a file that is write-protected, or the nearest folder above it that exists cannot be
        written to; the text names it.
    """
    path = Path(path)
    if path.is_dir():
        raise ValueError(f"{path}: is a folder; name a file to write")
    if path.exists() and not path.is_file():
        return
    if path.exists() and not os.access(path, os.W_OK):
        raise ValueError(f"{path}: cannot be written, it is write-protected; lift that, or choose another place")
    folder = next(above for above in Path(os.path.abspath(path)).parents if above.exists())
    probe = _beside(folder / path.name)
    try:
        probe.open("xb").close()
        probe.unlink()
    except OSError as error:
        raise ValueError(f"{path}: cannot be written ({error.strerror or error}); choose another place") from None


def _beside(target: Path) -> Path:
    """A new name beside a file, by which `_sweep` knows it again."""
    return target.with_name(f".{target.name[:100]}.{secrets.token_hex(4)}")


def hold(stream: Any) -> bool:
    """Lock a file as long as it is open, so that `unlink_unheld` leaves it.

    Parameters
    ----------
    stream : file

    Returns
    -------
    bool
        False where an open file is safe anyhow.
    """
    try:
        import fcntl
    except ModuleNotFoundError:  # Windows removes and renames no open file
        return False
    with suppress(OSError):  # a file system without locks
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    return True


def unlink_unheld(path: Path) -> None:
    """Remove a file, unless a process that lives holds it.

    Parameters
    ----------
    path : Path

    Raises
    ------
    OSError
        If it is held, or the system refuses.
    """
    if os.name != "nt":
        import fcntl

        with path.open("rb") as stream:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    path.unlink()


def _sweep(target: Path) -> None:
    """Take away what writers of a file that were killed left beside it; those still at work hold theirs."""
    begin = f".{target.name[:100]}."
    for left in target.parent.iterdir():
        if left.name.startswith(begin) and _LEFT.fullmatch(left.name[len(begin) :]):
            with suppress(OSError):
                unlink_unheld(left)


def _open_to_write(path: Path) -> int:
    """Open a device or a pipe; nobody who reads the pipe is waited for longer than `SILENCE_S`."""
    flags, end = os.O_WRONLY | getattr(os, "O_NONBLOCK", 0), time.monotonic() + SILENCE_S
    while True:
        try:
            descriptor = os.open(path, flags)
            break
        except OSError as error:
            if error.errno != errno.ENXIO:
                raise
        if time.monotonic() > end:
            raise ValueError(f"{path}: nobody reads this pipe; start the reader first, or name a file")
        time.sleep(_POLL_S)
    if hasattr(os, "O_NONBLOCK"):
        os.set_blocking(descriptor, True)
    return descriptor


def _read_pipe(path: Path, limit_bytes: int, silence_s: float) -> bytes:
    """Read until the writer closes; one that has not come yet is waited for."""
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    data, heard = bytearray(), time.monotonic()
    try:
        while len(data) <= limit_bytes:
            ready, _, _ = select.select([descriptor], [], [], max(0.0, heard + silence_s - time.monotonic()))
            chunk = os.read(descriptor, 1 << 16) if ready else b""
            if chunk:
                data += chunk
                heard = time.monotonic()
            elif ready and data:
                return bytes(data)
            elif time.monotonic() - heard >= silence_s:
                raise ValueError(f"{path}: this pipe says nothing for {silence_s:g} s; is anything writing to it?")
            else:
                time.sleep(_POLL_S)
    finally:
        os.close(descriptor)
    raise ValueError(f"{path}: this pipe delivers more than {_size(limit_bytes)}; is it the right one?")


def _hint(path: Path) -> str:
    """What else the user may have meant by a name that is not there."""
    if path.is_symlink():
        return f"; it is a link to {os.readlink(path)}, which is not there"
    if not path.parent.is_dir():
        return f"; there is no folder {path.parent}"
    near = difflib.get_close_matches(path.name, [other.name for other in path.parent.iterdir()], 1, _ALIKE)
    return f"; did you mean {near[0]}?" if near else ""


def _size(count: float) -> str:
    """Bytes for people: ``"12 kB"``."""
    for unit in ("bytes", "kB", "MB", "GB"):
        if count < 1000 or unit == "GB":
            return f"{count:.3g} {unit}"
        count /= 1000
    raise AssertionError
