"""Is this calibration good? Faults of the board pairs by name, and a verdict in metric units."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stereolib.base import Float64
from stereolib.calibration.board_size import left_out_size_errors
from stereolib.calibration.board_views import BoardViews
from stereolib.calibration.bundle_adjustment import RigFit
from stereolib.calibration.coverage import Coverage, judge_coverage
from stereolib.calibration.findings import FEW_PAIRS, Check, folds_of, judged
from stereolib.calibration.lens_choice import (
    HoldOut,
    choose_lens_model,
    left_out_errors,
    lens_errors_mm,
    neighbour_fits,
)
from stereolib.calibration.misfits import by_reason
from stereolib.calibration.outliers import sort_pairs
from stereolib.calibration.rectified_errors import rectified_std
from stereolib.calibration.solve import epipolar_errors_px, rectified_scale
from stereolib.calibration.uncertainty import (
    JUDGED_AT_MM,
    ErrorMap,
    RigStd,
    check_distance,
    error_map,
    rig_covariance,
    rig_std,
)
from stereolib.calibration.wrong_corners import CornerOff, corners_off
from stereolib.rig import StereoRig

_LENGTH_MM, _LENGTH_SHARE = 100.0, 0.1  # the length whose error is told; nearer, that share of the distance


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
    unrectified : str
        Why the rig cannot be rectified; empty if it can.
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
    unrectified: str
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
    views: BoardViews, *, model: str = "brown3", ruler_mm: float | None = None, at_mm: float = JUDGED_AT_MM
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
        Fewer than 5 usable pairs, all views alike, left and right exchanged, pairs that do not belong together, or a
        distance or a ruler's reading that is none in mm.

    Notes
    -----
    The verdict follows the error of depth and of length, one standard deviation, and what makes this untrue: a lens
    model too short (what it makes wrong is added), boards left out whose size comes out wrong, a ruler that
    contradicts, squares not as high as wide, a rig that moved, one that cannot be rectified or sees nothing there, a
    lens that folds where boards were seen. All else is advice.
    """
    check_distance(at_mm)
    if ruler_mm is not None and not (np.isfinite(ruler_mm) and ruler_mm > 0):
        raise ValueError(f"the ruler's reading must be a positive number of mm, got {ruler_mm}")
    pairs = sort_pairs(views, model)
    used = pairs.views.only(pairs.groups[0])
    fit, rig = pairs.calibration.fit, pairs.calibration.rig
    covariance = rig_covariance(fit)
    sizes = left_out_size_errors(used, fit)
    rows, scale, unrectified = _rectified(rig, used)
    worst = int(np.nanargmax(rows)) if np.isfinite(rows).any() else int(fit.pair_rms_px.max(axis=1).argmax())
    fits = neighbour_fits(used, fit, model) if len(used) >= FEW_PAIRS else {}
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
        unrectified=unrectified,
        square_error_pct=sizes.square_error_pct,
        board_error_pct=sizes.board_error_pct,
        epipolar_rms_px=float(np.sqrt(np.nanmean(rows**2))) if np.isfinite(rows).any() else np.nan,
        worst_pair=used.names[worst],
        worst_pair_px=float(rows[worst]),
        folds=tuple(f"the {side} lens {fold}" for side, fold in folds_of(rig)),
        lenses=lenses,
        fit=fit,
        wrong_corners=tuple(corner for corner in pairs.wrong_corners if corner.pair in used.names),
    )
    return judged(diagnosis, pairs.moved_by, ruler_mm)


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


def _rectified(rig: StereoRig, views: BoardViews) -> tuple[Float64, tuple[float, float], str]:
    """Row error of each pair after rectification, px rms (n,), its `rectified_scale`, and why there is none."""
    try:
        rectified = rig.rectify()
    except ValueError as error:
        return np.full(len(views), np.nan), (np.nan, np.nan), str(error)
    rows = epipolar_errors_px(rectified, views)
    return np.asarray(np.sqrt(np.nanmean(rows**2, axis=1))), rectified_scale(rectified), ""


def _rectified_std(rig: StereoRig, covariance: Float64) -> dict[str, Any]:
    with suppress(ValueError):  # the cameras see nothing together there
        return rectified_std(rig.rectify(), covariance)
    return {}


def _median(values: Float64) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else float("nan")
