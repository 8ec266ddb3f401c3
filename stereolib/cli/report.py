"""The command ``stereolib report``: the chapter on one's own rig, run on a folder of it."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from stereolib.cli.command import Command
from stereolib.cli.errors import DONE, turns_named
from stereolib.cli.outputs import check_outputs

_FILES = {"report": ("report.html", "report.ipynb", "calibration.json"),
          "calibration": ("calibration.html", "calibration.ipynb")}  # fmt: skip
_NOTES = """\
FOLDER is made by `stereolib new`, or holds a rig.toml that says where its boards, pairs and scans are. Written, into
FOLDER/report or what --output names:
  report.html       one page: calibration and verdict, rows, depth in mm, sizes, the laser's error, the map; what the
                    folder holds no recordings for is left out, and said
  report.ipynb      the notebook that made it, to be changed and run again
  calibration.json  of the boards, if there are any, for `stereolib measure`, `disparity` and `map`
With --chapter calibration it is the course's chapter on calibration, with your boards in it, and the files are
calibration.html and calibration.ipynb. Where FOLDER itself has a calibration.json, lengths are told by that one:
calibrate-laser writes into it where the laser stands. Nothing is held against the paper. It needs the extra
"notebooks": pip install ".[notebooks]" in the project's folder."""


def _configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of your rig")
    parser.add_argument("--output", type=Path, metavar="DIR", help="default: FOLDER/report, FOLDER/calibration")
    about = "which chapter is run: report on the whole rig (default), or calibration, which explains"
    parser.add_argument("--chapter", choices=tuple(_FILES), default="report", help=about)
    parser.add_argument("--force", action="store_true", help="replace a report that is there")


def _run(arguments: argparse.Namespace) -> int:
    from stereolib.calibration import check_first_boards
    from stereolib.mapping import load_rig_folder
    from stereolib.reproduction import NotebookError, report_rig

    name = arguments.chapter
    own, out = load_rig_folder(arguments.folder), arguments.output or arguments.folder / name
    if in_the_way := [path for path in (out, *out.parents) if path.is_file()]:
        raise ValueError(f"--output must name a folder, but {in_the_way[0]} is a file")
    if not (own.boards or own.stations):
        raise ValueError(f"{arguments.folder} holds no recordings yet: its rig.toml says where they are looked for")
    if name != "report" and not own.boards:
        raise ValueError(f"{arguments.folder} holds no pairs of a board, so that nothing can be calibrated")
    check_outputs([out / file for file in _FILES[name]], force=arguments.force, option="--output")
    print(f"{arguments.folder}: {own}", *own.absent, sep="\n  ", flush=True)
    if own.boards and own.board is not None:  # before the minutes of the rest
        with turns_named([file for pair in own.boards for file in pair]):
            check_first_boards(own.boards, own.board, str(own.boards[0].left.parent), progress=sys.stderr.isatty())
    try:
        written = report_rig(arguments.folder, out, name)
    except NotebookError as error:
        raise ValueError(f"{arguments.folder}: {_first_line(str(error))}") from error
    texts = _outputs(written)
    for line in (*_verdict(texts), *(_left_out(texts, own.absent) if name == "report" else ())):
        print(line)
    print(f"written to {out}: {', '.join(path.name for path in written)}")
    return DONE


def _outputs(written: list[Path]) -> list[str]:
    """What the cells of the notebook that was run print."""
    cells = [cell for path in written if path.suffix == ".ipynb" for cell in json.loads(path.read_bytes())["cells"]]
    return ["".join(output.get("text", ())) for cell in cells for output in cell.get("outputs", ())]


def _verdict(texts: list[str]) -> list[str]:
    """The cameras' verdict and why; nothing where there were no boards."""
    from stereolib.calibration import VERDICT_MEANINGS

    verdicts = tuple(f"{verdict}: {meaning}" for verdict, meaning in VERDICT_MEANINGS.items())
    return next((text.splitlines() for text in texts if text.startswith(verdicts)), [])


def _left_out(texts: list[str], absent: Sequence[str]) -> list[str]:
    """What is left out and why, but for what the folder does not hold, which was said before."""
    said = {f"left out: {text}" for text in absent}
    return [line for text in texts for line in text.splitlines() if "left out" in line and line not in said]


def _first_line(text: str) -> str:
    """What the failed cell says, without where it stands in the notebook."""
    line = text.splitlines()[0]
    return line.partition("ValueError: ")[2] or line


REPORT = Command(
    "report",
    "say on one page what a rig of your own can measure, and how well",
    "stereolib report walk",
    _run,
    _configure,
    notes=_NOTES,
    before=("stereolib data walk walk", "stereolib new walk"),
    interrupted="boards found so far are kept beside the pictures; no report was written",
)
