"""The one place where an exception becomes one line for people and an exit code."""

from __future__ import annotations

import errno
import os
import re
import shutil
import signal
import sys
import textwrap
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import NoReturn

#: What libraries say that could not get memory: OpenCV, C++, the system's loader, Python's threads.
_NO_MEMORY = (
    "Insufficient memory",
    "bad_alloc",
    "failed to map segment",
    "annot allocate memory",
    "t start new thread",
)
#: What the library proposes to who calls it from Python; and an argument of its, named before the option that sets it.
_IN_PYTHON, _ARGUMENT = re.compile(r"(?:;|, or,) in Python, [^;)]*"), re.compile(r"\b(\w+) \((--\1)\)")
_IS_FOR = "the calibration is for"
_MAKE_ROOM = "; make room, or write to another place (of temporary files: the variable TMPDIR)"
_REMEDIES = dict.fromkeys((errno.ENOSPC, errno.EDQUOT), _MAKE_ROOM)
_REMEDIES[errno.EACCES] = "; see whether you may read and write there, or name another place"
DONE, REFUSED, WRONG_INPUT, INTERRUPTED = 0, 1, 2, 130
_ENDING = ("SIGTERM", "SIGHUP", "SIGBREAK")  # those of them that a system has


class Refused(ValueError):
    """All that was given is right, but nothing can be told of it."""


class Ended(KeyboardInterrupt):
    """The system ends the command, or its terminal was closed: as Ctrl-C, but nobody waits for what comes after."""


def guarded(run: Callable[[], int], interrupted: str = "") -> int:
    """Run a command; whatever the user can mend comes out as one line on stderr, broken where that is a terminal.

    Parameters
    ----------
    run : callable
        Does the work and returns the exit code.
    interrupted : str
        What an interruption leaves behind, said after Ctrl-C, unless the exception says it.

    Returns
    -------
    int
        The code of `run`; 1 where it raises `Refused`; 2 for wrong input, a file or device that the system refuses, a
        missing extra, or too little memory; 130 when interrupted, or ended by SIGTERM or SIGHUP; 0, without a word,
        when who reads our output has gone (``| head``).

    Raises
    ------
    Exception
        Anything else is a fault of ours and keeps its traceback.
    """
    try:
        with _ended_cleanly():
            code = int(run())
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the interpreter flushes once more at its end
        return DONE
    except (KeyboardInterrupt, Exception) as error:
        if _was_interrupted(error):
            warnings.simplefilter("ignore")  # joblib tells of the work that is dropped with this error
            left = str(error) if isinstance(error, KeyboardInterrupt) else ""
            _say("; ".join(filter(None, ("interrupted", left or interrupted))))
            return INTERRUPTED
        if isinstance(error, ModuleNotFoundError) and error.name and error.name.partition(".")[0] != "stereolib":
            _say(f"error: this needs {error.name}: pip install '.[notebooks]' in the project's folder")
        elif _lacks_memory(error):
            why = getattr(error, "err", "") or str(error) or "none is left"
            _say(f"error: too little memory ({why}): try smaller pictures, or close other programs")
        elif isinstance(error, (ValueError, OSError)) or (isinstance(error, ImportError) and not error.name):
            _say(f"error: {_told(error)}")  # an ImportError without a name is one of ours, which says what to do
            if isinstance(error, Refused):
                return REFUSED
        else:
            raise
    return WRONG_INPUT


@contextmanager
def _ended_cleanly() -> Iterator[None]:
    """Take the way of Ctrl-C for what else ends a command, so that nothing that it began goes on without it."""
    if threading.current_thread() is not threading.main_thread():  # which alone is told of signals
        yield
        return
    owner = os.getpid()

    def end(number: int, _: FrameType | None) -> None:
        if os.getpid() != owner:  # a fork of ours, as if this were not here
            signal.signal(number, signal.SIG_DFL)
            os.kill(os.getpid(), number)
        raise Ended

    numbers = [getattr(signal, name) for name in _ENDING if hasattr(signal, name)]
    ours = [number for number in numbers if signal.getsignal(number) == signal.SIG_DFL]  # nohup's stays
    for number in ours:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def named(*files: Path) -> Iterator[None]:
    """Put the pictures before what the library says of them, unless it says so itself, and behind it what EXIF did."""
    try:
        yield
    except ValueError as error:
        text = str(error)
        if not any(str(file) in text for file in files):
            text = f"{' and '.join(map(str, files))}: {text}"
        _raise_as(_with_turns(text, files), error)


@contextmanager
def turns_named(files: Sequence[Path]) -> Iterator[None]:
    """Say which pictures EXIF turned, if any, behind what the library says of them."""
    try:
        yield
    except ValueError as error:
        _raise_as(_with_turns(str(error), files), error)


def _with_turns(text: str, files: Sequence[Path]) -> str:
    from stereolib.rig import turned_by_exif

    end = "" if text.endswith(("?", ".")) else "."
    return f"{text}{end} {turned}" if (turned := turned_by_exif(files)) else text


def _raise_as(text: str, error: ValueError) -> NoReturn:
    """Raise it with another text, or as it is where that is its own."""
    if text == str(error):
        raise error
    raise ValueError(text) from error


@contextmanager
def calibration_named(calibration: Path | None) -> Iterator[None]:
    """Say which file the calibration is where the library, which is not told, says that it is for other pictures."""
    try:
        yield
    except ValueError as error:
        if calibration is None or _IS_FOR not in str(error):
            raise
        raise ValueError(str(error).replace(_IS_FOR, f"{calibration} is for")) from error


def _was_interrupted(error: BaseException | None) -> bool:
    """Whether Ctrl-C is what it came of: a library that is just being loaded makes an ImportError of it."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _lacks_memory(error: BaseException) -> bool:
    """Whether there was too little memory: for Python, for the system that loads or forks, or for OpenCV."""
    if isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM:
        return True
    is_of_libraries = isinstance(error, (ImportError, RuntimeError)) or type(error).__module__ == "cv2"
    return is_of_libraries and any(words in str(error) for words in _NO_MEMORY)


def _told(error: BaseException) -> str:
    """The system's own words with the file first, anybody else's as they are."""
    if isinstance(error, OSError) and error.strerror:
        place = "" if error.filename is None else f"{os.fsdecode(error.filename)}: "
        remedy = _REMEDIES.get(error.errno or 0, "")
        return f"{place}{error.strerror}{remedy}"
    return without_python(str(error)).strip() or type(error).__name__


def without_python(text: str) -> str:
    """What the library says, without what it proposes to who calls it from Python."""
    return _ARGUMENT.sub(r"\2", _IN_PYTHON.sub("", text))


def as_wide_as_the_terminal(line: str) -> str:
    """Break a line between words where standard error is a terminal; whoever else reads it gets one line.

    Words stay whole, so that a path can be copied.
    """
    if not sys.stderr.isatty():
        return line
    width = shutil.get_terminal_size().columns
    return textwrap.fill(line, width, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)


def _say(text: str) -> None:
    line = as_wide_as_the_terminal(" ".join(f"stereolib: {text}".split()))
    encoding = getattr(sys.stderr, "encoding", None) or "utf-8"
    print(line.encode(encoding, "backslashreplace").decode(encoding), file=sys.stderr)
