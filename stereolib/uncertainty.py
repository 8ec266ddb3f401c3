"""How sure a calibration is: standard deviations of every parameter, and what they mean in millimetres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class RigStd:
    """Standard deviations (one sigma) of a rig's parameters.

    ``left_K``, ``right_K`` are (4,): fx fy cx cy, px; ``left_dist``, ``right_dist`` as the lens's coefficients;
    ``R_rad`` (3,) turns about the right camera's x, y and z; ``T_mm`` (3,); ``baseline_mm``.
    """

    left_K: Array
    left_dist: Array
    right_K: Array
    right_dist: Array
    R_rad: Array
    T_mm: Array
    baseline_mm: float


@dataclass(frozen=True, eq=False)
class ErrorMap:
    """One-sigma errors that a calibration's uncertainty causes at one depth, on a grid of left pixels.

    ``columns_px`` (w,), ``rows_px`` (h,); ``depth_mm`` and ``length_mm`` (h, w), the latter of a level length of
    ``of_mm`` held there. NaN where the right camera does not see the point.
    """

    columns_px: Array
    rows_px: Array
    depth_mm: Array
    length_mm: Array
    at_mm: float
    of_mm: float
