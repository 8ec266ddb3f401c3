"""Poses of stations from their scans: all of them laid over each other, point to line (Chen and Medioni 1992).

Every reading that lies near a straight bit of another station's scan, seen from the same side, should lie on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from stereolib.base import Float64, Ints, counted, turn_2d
from stereolib.laser import XV11_SIGMA
from stereolib.mapping.stations import XV11_BIAS, Station, laser_errors_mm, station_names

_LEAST_PAIRS = 30  # of readings that two scans must have in common to be linked
_BESIDE_MM = 200.0  # a reading may lie so far past the last one of the line it is matched with
_REACH_MM = (300.0, 40.0)  # from a line, of the first and the last round: what poses are off by, and what bias leaves
_FACING_RAD = np.deg2rad(35.0)  # between two matched bits: the far side of a thin box is another wall
_ROUNDS = 12  # matchings, each followed by least squares
_LEAST_SHARE = 0.012  # of the firmness of the best-held direction: less is refused
_DOUBT = 2.0  # deviations from which on a pair counts less and less
_MOVED = 0.6  # deviations by which neighbouring readings lie off in the mean: twice what noise makes of seven
_STEPS = 20  # of least squares; most need four
_STILL_MM = 0.01  # steps that are smaller end it, turns counted at a metre
_HALF_WINDOW = 3  # readings to either side that tell whether the scan is straight there
_LEAST_STRAIGHT = 10  # readings on straight bits
_STRAIGHT = (3.0, 5.0)  # deviations of noise: at most across a straight bit, and at least along it
_STEP_MM = (150.0, 0.05)  # longest gap within a bit: mm, and share of the range
_TURN_RAD = 0.3  # where the normal turns by more from reading to reading another bit begins
_ONE_LINE = 2.0  # deviations of noise: bits that are straighter are one line


@dataclass(frozen=True, eq=False)
class ScanMatch:
    """Refined poses.

    Attributes
    ----------
    stations : tuple of Station
        With their refined poses and covariances; the first as it was.
    covariance : (3 (n - 1), 3 (n - 1)) float64
        Of all poses but the first, jointly: x, y, yaw of station 2, then 3, ...; mm and rad.
    rms_before_mm, rms_after_mm : float
        Of the distances between readings and the lines they were matched with at the end, before and after.
    pairs : int
        Readings matched.
    """

    stations: tuple[Station, ...]
    covariance: Float64
    rms_before_mm: float
    rms_after_mm: float
    pairs: int


def refine_poses(stations: Sequence[Station], *, bias_mm: tuple[float, float] = XV11_BIAS) -> ScanMatch:
    """Refine the poses of stations by their scans; the first one stays.

    Parameters
    ----------
    stations : sequence of Station
        Two or more, with poses known to some 50 mm and 3 degrees. Farther off, scans may come to lie on the wrong walls
        of each other, and nothing here tells so: `place_stations` does, by what their beams went through.
    bias_mm : (a, b)
        Standard deviations of what averaging does not remove, mm and 1/mm: `a` is what all readings of one station on
        one straight bit share (brightness and angle), ``b r^2`` what all readings share, as a laser that triangulates
        errs with the square of the range. The second is 0 if it was learnt and taken off
        (`stereolib.laser.learn_bias`).

    Returns
    -------
    ScanMatch

    Raises
    ------
    ValueError
        If there are fewer than two stations, a scan has no straight bit, two scans do not overlap, or the scans leave
        a direction open: with a single wall nothing tells where along it a station stands. The text says which.

    Notes
    -----
    Minimises ``sum rho((R_j n) . (T_i p - T_j q) / s)`` over the poses ``T``: p is a reading of station i, q the
    nearest bit of station j with its normal n, s its deviation by noise and a; rho is Cauchy's loss, at two
    deviations. The covariance is ``H^-1 C' C H^-1``: H is the loss's second derivative, and each row of C is what one
    standard deviation of an independent error does to its gradient. There is a row for each reading's noise, which
    enters all pairs that the reading or the line through it is in (i to j and j to i alike), one for the bias of each
    bit of each station, one for each error of the laser: b's, those of its pose and scale that all stations share,
    and each station's own; and one for each run of readings that lie off together by more than noise: what they met
    has moved meanwhile, and pulls.
    """
    if len(stations) < 2:
        raise ValueError(f"matching needs two stations or more, got {len(stations)}: a single one has nothing to match")
    names = station_names(stations)
    scans = [_Scan.of(name, station, bias_mm[0]) for name, station in zip(names, stations, strict=True)]
    poses = np.array([station.pose for station in stations])
    start = poses.copy()
    for reach in np.geomspace(*_REACH_MM, _ROUNDS):  # the last one again at the poses that it led to
        pairs = _match(scans, poses, reach)
        _check_linked(pairs, names)
        if reach == _REACH_MM[0]:
            _check_held(scans, poses, pairs, names)
        poses = _least_squares(scans, poses, pairs, max(_DOUBT, reach / _REACH_MM[1]))
    pairs = _match(scans, poses, _REACH_MM[1])
    _check_linked(pairs, names)
    _check_held(scans, poses, pairs, names)
    poses = _least_squares(scans, poses, pairs, _DOUBT)
    there = [replace(station, pose=pose) for station, pose in zip(stations, poses, strict=True)]
    covariance = _covariance(scans, poses, pairs, laser_errors_mm(there, bias_mm[1]))
    refined = [stations[0]]
    for k, station in enumerate(stations[1:]):
        refined.append(replace(station, pose=poses[k + 1], covariance=covariance[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]))
    rms = [float(np.sqrt(np.mean(_residuals(scans, at, pairs)[0] ** 2))) for at in (start, poses)]
    return ScanMatch(tuple(refined), covariance, rms[0], rms[1], len(pairs[0]))


def disturb_poses(
    stations: Sequence[Station], rng: np.random.Generator, off_mm: float, off_rad: float
) -> tuple[Station, ...]:
    """Put all stations but the first at wrong poses, to try `refine_poses`.

    Parameters
    ----------
    stations : sequence of Station
    rng : numpy.random.Generator
    off_mm, off_rad : float
        Largest errors, uniform, along x and y and in yaw.

    Returns
    -------
    tuple of Station

    Examples
    --------
    >>> stations = [Station(np.zeros(3), ()), Station(np.array([800.0, 0, 0]), ())]
    >>> first, second = disturb_poses(stations, np.random.default_rng(0), 50.0, 0.05)
    >>> bool((first.pose == 0).all()), bool(0 < abs(second.pose[0] - 800) < 50)
    (True, True)
    """
    errors = rng.uniform(-1, 1, (len(stations), 3)) * [off_mm, off_mm, off_rad]
    errors[0] = 0
    return tuple(replace(s, pose=s.pose + error) for s, error in zip(stations, errors, strict=True))


@dataclass(frozen=True, eq=False)
class _Scan:
    """A scan in its station's frame, and its straight bits.

    Attributes
    ----------
    points, anchors : (N, 2) float64, mm
        Readings, and where they come to lie on the line of their straight bit.
    normals : (N, 2) float64
        Of the bit, towards the laser; NaN where not straight.
    bit : (N,) int
        Number of the bit.
    line : (N, N) float64
        By how much each anchor (row) shifts across its bit for 1 mm of each reading.
    noise, across, bias : (N,) float64, mm
        Deviations by noise, as it is and across the bit, and by what a bit's readings share.
    """

    points: Float64
    anchors: Float64
    normals: Float64
    bit: Ints
    line: Float64
    noise: Float64
    across: Float64
    bias: Float64

    @classmethod
    def of(cls, name: str, station: Station, bias_mm: float) -> _Scan:
        p, half = station.scan_mm, _HALF_WINDOW
        if len(p) < 2 * half + 1:
            raise ValueError(
                f"the scan of station {name} has {counted(len(p), 'reading')}: too few to match; scan again"
            )
        window = (np.arange(len(p))[:, None] + np.arange(-half, half + 1)) % len(p)
        q = p[window]
        q0 = q - q.mean(axis=1, keepdims=True)
        values, vectors = np.linalg.eigh(q0.transpose(0, 2, 1) @ q0 / q.shape[1])
        normals = vectors[:, :, 0]
        normals *= np.sign(((station.laser_mm - p) * normals).sum(axis=1))[:, None]
        step = np.linalg.norm(np.diff(q, axis=1), axis=2).max(axis=1)
        range_mm = np.linalg.norm(p - station.laser_mm, axis=1)
        noise = np.asarray(XV11_SIGMA(range_mm), float)
        straight = (np.sqrt(values[:, 0]) < _STRAIGHT[0] * noise) & (step < _STEP_MM[0] + _STEP_MM[1] * range_mm)
        straight &= np.sqrt(values[:, 1]) > _STRAIGHT[1] * noise
        if straight.sum() < _LEAST_STRAIGHT:
            raise ValueError(
                f"the scan of station {name} has no straight bit of wall or face among its {len(p)} readings to "
                f"match with; scan where there are walls"
            )
        turn = np.abs(np.diff(np.unwrap(np.arctan2(normals[:, 1], normals[:, 0])), prepend=0)) > _TURN_RAD
        bias, bit = np.full(len(p), bias_mm), np.cumsum(turn | ~straight)
        anchors, normals, fit = p.copy(), np.where(straight[:, None], normals, np.nan), np.eye(len(p))
        for members in (np.flatnonzero(straight & (bit == k)) for k in np.unique(bit[straight])):
            if len(members) < 3:
                continue
            middle = p[members].mean(axis=0)
            line = np.linalg.svd(p[members] - middle, full_matrices=False)[2][1]
            off = (p[members] - middle) @ line
            if np.sqrt(np.mean(off**2)) < _ONE_LINE * np.median(noise[members]):  # one line for all of it
                normals[members] = line * np.sign(line @ normals[members].sum(axis=0))
                anchors[members] -= off[:, None] * line
                along = (p[members] - middle) @ (line[::-1] * [1, -1])
                fit[np.ix_(members, members)] = 1 / len(members) + np.outer(along, along) / (along @ along)
        across = noise * np.abs(((p - station.laser_mm) * np.nan_to_num(normals)).sum(axis=1)) / range_mm
        return cls(p, anchors, normals, bit, fit, noise, across, bias)


def _match(scans: Sequence[_Scan], poses: Float64, reach: float) -> tuple[Ints, ...]:
    """Pairs (station i, reading, station j, reading) that lie near each other and face the same way."""
    from scipy.spatial import cKDTree

    placed = [_placed(scan, pose) for scan, pose in zip(scans, poses, strict=True)]
    pairs = []
    for j, (_, there, normals) in enumerate(placed):
        lines = np.flatnonzero(np.isfinite(normals[:, 0]))
        tree = cKDTree(there[lines])
        for i, (here, _, own) in enumerate(placed):
            if i == j:
                continue
            distance, nearest = tree.query(here, distance_upper_bound=max(reach, _BESIDE_MM))
            near = np.flatnonzero(np.isfinite(distance))
            q = lines[nearest[near]]
            alike = (own[near] * normals[q]).sum(axis=1) > np.cos(_FACING_RAD)  # NaN is not alike
            alike &= np.abs(((here[near] - there[q]) * normals[q]).sum(axis=1)) < reach
            near, q = near[alike], q[alike]
            pairs.append(np.stack([np.full(len(near), i), near, np.full(len(near), j), q]))
    return tuple(np.concatenate(pairs, axis=1))


def _placed(scan: _Scan, pose: Float64) -> tuple[Float64, Float64, Float64]:
    """Readings, anchors and normals in the map."""
    R = turn_2d(-pose[2])  # transposed: points are rows
    return scan.points @ R + pose[:2], scan.anchors @ R + pose[:2], scan.normals @ R


def _numbers(scans: Sequence[_Scan], pairs: tuple[Ints, ...]) -> tuple[Ints, Ints]:
    """Of the readings and of the bits they were matched with, among those of all scans."""
    i, a, j, b = pairs
    starts = np.cumsum([0, *(len(scan.points) for scan in scans)])
    return starts[i] + a, starts[j] + b


def _residuals(scans: Sequence[_Scan], poses: Float64, pairs: tuple[Ints, ...]) -> tuple[Float64, Float64]:
    """Distances of readings from their lines, mm, and the Jacobian with all poses, (N, 3 n)."""
    placed = [_placed(scan, pose) for scan, pose in zip(scans, poses, strict=True)]
    (i, _, j, _), (first, second) = pairs, _numbers(scans, pairs)
    points, anchors, normals = (np.concatenate(parts) for parts in zip(*placed, strict=True))
    p, q, n = points[first], anchors[second], normals[second]
    residual = ((p - q) * n).sum(axis=1)
    J = np.zeros((len(i), 3 * len(scans)))
    row = np.arange(len(i))
    for k in (0, 1):
        J[row, 3 * i + k], J[row, 3 * j + k] = n[:, k], -n[:, k]
    lever_i, lever_j = p - poses[i, :2], p - poses[j, :2]
    J[row, 3 * i + 2] = n[:, 1] * lever_i[:, 0] - n[:, 0] * lever_i[:, 1]
    # Turning station j moves q and turns n: together as if p turned the other way about it.
    J[row, 3 * j + 2] = -(n[:, 1] * lever_j[:, 0] - n[:, 0] * lever_j[:, 1])
    return residual, J


def _deviations(scans: Sequence[_Scan], pairs: tuple[Ints, ...]) -> Float64:
    """Of the distances of pairs by noise and bias, (N,) mm."""
    first, second = _numbers(scans, pairs)
    each = np.concatenate([np.hypot(scan.noise, scan.bias) for scan in scans])
    return np.asarray(np.hypot(each[first], each[second]))


def _least_squares(scans: Sequence[_Scan], poses: Float64, pairs: tuple[Ints, ...], doubt: float) -> Float64:
    """Poses that bring the pairs together; pairs farther apart than `doubt` deviations count less and less.

    Gauss-Newton with Cauchy's weights ``1 / (1 + (r / (doubt s))^2)``.
    """
    deviation = _deviations(scans, pairs)
    poses = poses.copy()
    for _ in range(_STEPS):
        residual, J = _residuals(scans, poses, pairs)
        J = J[:, 3:]
        weight = 1 / (deviation**2 + (residual / doubt) ** 2)
        step = np.linalg.solve(J.T @ (weight[:, None] * J), J.T @ (weight * residual)).reshape(-1, 3)
        poses[1:] -= step
        if np.abs(step * [1.0, 1.0, 1000.0]).max() < _STILL_MM:  # mm, and mm at one metre
            break
    return poses


def _covariance(scans: Sequence[_Scan], poses: Float64, pairs: tuple[Ints, ...], errors: Float64) -> Float64:
    """Of all poses but the first; `errors` as `laser_errors_mm` tells them."""
    residual, J = _residuals(scans, poses, pairs)
    deviation, J = _deviations(scans, pairs), J[:, 3:]
    off = (residual / deviation / _DOUBT) ** 2
    # rho'', of pairs that come 1 mm farther apart: those beyond the doubt hold nothing
    pull = (np.maximum(1 - off, 0.0) / (1 + off) ** 2 / deviation**2)[:, None] * J
    inverse = np.linalg.inv(J.T @ pull)
    first, second = _numbers(scans, pairs)
    each = np.zeros((sum(len(scan.points) for scan in scans), J.shape[1]))  # of a reading, in all its pairs at once
    np.add.at(each, second, -pull)
    ends = np.cumsum([len(scan.points) for scan in scans])
    each = np.concatenate([scan.line @ on for scan, on in zip(scans, np.split(each, ends[:-1]), strict=True)])
    np.add.at(each, first, pull)
    across, bias = (np.concatenate([getattr(scan, name) for scan in scans])[:, None] for name in ("across", "bias"))
    bit = np.unique(np.concatenate([scan.bit + k * len(each) for k, scan in enumerate(scans)]), return_inverse=True)[1]
    alike = np.zeros((bit.max() + 1, J.shape[1]))
    np.add.at(alike, bit, bias * each)
    normals = np.concatenate([_placed(scan, pose)[2] for scan, pose in zip(scans, poses, strict=True)])
    shared = ((errors[:, first] - errors[:, second]) * normals[second]).sum(axis=-1) @ pull
    moved = _moved(scans, pairs, residual / deviation, (residual / (1 + off) / deviation**2)[:, None] * J)
    columns = np.concatenate([across * each, alike, shared, moved])
    return np.asarray(inverse @ (columns.T @ columns) @ inverse)


def _moved(scans: Sequence[_Scan], pairs: tuple[Ints, ...], off: Float64, push: Float64) -> Float64:
    """The gradient of each run of readings that lie off together, as on a thing that moved: (k, 3 (n - 1)).

    Where both ends of a pair lie in such runs either may have moved, the one that lies farther off more likely: they
    share its variance.
    """
    ends, starts = np.stack(_numbers(scans, pairs)), np.cumsum([0, *(len(scan.points) for scan in scans)])
    total, count = np.zeros((2, starts[-1]))
    np.add.at(total, ends, np.stack([off, -off]))
    np.add.at(count, ends, 1.0)
    lies_off = np.zeros(starts[-1])
    for start, stop in pairwise(starts):
        window = np.arange(stop - start)[:, None] + np.arange(-_HALF_WINDOW, _HALF_WINDOW + 1)
        window = start + window % (stop - start)
        mean = total[window].sum(axis=1) / np.maximum(count[window].sum(axis=1), 1.0)
        lies_off[start:stop] = np.where(np.abs(mean) > _MOVED, mean, 0.0)
    share = lies_off[ends] ** 2
    share /= np.maximum(np.linalg.norm(share, axis=0), _MOVED**2)  # 0 where neither does
    run = np.cumsum(np.isin(np.arange(starts[-1]), starts) | (np.diff(np.sign(lies_off), prepend=0.0) != 0)) - 1
    runs = np.zeros((run[-1] + 1, push.shape[1]))
    np.add.at(runs, run[ends], share[..., None] * push)
    return runs


def _check_linked(pairs: tuple[Ints, ...], names: Sequence[str]) -> None:
    """Refuse if the stations fall into groups that see nothing in common."""
    i, j, count = pairs[0], pairs[2], len(names)
    many = np.zeros((count, count))
    np.add.at(many, (i, j), 1)
    linked = (many + many.T) >= _LEAST_PAIRS
    group = {0}
    while more := {k for k in range(count) if linked[list(group), k].any()} - group:
        group |= more
    alone = [names[k] for k in range(count) if k not in group]
    if alone:
        raise ValueError(
            f"the scans of stations {', '.join(alone)} have nothing in common with that of station {names[0]} and what "
            f"overlaps it: their starting poses are too far off, or they see other walls; add a station between"
        )


def _check_held(scans: Sequence[_Scan], poses: Float64, pairs: tuple[Ints, ...], names: Sequence[str]) -> None:
    """Refuse if some motion of a station hardly changes any residual; say which."""
    J = _residuals(scans, poses, pairs)[1][:, 3:]
    reach = np.sqrt(np.mean(J[:, 2::3] ** 2) / np.mean(J[:, ::3] ** 2 + J[:, 1::3] ** 2)) + 1.0
    J /= np.tile([1.0, 1.0, reach], len(poses) - 1)
    H = J.T @ J
    open_ = np.linalg.inv(H + 1e-9 * np.trace(H) * np.eye(len(H)))
    for k in range(len(poses) - 1):
        block = slice(3 * k, 3 * k + 3)
        values, vectors = np.linalg.eigh(open_[block, block])
        times = float(values[-1] * np.linalg.eigvalsh(H[block, block])[-1])
        if times * _LEAST_SHARE < 1:
            continue
        x, y, turn = vectors[:, -1]
        if abs(turn) > np.hypot(x, y):
            what, mend = "the direction in which it looks", "walls that are not round about it"
        else:
            along = np.degrees(np.arctan2(y, x)) % 180
            what = f"where it stands along {along:.0f} degrees in the map"
            mend = f"a wall or a face across it, which looks {(along + 180) % 360:.0f} or {along:.0f} degrees"
        raise ValueError(
            f"the scans leave open for station {names[k + 1]} {what}: they hold it {min(times, 9999):.0f} "
            f"times less firmly than the rest. Let the scans show {mend}, or give that pose from elsewhere"
        )
