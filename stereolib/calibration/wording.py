"""What a calibration says of itself, as facts for programs and as text for people."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import cv2
import numpy as np

from stereolib.calibration.boards import Board, Charuco
from stereolib.calibration.diagnosis import Diagnosis

Array = np.ndarray
#: What a verdict allows.
MEANS = {
    "good": "nothing that was tested speaks against this calibration, measure with it",
    "usable": "sizes and depths to a few per cent; mend what is named for more",
    "bad": "do not measure with it; mend what is named and calibrate again",
}
#: Coefficients in OpenCV's order.
DIST_NAMES = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tau_x", "tau_y")
_TIED = "\N{NO-BREAK SPACE}"
_K_NAMES = ("fx", "fy", "cx", "cy")


def facts(diagnosis: Diagnosis) -> dict[str, Any]:
    """Everything that a program may want to know, ready for JSON; what is not known is None.

    Returns
    -------
    dict
        ``verdict reasons warnings model board rms_px K dist R T baseline_mm std pairs_used pairs_refused groups
        coverage errors checks lens_models``. K and dist are of ``left`` and ``right``, T is in mm. ``std`` repeats
        their names; its K are fx fy cx cy, and ``R_rad`` are turns about the right camera's axes.
    """
    rig, std, board, score = diagnosis.rig, diagnosis.std, diagnosis.views.board, diagnosis.coverage
    errors = diagnosis.error_map
    return _plain(
        {
            "verdict": diagnosis.verdict,
            "reasons": diagnosis.reasons,
            "warnings": diagnosis.warnings,
            "model": diagnosis.model,
            "board": asdict(board),
            "rms_px": diagnosis.rms_px,
            "K": {"left": rig.left.K, "right": rig.right.K},
            "dist": {"left": rig.left.dist, "right": rig.right.dist},
            "R": rig.R,
            "T": rig.T,
            "baseline_mm": rig.baseline_mm,
            "std": {
                "K": {"left": std.left_K, "right": std.right_K},
                "dist": {"left": std.left_dist, "right": std.right_dist},
                "R_rad": std.R_rad,
                "T": std.T_mm,
                "baseline_mm": std.baseline_mm,
                "rectified": diagnosis.rectified_std,
            },
            "pairs_used": diagnosis.pairs_used,
            "pairs_refused": refused(diagnosis),
            "pair_rms_px": dict(zip(diagnosis.pairs_used, diagnosis.pair_rms_px, strict=True)),
            "groups": diagnosis.groups,
            "coverage": {
                "score": score.score,
                "image": score.image,
                "distance": score.distance,
                "tilt": score.tilt,
                "missing": score.missing,
            },
            "errors": {
                "square_pct": diagnosis.square_error_pct,
                "board_pct": diagnosis.board_error_pct,
                "epipolar_rms_px": diagnosis.epipolar_rms_px,
                "worst_pair": diagnosis.worst_pair,
                "worst_pair_px": diagnosis.worst_pair_px,
                "at_mm": errors.at_mm,
                "depth_std_mm": _median(errors.depth_mm),
                "length_std_mm": _median(errors.length_mm),
                "length_mm": errors.of_mm,
            },
            "folds": diagnosis.folds,
            "checks": {check.name: check._asdict() for check in diagnosis.checks},
            "lens_models": {lens.model: asdict(lens) for lens in diagnosis.lenses},
        }
    )


def refused(diagnosis: Diagnosis) -> dict[str, str]:
    """Pairs that the calibration does not stand on, and why."""
    unseen = {name: "the board was not found in both views" for name in diagnosis.views.missing}
    return unseen | dict(diagnosis.pairs_refused)


def summary(diagnosis: Diagnosis) -> str:
    """The verdict as text: a line for each thing, standard deviations behind ``±``."""
    names, left_out = diagnosis.pairs_used, refused(diagnosis)
    lines = [(diagnosis.verdict, MEANS.get(diagnosis.verdict, ""))]
    lines += [("because", text) for text in diagnosis.reasons] + [("note", text) for text in remarks(diagnosis)]
    lines += [("rms (px)", f"{diagnosis.rms_px:.4f}  ({diagnosis.model}, {len(names)} pairs)")]
    lines += parameters(diagnosis)
    lines += meaning(diagnosis)
    lines += [("pairs used", f"{len(names)}: {' '.join(names)}"), ("pairs refused", str(len(left_out) or "none"))]
    lines += [("", f"{name}: {reason}") for name, reason in left_out.items()]
    width = max(len(name) for name, _ in lines) + 2
    wrapped = (textwrap.wrap(f"{name:{width}}{text}", 120, subsequent_indent=" " * width, break_long_words=False,
                             break_on_hyphens=False) for name, text in lines)  # fmt: skip
    return "\n".join(line for entry in wrapped for line in entry).replace(_TIED, " ")


def remarks(diagnosis: Diagnosis) -> list[str]:
    """The warnings that are not among the verdict's reasons."""
    return [text for text in diagnosis.warnings if text not in diagnosis.reasons]


def parameters(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Name and text of every parameter, standard deviations behind ``±``."""
    rig, std = diagnosis.rig, diagnosis.std
    rows = [("baseline (mm)", _pm(rig.baseline_mm, std.baseline_mm))]
    for side, camera, K_std, dist_std in (
        ("left", rig.left, std.left_K, std.left_dist),
        ("right", rig.right, std.right_K, std.right_dist),
    ):
        values = camera.K[[0, 1, 0, 1], [0, 1, 2, 2]]
        rows.append((f"K {side} (px)", _named(_K_NAMES, values, K_std)))
        rows.append((f"dist {side}", _named(DIST_NAMES[: camera.dist.size], camera.dist, dist_std)))
    turns = np.degrees(np.ravel(cv2.Rodrigues(rig.R)[0]))
    rows += [("R", "  ".join("[" + " ".join(f"{v:9.6f}" for v in row) + "]" for row in rig.R))]
    rows += [("R as turns (deg)", _named("xyz", turns, np.degrees(std.R_rad)))]
    return [*rows, ("T (mm)", _named("xyz", rig.T, std.T_mm))]


def meaning(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Name and text of what the calibration means in millimetres."""
    d, errors, score = diagnosis, diagnosis.error_map, diagnosis.coverage
    depth, length = _median(errors.depth_mm), _median(errors.length_mm)
    lenses = ", ".join(f"{lens.model} {lens.hold_out_rms_px:.4f} px" for lens in d.lenses)
    return [
        ("scale", f"all lengths rest on squares of {_edges(d.views.board)}; the distance of the lenses by a ruler "
                  f"checks them"),
        (f"at {errors.at_mm:g} mm", f"depth ± {depth:.2g} mm, a length of {errors.of_mm:g} mm ± {length:.2g} mm, if "
                                    f"the lens model fits"),
        *([("lens models", f"rms of boards left out: {lenses}")] if lenses else []),
        ("each pair left out", f"squares {d.square_error_pct:.3f} % off, board {d.board_error_pct:.3f} %"),
        ("rows, rectified", f"{d.epipolar_rms_px:.3f} px rms, worst {d.worst_pair}: {d.worst_pair_px:.3f} px"),
        ("coverage", f"{score.score:.0%}: {score}"),
    ]  # fmt: skip


def checked(diagnosis: Diagnosis) -> list[tuple[str, str, str, str]]:
    """Everything with limits: what it is, its value, up to where it is good, and up to where usable."""
    return [(c.name, f"{c.value:.2f} {c.unit}", f"{c.good:.3g}", f"{c.usable:.3g}") for c in diagnosis.checks]


def board_text(board: Board) -> str:
    """What the board was said to be."""
    kind = f"ChArUco board ({board.dictionary})" if isinstance(board, Charuco) else "checkerboard"
    return f"{kind} of {board.columns} x {board.rows} inner corners, squares of {_edges(board)}"


def _edges(board: Board) -> str:
    if isinstance(board, Charuco) or board.aspect == 1:
        return f"{board.square_mm:g} mm"
    width = 2 * board.square_mm / (1 + board.aspect)
    return f"{width:.4g} x {width * board.aspect:.4g} mm"


def _named(names: Sequence[str], values: Array, stds: Array) -> str:
    tied = (f"{name} {_pm(v, s)}".replace(" ", _TIED) for name, v, s in zip(names, values, stds, strict=True))
    return "  ".join(tied) or "none"


def _pm(value: float, std: float) -> str:
    """``729.91 ± 0.12``: the deviation with two digits, the value with as many decimals."""
    if not (np.isfinite(std) and std > 0):
        return f"{value:.6g}"
    decimals = int(np.clip(1 - np.floor(np.log10(std)), 0, 9))
    return f"{round(value, decimals) + 0.0:.{decimals}f} ± {std:.{decimals}f}"  # + 0.0: never -0.00


def _median(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else float("nan")


def _plain(value: Any) -> Any:
    """Lists, floats and None in place of arrays, tuples and NaN."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray | tuple | list):
        return [_plain(entry) for entry in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return int(value) if isinstance(value, np.integer) else value
