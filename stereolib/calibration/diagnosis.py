"""Is this calibration good? Faults of the board pairs by name, and a verdict in metric units."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from stereolib.base import Float64, counted
from stereolib.calibration.board_size import board_stretch, left_out_size_errors
from stereolib.calibration.boards import BoardViews, Checkerboard
from stereolib.calibration.bundle_adjustment import RigFit
from stereolib.calibration.coverage import Coverage, judge_coverage
from stereolib.calibration.lens_choice import (
    HoldOut,
    choose_lens_model,
    left_out_errors,
    lens_errors_mm,
    neighbour_fits,
)
from stereolib.calibration.lens_models import LensFold, fold_inside
from stereolib.calibration.misfits import by_reason, in_short
from stereolib.calibration.outliers import SortedPairs, sort_pairs
from stereolib.calibration.solve import epipolar_errors_px, rectified_scale
from stereolib.calibration.uncertainty import ErrorMap, RigStd, error_map, rectified_std, rig_covariance, rig_std
from stereolib.calibration.wrong_corners import CornerOff, corners_off
from stereolib.rig import StereoRig

#: What decides the verdict, per cent of a depth or a length: up to the first a calibration is good, up to the second
#: usable; 0.5 % is 1.5 mm on the paper's cube.
ERROR_PCT = (0.5, 2.0)
#: Beyond it advice is due: corners and rows in pixels of an image 640 wide (more for wider ones), focal lengths in %.
_RMS_PX, _EPIPOLAR_PX, _FOCAL_PCT = 0.5, 0.3, 0.5
WIDTH_PX = 640
_LENGTH_MM, _LENGTH_SHARE = 100.0, 0.1  # the length whose error is told; nearer, that share of the distance
_FEW_PAIRS = 8  # fewer say too little about what they leave out
_RULER = (0.02, 2.0)  # share of the baseline, and mm: a ruler between two lenses is no better
_LITTLE_IMAGE = 0.2  # share of the images: a lens that was seen on less is a guess elsewhere
_MAGNIFIED = 3.0  # times: rows err as many times more, and a ninth of each picture is left
_LEAST_LEFT = 1 / _MAGNIFIED**2  # of each picture: where cropping fails, nothing is magnified but as little is left
_FOLDED = 0.001  # of the image: less is worth a word and nothing more
_SQUARES_MM = (5.0, 300.0)  # other sizes were hardly meant in millimetres
_LISTED = 4  # pairs of names in one sentence
_ADVICE = 3  # lines: more are not read
#: How what boards leave out begins, and what mends it: what leaves the focal length open stands first.
_REMEDIES = {
    "all boards fronto-parallel": "",  # says it itself
    "no boards": ": add such pictures",
    "all boards at one distance": ": hold some nearer and some farther away",
    "no views": ": hold the board there in some pictures",
}
_NUMBERS = {2: "two", 3: "three", 4: "four"}
_NOTE, _REMARK, _USABLE, _BAD = -1, 0, 1, 2  # for the record; advice; what makes the verdict no better than that


class Finding(NamedTuple):
    """A sentence on a calibration, and what it means for the verdict."""

    level: int
    text: str


class Check(NamedTuple):
    """A measured quantity of a calibration and its limits: up to ``good``, up to ``usable``, beyond that bad.

    Where ``usable`` is infinite the quantity is worth advice beyond ``good`` and never decides the verdict.
    """

    name: str
    value: float
    unit: str
    good: float
    usable: float
    remedy: str

    @property
    def decides(self) -> bool:
        """Whether it counts in the verdict."""
        return bool(np.isfinite(self.usable))

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
    pairs : tuple of str
        Names of all pairs in which both cameras saw the board.
    pairs_refused : dict
        Name of each of these that was left out of the fit, and the reason.
    pairs_repeated : dict
        Name of each of these that shows the board where another pair does, and that one's name.
    pair_rms_px : (n, 2) float64
        Of the pairs used, left and right.
    residuals_px : (2, n, corners, 2) float64
        Found minus predicted, left then right; NaN where a corner was not found.
    coverage : Coverage
    groups : tuple of tuple of str
        Names of the pairs of each position of the rig, largest first; one group for a sound set.
    error_map : ErrorMap
        Where it was asked for; what a lens model too short makes wrong is in it.
    lens_error_pct : float
        So much of depth or length, whichever is more, is due to a lens model too short; 0 if it is not.
    rectified_std : dict
        From `rectified_std`; empty if the rig cannot be rectified, or sees nothing where rigs measure.
    magnification, picture_left : float
        From `rectified_scale`; NaN if the rig cannot be rectified.
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
    wrong_corners : tuple of CornerOff
        Single corners of these pairs that were left out, the farthest off first.
    checks : tuple of Check
        Everything that has limits.
    warnings : tuple of str
        Everything noteworthy, one sentence each, causes before what they cause.
    verdict : str
        ``"good"``, ``"usable"`` or ``"bad"``: by the errors of depth and length, and what makes these untrue.
    reasons : tuple of str
        The sentences that made it so, the worst first.
    advice : tuple of str
        The first three others that name something to be done.
    """

    model: str
    views: BoardViews
    rig: StereoRig
    rms_px: float
    std: RigStd
    pairs: tuple[str, ...]
    pairs_refused: dict[str, str]
    pairs_repeated: dict[str, str]
    pair_rms_px: Float64
    residuals_px: Float64
    coverage: Coverage
    groups: tuple[tuple[str, ...], ...]
    error_map: ErrorMap
    lens_error_pct: float
    rectified_std: dict[str, Any]
    magnification: float
    picture_left: float
    square_error_pct: float
    board_error_pct: float
    epipolar_rms_px: float
    worst_pair: str
    worst_pair_px: float
    folds: tuple[str, ...]
    lenses: tuple[HoldOut, ...]
    fit: RigFit
    wrong_corners: tuple[CornerOff, ...]
    checks: tuple[Check, ...] = ()
    warnings: tuple[str, ...] = ()
    verdict: str = ""
    reasons: tuple[str, ...] = ()
    advice: tuple[str, ...] = ()

    @property
    def worst_corners(self) -> list[CornerOff]:
        """Corners with where the others expect them: those left out, then those of the fit, the farthest off first."""
        found = np.stack([self.views.left_px, self.views.right_px]).astype(float)
        fitted = [
            corner
            for side, at, residuals in zip(("left", "right"), found, self.residuals_px, strict=True)
            for corner in corners_off(self.views, side, at - residuals, np.isfinite(residuals[..., 0]))
        ]
        return [*self.wrong_corners, *sorted(fitted, key=lambda corner: -corner.off_px)]

    @property
    def pairs_used(self) -> tuple[str, ...]:
        """Names of the pairs that the calibration stands on."""
        return self.views.names

    @property
    def pairs_left_out(self) -> dict[str, str]:
        """Names of all pairs that the calibration does not stand on, and why."""
        return dict.fromkeys(self.views.missing, "the board was not found in both views") | self.pairs_refused

    @property
    def left_out_by_reason(self) -> list[tuple[str, str]]:
        """Names of pairs, in short, and why the calibration does not stand on them: one line for each reason."""
        return by_reason(self.pairs_left_out, self.pairs)

    @property
    def depth_mm(self) -> float:
        """Standard deviation of a depth where it was asked for: the median over the picture; NaN if none is seen."""
        return _median(self.error_map.depth_mm)

    @property
    def length_mm(self) -> float:
        """Standard deviation of a length of ``error_map.of_mm`` there, likewise."""
        return _median(self.error_map.length_mm)

    @property
    def depth_pct(self) -> float:
        """Standard deviation of a depth, of the depth, %."""
        return 100 * self.depth_mm / self.error_map.at_mm

    @property
    def length_pct(self) -> float:
        """Standard deviation of a length, of the length, %."""
        return 100 * self.length_mm / self.error_map.of_mm


def diagnose(
    views: BoardViews, *, model: str = "brown3", ruler_mm: float | None = None, at_mm: float = 1000.0
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
    at_mm : float
        Where the rig is to measure: errors are judged there.

    Returns
    -------
    Diagnosis

    Raises
    ------
    ValueError
        Fewer than 5 usable pairs, all views alike, left and right exchanged, or pairs that do not belong together.

    Notes
    -----
    The verdict follows the error of depth and of length, one standard deviation, and what makes this untrue: a lens
    model too short (what it makes wrong is added), boards left out whose size comes out wrong, a ruler that
    contradicts, squares not as high as wide, a rig that moved, one that cannot be rectified or sees nothing there, a
    lens that folds where boards were seen. All else is advice.
    """
    for what, value in (("ruler's reading", ruler_mm), ("distance to judge depths at", at_mm)):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise ValueError(f"the {what} must be a positive number of mm, got {value}")
    pairs = sort_pairs(views, model)
    used = pairs.views.only(pairs.groups[0])
    fit, rig = pairs.calibration.fit, pairs.calibration.rig
    covariance = rig_covariance(fit)
    sizes = left_out_size_errors(used, fit)
    rows, scale, unrectified = _rectified(rig, used)
    worst = int(np.nanargmax(rows)) if np.isfinite(rows).any() else int(fit.pair_rms_px.max(axis=1).argmax())
    fits = neighbour_fits(used, fit, model) if len(used) >= _FEW_PAIRS else {}
    lenses = left_out_errors(fits)
    errors, lens_error_pct = _with_lens(
        error_map(rig, covariance, at_mm=at_mm, of_mm=min(_LENGTH_MM, at_mm * _LENGTH_SHARE)),
        rig,
        fits,
        _better(lenses, model),
    )
    diagnosis = Diagnosis(
        model=model,
        views=used,
        rig=rig,
        rms_px=fit.rms_px,
        std=rig_std(rig, covariance),
        pairs=views.names,
        pairs_refused={views.names[k]: why for k, why in sorted(pairs.refused.items())},
        pairs_repeated={views.names[k]: views.names[other] for k, other in sorted(pairs.repeated.items())},
        pair_rms_px=fit.pair_rms_px,
        residuals_px=np.where(fit.known[..., None], fit.residuals_px, np.nan).transpose(1, 0, 2, 3),
        coverage=judge_coverage(used, fit.turns, fit.shifts),
        groups=tuple(tuple(views.names[k] for k in group) for group in pairs.groups),
        error_map=errors,
        lens_error_pct=lens_error_pct,
        rectified_std=_rectified_std(rig, covariance) if np.isfinite(scale[0]) else {},
        magnification=scale[0],
        picture_left=scale[1],
        square_error_pct=sizes.square_error_pct,
        board_error_pct=sizes.board_error_pct,
        epipolar_rms_px=float(np.sqrt(np.nanmean(rows**2))) if np.isfinite(rows).any() else np.nan,
        worst_pair=used.names[worst],
        worst_pair_px=float(rows[worst]),
        folds=tuple(f"the {side} lens {fold}" for side, fold in _folds(rig)),
        lenses=lenses,
        fit=fit,
        wrong_corners=tuple(corner for corner in pairs.wrong_corners if corner.pair in used.names),
    )
    diagnosis = replace(diagnosis, checks=_checks(diagnosis))
    return _judged(
        diagnosis,
        [
            *_moved_findings(diagnosis, pairs),
            *_ruler_findings(diagnosis, ruler_mm),
            *_pair_findings(diagnosis),
            *_corner_findings(diagnosis),
            *_board_findings(used, fit),
            *unrectified,
            *_lens_findings(diagnosis),
            *_coverage_findings(diagnosis),
            *_check_findings(diagnosis),
            *(_fold_finding(diagnosis, *fold) for fold in _folds(rig)),
        ],
    )


def _judged(diagnosis: Diagnosis, findings: list[Finding]) -> Diagnosis:
    """The verdict, its reasons and what is to be done.

    Findings come with causes before what they cause: a rig that moved, scale, single pairs, the board, the lens, what
    boards leave out, then the errors that all of this makes, and last what concerns few pixels. So whoever follows the
    first line of advice may find the others gone.
    """
    reasons = sorted((f for f in findings if f.level > _REMARK), key=lambda finding: -finding.level)
    return replace(
        diagnosis,
        warnings=tuple(finding.text for finding in findings),
        verdict=("good", "usable", "bad")[max((f.level for f in reasons), default=0)],
        reasons=tuple(finding.text for finding in reasons),
        advice=tuple(finding.text for finding in findings if finding.level == _REMARK)[:_ADVICE],
    )


def _moved_findings(diagnosis: Diagnosis, pairs: SortedPairs) -> list[Finding]:
    """Whether the set mixes several positions of the rig."""
    if not pairs.moved_by:
        return []
    groups = "; ".join(f"{len(group)} pairs: {in_short(group, diagnosis.pairs)}" for group in diagnosis.groups)
    number = _NUMBERS.get(len(diagnosis.groups), f"{len(diagnosis.groups)}")
    text = f"{number} positions of the rig are mixed ({', '.join(pairs.moved_by)}): calibrate each group by itself"
    return [Finding(_BAD, f"{text} ({groups})")]


def _ruler_findings(diagnosis: Diagnosis, ruler_mm: float | None) -> list[Finding]:
    """Whether the scale can be right."""
    findings = []
    baseline, square = diagnosis.rig.baseline_mm, diagnosis.views.board.square_mm
    if ruler_mm is not None and abs(baseline / ruler_mm - 1) > max(_RULER[0], _RULER[1] / ruler_mm):
        text = f"the baseline comes out {baseline:.1f} mm, the ruler says {ruler_mm:.1f} mm"
        squares = f"so the squares would be {square * ruler_mm / baseline:.2f} mm and not {square:g} mm"
        findings.append(Finding(_BAD, f"the board or the ruler is measured wrong: {text}, {squares}"))
    if not _SQUARES_MM[0] <= square <= _SQUARES_MM[1]:
        text = f"squares of {square:g} mm and a baseline of {baseline:.3g} mm"
        findings.append(Finding(_REMARK, f"{text}: was the square's edge given in millimetres?"))
    return findings


def _pair_findings(diagnosis: Diagnosis) -> list[Finding]:
    """Pairs that say nothing, or something else than the others."""
    d, total = diagnosis, len(diagnosis.pairs)
    others = {name for group in d.groups[1:] for name in group} | set(d.pairs_repeated)
    lone = {name: why for name, why in d.pairs_refused.items() if name not in others}
    findings = []
    for names, reason in by_reason(lone, d.pairs):
        count = sum(why == reason for why in lone.values())
        findings.append(Finding(_REMARK, f"{count} of {total} pairs were left out, {names}: {reason}"))
    if d.pairs_repeated:
        listed = [f"{name} as {other}" for name, other in d.pairs_repeated.items()]
        names = ", ".join(listed[:_LISTED]) + ", ..." * (len(listed) > _LISTED)
        text = (
            f"{len(listed)} of {total} pairs show the board where another does ({names}): copies, or it was held still"
        )
        why = "one of each is used, more would make the deviations too small; move the board between pictures"
        findings.append(Finding(_REMARK, f"{text}; {why}"))
    return findings


def _corner_findings(diagnosis: Diagnosis) -> list[Finding]:
    """Single corners that stood elsewhere."""
    wrong = diagnosis.wrong_corners
    if not wrong:
        return []
    listed = "; ".join(map(str, wrong[:_LISTED])) + f"; and {len(wrong) - _LISTED} more" * (len(wrong) > _LISTED)
    what = f"{counted(len(wrong), 'corner')} left out, off by up to {wrong[0].off_px:.1f} px"
    return [Finding(_REMARK, f"{what}: look whether the board is covered, glossy or cut there ({listed})")]


def _board_findings(used: BoardViews, fit: RigFit) -> list[Finding]:
    """Whether the board's squares are as high as wide."""
    board, found = used.board, board_stretch(used, fit)
    if found is None or not isinstance(board, Checkerboard):
        return []
    off, std, aspect = 100 * found[0] / board.aspect, 100 * found[1], board.aspect + found[0]
    wide = 2 * board.square_mm / (1 + aspect)
    than = "they are wide" if board.aspect == 1 else "given"
    text = f"the board's squares come out {abs(off):.1f} % {'higher' if off > 0 else 'lower'} than {than}"
    remedy = "measure both sides of the board and give a square's width x height, as --square-mm"
    text += f" (± {std:.2f} %; width runs along the {board.columns} corners): {remedy} {wide:.2f}x{wide * aspect:.2f}"
    return [Finding(_level(abs(off)), text)]


def _lens_findings(diagnosis: Diagnosis) -> list[Finding]:
    """Whether another lens model predicts boards better to which it was not fitted, or as well with less."""
    lenses, model = {lens.model: lens for lens in diagnosis.lenses}, diagnosis.model
    if not lenses or (best := lenses[choose_lens_model(diagnosis.lenses)]) == (ours := lenses[model]):
        return []
    errors = f"({best.hold_out_rms_px:.3f} px against {ours.hold_out_rms_px:.3f} px)"
    if best.coefficients > ours.coefficients:
        text = f"the lens model {model} is too short: {best.model} predicts boards left out better {errors}"
        differ = f"the two differ by {diagnosis.lens_error_pct:.2g} % at {diagnosis.error_map.at_mm:g} mm"
        return [Finding(_level(diagnosis.lens_error_pct), f"{text}; {differ}: use --model {best.model}")]
    text = f"the last coefficients of {model} cannot be told from these pictures: {best.model} predicts boards left out"
    return [Finding(_REMARK, f"{text} as well {errors}: use --model {best.model}")]


def _coverage_findings(diagnosis: Diagnosis) -> list[Finding]:
    """What the boards leave out."""
    findings: list[Finding] = []
    count, coverage = len(diagnosis.views), diagnosis.coverage
    if count < _FEW_PAIRS:
        findings.append(Finding(_REMARK, f"{count} pairs are few: 15 to 30 make the result trustworthy"))
    for kind, remedy in _REMEDIES.items():
        if texts := [text for text in coverage.missing if text.startswith(kind)]:
            findings.append(Finding(_REMARK, "; ".join(texts) + remedy))
    if coverage.image < _LITTLE_IMAGE:
        text = f"the boards cover only {100 * coverage.image:.0f} % of the images: hold them nearer"
        findings.append(Finding(_REMARK, text))
    return findings


def _checks(diagnosis: Diagnosis) -> tuple[Check, ...]:
    """Everything with limits that could be measured."""
    d, rig, std, at = diagnosis, diagnosis.rig, diagnosis.std, f"at {diagnosis.error_map.at_mm:g} mm"
    scale = max(1.0, d.views.size[0] / WIDTH_PX)
    lenses = (rig.left, std.left_K), (rig.right, std.right_K)
    focal_pct = 100 * float(max((K_std[:2] / np.diag(camera.K)[:2]).max() for camera, K_std in lenses))
    checks = []
    if np.isfinite(d.depth_pct):
        remedy = "take more pictures, near and far and all over the image"
        checks.append(Check(f"depths {at} are sure to", d.depth_pct, "%", *ERROR_PCT, remedy))
        checks.append(Check(f"lengths {at} are sure to", d.length_pct, "%", *ERROR_PCT, remedy))
    remedy = "is the board flat, and was it held still?"
    checks.append(Check("squares of boards left out are wrong by", d.square_error_pct, "%", *ERROR_PCT, remedy))
    remedy = "is the board flat, held still, and in focus?"
    checks.append(Check("corners fit to", d.rms_px, "px rms", _RMS_PX * scale, np.inf, remedy))
    if np.isfinite(d.epipolar_rms_px) and d.magnification <= _MAGNIFIED:
        remedy, limit = "did a camera or its focus move between pictures?", _EPIPOLAR_PX * scale
        checks.append(Check("rows differ after rectification by", d.epipolar_rms_px, "px rms", limit, np.inf, remedy))
    remedy = "take more pictures, the board tilted by 20 to 40 degrees, both ways"
    checks.append(Check("the focal length is sure to", focal_pct, "%", _FOCAL_PCT, np.inf, remedy))
    return tuple(checks)


def _check_findings(diagnosis: Diagnosis) -> list[Finding]:
    """What exceeds its limits; of depths and lengths, which are unsure for the same reasons, the worse."""
    at_mm, checks = diagnosis.error_map.at_mm, list(diagnosis.checks)
    if not np.isfinite(diagnosis.depth_pct):
        remedy = "give the distance where you measure as --at-mm, or point the cameras there"
        findings = [Finding(_BAD, f"at {at_mm:g} mm the two views do not overlap: {remedy}")]
    else:
        worse, checks = max(checks[:2], key=lambda check: check.value), checks[2:]
        findings = [Finding(worse.level, str(worse))] if worse.level else []
    findings += [Finding(check.level if check.decides else _REMARK, str(check)) for check in checks if check.level]
    return findings


def _fold_finding(diagnosis: Diagnosis, side: str, fold: LensFold) -> Finding:
    """A fold among the boards spoils what they say; elsewhere it costs pixels that nothing was known of anyway."""
    corners = diagnosis.views.left_px if side == "left" else diagnosis.views.right_px
    known = corners[np.isfinite(corners).all(axis=2)]
    if np.isnan(getattr(diagnosis.rig, side).rays(known)).any():
        return Finding(_BAD, f"the {side} lens {fold}, where boards were seen: use a shorter --model")
    much = fold.share > _FOLDED
    remedy = "boards held there or a shorter --model mend it" if much else "too few to matter"
    text = f"the {side} lens {fold}; those pixels cannot be rectified: {remedy}"
    return Finding(_REMARK if much else _NOTE, text)


def _folds(rig: StereoRig) -> list[tuple[str, LensFold]]:
    return [(side, fold) for side in ("left", "right") if (fold := fold_inside(getattr(rig, side)))]


def _better(lenses: tuple[HoldOut, ...], model: str) -> str | None:
    """The longer lens model that predicts boards better, if there is one."""
    if not lenses or (best := choose_lens_model(lenses)) == model:
        return None
    coefficients = {lens.model: lens.coefficients for lens in lenses}
    return best if coefficients[best] > coefficients[model] else None


def _with_lens(errors: ErrorMap, rig: StereoRig, fits: dict[str, RigFit], better: str | None) -> tuple[ErrorMap, float]:
    """Errors with what the lens model makes wrong added, and that part alone in per cent, of depth or of length."""
    if better is None:
        return errors, 0.0
    depth, length = (np.abs(off) for off in lens_errors_mm(rig, fits[better].rig, errors))
    parts = [
        np.where(np.isfinite(own), off, np.nan) for own, off in ((errors.depth_mm, depth), (errors.length_mm, length))
    ]
    lens_pct = np.nanmax([100 * _median(parts[0]) / errors.at_mm, 100 * _median(parts[1]) / errors.of_mm, 0.0])
    whole = np.hypot(errors.depth_mm, depth), np.hypot(errors.length_mm, length)
    return replace(errors, depth_mm=whole[0], length_mm=whole[1]), float(lens_pct)


def _rectified(rig: StereoRig, views: BoardViews) -> tuple[Float64, tuple[float, float], list[Finding]]:
    """Row error of each pair after rectification, px rms (n,), its `rectified_scale`, and what speaks against it."""
    try:
        rectified = rig.rectify()
    except ValueError as error:
        finding = Finding(_BAD, f"the pair cannot be rectified: {error}")
        return np.full(len(views), np.nan), (np.nan, np.nan), [finding]
    rows, (magnified, left) = epipolar_errors_px(rectified, views), rectified_scale(rectified)
    findings = []
    angle, how = np.arccos(np.clip(rig.R[2, 2], -1, 1)), "converge" if rig.R[2, 0] < 0 else "diverge"
    sees = min(2 * np.arctan(camera.size[0] / 2 / camera.K[0, 0]) for camera in (rig.left, rig.right))
    if magnified > _MAGNIFIED or left < _LEAST_LEFT or angle > sees:
        text = f"the cameras {how} by {np.degrees(angle):.0f} degrees: too much for this rectification, which"
        does = f"magnifies {magnified:.1f} times and leaves {100 * left:.0f} % of a picture"
        if angle > sees:  # OpenCV crops nothing then
            does = f"finds no direction that both pictures show, {np.degrees(sees):.0f} degrees wide each"
        findings = [Finding(_BAD, f"{text} {does}: turn them to where their axes are nearly parallel")]
    return np.asarray(np.sqrt(np.nanmean(rows**2, axis=1))), (magnified, left), findings


def _rectified_std(rig: StereoRig, covariance: Float64) -> dict[str, Any]:
    with suppress(ValueError):  # the cameras see nothing together there
        return rectified_std(rig.rectify(), covariance)
    return {}


def _level(error_pct: float) -> int:
    """What an error means for the verdict."""
    return _REMARK if error_pct <= ERROR_PCT[0] else _USABLE if error_pct <= ERROR_PCT[1] else _BAD


def _median(values: Float64) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else float("nan")
