"""Lines of code of each room of the library, without docstrings, comments and blanks.

Prints a table; with ``--enforce`` the exit code is 1 when the core has more than its goal.
"""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from pathlib import Path

LIBRARY = Path(__file__).resolve().parents[2] / "stereolib"
CORE = ("base", "rig", "laser", "matching", "calibration", "paper", "measurement")
CORE_GOAL = 6000
_NO_CODE = {
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENCODING,
    tokenize.ENDMARKER,
}  # fmt: skip


def count(source: str) -> int:
    """Lines of a module that hold code."""
    lines = {
        line
        for token in tokenize.generate_tokens(io.StringIO(source).readline)
        if token.type not in _NO_CODE
        for line in range(token.start[0], token.end[0] + 1)
    }
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        if ast.get_docstring(node, clean=False) is not None:
            lines -= set(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    return len(lines)


def rooms(library: Path = LIBRARY) -> dict[str, int]:
    """Lines of code of each package, or module, right below the library."""
    counts: dict[str, int] = {}
    for path in sorted(library.rglob("*.py")):
        room = path.relative_to(library).parts[0].removesuffix(".py")
        counts[room] = counts.get(room, 0) + count(path.read_text(encoding="utf-8"))
    return counts


def main(arguments: list[str]) -> int:
    counts = rooms()
    core = sum(counts.get(room, 0) for room in CORE)
    for room, lines in sorted(counts.items(), key=lambda entry: -entry[1]):
        print(f"{room:20} {lines:6}{'  core' if room in CORE else ''}")
    print(f"{'all':20} {sum(counts.values()):6}\n{'core':20} {core:6}  goal: at most {CORE_GOAL}")
    return int("--enforce" in arguments and core > CORE_GOAL)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
