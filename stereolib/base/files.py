"""One reader and one writer of files: bounded on the way in, whole at any moment on the way out."""

from __future__ import annotations

import difflib
import errno
import json
import os
import re
import secrets
import select
import stat
import time
import tomllib
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import Any

LIMIT_BYTES = 256 * 2**20  # any recording or picture of a rig is far smaller, any laptop's memory larger
TEXT_LIMIT_BYTES = 4 * 2**20  # a calibration is a few kB; a whole ledger some 100
SILENCE_S = 10.0  # a pipe that says nothing for so long has nobody at its other end
NESTING = 64  # levels of brackets, tags or lists; calibrations have four
YAML_NODES = 100_000  # entries after all aliases are followed
_POLL_S = 0.02
_LEFT = re.compile("[0-9a-f]{8}")  # how the name of a file that is being written ends
_BRACKETS = re.compile(r'"(?:\\.|[^"\\])*"|([\[{])|([\]}])|<[?!][^>]*>|<(?!/)[^<>]*[^<>/]>|(</[^<>]*>)', re.DOTALL)


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


def read_json(path: str | PathLike[str]) -> Any:
    """Read a JSON file of bounded size and nesting.

    Parameters
    ----------
    path : path

    Returns
    -------
    object
        Dictionaries, lists, numbers, texts.

    Raises
    ------
    ValueError
        As `read_text`; or it is no JSON, or nested more than `NESTING` deep.
    """
    text = read_text(path)
    try:
        check_nesting(text)
        return json.loads(text)
    except ValueError as error:
        raise ValueError(f"{path}: not a JSON file ({error})") from None


def read_toml(path: str | PathLike[str]) -> dict[str, Any]:
    """Read a TOML file of bounded size and nesting.

    Parameters
    ----------
    path : path

    Returns
    -------
    dict

    Raises
    ------
    ValueError
        As `read_text`; or it is no TOML, or nested more than `NESTING` deep.
    """
    text = read_text(path)
    try:
        check_nesting(text)
        return tomllib.loads(text)
    except ValueError as error:
        raise ValueError(f"{path}: not a TOML file ({error})") from None


def read_yaml(path: str | PathLike[str]) -> Any:
    """Read a YAML file: plain values only, of bounded size, nesting and aliases.

    Parameters
    ----------
    path : path

    Returns
    -------
    object
        Dictionaries, lists, numbers, texts.

    Raises
    ------
    ValueError
        As `read_text`; or it is no YAML, holds more than plain values, is nested more than `NESTING` deep, or its
        aliases unfold to more than `YAML_NODES` entries.
    """
    text = read_text(path)
    try:
        return parse_yaml(text)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def parse_yaml(text: str) -> Any:
    """Parse YAML: plain values only, of bounded nesting and aliases.

    Parameters
    ----------
    text : str

    Returns
    -------
    object
        Dictionaries, lists, numbers, texts.

    Raises
    ------
    ValueError
        As `read_yaml`.

    Examples
    --------
    >>> parse_yaml("a: [1, 2.5]")
    {'a': [1, 2.5]}
    """
    import yaml

    class Bounded(yaml.SafeLoader):
        """Counts the levels and the unfolded entries of each node while it is composed."""

        depth = 0
        sizes: dict[int, int] = {}  # noqa: RUF012 (replaced for each file below)

        def compose_node(self, parent: Any, index: Any) -> Any:
            self.depth += 1
            if self.depth > NESTING:
                raise yaml.YAMLError(f"nested more than {NESTING} deep")
            alias = self.check_event(yaml.AliasEvent)
            node = super().compose_node(parent, index)
            self.depth -= 1
            if alias and id(node) not in self.sizes:
                raise yaml.YAMLError("an alias stands for what it is in")
            children = node.value if isinstance(node, yaml.CollectionNode) else []
            parts = [part for child in children for part in (child if isinstance(child, tuple) else (child,))]
            size = self.sizes.setdefault(id(node), 1 + sum(self.sizes[id(part)] for part in parts))
            if size > YAML_NODES:
                raise yaml.YAMLError(f"its aliases unfold to more than {YAML_NODES} entries")
            return node

    try:
        loader = Bounded(text)
        loader.sizes = {}
        try:
            return loader.get_single_data()
        finally:
            loader.dispose()
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ValueError(f"not a YAML file of plain values ({' '.join(str(error).split())})") from None


def check_nesting(text: str) -> None:
    """Refuse brackets or XML tags nested more than `NESTING` deep: parsers that call themselves run out of stack.

    Parameters
    ----------
    text : str
        JSON, flow YAML or XML.

    Raises
    ------
    ValueError
        If they are.

    Examples
    --------
    >>> check_nesting('{"a": [1, [2, 3]]}')
    >>> check_nesting("[" * 100)
    Traceback (most recent call last):
    ...
    ValueError: nested more than 64 deep
    """
    depth = 0
    for match in _BRACKETS.finditer(text):
        opening, closing, end_tag = match.groups()
        if opening or (match[0][0] == "<" and not end_tag and match[0][1] not in "?!"):
            depth += 1
        elif closing or end_tag:
            depth -= 1
        if depth > NESTING:
            raise ValueError(f"nested more than {NESTING} deep")


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
            held = _hold(stream)
            stream.write(payload)
            stream.flush()
            if target.exists():
                os.chmod(temporary, stat.S_IMODE(target.stat().st_mode))
            if held:  # until it has its name: whoever sweeps leaves it alone
                os.replace(temporary, target)
        if not held:
            os.replace(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
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
        If it is a folder, or the nearest folder above it that exists cannot be written to; the text names it.
    """
    path = Path(path)
    if path.is_dir():
        raise ValueError(f"{path}: is a folder; name a file to write")
    if path.exists() and not path.is_file():
        return
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


def _hold(stream: Any) -> bool:
    """Lock a file as long as it is open, so that nobody sweeps it; False where an open file is safe anyhow."""
    try:
        import fcntl
    except ModuleNotFoundError:  # Windows removes and renames no open file
        return False
    with suppress(OSError):  # a file system without locks
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    return True


def _sweep(target: Path) -> None:
    """Take away what writers of a file that were killed left beside it; those still at work hold theirs."""
    begin = f".{target.name[:100]}."
    for left in target.parent.iterdir():
        if not (left.name.startswith(begin) and _LEFT.fullmatch(left.name[len(begin) :])):
            continue
        with suppress(OSError):
            if os.name != "nt":
                import fcntl

                with left.open("rb") as stream:
                    fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            left.unlink()


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
    if not path.parent.is_dir():
        return f"; there is no folder {path.parent}"
    near = difflib.get_close_matches(path.name, [other.name for other in path.parent.iterdir()], 1)
    return f"; did you mean {near[0]}?" if near else ""


def _size(count: float) -> str:
    """Bytes for people: ``"12 kB"``."""
    for unit in ("bytes", "kB", "MB", "GB"):
        if count < 1000 or unit == "GB":
            return f"{count:.3g} {unit}"
        count /= 1000
    raise AssertionError
