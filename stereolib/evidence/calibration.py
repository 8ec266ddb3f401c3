"""What notebook 01 holds against the paper: cameras found again, printed numbers, equations, two ways to calibrate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from stereolib import paper
from stereolib.base import Float64, Floats
from stereolib.calibration import (
    BoardViews,
    HoldOut,
    RigFit,
    calibrate_stereo,
    hold_out_rigs,
    moved_rig,
    rig_difference,
    triangulate,
)
from stereolib.rig import Camera, StereoRig

if TYPE_CHECKING:
    import pandas as pd

_STDS = 4.0  # a number farther off its true value than this is not scatter
_STEP_STDS = 0.01  # of a parameter, for derivatives: far above rounding, far below bends
_GRID_PX = 40  # points at which depths are asked
_IMAGE_PX = 8  # points at which the printed equation is asked
_DENOMINATOR = (0.1, -0.05, 0.02)  # k4 to k6 of a lens on which the printed denominator is tried
_PIXEL_SHIFTS = (0.5, 1.0)  # between the pixels of Table I and of F: half a pixel, and counting from 1
_COLUMNS = ["way", "R off by (mrad)", "T off by (mm)", "depths off by (mm)"]
_WAYS = {"all parameters together": False, "two parts, lenses held": True}  # and whether the lenses are held
_SKEW_PX = -0.5  # of the right camera matrix: Table I prints none


def recovery_tolerances(rig: StereoRig, covariance: Float64, truth: StereoRig) -> dict[str, Float64]:
    """Tell how far a calibrated rig may lie from the printed one, by its own covariance.

    Parameters
    ----------
    rig : StereoRig
    covariance : (s, s) float64
        From `rig_covariance`.
    truth : StereoRig
        The rig that took the pictures.

    Returns
    -------
    dict of id to float64
        For every id of `paper.printed_form`, in its shape and unit, rounded up to two digits.

    Notes
    -----
    ``4 sqrt(diag(J C J'))`` with J the derivatives of the printed numbers by the parameters, by central differences;
    plus ``|printed_form(truth) - printed|``, by which the truth itself, whose R is an exact rotation, differs.
    """
    stds = np.sqrt(np.diag(covariance))
    steps = _STEP_STDS * np.diag(stds)
    forms = [[paper.printed_form(moved_rig(rig, sign * step)) for sign in (1, -1)] for step in steps]
    tolerances = {}
    for id, true in paper.printed_form(truth).items():
        J = np.array([(np.asarray(up[id]) - np.asarray(down[id])) for up, down in forms])
        J /= (2 * _STEP_STDS * stds).reshape(-1, *(1,) * (J.ndim - 1))
        variance = np.einsum("i...,ij,j...->...", J, covariance, J)
        off = np.abs(np.asarray(true) - np.asarray(paper.printed_value(id)))
        tolerances[id] = _rounded_up(_STDS * np.sqrt(variance) + off)
    return tolerances


def _rounded_up(values: Float64) -> Float64:
    """Each positive number to two digits, upwards."""
    unit = 10.0 ** (np.floor(np.log10(np.maximum(values, 1e-300))) - 1)
    return np.asarray(np.ceil(values / unit) * unit)


def projection_restored() -> dict[str, float]:
    """Hold the printed projection, its squares restored, against OpenCV's.

    Returns
    -------
    dict
        ``restored_px``: largest difference over the images of Table I's cameras and of one with a denominator, px.

    Examples
    --------
    >>> projection_restored()["restored_px"] < 1e-9
    True
    """
    rig = paper.paper_rig()
    divided = Camera(rig.left.K, np.append(rig.left.dist, _DENOMINATOR), rig.left.size)
    return {"restored_px": max(_beside_opencv_px(c, squares=True) for c in (rig.left, rig.right, divided))}


def projection_as_printed(rig: StereoRig) -> dict[str, float]:
    """Hold the projection equation, letter by letter, against OpenCV's.

    Parameters
    ----------
    rig : StereoRig

    Returns
    -------
    dict
        ``left_px``, ``right_px``: largest distance over the image of each camera, px.
    """
    return {"left_px": _beside_opencv_px(rig.left), "right_px": _beside_opencv_px(rig.right)}


def _beside_opencv_px(camera: Camera, *, squares: bool = False) -> float:
    """Largest distance over the image between the paper's equation and `cv2.projectPoints`, px."""
    xy = _image_directions(camera)
    points = np.column_stack([xy, np.ones(len(xy))])
    known, _ = cv2.projectPoints(points[:, None], np.zeros(3), np.zeros(3), camera.K, camera.dist)
    off = paper.printed_projection(camera, xy, squares=squares) - known[:, 0]
    return float(np.hypot(*off.T).max())


def pinhole_misses(rig: StereoRig) -> dict[str, float]:
    """Tell how far lenses bend away from the pinholes that come nearest to them.

    Parameters
    ----------
    rig : StereoRig

    Returns
    -------
    dict
        ``edge_px``, ``corner_px``: distance between lens and pinhole in the middles of the rims and in the corners,
        the largest of both cameras, px.

    Notes
    -----
    Least squares of ``u = fx x + cx`` and ``v = fy y + cy`` over the image, with ``(x, y)`` the directions of its
    pixels. A corner has no direction where the lens folds over, so the directions at the rims are the pinhole's.
    """
    misses: list[list[float]] = []
    for camera in (rig.left, rig.right):
        xy, last = _image_directions(camera), np.array(camera.size) - 1
        uv = camera.project(np.column_stack([xy, np.ones(len(xy))]))
        (fx, cx), (fy, cy) = (np.polyfit(xy[:, k], uv[:, k], 1) for k in (0, 1))
        rims = np.array([[0, 0.5], [1, 0.5], [0.5, 0], [0.5, 1], [0, 0], [1, 0], [0, 1], [1, 1]]) * last
        seen = camera.project(np.column_stack([(rims - [cx, cy]) / [fx, fy], np.ones(len(rims))]))
        off = np.hypot(*(seen - rims).T)
        misses.append([off[:4].max(), off[4:].max()])
    edge, corner = np.max(misses, axis=0)
    return {"edge_px": float(edge), "corner_px": float(corner)}


def principal_points_beside(rig: StereoRig) -> dict[str, float]:
    """Tell how far principal points stand from the centre of their images.

    Parameters
    ----------
    rig : StereoRig

    Returns
    -------
    dict
        ``left_px``, ``right_px``: distance from ``((width - 1) / 2, (height - 1) / 2)``, px.

    Examples
    --------
    >>> {side: round(off, 1) for side, off in principal_points_beside(paper.paper_rig()).items()}
    {'left_px': 13.7, 'right_px': 22.2}
    """
    return {
        name: float(np.linalg.norm(camera.K[:2, 2] - (np.array(camera.size) - 1) / 2))
        for name, camera in (("left_px", rig.left), ("right_px", rig.right))
    }


def _image_directions(camera: Camera) -> Float64:
    """Ideal coordinates of a grid of a camera's pixels, corners included; without those that have none. (N, 2)."""
    across = [np.append(np.arange(0, n - 1, _IMAGE_PX), n - 1) for n in camera.size]
    rays = camera.rays(np.stack(np.meshgrid(*across), -1).reshape(-1, 2))
    return np.asarray(rays[np.isfinite(rays[:, 0]), :2])


def denominator_gain(results: Sequence[HoldOut]) -> dict[str, float]:
    """Tell by how much a denominator lowers the error on boards left out.

    Parameters
    ----------
    results : sequence of HoldOut
        From `hold_out_errors`; ``brown3`` and ``rational8`` among them.

    Returns
    -------
    dict
        ``less_pct``: ``100 (1 - rms(rational8) / rms(brown3))``, %.

    Examples
    --------
    >>> lenses = [HoldOut("brown3", 5, 0.05, 0.06), HoldOut("rational8", 8, 0.05, 0.057)]
    >>> round(denominator_gain(lenses)["less_pct"], 1)
    5.0
    """
    rms = {result.model: result.hold_out_rms_px for result in results}
    return {"less_pct": 100 * (1 - rms["rational8"] / rms["brown3"])}


def pose_by_words() -> dict[str, float]:
    """Take the printed R and T at the paper's word: camera 2's axes seen from camera 1, and the way to its centre.

    Returns
    -------
    dict
        ``axes``: miss of the printed E over what the digits allow; ``place_mm``: how far to the right of the left
        camera the right one would stand, mm.
    """
    return {"axes": paper.essential_miss("paper"), "place_mm": float(paper.printed_value("stereo.T")[0])}


def translation_between_principal_points() -> dict[str, float]:
    """Tell how large pixels may be if the printed T leads from principal point to principal point.

    Returns
    -------
    dict
        ``pixel_um``: the largest size at which the printed digits still allow ``E t = 0``, micrometres.

    Notes
    -----
    With pixels of size s the principal points stand ``s f_L e_z`` and ``s f_R R e_z`` before the centres (R's columns
    are camera 2's axes), so that the centres are ``t = T +- s v`` apart, ``v = f_R R e_z - f_L e_z``; the sign is that
    of T's direction, and the one that allows more is taken. ``|E T +- s E v|`` must keep within the digits of E and T.
    """
    E, T, R = (np.array(paper.printed_value(f"stereo.{name}")) for name in "ETR")
    wide_E, wide_T = (paper.printed_half_width(f"stereo.{name}") for name in "ET")
    budget = paper.product_half_width((E, wide_E), (T[:, None], wide_T[:, None]))[:, 0]
    f_left, f_right = (paper.printed_value(f"table1.{side}.fx") for side in ("left", "right"))
    at_zero, slope = E @ T, E @ (f_right * R[:, 2] - f_left * np.array([0, 0, 1]))
    most_mm = max(((budget - np.sign(way * slope) * at_zero) / np.abs(slope)).min() for way in (1, -1))
    return {"pixel_um": 1e3 * float(most_mm)}


def pose_readings() -> pd.DataFrame:
    """Lay out which reading of the printed R and T gives the printed E, and what other printed numbers say.

    Returns
    -------
    DataFrame
        A row per reading: what it says, what should vanish or agree, by how much it does not, and that over what the
        printed digits allow (up to 1 is rounding).
    """
    import pandas as pd

    E, T = (np.array(paper.printed_value(f"stereo.{name}")) for name in "ET")
    wide_E, wide_T = (paper.printed_half_width(f"stereo.{name}") for name in "ET")
    rows = []
    for name, reading, formula in (
        ("opencv", "x2 = R x1 + T (OpenCV)", "skew(T) R = E"),
        ("rows", "x2' = x1' R + T' (row vectors, as MATLAB)", "skew(T) R' = E"),
        ("paper", "x2 = R' (x1 + T): R holds camera 2's axes", "R' skew(T) = E"),
    ):
        miss = float(np.abs(paper.printed_essential(name) - E).max())
        rows.append((reading, formula, miss, paper.essential_miss(name)))
    for reading, formula, factors in (
        ("T stands in camera 2's frame", "T' E = 0", ((T[None], wide_T[None]), (E, wide_E))),
        ("T stands in camera 1's frame", "E T = 0", ((E, wide_E), (T[:, None], wide_T[:, None]))),
    ):
        miss = np.abs(factors[0][0] @ factors[1][0])
        rows.append(
            (reading, formula, float(miss.max()), paper.within_budget(miss, paper.product_half_width(*factors)))
        )
    return pd.DataFrame(rows, columns=["reading", "should hold", "misses by", "times the digits"])


def fundamental_from_pose() -> Float64:
    """Make F of the printed R, T and Table I as they stand, without the printed E.

    Returns
    -------
    (3, 3) float64
        ``inv(K_R)' R' skew(T) inv(K_L)``, not normalised.

    Examples
    --------
    >>> float(fundamental_from_pose()[2, 2].round(4))
    0.625
    """
    right, left = (np.linalg.inv(paper.printed_camera_matrix(side)) for side in ("right", "left"))
    return np.asarray(right.T @ paper.printed_essential() @ left)


def fundamental_readings() -> pd.DataFrame:
    """Lay out what would make the printed F agree with the printed E, R, T and Table I.

    Returns
    -------
    DataFrame
        A row per reading: F33, and the largest miss of F over what the printed digits allow (up to 1 is rounding).

    Notes
    -----
    Pixels shifted by s between Table I and F: ``S' F S`` with ``S = [[1, 0, s], [0, 1, s], [0, 0, 1]]``. A skew k
    stands in the first row of the right camera matrix, ``u = fx x + k y + cx``.
    """
    import pandas as pd

    right, left = (paper.printed_camera_matrix(side) for side in ("right", "left"))
    E, F = (np.array(paper.printed_value(f"stereo.{name}")) for name in "EF")
    plain = paper.printed_fundamental()
    readings = {"as printed": plain}
    for shift in _PIXEL_SHIFTS:
        S = np.eye(3)
        S[:2, 2] = shift
        readings[f"pixels of F and Table I {shift:g} px apart"] = S.T @ plain @ S
    skewed = right + _SKEW_PX * np.outer([1, 0, 0], [0, 1, 0])
    readings[f"a skew of {_SKEW_PX:g} px in the right camera"] = np.linalg.inv(skewed).T @ E @ np.linalg.inv(left)
    readings["E made of the printed, rounded R and T"] = fundamental_from_pose()
    readings["cameras exchanged"] = paper.printed_fundamental("left-right")
    swapped = [K + (K[1, 1] - K[0, 0]) * np.diag([1, -1, 0]) for K in (right, left)]
    readings["fx and fy exchanged"] = np.linalg.inv(swapped[0]).T @ E @ np.linalg.inv(swapped[1])
    budget = paper.fundamental_budget()
    rows = [(name, G[2, 2], paper.within_budget(G - F, budget)) for name, G in readings.items()]
    return pd.DataFrame(rows, columns=["reading", "F33", "times the digits"])


def joint_and_two_parts(views: BoardViews, truth: StereoRig, depths_mm: Floats, at_mm: float = 700.0) -> pd.DataFrame:
    """Calibrate jointly and in the paper's two parts, and hold both against the rig that took the pictures.

    Parameters
    ----------
    views : BoardViews
    truth : StereoRig
    depths_mm : (n,) float64
        True depth of each board's centre in the left camera.
    at_mm : float
        Depth to which the errors of the boards' depths are scaled, by ``(at / Z)^2``.

    Returns
    -------
    DataFrame
        A row a way: angle between R and the true one (mrad), distance between T and the true one (mm), rms error of the
        depths of boards that were left out (mm).
    """
    import pandas as pd

    known, rows = dict(zip(views.names, np.asarray(depths_mm, float), strict=True)), []
    for way, fixed in _WAYS.items():
        errors = []
        for rig, boards in hold_out_rigs(views, fixed=fixed):
            for name, left_px, right_px in zip(boards.names, boards.left_px, boards.right_px, strict=True):
                depth = triangulate(rig, left_px, right_px)[:, 2].mean()
                errors.append((depth - known[name]) * (at_mm / known[name]) ** 2)
        rig = calibrate_stereo(views, fixed=fixed).rig
        rows.append((way, *_off(rig, truth), float(np.sqrt(np.mean(np.square(errors))))))
    return pd.DataFrame(rows, columns=_COLUMNS)


def joint_and_two_parts_redrawn(
    views: BoardViews, fitted: RigFit, rng: np.random.Generator, *, draws: int = 20, at_mm: float = 700.0
) -> pd.DataFrame:
    """Draw the corners' noise anew, many times, and calibrate jointly and in two parts each time.

    Parameters
    ----------
    views : BoardViews
    fitted : RigFit
        Of these views: its rig is the truth, its residuals' deviation the noise.
    rng : numpy.random.Generator
    draws : int
    at_mm : float
        Depth of the points, all over the left image, whose depths are compared.

    Returns
    -------
    DataFrame
        As `joint_and_two_parts`, rms over the draws.
    """
    import pandas as pd

    truth = fitted.rig
    width, height = truth.left.size
    pixels = np.stack(np.meshgrid(np.arange(0, width, _GRID_PX), np.arange(0, height, _GRID_PX)), -1).reshape(-1, 2)
    points = truth.left.rays(pixels, clamp=True) * at_mm
    seen = truth.left.project(points), truth.right.project(points @ truth.R.T + truth.T)
    inside = np.all((seen[1] >= 0) & (seen[1] < truth.right.size), axis=1)
    found: dict[str, list[tuple[float, ...]]] = {way: [] for way in _WAYS}
    for _ in range(draws):
        drawn = redrawn_corners(views, fitted, rng)
        for way, fixed in _WAYS.items():
            rig = calibrate_stereo(drawn, fixed=fixed).rig
            depth = triangulate(rig, seen[0][inside], seen[1][inside])[:, 2]
            found[way].append((*_off(rig, truth), float(np.sqrt(np.nanmean((depth - at_mm) ** 2)))))
    rows = [(way, *np.sqrt(np.mean(np.square(kept), axis=0))) for way, kept in found.items()]
    return pd.DataFrame(rows, columns=_COLUMNS)


def redrawn_corners(views: BoardViews, fitted: RigFit, rng: np.random.Generator) -> BoardViews:
    """Put a fit's own corners in place of the found ones, with normal noise of its residuals' size.

    Parameters
    ----------
    views : BoardViews
    fitted : RigFit
        Of these views.
    rng : numpy.random.Generator

    Returns
    -------
    BoardViews
    """
    corners = np.stack([views.left_px, views.right_px], 1) - fitted.residuals_px
    left, right = (corners + rng.normal(0, fitted.sigma_px, corners.shape)).astype(np.float32).swapaxes(0, 1)
    return replace(views, left_px=left, right_px=right)


def _off(rig: StereoRig, truth: StereoRig) -> tuple[float, float]:
    """Angle between the two R (mrad), and distance between the two T (mm)."""
    step = rig_difference(rig, truth)[-6:]
    return 1e3 * float(np.linalg.norm(step[:3])), float(np.linalg.norm(step[3:]))
