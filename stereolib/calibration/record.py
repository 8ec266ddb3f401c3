"""What a calibration keeps of itself so that it can be checked later: how sure it is, and which boards made it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from stereolib.base import Bools, Float64, finite_array
from stereolib.calibration.board_views import BoardViews
from stereolib.calibration.bundle_adjustment import RigFit, inverse_normal
from stereolib.calibration.uncertainty import rig_covariance
from stereolib.rig import StereoRig, calibration_notes

#: Two views whose outer corners stand so near to each other are one picture, perhaps stored again: a camera that takes
#: the same board twice differs by its noise in some of the eight numbers.
_SAME_PX = 0.02
_DECIMALS = 3  # px: far finer than that
_MOST = 1e12  # of any number that is kept: a larger one is damage, and products overflow
_POSE = slice(-6, None)  # R and T among the shared parameters
_SIDES = ("left", "right")
_ROUNDING = 1e-6  # of a correlation


def damage(error: Exception) -> str:
    """Tell what is wrong with what a file holds, in words that name its entries and nothing of Python.

    Parameters
    ----------
    error : Exception
        What came of using it.

    Returns
    -------
    str

    Examples
    --------
    >>> damage(KeyError("covariance")), damage(TypeError("'int' object is not subscriptable"))
    ("it has no 'covariance'", 'an entry is of another kind')
    """
    if isinstance(error, KeyError):
        return f"it has no {error}"
    return str(error) if isinstance(error, ValueError) else "an entry is of another kind"


@dataclass(frozen=True, eq=False)
class CalibrationRecord:
    """How sure a calibration is, and which boards made it.

    Attributes
    ----------
    covariance : (s, s) float64
        Of the rig's parameters, in the order of `rig_parameter_names`; zeros where nothing is stated.
    sigma_px : float
        Standard deviation of a corner's coordinate, 0 where it is not stated.
    scatter : float
        By how much pairs scatter more than their corners' noise explains, at least 1: boards that bend, hands that
        move between two shutters.
    outer_px : dict of str to (8,) list, or None
        Each pair's first and last corner in the left and in the right picture; None where it is not stated.
    whole : bool
        False where the covariance was put together from single deviations, without what goes together.
    """

    covariance: Float64
    sigma_px: float = 0.0
    scatter: float = 1.0
    outer_px: Mapping[str, list[float]] | None = None
    whole: bool = True

    @classmethod
    def of(cls, fit: RigFit, views: BoardViews) -> CalibrationRecord:
        """Record a calibration.

        Parameters
        ----------
        fit : RigFit
        views : BoardViews
            Those of the fit.

        Returns
        -------
        CalibrationRecord
        """
        outer = dict(zip(views.names, _outer_px(views).tolist(), strict=True))
        return cls(rig_covariance(fit), fit.sigma_px, pair_scatter(fit), outer)

    @classmethod
    def load(cls, path: str | PathLike[str], rig: StereoRig) -> CalibrationRecord:
        """Read the record from a rig file; files of other programs and of older versions hold less of it.

        Parameters
        ----------
        path : path
        rig : StereoRig
            The one in that file.

        Returns
        -------
        CalibrationRecord

        Raises
        ------
        ValueError
            If what the file says of its calibration is damaged.
        """
        count = 2 * (4 + rig.left.dist.size) + 6
        notes = calibration_notes(path)
        try:
            if "record" not in notes:
                return cls(_from_deviations(notes, count), whole=False)
            kept = notes["record"]
            outer = {
                str(name): finite_array(at, (8,), name, most=_MOST).tolist() for name, at in kept["outer_px"].items()
            }
            covariance = finite_array(kept["covariance"], (count, count), "covariance", most=_MOST)
            if not _is_covariance(covariance):
                raise ValueError("its covariance is none")
            numbers = finite_array([kept["sigma_px"], kept["scatter"]], (2,), "sigma_px and scatter", most=_MOST)
            return cls(covariance, float(numbers[0]), float(numbers[1]), outer)
        except (ValueError, LookupError, TypeError, AttributeError) as error:
            why = damage(error).partition(":")[0]  # no matrix
            raise ValueError(f"{path}: what it says of its calibration is damaged ({why}): calibrate again") from error

    def facts(self) -> dict[str, Any]:
        """Write the record as JSON has it; `load` reads it.

        Returns
        -------
        dict
        """
        facts = {"covariance": self.covariance, "sigma_px": self.sigma_px, "scatter": self.scatter}
        return facts | {"outer_px": self.outer_px}

    def made_from(self, views: BoardViews) -> tuple[str, ...]:
        """Name the pairs that the calibration was made from.

        Parameters
        ----------
        views : BoardViews

        Returns
        -------
        tuple of str
        """
        if not self.outer_px:
            return ()
        off = np.abs(_outer_px(views)[:, None] - np.array(list(self.outer_px.values()))).max(axis=2)
        return tuple(name for name, near in zip(views.names, off.min(axis=1) < _SAME_PX, strict=True) if near)


def pair_scatter(fit: RigFit) -> float:
    """Tell by how much pairs disagree about R and T, over what the noise of their corners explains.

    Parameters
    ----------
    fit : RigFit
        At its optimum.

    Returns
    -------
    float
        At least 1.

    Notes
    -----
    A pair's gradient ``g_k`` at the optimum has the covariance ``sigma^2 (N_k - N_k N^-1 N_k)`` if corners err each on
    its own; the rms of what it comes to in these units, over R and T, is 1 then.
    """
    inverse = inverse_normal(fit.normal.sum(axis=0))
    squares = []
    for normal, gradient in zip(fit.normal, fit.gradient[:, _POSE], strict=True):
        own = (normal - normal @ inverse @ normal)[_POSE, _POSE]
        squares.append(gradient @ inverse_normal(own) @ gradient / len(gradient))
    return max(1.0, float(np.sqrt(np.mean(squares))) / max(fit.sigma_px, 1e-9))


def _outer_px(views: BoardViews) -> Float64:
    """The first and the last known corner of both views of each pair. (n, 8)."""
    outer = []
    for pair in np.stack([views.left_px, views.right_px], 1).astype(float):
        known: list[Bools] = [np.isfinite(corners).all(axis=1) for corners in pair]
        outer.append(np.concatenate([corners[at][[0, -1]].ravel() for corners, at in zip(pair, known, strict=True)]))
    return np.round(outer, _DECIMALS)


def _is_covariance(matrix: Float64) -> bool:
    """It is symmetric, and no combination of parameters has a negative variance."""
    std = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    scaled = matrix / np.outer(*[np.where(std > 0, std, 1.0)] * 2)
    return bool(np.allclose(scaled, scaled.T) and np.linalg.eigvalsh((scaled + scaled.T) / 2)[0] > -_ROUNDING)


def _from_deviations(notes: Mapping[str, Any], count: int) -> Float64:
    """A covariance from the single deviations of older files; zeros where there are none."""
    if "std" not in notes:
        return np.zeros((count, count))
    std = notes["std"]
    lenses = [np.concatenate([std["K"][side], std["dist"][side]]) for side in _SIDES]
    std = finite_array(np.concatenate([*lenses, std["R_rad"], std["T"]]), (count,), "std", most=_MOST)
    return np.diag(std**2)
