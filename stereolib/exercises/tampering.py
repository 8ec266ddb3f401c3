"""What a cell of exercises has no reason to touch: looked for in its text, before anything runs.

The checker runs in the same process as the student's code, so no check inside it is safe from that code. This one looks
at the text from outside. It finds the plain ways of changing the checker, not every thinkable one.
"""

from __future__ import annotations

import ast
from typing import Any, TypeGuard

#: Modules and functions that reach into other code; no exercise needs one.
REFUSED_NAMES = frozenset(
    """IPython __import__ builtins ctypes delattr eval exec exit gc get_ipython getattr globals importlib inspect locals
    nbgrader os quit setattr subprocess vars""".split()  # noqa: SIM905 (a list would be twenty lines)
)
_REFUSED_ATTRIBUTES = (REFUSED_NAMES - {"eval"}) | {"chdir", "exercises", "modules"}  # also by way of another module
_OTHERS = {"cv2", "exercise", "np", "numpy", "stereolib", "task"}  # whose attributes are not the student's to set
_HARMLESS = {"config", "matplotlib", "pinfo", "pinfo2", "precision"}  # commands that begin with %, or end with ?
_TIMING = {"time", "timeit"}  # these run the code behind them
_KEPT = "exercise"  # the name that the check cells use
#: As they import it, and what is put before them while grading.
_ALLOWED = {f"from stereolib.exercises import {name}" for name in (_KEPT, "handed_in_by")}
_NEW_MEANING = f"it gives the name {_KEPT} a new meaning"


def refuse_tampering(source: str) -> str:
    """Say what in a cell may change the checker.

    Parameters
    ----------
    source : str
        Code of a cell, as a notebook takes it: also with commands that begin with % or !.

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
    from IPython.core.inputtransformer2 import TransformerManager

    transformer: Any = TransformerManager  # its parts have no types

    try:
        nodes = list(ast.walk(ast.parse(transformer().transform_cell(source))))
    except (SyntaxError, ValueError):
        return ""
    imported = {
        (alias.asname or alias.name).split(".")[0]
        for node in nodes
        for alias in getattr(node, "names", [])
        if isinstance(alias, ast.alias)
    }
    commands = [node for node in nodes if _is_command(node)]
    own = {id(part) for command in commands for part in ast.walk(command)}
    said = map(_of_command, commands)
    others = (_suspicion(node, imported | _OTHERS) for node in nodes if id(node) not in own)
    return next(filter(None, (*said, *others)), "")


def _is_command(node: ast.AST) -> TypeGuard[ast.Call]:
    """Whether a node is a command of the notebook, which IPython turns into get_ipython().run_line_magic(...)."""
    return isinstance(node, ast.Call) and ast.unparse(node.func).startswith("get_ipython().")


def _of_command(node: ast.Call) -> str:
    """Say what is wrong with a command of the notebook."""
    way = ast.unparse(node.func).removeprefix("get_ipython().")
    words = [part.value for part in node.args if isinstance(part, ast.Constant) and isinstance(part.value, str)]
    if way in ("run_line_magic", "run_cell_magic") and words[:1] and len(words) == len(node.args):
        if words[0] in _HARMLESS:
            return ""
        if words[0] in _TIMING:
            return next(filter(None, map(refuse_tampering, words[1:])), "")
    return "it calls a command of the notebook or of the system (a line that begins with % or !)"


def _suspicion(node: ast.AST, others: set[str]) -> str:
    if isinstance(node, (ast.Import, ast.ImportFrom)):
        return "" if ast.unparse(node) in _ALLOWED else _imports(node)
    if isinstance(node, ast.Name) and node.id in REFUSED_NAMES:
        return f"it uses {node.id}"
    if isinstance(node, ast.Name) and _is_set(node) and node.id == _KEPT:
        return _NEW_MEANING
    if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)) and node.name == _KEPT:
        return _NEW_MEANING
    if isinstance(node, ast.Attribute) and _is_reaching(node, others):
        return f"it reaches for the attribute {node.attr}"
    return ""


def _is_reaching(node: ast.Attribute, others: set[str]) -> bool:
    """Whether an attribute is hidden or leads to other code, or is set on what is not the student's."""
    if node.attr.startswith("_") or node.attr in _REFUSED_ATTRIBUTES:
        return True
    root = node.value
    while isinstance(root, (ast.Attribute, ast.Subscript)):
        root = root.value
    foreign = isinstance(root, ast.Call) or (isinstance(root, ast.Name) and root.id in others)
    return _is_set(node) and (foreign or node.attr == "check")


def _is_set(node: ast.Name | ast.Attribute) -> bool:
    return isinstance(node.ctx, (ast.Store, ast.Del))


def _imports(node: ast.Import | ast.ImportFrom) -> str:
    before = f"{node.module}." if isinstance(node, ast.ImportFrom) else ""
    for alias in node.names:
        wanted = before + alias.name
        if wanted.startswith("stereolib.exercises") or not REFUSED_NAMES.isdisjoint(wanted.split(".")):
            return f"it imports {wanted}"
        if alias.name == "modules":
            return f"it imports {wanted}"
        if (alias.asname or alias.name) == _KEPT:
            return _NEW_MEANING
    return ""
