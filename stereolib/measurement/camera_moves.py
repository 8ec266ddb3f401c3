"""Cameras that moved since their calibration, as rows of a pair tell; and the rig as it stands now."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from stereolib.base import Float64, Ints, UInt8, clustered_covariance, median
from stereolib.calibration import DisparityErrors
from stereolib.matching import RowCells, RowOffset, find_rows
from stereolib.measurement.instrument import CameraMoves, Instrument
from stereolib.measurement.views import Views
from stereolib.rig import RectifiedRig

#: What is corrected: a turn sideways, and a right camera that rose, in baselines; standard deviations, where it is so.
_TURNED_RAD, _RISEN = np.radians(0.5), 0.03
_CHANCE, _DOUBTED = 0.02, 0.1  # that it is so, as `hypotheses` has it; up to which nothing is made of it
#: What else may have moved since the calibration, and lets rows disagree, too: standard deviations.
_ADVANCED, _TILTED_RAD, _REFOCUSED = 0.03, np.radians(0.5), 0.01  # the right camera; of each lens's k1
_NEAREST = 5.0  # baselines: a rise is told in rows by which it shifts what stands there
_ROUNDS = 3  # in which a large move is told from ever straighter rows, and of weights in each
_TUKEY, _LEAST_OFF_PX = 4.7 * 1.48, 0.01  # weights end at so many medians of what is left, as in `matching.rows`
_LEAST_PX = 0.05  # no move is known better, and by less nothing is rectified anew
_LEAST_SHARE = 1e-6  # by which rows tell more than is known without them
_LEAST_DISPARITY_PX = 1.0  # of what is asked for errors of the calibration
_MOST_EXPONENT = 500.0  # beyond which a move is certain
_SEEN_STDS = 2.0  # by which what is seen may be less than what there is
Seen = TypeVar("Seen")


def see_pair(left: UInt8, right: UInt8, instrument: Instrument) -> tuple[Views, Instrument]:
    """Prepare a pair for measuring, its cameras moved back as far as the rows tell.

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


def moved_back(left: UInt8, right: UInt8, instrument: Instrument) -> Instrument:
    """Move the cameras of a rig back as far as the rows of a pair tell, which is not prepared for measuring.

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
    Errors of a calibration let rows drift apart likewise. Only where it tells how sure each parameter is, a move is
    told from them; else the rig is taken as it was calibrated.
    """
    if instrument.uncertainty.errors is None:
        return instrument
    return _settled(instrument, lambda rectified: find_rows(*rectified.rectify(left, right))[0], lambda rows: rows)[1]


def _settled(
    instrument: Instrument, see: Callable[[RectifiedRig], Seen], rows: Callable[[Seen], RowOffset]
) -> tuple[Seen, Instrument]:
    """What is seen by a rig as it stands, and that rig; one whose cameras were moved back already stays as it is."""
    seen, now, errors = see(instrument.rectified), instrument, instrument.uncertainty.errors
    if errors is None or instrument.moves is not None:
        return seen, instrument
    f_px, baseline_mm = instrument.rectified.f_px, instrument.rectified.baseline_mm
    told_px, chance = np.zeros(2), None
    for _ in range(_ROUNDS):
        cells, before_px = rows(seen).cells, told_px
        try:
            if cells is None:
                break
            found = _keystone(cells, errors, before_px)
        except np.linalg.LinAlgError:  # all that tells it stands in one place
            break
        told_px, std_px, chance, shows_px = _likely(*found, f_px, chance)
        turn = [each[0] for each in (told_px, std_px, chance, shows_px)]
        rise_mm = [each[1] * _NEAREST * baseline_mm / f_px for each in (told_px, std_px)]
        moves = CameraMoves(*map(float, (*turn, *rise_mm)))
        if (np.abs(told_px - before_px) < _LEAST_PX).all():
            return seen, replace(now, moves=moves)
        now = instrument.moved_back(moves)
        seen = see(now.rectified)
    return seen, now


def _keystone(cells: RowCells, errors: DisparityErrors, before_px: Float64) -> tuple[Float64, Float64]:
    """How far the cameras turned and the right one rose, (2,), and the variances of that.

    The turn is told as a shift of all disparities in px, the rise as one of the rows of what is nearest. A right camera
    that was turned about its upright axis by w shifts what it sees by ``w f (1 + x^2, x y)`` at ``x = (u - cu) / f``
    and ``y = (v - cv) / f``; half of it for each camera, nobody knowing which was turned. One that rose by r baselines
    sees everything lower, by ``r`` of its disparity. A plane is taken off. What else lets rows disagree is fitted with
    it, each within its deviation: a right camera that advanced or was tilted, lenses of another k1. The calibration's
    own errors are not: no more is told of a move than is left when they are taken as noise, since a lens model that
    fits badly makes them larger than anyone knows.
    """
    f_px, P = errors.rectified.f_px, errors.rectified.P1
    (u, v), in_left = cells.right_px.T, cells.left_u_px
    x, left_x, y = (u - P[0, 2]) / f_px, (in_left - P[0, 2]) / f_px, (v - P[1, 2]) / f_px
    d, middle = left_x - x, (x + left_x) / 2
    moved = np.column_stack([middle * y, _NEAREST * d])
    lenses = [_REFOCUSED * y * (a**2 + y**2) for a in (x, left_x)]
    besides = f_px * np.column_stack([_ADVANCED * y * d, _TILTED_RAD * y**2, *lenses])
    every = np.column_stack([x, y, np.ones_like(x), moved, besides])
    prior = _prior_px(f_px) ** 2
    known = np.diag(np.r_[np.zeros(3), 1 / prior, np.ones(besides.shape[1])])
    offset_px = cells.offset_px + moved @ before_px
    # Few columns at first keep errors of rows from passing for a turn, but leave out what a rise alone explains.
    as_if_turned, as_it_is = (_fit(every, known, offset_px, cells, first) for first in (every[:, :4], every))
    gain = np.stack([as_if_turned[0][3], as_it_is[0][4]])
    variance, rougher = np.array([as_if_turned[1][3], as_it_is[1][4]]), np.array([1.0, max(as_it_is[2], 1.0)])
    by_rig = gain @ errors.of_rows(in_left, v, np.maximum(in_left - u, _LEAST_DISPARITY_PX))
    told = np.maximum(1 - variance / prior, _LEAST_SHARE)  # by the rows alone: without what is known before
    return gain @ offset_px / told, rougher * variance / told + (by_rig**2).sum(axis=1) / told**2


def _fit(
    every: Float64, known: Float64, offset_px: Float64, cells: RowCells, first: Float64
) -> tuple[Float64, Float64, float]:
    """What turns offsets into coefficients, (k, N); their variances; how much more errors clump as a rise than a turn.

    Tukey's weights begin with what these columns `first` leave.
    """
    rest = offset_px - first @ np.linalg.lstsq(first, offset_px, rcond=None)[0]
    for _ in range(_ROUNDS):
        off = (rest / max(_TUKEY * median(np.abs(rest)), _LEAST_OFF_PX)) ** 2
        root = np.maximum(1 - off, 0)
        weight, bend = root**2 * cells.weight, root * (1 - 5 * off) * cells.weight
        turned, risen = (_scatter(every[:, :k], rest, weight, cells.block, bend) for k in (4, 5))
        weight = weight / turned  # now of variances
        covariance = np.linalg.inv((every.T * weight) @ every + known)
        gain = covariance @ (every.T * weight)
        rest = offset_px - every @ (gain @ offset_px)
    return gain, np.diag(covariance), risen / turned


def _scatter(x: Float64, rest: Float64, weight: Float64, block: Ints, bend: Float64) -> float:
    """Variance of the last coefficient of a fit as blocks of errors tell it, over that by its weights alone."""
    by_blocks = clustered_covariance(x, rest, weight, block, bend)[-1, -1]
    return float(by_blocks / np.linalg.inv((x.T * weight) @ x)[-1, -1])


def _prior_px(f_px: float) -> Float64:
    """Standard deviations of a turn and of a rise, where there is one, as `_keystone` tells them. (2,)."""
    return f_px * np.array([_TURNED_RAD, _RISEN / _NEAREST])


def _likely(
    k: Float64, variance: Float64, f_px: float, chance: Float64 | None = None
) -> tuple[Float64, Float64, Float64, Float64]:
    """Means and deviations of moves, as far as the rows make them likelier than one in ten; else there is none.

    Of a move k that they tell, of variance s, and one of variance t, if there is one: what they say multiplies
    its odds by ``sqrt(s / (s + t)) exp(k^2 t / (2 s (s + t)))``. Straightened by what was found before, they tell how
    far, but no longer whether: else a little more of a turn would lead to all of it. Last, what shows.
    """
    s, t = variance + _LEAST_PX**2, _prior_px(f_px) ** 2
    share = t / (s + t)
    least, spread = np.sqrt(s / (s + t)) * _CHANCE / (1 - _CHANCE), s / share
    if chance is None:
        odds = least * np.exp(np.minimum(k**2 / (2 * spread), _MOST_EXPONENT))
        chance = np.maximum(odds / (1 + odds) - _DOUBTED, 0.0) / (1 - _DOUBTED)
    shows = np.sqrt(-2 * spread * np.log(least)) + _SEEN_STDS * np.sqrt(s)
    std = np.sqrt(chance * share * s + chance * (1 - chance) * (share * k) ** 2)
    return chance * share * k, std, chance, shows
