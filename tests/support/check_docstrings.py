"""Hold the docstrings of every public name to numpydoc: ``python tests/support/check_docstrings.py``.

Public is what a room offers (its ``__all__``), with the public methods of its classes. A third of the functions must
carry an example that runs.
"""

from __future__ import annotations

import importlib
import inspect
import sys
from collections.abc import Iterator
from typing import Any

from numpydoc.validate import validate

import stereolib

#: A docstring, a summary that begins with a capital and ends with a period, all parameters, returns and yields.
CHECKS = {"GL08", "PR01", "PR02", "PR03", "RT01", "SS01", "SS02", "SS03", "YD01"}
ROOMS = sorted(name for name in stereolib.__all__ if inspect.ismodule(getattr(stereolib, name)))


def public(room: str) -> Iterator[tuple[str, Any]]:
    """Yield each public function and class of a room, and the public methods of its classes, with import paths."""
    module = importlib.import_module(f"stereolib.{room}")
    for name in module.__all__:
        offered = getattr(module, name)
        home = getattr(offered, "__module__", "")
        if not (inspect.isfunction(offered) or inspect.isclass(offered)) or not str(home).startswith("stereolib."):
            continue
        yield f"{home}.{offered.__qualname__}", offered
        for method, value in vars(offered).items() if inspect.isclass(offered) else ():
            if not method.startswith("_") and (callable(value) or isinstance(value, (classmethod, staticmethod))):
                yield f"{home}.{offered.__qualname__}.{method}", value


def problems(room: str) -> list[str]:
    """Return what is wrong with the docstrings of a room, a line each."""
    lines = []
    for path, offered in public(room):
        fields_are_attributes = inspect.isclass(offered)  # what a dataclass takes is what it holds
        for code, text in validate(path)["errors"]:
            if code in CHECKS and not (fields_are_attributes and code in ("PR01", "PR02")):
                lines.append(f"{path}: {code} {text}")
    return lines


def examples(room: str) -> tuple[int, int]:
    """Count a room's public functions, and those of them with an example."""
    functions = [offered for _, offered in public(room) if inspect.isfunction(offered)]
    return len(functions), sum(">>> " in (inspect.getdoc(function) or "") for function in functions)


def main() -> int:
    """Print all problems; return 1 if there is one."""
    lines = [line for room in ROOMS for line in problems(room)]
    print(*lines, sep="\n")
    counts = [examples(room) for room in ROOMS]
    with_example, all_of_them = sum(n for _, n in counts), sum(n for n, _ in counts)
    print(f"{len(lines)} problems; {with_example} of {all_of_them} public functions have an example that runs")
    print(*(f"  {room:14}{n:4} of {total}" for room, (total, n) in zip(ROOMS, counts, strict=True)), sep="\n")
    return 1 if lines or 3 * with_example < all_of_them else 0


if __name__ == "__main__":
    sys.exit(main())
