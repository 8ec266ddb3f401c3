"""What a command of the command line is."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Command:
    """One command, or a group of them.

    ``run`` gets the parsed arguments and returns the exit code: 0 done, 1 the work says no, 2 wrong input. A ValueError
    or OSError that it raises becomes one line on stderr. Library modules are imported inside ``run``. ``notes`` stand
    in its help, ``interrupted`` says what Ctrl-C leaves behind. ``before`` are the lines to be typed first, so that the
    example works in an empty folder.
    """

    name: str
    summary: str
    example: str
    run: Callable[[argparse.Namespace], int] | None = None
    configure: Callable[[argparse.ArgumentParser], None] | None = None
    commands: Sequence[Command] = field(default=())
    notes: str = ""
    before: Sequence[str] = field(default=())
    interrupted: str = ""
