"""Which pairs belong together: wrong corners, pairs whose halves do not match, and rigs that moved."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.base import Float64, Floats, Ints
from stereolib.calibration.boards import BoardViews
from stereolib.calibration.bundle_adjustment import board_poses, fit_rig, project_with_derivatives
from stereolib.calibration.solve import CameraCalibration, StereoCalibration, calibrate_camera, calibrate_stereo
from stereolib.rig import Camera

_WORSE = 4.0  # times the median rms: what honest pairs never reach
_LEAST_RMS_PX = 0.02  # corners that a detector finds are never better: a median below it is no measure
_AGREE = 6.0  # times both views' median rms: a pair's own pose carries its noise into another's right view
_LEAST_AGREE_PX = 0.6  # limit where the corners are nearly perfect
_ROUNDS = 4  # of fitting and sorting anew; most sets settle in two
_MIN_GROUP = 3  # pairs: fewer determine no rig
_LEAST_SHARE = 4  # a quarter of the pairs must agree, or the set is no set
_SAME_PX = 0.01  # left and right corners nearer than that are one picture's
_STILL_PX = 2.0  # boards whose corners differ by less were held still
_FLAT_DEG = 5.0  # boards tilted by less leave the focal length open
_USUAL_FOCAL = 1.1  # image widths, a webcam's


@dataclass(frozen=True, eq=False)
class SortedPairs:
    """Pairs sorted by the rig that they agree with.

    Attributes
    ----------
    calibration : StereoCalibration
        Stands on the first of `groups`.
    groups : tuple of tuple of int
        Indices of pairs, the largest group first.
    refused : dict
        Index of each other pair, and the reason.
    moved : tuple of str
        How far the rig moved for each further group.
    """

    calibration: StereoCalibration
    groups: tuple[tuple[int, ...], ...]
    refused: dict[int, str]
    moved: tuple[str, ...]


def sort_pairs(views: BoardViews, model: str = "brown3") -> SortedPairs:
    """Calibrate on the pairs that agree, and say what is wrong with the others.

    Parameters
    ----------
    views : BoardViews
    model : str
        A name of `LENS_MODELS`.

    Returns
    -------
    SortedPairs

    Raises
    ------
    ValueError
        Fewer than 3 pairs, all alike or all fronto-parallel, pairs that do not fit to each other, or left and right
        exchanged.

    Notes
    -----
    First each camera on its own: a view that fits no pose has wrong corners. Then the pose of the right camera that
    each pair alone implies: of all these, the one that predicts most pairs' right corners from their left ones wins,
    and the next one is sought among the rest. Last the joint fit of the winners, against which every pair is tried
    again: what is worse than four times the median is out.
    """
    _refuse_few(views)
    _refuse_flat(views)
    left, left_bad = _single(views, views.left_px, model)
    right, right_bad = _single(views, views.right_px, model)
    refused = {
        k: f"the corners in the {side} view fit no board ({rms:.2f} px): wrong corners"
        for side, bad in (("left", left_bad), ("right", right_bad))
        for k, rms in bad.items()
    }
    able = np.array([k for k in range(len(views)) if k not in refused])
    if len(able) < _MIN_GROUP:
        raise ValueError(f"only {len(able)} of {len(views)} pairs have usable corners; at least 3 are needed")
    noise = float(np.hypot(np.median(left.view_rms_px), np.median(right.view_rms_px)))
    groups = _groups(views, able, left.camera, right.camera, max(_AGREE * noise, _LEAST_AGREE_PX))
    if not groups or len(groups[0]) < max(_MIN_GROUP, len(views) / _LEAST_SHARE):
        most = len(groups[0]) if groups else 0
        why = f"the pairs do not belong together: at most {most} of {len(views)} agree on where the right camera stands"
        remedy = "Are left and right files of the same moments, in the same order? Is one camera upside down?"
        raise ValueError(f"{why}. {remedy}")
    calibration, inside = _settled(views, groups[0], able, model)
    others = [rest for g in groups[1:] if len(rest := np.setdiff1d(g, inside)) >= _MIN_GROUP]
    pair_rms = _tried(views, calibration)
    moved = []
    for number, group in enumerate(others, 2):
        far = _movement(calibration, _settled(views, group, group, model)[0])
        moved.append(f"{len(group)} pairs were taken with the rig in another position ({far})")
        refused |= {int(k): f"belongs to position {number} of the rig, {far} from the first" for k in group}
    why = "the board moved between the shutters, or these are two different moments"
    misfits = [int(k) for k in able if k not in inside and k not in refused]
    refused |= {k: f"left and right do not fit together ({pair_rms[k]:.2f} px): {why}" for k in misfits}
    return SortedPairs(calibration, tuple(tuple(g.tolist()) for g in (inside, *others)), refused, tuple(moved))


def _refuse_few(views: BoardViews) -> None:
    """Too few pairs, or too few different ones, or one camera twice."""
    if len(views) < _MIN_GROUP:
        why = f"{len(views)} pairs of the board are too few ({', '.join(views.names)})"
        raise ValueError(f"{why}: at least 3 with different tilts are needed, and 15 to 30 give a trustworthy rig")
    if np.nanmedian(np.abs(views.left_px - views.right_px)) < _SAME_PX:
        why = "left and right are the same pictures: the board is at the same place in both"
        raise ValueError(f"{why}. Was one folder copied twice?")
    different: list[Float64] = []
    for corners in np.asarray(views.left_px, float):
        if all(not np.nanmax(np.abs(corners - other), initial=0) < _STILL_PX for other in different):
            different.append(corners)
    if len(different) < _MIN_GROUP:
        why = f"the {len(views)} pairs show the board in only {len(different)} different place(s): move and tilt it"
        raise ValueError(f"{why} between pictures; at least 3 places are needed, and 15 to 30 give a trustworthy rig")


def _refuse_flat(views: BoardViews) -> None:
    """Boards parallel to the image leave the focal length open: any one fits, at another distance.

    Judged before any calibration, with a webcam's focal length: tilts come out right within a third.
    """
    (width, height), f = views.size, _USUAL_FOCAL * max(views.size)
    guess = Camera(np.array([[f, 0, width / 2], [0, f, height / 2], [0, 0, 1]]), np.zeros(0), views.size)
    turns = board_poses(views.board.points_mm, views.left_px, guess)[0]
    tilts = np.degrees(np.arccos(np.clip(np.abs(turns[:, 2, 2]), 0, 1)))
    if np.sort(tilts)[-max(2, len(tilts) // 5)] < _FLAT_DEG:
        why = f"all boards fronto-parallel: hardly one of {len(views)} is tilted by more than {_FLAT_DEG:g} degrees"
        raise ValueError(f"{why}: that hides the focal length; tilt the board by 20 to 40 degrees, both ways")


def _single(views: BoardViews, corners_px: Floats, model: str) -> tuple[CameraCalibration, dict[int, float]]:
    """One camera, calibrated without the views that fit no pose, and those views' rms (px)."""
    keep = np.arange(len(corners_px))
    for _ in range(_ROUNDS):
        calibration = calibrate_camera(views.board, corners_px[keep], views.size, model=model)
        camera = calibration.camera
        points = _boards_in(views, corners_px, camera)[2]
        rms = _corner_rms(corners_px - project_with_derivatives(camera, points)[0])
        good = np.flatnonzero(rms <= _WORSE * max(np.median(rms), _LEAST_RMS_PX))
        if len(good) < _MIN_GROUP or np.array_equal(good, keep):
            break
        keep = good
    bad = np.setdiff1d(np.arange(len(corners_px)), keep)
    return calibration, {int(k): float(rms[k]) for k in bad}


def _boards_in(views: BoardViews, corners_px: Floats, camera: Camera) -> tuple[Float64, Float64, Float64]:
    """Turns and shifts of the boards before one camera, and their corners in its frame (n, N, 3) mm."""
    turns, shifts = board_poses(views.board.points_mm, corners_px, camera)
    return turns, shifts, views.board.points_mm @ turns.transpose(0, 2, 1) + shifts[:, None]


def _corner_rms(off_px: Float64) -> Float64:
    """Rms distance over the corners (n, N, 2) of each view. (n,)."""
    return np.asarray(np.sqrt(np.nanmean((off_px**2).sum(axis=2), axis=1)))


def _groups(views: BoardViews, able: Ints, left: Camera, right: Camera, limit_px: float) -> list[Ints]:
    """Groups of the able pairs, largest first, each agreeing with the pose of the rig that one of them implies."""
    some = views.only(able.tolist())
    left_turns, left_shifts, points = _boards_in(some, some.left_px, left)
    right_turns, right_shifts, _ = _boards_in(some, some.right_px, right)
    R = right_turns @ left_turns.transpose(0, 2, 1)
    T = right_shifts - np.einsum("nij,nj->ni", R, left_shifts)
    right_px = np.asarray(some.right_px, float)
    predicted = (project_with_derivatives(right, points @ turn.T + shift)[0] for turn, shift in zip(R, T, strict=True))
    agree = np.array([_corner_rms(right_px - pixels) for pixels in predicted]) < limit_px
    free, groups = np.ones(len(R), bool), list[Ints]()
    while True:
        support = (agree & free).sum(axis=1) * free
        members = np.flatnonzero(agree[int(np.argmax(support))] & free)
        if len(members) < _MIN_GROUP:
            return groups
        groups.append(able[members])
        free[members] = False


def _settled(views: BoardViews, start: Ints, able: Ints, model: str) -> tuple[StereoCalibration, Ints]:
    """Fit a group, try every able pair against it, and go on with those that fit, until nothing changes."""
    inside = start
    for _ in range(_ROUNDS):
        calibration = calibrate_stereo(views.only(inside.tolist()), model=model)
        rms = _tried(views, calibration)
        limit = _WORSE * max(float(np.median(rms[inside])), _LEAST_RMS_PX)
        now = able[rms[able] <= limit]
        if len(now) < _MIN_GROUP or np.array_equal(now, inside):
            break
        inside = now
    return calibration, inside


def _tried(views: BoardViews, calibration: StereoCalibration) -> Float64:
    """Rms of every pair, posed anew before the rig, px. (n,)."""
    return np.asarray(np.sqrt((fit_rig(views, calibration.rig, free=False).pair_rms_px ** 2).mean(axis=1)))


def _movement(first: StereoCalibration, second: StereoCalibration) -> str:
    turn = np.degrees(np.linalg.norm(cv2.Rodrigues(second.rig.R @ first.rig.R.T)[0]))
    shift = np.linalg.norm(second.rig.T - first.rig.T)
    return f"the right camera {shift:.1f} mm shifted and {turn:.2f} degrees turned"
