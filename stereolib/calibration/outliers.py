"""Which pairs belong together: wrong corners, pairs whose halves do not match, and rigs that moved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.calibration import bundle_adjustment
from stereolib.calibration.boards import BoardViews
from stereolib.calibration.coverage import tilts_rad
from stereolib.calibration.solve import CameraCalibration, StereoCalibration, calibrate_camera, calibrate_stereo
from stereolib.rig import Camera

Array = np.ndarray
_WORSE = 4.0  # times the median rms: what honest pairs never reach
_MIN_GROUP = 3
_SAME_PX = 0.01
_FLAT_DEG = 5.0


@dataclass(frozen=True, eq=False)
class Sorted:
    """Pairs sorted by the rig that they agree with.

    ``calibration`` stands on the first of ``groups`` (indices of pairs, the largest group first). ``refused`` maps
    the other pairs' indices to the reason. ``moved`` says how far the rig moved for each further group.
    """

    calibration: StereoCalibration
    groups: tuple[tuple[int, ...], ...]
    refused: dict[int, str]
    moved: tuple[str, ...]


def sort_pairs(views: BoardViews, model: str = "brown3") -> Sorted:
    """Calibrate on the pairs that agree, and say what is wrong with the others.

    Notes
    -----
    First each camera on its own: a view that fits no pose has wrong corners. Then the pose of the right camera that
    each pair alone implies: of all these, the one that predicts most pairs' right corners from their left ones wins,
    and the next one is sought among the rest. Last the joint fit of the winners, against which every pair is tried
    again: what is worse than four times the median is out.

    Raises
    ------
    ValueError
        Fewer than 3 pairs, all alike or all fronto-parallel, pairs that do not fit to each other, or left and right
        exchanged.
    """
    _refuse_few(views)
    _refuse_flat(views)
    left, left_bad = _single(views, views.left_px, model)
    right, right_bad = _single(views, views.right_px, model)
    refused: dict[int, str] = {}
    for side, bad in (("left", left_bad), ("right", right_bad)):
        refused |= {k: f"the corners in the {side} view fit no board ({rms:.2f} px): wrong corners"
                    for k, rms in bad.items()}  # fmt: skip
    able = np.array([k for k in range(len(views)) if k not in refused])
    if len(able) < _MIN_GROUP:
        raise ValueError(f"only {len(able)} of {len(views)} pairs have usable corners; at least 3 are needed")
    noise = float(np.hypot(np.median(left.view_rms_px), np.median(right.view_rms_px)))
    relative = _relative_poses(views.only(able.tolist()), left.camera, right.camera)
    groups = [able[group] for group in _groups(*relative, limit_px=max(6 * noise, 0.6))]
    if not groups or len(groups[0]) < max(_MIN_GROUP, len(views) / 4):
        most = len(groups[0]) if groups else 0
        raise ValueError(
            f"the pairs do not belong together: at most {most} of {len(views)} agree on where the right camera "
            f"stands. Are left and right files of the same moments, in the same order? Is one camera upside down?"
        )
    calibration, inside = _settled(views, groups[0], able, model)
    taken = set(inside.tolist())
    others = [rest for g in groups[1:] if len(rest := np.array([k for k in g if k not in taken])) >= _MIN_GROUP]
    pair_rms = _tried(views, calibration)
    moved = []
    for number, group in enumerate(others, 2):
        far = _movement(calibration, _settled(views, group, group, model)[0])
        moved.append(f"{len(group)} pairs were taken with the rig in another position ({far})")
        refused |= {int(k): f"belongs to position {number} of the rig, {far} from the first" for k in group}
    for k in able:
        if k not in taken and k not in refused:
            refused[int(k)] = (
                f"left and right do not fit together ({pair_rms[k]:.2f} px): the board moved between the shutters, "
                f"or these are two different moments"
            )
    return Sorted(
        calibration, tuple(tuple(int(k) for k in group) for group in (inside, *others)), refused, tuple(moved)
    )


def _refuse_few(views: BoardViews) -> None:
    """Too few pairs, or too few different ones, or one camera twice."""
    if len(views) < _MIN_GROUP:
        raise ValueError(
            f"{len(views)} pairs of the board are too few ({', '.join(views.names)}): at least 3 with different tilts "
            f"are needed, and 15 to 30 give a trustworthy rig"
        )
    if np.nanmedian(np.abs(views.left_px - views.right_px)) < _SAME_PX:
        raise ValueError(
            "left and right are the same pictures: the board is at the same place in both. Was one folder copied twice?"
        )
    different: list[Array] = []
    for corners in np.asarray(views.left_px, float):
        if all(not np.nanmax(np.abs(corners - other), initial=0) < 2 for other in different):
            different.append(corners)
    if len(different) < _MIN_GROUP:
        raise ValueError(
            f"the {len(views)} pairs show the board in only {len(different)} different place(s): move and tilt it "
            f"between pictures; at least 3 places are needed, and 15 to 30 give a trustworthy rig"
        )


def _refuse_flat(views: BoardViews) -> None:
    """Boards parallel to the image leave the focal length open: any one fits, at another distance.

    Judged before any calibration, with a focal length of 1.1 image widths: tilts come out right within a third.
    """
    (width, height), f = views.size, 1.1 * max(views.size)
    guess = Camera(np.array([[f, 0, width / 2], [0, f, height / 2], [0, 0, 1]]), np.zeros(0), views.size)
    tilts = np.degrees(tilts_rad(bundle_adjustment.poses(views.board.points_mm, views.left_px, guess)[0]))
    if np.sort(tilts)[-max(2, len(tilts) // 5)] < _FLAT_DEG:
        raise ValueError(
            f"all boards fronto-parallel: hardly one of {len(views)} is tilted by more than {_FLAT_DEG:g} degrees, so "
            f"that the focal length cannot be told from the distance; tilt the board by 20 to 40 degrees, both ways"
        )


def _single(views: BoardViews, corners_px: Array, model: str) -> tuple[CameraCalibration, dict[int, float]]:
    """One camera, calibrated without the views that fit no pose, and those views' rms (px)."""
    keep = np.arange(len(corners_px))
    for _ in range(4):
        found = calibrate_camera(views.board, corners_px[keep], views.size, model=model)
        rms = _view_rms(found.camera, views, corners_px)
        good = np.flatnonzero(rms <= _WORSE * max(np.median(rms), 0.02))
        if len(good) < _MIN_GROUP or np.array_equal(good, keep):
            break
        keep = good
    bad = np.setdiff1d(np.arange(len(corners_px)), keep)
    return found, {int(k): float(rms[k]) for k in bad}


def _view_rms(camera: Camera, views: BoardViews, corners_px: Array) -> Array:
    turns, shifts = bundle_adjustment.poses(views.board.points_mm, corners_px, camera)
    points = views.board.points_mm @ turns.transpose(0, 2, 1) + shifts[:, None]
    off = corners_px - bundle_adjustment.project(camera, points)[0]
    return np.sqrt(np.nanmean((off**2).sum(axis=2), axis=1))


def _relative_poses(views: BoardViews, left: Camera, right: Camera) -> tuple[Array, Array, Array, Array, Camera]:
    """R (n, 3, 3) and T (n, 3) that each pair alone implies; points (n, N, 3) in the left camera; right corners."""
    board = views.board.points_mm.astype(float)
    (Rl, tl), (Rr, tr) = (
        bundle_adjustment.poses(board, c, lens) for c, lens in ((views.left_px, left), (views.right_px, right))
    )
    R = Rr @ Rl.transpose(0, 2, 1)
    T = tr - np.einsum("nij,nj->ni", R, tl)
    return R, T, board @ Rl.transpose(0, 2, 1) + tl[:, None], np.asarray(views.right_px, float), right


def _groups(R: Array, T: Array, points: Array, right_px: Array, right: Camera, *, limit_px: float) -> list[Array]:
    """Groups of pairs, largest first, each agreeing with the pose that one of them implies."""
    errors = np.empty((len(R), len(R)))
    for j in range(len(R)):
        off = right_px - bundle_adjustment.project(right, points @ R[j].T + T[j])[0]
        errors[j] = np.sqrt(np.nanmean((off**2).sum(axis=2), axis=1))
    agree, free, found = errors < limit_px, np.ones(len(R), bool), list[Array]()
    while True:
        support = (agree & free).sum(axis=1) * free
        best = int(np.argmax(support))
        members = np.flatnonzero(agree[best] & free)
        if len(members) < _MIN_GROUP:
            return found
        found.append(members)
        free[members] = False


def _settled(views: BoardViews, start: Array, able: Array, model: str) -> tuple[StereoCalibration, Array]:
    """Fit a group, try every able pair against it, and go on with those that fit, until nothing changes."""
    inside = start
    for _ in range(4):
        calibration = calibrate_stereo(views.only(inside.tolist()), model=model)
        rms = _tried(views, calibration)
        limit = _WORSE * max(float(np.median(rms[inside])), 0.02)
        now = able[rms[able] <= limit]
        if len(now) < _MIN_GROUP or np.array_equal(now, inside):
            break
        inside = now
    return calibration, inside


def _tried(views: BoardViews, calibration: StereoCalibration) -> Array:
    """Rms of every pair, posed anew before the rig, px. (n,)."""
    return np.sqrt((bundle_adjustment.fit(views, calibration.rig, free=False).pair_rms_px ** 2).mean(axis=1))


def _movement(first: StereoCalibration, second: StereoCalibration) -> str:
    turn = np.degrees(np.linalg.norm(cv2.Rodrigues(second.rig.R @ first.rig.R.T)[0]))
    shift = np.linalg.norm(second.rig.T - first.rig.T)
    return f"the right camera {shift:.1f} mm shifted and {turn:.2f} degrees turned"


def named(names: Sequence[str], indices: Sequence[int], most: int = 6) -> str:
    """Names of these pairs as a list, cut short."""
    shown = ", ".join(names[k] for k in indices[:most])
    return shown + (f" and {len(indices) - most} more" if len(indices) > most else "")
