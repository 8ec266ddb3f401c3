"""Where the paper's camera stood: what its printed set-up would show, and the pitch or height that fits its picture."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np

from stereolib.base import Float64
from stereolib.paper.printed_values import assumed, printed_item, printed_value
from stereolib.rig import RectifiedRig, pose_left_world, rigid

_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0}
_MOST_PITCH_DEG = 45.0  # either way: beyond it a camera shows floor or ceiling
_MOST_HEIGHT = 2.0  # of the camera, in distances to the cube: beyond it a level camera sees it at its lower border
_LEAST_HEIGHT_MM = 1.0
_SETTLED = 1e-12  # where the search ends: rad or mm


@dataclass(frozen=True)
class CubeSetup:
    """A cube edge-on before the camera: its near vertical edge straight ahead, on the floor."""

    side_mm: float
    distance_mm: float
    camera_height_mm: float
    constant_rows: float


@dataclass(frozen=True)
class CubeView:
    """What a camera sees of the cube, in pixels of the rectified left image.

    ``width_px`` is that of the bounding rectangle, corner to corner; ``constant_rows`` the rows
    from the foot of the near edge to the bottom of the image; rows may lie outside the image.
    ``depth_side_mm`` is the depth of the two corners between which the width is counted, ``depth_side_end_mm`` that
    of the other ends of these upright edges.
    """

    pitch_rad: float
    camera_height_mm: float
    foot_row: float
    top_row: float
    column: float
    constant_rows: float
    width_px: float
    depth_side_mm: float
    depth_side_end_mm: float
    disparity_foot_px: float
    disparity_top_px: float
    T_left_world: Float64

    @property
    def edge_rows(self) -> float:
        """Rows that the near edge spans, px."""
        return self.foot_row - self.top_row

    @property
    def box_px(self) -> float:
        """Width of the bounding rectangle in pixels counted, first and last: one more than between the corners."""
        return self.width_px + 1


def paper_setup() -> CubeSetup:
    """The printed set-up in millimetres (II.C, II.F); the camera height's unit is assumed.

    Returns
    -------
    CubeSetup

    Examples
    --------
    >>> paper_setup()
    CubeSetup(side_mm=300.0, distance_mm=700.0, camera_height_mm=85.0, constant_rows=53)
    """
    side, distance = printed_item("setup.cube"), printed_item("setup.distance")
    return CubeSetup(
        side_mm=side.value[0] * _MM[side.unit],
        distance_mm=distance.value * _MM[distance.unit],
        camera_height_mm=printed_value("setup.camera_height") * _MM[assumed()["camera_height_unit"]],
        constant_rows=printed_value("height.constant_rows"),
    )


def left_level_roll(rectified: RectifiedRig) -> float:
    """Tell by how much the rectified pictures roll if not the rig's baseline is held level, but its left camera.

    Parameters
    ----------
    rectified : RectifiedRig

    Returns
    -------
    float, rad
        As ``roll_rad`` of `rig_pose`.

    Examples
    --------
    >>> from stereolib.paper import paper_rig
    >>> round(float(np.degrees(left_level_roll(paper_rig().rectify()))), 2)
    0.79
    """
    return float(np.arctan2(rectified.R1[1, 0], rectified.R1[0, 0]))


def rig_pose(rectified: RectifiedRig, pitch_rad: float, camera_height_mm: float, *, roll_rad: float = 0.0) -> Float64:
    """Pose ``T_left_world`` of a rig that looks along the world's x axis.

    The rig's baseline (the rectified camera) is held level across, pitched, and rolled; the left camera itself is
    turned against it by about a degree (`left_level_roll`).

    Parameters
    ----------
    rectified : RectifiedRig
    pitch_rad : float, rad
        Upwards.
    camera_height_mm : float, mm
        Of the left optical centre.
    roll_rad : float, rad
        About the axis of the rectified camera; what is shown turns clockwise.

    Returns
    -------
    (4, 4) float64

    Examples
    --------
    >>> from stereolib.paper import paper_rig
    >>> pose = rig_pose(paper_rig().rectify(), pitch_rad=0.0, camera_height_mm=85.0)
    >>> (np.linalg.inv(pose)[:3, 3].round(6) + 0.0).tolist()
    [0.0, 0.0, 85.0]
    """
    return np.asarray(_turn(rectified, roll_rad) @ pose_left_world(pitch_rad, camera_height_mm))


def _turn(rectified: RectifiedRig, roll_rad: float) -> Float64:
    """From a rolled rectified camera into the left camera, (4, 4)."""
    return rigid(rectified.R1.T @ cv2.Rodrigues(np.array([0.0, 0.0, roll_rad]))[0], np.zeros(3))


def cube_view(
    rectified: RectifiedRig,
    setup: CubeSetup,
    *,
    pitch_rad: float = 0.0,
    camera_height_mm: float | None = None,
    roll_rad: float = 0.0,
) -> CubeView:
    """Project the cube of a set-up into the rectified left image.

    Parameters
    ----------
    rectified : RectifiedRig
    setup : CubeSetup
    pitch_rad : float, rad
        Upwards.
    camera_height_mm : float, mm, optional
        Default: the set-up's.
    roll_rad : float, rad
        As of `rig_pose`.

    Returns
    -------
    CubeView

    Raises
    ------
    ValueError
        If part of the cube lies behind the camera.
    """
    height = setup.camera_height_mm if camera_height_mm is None else camera_height_mm
    pose = rig_pose(rectified, pitch_rad, height, roll_rad=roll_rad)
    return _views(rectified, setup.side_mm, [_Placed(pitch_rad, height, setup.distance_mm, pose)])[0]


class _Placed(NamedTuple):
    """Where a camera stands before the cube."""

    pitch_rad: float
    camera_height_mm: float
    distance_mm: float
    T_left_world: Float64


def _views(rectified: RectifiedRig, side_mm: float, placed: Sequence[_Placed]) -> list[CubeView]:
    """What each camera sees of the cube, as `cube_view`."""
    half = side_mm / np.sqrt(2)  # of the diagonal
    ground = [[0, 0], [half, half], [half, -half], [2 * half, 0]]
    cube = np.array([[x, y, z] for z in (0, side_mm) for x, y in ground])  # the four feet, then the four tops
    pose = np.array([each.T_left_world for each in placed])
    corners = cube + np.array([[[each.distance_mm, 0, 0]] for each in placed])
    points = (corners @ pose[:, :3, :3].swapaxes(1, 2) + pose[:, None, :3, 3]) @ rectified.R1.T
    for each, in_front in zip(placed, (points[..., 2] > 0).all(axis=1), strict=True):
        if not in_front:
            raise ValueError(f"part of the cube is behind a camera pitched {np.degrees(each.pitch_rad):.1f} deg")
    u, v = np.moveaxis(points @ rectified.P1[:2, :3].T, -1, 0) / points[..., 2]
    disparity = rectified.f_px * rectified.baseline_mm / points[..., 2]
    which, side = np.arange(len(placed)), u.argmax(axis=1)
    found = {
        "foot_row": v[:, 0], "top_row": v[:, 4], "column": u[:, 0], "constant_rows": rectified.size[1] - v[:, 0],
        "width_px": np.ptp(u, axis=1), "depth_side_mm": points[which, side, 2],
        "depth_side_end_mm": points[which, (side + 4) % 8, 2],
        "disparity_foot_px": disparity[:, 0], "disparity_top_px": disparity[:, 4],
    }  # fmt: skip
    rows = zip(*(values.tolist() for values in found.values()), strict=True)
    return [
        CubeView(
            each.pitch_rad, each.camera_height_mm, T_left_world=each.T_left_world, **dict(zip(found, row, strict=True))
        )
        for each, row in zip(placed, rows, strict=True)
    ]


def solve_pitch(rectified: RectifiedRig, setup: CubeSetup) -> CubeView:
    """The upward pitch at which the cube's foot stands ``setup.constant_rows`` above the bottom.

    Parameters
    ----------
    rectified : RectifiedRig
    setup : CubeSetup

    Returns
    -------
    CubeView
        With that pitch.

    Raises
    ------
    ValueError
        If no pitch within 45 degrees does.

    Examples
    --------
    >>> from stereolib.paper import paper_rig
    >>> round(float(np.degrees(solve_pitch(paper_rig().rectify(), paper_setup()).pitch_rad)), 2)
    8.27
    """
    most = np.radians(_MOST_PITCH_DEG)
    return _solve(rectified, setup, "pitch_rad", (-most, most))


def solve_camera_height(rectified: RectifiedRig, setup: CubeSetup) -> CubeView:
    """The height at which a level camera sees the foot ``setup.constant_rows`` above the bottom.

    Parameters
    ----------
    rectified : RectifiedRig
    setup : CubeSetup

    Returns
    -------
    CubeView
        With that height.

    Raises
    ------
    ValueError
        If no height up to twice the distance does.

    Examples
    --------
    >>> from stereolib.paper import paper_rig
    >>> round(solve_camera_height(paper_rig().rectify(), paper_setup()).camera_height_mm)
    190
    """
    return _solve(rectified, setup, "camera_height_mm", (_LEAST_HEIGHT_MM, _MOST_HEIGHT * setup.distance_mm))


def setups_in_print(*, end_px: float = 1.0) -> list[CubeSetup]:
    """The printed set-up at the ends of what its digits leave open: nine corners.

    Parameters
    ----------
    end_px : float, px
        How well the row of the foot is found.

    Returns
    -------
    list of CubeSetup
        The distance as printed and half of its last digit to either side; the rows as printed and `end_px` to either
        side, each with each.

    Examples
    --------
    >>> sorted({setup.distance_mm for setup in setups_in_print()})
    [695.0, 700.0, 705.0]
    """
    setup, item = paper_setup(), printed_item("setup.distance")
    half_mm = 0.5 * 10.0 ** -float(np.max(item.digits)) * _MM[item.unit]
    return [
        replace(setup, distance_mm=setup.distance_mm + a * half_mm, constant_rows=setup.constant_rows + b * end_px)
        for a in (-1, 0, 1)
        for b in (-1, 0, 1)
    ]


def setup_family(
    rectified: RectifiedRig,
    setup: CubeSetup,
    camera_heights_mm: Iterable[float],
    *,
    to_point: bool = False,
    roll_rad: float = 0.0,
) -> list[CubeView]:
    """Every camera that sees the cube's foot where it was printed: to each height belongs one pitch.

    Parameters
    ----------
    rectified : RectifiedRig
    setup : CubeSetup
    camera_heights_mm : iterable of float, mm
    to_point : bool
        The set-up's distance leads to the nearest *point* of the near edge, which for a camera above the cube is its
        top, so that the cube stands nearer on the floor. By default it is the distance to the edge's line.
    roll_rad : float, rad
        As of `rig_pose`.

    Returns
    -------
    list of CubeView

    Raises
    ------
    ValueError
        If a camera stands so high that part of the cube is behind it, or farther above the cube than the distance.

    Notes
    -----
    ``pitch = arctan((H - c - cy) / (f cos(roll))) - arctan(h / D)``, upwards.

    Examples
    --------
    >>> from stereolib.paper import paper_rig
    >>> low, high = setup_family(paper_rig().rectify(), paper_setup(), [85.0, 300.0])
    >>> round(float(np.degrees(low.pitch_rad)), 2), round(float(np.degrees(high.pitch_rad)), 2)
    (8.27, -8.01)
    """
    below_axis = (rectified.size[1] - setup.constant_rows - rectified.P1[1, 2]) / rectified.P1[1, 1] / np.cos(roll_rad)
    turn, placed = _turn(rectified, roll_rad), list[_Placed]()
    for height in camera_heights_mm:
        above = max(0.0, height - setup.side_mm) if to_point else 0.0
        if above >= setup.distance_mm:
            raise ValueError(f"a camera {height:g} mm up is farther from the cube than {setup.distance_mm:g} mm")
        near_mm = math.sqrt(setup.distance_mm**2 - above**2)
        pitch_rad = math.atan(below_axis) - math.atan2(height, near_mm)
        placed.append(_Placed(pitch_rad, height, near_mm, turn @ pose_left_world(pitch_rad, height)))
    return _views(rectified, setup.side_mm, placed) if placed else []


def _solve(rectified: RectifiedRig, setup: CubeSetup, name: str, span: tuple[float, float]) -> CubeView:
    """The view whose argument `name`, within `span`, puts the foot where it was printed."""
    from scipy.optimize import brentq

    def view(x: float) -> CubeView:
        return cube_view(rectified, setup, **{name: x})

    def miss(x: float) -> float:
        return view(x).constant_rows - setup.constant_rows

    if miss(span[0]) * miss(span[1]) > 0:
        raise ValueError(
            f"no {name} from {span[0]:.3g} to {span[1]:.3g} puts the foot {setup.constant_rows:g} rows above the bottom"
        )
    return view(brentq(miss, *span, xtol=_SETTLED))
