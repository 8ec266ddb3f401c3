"""What notebook 02 holds against the paper: rows, sizes by the depth equation, and matching without rectification."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np

from stereolib.base import Bools, Float64, Floats, UInt8
from stereolib.calibration import Board, BoardViews, board_size_error_pct, epipolar_errors_px
from stereolib.matching import Score, SGBMParams, compute_disparity, score
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


def depth_errors_left_out(
    held_out: HeldOut, corners_mm: Mapping[str, Floats], alpha: float = 0.0
) -> tuple[Float64, Float64]:
    """Triangulate boards that the calibration has not seen, and hold each corner's depth against the true one.

    Parameters
    ----------
    held_out : sequence of (StereoRig, BoardViews)
        From `hold_out_rigs`: each rig with pairs that it has not seen.
    corners_mm : mapping of str to (N, 3) array, mm
        True corners by the pair's name, in the left camera's frame.
    alpha : float
        As `StereoRig.rectify`.

    Returns
    -------
    true_mm, error_mm : (corners,) float64, mm
        Depth along the left camera's axis, and ours less it.

    Notes
    -----
    A checkerboard may be found upside down; of both orders of its corners the one that fits is taken.
    """
    depths, errors = [], []
    for rig, boards in held_out:
        rectified = rig.rectify(alpha)
        for name, *pair in zip(boards.names, boards.left_px, boards.right_px, strict=True):
            found, true = board_points_mm(rectified, *pair) @ rectified.R1, np.asarray(corners_mm[name], float)
            if np.linalg.norm(found[0] - true[0]) > np.linalg.norm(found[0] - true[-1]):
                true = true[::-1]
            depths.append(true[:, 2])
            errors.append(found[:, 2] - true[:, 2])
    return np.concatenate(depths), np.concatenate(errors)


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


@dataclass(frozen=True, eq=False)
class Stage:
    """A pair as it came, or made ready, matched and held against its own truth.

    Attributes
    ----------
    left : (H, W, 3) uint8
    disparity_px : (H, W) float32, px
    columns_px, rows_px : (H, W) float64, px
        How far the true partner of each pixel stands away, in column and row; NaN where it is not known or not seen.
    """

    left: UInt8
    disparity_px: Floats
    columns_px: Float64
    rows_px: Float64

    @cached_property
    def score(self) -> Score:
        """The map against the true columns."""
        return score(self.disparity_px, self.columns_px)

    @property
    def wrong(self) -> Bools:
        """Pixels off by more than 2 px or empty, of those whose truth is known. (H, W) bool."""
        with np.errstate(invalid="ignore"):
            near = np.abs(self.disparity_px - self.columns_px) <= 2
        return np.asarray(self.counted & ~near)

    @property
    def counted(self) -> Bools:
        """Pixels whose truth is known. (H, W) bool."""
        return np.asarray(np.isfinite(self.columns_px))

    @property
    def rows_rms_px(self) -> float:
        """How far apart in row partners stand, px rms."""
        return float(np.sqrt(np.nanmean(self.rows_px**2)))


def match_stages(
    pair: tuple[UInt8, UInt8], rig: StereoRig, true: RectifiedRig, seen_px: Floats, params: SGBMParams
) -> dict[str, Stage]:
    """Match a pair with the same settings as recorded, undistorted only, and rectified.

    Parameters
    ----------
    pair : (left, right), (H, W, 3) uint8
        As recorded.
    rig : StereoRig
        As calibrated: it undistorts and rectifies.
    true : RectifiedRig
        The rig as it is.
    seen_px : (H, W) float, px
        True disparity in its rectified left image; NaN where the right camera does not see the point.
    params : SGBMParams
        For all three, but for the place of the search window: rectified it begins at 0.

    Returns
    -------
    dict of str to Stage
        ``"as recorded"``, ``"undistorted only"``, ``"rectified"``.
    """
    lenses = rig.left, rig.right
    undistorted = [cv2.undistort(image, c.K, c.dist) for image, c in zip(pair, lenses, strict=True)]
    pinholes = [Camera(c.K, np.zeros(0), c.size) for c in (true.rig.left, true.rig.right)]
    rows = np.where(np.isfinite(seen_px), 0.0, np.nan)
    known = {
        "as recorded": (pair, params, partner_offsets_px(seen_px, true, true.rig.left, true.rig.right)),
        "undistorted only": (undistorted, params, partner_offsets_px(seen_px, true, *pinholes)),
        "rectified": (
            rig.rectify().rectify(*pair),
            replace(params, min_disparity=0),
            (np.asarray(seen_px, float), rows),
        ),
    }
    return {
        name: Stage(images[0], compute_disparity(images[0], images[1], search, whole=True), *offsets)
        for name, (images, search, offsets) in known.items()
    }


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
        at least 0.1 %.
    """
    least = max(rectified.bad2_pct, _LEAST_WRONG_PCT)
    return {
        "recorded_times": recorded.bad2_pct / least,
        "undistorted_times": undistorted.bad2_pct / least,
    }
