"""Where the paper's camera stood: what its printed set-up would show, and the pitch or height that fits its picture."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

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
    roll = cv2.Rodrigues(np.array([0.0, 0.0, roll_rad]))[0]
    pose: Float64 = rigid(rectified.R1.T @ roll, np.zeros(3)) @ pose_left_world(pitch_rad, camera_height_mm)
    return pose


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
    half = setup.side_mm / np.sqrt(2)  # of the diagonal
    ground = [[0, 0], [half, half], [half, -half], [2 * half, 0]]
    corners = np.array([[setup.distance_mm + x, y, z] for z in (0, setup.side_mm) for x, y in ground])
    points = (corners @ pose[:3, :3].T + pose[:3, 3]) @ rectified.R1.T
    if not (points[:, 2] > 0).all():
        raise ValueError(f"part of the cube is behind a camera pitched {np.degrees(pitch_rad):.1f} deg")
    u, v = (points @ rectified.P1[:, :3].T)[:, :2].T / points[:, 2]
    disparity = rectified.f_px * rectified.baseline_mm / points[:, 2]
    return CubeView(
        pitch_rad=pitch_rad,
        camera_height_mm=height,
        foot_row=float(v[0]),
        top_row=float(v[4]),
        column=float(u[0]),
        constant_rows=float(rectified.size[1] - v[0]),
        width_px=float(np.ptp(u)),
        depth_side_mm=float(points[u.argmax(), 2]),
        depth_side_end_mm=float(np.roll(points, 4, axis=0)[u.argmax(), 2]),  # the four feet, then the four tops
        disparity_foot_px=float(disparity[0]),
        disparity_top_px=float(disparity[4]),
        T_left_world=pose,
    )


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
    views = []
    for height in camera_heights_mm:
        above = max(0.0, height - setup.side_mm) if to_point else 0.0
        if above >= setup.distance_mm:
            raise ValueError(f"a camera {height:g} mm up is farther from the cube than {setup.distance_mm:g} mm")
        near = replace(setup, distance_mm=float(np.sqrt(setup.distance_mm**2 - above**2)))
        pitch_rad = float(np.arctan(below_axis) - np.arctan2(height, near.distance_mm))
        views.append(cube_view(rectified, near, pitch_rad=pitch_rad, camera_height_mm=height, roll_rad=roll_rad))
    return views


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
