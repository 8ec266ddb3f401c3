"""Is this calibration good? Faults of the board pairs by name, and a verdict in metric units."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from stereolib.base import Float64
from stereolib.calibration.board_size import left_out_size_errors
from stereolib.calibration.boards import BoardViews, Checkerboard
from stereolib.calibration.bundle_adjustment import RigFit, fit_rig
from stereolib.calibration.coverage import Coverage, judge_coverage
from stereolib.calibration.lens_choice import HoldOut, choose_lens_model, neighbour_errors
from stereolib.calibration.lens_models import LensFold, fold_inside
from stereolib.calibration.outliers import sort_pairs
from stereolib.calibration.solve import epipolar_errors_px
from stereolib.calibration.uncertainty import ErrorMap, RigStd, error_map, rectified_std, rig_covariance, rig_std
from stereolib.rig import StereoRig

#: Up to the first a calibration is good, up to the second usable: corners and rows in pixels of an image 640 wide (more
#: for wider ones), focal lengths, sizes and depths in per cent; 0.5 % is 1.5 mm on the paper's cube.
_RMS_PX, _EPIPOLAR_PX, _LENGTH_PCT = (0.5, 2.0), (0.3, 1.0), (0.5, 2.0)
_WIDTH_PX = 640
_FEW_PAIRS = 8  # fewer say too little about what they leave out
_MANY_REFUSED = 4  # more than a quarter of the pairs left out: the rest is hardly better
_RULER = (0.02, 2.0)  # share of the baseline, and mm: a ruler between two lenses is no better
_LITTLE_IMAGE = 0.2  # share of the images: a lens that was seen on less is a guess elsewhere
_TRIED_STRETCH = 0.01  # of a square's height: the secant's step
_STRETCH = 0.003  # of a square's height: printers do that, and it costs less than the limits
_STRETCH_SHARE = 0.1  # of the residuals (of its root) that a stretch must explain to be named
_FOLDED = 0.001  # of the image: less is worth a word and nothing more
_SQUARES_MM = (5.0, 300.0)  # other sizes were hardly meant in millimetres
_LISTED = 6  # names in one sentence
Finding = tuple[int, str]  # how bad (0 a remark, 1 usable, 2 bad), and what


class Check(NamedTuple):
    """A measured quantity of a calibration and its limits: up to ``good``, up to ``usable``, beyond that bad."""

    name: str
    value: float
    unit: str
    good: float
    usable: float
    remedy: str

    @property
    def level(self) -> int:
        """0 good, 1 usable, 2 bad, or not known (NaN)."""
        return 0 if self.value <= self.good else 1 if self.value <= self.usable else 2

    def __str__(self) -> str:
        return f"{self.name} {self.value:.2f} {self.unit}, good is up to {self.good:.3g}: {self.remedy}"


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """A calibration and everything that speaks for or against it.

    Attributes
    ----------
    model : str
        Name of the lens model.
    views : BoardViews
        The pairs used.
    rig : StereoRig
    rms_px : float
        Of the fit over all corners.
    std : RigStd
    pairs_refused : dict
        Name of each pair left out of the fit though both cameras saw the board, and the reason.
    pair_rms_px : (n, 2) float64
        Of the pairs used, left and right.
    residuals_px : (2, n, corners, 2) float64
        Found minus predicted, left then right; NaN where a corner was not found.
    coverage : Coverage
    groups : tuple of tuple of str
        Names of the pairs of each position of the rig, largest first; one group for a sound set.
    error_map : ErrorMap
        At the boards' median distance, or where it was asked for.
    rectified_std : dict
        From `rectified_std`; empty if the rig cannot be rectified.
    square_error_pct, board_error_pct : float
        Mean over pairs of how wrong the size of the squares, and of the board's longer edge, is, each pair left out
        of its rig.
    epipolar_rms_px : float
        Row errors after rectification.
    worst_pair, worst_pair_px : str and float
        The pair with the largest row errors.
    folds : tuple of str
        What `fold_inside` says, of either camera; empty for a sound lens.
    lenses : tuple of HoldOut
        Of this lens model and its neighbours, shortest first; empty for too few pairs.
    fit : RigFit
        The problem at its minimum, of the pairs used.
    checks : tuple of Check
        Everything that has limits.
    warnings : tuple of str
        Everything noteworthy, one sentence each.
    verdict : str
        ``"good"``, ``"usable"`` or ``"bad"``.
    reasons : tuple of str
        The sentences that made it so.
    """

    model: str
    views: BoardViews
    rig: StereoRig
    rms_px: float
    std: RigStd
    pairs_refused: dict[str, str]
    pair_rms_px: Float64
    residuals_px: Float64
    coverage: Coverage
    groups: tuple[tuple[str, ...], ...]
    error_map: ErrorMap
    rectified_std: dict[str, Any]
    square_error_pct: float
    board_error_pct: float
    epipolar_rms_px: float
    worst_pair: str
    worst_pair_px: float
    folds: tuple[str, ...]
    lenses: tuple[HoldOut, ...]
    fit: RigFit
    checks: tuple[Check, ...] = ()
    warnings: tuple[str, ...] = ()
    verdict: str = ""
    reasons: tuple[str, ...] = ()

    @property
    def pairs_used(self) -> tuple[str, ...]:
        """Names of the pairs that the calibration stands on."""
        return self.views.names

    @property
    def pairs_left_out(self) -> dict[str, str]:
        """Names of all pairs that the calibration does not stand on, and why."""
        return dict.fromkeys(self.views.missing, "the board was not found in both views") | self.pairs_refused

    @property
    def remarks(self) -> list[str]:
        """The warnings that are not among the verdict's reasons."""
        return [text for text in self.warnings if text not in self.reasons]


def diagnose(
    views: BoardViews, *, model: str = "brown3", ruler_mm: float | None = None, at_mm: float | None = None
) -> Diagnosis:
    """Calibrate a rig from board pairs and judge the result.

    Parameters
    ----------
    views : BoardViews
        From `find_in_files` or `find_in_pairs`.
    model : str
        A name of `LENS_MODELS`.
    ruler_mm : float, optional
        The distance of the two lenses by a ruler: checks the board's size.
    at_mm : float, optional
        Where depths are judged; the boards' median distance if not given.

    Returns
    -------
    Diagnosis

    Raises
    ------
    ValueError
        Fewer than 3 pairs, all views alike, left and right exchanged, or pairs that do not belong together.
    """
    for what, value in (("ruler's reading", ruler_mm), ("distance to judge depths at", at_mm)):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise ValueError(f"the {what} must be a positive number of mm, got {value}")
    pairs = sort_pairs(views, model)
    used = views.only(pairs.groups[0])
    fit, rig = pairs.calibration.fit, pairs.calibration.rig
    covariance = rig_covariance(fit)
    sizes = left_out_size_errors(used, fit)
    epipolar, unrectified = _epipolar(rig, used)
    middles_mm = fit.shifts + fit.turns @ used.board.points_mm.mean(axis=0)
    at_mm = at_mm or float(f"{np.median(middles_mm[:, 2]):.2g}")
    worst = int(np.nanargmax(epipolar)) if np.isfinite(epipolar).any() else int(fit.pair_rms_px.max(axis=1).argmax())
    folds = [(side, fold) for side in ("left", "right") if (fold := fold_inside(getattr(rig, side)))]
    diagnosis = Diagnosis(
        model=model,
        views=used,
        rig=rig,
        rms_px=fit.rms_px,
        std=rig_std(rig, covariance),
        pairs_refused={views.names[k]: why for k, why in sorted(pairs.refused.items())},
        pair_rms_px=fit.pair_rms_px,
        residuals_px=np.where(fit.known[..., None], fit.residuals_px, np.nan).transpose(1, 0, 2, 3),
        coverage=judge_coverage(used, fit.turns, fit.shifts),
        groups=tuple(tuple(views.names[k] for k in group) for group in pairs.groups),
        error_map=error_map(rig, covariance, at_mm=at_mm),
        rectified_std={} if unrectified else rectified_std(rig.rectify(), covariance),
        square_error_pct=sizes.square_error_pct,
        board_error_pct=sizes.board_error_pct,
        epipolar_rms_px=float(np.sqrt(np.nanmean(epipolar**2))) if np.isfinite(epipolar).any() else np.nan,
        worst_pair=used.names[worst],
        worst_pair_px=float(epipolar[worst]),
        folds=tuple(f"the {side} lens {fold}" for side, fold in folds),
        lenses=tuple(neighbour_errors(used, fit, model)) if len(used) >= _FEW_PAIRS else (),
        fit=fit,
    )
    diagnosis = replace(diagnosis, checks=_checks(diagnosis))
    findings = [  # causes before what they cause
        *_set_findings(diagnosis, pairs.moved, ruler_mm),
        *_board_findings(used, fit),
        *unrectified,
        *_lens_findings(diagnosis),
        *_coverage_findings(diagnosis),
        *_check_findings(diagnosis),
        *(_fold_finding(diagnosis, *fold) for fold in folds),
    ]
    level = max((level for level, _ in findings), default=0)
    reasons = tuple(text for at, text in findings if at == level and level)
    verdict = ("good", "usable", "bad")[level]
    return replace(diagnosis, warnings=tuple(text for _, text in findings), verdict=verdict, reasons=reasons)


def _set_findings(diagnosis: Diagnosis, moved: tuple[str, ...], ruler_mm: float | None) -> list[Finding]:
    """What is wrong with the set of pairs."""
    findings = [(2, f"two positions of the rig are mixed: {text}") for text in moved]
    total = len(diagnosis.views) + len(diagnosis.pairs_refused)
    if lone := [name for name, why in diagnosis.pairs_refused.items() if not why.startswith("belongs to")]:
        listed = ", ".join(lone[:_LISTED]) + (", ..." if len(lone) > _LISTED else "")
        level = 1 + (len(lone) > total / _MANY_REFUSED)
        findings.append((level, f"{len(lone)} of {total} pairs were left out: {listed}"))
    baseline, square = diagnosis.rig.baseline_mm, diagnosis.views.board.square_mm
    if ruler_mm is not None and abs(baseline / ruler_mm - 1) > max(_RULER[0], _RULER[1] / ruler_mm):
        text = f"the baseline comes out {baseline:.1f} mm, the ruler says {ruler_mm:.1f} mm"
        squares = f"so the squares would be {square * ruler_mm / baseline:.2f} mm and not {square:g} mm"
        findings.append((2, f"the board or the ruler is measured wrong: {text}, {squares}"))
    if not _SQUARES_MM[0] <= square <= _SQUARES_MM[1]:
        text = f"squares of {square:g} mm and a baseline of {baseline:.3g} mm"
        findings.append((0, f"{text}: was the square's edge given in millimetres?"))
    return findings


def _coverage_findings(diagnosis: Diagnosis) -> list[Finding]:
    """What the boards leave out."""
    findings: list[Finding] = []
    count, coverage = len(diagnosis.views), diagnosis.coverage
    if count < _FEW_PAIRS:
        findings.append((1, f"{count} pairs are few: {_FEW_PAIRS} or more make the result trustworthy"))
    remedy = ": hold the board there in some pictures"
    findings += [(1, text + remedy * ("no views" in text)) for text in coverage.missing]
    if coverage.image < _LITTLE_IMAGE:
        findings.append((1, f"the boards cover only {100 * coverage.image:.0f} % of the images: hold them nearer"))
    return findings


def _lens_findings(diagnosis: Diagnosis) -> list[Finding]:
    """Whether another lens model predicts boards better to which it was not fitted, or as well with less."""
    lenses, model = {lens.model: lens for lens in diagnosis.lenses}, diagnosis.model
    if not lenses or (best := lenses[choose_lens_model(diagnosis.lenses)]) == (ours := lenses[model]):
        return []
    errors = f"({best.hold_out_rms_px:.3f} px against {ours.hold_out_rms_px:.3f} px)"
    if best.coefficients > ours.coefficients:
        text = f"the lens model {model} is too short: {best.model} predicts boards left out better {errors}"
        return [(1, f"{text}, and no deviation stated here counts that; use --model {best.model}")]
    text = f"the last coefficients of {model} cannot be told from these pictures: {best.model} predicts boards left out"
    return [(0, f"{text} as well {errors}; use --model {best.model}")]


def _fold_finding(diagnosis: Diagnosis, side: str, fold: LensFold) -> Finding:
    """A fold among the boards spoils what they say; elsewhere it costs pixels that nothing was known of anyway."""
    corners = diagnosis.views.left_px if side == "left" else diagnosis.views.right_px
    known = corners[np.isfinite(corners).all(axis=2)]
    if np.isnan(getattr(diagnosis.rig, side).rays(known)).any():
        return 2, f"the {side} lens {fold}, where boards were seen: use a shorter --model"
    level = int(fold.share > _FOLDED)
    remedy = "boards held there or a shorter --model mend it" if level else "too few to matter"
    return level, f"the {side} lens {fold}; those pixels cannot be rectified: {remedy}"


def _board_findings(used: BoardViews, fit: RigFit) -> list[Finding]:
    """Whether the board's squares are as high as wide.

    The residuals of a second fit, with squares 1 % higher, give the height that fits best: a secant step of
    Gauss-Newton in which all other parameters follow. Its deviation is the jackknife's.
    """
    board = used.board
    if not isinstance(board, Checkerboard):
        return []
    stretched = replace(used, board=replace(board, aspect=board.aspect + _TRIED_STRETCH))
    before = fit.residuals_px
    change = np.where(fit.known[..., None], fit_rig(stretched, fit.rig).residuals_px - before, 0.0)
    along, length = (before * change).sum(axis=(1, 2, 3)), (change**2).sum(axis=(1, 2, 3))
    stretch = -_TRIED_STRETCH * float(along.sum() / max(length.sum(), 1e-30))
    if abs(stretch) < _STRETCH or along.sum() ** 2 < _STRETCH_SHARE * length.sum() * (before**2).sum():
        return []
    others = -_TRIED_STRETCH * (along.sum() - along) / (length.sum() - length)
    off, std = 100 * stretch / board.aspect, 100 * np.sqrt((len(others) - 1) * np.var(others))
    than, aspect = "they are wide" if board.aspect == 1 else "given", board.aspect + stretch
    wide = 2 * board.square_mm / (1 + aspect)
    text = f"the board's squares come out {abs(off):.1f} % {'higher' if off > 0 else 'lower'} than {than}"
    remedy = "measure both sides of the board and give a square's width x height, as --square-mm"
    text += f" (± {std:.2f} %; width runs along the {board.columns} corners): {remedy} {wide:.2f}x{wide * aspect:.2f}"
    return [(1, text)]


def _checks(diagnosis: Diagnosis) -> tuple[Check, ...]:
    """Everything with limits that could be measured."""
    rig, std, errors = diagnosis.rig, diagnosis.std, diagnosis.error_map
    scale = max(1.0, diagnosis.views.size[0] / _WIDTH_PX)
    rms, rows = ((good * scale, usable * scale) for good, usable in (_RMS_PX, _EPIPOLAR_PX))
    lenses = (rig.left, std.left_K), (rig.right, std.right_K)
    focal_pct = 100 * float(max((K_std[:2] / np.diag(camera.K)[:2]).max() for camera, K_std in lenses))
    square_pct, rows_px = diagnosis.square_error_pct, diagnosis.epipolar_rms_px
    checks = [Check("corners fit to", diagnosis.rms_px, "px rms", *rms, "is the board flat, held still, and in focus?")]
    if np.isfinite(rows_px):
        remedy = "did a camera or its focus move between pictures?"
        checks.append(Check("rows differ after rectification by", rows_px, "px rms", *rows, remedy))
    remedy = "is the board flat, and was it held still?"
    checks.append(Check("squares of boards left out are wrong by", square_pct, "%", *_LENGTH_PCT, remedy))
    remedy = "take more pictures, the board tilted by 20 to 40 degrees, both ways"
    checks.append(Check("the focal length is sure to", focal_pct, "%", *_LENGTH_PCT, remedy))
    if np.isfinite(errors.depth_mm).any():
        depth_pct = 100 * float(np.nanmedian(errors.depth_mm)) / errors.at_mm
        remedy = "take more pictures, near and far and all over the image"
        checks.append(Check(f"depths at {errors.at_mm:g} mm are sure to", depth_pct, "%", *_LENGTH_PCT, remedy))
    return tuple(checks)


def _check_findings(diagnosis: Diagnosis) -> list[Finding]:
    findings = [(check.level, str(check)) for check in diagnosis.checks if check.level]
    at_mm = diagnosis.error_map.at_mm
    if not np.isfinite(diagnosis.error_map.depth_mm).any():
        findings.append((1, f"at {at_mm:g} mm the two views do not overlap: no depth can be judged there"))
    return findings


def _epipolar(rig: StereoRig, views: BoardViews) -> tuple[Float64, list[Finding]]:
    """Row error of each pair after rectification, px rms (n,); NaN, and why, for a rig that cannot be rectified."""
    try:
        errors = epipolar_errors_px(rig.rectify(), views)
    except ValueError as error:
        return np.full(len(views), np.nan), [(2, f"the pair cannot be rectified: {error}")]
    return np.asarray(np.sqrt(np.nanmean(errors**2, axis=1))), []
