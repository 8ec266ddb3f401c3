"""The command ``stereolib calibrate``: two folders of board pictures in, a rig and its report out."""

from __future__ import annotations

import argparse
import json
import math
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from stereolib.cli.command import Command

if TYPE_CHECKING:
    from stereolib.calibration import Board

_MIN_PAIRS = 3
#: Kind of `formats.save_...` -> its files, and how many coefficients they hold at most.
_FORMATS = {"opencv": (["opencv.yml"], 14), "ros": (["left.yaml", "right.yaml"], 8), "kalibr": (["camchain.yaml"], 4)}
_NOTES = """verdict:
  good    corners fit to 0.5 px, rows agree to 0.3 px (of images 640 px wide, in proportion for wider ones), and boards
          left out, focal lengths and depths are right to 0.5 %; nothing else speaks against it: measure with it
  usable  2 px, 1 px and 2 %, or something is named that should be mended: sizes and depths to a few per cent
  bad     beyond that, or the set is faulty: do not measure with it

exit code: 0 good or usable, 1 bad, 2 wrong input. Boards found are kept in .stereolib_corners beside the pictures, so
that a second run does not search again; delete that folder at will."""
_SIDES = {"left", "right", "l", "r"}
Key = tuple[tuple[bool, int, str], ...]


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("left", type=Path, metavar="LEFT_DIR", help="pictures of the left camera, nothing else")
    parser.add_argument("right", type=Path, metavar="RIGHT_DIR", help="of the right one, by the same names or numbers")
    parser.add_argument("--board", required=True, metavar="9x6", help="inner corners, columns x rows")
    parser.add_argument(
        "--square-mm", required=True, metavar="MM", help="edge of a square, or width x height, as 24.9x25.1"
    )
    parser.add_argument("--marker-mm", type=float, metavar="MM", help="edge of a marker, if the board is ChArUco")
    parser.add_argument("--dictionary", default="5X5_100", metavar="NAME", help="its markers (default: 5X5_100)")
    parser.add_argument("--legacy", action="store_true", help="a ChArUco board printed by OpenCV before 4.6")
    parser.add_argument(
        "--model",
        default="brown3",
        help="lens: pinhole, brown2, brown3 (default), rational8, thin_prism12 or tilted14",
    )
    parser.add_argument("--ruler-mm", type=float, metavar="MM", help="distance of the lenses by a ruler: a check")
    parser.add_argument(
        "--at-mm", type=float, metavar="MM", help="judge depths there (default: where the boards stood)"
    )
    parser.add_argument("--output", type=Path, default=Path(), metavar="DIR", help="default: this folder")
    parser.add_argument(
        "--format", action="append", default=[], choices=list(_FORMATS), help="write the rig for another tool as well"
    )
    parser.add_argument("--force", action="store_true", help="replace files that are there")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def _calibrate(arguments: argparse.Namespace) -> int:
    others = {kind: [arguments.output / name for name in _FORMATS[kind][0]] for kind in arguments.format}
    written = [arguments.output / name for name in ("calibration.json", "report.html")]
    written += [path for paths in others.values() for path in paths]
    if in_the_way := [path for path in (arguments.output, *arguments.output.parents) if path.is_file()]:
        raise ValueError(f"--output must name a folder, but {in_the_way[0]} is a file")
    if (there := [str(path) for path in written if path.exists()]) and not arguments.force:
        raise FileExistsError(
            f"{' and '.join(there)} would be overwritten: name another folder with --output, or pass --force"
        )
    board = parse_board(
        arguments.board, arguments.square_mm, arguments.marker_mm, arguments.dictionary, arguments.legacy
    )
    for name, value in (("--ruler-mm", arguments.ruler_mm), ("--at-mm", arguments.at_mm)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be a positive number of mm, got {value}")
    pairs = pair_files(arguments.left, arguments.right)

    from stereolib.calibration import LENS_MODELS, calibration_facts, calibration_text, diagnose, find_in_files
    from stereolib.plotting import calibration_report
    from stereolib.rig import formats

    if arguments.model not in LENS_MODELS:  # before the boards are searched for
        raise ValueError(f"unknown lens model {arguments.model!r}; choose one of {', '.join(LENS_MODELS)}")
    for kind in others:
        if LENS_MODELS[arguments.model][0] > (most := _FORMATS[kind][1]):
            fits = [name for name, (count, _) in LENS_MODELS.items() if count <= most]
            raise ValueError(f"--format {kind} cannot hold a {arguments.model} lens: pass --model {fits[-1]}")
    left, right = zip(*pairs, strict=True)
    views = find_in_files(left, right, board, progress=sys.stderr.isatty())
    if len(views) < _MIN_PAIRS:
        raise ValueError(
            f"the board of {arguments.board} inner corners was found in both views of only {len(views)} pairs "
            f"({', '.join(views.names)}), not in {', '.join(views.missing)}: at least {_MIN_PAIRS} are needed, 15 to "
            f"30 give a trustworthy lens; is the board's size right?"
        )
    result = diagnose(views, model=arguments.model, ruler_mm=arguments.ruler_mm, at_mm=arguments.at_mm)
    facts = calibration_facts(result)
    notes = {name: entry for name, entry in facts.items() if name not in ("K", "dist", "R", "T")}  # the file has them
    calibration_report.build(written[1], result, dict(zip((path.name for path in left), pairs, strict=True)))
    result.rig.save(written[0], calibration=notes)
    for kind, paths in others.items():
        getattr(formats, f"save_{kind}")(*paths, result.rig)
    if arguments.json:
        print(json.dumps(facts, indent=1, allow_nan=False))
    else:
        print(calibration_text(result))
        print(f"written: {' '.join(map(str, written))}")
    return 1 if result.verdict == "bad" else 0


def parse_board(
    text: str,
    square_mm: str,
    marker_mm: float | None = None,
    dictionary: str = "5X5_100",
    legacy: bool = False,
) -> Board:
    """A board from ``"9x6"`` inner corners, a square's ``"25"`` or width x height ``"24.9x25.1"``, and its markers.

    Raises
    ------
    ValueError
        If a text is no board's size, or a number no length.
    """
    from stereolib.calibration import Charuco, Checkerboard

    found = re.fullmatch(r"\s*(\d{1,3})\s*[x×X*,]\s*(\d{1,3})\s*", text)
    if not found:
        raise ValueError(f"--board is columns x rows of inner corners, as 9x6 for 10 x 7 squares; got {text!r}")
    columns, rows = int(found[1]), int(found[2])
    try:
        edges = [float(part) for part in re.split("[x×X*]", square_mm)]
    except ValueError:
        edges = []
    if len(edges) not in (1, 2):
        raise ValueError(f"--square-mm is an edge in mm, as 25, or width x height, as 24.9x25.1; got {square_mm!r}")
    for edge in edges:
        if not (math.isfinite(edge) and edge > 0):
            raise ValueError(f"the square's edge must be a positive number of mm, got {edge:g}")
    mean, aspect = sum(edges) / len(edges), edges[-1] / edges[0]
    if marker_mm is None:
        if legacy:
            raise ValueError("--legacy is about ChArUco boards: give the edge of their markers with --marker-mm")
        return Checkerboard(columns, rows, mean, aspect)
    if aspect != 1:
        raise ValueError(f"a ChArUco board's squares are taken for square, got {square_mm}")
    return Charuco(columns, rows, mean, marker_mm, dictionary, legacy)


def pair_files(left: Path, right: Path) -> list[tuple[Path, Path]]:
    """Pair the pictures of two folders by their names, in the order of the numbers in them.

    Names belong together if they agree but for words for the side: ``left03.png`` and ``right03.png``, ``3_L.jpg`` and
    ``3_R.jpg``, ``03.png`` and ``3.png``. Where no name occurs on both sides (time stamps, for instance) and there are
    equally many, they are paired in sorted order. Hidden files and folders are passed over.

    Parameters
    ----------
    left, right : Path
        Folders.

    Raises
    ------
    ValueError
        If a folder is missing, one given twice or empty, or files are no images, have no partner, share a number or
        are too few; they are listed.
    """
    if left.resolve() == right.resolve():
        raise ValueError(f"{left} was given for both cameras: the left and the right pictures need a folder each")
    named = [_by_key(files) for files in _pictures(left, right)]
    if set(named[0]).isdisjoint(named[1]) and len(named[0]) == len(named[1]):
        return _enough([(named[0][a], named[1][b]) for a, b in zip(sorted(named[0]), sorted(named[1]), strict=True)])
    alone = [
        f"without a partner in {other}: {_listed(files[key] for key in sorted(set(files) - set(others)))}"
        for files, others, other in ((named[0], named[1], right), (named[1], named[0], left))
        if set(files) - set(others)
    ]
    if alone:
        raise ValueError(
            f"pictures {'; '.join(alone)}. Expected the same names or numbers in both folders, as 01.png in each, or "
            f"left01.png and right01.png: add the partner or move the odd one away"
        )
    return _enough([(named[0][key], named[1][key]) for key in sorted(named[0])])


def _enough(pairs: list[tuple[Path, Path]]) -> list[tuple[Path, Path]]:
    if len(pairs) < _MIN_PAIRS:
        raise ValueError(
            f"{len(pairs)} pairs ({_listed(a for a, _ in pairs)}) are too few: at least {_MIN_PAIRS} with different "
            f"tilts are needed, and 15 to 30 give a trustworthy lens"
        )
    return pairs


def _pictures(*folders: Path) -> list[list[Path]]:
    """Files of each folder, all of them images."""
    import cv2

    found, others = [], []
    for folder in folders:
        if not folder.is_dir():
            raise ValueError(f"{folder} is no folder: expected one with the pictures of one camera")
        files = [path for path in sorted(folder.iterdir()) if path.is_file() and not path.name.startswith(".")]
        if not files:
            raise ValueError(f"{folder} is empty: expected the pictures of one camera")
        found.append(files)
        if wrong := [path for path in files if not cv2.haveImageReader(str(path))]:
            others.append(f"{folder}: {_listed(wrong)}")
    if others:
        raise ValueError(
            f"files that are no readable images, in {'; in '.join(others)}. Expected only pictures (JPEG, PNG, ...): "
            f"move the others away, copy damaged ones again"
        )
    return found


def _by_key(files: Iterable[Path]) -> dict[Key, Path]:
    found: dict[Key, list[Path]] = {}
    for path in files:
        words = re.findall(r"\d+|[A-Z]?[a-z]+|[A-Z]+|[^\W\d_]+", path.stem)
        stripped = (re.sub("left|right", "", word.lower()) for word in words if word.lower() not in _SIDES)
        key = tuple((word.isdecimal(), int(word) if word.isdecimal() else 0, word if not word.isdecimal() else "")
                    for word in stripped if word)  # fmt: skip
        found.setdefault(key, []).append(path)
    if twice := [path for paths in found.values() if len(paths) > 1 for path in paths]:
        raise ValueError(f"{_listed(twice)} cannot be told apart by name: expected one number or name for each picture")
    return {key: paths[0] for key, paths in found.items()}


def _listed(files: Iterable[Path], most: int = 8) -> str:
    names = [path.name for path in files]
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


CALIBRATE = Command(
    "calibrate",
    "calibrate a stereo camera from pictures of a checkerboard, and say how far to trust it",
    "stereolib calibrate left right --board 9x6 --square-mm 30 --output rig",
    _calibrate,
    _arguments,
    notes=_NOTES,
    interrupted="the boards found so far are kept: run it again and it goes on from there",
)
