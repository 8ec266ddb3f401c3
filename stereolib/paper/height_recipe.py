"""The height of an object from its disparity: the paper's method, and the cure for its error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stereolib.base import Bools, Float64, Floats
from stereolib.matching import dilate
from stereolib.rig import RectifiedRig

_MM_PER_CM = 10.0


@dataclass(frozen=True, eq=False)
class HeightResult:
    """What the paper's Fig. 7 and 8 show.

    ``mask`` (H, W) bool holds the pixels of maximum disparity; ``top_row`` is the first row that
    has one, ``column`` its first column there, ``disparity_px`` its disparity; ``foot_row`` is the
    row below the object's lower end, so that ``height_px = foot_row - top_row``; ``threshold_px``
    the least disparity that counted.
    """

    top_row: int
    column: int
    disparity_px: float
    foot_row: int
    height_px: int
    height_mm: float
    threshold_px: float
    mask: Bools


def height_by_maximum(
    disparity_px: Floats,
    cm_per_px: float,
    constant_rows: int,
    *,
    tolerance_px: float = 0.0,
    threshold_px: float | None = None,
    dilate_px: int = 1,
) -> HeightResult:
    """Height from the topmost pixel of maximum disparity (sections II.F and III).

    Parameters
    ----------
    disparity_px : (H, W) float, px
        Of the rectified left image, NaN where invalid.
    cm_per_px : float, cm/px
        The paper's constant scale.
    constant_rows : int
        Rows from the bottom of the image to the object's lower end; they are cut off.
    tolerance_px : float
        How far below the maximum a disparity still counts.
    threshold_px : float, optional
        The least disparity that counts, whatever the maximum is; `tolerance_px` is then not used.
    dilate_px : odd int
        Side of the square kernel of the dilation before (`stereolib.matching.dilate`); 1 is none.

    Returns
    -------
    HeightResult

    Raises
    ------
    ValueError
        If the map is not (H, W) floats, has no valid pixel above the constant, has only negative
        ones (left and right exchanged), none that reaches the threshold, or a parameter is out of range.

    Notes
    -----
    ``height = (H - constant_rows - top_row) cm_per_px``, with ``top_row`` the first row of
    ``d >= max(d) - tolerance``. The paper speaks of a threshold and prints none. Where it breaks:

    - A camera pitched up sees the top of a vertical edge farther away: its disparity falls from
      foot to top (6.2 px where it stands at the printed height), and a strict maximum marks the foot alone.
    - The floor in front is nearer than the object. ``constant_rows`` removes it at one distance
      only; dilation brings it back by half a kernel.
    - One bright speckle above the object is the maximum of everything.
    - The scale belongs to one depth. The paper's is that of the side corners; at the near edge, seen
      from the printed height, it reads a quarter too much (`height_from_depth` does not).

    Examples
    --------
    >>> disparity = np.full((8, 6), 10.0)
    >>> disparity[2:6, 3] = 20.0
    >>> height_by_maximum(disparity, cm_per_px=0.1, constant_rows=2).height_mm
    4.0
    """
    disparity: Floats = _checked(disparity_px)
    rows = disparity.shape[0]
    if not 0 <= constant_rows < rows or constant_rows != int(constant_rows):
        raise ValueError(f"constant_rows must be whole, 0 to {rows - 1}, got {constant_rows}")
    if not (cm_per_px > 0 and tolerance_px >= 0):
        raise ValueError(f"need scale > 0 and tolerance >= 0, got {cm_per_px} and {tolerance_px}")
    if dilate_px != 1:
        disparity = dilate(disparity, dilate_px)
    filled = np.where(np.isfinite(disparity), disparity, -np.inf)
    foot_row = rows - int(constant_rows)
    crop = filled[:foot_row]
    maximum = crop.max()
    if not np.isfinite(maximum):
        raise ValueError(f"no valid disparity in the {foot_row} rows above the constant")
    if maximum <= 0:
        raise ValueError(f"all disparities are negative (at most {maximum:g} px): exchange the images")
    least = maximum - tolerance_px if threshold_px is None else threshold_px
    if maximum < least:
        raise ValueError(f"no disparity above the constant reaches {least:g} px: the largest is {maximum:g} px")
    mask = np.zeros(disparity.shape, bool)
    mask[:foot_row] = crop >= least
    top_row, column = np.argwhere(mask)[0]
    height_px = foot_row - int(top_row)
    return HeightResult(
        top_row=int(top_row),
        column=int(column),
        disparity_px=float(disparity[top_row, column]),
        foot_row=foot_row,
        height_px=height_px,
        height_mm=_MM_PER_CM * cm_per_px * height_px,
        threshold_px=float(least),
        mask=mask,
    )


def heights_over_tolerances(
    disparity_px: Floats, cm_per_px: float, constant_rows: int, tolerances_px: ArrayLike
) -> Float64:
    """What `height_by_maximum` reads at many tolerances, in one go.

    Parameters
    ----------
    disparity_px, cm_per_px, constant_rows
        As for `height_by_maximum`.
    tolerances_px : (N,) array_like, px

    Returns
    -------
    (N,) float64, mm

    Raises
    ------
    ValueError
        As `height_by_maximum`.

    Examples
    --------
    >>> disparity = np.array([[1.0], [8.0], [9.0], [10.0], [30.0]])
    >>> heights_over_tolerances(disparity, 0.1, 1, [0, 1, 2, 5]).tolist()
    [1.0, 2.0, 3.0, 3.0]
    """
    strict = height_by_maximum(disparity_px, cm_per_px, constant_rows)
    tolerances = np.asarray(tolerances_px, float)
    if not (tolerances >= 0).all():
        raise ValueError(f"need tolerances >= 0, got {tolerances.min()}")
    crop = np.where(np.isfinite(disparity_px), disparity_px, -np.inf)[: strict.foot_row].astype(np.float64)
    largest_above = np.maximum.accumulate(crop.max(axis=1))  # in a row or above it: it only grows downwards
    top_row = np.searchsorted(largest_above, strict.threshold_px - tolerances)
    return np.asarray(_MM_PER_CM * cm_per_px * (strict.foot_row - top_row))


def height_from_depth(
    rectified: RectifiedRig, T_left_world: Float64, column: float, row: float, disparity_px: float
) -> float:
    """Height above the floor of what one pixel shows, from its own depth.

    Parameters
    ----------
    rectified : RectifiedRig
    T_left_world : (4, 4) array
        Pose of the left camera over the floor (`rig_pose`).
    column, row : float, px
        In the rectified left image. The upper border of the top pixel is ``top_row - 0.5``, the foot's lower one
        ``foot_row - 0.5``.
    disparity_px : float, px
        At that pixel; NaN gives NaN.

    Returns
    -------
    float, mm

    Raises
    ------
    ValueError
        If the disparity is not positive.

    Notes
    -----
    ``X = Z K^-1 (u, v, 1)`` with ``Z = f B / d``, turned back by R1' and the pose; z is the height.
    """
    if disparity_px <= 0:
        raise ValueError(f"a disparity of {disparity_px:g} px has no depth before the camera")
    depth_mm = rectified.f_px * rectified.baseline_mm / disparity_px
    point = depth_mm * np.linalg.solve(rectified.P1[:, :3], [column, row, 1.0])
    left = rectified.R1.T @ point
    return float((T_left_world[:3, :3].T @ (left - T_left_world[:3, 3]))[2])


def height_of_top(rectified: RectifiedRig, T_left_world: Float64, recipe: HeightResult) -> float:
    """Height of the upper border of the pixel that `height_by_maximum` took for the top, from its own depth.

    Parameters
    ----------
    rectified : RectifiedRig
    T_left_world : (4, 4) array
        Pose of the left camera over the floor (`rig_pose`).
    recipe : HeightResult

    Returns
    -------
    float, mm
    """
    return height_from_depth(rectified, T_left_world, recipe.column, recipe.top_row - 0.5, recipe.disparity_px)


def _checked(disparity_px: Floats) -> Float64:
    disparity = np.asarray(disparity_px)
    if disparity.ndim != 2 or disparity.size == 0:
        raise ValueError(f"the disparity must be (rows, columns), got shape {disparity.shape}")
    if disparity.dtype.kind != "f":
        raise ValueError(
            f"the disparity is {disparity.dtype}: give float pixels with NaN for invalid ones "
            "(OpenCV's int16 is 16 times the disparity)"
        )
    if not np.isfinite(disparity).any():
        raise ValueError("the disparity map is empty: no pixel has a finite value")
    return disparity.astype(np.float64)
