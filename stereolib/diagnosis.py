"""Is this calibration good? Faults of the board pairs by name, and a verdict in metric units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolib.coverage import Coverage
from stereolib.rig import StereoRig
from stereolib.targets import BoardViews
from stereolib.uncertainty import ErrorMap, RigStd

Array = np.ndarray


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
    square_error_pct : rms over pairs of the squares' mean size against the true one, each pair left out of its rig
    board_error_pct : the same of the board's longer edge
    epipolar_rms_px, worst_pair, worst_pair_px : row errors after rectification, and the pair with the largest rms
    folds : what `calibration.folds_inside` says, of either camera; empty for a sound lens
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
    raise NotImplementedError
