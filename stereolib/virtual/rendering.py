"""Rendering through the exact lens: pictures of a scene in its light, and its true depth and disparity."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from stereolib.base import Bools, Float64, Ints
from stereolib.rig import Camera, RectifiedRig, StereoRig, rigid
from stereolib.virtual.ray_casting import EPS_MM, blocked, face_normal, face_pattern, first_surfaces
from stereolib.virtual.scene import Light, Material, Scene

_BAND_ROWS = 16  # rows drawn at a time: small enough for the processor's cache
_OBJECTS_AT_MM = np.array([700.0, 0.0, 150.0])  # where lights point: the cube's place
LIGHT_AT_MM = 2000.0  # a light's power is its irradiance at this distance
_GLARE_SPOTS = 5  # points of an area light that glare is taken from
FRESNEL = 0.04  # reflectance of glossy paint met head on
LEAST_ROUGHNESS = 1e-6  # its fourth power: a perfect mirror would have no glare to sample


@dataclass(frozen=True, eq=False)
class Truth:
    """What a perfect stereo system would return for the rectified left image.

    Attributes
    ----------
    disparity_px, depth_mm : (H, W) float64
    visible : (H, W) bool
        The right camera sees the pixel's point, too: inside its image, not occluded.
    box : (H, W) int
        Index of the box in the scene, or -1.
    """

    disparity_px: Float64
    depth_mm: Float64
    visible: Bools
    box: Ints


def render(
    scene: Scene, camera: Camera, T_camera_world: Float64, *, samples: int = 2, light_samples: int = 4
) -> Float64:
    """Draw a picture of a scene: linear light, before the webcam's own faults.

    Parameters
    ----------
    scene : Scene
    camera : Camera
        With any lens; rays go through the exact inverse.
    T_camera_world : (4, 4) array
        Maps world points (mm) into the camera.
    samples : int
        Rays per pixel and axis. 1 for sliders, 2 for emulated cameras, 3 for the recordings.
    light_samples : int
        Points per axis on each area light, where its shadow is soft.

    Returns
    -------
    (H, W, 3) float64
        Blue, green, red; 1 is white paper in good light.

    Raises
    ------
    ValueError
        If a number of samples is below 1.
    """
    if samples < 1 or light_samples < 1:
        raise ValueError(f"samples and light_samples must be at least 1, got {samples} and {light_samples}")
    width, height = camera.size
    R = T_camera_world[:3, :3]
    origin = -T_camera_world[:3, :3].T @ T_camera_world[:3, 3]
    rays = _ray_grid(camera, samples).reshape(height, -1, 3)
    pixel_rad = 1.0 / (camera.K[0, 0] * samples)
    picture = np.empty((height, width, 3))
    for top in range(0, height, _BAND_ROWS):
        directions = rays[top : top + _BAND_ROWS].reshape(-1, 3) @ R
        light = _radiance(scene, origin, directions, pixel_rad, light_samples, bounce=True)
        picture[top : top + _BAND_ROWS] = light.reshape(-1, samples, width, samples, 3).mean(axis=(1, 3))
    return picture


def render_truth(scene: Scene, rectified: RectifiedRig, T_left_world: Float64) -> Truth:
    """Compute depth and disparity of the rectified left image exactly, one ray through each pixel's centre.

    Parameters
    ----------
    scene : Scene
    rectified : RectifiedRig
    T_left_world : (4, 4) array
        Where the left camera stands, before it is rectified.

    Returns
    -------
    Truth

    Notes
    -----
    ``disparity = f B / Z``. A pixel is visible when the same point projects inside the rectified right image and
    nothing stands between it and the right camera.
    """
    camera, (width, height) = rectified.left, rectified.size
    T_rect_world = rigid(rectified.R1, np.zeros(3)) @ T_left_world
    R, origin = T_rect_world[:3, :3], -T_rect_world[:3, :3].T @ T_rect_world[:3, 3]
    rays, length = _pixel_rays(camera.K.tobytes(), camera.dist.tobytes(), camera.size)
    right_origin = origin + R.T @ [rectified.baseline_mm, 0.0, 0.0]
    depth, visible = np.empty((height, width)), np.empty((height, width), bool)
    box = np.empty((height, width), int)
    for top in range(0, height, _BAND_ROWS):
        band = slice(top, min(top + _BAND_ROWS, height))
        directions = rays[band].reshape(-1, 3) @ R
        distance, surface = first_surfaces(scene, origin, directions)
        distance = np.where(surface >= 0, distance, np.nan)
        points = origin + distance[:, None] * directions + EPS_MM * _facing(scene, surface)
        depth[band] = distance.reshape(-1, width) / length[band]
        visible[band] = ~blocked(scene.boxes, points, right_origin).reshape(-1, width)
        box[band] = np.where(surface >= 0, surface // 6, -1).reshape(-1, width)
    disparity = rectified.f_px * rectified.baseline_mm / depth
    return Truth(disparity, depth, visible & (np.arange(width) - disparity >= 0), box)


def render_pair(
    scene: Scene, rig: StereoRig, T_left_world: Float64, *, samples: int = 2, light_samples: int = 4
) -> tuple[Float64, Float64]:
    """Draw the pictures of both cameras of a rig.

    Parameters
    ----------
    scene : Scene
    rig : StereoRig
    T_left_world : (4, 4) array
        Where the left camera stands.
    samples, light_samples : int
        As for `render`.

    Returns
    -------
    left, right : (H, W, 3) float64
        As from `render`.
    """
    T_right_world = rigid(rig.R, rig.T) @ T_left_world
    left, right = (
        render(scene, camera, T, samples=samples, light_samples=light_samples)
        for camera, T in ((rig.left, T_left_world), (rig.right, T_right_world))
    )
    return left, right


def _ray_grid(camera: Camera, samples: int) -> Float64:
    """Unit rays of all sub-pixels in row order, (H * samples * W * samples, 3) float64, camera frame."""
    return _rays_of_lens(camera.K.tobytes(), camera.dist.tobytes(), camera.size, samples)


@lru_cache(maxsize=8)
def _rays_of_lens(K: bytes, dist: bytes, size: tuple[int, int], samples: int) -> Float64:
    """`_ray_grid`, kept for all cameras of the same lens: a rig that is moved has new cameras, but no new rays."""
    camera = Camera(np.frombuffer(K).reshape(3, 3), np.frombuffer(dist), size)
    width, height = size
    u, v = ((np.arange(n * samples) + 0.5) / samples - 0.5 for n in (width, height))
    rays = camera.rays(np.stack(np.meshgrid(u, v), -1).reshape(-1, 2), clamp=True)
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


@lru_cache(maxsize=4)
def _pixel_rays(K: bytes, dist: bytes, size: tuple[int, int]) -> tuple[Float64, Float64]:
    """Unit rays through the middles of all pixels (H, W, 3) and how long they are to depth 1 (H, W), camera frame."""
    camera, (width, height) = Camera(np.frombuffer(K).reshape(3, 3), np.frombuffer(dist), size), size
    rays = camera.rays(np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).reshape(-1, 2))
    length = np.linalg.norm(rays, axis=1)
    return (rays / length[:, None]).reshape(height, width, 3), length.reshape(height, width)


def _facing(scene: Scene, surface: Ints) -> Float64:
    """Normals (N, 3) of surface indices (N,)."""
    table = np.array([face_normal(box, face) for box in scene.boxes for face in range(6)])
    return table[surface]


def _radiance(
    scene: Scene, origins: Float64, directions: Float64, pixel_rad: float, light_samples: int, bounce: bool
) -> Float64:
    """Light along each ray, (N, 3) float64: diffuse with soft shadows, GGX glare, one mirror bounce."""
    distance, surface = first_surfaces(scene, origins, directions)
    light = np.zeros((len(directions), 3))
    origins = np.broadcast_to(origins, directions.shape)
    for s in np.unique(surface[surface >= 0]):
        at = np.flatnonzero(surface == s)
        box, face = scene.boxes[s // 6], int(s % 6)
        material, normal = box.materials[face], face_normal(box, face)
        toward = directions[at]
        points = origins[at] + distance[at, None] * toward + EPS_MM * normal
        patch = _Patch(points, normal, toward, material)
        pattern = face_pattern(box, face, points, toward, distance[at] * pixel_rad)
        diffuse, glare = np.full(len(at), scene.ambient), np.zeros(len(at))
        for lamp in scene.lights:
            d, g = _lit(scene, lamp, patch, light_samples if bounce else 1)
            diffuse += d
            glare += g
        light[at] = np.array(material.color_bgr) * (pattern * diffuse)[:, None] + glare[:, None]
        if bounce and material.gloss:
            cos = -toward @ normal
            mirrored = toward + 2 * cos[:, None] * normal
            fresnel = material.gloss * (FRESNEL + (1 - FRESNEL) * (1 - cos) ** 5)
            reflected = _radiance(scene, points, mirrored, pixel_rad, 1, bounce=False)
            light[at] += (fresnel * (1 - material.roughness))[:, None] * reflected
    return light


@dataclass(frozen=True, eq=False)
class _Patch:
    """Points (N, 3) on a face, its normal (3,), the rays' directions (N, 3) towards them, and the material."""

    points: Float64
    normal: Float64
    toward: Float64
    material: Material


def _lit(scene: Scene, lamp: Light, patch: _Patch, n: int) -> tuple[Float64, Float64]:
    """Diffuse irradiance and glare from one area light at the points of a patch, each (N,) float64."""
    points, normal, material = patch.points, patch.normal, patch.material
    grid = ((np.arange(n) + 0.5) / n - 0.5) * lamp.size_mm if n > 1 else np.zeros(1)
    to_scene = aim(lamp)
    side = np.cross(to_scene, [0.0, 1.0, 0.0] if abs(to_scene[1]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    up = np.cross(side, to_scene)
    spots = np.array([lamp.position_mm + a * side + b * up for a in grid for b in grid])
    lit = _visibility(scene, points, spots, n)
    middle = np.array(lamp.position_mm) - points
    reach = np.linalg.norm(middle, axis=1)
    cos = np.maximum(middle @ normal, 0) / reach
    shining = np.maximum(-middle @ to_scene, 0) / reach  # nothing goes backwards
    fall = lamp.power * shining * (LIGHT_AT_MM / reach) ** 2
    glare = np.zeros(len(points))
    if material.gloss:
        few = spots[:: max(1, len(spots) // _GLARE_SPOTS)]
        for spot in few:
            glare += _ggx(spot - points, normal, -patch.toward, material)
        glare *= fall / len(few)
    return lit * fall * cos, lit * glare


def aim(lamp: Light) -> Float64:
    """Direction in which a light shines.

    Parameters
    ----------
    lamp : Light

    Returns
    -------
    (3,) float64
        Unit vector, world frame.
    """
    to_scene = _OBJECTS_AT_MM - lamp.position_mm
    to_scene /= np.linalg.norm(to_scene)
    return to_scene


def _visibility(scene: Scene, points: Float64, spots: Float64, n: int) -> Float64:
    """Share of the light's points that each point sees: the corners first, the rest only in the half shadow."""
    corners = spots[[0, n - 1, -n, -1]] if n > 1 else spots
    lit = np.asarray(np.mean([~blocked(scene.boxes, points, spot) for spot in corners], axis=0))
    soft = np.flatnonzero((lit > 0) & (lit < 1))
    if n > 2 and soft.size:  # of two by two, all are corners
        lit[soft] = np.mean([~blocked(scene.boxes, points[soft], spot) for spot in spots], axis=0)
    return lit


def _ggx(to_light: Float64, normal: Float64, to_eye: Float64, material: Material) -> Float64:
    """Glare of a rough surface times the cosine: ``D F G / (4 n.v)`` (Walter et al. 2007). (N,) float64."""
    to_light = to_light / np.linalg.norm(to_light, axis=1, keepdims=True)
    half = to_light + to_eye
    half /= np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-6)
    nl, nv, nh = (np.maximum(x @ normal, 1e-3) for x in (to_light, to_eye, half))
    vh = np.maximum((to_eye * half).sum(axis=1), 0)
    a2 = material.roughness**4 + LEAST_ROUGHNESS
    spread = a2 / (np.pi * (nh * nh * (a2 - 1) + 1) ** 2)
    fresnel = material.gloss * (FRESNEL + (1 - FRESNEL) * (1 - vh) ** 5)
    k = a2**0.5 / 2
    shadowing = nl * nv / ((nl * (1 - k) + k) * (nv * (1 - k) + k))
    return np.where(to_light @ normal > 0, spread * fresnel * shadowing / (4 * nv), 0)
