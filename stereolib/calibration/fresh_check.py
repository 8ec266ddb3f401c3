"""A calibration tried on boards it has never seen: their size, their flatness and their rows, and what that says."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from stereolib.base import Float64, counted, plus_minus
from stereolib.calibration.board_size import SizeErrors, board_size_error_pct, triangulate
from stereolib.calibration.board_views import BoardViews
from stereolib.calibration.boards import Board
from stereolib.calibration.bundle_adjustment import moved_rig
from stereolib.calibration.check_wording import check_findings, check_notes
from stereolib.calibration.findings import ERROR_PCT, Check, picture_scale
from stereolib.calibration.misfits import refuse_one_picture
from stereolib.calibration.movement import SURE, Movement, estimate_movement
from stereolib.calibration.record import CalibrationRecord
from stereolib.calibration.solve import epipolar_errors_px
from stereolib.rig import StereoRig

_DRAWS = 32  # of the corners' noise: a standard deviation to an eighth
_BENT = 0.005  # of the board's longer side, 1 mm of 200 mm: bent so far, it is bent and not the pictures are noisy
_EXPLAINED = 1.5  # times the noise that the rows show: a flat board before the right rig leaves no more
ROWS_PX = (0.3, 1.0)  # of pictures 640 wide: up to the first good, up to the second usable
_UNFIT_PX = 1.5  # rms, of pictures 640 px wide: no rig explains such corners, whatever has moved
_WORSE = 4.0  # times the median rms of the pairs: what honest pairs never reach
_LEAST_RMS_PX = 0.1  # a median below it is no measure
_LISTED = 6  # names in one sentence
_LEAST_COMMON = 8  # corners that both cameras see; more than the longer side has, so that some stand in one row


class Estimate(NamedTuple):
    """A value that a true rig and a true board would show as 0.

    Attributes
    ----------
    value : float
    std : float
        What the calibration's stated deviations and the noise of the corners make of it.
    """

    value: float
    std: float

    @property
    def sure(self) -> bool:
        """Whether it is more than chance."""
        return abs(self.value) > SURE * self.std


@dataclass(frozen=True, eq=False)
class CalibrationCheck:
    """A calibration held against boards that it has never seen.

    Attributes
    ----------
    views : BoardViews
        The pairs used.
    pairs_refused : dict
        Name of each other pair in which the board was found, and the reason.
    rig : StereoRig
        As it was calibrated.
    points_mm : (n, corners, 3) float64
        The boards, triangulated; NaN where a corner was not found in both views.
    off_plane_mm : (n, corners) float64
        Distance of each corner from its board's plane, towards the cameras.
    row_errors_px : (n, corners) float64
        Row in the rectified left picture minus that in the right one.
    square_pct, board_pct : Estimate, %
        By how much squares, and the board's longer side, come out too large; mean over the pairs.
    bend_mm : dict of str to Estimate
        How far the board bends towards the cameras from its middle to its rim: along its columns, along its rows, and
        twisted.
    row_offset_px, row_slope_px : Estimate
        Of the rows in the middle of the picture, and how they change from its left rim to its right one.
    movement : Movement
    record : CalibrationRecord
    checks : tuple of Check
        What the verdict rests on.
    verdict : str
        A name of `CHECK_MEANINGS`.
    findings : tuple of str
        What is wrong, one sentence each.
    notes : tuple of str
        What these pairs cannot tell.
    """

    views: BoardViews
    pairs_refused: dict[str, str]
    rig: StereoRig
    points_mm: Float64
    off_plane_mm: Float64
    row_errors_px: Float64
    square_pct: Estimate
    board_pct: Estimate
    bend_mm: dict[str, Estimate]
    row_offset_px: Estimate
    row_slope_px: Estimate
    movement: Movement
    record: CalibrationRecord
    checks: tuple[Check, ...] = ()
    verdict: str = ""
    findings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def sizes(self) -> SizeErrors:
        """How wrong each pair's board comes out."""
        return _sizes(self.points_mm, self.views.board)

    @property
    def distance_mm(self) -> Float64:
        """Distance of each board's middle along the left camera's axis. (n,)."""
        return np.asarray(np.nanmean(self.points_mm[..., 2], axis=1))

    @property
    def flat_rms_mm(self) -> float:
        """Rms distance of the corners from their boards' planes."""
        return float(np.sqrt(np.nanmean(self.off_plane_mm**2)))

    @property
    def flat_worst_mm(self) -> float:
        """The largest one."""
        return float(np.nanmax(np.abs(self.off_plane_mm)))

    @property
    def row_rms_px(self) -> float:
        """Rms difference of the rows."""
        return float(np.sqrt(np.nanmean(self.row_errors_px**2)))


def check_calibration(
    rig: StereoRig, views: BoardViews, *, record: CalibrationRecord | None = None
) -> CalibrationCheck:
    """Try a calibration on board pairs taken since.

    Parameters
    ----------
    rig : StereoRig
        The calibrated one.
    views : BoardViews
        One pair is enough.
    record : CalibrationRecord, optional
        How sure the calibration is, and which boards made it; without it only the corners' noise counts.

    Returns
    -------
    CalibrationCheck

    Raises
    ------
    ValueError
        If there is no pair, or pairs made the calibration, have another size of pictures, show one picture twice, are
        exchanged, or fit no rig at all.

    Notes
    -----
    Standard deviations: each principal direction of the calibration's covariance moves the rig once, and the corners
    are drawn anew, with the noise that the rows show; what comes out varies by so much.

    Examples
    --------
    >>> from stereolib.calibration import Checkerboard
    >>> from stereolib.rig import Camera
    >>> camera = Camera([[700, 0, 320], [0, 700, 240], [0, 0, 1]], [], (640, 480))
    >>> rig, board = StereoRig(camera, camera, np.eye(3), [-90.0, 0, 0]), Checkerboard(9, 6, 25.0)
    >>> seen = board.points_mm @ [[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]] + [-60, -50, 600]
    >>> left, right = (camera.project(seen + [x, 0, 0])[None] for x in (0, -93))  # by 3 mm farther apart
    >>> check = check_calibration(rig, BoardViews(board, (640, 480), left, right, ("01.png",), ()))
    >>> check.verdict, check.movement.named[0].what
    ('recalibrate', 'baseline')
    """
    record = record or CalibrationRecord(np.zeros((2 * (4 + rig.left.dist.size) + 6,) * 2), whole=False)
    _refuse(rig, views, record)
    views, refused, movement = _fitting(rig, views, record)
    points, off, rows = _seen(rig, views)
    noise_px = max(_row_plane(views, rows)[1], record.sigma_px)
    found, std = _measured(rig, views), _deviations(rig, views, record, noise_px)
    squares, longer, *bends, offset, slope = (Estimate(*pair) for pair in zip(found.tolist(), std, strict=True))
    check = CalibrationCheck(
        views=views,
        pairs_refused=refused,
        rig=rig,
        points_mm=points,
        off_plane_mm=off,
        row_errors_px=rows,
        square_pct=squares,
        board_pct=longer,
        bend_mm=dict(zip(("along columns", "twisted", "along rows"), bends, strict=True)),
        row_offset_px=offset,
        row_slope_px=slope,
        movement=movement,
        record=record,
    )
    bent = _bent(check, noise_px)
    checks = _checks(check)[-1 if bent else 0 :]
    level = max(c.level for c in checks)
    verdict = "no verdict" if bent and level < 2 else ("still good", "usable", "recalibrate")[level]
    check = replace(check, checks=checks, verdict=verdict)
    findings = (*check_findings(check, bent), *(f"{name}: {why}" for name, why in refused.items()))
    return replace(check, findings=findings, notes=tuple(check_notes(check)))


def _refuse(rig: StereoRig, views: BoardViews, record: CalibrationRecord) -> None:
    """Pairs that cannot be a test of this calibration."""
    if not len(views):
        raise ValueError("there is no pair of the board to check the calibration with: one is enough")
    if views.size != rig.left.size:
        sizes = "the pictures are {}x{}, the calibration is for {}x{}".format(*views.size, *rig.left.size)
        raise ValueError(f"{sizes}: take pictures of that size, or calibrate again")
    if used := record.made_from(views):
        names = ", ".join(used[:_LISTED]) + ", ..." * (len(used) > _LISTED)
        which = f"{len(used)} of {counted(len(views), 'pair')} made the calibration ({names})"
        raise ValueError(f"{which}: take new ones, a check needs boards that it has never seen")
    common = (np.isfinite(views.left_px) & np.isfinite(views.right_px)).all(axis=2).sum(axis=1)
    least = max(_LEAST_COMMON, max(views.board.columns, views.board.rows) + 1)
    if few := [f"{n} in {name}" for n, name in zip(common, views.names, strict=True) if n < least]:
        why = f"too few corners are seen by both cameras, {', '.join(few)}"
        raise ValueError(f"{why}: at least {least} are needed, hold the board where both see it")
    refuse_one_picture(views)
    if all(np.nanmedian(triangulate(rig, *pair)[:, 2]) < 0 for pair in _pairs(views)):
        why = "the boards come out behind the cameras"
        raise ValueError(f"{why}: left and right pictures are exchanged, or of another rig")


def _fitting(
    rig: StereoRig, views: BoardViews, record: CalibrationRecord
) -> tuple[BoardViews, dict[str, str], Movement]:
    """The pairs that fit to one rig, the others and why, and how that rig has moved."""
    movement = estimate_movement(views, rig, record)
    rms = np.sqrt((movement.fit.pair_rms_px**2).mean(axis=1))
    unfit = _UNFIT_PX * picture_scale(views.size)
    limit = min(unfit, _WORSE * max(float(np.median(rms)), _LEAST_RMS_PX))
    keep = np.flatnonzero(rms <= limit)
    why = (
        "left and right do not fit together ({:.2f} px): were they taken at one instant, by this rig, of "
        "a board of this size?"
    )
    refused = {views.names[k]: why.format(rms[k]) for k in np.flatnonzero(rms > limit)}
    if not len(keep):
        raise ValueError("; ".join(f"{name}: {text}" for name, text in refused.items()))
    if refused:
        views = views.only(keep.tolist())
        movement = estimate_movement(views, rig, record)
    return views, refused, movement


def _pairs(views: BoardViews) -> Iterator[tuple[Float64, Float64]]:
    return zip(views.left_px.astype(float), views.right_px.astype(float), strict=True)


def _sizes(points: Float64, board: Board) -> SizeErrors:
    return SizeErrors(*np.array([board_size_error_pct(p, board) for p in points]).T)


def _seen(rig: StereoRig, views: BoardViews) -> tuple[Float64, Float64, Float64]:
    """The boards' corners (n, corners, 3), their distance from the boards' planes, and their rows' differences."""
    pixels = (np.reshape(corners, (-1, 2)).astype(float) for corners in (views.left_px, views.right_px))
    points = triangulate(rig, *pixels).reshape(*views.left_px.shape[:2], 3)
    off = np.full(points.shape[:2], np.nan)
    for distance, board in zip(off, points, strict=True):
        known = np.isfinite(board[:, 0])
        middle = board[known].mean(axis=0)
        normal = np.linalg.svd(board[known] - middle, full_matrices=False)[2][-1]
        distance[known] = (board[known] - middle) @ normal * -np.sign(normal @ middle)
    return points, off, epipolar_errors_px(rig.rectify(), views)


def _measured(rig: StereoRig, views: BoardViews) -> Float64:
    """Sizes (2), bends (3), and the rows' offset and slope, as means over the pairs. (7,)."""
    points, off, rows = _seen(rig, views)
    sizes = _sizes(points, views.board)
    x, y, _ = (2 * (views.board.points_mm / views.board.points_mm.max(axis=0, initial=1e-9)) - 1).T
    surface = np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y]).astype(float)
    bends = [np.linalg.lstsq(surface[at], d[at], rcond=None)[0][3:] for d in off if (at := np.isfinite(d)).any()]
    return np.array(
        [
            np.nanmean(sizes.square_pct),
            np.nanmean(sizes.board_pct),
            *np.mean(bends, axis=0),
            *_row_plane(views, rows)[0][:2],
        ]
    )


def _row_plane(views: BoardViews, rows: Float64) -> tuple[Float64, float]:
    """Rows' offset in the middle, change over the width and over the height; and the noise of a corner they leave, px.

    Rows know nothing of the board's shape, so that this noise is the corners' own, even of a bent board.
    """
    known = np.isfinite(rows)
    at = np.column_stack([np.ones(known.sum()), views.left_px[known].astype(float) / views.size - 0.5])
    plane = np.linalg.lstsq(at, rows[known], rcond=None)[0]
    return plane, float(np.std(rows[known] - at @ plane) / np.sqrt(2))


def _deviations(rig: StereoRig, views: BoardViews, record: CalibrationRecord, noise_px: float) -> list[float]:
    """Standard deviations of what `_measured` tells, for a rig and a board that are as they should be."""
    values, vectors = np.linalg.eigh(record.covariance)
    found = _measured(rig, views)
    steps = (vectors * np.sqrt(np.maximum(values, 0))).T[values > 0]
    by_rig = sum(((_measured(moved_rig(rig, step), views) - found) ** 2 for step in steps), np.zeros(len(found)))
    rng, draws = np.random.default_rng(0), []
    for _ in range(_DRAWS):
        left, right = (
            (corners + rng.normal(0, noise_px, corners.shape)).astype(np.float32)
            for corners in (views.left_px, views.right_px)
        )
        draws.append(_measured(rig, replace(views, left_px=left, right_px=right)))
    by_noise = record.scatter**2 * np.var(draws, axis=0)
    return [float(std) for std in np.sqrt(by_rig + by_noise)]


def _bent(check: CalibrationCheck, noise_px: float) -> str:
    """How the board is bent; empty for a flat one, or where a rig that has moved explains it to the corners' noise."""
    least = _BENT * float(np.ptp(check.views.board.points_mm, axis=0).max())
    worst, bend = max(check.bend_mm.items(), key=lambda item: abs(item[1].value))
    if not bend.sure or abs(bend.value) < least or check.movement.fit.sigma_px < _EXPLAINED * noise_px:
        return ""
    towards = "towards" if bend.value > 0 else "away from"
    how = f"{plus_minus(abs(bend.value), bend.std)} mm {worst}, its rim {towards} the cameras"
    return f"the board is not flat, it bends by {how}: its size and what rests on it are not judged"


def _checks(check: CalibrationCheck) -> tuple[Check, ...]:
    """What has limits: lengths, depths, and, last, the rows, which need no board that is flat."""
    moved = triangulate(
        check.movement.rig, *(np.reshape(c, (-1, 2)) for c in (check.views.left_px, check.views.right_px))
    )
    ratio = moved[:, 2] / check.points_mm[..., 2].ravel()
    depth_pct = 100 * float(np.nanmean(np.abs(ratio - 1)))
    good, usable = (limit * picture_scale(check.views.size) for limit in ROWS_PX)
    again = "calibrate again"
    return (
        Check("squares are wrong by", check.sizes.square_error_pct, "%", *ERROR_PCT, again),
        Check("the board's longer side is wrong by", check.sizes.board_error_pct, "%", *ERROR_PCT, again),
        Check("depths, as the rig has moved, are wrong by", depth_pct, "%", *ERROR_PCT, again),
        Check(
            "rows differ after rectification by",
            check.row_rms_px,
            "px rms",
            good,
            usable,
            again,
        ),
    )
