"""Pictures for sliders: what `render` draws with one ray a pixel and points of light, in single precision.

A plane at a time instead of a ray at a time: each face is met by the rays that can meet it, its texture and its light
are computed in its own two coordinates, shadows only where a box can throw one. What a glossy face mirrors is what the
eye's mirror image sees through it.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np

from stereolib.base import Bools, Float32, Float64, Floats, Ints
from stereolib.rig import Camera, StereoRig, rigid
from stereolib.virtual.ray_casting import EPS_MM, LEAST_COSINE, LEAST_COSINE_OF_PRINT, blocked, checkered, textured
from stereolib.virtual.rendering import FRESNEL, LEAST_ROUGHNESS, LIGHT_AT_MM, aim, render
from stereolib.virtual.scene import Box, Light, Material, Scene

_NODE_PX = 8  # rays are computed exactly at every eighth pixel
_ALONG = ((1, 2), (0, 2), (0, 1))  # axes of a face across x, y, z
_SPARE = 1e-5  # more than single precision loses of x/z


def render_quickly(scene: Scene, rig: StereoRig, T_left_world: Float64) -> tuple[Floats, Floats]:
    """Draw the pictures of both cameras of a rig, fast enough for a slider.

    Parameters
    ----------
    scene : Scene
        With a camera outside its room, it is drawn by `render`.
    rig : StereoRig
    T_left_world : (4, 4) array
        Where the left camera stands.

    Returns
    -------
    left, right : (H, W, 3) float32
        What `render_pair` draws with ``samples=1, light_samples=1`` to within 1/255 at 99 % of the pixels; from
        `render` float64.

    Examples
    --------
    >>> from stereolib.virtual import cube_scene, recordings
    >>> rig = recordings.rectified().rig
    >>> left, right = render_quickly(cube_scene(700.0), rig, recordings.setup())
    >>> left.shape, left.dtype
    ((480, 640, 3), dtype('float32'))
    """
    poses = T_left_world, rigid(rig.R, rig.T) @ T_left_world
    draw = _draw if _is_inside(scene, poses) else _draw_exactly
    with ThreadPoolExecutor(2) as both:
        left, right = both.map(draw, (scene, scene), (rig.left, rig.right), poses)
    return left, right


def _draw_exactly(scene: Scene, camera: Camera, T_camera_world: Float64) -> Floats:
    return render(scene, camera, T_camera_world, samples=1, light_samples=1)


def _is_inside(scene: Scene, poses: tuple[Float64, Float64]) -> bool:
    """Whether the cameras stand inside whatever is a room."""
    rooms = [box for box in scene.boxes if box.inside]
    return all((np.abs(_within(box, _eye(T))) < np.array(box.size_mm) / 2).all() for box in rooms for T in poses)


def _eye(T_camera_world: Float64) -> Float64:
    return np.asarray(-T_camera_world[:3, :3].T @ T_camera_world[:3, 3])


def _within(box: Box, points: Float64) -> Float64:
    """World points (..., 3) in the frame of a box."""
    return np.asarray((points - box.T_world_box[:3, 3]) @ box.T_world_box[:3, :3])


@dataclass(frozen=True, eq=False)
class _Lens:
    """A camera's rays (x/z, y/z, 1) as planes (3, H, W), their lengths (H, W), and what each column and row covers.

    `columns` (2, W) has the least and greatest x/z of each column, `rows` (2, H) the y/z of each row.
    """

    rays: Float32
    length: Float32
    columns: Float32
    rows: Float32


def _lens(camera: Camera) -> _Lens:
    return _lens_of(camera.K.tobytes(), camera.dist.tobytes(), camera.size)


@lru_cache(maxsize=8)
def _lens_of(K: bytes, dist: bytes, size: tuple[int, int]) -> _Lens:
    camera = Camera(np.frombuffer(K).reshape(3, 3), np.frombuffer(dist), size)
    (u, along_u), (v, along_v) = (_nodes(n) for n in size)
    nodes = np.stack(np.meshgrid(u, v), -1).reshape(-1, 2)
    rays = camera.rays(nodes)
    lost = np.isnan(rays[:, 0])
    rays[lost] = camera.rays(nodes[lost], clamp=True)
    xy = np.stack([along_v @ plane.reshape(len(v), len(u)) @ along_u.T for plane in rays[:, :2].T])
    near_lost, near_found = (_touched(along_v, some.reshape(len(v), len(u)), along_u) for some in (lost, ~lost))
    rows, columns = np.nonzero(near_lost & near_found)  # at the fold of a lens nothing can be interpolated
    xy[:, rows, columns] = camera.rays(np.column_stack([columns, rows]), clamp=True)[:, :2].T
    x, y = xy.astype(np.float32)
    length = np.sqrt(x * x + y * y + 1)
    columns_see, rows_see = np.stack([x.min(0), x.max(0)]), np.stack([y.min(1), y.max(1)])
    return _Lens(np.stack([x, y, np.ones_like(x)]), length, columns_see, rows_see)


def _nodes(count: int) -> tuple[Float64, Float64]:
    """Places of nodes (n,) among pixels 0 to count - 1, and weights (count, n) of cubic interpolation from them."""
    n = max(4, -(-(count - 1) // _NODE_PX) + 1)
    x = np.arange(count) * ((n - 1) / max(count - 1, 1))
    first = np.clip(x.astype(int) - 1, 0, n - 4)
    t = x - first - 1  # the four nodes stand at -1, 0, 1, 2
    weights = np.zeros((count, n))
    cubic = -t * (t - 1) * (t - 2) / 6, (t + 1) * (t - 1) * (t - 2) / 2, -(t + 1) * t * (t - 2) / 2, (t**3 - t) / 6
    for k, weight in enumerate(cubic):
        weights[np.arange(count), first + k] = weight
    return np.linspace(0, count - 1, n), weights


def _touched(along_v: Float64, nodes: Bools, along_u: Float64) -> Bools:
    """Which pixels (H, W) are interpolated from some of these nodes (n, m)."""
    return np.asarray((along_v != 0).astype(float) @ nodes @ (along_u != 0).T.astype(float) > 0)


#: Places on a face: u, v, and how far from the eye along its ray, each (N,).
_Place: TypeAlias = tuple[Float32, Float32, Float32]


@dataclass(frozen=True, eq=False)
class _Seen:
    """What each pixel sees, (H, W): its surface (6 * box + face, or -1), where on it, and how far along its ray."""

    surface: Ints
    u: Float32
    v: Float32
    along: Float32

    def flat(self) -> _Seen:
        """The same, (H * W,)."""
        return _Seen(self.surface.reshape(-1), self.u.reshape(-1), self.v.reshape(-1), self.along.reshape(-1))

    def keep(self, nearer: Bools, surface: Ints | int, u: Float32, v: Float32, along: Float32) -> None:
        """Put what is nearer before what was seen."""
        np.copyto(self.surface, surface, where=nearer, casting="same_kind")
        for plane, new in ((self.u, u), (self.v, v), (self.along, along)):
            np.copyto(plane, new, where=nearer)


@dataclass(frozen=True, eq=False)
class _Face:
    """A face in the frame of its box: its axis and the two along it, where it lies, and where it looks to (1, -1)."""

    box: Box
    number: int

    @property
    def axis(self) -> int:
        return self.number // 2

    @property
    def along(self) -> tuple[int, int]:
        return _ALONG[self.axis]

    @property
    def place_mm(self) -> float:
        return (self.number % 2 - 0.5) * self.box.size_mm[self.axis]

    @property
    def front(self) -> int:
        return (1 if self.number % 2 else -1) * (-1 if self.box.inside else 1)

    @property
    def material(self) -> Material:
        return self.box.materials[self.number]

    def above_mm(self, points: Float64) -> Float64:
        """How high points (..., 3) in the frame of the box stand before the face, mm."""
        return np.asarray(self.front * (points[..., self.axis] - self.place_mm))

    def world(self, u: Float32, v: Float32) -> Float32:
        """Points just above the face, (N, 3) mm."""
        local = np.full((len(u), 3), self.place_mm + self.front * EPS_MM, np.float32)
        local[:, self.along[0]], local[:, self.along[1]] = u, v
        T = self.box.T_world_box.astype(np.float32)
        return np.asarray(local @ T[:3, :3].T + T[:3, 3])


@dataclass(frozen=True, eq=False)
class _View:
    """Rays from an eye, or from its mirror image behind a face: then they begin where they leave the face.

    `rays` (3, N) with third row 1 are turned into the world by `R`; `length` (N,) is theirs, and they begin `begin`
    (N,) times that away from the eye.
    """

    eye: Float64
    R: Float64
    rays: Float32
    length: Float32
    begin: Float32 | None = None

    def directions(self, box: Box) -> Float32:
        """Of the rays in the frame of a box, in the shape of `rays`."""
        turn = (box.T_world_box[:3, :3].T @ self.R).astype(np.float32)
        return np.asarray((turn @ self.rays.reshape(3, -1)).reshape(self.rays.shape))

    def mirrored(self, face: _Face, at: Ints, along: Float32) -> _View:
        """Some of the rays from where a face mirrors them, so far along each."""
        normal = face.front * face.box.T_world_box[:3, face.axis]
        above = float(face.above_mm(_within(face.box, self.eye)))
        R = (np.eye(3) - 2 * np.outer(normal, normal)) @ self.R
        return _View(self.eye - 2 * above * normal, R, self.rays[:, at], self.length[at], along)


def _draw(scene: Scene, camera: Camera, T_camera_world: Float64) -> Floats:
    lens = _lens(camera)
    view = _View(_eye(T_camera_world), T_camera_world[:3, :3].T, lens.rays, lens.length)
    seen = _look(scene, view, [_window(box, lens, T_camera_world) for box in scene.boxes])
    flat = _View(view.eye, view.R, view.rays.reshape(3, -1), view.length.reshape(-1))
    picture = _colours(scene, flat, seen.flat(), float(1 / camera.K[0, 0]))
    return picture.reshape(*seen.surface.shape, 3)


def _colours(scene: Scene, view: _View, seen: _Seen, pixel_rad: float) -> Float32:
    """What comes along the rays of a view, (N, 3): of mirrored ones without what is mirrored again."""
    picture = np.zeros((len(seen.surface), 3), np.float32)
    distance = seen.along * view.length
    covered = (distance if view.begin is None else (seen.along - view.begin) * view.length) * pixel_rad
    for number in np.flatnonzero(np.bincount(seen.surface + 1)[1:]).tolist():
        at, face = np.flatnonzero(seen.surface == number), _Face(scene.boxes[number // 6], number % 6)
        place, eye = (seen.u[at], seen.v[at], distance[at]), _within(face.box, view.eye)
        light, glare = _light(scene, face, place, eye)
        light *= _pattern(face, place, eye, covered[at])
        shown = light[:, None] * np.array(face.material.color_bgr, np.float32)
        if face.material.gloss:
            shown += glare[:, None]
            if view.begin is None:
                behind = view.mirrored(face, at, seen.along[at])
                there = [None if box is face.box and not box.inside else (slice(None),) for box in scene.boxes]
                mirror = _fresnel(face.material, float(face.above_mm(eye)) / place[2]) * (1 - face.material.roughness)
                shown += mirror[:, None] * _colours(scene, behind, _look(scene, behind, there), pixel_rad)
        picture[at] = shown
    return picture


def _look(scene: Scene, view: _View, windows: Sequence[tuple[slice, ...] | None]) -> _Seen:
    """What the rays of a view meet; each box is looked for in its window, if it has one."""
    shape = view.length.shape
    nothing = np.full(shape, -1, np.int16), *np.zeros((2, *shape), np.float32), np.full(shape, np.inf, np.float32)
    seen = _Seen(*nothing)
    for index, (box, window) in enumerate(zip(scene.boxes, windows, strict=True)):
        if window is not None:
            part = _Seen(seen.surface[window], seen.u[window], seen.v[window], seen.along[window])
            begin = None if view.begin is None else view.begin[window]
            near = _View(view.eye, view.R, view.rays[:, *window], view.length[window], begin)
            meet = _meet_room if box.inside else _meet_box
            meet(part, 6 * index, box, near)
    return seen


def _window(box: Box, lens: _Lens, T_camera_world: Float64) -> tuple[slice, slice] | None:
    """Rows and columns of the rectangle of the picture in which a box can be seen; None if it cannot."""
    corners = _corners(box) @ T_camera_world[:3, :3].T + T_camera_world[:3, 3]
    if corners[:, 2].max() <= 0:
        return None
    if corners[:, 2].min() <= EPS_MM:
        return slice(None), slice(None)
    xy = corners[:, :2] / corners[:, 2:]
    found = []
    for seen, low, high in zip((lens.columns, lens.rows), xy.min(0) - _SPARE, xy.max(0) + _SPARE, strict=True):
        at = np.flatnonzero((seen[1] >= low) & (seen[0] <= high))
        if not at.size:
            return None
        found.append(slice(int(at[0]), int(at[-1]) + 1))
    return found[1], found[0]


def _corners(box: Box) -> Float64:
    """(8, 3) mm, world frame."""
    signs = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    return np.asarray(signs * box.size_mm @ box.T_world_box[:3, :3].T + box.T_world_box[:3, 3])


def _meet_room(seen: _Seen, first: int, box: Box, view: _View) -> None:
    """Where rays from within meet the walls: at the nearest of three planes."""
    eye, (x, y, z) = _within(box, view.eye).tolist(), view.directions(box)
    with np.errstate(divide="ignore"):
        ways = [(np.copysign(s / 2, d) - e) / d for s, e, d in zip(box.size_mm, eye, (x, y, z), strict=True)]
    along = np.minimum(np.minimum(ways[0], ways[1]), ways[2])
    at_x, at_z = ways[0] == along, ways[2] == along
    face = np.where(at_x, x > 0, np.where(at_z, 4 + (z > 0), 2 + (y > 0)).astype(np.int16))
    local = [e + along * d for e, d in zip(eye, (x, y, z), strict=True)]
    u, v = np.where(at_x, local[1], local[0]), np.where(at_z, local[1], local[2])
    seen.keep(along < seen.along, first + face, u, v, along)


def _meet_box(seen: _Seen, first: int, box: Box, view: _View) -> None:
    """Where rays meet the faces that look at the eye, three at most."""
    eye, directions = _within(box, view.eye).tolist(), view.directions(box)
    begin = EPS_MM if view.begin is None else view.begin
    for axis, (a, b) in enumerate(_ALONG):
        half_mm = box.size_mm[axis] / 2
        if abs(eye[axis]) <= half_mm:
            continue
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (float(np.copysign(half_mm, eye[axis])) - eye[axis]) / directions[axis]
            u, v = eye[a] + along * directions[a], eye[b] + along * directions[b]
            met = (np.abs(u) < box.size_mm[a] / 2) & (np.abs(v) < box.size_mm[b] / 2)
        met &= (along > begin) & (along < seen.along)
        seen.keep(met, first + 2 * axis + int(eye[axis] > 0), u, v, along)


def _pattern(face: _Face, place: _Place, eye: Float64, covered: Float32) -> Floats | float:
    """Relative reflectance at places on a face, (N,); `covered` is the width of a pixel there, held across its ray."""
    material, above, (u, v, distance) = face.material, float(face.above_mm(eye)), place
    if material.checker:
        cos = np.maximum(above / distance, LEAST_COSINE_OF_PRINT)
        slopes = ((x - float(eye[axis])) / distance / cos for x, axis in zip((u, v), face.along, strict=True))
        wide_u, wide_v = (covered * np.sqrt(1 + slope * slope) for slope in slopes)
        return checkered(material.checker, u, v, (wide_u, wide_v))
    if not material.contrast:
        return 1.0
    return textured(material, face.number, u, v, covered / np.sqrt(np.maximum(above / distance, LEAST_COSINE)))


def _light(scene: Scene, face: _Face, place: _Place, eye: Float64) -> tuple[Float32, Float32]:
    """Diffuse light that falls on places of a face, and glare from there into an eye, each (N,)."""
    u, v, _ = place
    light, glare = np.full(len(u), scene.ambient, np.float32), np.zeros(len(u), np.float32)
    (a, b), T = face.along, face.box.T_world_box
    for lamp in scene.lights:
        stands, shines = _within(face.box, np.array(lamp.position_mm)), (aim(lamp) @ T[:3, :3]).tolist()
        above = float(face.above_mm(stands))
        if above > 0:
            du, dv = u - float(stands[a]), v - float(stands[b])
            forward = du * shines[a] + dv * shines[b] - face.front * above * shines[face.axis]
            square = du * du + dv * dv + above**2
            falls = np.maximum(forward, 0) / (square * square) * (lamp.power * LIGHT_AT_MM**2 * above)
            for box in scene.boxes:
                if box is not face.box and not box.inside:
                    falls[_shadow(box, face, u, v, lamp)] = 0
            light += falls
            if face.material.gloss:
                glare += falls * _glare(face, place, eye, (-du, -dv, above), np.sqrt(square))
    return light, glare


def _glare(face: _Face, place: _Place, eye: Float64, lamp: tuple[Float32, Float32, float], reach: Float32) -> Float32:
    """Glare for each unit of light that falls, ``D F G / (4 n.v n.l)`` as in `render`; `lamp` as seen from there."""
    (u, v, distance), (a, b), material = place, face.along, face.material
    nl, nv = lamp[2] / reach, float(face.above_mm(eye)) / distance
    eye_u, eye_v = ((float(eye[axis]) - x) / distance for axis, x in ((a, u), (b, v)))
    half = lamp[0] / reach + eye_u, lamp[1] / reach + eye_v, nl + nv
    aside = half[0] * half[0] + half[1] * half[1]
    square = aside + half[2] * half[2]
    vh = np.maximum((eye_u * half[0] + eye_v * half[1] + nv * half[2]) / np.sqrt(square), 0)
    a2 = material.roughness**4 + LEAST_ROUGHNESS
    spread = a2 / np.pi * np.square(square / (aside + a2 * half[2] * half[2]))
    k = a2**0.5 / 2
    return np.asarray(spread * _fresnel(material, vh) / (4 * (nl * (1 - k) + k) * (nv * (1 - k) + k)))


def _fresnel(material: Material, cos: Float32) -> Float32:
    """Share of the light that gloss sends back, met at this angle."""
    lost = 1 - cos
    return np.asarray(material.gloss * (FRESNEL + (1 - FRESNEL) * np.square(np.square(lost)) * lost))


def _shadow(box: Box, face: _Face, u: Float32, v: Float32, lamp: Light) -> Ints:
    """Indices of the places on a face that a box hides from the middle of a lamp: tried where its shadow can fall."""
    spot = np.array(lamp.position_mm)
    stands, corners = (_within(face.box, points) for points in (spot, _corners(box)))
    above, lamp_above = face.above_mm(corners), face.above_mm(stands)
    if above.max() <= 0:
        return np.zeros(0, np.intp)
    if above.max() < lamp_above:
        thrown = stands + (corners - stands) * (lamp_above / (lamp_above - above))[:, None]
        (low_u, high_u), (low_v, high_v) = ((float(thrown[:, k].min()), float(thrown[:, k].max())) for k in face.along)
        at = np.flatnonzero((u > low_u) & (u < high_u) & (v > low_v) & (v < high_v))
    else:
        at = np.arange(len(u))
    return at[blocked([box], face.world(u[at], v[at]), spot.astype(np.float32))]
