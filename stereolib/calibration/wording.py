"""What a calibration says of itself: facts for programs, text for people."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from os import PathLike
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from stereolib.base import Float64, plus_minus
from stereolib.calibration.boards import Board, Charuco
from stereolib.calibration.bundle_adjustment import lens_vector
from stereolib.calibration.diagnosis import Diagnosis
from stereolib.calibration.findings import Check
from stereolib.calibration.record import CalibrationRecord
from stereolib.calibration.uncertainty import LENS_NAMES

#: What a verdict allows; the errors are one standard deviation, at the distance that was asked about.
VERDICT_MEANINGS = {
    "good": "measure with it: its part of the errors of depths and lengths is 0.5 % (one standard deviation) or less",
    "usable": "measure with it, to 2 % (one standard deviation); mend what is named for more",
    "bad": "do not measure with it; mend what is named and calibrate again",
}
_TIED = "\N{NO-BREAK SPACE}"  # keeps a name and its value on one line
_WIDTH = 120  # columns of the text
_IN_THE_RIG = ("K", "dist", "R", "T")  # what the rig's file says anyway


def calibration_facts(diagnosis: Diagnosis) -> dict[str, Any]:
    """Collect everything that a program may want to know of a calibration, ready for JSON.

    Parameters
    ----------
    diagnosis : Diagnosis

    Returns
    -------
    dict
        ``verdict reasons advice warnings model board rms_px K dist R T baseline_mm std pairs_used pairs_refused
        pairs_repeated pair_rms_px groups coverage errors folds checks lens_models record``. K and dist are of ``left``
        and ``right``, T is in mm. ``std`` repeats their names; its K are fx fy cx cy, and ``R_rad`` are turns about the
        right camera's axes. What is not known is None.
    """
    d, rig, std, errors = diagnosis, diagnosis.rig, diagnosis.std, diagnosis.error_map
    matrices = {
        "K": {"left": rig.left.K, "right": rig.right.K},
        "dist": {"left": rig.left.dist, "right": rig.right.dist},
    }
    stds: dict[str, Any] = {"K": {"left": std.left_K, "right": std.right_K}}
    stds |= {"dist": {"left": std.left_dist, "right": std.right_dist}, "R_rad": std.R_rad, "T": std.T_mm}
    stds |= {"baseline_mm": std.baseline_mm, "rectified": d.rectified_std}
    wrong = {"square_pct": d.square_error_pct, "board_pct": d.board_error_pct}
    wrong |= {name: getattr(d, name) for name in ("epipolar_rms_px", "worst_pair", "worst_pair_px")}
    wrong |= {
        "at_mm": errors.at_mm,
        "depth_std_mm": d.depth_mm,
        "length_std_mm": d.length_mm,
        "length_mm": errors.of_mm,
    }
    wrong |= {name: getattr(d, name) for name in ("depth_pct", "length_pct", "lens_error_pct")}
    wrong |= {name: getattr(d, name) for name in ("magnification", "picture_left")}
    told = {name: getattr(d, name) for name in ("verdict", "reasons", "advice", "warnings", "model")}
    told |= {"board": asdict(d.views.board), "rms_px": d.rms_px, **matrices}
    told |= {"R": rig.R, "T": rig.T, "baseline_mm": rig.baseline_mm, "std": stds}
    told |= {"pairs_used": d.pairs_used, "pairs_refused": d.pairs_left_out, "pairs_repeated": d.pairs_repeated}
    told |= {"pair_rms_px": dict(zip(d.pairs_used, d.pair_rms_px, strict=True)), "groups": d.groups}
    told |= {"coverage": asdict(d.coverage), "errors": wrong, "folds": d.folds}
    told |= {"checks": {check.name: check._asdict() for check in d.checks}}
    told |= {"lens_models": {lens.model: asdict(lens) for lens in d.lenses}}
    told |= {"record": CalibrationRecord.of(d.fit, d.views).facts()}
    plain: dict[str, Any] = _plain(told)
    return plain


def save_calibration(path: str | PathLike[str], diagnosis: Diagnosis) -> Path:
    """Write a calibrated rig with everything that is known of its calibration.

    Parameters
    ----------
    path : path
    diagnosis : Diagnosis

    Returns
    -------
    Path
        Where it was written.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    notes = {name: entry for name, entry in calibration_facts(diagnosis).items() if name not in _IN_THE_RIG}
    return diagnosis.rig.save(path, calibration=notes)


def calibration_text(diagnosis: Diagnosis) -> str:
    """Write a calibration as text: a line for each item, standard deviations behind ``±``.

    Parameters
    ----------
    diagnosis : Diagnosis

    Returns
    -------
    str
        Lines of at most 120 columns.
    """
    rows = result_rows("summary", diagnosis)
    width = max(len(name) for name, _ in rows) + 2
    wrap = textwrap.TextWrapper(_WIDTH, subsequent_indent=" " * width, break_long_words=False, break_on_hyphens=False)
    return "\n".join(line for name, text in rows for line in wrap.wrap(f"{name:{width}}{text}")).replace(_TIED, " ")


def result_rows(part: str, diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Write a part of what a calibration found, standard deviations behind ``±``; a line's end in a value is a blank.

    Parameters
    ----------
    part : str
        ``"summary"``; ``"errors"`` (the distance, and one standard deviation of a depth and of a length there);
        ``"parameters"``; ``"meaning"`` (what it rests on, and how it does on boards that it has not seen).
    diagnosis : Diagnosis

    Returns
    -------
    list of (name, text)
    """
    import jinja2

    templates = jinja2.Environment(
        loader=jinja2.PackageLoader("stereolib.calibration"),
        autoescape=False,  # plain text; whoever puts it into HTML escapes it
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        keep_trailing_newline=True,
        finalize=lambda value: re.sub(r"[\r\n]", " ", str(value)),
    )
    rig, verdict = diagnosis.rig, diagnosis.verdict
    values = {"named": _named, "with_std": plus_minus, "edges": _edges, "degrees": np.degrees}
    values |= {"lens_names": LENS_NAMES, "lenses": {s: lens_vector(getattr(rig, s)) for s in ("left", "right")}}
    values |= {"verdict_meaning": VERDICT_MEANINGS.get(verdict, ""), "turns": np.ravel(cv2.Rodrigues(rig.R)[0])}
    text = templates.get_template(f"{part}.txt.jinja").render(values, d=diagnosis)
    return [(name, value) for name, _, value in (line.partition(" | ") for line in text.split("\n") if line)]


def check_rows(diagnosis: Diagnosis) -> list[tuple[str, str, str, str, str]]:
    """Write everything of a calibration that has limits.

    Parameters
    ----------
    diagnosis : Diagnosis

    Returns
    -------
    list of (name, value, good, usable, advice)
        Up to which value it is good, and up to which usable; or, if it does not decide, beyond which advice is due.
    """
    return [(check.name, f"{check.value:.2f} {check.unit}", *_limits(check)) for check in diagnosis.checks]


def board_text(board: Board) -> str:
    """Write what a board was said to be.

    Parameters
    ----------
    board : Checkerboard or Charuco

    Returns
    -------
    str

    Examples
    --------
    >>> from stereolib.calibration import Checkerboard
    >>> board_text(Checkerboard(9, 6, 25.0))
    'checkerboard of 9 x 6 inner corners, squares of 25 mm'
    """
    kind = f"ChArUco board ({board.dictionary})" if isinstance(board, Charuco) else "checkerboard"
    return f"{kind} of {board.columns} x {board.rows} inner corners, squares of {_edges(board)}"


def _limits(check: Check) -> tuple[str, str, str]:
    good = f"{check.good:.3g}"
    return (good, f"{check.usable:.3g}", "") if check.decides else ("", "", good)


def _edges(board: Board) -> str:
    if isinstance(board, Charuco) or board.aspect == 1:
        return f"{board.square_mm:g} mm"
    width = 2 * board.square_mm / (1 + board.aspect)
    return f"{width:.4g} x {width * board.aspect:.4g} mm"


def _named(names: Sequence[str], values: Float64, stds: Float64) -> str:
    """As many values as there are, each behind its name."""
    entries = zip(names, values, stds, strict=False)
    return "  ".join(f"{name} {plus_minus(v, s)}".replace(" ", _TIED) for name, v, s in entries) or "none"


def _plain(value: Any) -> Any:
    """Lists, floats and None in place of arrays, tuples and NaN."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray | tuple | list):
        return [_plain(entry) for entry in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return int(value) if isinstance(value, np.integer) else value
