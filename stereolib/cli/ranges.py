"""Numbers on the command line: what an option takes, said where it is declared."""

from __future__ import annotations

import argparse
from collections.abc import Callable

MM = 1e6  # a kilometre, beyond which no length of a rig, a board or a room lies
FOR_EVER = float("inf")  # seconds


def number(least: float, most: float) -> Callable[[str], float]:
    """A number within these limits, as the ``type`` of an option; NaN lies in none."""

    def convert(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text!r} is not a number {_limits(least, most)}")
        return value

    return convert


def whole(least: int, most: int) -> Callable[[str], int]:
    """A whole number within these limits, as the ``type`` of an option."""

    def convert(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text!r} is not a whole number {_limits(least, most)}")
        return value

    return convert


def _limits(least: float, most: float) -> str:
    return f"of {least:g} or more" if most == FOR_EVER else f"from {least:.10g} to {most:.10g}"
