"""What notebook 02 holds against the paper: rows, sizes by the depth equation, and matching without rectification."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stereolib.base import Bools, Float64, Floats
from stereolib.calibration import Board, BoardViews, board_size_error_pct, epipolar_errors_px
from stereolib.matching import Score
from stereolib.measurement import HeightAttempt, corner_width_mm
from stereolib.rig import Camera, RectifiedRig, StereoRig

_LEAST_WRONG_PCT = 0.1  # a map with less counts as one with so much: about one exposure's scatter
HeldOut = Sequence[tuple[StereoRig, BoardViews]]


def rows_left_out(held_out: HeldOut, alpha: float = 0.0) -> dict[str, float]:
    """Tell how well rows agree on boards that the calibration has not seen.

    Parameters
    ----------
    held_out : sequence of (StereoRig, BoardViews)
        From `hold_out_rigs`: each rig with pairs that it has not seen.
    alpha : float
        As `StereoRig.rectify`.

    Returns
    -------
    dict
        ``left_out_px``: rms over all corners of the row in the left image minus that in the right one, rectified, px.
    """
    rows = [epipolar_errors_px(rig.rectify(alpha), boards).ravel() for rig, boards in held_out]
    return {"left_out_px": float(np.sqrt(np.nanmean(np.concatenate(rows) ** 2)))}


def board_points_mm(rectified: RectifiedRig, left_px: Floats, right_px: Floats) -> Float64:
    """Triangulate a board's corners by the paper's depth equation.

    Parameters
    ----------
    rectified : RectifiedRig
    left_px, right_px : (N, 2) array, px
        As found in the recorded images.

    Returns
    -------
    (N, 3) float64, mm
        ``Z = f B / d``, ``X = x_l B / d``, ``Y = y_l B / d`` in the rectified left camera's frame.
    """
    left, right = rectified.rectify_points(left_px, "left"), rectified.rectify_points(right_px, "right")
    return rectified.triangulate(left, left[:, 0] - right[:, 0])


def sizes_by_depth_equation(
    held_out: HeldOut, board: Board, cube: HeightAttempt, true_mm: tuple[float, float], alpha: float = 0.0
) -> dict[str, float]:
    """Hold sizes by the depth equation against true ones that the calibration was not told.

    Parameters
    ----------
    held_out : sequence of (StereoRig, BoardViews)
        From `hold_out_rigs`: each rig with pairs that it has not seen.
    board : Checkerboard or Charuco
        The board as it truly is, whatever the calibration was told.
    cube : HeightAttempt
        A cube's pair, matched and measured with a calibrated rig.
    true_mm : (edge, distance)
        The cube's true edge, and how far its near edge stands from the camera along the floor.
    alpha : float
        As `StereoRig.rectify`.

    Returns
    -------
    dict
        ``squares_pct``: mean over the boards left out of how wrong their squares are; ``distance_pct``, ``width_pct``:
        how wrong the distance of the cube's near edge and the cube's width from corner to corner are, whatever the
        sign, %; NaN if the cube was refused.
    """
    squares = []
    for rig, boards in held_out:
        rectified = rig.rectify(alpha)
        for pair in zip(boards.left_px, boards.right_px, strict=True):
            squares.append(abs(board_size_error_pct(board_points_mm(rectified, *pair), board)[0]))
    edge_mm, distance_mm = true_mm
    return {
        "squares_pct": float(np.mean(squares)),
        "distance_pct": float(100 * abs(cube.near_mm[0] / distance_mm - 1)),
        "width_pct": float(100 * abs(corner_width_mm(cube) / (np.sqrt(2) * edge_mm) - 1)),
    }


def partner_offsets_px(
    disparity_px: Floats, rectified: RectifiedRig, left: Camera, right: Camera
) -> tuple[Float64, Float64]:
    """Carry a known disparity from rectified images to images of the same scene that are not.

    Parameters
    ----------
    disparity_px : (H, W) float
        Of the rectified left image; NaN where unknown, or where the right camera does not see the point.
    rectified : RectifiedRig
    left, right : Camera
        What projects into the other images: the rig's own cameras for recorded ones, the same without coefficients for
        undistorted ones.

    Returns
    -------
    columns, rows : (H, W) float64, px
        Column and row of each pixel of the other left image, less those of its true partner in the other right one; NaN
        where unknown or outside. A matcher along rows can find the first only where the second is about zero.

    Notes
    -----
    Each pixel's ray, turned by R1, gives a pixel of the rectified left image, whose nearest disparity gives the point
    (`RectifiedRig.triangulate`); the point goes back by R1', on by R and T, and through the right camera.
    """
    width, height = left.size
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).reshape(-1, 2).astype(float)
    rays = left.rays(pixels) @ rectified.R1.T
    on_rectified = rays[:, :2] / rays[:, 2:] @ rectified.P1[:2, :2].T + rectified.P1[:2, 2]
    at = np.rint(np.nan_to_num(on_rectified, nan=-1.0)).astype(int)
    known: Bools = np.all((at >= 0) & (at < rectified.size), axis=1)
    disparity = np.full(len(pixels), np.nan)
    disparity[known] = np.asarray(disparity_px)[at[known, 1], at[known, 0]]
    points = rectified.triangulate(on_rectified, disparity) @ rectified.R1
    partners = right.project(points @ rectified.rig.R.T + rectified.rig.T)
    partners[~np.all((partners >= 0) & (partners <= np.array(right.size) - 1), axis=1)] = np.nan
    columns, rows = (pixels - partners).T
    return columns.reshape(height, width), rows.reshape(height, width)


def rectification_gain(recorded: Score, undistorted: Score, rectified: Score) -> dict[str, float]:
    """Compare how many pixels are wrong in maps matched with and without rectification.

    Parameters
    ----------
    recorded, undistorted, rectified : Score
        Of one scene and one setting, each against its own truth.

    Returns
    -------
    dict
        ``recorded_times``, ``undistorted_times``: ratios of `bad2_pct` to that of the rectified pair, which counts as
        at least 0.1 %; ``recorded_pct``: `bad2_pct` of the recorded pair.
    """
    least = max(rectified.bad2_pct, _LEAST_WRONG_PCT)
    return {
        "recorded_times": recorded.bad2_pct / least,
        "undistorted_times": undistorted.bad2_pct / least,
        "recorded_pct": recorded.bad2_pct,
    }
