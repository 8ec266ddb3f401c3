"""Why a pair does not fit: shown twice, mirrored, left and right exchanged, or taken with another focus."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from stereolib.base import Float64, Floats, Ints
from stereolib.calibration.board_views import BoardViews, match_order
from stereolib.calibration.bundle_adjustment import RigFit, fit_rig, inverse_normal, moved_rig
from stereolib.rig import StereoRig

_SAME_PX = 0.01  # left and right corners nearer than that are one picture's
_STILL_PX = 2.0  # boards whose corners differ by less were held still: a hand moves them farther
_REFOCUSED = 0.01  # of the focal length: what autofocus changes is more, what lenses and boards pretend mostly less
_MOST_REFOCUSED = 0.3  # nor does any lens change by more
_SURE = 5.0  # times the scatter of the others: not once in a hundred sets by chance
_LIKELY = 3.0  # the same for further pairs, once one is sure
_SCATTER = 1.4826  # standard deviation over the median distance from the median
_MOST = 3  # a third of the pairs: of more the others are no judges
_ROUNDS = 4  # of judging anew; most sets settle in two
_NEWTON_STEPS = 3  # of two focal lengths beside a pose: 3 % are met to 1e-6
_HOPELESS = 4.0  # times the limit, still off after the first step: another focus is no explanation
_LISTED = 6  # names in one sentence


def repeated_pairs(views: BoardViews) -> dict[int, int]:
    """Find pairs that show the board where another does: copies, or pictures of a board held still.

    Parameters
    ----------
    views : BoardViews

    Returns
    -------
    dict of int to int
        Index of each such pair, and of the first one that it repeats.
    """
    corners = np.concatenate([views.left_px, views.right_px], axis=1).astype(float)
    different, repeated = list[int](), dict[int, int]()
    for k in range(len(views)):
        off = np.abs(corners[different] - corners[k])
        largest = np.where(np.isnan(off), -1.0, off).max(axis=(1, 2), initial=-1.0)
        same = np.flatnonzero((largest >= 0) & (largest < _STILL_PX))
        if same.size:
            repeated[k] = different[same[0]]
        else:
            different.append(k)
    return repeated


def refocused_pairs(tried: RigFit, inside: Ints) -> Ints:
    """Find pairs taken with another focus that their boards' poses hide: both focal lengths longer, boards nearer.

    Parameters
    ----------
    tried : RigFit
        All pairs, posed before a rig that stands on those inside.
    inside : (m,) int
        Indices of the pairs that fit.

    Returns
    -------
    (k,) int
        Those of them with another focus.

    Notes
    -----
    Beside its pose every pair gets a scale of the focal lengths, against the rig of the others: one number, met in one
    step of Gauss-Newton from the pair's part of the normal equations. What is scaled by more than 1 %, five times as
    much as the others scatter, was taken with another focus. Such pairs spoil the rig, and hide each other: so the most
    suspicious ones are left out one by one, and then judged by the rig of the rest.
    """
    found = np.zeros(0, int)
    while _MOST * (len(found) + 1) <= len(inside):
        scales, scores = _focal_scales(tried, inside, np.setdiff1d(inside, found))
        scores[np.isin(inside, found) | (np.abs(scales) < _REFOCUSED / 2)] = 0.0
        if scores.max() < _SURE:
            break
        found = np.append(found, inside[scores.argmax()])
    for _ in range(_ROUNDS):
        rest = np.setdiff1d(inside, found)
        scales, scores = _focal_scales(tried, inside, rest)
        scatter = max(1.0, _SCATTER * float(np.median(scores)))  # of all: the rest alone has lost its tails
        scores[np.abs(scales) < _REFOCUSED] = 0.0
        now = inside[scores > scatter * (_SURE if scores.max() < _SURE * scatter else _LIKELY)]
        if np.array_equal(now, np.sort(found)):
            break
        found = now if _MOST * len(now) <= len(inside) else found[:0]
    return found


def _focal_scales(tried: RigFit, asked: Ints, rest: Ints) -> tuple[Float64, Float64]:
    """Scale of the focal lengths of each pair asked, less the rest's median, and its amount in standard deviations."""
    direction = _focal_directions(tried.rig).sum(axis=0)
    total, pull = tried.normal[rest].sum(axis=0), tried.gradient[rest].sum(axis=0)
    scales, stds, member = np.zeros(len(asked)), np.zeros(len(asked)), np.isin(asked, rest)
    for i, k in enumerate(asked):
        normal, gradient = tried.normal[k], tried.gradient[k]
        others = inverse_normal(total - member[i] * normal)  # covariance of their rig, and the step that leaves k out
        along, informs = normal @ direction, direction @ normal @ direction
        scales[i] = (direction @ gradient - along @ others @ (pull - member[i] * gradient)) / informs
        stds[i] = np.sqrt(informs + along @ others @ along) / informs
    residuals = tried.residuals_px[rest][tried.known[rest]]
    scales -= np.median(scales[member])
    scores = np.abs(scales) / (stds * np.sqrt(max(float(np.mean(residuals**2)), 1e-12)))
    return scales, scores


def _focal_directions(rig: StereoRig) -> Float64:
    """Change of the shared parameters when the left, and when the right, focal lengths double. (2, s)."""
    n = 4 + rig.left.dist.size
    directions = np.zeros((2, 2 * n + 6))
    for side, camera in enumerate((rig.left, rig.right)):
        directions[side, [side * n, side * n + 1]] = camera.K[[0, 1], [0, 1]]
    return directions


def refuse_one_picture(views: BoardViews) -> None:
    """Refuse pairs whose left and right pictures are one.

    Parameters
    ----------
    views : BoardViews

    Raises
    ------
    ValueError
        If the corners stand in the same place in both.
    """
    if np.nanmedian(np.abs(views.left_px - views.right_px)) < _SAME_PX:
        why = "left and right are the same pictures: the corners stand in the same place in both"
        raise ValueError(f"{why}. Was one folder copied twice?")


def explain(views: BoardViews, rig: StereoRig, limit_px: float) -> dict[int, str]:
    """Try what makes a pair fit to the rig of the others, and tell what did.

    Parameters
    ----------
    views : BoardViews
        Pairs that do not fit.
    rig : StereoRig
        Of the others.
    limit_px : float
        Rms of a pair that fits.

    Returns
    -------
    dict of int to str
        Index of each pair that something explains, and this reason.
    """
    if not len(views):
        return {}
    mirrored = _mirrored(views)
    off = "switch that off in the camera's program"
    tries = [
        (f"both pictures are mirrored: {off}", mirrored),
        ("left and right are exchanged: swap these files", _exchanged(views)),
        ("the pair was mirrored as one picture, and so left and right exchanged", _exchanged(mirrored)),
    ]
    for turn in (1, -1):  # a board seen in a mirror may have been found from its other end
        left, right = mirrored.left_px[:, ::turn], mirrored.right_px[:, ::turn]
        tries += [(f"the left picture is mirrored: {off}", replace(views, left_px=left))]
        tries += [(f"the right picture is mirrored: {off}", replace(views, right_px=right))]
    least, reasons = np.full(len(views), limit_px), dict[int, str]()
    for reason, changed in tries:
        rms = np.array([_rms_px(changed.only([k]), rig) for k in range(len(views))])
        reasons |= dict.fromkeys(np.flatnonzero(rms <= least).tolist(), reason)
        least = np.minimum(least, rms)
    return reasons | _refocused(views, rig, least)


def posed_rms_px(posed: RigFit) -> Float64:
    """Rms of every pair over both views.

    Parameters
    ----------
    posed : RigFit

    Returns
    -------
    (n,) float64, px
    """
    return np.asarray(np.sqrt((posed.pair_rms_px**2).mean(axis=1)))


def _rms_px(views: BoardViews, rig: StereoRig) -> float:
    """Rms of one pair, posed anew before the rig; inf where no pose is found."""
    try:
        return float(posed_rms_px(fit_rig(views, rig, free=False))[0])
    except np.linalg.LinAlgError:  # the board was moved out of what the cameras can see
        return float("inf")


def _mirrored(views: BoardViews) -> BoardViews:
    """Both pictures of each pair seen in a mirror, the corners in the order in which they are found there."""
    shape = len(views), views.board.rows, views.board.columns, 2

    def seen(corners_px: Floats) -> Floats:
        turned = np.reshape(corners_px, shape)[:, :, ::-1] * [-1, 1] + [views.size[0] - 1, 0]
        return np.asarray(turned.reshape(len(views), -1, 2), np.float32)

    return replace(views, left_px=seen(views.left_px), right_px=seen(views.right_px))


def _exchanged(views: BoardViews) -> BoardViews:
    ordered = [match_order(right, left) for left, right in zip(views.left_px, views.right_px, strict=True)]
    return replace(views, left_px=views.right_px, right_px=np.stack(ordered))


def _refocused(views: BoardViews, rig: StereoRig, limits_px: Float64) -> dict[int, str]:
    """Pairs that fit within their limits when both cameras' focal lengths are free, and by how much these changed."""
    found = dict[int, Float64]()
    for k, limit in enumerate(limits_px):
        scales, rms = _focus_of(views.only([k]), rig, float(limit))
        if rms <= limit and np.abs(scales).max() > _REFOCUSED:
            found[k] = scales
    reasons = dict[int, str]()
    kinds = {k: tuple(_changed(scales).tolist()) for k, scales in found.items()}
    for kind in set(kinds.values()):
        alike = [k for k in found if kinds[k] == kind]
        reason = _focus_text(np.median([found[k] for k in alike], axis=0))
        reasons |= dict.fromkeys(alike, reason)
    return reasons


def _changed(scales: Float64) -> Ints:
    """Sign of each change that is one."""
    return np.asarray(np.sign(scales) * (np.abs(scales) > _REFOCUSED), int)


def _focus_of(views: BoardViews, rig: StereoRig, limit_px: float) -> tuple[Float64, float]:
    """Changes of the left and right focal length with which one pair fits best, and its rms then."""
    directions, scales, rms = _focal_directions(rig), np.zeros(2), float("inf")
    for _ in range(_NEWTON_STEPS):
        posed = fit_rig(views, moved_rig(rig, scales @ directions), free=False)
        pull = directions @ posed.gradient[0]
        step = np.linalg.solve(directions @ posed.normal[0] @ directions.T, pull)
        rms = float(np.sqrt(max((posed.residuals_px**2).sum() - step @ pull, 0.0) / posed.known.sum()))
        scales = scales + step
        if rms > _HOPELESS * limit_px or np.abs(scales).max() > _MOST_REFOCUSED:
            return scales, float("inf")
    return scales, rms


def _focus_text(scales: Float64) -> str:
    cameras, amounts = ["the left camera", "the right camera"], scales[_changed(scales) != 0]
    cameras = [camera for camera, sign in zip(cameras, _changed(scales), strict=True) if sign]
    if len(cameras) == 2 and abs(scales[0] - scales[1]) < _REFOCUSED / 2:
        cameras, amounts = ["both cameras"], scales.mean(keepdims=True)
    told = [
        f"{100 * abs(amount):.1f} % {'longer' if amount > 0 else 'shorter'} in {camera}"
        for camera, amount in zip(cameras, amounts, strict=True)
    ]
    return f"taken with another focus, the focal length {' and '.join(told)}: switch autofocus off"


def in_short(names: Sequence[str], everyone: Sequence[str]) -> str:
    """List names, those that follow on each other as a range.

    Parameters
    ----------
    names, everyone : sequences of str
        Some names, and all of them in their order.

    Returns
    -------
    str

    Examples
    --------
    >>> in_short(["a", "b", "c", "f"], ["a", "b", "c", "d", "e", "f"])
    'a to c, f'
    """
    place = {name: k for k, name in enumerate(everyone)}
    runs = list[list[str]]()
    for name in names:
        if runs and name in place and place.get(runs[-1][-1], len(place)) == place[name] - 1:
            runs[-1].append(name)
        else:
            runs.append([name])
    parts = [f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(run) for run in runs]
    rest = sum(len(run) for run in runs[_LISTED:])
    return ", ".join(parts[:_LISTED]) + f" and {rest} more" * bool(rest)


def by_reason(reasons: Mapping[str, str], everyone: Sequence[str]) -> list[tuple[str, str]]:
    """Gather names that share a reason.

    Parameters
    ----------
    reasons : mapping of name to reason
    everyone : sequence of str
        All names in their order.

    Returns
    -------
    list of (names, reason)
        Names as `in_short` lists them.
    """
    groups = dict[str, list[str]]()
    for name, reason in reasons.items():
        groups.setdefault(reason, []).append(name)
    return [(in_short(names, everyone), reason) for reason, names in groups.items()]
