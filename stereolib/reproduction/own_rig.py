"""A chapter executed on the folder of one's own rig, and made one page."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from stereolib.base import datasets, read_text, work_folder, write_atomic
from stereolib.reproduction.execution import execute_notebooks

CHAPTER = "11_your_own_rig"
#: Chapters that take a folder, by the name of what is written.
CHAPTERS = {"report": CHAPTER, "calibration": "01_calibration"}
_LIMIT_BYTES = 64 * 2**20  # of an executed notebook: pictures of a dozen pairs are some MB
_REST = "left out: the rest"
_NOTEBOOK = "only-notebook"  # tag of cells that a page has no use for
#: What the notebook says of itself, and what a page says in its place.
_RUN = re.compile(r", write its name below, and run all cells; or let (`.+`) do that\. With no name .*? nobody knows\.")
_MADE = r"; then \1 makes this page."
_WHOLE_WORDS = "<style>div.output_area pre { word-break: normal; overflow-wrap: anywhere; }</style>\n</head>"
_LINK = re.compile(r"\[([^\]]+)\]\((?![a-z]+:)[^)]*\)")  # to what is not beside a report


def report_rig(folder: Path, output: Path, name: str = "report") -> list[Path]:
    """Execute a chapter on a folder; write it as a notebook and as a page that needs nothing else.

    Parameters
    ----------
    folder : Path
        As `stereolib.mapping.load_rig_folder` reads it.
    output : Path
        Folder for what is written; the notebook writes its calibration, or its figures, there, too.
    name : {"report", "calibration"}
        Of what is written: the chapter on one's own rig, or that on calibration.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    NotebookError
        If a cell failed: nothing but a calibration was written.
    """
    import nbformat
    from nbconvert import HTMLExporter
    from traitlets.config import Config

    chapter = CHAPTERS[name]
    notebook: Any = nbformat.reads(read_text(datasets.chapter_path(chapter)), as_version=4)  # type: ignore[no-untyped-call]
    at = next(k for k, cell in enumerate(notebook.cells) if "parameters" in cell.metadata.get("tags", []))
    given = f"folder = {str(folder.resolve())!r}\noutput = {str(output.resolve())!r}"
    about = {"id": "injected", "metadata": {"tags": ["injected-parameters"]}}  # an id of its own would differ each time
    injected: Any = nbformat.v4.new_code_cell(given, **about)  # type: ignore[no-untyped-call]
    notebook.cells.insert(at + 1, injected)
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            cell.source = _LINK.sub(r"\1", cell.source)
    calibration = output / "calibration.json"
    earlier = _writing(calibration)
    with work_folder() as work:
        source = write_atomic(work / f"{chapter}.ipynb", nbformat.writes(notebook))  # type: ignore[no-untyped-call]
        execute_notebooks([source], work / "executed", work / "figures", jobs=1)
        text = read_text(work / "executed" / source.name, limit_bytes=_LIMIT_BYTES)
    executed = nbformat.reads(text, as_version=4)  # type: ignore[no-untyped-call]
    plain: dict[str, Any] = {
        "template_name": "classic",
        "exclude_input": True,
        "exclude_output_prompt": True,
        "embed_images": True,
    }
    nothing_from_elsewhere = dict.fromkeys(("mathjax_url", "require_js_url", "jquery_url"), "")
    for cell in _explains_nothing(executed.cells):
        cell.metadata["tags"] = [_NOTEBOOK]
    executed.cells[0].source = _RUN.sub(_MADE, executed.cells[0].source)
    left_out = {"enabled": True, "remove_cell_tags": [_NOTEBOOK]}
    make_page: Any = HTMLExporter
    page = make_page(config=Config(TagRemovePreprocessor=left_out), **plain, **nothing_from_elsewhere)
    html, _ = page.from_notebook_node(executed, {"metadata": {"name": f"{folder.resolve().name}: {name}"}})
    html = html.replace("</head>", _WHOLE_WORDS, 1)
    written = [write_atomic(output / f"{name}.html", html), write_atomic(output / f"{name}.ipynb", text)]
    is_new = chapter == CHAPTER and _writing(calibration) not in (None, earlier)
    return [*written, *([calibration] if is_new else [])]


def _writing(file: Path) -> tuple[int, int] | None:
    """What tells one writing of a file from another; None where there is none."""
    if not file.is_file():
        return None
    known = file.stat()
    return known.st_ino, known.st_mtime_ns


def _explains_nothing(cells: Sequence[Any]) -> Iterator[Any]:
    """Cells that tell what to see where their part was left out, and all after the rest was."""
    is_absent, is_end = False, False
    for cell in cells:
        if is_end:
            yield cell
        elif cell.cell_type == "code":
            text = "".join(output.get("text", "") for output in cell.outputs)
            is_absent |= text.startswith("left out: ")
            is_end |= _REST in text
        elif cell.source.startswith("## "):
            is_absent = False
        elif is_absent and cell.source.startswith("**What to see:**"):
            yield cell
