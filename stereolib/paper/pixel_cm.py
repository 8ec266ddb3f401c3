"""The relation of pixels and lengths: the paper's constant, its parametric form, and what it says
about where the camera stood (sections II.F and IV)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.paper.ledger import assumed, published, value
from stereolib.rig import RectifiedRig, check_pair, pose_left_world, rigid, to_grey

Array = np.ndarray
_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0}


def cm_per_px(length_cm: float, width_px: float) -> float:
    """The paper's constant: a known length over its width in the image (section IV), cm/px."""
    if not (length_cm > 0 and width_px > 0):
        raise ValueError(f"length and width must be positive, got {length_cm} cm, {width_px} px")
    return length_cm / width_px


def cm_per_px_at(depth_mm: float | Array, f_px: float) -> Array:
    """The parametric relation: one pixel at a depth stands for ``Z / f``, in cm/px.

    Parameters
    ----------
    depth_mm : float or array, mm
        Along the optical axis; NaN where unknown.
    f_px : float
    """
    if not f_px > 0:
        raise ValueError(f"the focal length must be positive, got {f_px} px")
    return np.asarray(depth_mm, float) / (10.0 * f_px)


def depth_of_scale_mm(scale_cm_per_px: float, f_px: float) -> float:
    """Depth at which a scale is true, ``Z = scale f``, mm."""
    return 10.0 * scale_cm_per_px * f_px


def fit_scale(depth_mm: Array, scale_cm_per_px: Array) -> float:
    """Focal length of measured scales: least squares of ``scale = Z / f``, px.

    Parameters
    ----------
    depth_mm, scale_cm_per_px : (N,) arrays

    Raises
    ------
    ValueError
        If the lengths differ, or a value is not positive and finite.
    """
    depth, scale = np.asarray(depth_mm, float), 10.0 * np.asarray(scale_cm_per_px, float)
    pair = [depth, scale]
    if depth.shape != scale.shape or depth.ndim != 1 or not depth.size:
        raise ValueError(f"need as many depths as scales, got {depth.shape} and {scale.shape}")
    if not all(np.isfinite(a).all() and (a > 0).all() for a in pair):
        raise ValueError("depths and scales must be positive and finite: drop the invalid ones")
    return float(depth @ depth / (depth @ scale))


@dataclass(frozen=True)
class Box:
    """An upright rectangle of pixels: columns ``left`` to ``left + width - 1``, rows likewise."""

    left: int
    top: int
    width: int
    height: int


def canny_edges(image: Array, *, low: float = 50, high: float = 150, blur_px: int = 5, channel: str = "grey") -> Array:
    """Canny's edges of a picture.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
    low, high : float
        Canny's thresholds on the gradient.
    blur_px : odd int
        Side of the Gaussian before; 1 is none.
    channel : "grey" | "saturation"
        Brightness, or saturation ``(max - min) / max`` of blue, green and red (times 4, where 255 is full). A pattern
        of light and dark fills the first with edges; the second does not see it, nor shading, and shows the outline
        of a coloured object. In poor light it is noise.

    Returns
    -------
    (H, W) uint8, 255 on an edge, else 0

    Raises
    ------
    ValueError
        If the image is not uint8, `blur_px` is even, or the saturation of a grey image is asked for.
    """
    check_pair(image, image, names=("image", "image"))
    _check_odd("blur_px", blur_px)
    return cv2.Canny(cv2.GaussianBlur(_channel(image, channel), (blur_px, blur_px), 0), low, high)


def canny_bounding_box(
    image: Array,
    *,
    low: float = 50,
    high: float = 150,
    blur_px: int = 5,
    close_px: int = 5,
    channel: str = "grey",
    region: tuple[int, int, int, int] | None = None,
) -> Box:
    """Bounding rectangle of the largest contour of Canny's edges (the paper's Fig. 9).

    Parameters
    ----------
    image, low, high, blur_px, channel
        As for `canny_edges`.
    close_px : odd int
        Side of the closing that joins broken edges; 1 is none.
    region : (left, top, width, height), px, optional
        Where to look. A textured floor has edges too.

    Returns
    -------
    Box
        In pixels of the whole image; first and last edge pixel belong to it, so that it is one pixel wider than the
        distance between the edges. Its ends are good to about 1 px each.

    Raises
    ------
    ValueError
        As `canny_edges`; or the region is empty, or no edge is found.
    """
    check_pair(image, image, names=("image", "image"))
    _check_odd("close_px", close_px)
    left, top, width, height = region or (0, 0, image.shape[1], image.shape[0])
    part = image[max(top, 0) : top + height, max(left, 0) : left + width]
    if part.size == 0:
        raise ValueError(f"region {region} has no pixel of the {image.shape[1]}x{image.shape[0]} image")
    edges = canny_edges(part, low=low, high=high, blur_px=blur_px, channel=channel)
    edges = cv2.morphologyEx(edges, cv2.MORPH_CLOSE, np.ones((close_px, close_px), np.uint8))
    contours, _ = cv2.findContours(edges, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    if not contours:
        raise ValueError(f"no edge above {low} and {high}: lower the thresholds or move the region")
    boxes = [cv2.boundingRect(contour) for contour in contours]
    x, y, w, h = max(boxes, key=lambda box: box[2] * box[3])
    return Box(x + max(left, 0), y + max(top, 0), w, h)


def _channel(image: Array, channel: str) -> Array:
    if channel not in ("grey", "saturation") or (channel == "saturation" and image.ndim == 2):
        raise ValueError(f'channel must be "grey", or "saturation" of a colour image; got {channel!r}, {image.shape}')
    if channel == "grey":
        return to_grey(image)
    high, low = (pick(image, axis=2).astype(np.float32) for pick in (np.max, np.min))
    return np.clip(4 * 255 * (high - low) / np.maximum(high, 1), 0, 255).astype(np.uint8)


def _check_odd(name: str, size: int) -> None:
    if size < 1 or size % 2 == 0:
        raise ValueError(f"{name} must be odd and at least 1, got {size}")


@dataclass(frozen=True)
class Setup:
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
    ``depth_side_mm`` is the depth of the two corners between which the width is counted.
    """

    pitch_rad: float
    camera_height_mm: float
    foot_row: float
    top_row: float
    column: float
    constant_rows: float
    width_px: float
    depth_side_mm: float
    disparity_foot_px: float
    disparity_top_px: float
    T_left_world: Array


def paper_setup() -> Setup:
    """The printed set-up in millimetres (II.C, II.F); the camera height's unit is assumed."""
    item = published()
    side, distance = item["setup.cube"], item["setup.distance"]
    return Setup(
        side_mm=side.value[0] * _MM[side.unit],
        distance_mm=distance.value * _MM[distance.unit],
        camera_height_mm=value("setup.camera_height") * _MM[assumed()["camera_height_unit"]],
        constant_rows=value("height.constant_rows"),
    )


def rig_pose(rectified: RectifiedRig, pitch_rad: float, camera_height_mm: float, frame: str = "rectified") -> Array:
    """Pose ``T_left_world`` (4, 4) of a rig that looks along the world's x axis.

    Parameters
    ----------
    rectified : RectifiedRig
    pitch_rad : float
        Upwards.
    camera_height_mm : float
        Of the left optical centre.
    frame : "rectified" | "left"
        What is held level across and then pitched: the rig's baseline (the rectified camera), or
        the left camera itself, which the rectification turns by about a degree.
    """
    if frame not in ("rectified", "left"):
        raise ValueError(f'frame must be "rectified" or "left", got {frame!r}')
    pose = pose_left_world(pitch_rad, camera_height_mm)
    return pose if frame == "left" else rigid(rectified.R1.T, np.zeros(3)) @ pose


def cube_view(
    rectified: RectifiedRig,
    setup: Setup,
    *,
    pitch_rad: float = 0.0,
    camera_height_mm: float | None = None,
    frame: str = "rectified",
) -> CubeView:
    """Project the cube of a set-up into the rectified left image.

    Raises
    ------
    ValueError
        If part of the cube lies behind the camera.
    """
    height = setup.camera_height_mm if camera_height_mm is None else camera_height_mm
    pose = rig_pose(rectified, pitch_rad, height, frame)
    half = setup.side_mm / np.sqrt(2)
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
        disparity_foot_px=float(disparity[0]),
        disparity_top_px=float(disparity[4]),
        T_left_world=pose,
    )


def solve_pitch(rectified: RectifiedRig, setup: Setup, frame: str = "rectified") -> CubeView:
    """The upward pitch at which the cube's foot stands ``setup.constant_rows`` above the bottom.

    Raises
    ------
    ValueError
        If no pitch within 45 degrees does.
    """

    def view(pitch: float) -> CubeView:
        return cube_view(rectified, setup, pitch_rad=pitch, frame=frame)

    return _solve(view, setup, np.radians(-45), np.radians(45), "pitch within 45 degrees")


def solve_camera_height(rectified: RectifiedRig, setup: Setup, frame: str = "rectified") -> CubeView:
    """The height at which a level camera sees the foot ``setup.constant_rows`` above the bottom.

    Raises
    ------
    ValueError
        If no height up to twice the distance does.
    """

    def view(height: float) -> CubeView:
        return cube_view(rectified, setup, camera_height_mm=height, frame=frame)

    return _solve(view, setup, 1.0, 2 * setup.distance_mm, "height up to twice the distance")


def _solve(view: Callable[[float], CubeView], setup: Setup, low: float, high: float, what: str) -> CubeView:
    from scipy.optimize import brentq

    def miss(x: float) -> float:
        return view(x).constant_rows - setup.constant_rows

    if miss(low) * miss(high) > 0:
        raise ValueError(f"no {what} puts the foot {setup.constant_rows:g} rows above the bottom")
    return view(brentq(miss, low, high, xtol=1e-12))
