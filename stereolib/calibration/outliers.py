"""Which pairs belong together: copies, wrong corners, pairs whose halves do not match, and rigs that moved."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from stereolib.base import Float64, Floats, Ints, counted
from stereolib.calibration.board_poses import board_poses, boards_before
from stereolib.calibration.board_size import board_stretch
from stereolib.calibration.board_views import BoardViews
from stereolib.calibration.boards import Checkerboard
from stereolib.calibration.bundle_adjustment import RigFit, fit_rig, project_with_derivatives, with_coefficients
from stereolib.calibration.lens_models import LENS_MODELS
from stereolib.calibration.misfits import (
    by_reason,
    explain,
    posed_rms_px,
    refocused_pairs,
    refuse_one_picture,
    repeated_pairs,
)
from stereolib.calibration.solve import CameraCalibration, StereoCalibration, calibrate_camera, calibrate_stereo
from stereolib.calibration.wrong_corners import CornerOff, without_wrong_corners
from stereolib.rig import Camera

#: Usable pairs: fewer hold a rig at best, and say nothing of how good it is.
MIN_PAIRS = 5
_ENOUGH = f"at least {MIN_PAIRS} are needed, and 15 to 30 give a trustworthy rig"
_WORSE = 4.0  # times the median rms: what honest pairs never reach
_LEAST_RMS_PX = 0.02  # corners that a detector finds are never better: a median below it is no measure
_AGREE = 6.0  # times both views' median rms: a pair's own pose carries its noise into another's right view
_LEAST_AGREE_PX = 0.6  # limit where the corners are nearly perfect
_ROUNDS = 4  # of fitting and sorting anew; most sets settle in two
_MIN_GROUP = 3  # pairs: fewer determine no rig
_LEAST_SHARE = 4  # a quarter of the pairs must agree, or the set is no set
_FLAT_DEG = 5.0  # boards tilted by less leave the focal length open
_JUDGING_LENS = LENS_MODELS["brown3"][0]  # what webcams need: a shorter one asked for is no judge of the focus
_USUAL_FOCAL = 1.1  # image widths, a webcam's
_WRONG_CORNERS = "the corners in the {} view fit no board: is the picture sharp, the board flat and whole in it?"
_MISFIT = "left and right do not fit together: the board moved between the shutters, or these are two different moments"
_REPEATED = "the board stands where it does in another pair: a copy, or it was held still"


@dataclass(frozen=True, eq=False)
class SortedPairs:
    """Pairs sorted by the rig that they agree with.

    Attributes
    ----------
    calibration : StereoCalibration
        Stands on the first of `groups`.
    views : BoardViews
        All pairs, NaN for single corners that are wrong.
    wrong_corners : tuple of CornerOff
        These.
    groups : tuple of tuple of int
        Indices of pairs, the largest group first.
    refused : dict
        Index of each other pair, and the reason.
    repeated : dict
        Index of each pair among these that shows the board where another does, and of that one.
    moved_by : tuple of str
        How far the rig moved for each further group.
    """

    calibration: StereoCalibration
    views: BoardViews
    wrong_corners: tuple[CornerOff, ...]
    groups: tuple[tuple[int, ...], ...]
    refused: dict[int, str]
    repeated: dict[int, int]
    moved_by: tuple[str, ...]


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
        Fewer than 5 usable pairs, all alike or all fronto-parallel, pairs that do not fit to each other, or left and
        right exchanged.

    Notes
    -----
    Of pairs that show the board in one place the first stays. Then each camera on its own: single wrong corners are
    left out, and a view that fits no pose has many. Then the pose of the right camera that each pair alone implies: of
    all these, the one that predicts most pairs' right corners from their left ones wins, and the next one is sought
    among the rest. Last the joint fit of the winners, against which every pair is tried again: what is worse than four
    times the median is out, and so is another focus. For what is out, explanations are tried.
    """
    repeated = repeated_pairs(views)
    different = np.setdiff1d(np.arange(len(views)), list(repeated))
    _refuse_few(views, len(different))
    _refuse_flat(views.only(different.tolist()))
    views, wrong_corners = without_wrong_corners(views, model)
    some = views.only(different.tolist())
    groups, wrong = _start(some, model)
    able = np.setdiff1d(np.arange(len(some)), list(wrong))
    calibration, inside, limit_px = _settled(some, groups[0], able, model)
    out = np.setdiff1d(np.arange(len(some)), inside)
    explained = {int(out[k]): why for k, why in explain(some.only(out.tolist()), calibration.rig, limit_px).items()}
    others = [g for group in groups[1:] if len(g := np.setdiff1d(group, [*inside, *explained])) >= _MIN_GROUP]
    moved_by = tuple(_movement(calibration, _settled(some, group, group, model)[0]) for group in others)
    reasons = dict.fromkeys(out.tolist(), _MISFIT) | wrong | explained
    for number, (group, far) in enumerate(zip(others, moved_by, strict=True), 2):
        reasons |= dict.fromkeys(group.tolist(), f"taken with the rig in position {number}: {far}")
    reasons = {int(different[k]): why for k, why in reasons.items()} | dict.fromkeys(repeated, _REPEATED)
    _refuse_unusable(views, len(inside), reasons)
    positions = tuple(tuple(different[group].tolist()) for group in (inside, *others))
    return SortedPairs(calibration, views, wrong_corners, positions, reasons, repeated, moved_by)


def _start(views: BoardViews, model: str) -> tuple[list[Ints], dict[int, str]]:
    """Groups of pairs that agree on where the right camera stands, and the pairs with wrong corners."""
    left, left_bad = _single(views, views.left_px, model)
    right, right_bad = _single(views, views.right_px, model)
    wrong = dict.fromkeys(left_bad, _WRONG_CORNERS.format("left"))
    wrong |= dict.fromkeys(right_bad, _WRONG_CORNERS.format("right"))
    able = np.setdiff1d(np.arange(len(views)), list(wrong))
    _refuse_unusable(views, len(able), wrong)
    noise = float(np.hypot(np.median(left.view_rms_px), np.median(right.view_rms_px)))
    groups = _groups(views, able, left.camera, right.camera, max(_AGREE * noise, _LEAST_AGREE_PX))
    if not groups or len(groups[0]) < len(views) / _LEAST_SHARE:
        most = len(groups[0]) if groups else 0
        why = f"the pairs do not belong together: at most {most} of {len(views)} agree on where the right camera stands"
        remedy = (
            "Are left and right files of the same moments, in the same order? Is one camera upside down, or mirrored?"
        )
        raise ValueError(f"{why}. {remedy}")
    return groups, wrong


def _refuse_few(views: BoardViews, different: int) -> None:
    """Too few pairs, or too few different ones, or one camera twice."""
    if len(views) < MIN_PAIRS:
        is_or_are = "is" if len(views) == 1 else "are"
        why = f"{counted(len(views), 'pair')} of the board {is_or_are} too few ({', '.join(views.names)})"
        raise ValueError(f"{why}: {_ENOUGH}, the board tilted differently in each")
    refuse_one_picture(views)
    if different < MIN_PAIRS:
        why = f"the {len(views)} pairs show the board in only {counted(different, 'different place')}: move and tilt it"
        raise ValueError(f"{why} between pictures; {_ENOUGH}")


def _refuse_unusable(views: BoardViews, usable: int, reasons: dict[int, str]) -> None:
    """Too few pairs that fit to each other."""
    if usable < MIN_PAIRS:
        refused = {views.names[k]: why for k, why in sorted(reasons.items())}
        why = "; ".join(f"{names}: {reason}" for names, reason in by_reason(refused, views.names))
        raise ValueError(f"only {usable} of {len(views)} pairs are usable, {_ENOUGH}; left out: {why}")


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


def _single(views: BoardViews, corners_px: Floats, model: str) -> tuple[CameraCalibration, list[int]]:
    """One camera, calibrated without the views that fit no pose, and which these are."""
    keep = np.arange(len(corners_px))
    for _ in range(_ROUNDS):
        calibration = calibrate_camera(views.board, corners_px[keep], views.size, model=model)
        camera = calibration.camera
        points = boards_before(views.board.points_mm, corners_px, camera)[2]
        rms = _corner_rms(corners_px - project_with_derivatives(camera, points)[0])
        good = np.flatnonzero(rms <= _WORSE * max(np.median(rms), _LEAST_RMS_PX))
        if len(good) < _MIN_GROUP or np.array_equal(good, keep):
            break
        keep = good
    return calibration, np.setdiff1d(np.arange(len(corners_px)), keep).tolist()


def _corner_rms(off_px: Float64) -> Float64:
    """Rms distance over the corners (n, N, 2) of each view. (n,)."""
    return np.asarray(np.sqrt(np.nanmean((off_px**2).sum(axis=2), axis=1)))


def _groups(views: BoardViews, able: Ints, left: Camera, right: Camera, limit_px: float) -> list[Ints]:
    """Groups of the able pairs, largest first, each agreeing with the pose of the rig that one of them implies."""
    some = views.only(able.tolist())
    left_turns, left_shifts, points = boards_before(some.board.points_mm, some.left_px, left)
    right_turns, right_shifts, _ = boards_before(some.board.points_mm, some.right_px, right)
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


def _settled(views: BoardViews, start: Ints, able: Ints, model: str) -> tuple[StereoCalibration, Ints, float]:
    """Fit a group, try every able pair against it, and go on with those that fit, until nothing changes.

    Returns the rms up to which pairs fit, too.
    """
    now = start
    for _ in range(_ROUNDS):
        inside = now
        calibration = calibrate_stereo(views.only(inside.tolist()), model=model)
        tried = fit_rig(views, calibration.rig, free=False)
        rms = posed_rms_px(tried)
        limit = _WORSE * max(float(np.median(rms[inside])), _LEAST_RMS_PX)
        fitting = able[rms[able] <= limit]
        now = np.setdiff1d(fitting, _refocused(views, tried, fitting))
        if len(now) < _MIN_GROUP or np.array_equal(now, inside):
            break
    return calibration, inside, limit


def _refocused(views: BoardViews, tried: RigFit, fitting: Ints) -> Ints:
    """Pairs with another focus, whatever lens and board: one too short and one stretched look like changing focus."""
    found = refocused_pairs(tried, fitting)
    if not found.size:
        return found
    board, some = views.board, views.only(fitting.tolist())
    fit = fit_rig(some, with_coefficients(tried.rig, max(tried.rig.left.dist.size, _JUDGING_LENS)))
    if isinstance(board, Checkerboard) and (stretch := board_stretch(some, fit)):
        board = replace(board, aspect=board.aspect + stretch[0])
        fit = fit_rig(replace(some, board=board), fit.rig)
    return refocused_pairs(fit_rig(replace(views, board=board), fit.rig, free=False), fitting)


def _movement(first: StereoCalibration, second: StereoCalibration) -> str:
    turn = np.degrees(np.linalg.norm(cv2.Rodrigues(second.rig.R @ first.rig.R.T)[0]))
    shift = np.linalg.norm(second.rig.T - first.rig.T)
    return f"the right camera {shift:.1f} mm shifted and {turn:.2f} degrees turned"
