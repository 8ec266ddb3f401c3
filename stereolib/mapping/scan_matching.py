"""Poses of stations from their scans: all of them laid over each other, point to line (Chen and Medioni 1992).

Every reading that lies near a straight bit of another station's scan, seen from the same side, should lie on it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stereolib.laser import XV11_SIGMA
from stereolib.mapping.stations import Station

Array = np.ndarray
_LEAST_PAIRS = 30
_BESIDE_MM = 200.0  # a reading may lie so far past the last one of the line it is matched with


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
    covariance: Array
    rms_before_mm: float
    rms_after_mm: float
    pairs: int


def refine_poses(
    stations: Sequence[Station],
    *,
    reach_mm: tuple[float, float] = (300.0, 40.0),
    facing_rad: float = np.deg2rad(35.0),
    rounds: int = 12,
    bias_mm: tuple[float, float] = (1.0, 0.8e-6),
    least_share: float = 0.012,
    sigma: Callable[[Array], Array] = XV11_SIGMA,
) -> ScanMatch:
    """Refine the poses of stations by their scans; the first one stays.

    Parameters
    ----------
    stations : sequence of Station
        Two or more, with poses known to some 50 mm and 3 degrees.
    reach_mm : (first, last)
        How far off a line readings may lie to be matched with it; it shrinks from round to round.
    facing_rad : float
        How much the directions of two matched bits may differ: the far side of a thin box is another wall.
    rounds : int
        Matchings, each followed by least squares.
    bias_mm : (a, b)
        Standard deviations of what averaging does not remove, mm and 1/mm: `a` is what all readings of one station on
        one straight bit share (brightness and angle), ``b r^2`` what all readings share, as a laser that triangulates
        errs with the square of the range. The second is 0 if it was learnt and taken off
        (`stereolib.laser.learn_bias`).
    least_share : float
        How firmly every direction must be held, as a share of what the best-held one is; less is refused.
    sigma : callable
        Noise of a reading (see `stereolib.laser.find_segments`).

    Raises
    ------
    ValueError
        If there are fewer than two stations, a scan has no straight bit, two scans do not overlap, or the scans leave
        a direction open: with a single wall nothing tells where along it a station stands. The text says which.

    Notes
    -----
    Minimises ``sum rho((R_j n) . (T_i p - T_j q) / s)`` over the poses ``T``: p is a reading of station i, q the
    nearest bit of station j with its normal n, s its deviation by noise and a; rho is Cauchy's loss, at two
    deviations. The covariance is ``H^-1 (N + sum_c g_c g_c' + g g') H^-1``: N is the noise's part, ``g_c`` what the
    bias does through all pairs of one station with one bit of another, which err together, g what b does through all.
    """
    if len(stations) < 2:
        raise ValueError(f"matching needs two stations or more, got {len(stations)}: a single one has nothing to match")
    scans = [_Scan.of(k, station, sigma, bias_mm) for k, station in enumerate(stations, start=1)]
    poses = np.array([station.pose for station in stations])
    start = poses.copy()
    pairs = None
    for reach in np.geomspace(*reach_mm, rounds):
        pairs = _match(scans, poses, reach, facing_rad)
        _check_linked(pairs, len(stations))
        if reach == reach_mm[0]:
            _check_held(scans, poses, pairs, least_share)
        poses = _least_squares(scans, poses, pairs, max(2.0, reach / 40))
    pairs = _match(scans, poses, reach_mm[1], facing_rad)
    _check_linked(pairs, len(stations))
    _check_held(scans, poses, pairs, least_share)
    poses = _least_squares(scans, poses, pairs, 2.0)
    covariance = _covariance(scans, poses, pairs)
    refined = [stations[0]]
    for k, station in enumerate(stations[1:]):
        refined.append(replace(station, pose=poses[k + 1], covariance=covariance[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]))
    rms = [float(np.sqrt(np.mean(_residuals(scans, at, pairs)[0] ** 2))) for at in (start, poses)]
    return ScanMatch(tuple(refined), covariance, rms[0], rms[1], len(pairs[0]))


def disturbed(
    stations: Sequence[Station], rng: np.random.Generator, off_mm: float, off_rad: float
) -> tuple[Station, ...]:
    """The stations at wrong poses, but for the first: uniform errors up to `off_mm` along x and y, `off_rad` in yaw."""
    errors = rng.uniform(-1, 1, (len(stations), 3)) * [off_mm, off_mm, off_rad]
    errors[0] = 0
    return tuple(replace(s, pose=s.pose + error) for s, error in zip(stations, errors, strict=True))


@dataclass(frozen=True, eq=False)
class _Scan:
    """Readings (N, 2) in the station's frame, what they are on the line of their straight bit, its normal towards the
    laser (NaN where not straight) and number, the deviations of
    noise and of what a bit's readings share, and the shift (N, 2) that all readings share."""

    points: Array
    anchors: Array
    normals: Array
    bit: Array
    noise: Array
    bias: Array
    common: Array

    @classmethod
    def of(
        cls, number: int, station: Station, sigma: Callable[[Array], Array], bias_mm: tuple[float, float], half: int = 3
    ) -> _Scan:
        p = station.scan_mm
        if len(p) < 2 * half + 1:
            raise ValueError(f"the scan of station {number} has {len(p)} readings: too few to match; scan again")
        window = (np.arange(len(p))[:, None] + np.arange(-half, half + 1)) % len(p)
        q = p[window]
        q0 = q - q.mean(axis=1, keepdims=True)
        values, vectors = np.linalg.eigh(q0.transpose(0, 2, 1) @ q0 / q.shape[1])
        normals = vectors[:, :, 0]
        normals *= np.sign(((station.laser_mm - p) * normals).sum(axis=1))[:, None]
        step = np.linalg.norm(np.diff(q, axis=1), axis=2).max(axis=1)
        range_mm = np.linalg.norm(p - station.laser_mm, axis=1)
        noise = np.asarray(sigma(range_mm), float)
        straight = (np.sqrt(values[:, 0]) < 3 * noise) & (step < 150.0 + 0.05 * range_mm)
        straight &= np.sqrt(values[:, 1]) > 5 * noise
        if straight.sum() < 10:
            raise ValueError(
                f"the scan of station {number} has no straight bit of wall or face among its {len(p)} readings to "
                f"match with; scan where there are walls"
            )
        turn = np.abs(np.diff(np.unwrap(np.arctan2(normals[:, 1], normals[:, 0])), prepend=0)) > 0.3
        common = bias_mm[1] * range_mm[:, None] * (p - station.laser_mm)
        bias, bit = np.full(len(p), bias_mm[0]), np.cumsum(turn | ~straight)
        anchors, normals = p.copy(), np.where(straight[:, None], normals, np.nan)
        for members in (np.flatnonzero(straight & (bit == k)) for k in np.unique(bit[straight])):
            if len(members) < 3:
                continue
            middle = p[members].mean(axis=0)
            line = np.linalg.svd(p[members] - middle, full_matrices=False)[2][1]
            off = (p[members] - middle) @ line
            if np.sqrt(np.mean(off**2)) < 2 * np.median(noise[members]):  # one line for all of it
                normals[members] = line * np.sign(line @ normals[members].sum(axis=0))
                anchors[members] -= off[:, None] * line
        return cls(p, anchors, normals, bit, noise, bias, common)


def _match(scans: Sequence[_Scan], poses: Array, reach: float, facing: float) -> tuple[Array, ...]:
    """Pairs (station i, reading, station j, reading) that lie near each other and face the same way."""
    from scipy.spatial import cKDTree

    placed = [_placed(scan, pose) for scan, pose in zip(scans, poses, strict=True)]
    found = []
    for j, (_, there, normals) in enumerate(placed):
        lines = np.flatnonzero(np.isfinite(normals[:, 0]))
        tree = cKDTree(there[lines])
        for i, (here, _, own) in enumerate(placed):
            if i == j:
                continue
            distance, nearest = tree.query(here, distance_upper_bound=max(reach, _BESIDE_MM))
            near = np.flatnonzero(np.isfinite(distance))
            q = lines[nearest[near]]
            alike = (own[near] * normals[q]).sum(axis=1) > np.cos(facing)  # NaN is not alike
            alike &= np.abs(((here[near] - there[q]) * normals[q]).sum(axis=1)) < reach
            near, q = near[alike], q[alike]
            found.append(np.stack([np.full(len(near), i), near, np.full(len(near), j), q]))
    return tuple(np.concatenate(found, axis=1))


def _placed(scan: _Scan, pose: Array) -> tuple[Array, Array, Array]:
    """Readings, anchors and normals in the map."""
    R = _turn(pose[2])
    return scan.points @ R + pose[:2], scan.anchors @ R + pose[:2], scan.normals @ R


def _turn(yaw: float) -> Array:
    """Transposed rotation: rows of points times it are turned by yaw."""
    return np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])


def _residuals(scans: Sequence[_Scan], poses: Array, pairs: tuple[Array, ...]) -> tuple[Array, Array]:
    """Distances of readings from their lines, mm, and the Jacobian with all poses, (N, 3 n)."""
    placed = [_placed(scan, pose) for scan, pose in zip(scans, poses, strict=True)]
    i, a, j, b = pairs
    starts = np.cumsum([0, *(len(scan.points) for scan in scans)])
    points, anchors, normals = (np.concatenate(parts) for parts in zip(*placed, strict=True))
    p, q, n = points[starts[i] + a], anchors[starts[j] + b], normals[starts[j] + b]
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


def _deviations(scans: Sequence[_Scan], pairs: tuple[Array, ...]) -> tuple[Array, Array]:
    """Of the distances of pairs: by noise and bias, and the bias's part, each (N,) mm."""
    i, a, j, b = pairs
    starts = np.cumsum([0, *(len(scan.points) for scan in scans)])
    first, second = starts[i] + a, starts[j] + b
    noise, bias = (np.concatenate([getattr(scan, name) for scan in scans]) for name in ("noise", "bias"))
    common = np.hypot(bias[first], bias[second])
    return np.hypot(np.hypot(noise[first], noise[second]), common), common


def _least_squares(scans: Sequence[_Scan], poses: Array, pairs: tuple[Array, ...], doubt: float) -> Array:
    """Poses that bring the pairs together; pairs farther apart than `doubt` deviations count less and less.

    Gauss-Newton with Cauchy's weights ``1 / (1 + (r / (doubt s))^2)``.
    """
    deviation = _deviations(scans, pairs)[0]
    poses = poses.copy()
    for _ in range(20):
        residual, J = _residuals(scans, poses, pairs)
        J = J[:, 3:]
        weight = 1 / (deviation**2 + (residual / doubt) ** 2)
        step = np.linalg.solve(J.T @ (weight[:, None] * J), J.T @ (weight * residual)).reshape(-1, 3)
        poses[1:] -= step
        if np.abs(step * [1.0, 1.0, 1000.0]).max() < 0.01:  # mm, and mm at one metre
            break
    return poses


def _covariance(scans: Sequence[_Scan], poses: Array, pairs: tuple[Array, ...]) -> Array:
    residual, J = _residuals(scans, poses, pairs)
    deviation, common = _deviations(scans, pairs)
    J = J[:, 3:] / deviation[:, None]
    weight = 1 / (1 + (residual / deviation / 2) ** 2)
    inverse = np.linalg.inv(J.T @ (weight[:, None] * J))
    i, _, j, b = pairs
    wall = np.array([scans[k].bit[m] for k, m in zip(j, b, strict=True)])
    cluster = np.unique(np.stack([i, j, wall]), axis=1, return_inverse=True)[1].ravel()
    G = np.zeros((cluster.max() + 1, J.shape[1]))
    np.add.at(G, cluster, (weight * common / deviation)[:, None] * J)
    turned = [scan.common @ _turn(pose[2]) for scan, pose in zip(scans, poses, strict=True)]
    normal = [_placed(scan, pose)[2] for scan, pose in zip(scans, poses, strict=True)]
    shift = np.array([(turned[k][m] - turned[n][q]) @ normal[n][q] for k, m, n, q in zip(*pairs, strict=True)])
    shared = J.T @ (weight * shift / deviation)
    own = J * (weight * np.sqrt(1 - (common / deviation) ** 2))[:, None]
    return np.asarray(inverse @ (G.T @ G + own.T @ own + np.outer(shared, shared)) @ inverse)


def _check_linked(pairs: tuple[Array, ...], count: int) -> None:
    """Refuse if the stations fall into groups that see nothing in common."""
    i, j = pairs[0], pairs[2]
    many = np.zeros((count, count))
    np.add.at(many, (i, j), 1)
    linked = (many + many.T) >= _LEAST_PAIRS
    group = {0}
    while more := {k for k in range(count) if linked[list(group), k].any()} - group:
        group |= more
    alone = [str(k + 1) for k in range(count) if k not in group]
    if alone:
        raise ValueError(
            f"the scans of stations {', '.join(alone)} have nothing in common with that of station 1 and what overlaps "
            f"it: their starting poses are too far off, or they see other walls; add a station between"
        )


def _check_held(scans: Sequence[_Scan], poses: Array, pairs: tuple[Array, ...], least_share: float) -> None:
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
        if times * least_share < 1:
            continue
        x, y, turn = vectors[:, -1]
        if abs(turn) > np.hypot(x, y):
            what, mend = "the direction in which it looks", "walls that are not round about it"
        else:
            along = np.degrees(np.arctan2(y, x)) % 180
            what = f"where it stands along {along:.0f} degrees in the map"
            mend = f"a wall or a face across it, which looks {(along + 180) % 360:.0f} or {along:.0f} degrees"
        raise ValueError(
            f"the scans leave open for station {k + 2} {what}: they hold it {min(times, 9999):.0f} "
            f"times less firmly than the rest. Let the scans show {mend}, or give that pose from elsewhere"
        )
