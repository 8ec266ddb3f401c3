"""Cameras that were turned sideways since their calibration, as rows of a pair tell; and the rig as it stands now."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from stereolib.base import UInt8
from stereolib.calibration import DisparityErrors
from stereolib.matching import Keystone, RowOffset, find_rows
from stereolib.measurement.instrument import Instrument, Turn
from stereolib.measurement.views import Views
from stereolib.rig import RectifiedRig

_TURNED_RAD = np.radians(0.5)  # standard deviation of a turn, where there is one
_CHANCE = 0.02  # that there is one, before anything was seen
_ROUNDS = 3  # in which a large turn is told from ever straighter rows
_LEAST_PX = 0.05  # of disparity: no turn is known better, and by less nothing is rectified anew
_LEAST_DISPARITY_PX = 1.0  # of what is asked for errors of the calibration
_MOST_EXPONENT = 500.0  # beyond which a turn is certain
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
    """Turn the cameras of a rig back as far as the rows of a pair tell.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        As the cameras gave them.
    instrument : Instrument
        As it was calibrated.

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
    """What is seen by a rig as it stands, and that rig."""
    seen, now, offset_px, errors = see(instrument.rectified), instrument, 0.0, instrument.uncertainty.errors
    for _ in range(_ROUNDS):
        keystone = rows(seen).keystone
        if errors is None or keystone is None:
            break
        turn = _likely(keystone, offset_px, errors)
        if abs(turn.offset_px - offset_px) < _LEAST_PX:
            return seen, replace(now, turn=turn)
        offset_px, now = turn.offset_px, instrument.turned(turn)
        seen = see(now.rectified)
    return seen, now


def _likely(keystone: Keystone, corrected_px: float, errors: DisparityErrors) -> Turn:
    """Mean and deviation of a turn, where the rows make it likelier than it was before; else there is none.

    Of the offset k that they tell, with a variance s of the pictures' scatter and the calibration's errors, and of a
    turn of variance t, if there is one: what they say multiplies its odds by
    ``sqrt(s / (s + t)) exp(k^2 t / (2 s (s + t)))``.
    """
    f_px = errors.rectified.f_px
    disparity = np.maximum(keystone.left_u_px - keystone.right_px[:, 0], _LEAST_DISPARITY_PX)
    by_rig = keystone.gain @ errors.of_rows(keystone.left_u_px, keystone.right_px[:, 1], disparity)
    k = f_px**2 * keystone.per_px + corrected_px
    s = f_px**4 * (keystone.std_per_px**2 + by_rig @ by_rig) + _LEAST_PX**2
    t = (f_px * _TURNED_RAD) ** 2
    least, share, spread = np.sqrt(s / (s + t)) * _CHANCE / (1 - _CHANCE), t / (s + t), s * (s + t) / t
    odds = least * np.exp(min(k**2 / (2 * spread), _MOST_EXPONENT))
    told = max(float(odds / (1 + odds)) - _CHANCE, 0.0) / (1 - _CHANCE)
    variance = told * share * s + told * (1 - told) * (share * k) ** 2
    seen_px = np.sqrt(-2 * spread * np.log(least))
    return Turn(float(told * share * k), float(np.sqrt(variance)), told, float(seen_px))
