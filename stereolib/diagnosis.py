"""Is this calibration good? Faults of the board pairs by name, and a verdict in metric units."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stereolib.bundle import Fit
from stereolib.bundle import fit as fit_again
from stereolib.calibration import epipolar_errors_px, fold_inside
from stereolib.consistency import sort_pairs
from stereolib.coverage import Coverage, measure
from stereolib.metric import leave_one_out
from stereolib.rig import StereoRig
from stereolib.targets import BoardViews, Checkerboard
from stereolib.uncertainty import ErrorMap, RigStd, error_map, rig_covariance, rig_std

Array = np.ndarray
#: Up to the first a calibration is good, up to the second usable. Squares of 0.5 % are 1.5 mm on the paper's cube.
_RMS_PX = (0.5, 2.0)
_EPIPOLAR_PX = (0.3, 1.0)
_SIZE_PCT = (0.5, 2.0)
_FOCAL_PCT = (0.5, 2.0)
_DEPTH_MM = (3.5, 14.0)
_FEW_PAIRS = 8
_LITTLE_IMAGE = 0.2
_STRETCH = 0.003
_FOLDED = (0.001, 0.1)  # of the image: less than the first is worth a word and nothing more


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
    error_map : `ErrorMap` at 0.7 m
    square_error_pct : mean over pairs of how wrong the squares' size is, each pair left out of its rig
    board_error_pct : the same of the board's longer edge
    epipolar_rms_px, worst_pair, worst_pair_px : row errors after rectification, and the pair with the largest rms
    folds : what `calibration.fold_inside` says, of either camera; empty for a sound lens
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
    square_error_pct: float
    board_error_pct: float
    epipolar_rms_px: float
    worst_pair: str
    worst_pair_px: float
    folds: tuple[str, ...]
    warnings: tuple[str, ...]
    verdict: str
    reasons: tuple[str, ...]

    @property
    def pairs_used(self) -> tuple[str, ...]:
        """Names of the pairs that the calibration stands on."""
        return self.views.names


def diagnose(views: BoardViews, *, model: str = "brown3", ruler_mm: float | None = None) -> Diagnosis:
    """Calibrate a rig from board pairs and judge the result.

    Parameters
    ----------
    views : BoardViews
        From `detection.find_in_files` or `targets.find_in_pairs`.
    model : str
        A name of `calibration.LENS_MODELS`.
    ruler_mm : float, optional
        The distance of the two lenses by a ruler: checks the board's size.

    Raises
    ------
    ValueError
        Fewer than 3 pairs, all views alike, left and right exchanged, or pairs that do not belong together.
    """
    if ruler_mm is not None and not (np.isfinite(ruler_mm) and ruler_mm > 0):
        raise ValueError(f"the ruler's reading must be a positive number of mm, got {ruler_mm}")
    pairs = sort_pairs(views, model)
    used = views.only(pairs.groups[0])
    fit, rig = pairs.calibration.fit, pairs.calibration.rig
    covariance = rig_covariance(fit)
    std = rig_std(rig, covariance)
    coverage = measure(used, fit.turns, fit.shifts)
    sizes = leave_one_out(used, fit)
    epipolar = _epipolar(rig, used)
    worst = int(np.nanargmax(epipolar)) if np.isfinite(epipolar).any() else int(fit.pair_rms_px.max(axis=1).argmax())
    folds = [(side, fold) for side in ("left", "right") if (fold := fold_inside(getattr(rig, side)))]
    groups = tuple(tuple(views.names[k] for k in group) for group in pairs.groups)
    found = Diagnosis(
        model=model, views=used, rig=rig, rms_px=fit.rms_px, std=std,
        pairs_refused={views.names[k]: why for k, why in sorted(pairs.refused.items())},
        pair_rms_px=fit.pair_rms_px,
        residuals_px=np.where(fit.seen[..., None], fit.residuals_px, np.nan).transpose(1, 0, 2, 3),
        coverage=coverage, groups=groups, error_map=error_map(rig, covariance),
        square_error_pct=sizes.square_error_pct, board_error_pct=sizes.board_error_pct,
        epipolar_rms_px=float(np.sqrt(np.nanmean(epipolar**2))) if np.isfinite(epipolar).any() else np.nan,
        worst_pair=used.names[worst], worst_pair_px=float(epipolar[worst]),
        folds=tuple(f"the {side} lens {fold}" for side, fold in folds), warnings=(), verdict="", reasons=(),
    )  # fmt: skip
    findings = [*_set_findings(found, pairs.moved, ruler_mm), *_board_findings(used, fit), *_rig_findings(found)]
    findings += [(sum(fold.share > limit for limit in _FOLDED), f"the {side} lens {fold}") for side, fold in folds]
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
        findings.append((2, f"the board is measured wrong: the baseline comes out {found.rig.baseline_mm:.1f} mm, the "
                            f"ruler says {ruler_mm:.1f} mm, so the squares would be {square:.2f} mm and not "
                            f"{found.views.board.square_mm:g} mm"))  # fmt: skip
    if len(found.views) < _FEW_PAIRS:
        findings.append((1, f"{len(found.views)} pairs are few: {_FEW_PAIRS} or more make the result trustworthy"))
    findings += [(1, text) for text in found.coverage.missing]
    if found.coverage.image < _LITTLE_IMAGE:
        findings.append((1, f"the boards cover only {100 * found.coverage.image:.0f} % of the images"))
    return findings


def _board_findings(used: BoardViews, fit: Fit) -> list[Finding]:
    """Whether the board's squares are as high as wide.

    The residuals of a second fit, with squares 1 % higher, give the height that fits best: a secant step of
    Gauss-Newton in which all other parameters follow.
    """
    board = used.board
    if not isinstance(board, Checkerboard):
        return []
    stretched = replace(used, board=replace(board, aspect=board.aspect + 0.01))
    before = fit.residuals_px
    change = np.where(fit.seen[..., None], fit_again(stretched, fit.rig).residuals_px - before, 0.0)
    gain = float((before * change).sum()) ** 2 / max(float((change**2).sum()), 1e-30)
    stretch = -0.01 * float((before * change).sum()) / max(float((change**2).sum()), 1e-30)
    if abs(stretch) < _STRETCH or gain < 0.1 * float((before**2).sum()):
        return []
    off, than = 100 * stretch / board.aspect, "they are wide" if board.aspect == 1 else "given"
    return [(1, f"the board's squares come out {abs(off):.1f} % {'higher' if off > 0 else 'lower'} than {than}: "
                f"measure both sides and give the board's aspect ({board.aspect + stretch:.4f})")]  # fmt: skip


def _rig_findings(found: Diagnosis) -> list[Finding]:
    """What is wrong with the calibration itself."""
    findings: list[Finding] = []
    limits = (
        ("the corners fit to {:.2f} px rms only", found.rms_px, _RMS_PX),
        ("rows differ by {:.2f} px rms after rectification", found.epipolar_rms_px, _EPIPOLAR_PX),
        ("squares of boards left out are wrong by {:.2f} %", found.square_error_pct, _SIZE_PCT),
        ("the focal length is sure to {:.2f} % only", _focal_pct(found), _FOCAL_PCT),
        ("depths at 0.7 m are sure to {:.1f} mm only", float(np.nanmedian(found.error_map.depth_mm)), _DEPTH_MM),
    )
    for text, value, (usable, bad) in limits:
        if not value <= usable:
            findings.append((2 if not value <= bad else 1, text.format(value)))
    return findings


def _focal_pct(found: Diagnosis) -> float:
    cameras = (found.rig.left, found.std.left_K), (found.rig.right, found.std.right_K)
    return 100 * float(max((std[:2] / np.diag(camera.K)[:2]).max() for camera, std in cameras))


def _epipolar(rig: StereoRig, views: BoardViews) -> Array:
    """Row error of each pair after rectification, px rms (n,); NaN for a rig that cannot be rectified."""
    try:
        errors = epipolar_errors_px(rig.rectify(), views)
    except ValueError:
        return np.full(len(views), np.nan)
    return np.sqrt(np.nanmean(errors**2, axis=1))
