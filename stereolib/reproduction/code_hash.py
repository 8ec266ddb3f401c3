"""A fingerprint of some code, which comments, docstrings and layout leave as it is."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]
_DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def code_sha256(rooms: Iterable[str], package: Path | None = None) -> str:
    """Hash the code of some rooms, or of single modules of theirs.

    Parameters
    ----------
    rooms : iterable of str
        Names of folders in `package`, or of one file as ``"paper/printed_rig.py"``, in any order.
    package : Path, optional
        By default this one.

    Returns
    -------
    str
        Sha256 over the names of the modules and their syntax trees without docstrings, the same for every
        version of Python, and over the JSON files that lie beside them.

    Raises
    ------
    ValueError
        If there is no such room or module.

    Examples
    --------
    >>> code_sha256(["base", "rig"]) == code_sha256(["rig", "base"]) != code_sha256(["rig"])
    True
    """
    package = package or _PACKAGE
    digest = hashlib.sha256()
    for room in sorted(set(rooms)):
        named = (room,) if "." in room else (f"{room}/*.py", f"{room}/*.json")
        modules = sorted(file for name in named for file in package.glob(name))
        if not modules:
            raise ValueError(f"there is no room {room!r} in {package.name}")
        for module in modules:
            changed = module.stat()
            text = _module_sha256(module, changed.st_mtime_ns, changed.st_size)
            digest.update(f"{module.parent.name}/{module.name} {text}\n".encode())
    return digest.hexdigest()


@cache
def _module_sha256(module: Path, _mtime_ns: int, _size: int) -> str:
    """Hash one module, or data, as it is; read again when the file has another time or size."""
    data = module.read_bytes()
    return hashlib.sha256("".join(_pieces(ast.parse(data))).encode() if module.suffix == ".py" else data).hexdigest()


def _pieces(node: object) -> Iterator[str]:
    """Write a syntax tree down, without docstrings, and without fields that are empty: newer Pythons have more."""
    if isinstance(node, ast.AST):
        yield f"({type(node).__name__}"
        for name, value in ast.iter_fields(node):
            if name == "body" and isinstance(node, _DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
                value = value[1:]
            elif isinstance(node, ast.JoinedStr):  # Python 3.12 has empty texts in some formats
                value = [part for part in node.values if getattr(part, "value", None) != ""]
            if value is not None and value != [] and name != "type_comment":
                yield f" {name}="
                yield from _pieces(value)
        yield ")"
    elif isinstance(node, list):
        for part in node:
            yield from _pieces(part)
            yield ","
    else:
        yield repr(node)
