"""What notebook 05 holds against the paper's section on the laser."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from stereolib.base import Bools, Float64
from stereolib.laser import ErrorCurve, LaserScan, error_curve, find_segments, fit_footprint

#: Powers of the distance with which the steps of a reading may grow: 0 is a clock's, 2 a spot's on a chip.
STEP_POWERS = tuple(np.arange(0, 4.01, 0.25).tolist())
_STEPS_MM = (1.2, 4.0)  # looked for, at the nearest reading: nearer to one millimetre the packet's own would be found
_OVERSAMPLING = 4  # steps tried, for one that could be told apart from the next
_CHANCE = 1e-3  # of as good a pattern among readings without one
_LEAST_READINGS = 30  # of which a mean error is told
_LEAST_VARIANCE_MM2 = 1e-9  # what rounding may leave of nothing
_LIGHT_MM_PER_PS = 0.299792458
_MM_PER_CM = 10.0


@dataclass(frozen=True, eq=False)
class StepPattern:
    """In which steps a sensor counts, as its readings show.

    Attributes
    ----------
    powers : (p,) float64
        Of the distance, with which the step is taken to grow.
    scores : (p,) float64
        The best step's score for each: about 1 to 10 where there is no such pattern.
    power : float
        The one with the best score.
    chance : float
        At most so likely is as good a score among readings without any pattern.
    steps_mm : (p,) float64
        The best step for each power, at `at_mm`.
    at_mm : float
        The nearest reading.
    """

    powers: Float64
    scores: Float64
    power: float
    chance: float
    steps_mm: Float64
    at_mm: float

    def step_mm(self, distance_mm: float) -> float:
        """Tell the step at a distance.

        Parameters
        ----------
        distance_mm : float

        Returns
        -------
        float, mm
            ``step(at) (distance / at)^power``.
        """
        best = float(self.steps_mm[np.argmax(self.scores)])
        return best * float((distance_mm / self.at_mm) ** self.power)


def find_step_pattern(readings_mm: ArrayLike, powers: Sequence[float] = STEP_POWERS) -> StepPattern:
    """Find the steps in which a sensor counts before it rounds to millimetres.

    Parameters
    ----------
    readings_mm : array_like, mm
        Far enough that a step is wider than the packet's millimetre.
    powers : sequence of float
        That are tried.

    Returns
    -------
    StepPattern

    Raises
    ------
    ValueError
        If there are fewer than 50 readings.

    Notes
    -----
    A sensor whose step is ``q r^p`` counts evenly in ``x``, with ``dx = dr / (r / at)^p``: a clock (p = 0) in r, the
    place of a spot on a chip, ``s = f b / r`` (p = 2), in 1 / r. For every p the readings' x are searched for a period:
    ``score = |sum exp(2 pi i x / q)|^2 / n``, over all q from 1.2 to 4 mm: one of 1 mm, the packet's own, would always
    fit, with p = 0. Of readings without the period q the score exceeds s with the probability ``exp(-s)``.

    Examples
    --------
    >>> r = np.random.default_rng(0).uniform(2600, 3300, 300)
    >>> pattern = find_step_pattern(np.rint(1 / (np.rint(1 / (2e-7 * r)) * 2e-7)))
    >>> pattern.power, round(pattern.step_mm(3000), 2)
    (2.0, 1.8)
    """
    r = np.asarray(readings_mm, np.float64).ravel()
    r = r[np.isfinite(r)]
    if len(r) < 50:
        raise ValueError(f"a pattern of steps needs 50 readings and more, got {len(r)}")
    at = float(r.min())
    scores, steps, tried = [], [], 0
    for power in powers:
        x = at * (np.log(r / at) if power == 1 else (r / at) ** (1 - power) / (1 - power))
        spacing = 1 / (_OVERSAMPLING * max(np.ptp(x), _STEPS_MM[1]))
        rates = np.arange(1 / _STEPS_MM[1], 1 / _STEPS_MM[0], spacing)
        score = np.abs(np.exp(2j * np.pi * rates[:, None] * x).sum(axis=1)) ** 2 / len(x)
        scores.append(float(score.max()))
        steps.append(float(1 / rates[score.argmax()]))
        tried += len(rates)
    best = int(np.argmax(scores))
    chance = min(1.0, tried * float(np.exp(-scores[best])))
    return StepPattern(np.array(powers), np.array(scores), float(powers[best]), chance, np.array(steps), at)


def steps_of_a_clock(pattern: StepPattern) -> dict[str, float]:
    """Whether the steps could be a clock's.

    Parameters
    ----------
    pattern : StepPattern

    Returns
    -------
    dict
        ``power`` of the distance with which the steps grow: 0 for a clock.

    Raises
    ------
    ValueError
        If the readings show no steps: then they cannot decide.
    """
    if pattern.chance > _CHANCE:
        raise ValueError(f"these readings show no steps: as good a pattern comes by chance in {pattern.chance:.0%}")
    return {"power": pattern.power}


def flight_time_ps(distance_mm: float) -> float:
    """Time that light needs for a distance, there and back.

    Parameters
    ----------
    distance_mm : float

    Returns
    -------
    float, ps

    Examples
    --------
    >>> round(flight_time_ps(1.0), 1)
    6.7
    """
    return 2 * distance_mm / _LIGHT_MM_PER_PS


def noise_of_median(turns_mm: ArrayLike, n: int) -> float:
    """How much the median of n turns scatters, from more than n turns of a scene in which nothing moves.

    Parameters
    ----------
    turns_mm : (turns, beams) array_like, mm
    n : int
        Turns combined, fewer than there are.

    Returns
    -------
    float, mm
        Root mean square over the beams; NaN where it is too small to be told, the estimate of its square not positive.

    Raises
    ------
    ValueError
        If not at least one turn is left over.

    Notes
    -----
    The truth is not known. So the median of n turns is held against the mean of the others, for every choice of n:
    ``var(median) = mean (median - mean of the others)^2 - s^2 / (N - n)``, with ``s`` the beam's own deviation. With
    n = 1 this is s itself.

    Examples
    --------
    >>> turns = np.random.default_rng(0).normal(1000, 8, (7, 2000))
    >>> round(noise_of_median(turns, 1)), round(noise_of_median(turns, 5), 1)
    (8, 4.3)
    """
    turns = np.asarray(turns_mm, np.float64)
    total = len(turns)
    if not 1 <= n < total:
        raise ValueError(f"of {total} turns, 1 to {total - 1} can be combined, not {n}")
    squares = []
    for chosen in combinations(range(total), n):
        others = np.delete(turns, chosen, axis=0)
        squares.append((np.median(turns[list(chosen)], axis=0) - others.mean(axis=0)) ** 2)
    variance = np.mean(squares) - turns.var(axis=0, ddof=1).mean() / (total - n)
    return float(np.sqrt(variance)) if variance > _LEAST_VARIANCE_MM2 else np.nan


def repeatability(far_mm: ArrayLike, pattern: StepPattern) -> dict[str, float]:
    """How far a real sensor keeps its millimetre just below 3 m.

    Parameters
    ----------
    far_mm : (turns, beams) array_like, mm
    pattern : StepPattern
        Of the far readings.

    Returns
    -------
    dict
        ``far_mm``: how much one reading scatters; ``step_mm`` at 3 m.
    """
    return {"far_mm": noise_of_median(far_mm, 1), "step_mm": pattern.step_mm(3000.0)}


def relative_error(far_mm: ArrayLike, true_mm: ArrayLike | None = None) -> dict[str, float]:
    """Scatter of a single reading, and what all turns are off together, in per cent of the distance.

    Parameters
    ----------
    far_mm : (turns, beams) array_like, mm
    true_mm : float or (beams,) array_like, mm, optional
        True distances, where they are known.

    Returns
    -------
    dict
        ``spread_pct``; ``bias_pct``, the mean over turns and beams without its sign, NaN if the truth is not known.

    Examples
    --------
    >>> relative_error([[1001, 1003], [1003, 1001]], 1000.0)["bias_pct"]
    0.2
    """
    turns = np.asarray(far_mm, np.float64)
    bias = np.nan if true_mm is None else float(np.mean(turns / np.asarray(true_mm, np.float64)) - 1)
    spread = noise_of_median(turns, 1) / float(np.median(turns))
    return {"spread_pct": 100 * spread, "bias_pct": round(100 * abs(bias), 9)}


def averaging_gain(far_mm: ArrayLike, n: int = 5) -> dict[str, float]:
    """What is left of a real sensor's noise in the median of n turns.

    Parameters
    ----------
    far_mm : (turns, beams) array_like, mm
    n : int

    Returns
    -------
    dict
        ``noise_times``
    """
    return {"noise_times": noise_of_median(far_mm, n) / noise_of_median(far_mm, 1)}


def noise_within(within_mm: ArrayLike, beyond_mm: ArrayLike) -> dict[str, float]:
    """How much one turn of a real sensor scatters within a range, over what it does beyond it.

    Parameters
    ----------
    within_mm, beyond_mm : (turns, beams) array_like, mm

    Returns
    -------
    dict
        ``noise_times``
    """
    return {"noise_times": noise_of_median(within_mm, 1) / noise_of_median(beyond_mm, 1)}


def averaging_of_reflectivity(true_mm: ArrayLike, readings_mm: Sequence[Float64], n: int = 5) -> dict[str, float]:
    """What the median of n readings leaves of the errors that a surface makes.

    Parameters
    ----------
    true_mm : (k,) array_like
        Known distances, mm.
    readings_mm : sequence of k arrays
        Readings at each, mm, NaN where none came back; combined n by n in their order.
    n : int

    Returns
    -------
    dict
        ``bias_times``: bias (rms over the distances) of the medians over that of single readings; ``lost_times``: the
        same of the share that is lost.
    """
    one = error_curve(true_mm, readings_mm)
    many = error_curve(true_mm, [_medians(np.asarray(r, np.float64), n) for r in readings_mm])
    kept = (one.n >= _LEAST_READINGS) & (many.n >= _LEAST_READINGS)
    bias = np.sqrt(np.mean(many.bias_mm[kept] ** 2) / np.mean(one.bias_mm[kept] ** 2))
    return {"bias_times": float(bias), "lost_times": float(many.dropout.sum() / one.dropout.sum())}


def _medians(readings_mm: Float64, n: int) -> Float64:
    """Medians of n by n readings, of those that are there; NaN where none is."""
    groups = np.sort(readings_mm[: len(readings_mm) // n * n].reshape(-1, n), axis=1)  # NaN last
    count = np.isfinite(groups).sum(axis=1)
    rows = np.arange(len(groups))
    return np.asarray((groups[rows, (count - 1) // 2] + groups[rows, count // 2]) / 2)


def turns_gain(far_mm: ArrayLike, n: int = 5) -> dict[str, float]:
    """What n turns take off the noise that fewer leave just below 3 m, and what more would.

    Parameters
    ----------
    far_mm : (turns, beams) array_like, mm
    n : int

    Returns
    -------
    dict
        ``gained_mm``, from two turns fewer to n; ``gained_std_mm``, its standard deviation by the jackknife over the
        turns, NaN where there are less than n + 2; ``beyond_mm``, from n to two more.

    Notes
    -----
    Two turns more than n may not have been recorded: their noise is taken to be ``sqrt(n / (n + 2))`` of n's, as that
    of independent turns is.
    """
    turns = np.asarray(far_mm, np.float64)
    one_less = [_gained(np.delete(turns, k, axis=0), n) for k in range(len(turns))] if len(turns) > n + 1 else [np.nan]
    return {
        "gained_mm": _gained(turns, n),
        "gained_std_mm": float(np.std(one_less) * np.sqrt(len(turns) - 1)),
        "beyond_mm": noise_of_median(turns, n) * (1 - float(np.sqrt(n / (n + 2)))),
    }


def _gained(turns_mm: Float64, n: int) -> float:
    return noise_of_median(turns_mm, n - 2) - noise_of_median(turns_mm, n)


def error_below(limit_mm: float, **curves: ErrorCurve) -> dict[str, float]:
    """The largest mean error in per cent below a distance.

    Parameters
    ----------
    limit_mm : float
    **curves : ErrorCurve
        By the target's name.

    Returns
    -------
    dict
        ``percent_NAME`` of every curve.
    """
    return {
        f"percent_{name}": float(np.nanmax(np.where(curve.true_mm <= limit_mm, curve.percent, np.nan)))
        for name, curve in curves.items()
    }


def sweep_error(scan: LaserScan, truth_mm: Float64, walls: Bools) -> dict[str, float]:
    """How far the readings of the walls lie from them.

    Parameters
    ----------
    scan : LaserScan
    truth_mm : (360,) float64, mm
    walls : (360,) bool
        Beams that meet a wall.

    Returns
    -------
    dict
        ``walls_mm``, root mean square.
    """
    off = (scan.ranges_mm - truth_mm)[walls]
    return {"walls_mm": float(np.sqrt(np.nanmean(off**2)))}


def footprint_cm(scan: LaserScan) -> Float64:
    """Length and width of the nearest object of a scan, by the laser alone.

    Parameters
    ----------
    scan : LaserScan

    Returns
    -------
    (2,) float64, cm
        NaN where the scan does not show it, or shows no object.
    """
    parts = [part for part in find_segments(scan) if part.kind == "object"]
    if not parts:
        return np.full(2, np.nan)
    nearest = min(parts, key=lambda part: float(np.min(scan.ranges_mm[part.beams])))
    outline = fit_footprint(nearest)
    return np.array([outline.length_mm, outline.width_mm]) / _MM_PER_CM


def half_beam_step_cm(distance_mm: float, side_mm: float, step_rad: float = float(np.radians(1.0))) -> float:
    """Half of the stretch between the last beam on a face of a cube seen edge-on and the first one beyond it.

    Parameters
    ----------
    distance_mm : float
        To the near edge.
    side_mm : float
        Of the cube.
    step_rad : float
        Between two beams.

    Returns
    -------
    float, cm
        ``r step / (2 sin a)`` at the face's far end: r its distance, a the angle between beam and face.

    Examples
    --------
    >>> round(half_beam_step_cm(700, 300), 2)
    1.55
    """
    along = side_mm / np.sqrt(2)
    far = np.array([distance_mm + along, along])
    angle = np.pi / 4 - np.arctan2(far[1], far[0])
    return float(np.hypot(*far) * step_rad / (2 * np.sin(angle)) / _MM_PER_CM)
