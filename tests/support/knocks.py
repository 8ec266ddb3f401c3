"""Rigs that were calibrated and then knocked: what a check must find out."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from stereolib.calibration import BoardViews, CalibrationRecord, fit_rig
from stereolib.rig import Camera, StereoRig
from support.corners import corner_set


def calibrated(
    rig: StereoRig, rng: np.random.Generator, pairs: int = 30
) -> tuple[StereoRig, CalibrationRecord, BoardViews]:
    """Calibrate a rig on a virtual corner set.

    Parameters
    ----------
    rig : StereoRig
    rng : numpy.random.Generator
    pairs : int

    Returns
    -------
    rig : StereoRig
        As it was found.
    record : CalibrationRecord
    views : BoardViews
    """
    views = corner_set(rng, rig=rig, pairs=pairs)
    fit = fit_rig(views, rig)
    return fit.rig, CalibrationRecord.of(fit, views), views


def knocked(
    rig: StereoRig,
    turn_deg: Sequence[float] = (0, 0, 0),
    shift_mm: Sequence[float] = (0, 0, 0),
    left: float = 0.0,
    right: float = 0.0,
) -> StereoRig:
    """Knock a rig.

    Parameters
    ----------
    rig : StereoRig
    turn_deg, shift_mm : (x, y, z)
        Of points before the right camera, in its frame.
    left, right : float
        Shares by which focal lengths grow.

    Returns
    -------
    StereoRig
    """
    turn = cv2.Rodrigues(np.radians(np.array(turn_deg, float)))[0]
    lenses = _refocused(rig.left, left), _refocused(rig.right, right)
    return StereoRig(*lenses, turn @ rig.R, rig.T + np.array(shift_mm))


def _refocused(camera: Camera, share: float) -> Camera:
    K = camera.K.copy()
    K[[0, 1], [0, 1]] *= 1 + share
    return Camera(K, camera.dist, camera.size)
