"""What speaks for and against a calibration, in sentences that name the remedy, and what they make of the verdict."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stereolib.base import counted
from stereolib.calibration.board_size import board_stretch
from stereolib.calibration.boards import Checkerboard
from stereolib.calibration.lens_choice import choose_lens_model
from stereolib.calibration.lens_models import LensFold, fold_inside
from stereolib.calibration.misfits import by_reason, in_short
from stereolib.rig import StereoRig

if TYPE_CHECKING:
    from stereolib.calibration.diagnosis import Diagnosis

#: What decides the verdict, per cent of a depth or a length: up to the first a calibration is good, up to the second
#: usable; 0.5 % is 1.5 mm on the paper's cube.
ERROR_PCT = (0.5, 2.0)
#: Beyond it advice is due: corners and rows in pixels of an image 640 wide (more for wider ones), focal lengths in %.
_RMS_PX, _EPIPOLAR_PX, _FOCAL_PCT = 0.5, 0.3, 0.5
_WIDTH_PX = 640
FEW_PAIRS = 8  # fewer say too little about what they leave out
_RULER = (0.02, 2.0)  # share of the baseline, and mm: a ruler between two lenses is no better
_MAGNIFIED = 3.0  # times: rows err as many times more, and a ninth of each picture is left
_LEAST_LEFT = 1 / _MAGNIFIED**2  # of each picture: where cropping fails, nothing is magnified but as little is left
_FOLDED = 0.001  # of the image: less is worth a word and nothing more
_SQUARES_MM = (5.0, 300.0)  # other sizes were hardly meant in millimetres
_RATIO = "the pictures tell nothing but the height by the width"
_BASELINES_MM = (15.0, 500.0)  # lenses of two webcams stand no nearer, and hardly farther apart
_LISTED = 4  # pairs of names in one sentence
_ADVICE = 3  # lines: more are not read
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


def picture_scale(size: tuple[int, int]) -> float:
    """Tell how much larger limits in pixels are in pictures of a size: 1 up to 640 columns, in proportion beyond."""
    return max(1.0, size[0] / _WIDTH_PX)


def judged(diagnosis: Diagnosis, moved_by: tuple[str, ...], ruler_mm: float | None) -> Diagnosis:
    """Add what was checked, what was found, the verdict, its reasons and what is to be done.

    Parameters
    ----------
    diagnosis : Diagnosis
    moved_by : tuple of str
        How far the rig moved between the groups of pairs.
    ruler_mm : float, optional
        The distance of the lenses by a ruler.

    Returns
    -------
    Diagnosis
    """
    diagnosis = replace(diagnosis, checks=checks_of(diagnosis))
    return with_verdict(
        diagnosis,
        [
            *_moved_findings(diagnosis, moved_by),
            *_ruler_findings(diagnosis, ruler_mm),
            *_pair_findings(diagnosis),
            *_corner_findings(diagnosis),
            *_board_findings(diagnosis),
            *_rectification_findings(diagnosis),
            *_scale_findings(diagnosis, ruler_mm),
            *_lens_findings(diagnosis),
            *_settling_findings(diagnosis),
            *_coverage_findings(diagnosis),
            *check_findings(diagnosis),
            *(_fold_finding(diagnosis, *fold) for fold in folds_of(diagnosis.rig)),
        ],
    )


def with_verdict(diagnosis: Diagnosis, findings: list[Finding]) -> Diagnosis:
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


def _moved_findings(diagnosis: Diagnosis, moved_by: tuple[str, ...]) -> list[Finding]:
    """Whether the set mixes several positions of the rig."""
    if not moved_by:
        return []
    groups = "; ".join(f"{len(group)} pairs: {in_short(group, diagnosis.pairs)}" for group in diagnosis.groups)
    number = _NUMBERS.get(len(diagnosis.groups), f"{len(diagnosis.groups)}")
    text = f"{number} positions of the rig are mixed ({', '.join(moved_by)}): calibrate each group by itself"
    return [Finding(_BAD, f"{text} ({groups})")]


def _ruler_findings(diagnosis: Diagnosis, ruler_mm: float | None) -> list[Finding]:
    """Whether a ruler between the lenses agrees."""
    baseline, square = diagnosis.rig.baseline_mm, diagnosis.views.board.square_mm
    if ruler_mm is not None and abs(baseline / ruler_mm - 1) > max(_RULER[0], _RULER[1] / ruler_mm):
        text = f"the baseline comes out {baseline:.1f} mm, the ruler says {ruler_mm:.1f} mm"
        squares = f"so the squares would be {square * ruler_mm / baseline:.2f} mm and not {square:g} mm"
        return [Finding(_BAD, f"the board or the ruler is measured wrong: {text}, {squares}")]
    return []


def _scale_findings(diagnosis: Diagnosis, ruler_mm: float | None) -> list[Finding]:
    """Whether the squares can be as large as they were said to be."""
    baseline, square = diagnosis.rig.baseline_mm, diagnosis.views.board.square_mm
    odd, likely = not _BASELINES_MM[0] <= baseline <= _BASELINES_MM[1], _SQUARES_MM[0] <= square <= _SQUARES_MM[1]
    if odd and ruler_mm is None:
        text = f"squares of {square:g} mm make the lenses stand {baseline:.3g} mm apart, as those of two webcams do not"
        remedy = (
            "all sizes are off alike if the square's edge is mistyped; measure it, in millimetres, or if it is right"
        )
        return [
            Finding(
                _BAD,
                f"{text}: {remedy} give the distance of the lenses by a ruler, as --ruler-mm (in rig.toml: ruler_mm)",
            )
        ]
    if not likely:
        text = f"squares of {square:g} mm and a baseline of {baseline:.3g} mm"
        return [Finding(_REMARK, f"{text}: was the square's edge given in millimetres?")]
    return []


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


def _board_findings(diagnosis: Diagnosis) -> list[Finding]:
    """Whether the board's squares are as high as wide."""
    board, found = diagnosis.views.board, board_stretch(diagnosis.views, diagnosis.fit)
    if found is None or not isinstance(board, Checkerboard):
        return []
    off, std, aspect = 100 * found[0] / board.aspect, 100 * found[1], board.aspect + found[0]
    than = "they are wide" if board.aspect == 1 else "given"
    text = f"the board's squares come out {abs(off):.1f} % {'higher' if off > 0 else 'lower'} than {than}"
    remedy = "measure both sides of the board over many squares, and give one's as --square-mm WIDTHxHEIGHT "
    remedy += f"(in rig.toml: square_mm; {_RATIO}"
    text += f" (± {std:.2f} %; width runs along the {board.columns} corners): {remedy}, {aspect:.3f})"
    return [Finding(_level(abs(off)), text)]


def _rectification_findings(diagnosis: Diagnosis) -> list[Finding]:
    """Whether the pair can be rectified, and what is left of its pictures."""
    d, rig = diagnosis, diagnosis.rig
    if d.unrectified:
        return [Finding(_BAD, f"the pair cannot be rectified: {d.unrectified}")]
    angle, how = np.arccos(np.clip(rig.R[2, 2], -1, 1)), "converge" if rig.R[2, 0] < 0 else "diverge"
    sees = min(2 * np.arctan(camera.size[0] / 2 / camera.K[0, 0]) for camera in (rig.left, rig.right))
    if d.magnification <= _MAGNIFIED and d.picture_left >= _LEAST_LEFT and angle <= sees:
        return []
    text = f"the cameras {how} by {np.degrees(angle):.0f} degrees: too much for this rectification, which"
    does = f"magnifies {d.magnification:.1f} times and leaves {100 * d.picture_left:.0f} % of a picture"
    if angle > sees:  # OpenCV crops nothing then
        does = f"finds no direction that both pictures show, {np.degrees(sees):.0f} degrees wide each"
    return [Finding(_BAD, f"{text} {does}: turn them to where their axes are nearly parallel")]


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


def _settling_findings(diagnosis: Diagnosis) -> list[Finding]:
    """Whether the fit came to its end."""
    if diagnosis.fit.converged:
        return []
    text = f"the fit with {diagnosis.model} did not settle, these pictures leave some of its coefficients open"
    return [Finding(_REMARK, f"{text}: use a shorter --model, or hold boards to the rims of the pictures")]


def _coverage_findings(diagnosis: Diagnosis) -> list[Finding]:
    """What the boards leave out."""
    findings: list[Finding] = []
    if (count := len(diagnosis.views)) < FEW_PAIRS:
        findings.append(Finding(_REMARK, f"{count} pairs are few: 15 to 30 make the result trustworthy"))
    return [*findings, *(Finding(_REMARK, text) for text in diagnosis.coverage.advice)]


def checks_of(diagnosis: Diagnosis) -> tuple[Check, ...]:
    """Everything with limits that could be measured."""
    d, rig, std, at = diagnosis, diagnosis.rig, diagnosis.std, f"at {diagnosis.error_map.at_mm:g} mm"
    scale = picture_scale(d.views.size)
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


def check_findings(diagnosis: Diagnosis) -> list[Finding]:
    """What exceeds its limits; of depths and lengths, which are unsure for the same reasons, the worse."""
    at_mm, checks = diagnosis.error_map.at_mm, list(diagnosis.checks)
    if not np.isfinite(diagnosis.depth_pct):
        remedy = "give the distance where you measure as --at-mm (in rig.toml: at_mm), or point the cameras there"
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


def folds_of(rig: StereoRig) -> list[tuple[str, LensFold]]:
    """List the sides whose lens folds over inside its picture, and where."""
    return [(side, fold) for side in ("left", "right") if (fold := fold_inside(getattr(rig, side)))]


def _level(error_pct: float) -> int:
    """What an error means for the verdict."""
    return _REMARK if error_pct <= ERROR_PCT[0] else _USABLE if error_pct <= ERROR_PCT[1] else _BAD
