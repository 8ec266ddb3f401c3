"""The one place where an exception becomes one line for people and an exit code."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

DONE, REFUSED, WRONG_INPUT, INTERRUPTED = 0, 1, 2, 130


def guarded(run: Callable[[], int], interrupted: str = "") -> int:
    """Run a command; whatever the user can mend comes out as one line on stderr.

    Parameters
    ----------
    run : callable
        Does the work and returns the exit code.
    interrupted : str
        What an interruption leaves behind, said after Ctrl-C.

    Returns
    -------
    int
        The code of `run`; 2 for wrong input, a file or device that the system refuses, a missing extra, or too little
        memory; 130 when interrupted; 0, without a word, when who reads our output has gone (``| head``).

    Raises
    ------
    Exception
        Anything else is a fault of ours and keeps its traceback.
    """
    try:
        code = int(run())
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the interpreter flushes once more at its end
        return DONE
    except KeyboardInterrupt:
        _say("; ".join(filter(None, ("interrupted", interrupted))))
        return INTERRUPTED
    except ModuleNotFoundError as error:
        if not error.name or error.name.partition(".")[0] == "stereolib":
            raise
        _say(f'error: this needs {error.name}: pip install "stereolib[notebooks]"')
    except MemoryError as error:
        _say(
            f"error: too little memory ({str(error) or 'none is left'}): try smaller pictures, or close other programs"
        )
    except (ValueError, OSError) as error:
        _say(f"error: {_told(error)}")
    return WRONG_INPUT


@contextmanager
def named(*files: object) -> Iterator[None]:
    """Put the files before what the library says of what it was given of them, unless it says so itself."""
    try:
        yield
    except ValueError as error:
        text = str(error)
        if any(str(file) in text for file in files):
            raise
        raise ValueError(f"{' and '.join(map(str, files))}: {text}") from error


def _told(error: Exception) -> str:
    """The system's own words with the file first, anybody else's as they are."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{os.fsdecode(error.filename)}: {error.strerror}"
    return str(error).strip() or type(error).__name__


def _say(text: str) -> None:
    line = " ".join(f"stereolib: {text}".split())
    encoding = getattr(sys.stderr, "encoding", None) or "utf-8"
    print(line.encode(encoding, "backslashreplace").decode(encoding), file=sys.stderr)
