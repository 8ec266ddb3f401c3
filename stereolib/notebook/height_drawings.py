"""What the sliders about the object in pixels draw: its height and its width (notebooks 06 and 07)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING

import cv2
import numpy as np

from stereolib import paper
from stereolib.base import Float64, UInt8
from stereolib.matching import SGBMParams, compute_disparity
from stereolib.paper import CubeView, HeightResult, height_by_maximum, height_of_top
from stereolib.rig import rigid

if TYPE_CHECKING:
    from stereolib.measurement import HeightAttempt


def height_text(attempt: HeightAttempt) -> str:
    """Say a height with its interval of 95 %, or why there is none.

    Parameters
    ----------
    attempt : HeightAttempt

    Returns
    -------
    str
    """
    return attempt.refused or f"{attempt.height_mm / 10:.1f} ± {0.196 * attempt.std_mm:.1f} cm"


def recording_labels(names: Sequence[str]) -> list[str]:
    """Say recordings of the cube as a reader would: ``series/fine_700`` is "fine, 0.70 m".

    Parameters
    ----------
    names : sequence of str

    Returns
    -------
    list of str

    Examples
    --------
    >>> recording_labels(["series/fine_700", "conditions/poor_light"])
    ['fine, 0.70 m', 'poor light']
    """
    labels = []
    for name in names:
        kind, rest = name.split("/")
        texture, _, mm = rest.rpartition("_")
        labels.append(f"{texture}, {int(mm) / 1000:.2f} m" if kind == "series" else rest.replace("_", " "))
    return labels


def draw_recipe(pitch_deg: float, tolerance_px: float, rows: int, dilate_px: int) -> tuple[UInt8, str]:
    """Notebook 06: the paper's recipe with its knobs, on a camera of some pitch that sees the cube's foot where it was.

    Parameters
    ----------
    pitch_deg : float
        Upwards; to each belongs one camera height.
    tolerance_px : float
        The threshold: so far below the map's maximum a disparity still counts.
    rows : int
        Cut off at the picture's bottom.
    dilate_px : int
        Edge of the window by which the map is dilated first; 1 leaves it.

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    from stereolib.virtual import recordings

    left, right, view = _at_pitch(pitch_deg)
    result = height_by_maximum(
        compute_disparity(left, right, SGBMParams(128)),
        paper.printed_value("scale.cm_per_px"),
        rows,
        tolerance_px=tolerance_px,
        dilate_px=dilate_px,
    )
    picture = _marked(left, result)
    ray_mm = height_of_top(recordings.rectified(), view.T_left_world, result)
    fall = _fall_px(view)
    text = f"camera {view.camera_height_mm / 10:.1f} cm up; up the edge its disparity "
    text += f"{'falls' if fall > 0 else 'rises'} by {abs(fall):.1f} px; "
    count = int(result.mask.sum())
    text += f"{count} pixel{'s count' if count != 1 else ' counts'}, rows {result.top_row} to {result.foot_row}: "
    text += f"the recipe reads {result.height_mm / 10:.1f} cm, the top pixel's own depth {ray_mm / 10:.1f} cm, "
    return picture, text + f"true are {paper.paper_setup().side_mm / 10:.1f} cm"


def draw_heights(distance_mm: float, yaw_deg: float, lateral_mm: float, height_mm: float) -> tuple[UInt8, str]:
    """Notebook 06: a box of some height is moved; the paper's reading and the ground plane's beside the truth.

    Parameters
    ----------
    distance_mm : float
        From the camera to the box's near edge.
    yaw_deg : float
        At 45 an edge of the box is nearest, at 0 a face.
    lateral_mm : float
        How far to the left the box stands.
    height_mm : float
        Of the box: what both methods want to read.

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    from stereolib.measurement import attempt_height
    from stereolib.plotting import figure_to_image, panels, plot_height_attempt, plot_image
    from stereolib.plotting.style import DPI
    from stereolib.virtual import recordings

    rectified = recordings.rectified()
    view = paper.solve_pitch(rectified, paper.paper_setup())
    where = (distance_mm, yaw_deg, float(np.degrees(view.pitch_rad)))
    left, right = (_cube(*where, side, lateral_mm, height_mm) for side in ("left", "right"))
    tolerance = _fall_px(view) + 2  # SGBM's scatter with one ray a pixel
    recipe = height_by_maximum(
        compute_disparity(left, right, SGBMParams(160)),
        paper.printed_value("scale.cm_per_px"),
        paper.printed_value("height.constant_rows"),
        tolerance_px=tolerance,
    )
    attempt = attempt_height(left, right, rectified)
    figure, axes = panels(2, width_in=2 * left.shape[1] / DPI)
    plot_image(_marked(left, recipe), axes[0], "the recipe (virtual rig)")
    plot_height_attempt(attempt, axes[1], f"the ground plane{': refused' if attempt.refused else ''}")
    ours = f"{attempt.height_mm / 10:.2f} ± {0.196 * attempt.std_mm:.2f} cm (95 %)"
    ours = f"refused, {attempt.refused}" if attempt.refused else ours
    text = f"true height {height_mm / 10:.1f} cm; the paper's recipe reads {recipe.height_mm / 10:.1f} cm, "
    return figure_to_image(figure), text + f"the ground plane {ours}"


def draw_width(distance_mm: float, yaw_deg: float, pitch_deg: float) -> tuple[UInt8, str]:
    """Notebook 07: width of the cube in pixels, and what a pixel stands for, over distance.

    Parameters
    ----------
    distance_mm : float
        From the camera to the cube's near edge.
    yaw_deg : float
        At 45 an edge of the cube is nearest, at 0 a face.
    pitch_deg : float
        Of the camera, upwards.

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    from stereolib.virtual import recordings

    left = _cube(distance_mm, yaw_deg, pitch_deg, "left")
    box = paper.canny_bounding_box(left, channel="saturation", blur_px=13)
    picture = left.copy()
    corner = (box.left + box.width - 1, box.top + box.height - 1)
    cv2.rectangle(picture, (box.left, box.top), corner, (0, 94, 213), 2)
    rectified = recordings.rectified()
    points = _corners_mm(distance_mm, yaw_deg, pitch_deg)
    u = points[:, 0] / points[:, 2] * rectified.f_px
    ends = points[[u.argmin(), u.argmax()]]
    low, high = sorted(paper.cm_per_px_at(ends[:, 2], rectified.f_px))
    near = float(paper.cm_per_px_at(points[:, 2].min(), rectified.f_px))
    constant = paper.printed_value("scale.cm_per_px")
    text = f"{box.width} px wide, by geometry {np.ptp(u) + 1:.0f} px. One pixel stands for "
    text += f"{low:.3f} cm" + (f" and {high:.3f} cm" if round(high - low, 3) else "")
    text += f" at the two outermost corners and {near:.3f} cm at the nearest one. Between the two are "
    text += f"{np.linalg.norm(np.diff(ends, axis=0)) / 10:.1f} cm; "
    return picture, text + f"{constant} cm/px would read {constant * box.width:.1f} cm"


def _corners_mm(distance_mm: float, yaw_deg: float, pitch_deg: float) -> Float64:
    """Corners of the cube in the rectified left camera."""
    from stereolib import virtual
    from stereolib.virtual import recordings

    cube = virtual.cube_scene(distance_mm, yaw_rad=np.radians(yaw_deg)).boxes[-1]
    height_mm = paper.paper_setup().camera_height_mm
    T_left_box = paper.rig_pose(recordings.rectified(), np.radians(pitch_deg), height_mm) @ cube.T_world_box
    corners = np.array(list(product((-0.5, 0.5), repeat=3))) * cube.size_mm
    return np.asarray((corners @ T_left_box[:3, :3].T + T_left_box[:3, 3]) @ recordings.rectified().R1.T)


@lru_cache(maxsize=4)
def _cube(
    distance_mm: float, yaw_deg: float, pitch_deg: float, side: str, lateral_mm: float = 0.0, tall_mm: float = 300.0
) -> UInt8:
    """Rectified picture of the cube from the virtual rig, one ray a pixel; kept for the sliders that change nothing."""
    from stereolib import virtual
    from stereolib.virtual import recordings

    rectified = recordings.rectified()
    rig = rectified.rig  # the same objects every time: the renderer keeps a camera's rays
    pose = paper.rig_pose(rectified, np.radians(pitch_deg), paper.paper_setup().camera_height_mm)
    camera = rig.left if side == "left" else rig.right
    T_camera_world = pose if side == "left" else rigid(rig.R, rig.T) @ pose
    size = (300.0, 300.0, tall_mm)
    cube = virtual.cube_scene(distance_mm, size_mm=size, yaw_rad=np.radians(yaw_deg), lateral_mm=lateral_mm)
    light = virtual.render(cube, camera, T_camera_world, samples=1, light_samples=1)
    picture = virtual.Webcam().shoot(light, np.random.default_rng([6, side == "left"]))
    return rectified.rectify(picture, picture)[side == "right"]


@lru_cache(maxsize=8)  # the baked page goes through five, again and again
def _at_pitch(pitch_deg: float) -> tuple[UInt8, UInt8, CubeView]:
    """Rectified pair of the cube, one ray a pixel, by a camera so high that its foot has the printed rows below it."""
    from stereolib import virtual
    from stereolib.virtual import recordings

    rectified, setup = recordings.rectified(), paper.paper_setup()
    row = (rectified.size[1] - setup.constant_rows - rectified.P1[1, 2]) / rectified.P1[1, 1]
    height_mm = setup.distance_mm * np.tan(np.arctan(row) - np.radians(pitch_deg))
    (view,) = paper.setup_family(rectified, setup, [float(height_mm)])
    light = virtual.render_pair(virtual.cube_scene(), rectified.rig, view.T_left_world, samples=1, light_samples=1)
    rng, webcam = np.random.default_rng(6), virtual.Webcam()
    left, right = (webcam.shoot(one, rng) for one in light)
    return *rectified.rectify(left, right), view


def _fall_px(view: CubeView) -> float:
    return view.disparity_foot_px - view.disparity_top_px


def _marked(left: UInt8, height: HeightResult) -> UInt8:
    """A picture with the pixels that the recipe counted, its two rows, and a ring around its top pixel."""
    picture = left.copy()
    picture[height.mask] = (0, 94, 213)
    for row in (height.top_row, height.foot_row):
        cv2.line(picture, (0, row), (639, row), (233, 180, 86), 1)
    cv2.circle(picture, (height.column, height.top_row), 7, (255, 255, 255), 2, cv2.LINE_AA)
    return picture
