"""A verdict that could have been the other one: the same item, judged from two sets of data."""

from __future__ import annotations

import ast
from pathlib import Path

from stereolib.paper import compare_with_paper, published

FAVOURABLE = ("reproduced", "agrees", "meets the truth", "follows")


def verdict_of(id: str, ours, **how) -> str:
    return compare_with_paper({id: ours}, **how).loc[0, "verdict"]


def assert_turns(id: str, holds, broken, **how) -> None:
    """What data gave that bear the item out, and what data gave that break it: the verdict must turn.


    Both are what `compare_with_paper` takes, computed by the functions that the notebook calls. Every condition of a
    claim must turn: together they hold for the one and fail for the other.
    """
    assert published()[id].kind in ("test", "built in")
    assert verdict_of(id, holds, **how) in FAVOURABLE
    assert verdict_of(id, broken, **how) in ("differs", "does not hold", "misses the truth", "does not follow")


def turned_ids(tests: Path) -> set[str]:
    """Ids that some test hands to `assert_turns` as its first, literal argument."""
    found = set()
    for path in tests.rglob("test_*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            called = isinstance(node, ast.Call) and getattr(node.func, "id", "") == "assert_turns"
            if called and node.args and isinstance(node.args[0], ast.Constant):
                found.add(node.args[0].value)
    return found
