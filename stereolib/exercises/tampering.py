"""What a cell of exercises has no reason to touch: looked for in its text, before anything runs.

The checker runs in the same process as the student's code, so no check inside it is safe from that code. This one looks
at the text from outside. It finds the plain ways of changing the checker, not every thinkable one.
"""

from __future__ import annotations

import ast

#: Modules and functions that reach into other code; no exercise needs one.
REFUSED_NAMES = frozenset(
    """IPython __import__ builtins ctypes delattr eval exec exit gc get_ipython getattr globals importlib inspect locals
    nbgrader os quit setattr subprocess sys vars""".split()  # noqa: SIM905 (a list would be twenty lines)
)
_KEPT = "exercise"  # the name that the check cells use
_ALLOWED = f"from stereolib.exercises import {_KEPT}"  # as they import it
_NEW_MEANING = f"it gives the name {_KEPT} a new meaning"


def refuse_tampering(source: str) -> str:
    """Say what in a cell may change the checker.

    Parameters
    ----------
    source : str
        Code of a cell.

    Returns
    -------
    str
        A sentence; empty where there is nothing, and for code that does not parse, which does nothing.

    Examples
    --------
    >>> refuse_tampering("depth_mm = 3 * 4")
    ''
    >>> refuse_tampering("def exercise(*_): ...")
    'it gives the name exercise a new meaning'
    >>> refuse_tampering("import stereolib.exercises as e")
    'it imports stereolib.exercises'
    """
    if any(line.lstrip().startswith(("%", "!")) for line in source.splitlines()):
        return "it calls a command of the notebook or of the system (a line that begins with % or !)"
    try:
        nodes = list(ast.walk(ast.parse(source)))
    except (SyntaxError, ValueError):
        return ""
    return next(filter(None, map(_suspicion, nodes)), "")


def _suspicion(node: ast.AST) -> str:
    if isinstance(node, (ast.Import, ast.ImportFrom)):
        return "" if ast.unparse(node) == _ALLOWED else _imports(node)
    if isinstance(node, ast.Name) and node.id in REFUSED_NAMES:
        return f"it uses {node.id}"
    if isinstance(node, ast.Name) and _is_set(node) and node.id == _KEPT:
        return _NEW_MEANING
    if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)) and node.name == _KEPT:
        return _NEW_MEANING
    if isinstance(node, ast.Attribute) and (_is_set(node) or node.attr.startswith("_")):
        return f"it reaches for the attribute {node.attr}"
    return ""


def _is_set(node: ast.Name | ast.Attribute) -> bool:
    return isinstance(node.ctx, (ast.Store, ast.Del))


def _imports(node: ast.Import | ast.ImportFrom) -> str:
    before = f"{node.module}." if isinstance(node, ast.ImportFrom) else ""
    for alias in node.names:
        wanted = before + alias.name
        if wanted.startswith("stereolib.exercises") or wanted.split(".")[0] in REFUSED_NAMES:
            return f"it imports {wanted}"
        if (alias.asname or alias.name) == _KEPT:
            return _NEW_MEANING
    return ""
