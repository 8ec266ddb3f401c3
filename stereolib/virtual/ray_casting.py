"""Ray casting: where rays meet the boxes of a scene, and what they meet there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stereolib.base import Bools, Float64, Floats, Ints
from stereolib.virtual import texture
from stereolib.virtual.scene import Box, Material, Scene

EPS_MM = 1e-2
_GREY_FROM_BGR = (0.114, 0.587, 0.299)  # ITU-R BT.601
_FACE_OFFSET_MM = 137.0  # each face of a box shows another part of the texture
LEAST_COSINE, LEAST_COSINE_OF_PRINT = 0.02, 0.05  # surfaces seen at a lower angle are blurred no more
_CONE_SPARE = 1e-5  # of a cosine: more than rounding takes
_LEAST_PATTERN, _MOST_PATTERN = 0.05, 1.95  # of the mean reflectance: a texture never turns black or glows
_INK = 0.05  # reflectance of a board's black squares, of the paper's


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
    distance, surface = first_surfaces(scene, origins, directions)
    distance = np.where(surface >= 0, distance, np.nan)
    points = np.atleast_2d(origins) + distance[:, None] * directions
    normal = np.full(directions.shape, np.nan)
    albedo, gloss = np.full(len(distance), np.nan), np.zeros(len(distance))
    for s in np.unique(surface[surface >= 0]):
        at = np.flatnonzero(surface == s)
        box, face = scene.boxes[s // 6], s % 6
        normal[at] = face_normal(box, face)
        tint = np.dot(box.materials[face].color_bgr, _GREY_FROM_BGR)
        no_footprint = np.zeros(len(at))
        albedo[at] = tint * face_pattern(box, face, points[at], directions[at], no_footprint)
        gloss[at] = box.materials[face].gloss
    return Hits(distance, normal, surface, albedo, gloss)


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


def first_surfaces(scene: Scene, origins: Float64, directions: Float64) -> tuple[Float64, Ints]:
    """Find the surface that each ray meets first.

    Parameters
    ----------
    scene : Scene
    origins : (3,) or (N, 3) array, mm
    directions : (N, 3) array
        Unit vectors, world frame.

    Returns
    -------
    distance : (N,) float64, mm
        inf where a ray meets nothing.
    surface : (N,) int
        ``6 * box + face``, or -1.
    """
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


def face_normal(box: Box, face: int) -> Float64:
    """Compute the normal of a face, towards where it is seen from.

    Parameters
    ----------
    box : Box
    face : int
        0 to 5, in the order of `Box`.

    Returns
    -------
    (3,) float64
        Unit vector, world frame.
    """
    outward = box.T_world_box[:3, face // 2] * (1 if face % 2 else -1)
    return -outward if box.inside else outward


def face_pattern(box: Box, face: int, points: Float64, directions: Float64, footprint_mm: Float64) -> Floats:
    """Look up the relative reflectance of points on a face: its texture or its checkerboard, filtered.

    Parameters
    ----------
    box : Box
    face : int
        0 to 5, in the order of `Box`.
    points : (N, 3) array, mm
    directions : (N, 3) array
        Unit vectors of the rays that met them, world frame.
    footprint_mm : (N,) array
        What a pixel covers there, across its ray.

    Returns
    -------
    (N,) array
    """
    material: Material = box.materials[face]
    T = box.T_world_box
    local = (points - T[:3, 3].astype(points.dtype)) @ T[:3, :3].astype(points.dtype)
    a, b = [i for i in range(3) if i != face // 2]
    cos = np.abs(directions @ face_normal(box, face).astype(points.dtype))
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
