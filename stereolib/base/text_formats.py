"""JSON, TOML and YAML of people one does not know: of bounded size, nesting and aliases, plain values only."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable
from os import PathLike
from typing import Any

from stereolib.base.files import read_text

NESTING = 64  # levels of brackets, tags or lists; calibrations have four
YAML_NODES = 100_000  # entries after all aliases are followed
_BRACKETS = re.compile(r'"(?:\\.|[^"\\])*"|([\[{])|([\]}])|<[?!][^>]*>|<(?!/)[^<>]*[^<>/]>|(</[^<>]*>)', re.DOTALL)


def read_json(path: str | PathLike[str]) -> Any:
    """Read a JSON file of bounded size and nesting.

    Parameters
    ----------
    path : path

    Returns
    -------
    object
        Dictionaries, lists, numbers, texts.

    Raises
    ------
    ValueError
        As `read_text`; or it is no JSON, or nested more than `NESTING` deep.
    """
    return _parsed(path, "JSON", json.loads)


def read_toml(path: str | PathLike[str]) -> dict[str, Any]:
    """Read a TOML file of bounded size and nesting.

    Parameters
    ----------
    path : path

    Returns
    -------
    dict

    Raises
    ------
    ValueError
        As `read_text`; or it is no TOML, or nested more than `NESTING` deep.
    """
    return dict(_parsed(path, "TOML", tomllib.loads))


def _parsed(path: str | PathLike[str], kind: str, parse: Callable[[str], Any]) -> Any:
    text = read_text(path)
    try:
        check_nesting(text)
        return parse(text)
    except ValueError as error:
        raise ValueError(f"{path}: not a {kind} file ({error})") from None


def read_yaml(path: str | PathLike[str]) -> Any:
    """Read a YAML file: plain values only, of bounded size, nesting and aliases.

    Parameters
    ----------
    path : path

    Returns
    -------
    object
        Dictionaries, lists, numbers, texts.

    Raises
    ------
    ValueError
        As `read_text`; or it is no YAML, holds more than plain values, is nested more than `NESTING` deep, or its
        aliases unfold to more than `YAML_NODES` entries.
    """
    text = read_text(path)
    try:
        return parse_yaml(text)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def parse_yaml(text: str) -> Any:
    """Parse YAML: plain values only, of bounded nesting and aliases.

    Parameters
    ----------
    text : str

    Returns
    -------
    object
        Dictionaries, lists, numbers, texts.

    Raises
    ------
    ValueError
        As `read_yaml`.

    Examples
    --------
    >>> parse_yaml("a: [1, 2.5]")
    {'a': [1, 2.5]}
    """
    import yaml

    class Bounded(yaml.SafeLoader):
        """Counts the levels and the unfolded entries of each node while it is composed."""

        depth = 0
        sizes: dict[int, int] = {}  # noqa: RUF012 (replaced for each file below)

        def compose_node(self, parent: Any, index: Any) -> Any:
            self.depth += 1
            if self.depth > NESTING:
                raise yaml.YAMLError(f"nested more than {NESTING} deep")
            alias = self.check_event(yaml.AliasEvent)
            node = super().compose_node(parent, index)
            self.depth -= 1
            if alias and id(node) not in self.sizes:
                raise yaml.YAMLError("an alias stands for what it is in")
            children = node.value if isinstance(node, yaml.CollectionNode) else []
            parts = [part for child in children for part in (child if isinstance(child, tuple) else (child,))]
            size = self.sizes.setdefault(id(node), 1 + sum(self.sizes[id(part)] for part in parts))
            if size > YAML_NODES:
                raise yaml.YAMLError(f"its aliases unfold to more than {YAML_NODES} entries")
            return node

    try:
        loader = Bounded(text)
        loader.sizes = {}
        try:
            return loader.get_single_data()
        finally:
            loader.dispose()
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ValueError(f"not a YAML file of plain values ({' '.join(str(error).split())})") from None


def check_nesting(text: str) -> None:
    """Refuse brackets or XML tags nested more than `NESTING` deep: parsers that call themselves run out of stack.

    Parameters
    ----------
    text : str
        JSON, flow YAML or XML.

    Raises
    ------
    ValueError
        If they are.

    Examples
    --------
    >>> check_nesting('{"a": [1, [2, 3]]}')
    >>> check_nesting("[" * 100)
    Traceback (most recent call last):
    ...
    ValueError: nested more than 64 deep
    """
    depth = 0
    for match in _BRACKETS.finditer(text):
        opening, closing, end_tag = match.groups()
        if opening or (match[0][0] == "<" and not end_tag and match[0][1] not in "?!"):
            depth += 1
        elif closing or end_tag:
            depth -= 1
        if depth > NESTING:
            raise ValueError(f"nested more than {NESTING} deep")
