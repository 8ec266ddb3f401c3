"""Is this calibration good? Faults of the board pairs by name, and a verdict in metric units."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from stereolib.calibration.board_size import leave_one_out
from stereolib.calibration.boards import BoardViews, Checkerboard
from stereolib.calibration.bundle_adjustment import Fit
from stereolib.calibration.bundle_adjustment import fit as fit_again
from stereolib.calibration.coverage import Coverage, measure
from stereolib.calibration.lens_model import HoldOut, choose, neighbours
from stereolib.calibration.outliers import sort_pairs
from stereolib.calibration.solve import Fold, epipolar_errors_px, fold_inside
from stereolib.calibration.uncertainty import ErrorMap, RigStd, error_map, rectified_std, rig_covariance, rig_std
from stereolib.rig import StereoRig

Array = np.ndarray
#: Up to the first a calibration is good, up to the second usable: corners and rows in pixels of an image 640 wide (more
#: for wider ones), focal lengths, sizes and depths in per cent; 0.5 % is 1.5 mm on the paper's cube.
_RMS_PX, _EPIPOLAR_PX, _LENGTH_PCT = (0.5, 2.0), (0.3, 1.0), (0.5, 2.0)
_WIDTH_PX = 640
_FEW_PAIRS = 8
_LITTLE_IMAGE = 0.2
_STRETCH = 0.003
_FOLDED = 0.001  # of the image: less is worth a word and nothing more
_SQUARES_MM = (5.0, 300.0)


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
    model : name of the lens model
    views : the pairs used, `BoardViews`; ``pairs_used`` are their names
    rig, rms_px, std : the calibration, its fit over all corners, its standard deviations
    pairs_refused : name -> reason, for pairs left out of the fit
    pair_rms_px : (n, 2) of the pairs used, left and right
    residuals_px : (2, n, corners, 2), found minus predicted, left then right; NaN where a corner was not found
    coverage : `Coverage`
    groups : names of the pairs of each position of the rig, largest first; one group for a sound set
    error_map : `ErrorMap` at the boards' median distance, or where it was asked for
    square_error_pct : mean over pairs of how wrong the squares' size is, each pair left out of its rig
    board_error_pct : the same of the board's longer edge
    epipolar_rms_px, worst_pair, worst_pair_px : row errors after rectification, and the pair with the largest rms
    folds : what `calibration.fold_inside` says, of either camera; empty for a sound lens
    lenses : `HoldOut` of this lens model and its neighbours, shortest first; empty for too few pairs
    checks : `Check` of everything that has limits
    warnings : everything noteworthy, one sentence each
    verdict : "good", "usable" or "bad"; ``reasons`` are the sentences that made it so
    """

    model: str
    views: BoardViews
    rig: StereoRig
    rms_px: float
    std: RigStd
    pairs_refused: dict[str, str]
    pair_rms_px: Array
    residuals_px: Array
    coverage: Coverage
    groups: tuple[tuple[str, ...], ...]
    error_map: ErrorMap
    rectified_std: dict[str, float]
    square_error_pct: float
    board_error_pct: float
    epipolar_rms_px: float
    worst_pair: str
    worst_pair_px: float
    folds: tuple[str, ...]
    lenses: tuple[HoldOut, ...]
    checks: tuple[Check, ...]
    warnings: tuple[str, ...]
    verdict: str
    reasons: tuple[str, ...]

    @property
    def pairs_used(self) -> tuple[str, ...]:
        """Names of the pairs that the calibration stands on."""
        return self.views.names


def diagnose(
    views: BoardViews, *, model: str = "brown3", ruler_mm: float | None = None, at_mm: float | None = None
) -> Diagnosis:
    """Calibrate a rig from board pairs and judge the result.

    Parameters
    ----------
    views : BoardViews
        From `detection.find_in_files` or `targets.find_in_pairs`.
    model : str
        A name of `calibration.LENS_MODELS`.
    ruler_mm : float, optional
        The distance of the two lenses by a ruler: checks the board's size.
    at_mm : float, optional
        Where depths are judged; the boards' median distance if not given.

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
    std = rig_std(rig, covariance)
    coverage = measure(used, fit.turns, fit.shifts)
    sizes = leave_one_out(used, fit)
    epipolar, unrectified = _epipolar(rig, used)
    middles_mm = fit.shifts + fit.turns @ used.board.points_mm.mean(axis=0)
    at_mm = at_mm or float(f"{np.median(middles_mm[:, 2]):.2g}")
    worst = int(np.nanargmax(epipolar)) if np.isfinite(epipolar).any() else int(fit.pair_rms_px.max(axis=1).argmax())
    folds = [(side, fold) for side in ("left", "right") if (fold := fold_inside(getattr(rig, side)))]
    groups = tuple(tuple(views.names[k] for k in group) for group in pairs.groups)
    found = Diagnosis(
        model=model, views=used, rig=rig, rms_px=fit.rms_px, std=std,
        pairs_refused={views.names[k]: why for k, why in sorted(pairs.refused.items())},
        pair_rms_px=fit.pair_rms_px,
        residuals_px=np.where(fit.seen[..., None], fit.residuals_px, np.nan).transpose(1, 0, 2, 3),
        coverage=coverage, groups=groups, error_map=error_map(rig, covariance, at_mm=at_mm),
        rectified_std={} if unrectified else rectified_std(rig.rectify(), covariance),
        square_error_pct=sizes.square_error_pct, board_error_pct=sizes.board_error_pct,
        epipolar_rms_px=float(np.sqrt(np.nanmean(epipolar**2))) if np.isfinite(epipolar).any() else np.nan,
        worst_pair=used.names[worst], worst_pair_px=float(epipolar[worst]),
        folds=tuple(f"the {side} lens {fold}" for side, fold in folds),
        lenses=tuple(neighbours(used, fit, model)) if len(used) >= _FEW_PAIRS else (),
        checks=(), warnings=(), verdict="", reasons=(),
    )  # fmt: skip
    found = replace(found, checks=_checks(found))
    findings = [  # causes before what they cause
        *_set_findings(found, pairs.moved, ruler_mm), *_board_findings(used, fit), *unrectified, *_lens_findings(found),
        *_coverage_findings(found), *_check_findings(found), *(_fold_finding(found, *fold) for fold in folds),
    ]  # fmt: skip
    level = max((level for level, _ in findings), default=0)
    reasons = tuple(text for at, text in findings if at == level and level)
    return replace(
        found, warnings=tuple(text for _, text in findings), verdict=("good", "usable", "bad")[level], reasons=reasons
    )


Finding = tuple[int, str]  # how bad (0 a remark, 1 usable, 2 bad), and what


def _set_findings(found: Diagnosis, moved: tuple[str, ...], ruler_mm: float | None) -> list[Finding]:
    """What is wrong with the set of pairs."""
    findings = [(2, f"two positions of the rig are mixed: {text}") for text in moved]
    total = len(found.views) + len(found.pairs_refused)
    lone = [name for name, why in found.pairs_refused.items() if not why.startswith("belongs to")]
    if lone:
        listed = ", ".join(lone[:6]) + (", ..." if len(lone) > 6 else "")
        findings.append((1 + (len(lone) > total / 4), f"{len(lone)} of {total} pairs were left out: {listed}"))
    if ruler_mm is not None and abs(found.rig.baseline_mm / ruler_mm - 1) > max(0.02, 2 / ruler_mm):
        square = found.views.board.square_mm * ruler_mm / found.rig.baseline_mm
        findings.append((2, f"the board or the ruler is measured wrong: the baseline comes out "
                            f"{found.rig.baseline_mm:.1f} mm, the ruler says {ruler_mm:.1f} mm, so the squares would "
                            f"be {square:.2f} mm and not {found.views.board.square_mm:g} mm"))  # fmt: skip
    if not _SQUARES_MM[0] <= (square := found.views.board.square_mm) <= _SQUARES_MM[1]:
        findings.append((0, f"squares of {square:g} mm and a baseline of {found.rig.baseline_mm:.3g} mm: was the "
                            f"square's edge given in millimetres?"))  # fmt: skip
    return findings


def _coverage_findings(found: Diagnosis) -> list[Finding]:
    """What the boards leave out."""
    findings: list[Finding] = []
    if len(found.views) < _FEW_PAIRS:
        findings.append((1, f"{len(found.views)} pairs are few: {_FEW_PAIRS} or more make the result trustworthy"))
    for text in found.coverage.missing:
        findings.append((1, f"{text}: hold the board there in some pictures" if "no views" in text else text))
    if found.coverage.image < _LITTLE_IMAGE:
        findings.append(
            (1, f"the boards cover only {100 * found.coverage.image:.0f} % of the images: hold them nearer")
        )
    return findings


def _lens_findings(found: Diagnosis) -> list[Finding]:
    """Whether another lens model predicts boards better to which it was not fitted, or as well with less."""
    lenses = {lens.model: lens for lens in found.lenses}
    if not lenses or (best := lenses[choose(found.lenses)]) == (ours := lenses[found.model]):
        return []
    errors = f"({best.hold_out_rms_px:.3f} px against {ours.hold_out_rms_px:.3f} px)"
    if best.coefficients > ours.coefficients:
        return [(1, f"the lens model {ours.model} is too short: {best.model} predicts boards left out better {errors}, "
                    f"and no deviation stated here counts that; use --model {best.model}")]  # fmt: skip
    return [(0, f"the last coefficients of {ours.model} cannot be told from these pictures: {best.model} predicts "
                f"boards left out as well {errors}; use --model {best.model}")]  # fmt: skip


def _fold_finding(found: Diagnosis, side: str, fold: Fold) -> Finding:
    """A fold among the boards spoils what they say; elsewhere it costs pixels that nothing was known of anyway."""
    corners = found.views.left_px if side == "left" else found.views.right_px
    seen = corners[np.isfinite(corners).all(axis=2)]
    if np.isnan(getattr(found.rig, side).rays(seen)).any():
        return 2, f"the {side} lens {fold}, where boards were seen: use a shorter --model"
    level = int(fold.share > _FOLDED)
    remedy = "boards held there or a shorter --model mend it" if level else "too few to matter"
    return level, f"the {side} lens {fold}; those pixels cannot be rectified: {remedy}"


def _board_findings(used: BoardViews, fit: Fit) -> list[Finding]:
    """Whether the board's squares are as high as wide.

    The residuals of a second fit, with squares 1 % higher, give the height that fits best: a secant step of
    Gauss-Newton in which all other parameters follow. Its deviation is the jackknife's.
    """
    board = used.board
    if not isinstance(board, Checkerboard):
        return []
    stretched = replace(used, board=replace(board, aspect=board.aspect + 0.01))
    before = fit.residuals_px
    change = np.where(fit.seen[..., None], fit_again(stretched, fit.rig).residuals_px - before, 0.0)
    along, length = (before * change).sum(axis=(1, 2, 3)), (change**2).sum(axis=(1, 2, 3))
    stretch = -0.01 * float(along.sum() / max(length.sum(), 1e-30))
    if abs(stretch) < _STRETCH or along.sum() ** 2 < 0.1 * length.sum() * (before**2).sum():
        return []
    others = -0.01 * (along.sum() - along) / (length.sum() - length)
    off, std = 100 * stretch / board.aspect, 100 * np.sqrt((len(others) - 1) * np.var(others))
    than, aspect = "they are wide" if board.aspect == 1 else "given", board.aspect + stretch
    wide = 2 * board.square_mm / (1 + aspect)
    return [(1, f"the board's squares come out {abs(off):.1f} % {'higher' if off > 0 else 'lower'} than {than} "
                f"(± {std:.2f} %; width runs along the {board.columns} corners): measure both sides of the board and "
                f"give a square's width x height, as --square-mm {wide:.2f}x{wide * aspect:.2f}")]  # fmt: skip


def _checks(found: Diagnosis) -> tuple[Check, ...]:
    """Everything with limits that could be measured."""
    errors, scale = found.error_map, max(1.0, found.views.size[0] / _WIDTH_PX)
    cameras = (found.rig.left, found.std.left_K), (found.rig.right, found.std.right_K)
    focal_pct = 100 * float(max((std[:2] / np.diag(camera.K)[:2]).max() for camera, std in cameras))
    checks = [Check("corners fit to", found.rms_px, "px rms", _RMS_PX[0] * scale, _RMS_PX[1] * scale,
                    "is the board flat, held still, and in focus?")]  # fmt: skip
    if np.isfinite(found.epipolar_rms_px):
        checks.append(Check("rows differ after rectification by", found.epipolar_rms_px, "px rms",
                            _EPIPOLAR_PX[0] * scale, _EPIPOLAR_PX[1] * scale,
                            "did a camera or its focus move between pictures?"))  # fmt: skip
    checks += [
        Check("squares of boards left out are wrong by", found.square_error_pct, "%", *_LENGTH_PCT,
              "is the board flat, and was it held still?"),
        Check("the focal length is sure to", focal_pct, "%", *_LENGTH_PCT,
              "take more pictures, the board tilted by 20 to 40 degrees, both ways"),
    ]  # fmt: skip
    if np.isfinite(errors.depth_mm).any():
        depth_pct = 100 * float(np.nanmedian(errors.depth_mm)) / errors.at_mm
        checks.append(Check(f"depths at {errors.at_mm:g} mm are sure to", depth_pct, "%", *_LENGTH_PCT,
                            "take more pictures, near and far and all over the image"))  # fmt: skip
    return tuple(checks)


def _check_findings(found: Diagnosis) -> list[Finding]:
    findings = [(check.level, str(check)) for check in found.checks if check.level]
    if not np.isfinite(found.error_map.depth_mm).any():
        findings.append(
            (1, f"at {found.error_map.at_mm:g} mm the two views do not overlap: no depth can be judged there")
        )
    return findings


def _epipolar(rig: StereoRig, views: BoardViews) -> tuple[Array, list[Finding]]:
    """Row error of each pair after rectification, px rms (n,); NaN, and why, for a rig that cannot be rectified."""
    try:
        errors = epipolar_errors_px(rig.rectify(), views)
    except ValueError as error:
        return np.full(len(views), np.nan), [(2, f"the pair cannot be rectified: {error}")]
    return np.sqrt(np.nanmean(errors**2, axis=1)), []
