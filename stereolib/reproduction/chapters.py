"""What each notebook asks and which figures it draws, read from its text and code."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from stereolib.base import read_json

_TITLE = re.compile(r"^# (.+)$", re.MULTILINE)
_QUESTION = re.compile(r"^\*\*The question:\*\* (.+)$", re.MULTILINE)
_DRAWN = re.compile(r"""\bsave_figure\(\s*["'](\w+)["']""")
_MARKS = re.compile(r"\[([^\]]+)\]\([^)]*\)|[*`$]")  # links, of which the words stay, and marks of Markdown


@dataclass(frozen=True)
class Chapter:
    """One notebook.

    Parameters
    ----------
    stem : str
        Its file without ``.ipynb``.
    title, question : str
        Plain text; the question may be empty.
    figures : tuple of str
        Names of the figures that it writes, in its order.
    """

    stem: str
    title: str
    question: str
    figures: tuple[str, ...]


def read_chapters(folder: Path) -> list[Chapter]:
    """Read all notebooks of a folder, in order.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    list of Chapter
    """
    return [_chapter(path) for path in sorted(folder.glob("*.ipynb"))]


def _chapter(path: Path) -> Chapter:
    cells = read_json(path)["cells"]
    texts, codes = (
        "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == kind)
        for kind in ("markdown", "code")
    )
    title, question = (
        _MARKS.sub(r"\1", found[1]) if (found := pattern.search(texts)) else "" for pattern in (_TITLE, _QUESTION)
    )
    question = question[:1].upper() + question[1:]
    return Chapter(path.stem, title or path.stem, question, tuple(dict.fromkeys(_DRAWN.findall(codes))))
