"""Cameras that were turned sideways since their calibration, as rows of a pair tell; and the rig as it stands now."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from stereolib.base import UInt8, clustered_covariance, median
from stereolib.calibration import DisparityErrors
from stereolib.matching import RowCells, RowOffset, find_rows
from stereolib.measurement.instrument import Instrument, Turn
from stereolib.measurement.views import Views
from stereolib.rig import RectifiedRig

_TURNED_RAD = np.radians(0.5)  # standard deviation of a turn, where there is one
_CHANCE, _DOUBTED = 0.02, 0.1  # that there is one, as `hypotheses` has it; up to which nothing is made of it
#: What else may have moved since the calibration, and lets rows disagree, too: standard deviations.
_RISEN, _ADVANCED = 0.03, 0.03  # of the right camera, in baselines
_TILTED_RAD, _REFOCUSED = np.radians(0.5), 0.01  # of it; of each lens's k1
_ROUNDS = 3  # in which a large turn is told from ever straighter rows, and of weights in each
_TUKEY, _LEAST_OFF_PX = 4.7 * 1.48, 0.01  # weights end at so many medians of what is left, as in `matching.rows`
_LEAST_PX = 0.05  # of disparity: no turn is known better, and by less nothing is rectified anew
_LEAST_DISPARITY_PX = 1.0  # of what is asked for errors of the calibration
_MOST_EXPONENT = 500.0  # beyond which a turn is certain
_SEEN_STDS = 2.0  # by which what is seen may be less than what there is
Seen = TypeVar("Seen")


def see_pair(left: UInt8, right: UInt8, instrument: Instrument) -> tuple[Views, Instrument]:
    """Prepare a pair for measuring, its cameras turned back as far as the rows tell.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        As the cameras gave them.
    instrument : Instrument
        As it was calibrated.

    Returns
    -------
    views : Views
    instrument : Instrument
        As it stands now.

    Raises
    ------
    ValueError
        As `Views.of` does.
    """
    return _settled(instrument, lambda rectified: Views.of(left, right, rectified), lambda views: views.rows)


def turned_back(left: UInt8, right: UInt8, instrument: Instrument) -> Instrument:
    """Turn the cameras of a rig back as far as the rows of a pair tell, which is not prepared for measuring.

    Parameters
    ----------
    left, right, instrument
        As for `see_pair`.

    Returns
    -------
    Instrument
        As it stands now.

    Raises
    ------
    ValueError
        If pictures and calibration do not fit together.

    Notes
    -----
    Errors of a calibration let rows drift apart likewise. Only where it tells how sure each parameter is, a turn is
    told from them; else the rig is taken as it was calibrated.
    """
    if instrument.uncertainty.errors is None:
        return instrument
    return _settled(instrument, lambda rectified: find_rows(*rectified.rectify(left, right))[0], lambda rows: rows)[1]


def _settled(
    instrument: Instrument, see: Callable[[RectifiedRig], Seen], rows: Callable[[Seen], RowOffset]
) -> tuple[Seen, Instrument]:
    """What is seen by a rig as it stands, and that rig; one that was turned back already stays as it is."""
    seen, now, offset_px, errors = see(instrument.rectified), instrument, 0.0, instrument.uncertainty.errors
    if errors is None or instrument.turn is not None:
        return seen, instrument
    told: Turn | None = None
    for _ in range(_ROUNDS):
        cells = rows(seen).cells
        try:
            if cells is None:
                break
            shown_px, std_px = _keystone(cells, errors)
        except np.linalg.LinAlgError:  # all that tells it stands in one place
            break
        told = _likely(shown_px + offset_px, std_px, instrument.rectified.f_px, told)
        if abs(told.offset_px - offset_px) < _LEAST_PX:
            return seen, replace(now, turn=told)
        offset_px, now = told.offset_px, instrument.turned(told)
        seen = see(now.rectified)
    return seen, now


def _keystone(cells: RowCells, errors: DisparityErrors) -> tuple[float, float]:
    """How far the cameras are turned, as a shift of all disparities in px, and its standard deviation.

    A right camera that was turned about its upright axis by w shifts what it sees by ``w f (1 + x^2, x y)`` at
    ``x = (u - cu) / f`` and ``y = (v - cv) / f``; half of it for each camera, nobody knowing which was turned. A plane
    is taken off. What else lets rows disagree is fitted with it, each within its deviation: a right camera that rose,
    advanced or was tilted, lenses of another k1. The calibration's own errors are not: no more is told of a turn than
    is left when they are taken as noise, since a lens model that fits badly makes them larger than anyone knows.
    """
    f_px, P = errors.rectified.f_px, errors.rectified.P1
    (u, v), in_left = cells.right_px.T, cells.left_u_px
    x, left_x, y = (u - P[0, 2]) / f_px, (in_left - P[0, 2]) / f_px, (v - P[1, 2]) / f_px
    d, middle = left_x - x, (x + left_x) / 2
    free = np.column_stack([x, y, np.ones_like(x), middle * y])
    lenses = [_REFOCUSED * y * (a**2 + y**2) for a in (x, left_x)]
    moved = f_px * np.column_stack([_RISEN * d, _ADVANCED * y * d, _TILTED_RAD * y**2, *lenses])
    every = np.hstack([free, moved])
    known = np.diag(np.repeat([0.0, 1.0], [free.shape[1], every.shape[1] - free.shape[1]]))
    rest = cells.offset_px - free @ np.linalg.lstsq(free, cells.offset_px, rcond=None)[0]
    for _ in range(_ROUNDS):
        off = (rest / max(_TUKEY * median(np.abs(rest)), _LEAST_OFF_PX)) ** 2
        root = np.maximum(1 - off, 0)
        weight, bend = root**2 * cells.weight, root * (1 - 5 * off) * cells.weight
        scatter = clustered_covariance(free, rest, weight, cells.block, bend)[3, 3]
        weight = weight * np.linalg.inv((free.T * weight) @ free)[3, 3] / scatter  # now of variances
        covariance = np.linalg.inv((every.T * weight) @ every + known)
        gain = covariance @ (every.T * weight)
        rest = cells.offset_px - every @ (gain @ cells.offset_px)
    by_rig = gain[3] @ errors.of_rows(in_left, v, np.maximum(in_left - u, _LEAST_DISPARITY_PX))
    return float(gain[3] @ cells.offset_px), float(np.sqrt(covariance[3, 3] + by_rig @ by_rig))


def _likely(k: float, std_px: float, f_px: float, before: Turn | None = None) -> Turn:
    """Mean and deviation of a turn, as far as the rows make it likelier than one in ten; else there is none.

    Of the offset k that they tell, of variance s, and a turn of variance t, if there is one: what they say multiplies
    its odds by ``sqrt(s / (s + t)) exp(k^2 t / (2 s (s + t)))``. Straightened by what was found before, they tell how
    far, but no longer whether: else a little more of a turn would lead to all of it.
    """
    s, t = std_px**2 + _LEAST_PX**2, (f_px * _TURNED_RAD) ** 2
    share = t / (s + t)
    if before is None:
        least, spread = np.sqrt(s / (s + t)) * _CHANCE / (1 - _CHANCE), s / share
        odds = least * np.exp(min(k**2 / (2 * spread), _MOST_EXPONENT))
        chance = max(float(odds / (1 + odds)) - _DOUBTED, 0.0) / (1 - _DOUBTED)
        seen_px = float(np.sqrt(-2 * spread * np.log(least)) + _SEEN_STDS * np.sqrt(s))
    else:
        chance, seen_px = before.chance, before.seen_px
    variance = chance * share * s + chance * (1 - chance) * (share * k) ** 2
    return Turn(chance * share * k, float(np.sqrt(variance)), chance, seen_px)
