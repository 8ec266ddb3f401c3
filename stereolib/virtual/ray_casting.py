"""Ray casting through the exact lens: pictures of a scene, and its true depth and disparity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from stereolib.base import Bools, Float64, Floats, Ints
from stereolib.rig import Camera, RectifiedRig, StereoRig, rigid
from stereolib.virtual import texture
from stereolib.virtual.scene import Box, Light, Material, Scene

EPS_MM = 1e-2
_BAND_ROWS = 16  # rows drawn at a time: small enough for the processor's cache
_GREY_FROM_BGR = (0.114, 0.587, 0.299)  # ITU-R BT.601
_OBJECTS_AT_MM = np.array([700.0, 0.0, 150.0])  # where lights point: the cube's place
LIGHT_AT_MM = 2000.0  # a light's power is its irradiance at this distance
_FACE_OFFSET_MM = 137.0  # each face of a box shows another part of the texture
LEAST_COSINE, LEAST_COSINE_OF_PRINT = 0.02, 0.05  # surfaces seen at a lower angle are blurred no more
_CONE_SPARE = 1e-5  # of a cosine: more than rounding takes
_LEAST_PATTERN, _MOST_PATTERN = 0.05, 1.95  # of the mean reflectance: a texture never turns black or glows
_INK = 0.05  # reflectance of a board's black squares, of the paper's
_GLARE_SPOTS = 5  # points of an area light that glare is taken from
FRESNEL = 0.04  # reflectance of glossy paint met head on
LEAST_ROUGHNESS = 1e-6  # its fourth power: a perfect mirror would have no glare to sample


@dataclass(frozen=True, eq=False)
class Hits:
    """Where rays meet the scene.

    Attributes
    ----------
    distance_mm : (N,) float64
        NaN where a ray meets nothing.
    normal : (N, 3) float64
        Of the surface, facing the ray.
    surface : (N,) int
        ``6 * box + face``, or -1.
    albedo, gloss : (N,) float64
        Diffuse reflectance 0..1 with its texture, and gloss.
    """

    distance_mm: Float64
    normal: Float64
    surface: Ints
    albedo: Float64
    gloss: Float64


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


def cast_rays(scene: Scene, origins: Float64, directions: Float64) -> Hits:
    """Find the first hit of each ray.

    Parameters
    ----------
    scene : Scene
    origins : (3,) or (N, 3) array, mm
    directions : (N, 3) array
        Unit vectors, world frame.

    Returns
    -------
    Hits

    Examples
    --------
    >>> from stereolib.virtual import cube_scene
    >>> cast_rays(cube_scene(700.0), np.array([0.0, 0.0, 100.0]), np.array([[1.0, 0.0, 0.0]])).distance_mm.round(6)
    array([700.])
    """
    distance, surface = _nearest(scene, origins, directions)
    distance = np.where(surface >= 0, distance, np.nan)
    points = np.atleast_2d(origins) + distance[:, None] * directions
    normal = np.full(directions.shape, np.nan)
    albedo, gloss = np.full(len(distance), np.nan), np.zeros(len(distance))
    for s in np.unique(surface[surface >= 0]):
        at = np.flatnonzero(surface == s)
        box, face = scene.boxes[s // 6], s % 6
        normal[at] = _normal(box, face)
        tint = np.dot(box.materials[face].color_bgr, _GREY_FROM_BGR)
        no_footprint = np.zeros(len(at))
        albedo[at] = tint * _pattern(box, face, points[at], directions[at], no_footprint)
        gloss[at] = box.materials[face].gloss
    return Hits(distance, normal, surface, albedo, gloss)


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
        Rays per pixel and axis. 1 for sliders, 2 for pictures, 4 for calibration boards.
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
        distance, surface = _nearest(scene, origin, directions)
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


def _slabs(box: Box, origins: Floats, directions: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Entry and exit distance of each ray (N,), and the box-frame origins and directions (3, N)."""
    R, centre = box.T_world_box[:3, :3].astype(directions.dtype), box.T_world_box[:3, 3]
    o = _turned(np.atleast_2d(origins) - centre.astype(directions.dtype), R)
    d = _turned(directions, R)
    half = (np.array(box.size_mm, directions.dtype) / 2)[:, None]
    inverse = 1 / np.where(d == 0, d.dtype.type(1e-9), d)  # a ray along a face meets its slab far away, not nowhere
    middle, spread = -o * inverse, half * np.abs(inverse)
    entry, leave = _of_three(np.maximum, middle - spread), _of_three(np.minimum, middle + spread)
    return entry, leave, o, d


def _of_three(larger: np.ufunc, planes: Floats) -> Floats:
    """Maximum or minimum of three planes (3, N): what ``larger.reduce`` gives, in a fraction of its time."""
    return np.asarray(larger(larger(planes[0], planes[1]), planes[2]))


def _cone(box: Box, apex: Floats) -> tuple[Float64, float]:
    """Axis (3,) and cosine of a cone around all rays from an apex (3,) that meet a box; the cosine is -1 within it."""
    to_centre = box.T_world_box[:3, 3] - apex
    reach = float(np.linalg.norm(to_centre))
    sine = (float(np.linalg.norm(box.size_mm)) / 2 + EPS_MM) / max(reach, EPS_MM)
    return to_centre / max(reach, EPS_MM), float(np.sqrt(1 - sine**2)) - _CONE_SPARE if sine < 1 else -1.0


def _turned(vectors: Floats, R: Floats) -> Floats:
    """``R.T @ v`` of vectors (N, 3), as (3, N). Written out: faster than BLAS here, and the same on every processor."""
    x, y, z = np.ascontiguousarray(vectors.T)
    return np.stack([a * x + b * y + c * z for a, b, c in R.T])


def _nearest(scene: Scene, origins: Float64, directions: Float64) -> tuple[Float64, Ints]:
    """Distance of the first hit (inf for none) and its surface index, each (N,)."""
    distance = np.full(len(directions), np.inf, directions.dtype)
    surface = np.full(len(directions), -1)
    for index, box in enumerate(scene.boxes):
        near, some = _maybe_met(box, origins, directions)
        if not len(some):
            continue
        entry, leave, o, d = _slabs(box, origins if np.ndim(origins) == 1 else origins[near], some)
        t = leave if box.inside else entry
        met = np.flatnonzero((entry < leave) & (t > EPS_MM) & (t < distance[near]))
        at = met if isinstance(near, slice) else near[met]
        distance[at] = t[met]
        local = (o if o.shape[1] == 1 else o[:, met]) + t[met] * d[:, met]
        local /= np.array(box.size_mm, local.dtype)[:, None]
        surface[at] = 6 * index + _face_of(local)
    return distance, surface


def _face_of(local: Floats) -> Ints:
    """Faces 0 to 5 of places (3, N) on a box, in its sizes."""
    x, y, z = np.abs(local)
    at_z = z > np.maximum(x, y)
    faces: Ints = np.where(at_z, 4 + (local[2] > 0), np.where(y > x, 2 + (local[1] > 0), local[0] > 0))
    return faces


def _maybe_met(box: Box, origins: Float64, directions: Float64) -> tuple[slice | Ints, Float64]:
    """Which rays may meet a box, and their directions: all but those that pass its bounding sphere."""
    if box.inside or np.ndim(origins) > 1:
        return slice(None), directions
    axis, cosine = _cone(box, origins)
    near = np.flatnonzero(directions @ axis.astype(directions.dtype) >= cosine)
    return near, directions[near]


def blocked(boxes: Sequence[Box], points: Floats, target: Floats) -> Bools:
    """Find what is hidden from a point by boxes that are solid.

    Parameters
    ----------
    boxes : sequence of Box
    points : (N, 3) array, mm
    target : (3,) array, mm

    Returns
    -------
    (N,) bool
        Whether a box stands between the point and the target.
    """
    hidden = np.zeros(len(points), bool)
    way = target - points
    reach = np.sqrt(np.einsum("ij,ij->i", way, way))
    for box in boxes:
        if not box.inside:
            axis, cosine = _cone(box, target)
            near = np.flatnonzero(way @ -axis.astype(way.dtype) >= cosine * reach)
            entry, leave, *_ = _slabs(box, points[near], way[near])
            hidden[near] |= (entry < leave) & (leave > 0) & (entry < 1)
    return hidden


def _normal(box: Box, face: int) -> Float64:
    outward = box.T_world_box[:3, face // 2] * (1 if face % 2 else -1)
    return -outward if box.inside else outward


def _facing(scene: Scene, surface: Ints) -> Float64:
    """Normals (N, 3) of surface indices (N,)."""
    table = np.array([_normal(box, face) for box in scene.boxes for face in range(6)])
    return table[surface]


def _pattern(box: Box, face: int, points: Float64, directions: Float64, footprint_mm: Float64) -> Floats:
    """Relative reflectance of points (N, 3) on a face: the texture or the checkerboard, filtered. (N,)."""
    material: Material = box.materials[face]
    T = box.T_world_box
    local = (points - T[:3, 3].astype(points.dtype)) @ T[:3, :3].astype(points.dtype)
    a, b = [i for i in range(3) if i != face // 2]
    cos = np.abs(directions @ _normal(box, face).astype(points.dtype))
    if material.checker:
        along = directions @ T[:3, [a, b]].astype(points.dtype)
        stretch = 1 + (along / np.maximum(cos, LEAST_COSINE_OF_PRINT)[:, None]) ** 2
        wide = footprint_mm * np.sqrt(stretch[:, 0]), footprint_mm * np.sqrt(stretch[:, 1])
        return checkered(material.checker, local[:, a], local[:, b], wide)
    if not material.contrast:
        return np.ones(len(points))
    width = footprint_mm / np.sqrt(np.maximum(cos, LEAST_COSINE))
    return textured(material, face, local[:, a], local[:, b], width)


def checkered(checker: tuple[int, int, float], u: Floats, v: Floats, wide: tuple[Floats, Floats]) -> Floats:
    """Compute the relative reflectance of a printed checkerboard.

    Parameters
    ----------
    checker : (inner columns, inner rows, square_mm)
    u, v : (N,) array
        Place on the face, mm from its centre.
    wide : two (N,) arrays
        What a pixel covers along u and v, mm.

    Returns
    -------
    (N,) array
        1 for the paper.
    """
    columns, rows, square = checker
    # With an even number of squares the centre is a corner of four squares, with an odd one the middle of one.
    shift_u, shift_v = (0.0 if (n + 1) % 2 == 0 else square / 2 for n in (columns, rows))
    white = texture.checker(u + shift_u, v + shift_v, wide, square)
    inside = (np.abs(u) < (columns + 1) * square / 2) & (np.abs(v) < (rows + 1) * square / 2)
    return np.where(inside, _INK + (1 - _INK) * white, 1.0)


def textured(material: Material, face: int, u_mm: Floats, v_mm: Floats, width_mm: Floats) -> Floats:
    """Look up the relative reflectance of a textured face.

    Parameters
    ----------
    material : Material
    face : int
        0 to 5, in the order of `Box`.
    u_mm, v_mm : (N,) array
        Place on the face, mm from its centre along its first and its second axis.
    width_mm : (N,) array
        What a pixel covers there, mm.

    Returns
    -------
    (N,) float32
    """
    offset = _FACE_OFFSET_MM * face
    u, v, width = u_mm + offset, v_mm + offset, width_mm
    if material.tile:
        grain = texture.filtered(material.tile.levels, u, v, width, material.tile.mm_per_texel)
    else:
        grain = texture.noise(u, v, width, material.scale_mm, material.seed)
    return np.asarray(np.clip(1 + material.contrast * grain, _LEAST_PATTERN, _MOST_PATTERN))


def _radiance(
    scene: Scene, origins: Float64, directions: Float64, pixel_rad: float, light_samples: int, bounce: bool
) -> Float64:
    """Light along each ray, (N, 3) float64: diffuse with soft shadows, GGX glare, one mirror bounce."""
    distance, surface = _nearest(scene, origins, directions)
    light = np.zeros((len(directions), 3))
    origins = np.broadcast_to(origins, directions.shape)
    for s in np.unique(surface[surface >= 0]):
        at = np.flatnonzero(surface == s)
        box, face = scene.boxes[s // 6], int(s % 6)
        material, normal = box.materials[face], _normal(box, face)
        toward = directions[at]
        points = origins[at] + distance[at, None] * toward + EPS_MM * normal
        patch = _Patch(points, normal, toward, material)
        pattern = _pattern(box, face, points, toward, distance[at] * pixel_rad)
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
    if n > 1 and soft.size:
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
