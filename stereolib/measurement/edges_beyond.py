"""What lies beyond an edge of a face, or just inside of it: whether the face goes on there, or has ended before."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np

from stereolib.base import Bools, Float64
from stereolib.measurement.agreement import agreement
from stereolib.measurement.box import Box, Edge, Own, Side, World
from stereolib.measurement.light import Light, Picture, light_at
from stereolib.measurement.outline import edge_direction
from stereolib.measurement.regions import STEP, ObjectRegion
from stereolib.measurement.views import Views

_ACROSS_PX, _STEPS = np.arange(-6.0, 6.5, 0.5), 3  # points that are compared across it are a webcam's edge apart
_BESIDE_PX = 2.5  # from there on nothing of the edge is in it
_SURE = (0.1, 0.8)  # shares of the known extent between which it is the face's
_LEAST_PX, _BEYOND_PX = 8.0, 120.0  # so much must be known, and is looked at beyond
_STANDS_OUT = 2.0  # the edge's strength over that beside it: less tells nothing
_MOST, _WEIGHT = 1.0, 0.5  # logarithm of the odds of one pixel, at most; and what of it is its own, not its neighbour's
_FARTHEST_MM, _LEAST_AHEAD_MM = 1200.0, 1.0
_LEAST = 1e-3  # of a difference: what is less is none
_SPILL_PX = 4.0  # beyond an outline SGBM matches half its window as the nearer surface
_ON_FACE_PX = 1.5  # of disparity
_FACE_COLORS, _SAME_GREY, _ALIKE = (0.1, 0.9), 4.0, 0.2  # quantiles; grey levels; share of pixels that are alike
_MOST_INSIDE = 0.5  # share of a face, next to the corner, of which its colours are told
_LEAST_OTHER_PX, _LEAST_GAP_PX = 4, 8  # of another colour, beside the end of a face and farther in
_BESIDE = np.arange(3.0, 13.0)  # px beyond an edge that show what lies there
_INSIDE_PX, _SAMPLES = 24, 32  # lines within a face that tell its contrast, and points of each
_SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def upper_edge_beyond(light: Light, world: World, own: Float64, side: Side) -> tuple[float, float] | None:
    """Where the upper edge of a face ends, at the end that the face is taken to have or beyond.

    Parameters
    ----------
    light : (left, right), each (H, W, 3) or (H, W) uint8 or float32, or RawPicture
        Rectified pictures, or their light. The one that shows the face wider is looked at.
    world : World
        One, real.
    own : (8,) float64
        The box, in the order of `Own`.
    side : Side

    Returns
    -------
    (extent_mm, log_odds) or None
        Where it likeliest ends, and the logarithm of the odds for that against the known end; None where it does not
        stand out from what is beside it, and where the camera looks down on it: there it may run on into its shadow.

    Notes
    -----
    Each pixel along the line has a strength s, the difference across it; its median is S up to the known end, and T
    beside the line. Of exponential distributions ``log p(s | edge) - log p(s | none) = log T / S + s (1 / T - 1 / S)``,
    1 at most; half of it is summed beyond the known end.
    """
    boxes = np.repeat(own[None], 3, axis=0)
    boxes[:, side.extent] = 0.0, own[side.extent], _FARTHEST_MM
    tops = Box(boxes).edge(side.end)[:, 0]
    tops[:, 2] = own[Own.HEIGHT]
    ahead = (tops - [0.0, 0.0, float(world.camera_height)]) @ world.axes[:, 2]
    both = [world.pixels(tops, right) for right in (False, True)]
    width = [(u[1] - u[0]) * (1 if side is Side.RIGHT else -1) for u in (pixels[:, 0] for pixels in both)]
    picture, (corner, end, far) = light[int(np.argmax(width))], both[int(np.argmax(width))]
    known = int(np.hypot(*(end - corner)))
    from_above = float(world.camera_height) > own[Own.HEIGHT]
    if picture is None or from_above or ahead.min() < _LEAST_AHEAD_MM or max(width) <= 0 or known < _LEAST_PX:
        return None
    length = float(np.hypot(*(far - corner)))
    share = np.arange(1.0, min(known + _BEYOND_PX, length)) / length
    odds = _odds(picture, corner + share[:, None] * (far - corner), known)
    if odds is None:
        return None
    total = np.concatenate([[0.0], np.cumsum(odds)])
    best = int(total.argmax())
    at = (known + best) / length
    return float(_FARTHEST_MM * at / (at + (1 - at) * ahead[2] / ahead[0])), float(total[best])


def uprights_beyond(light: Light, world: World, own: Float64, ends: Iterable[Edge]) -> tuple[float, float] | None:
    """How high the upright edges of a box go, at the height that it is taken to have or beyond.

    Parameters
    ----------
    light : (left, right), each (H, W, 3) or (H, W) uint8 or float32, or RawPicture
        Rectified pictures, or their light.
    world : World
        One, real.
    own : (8,) float64
        The box, in the order of `Own`.
    ends : iterable of Edge
        Upright ones.

    Returns
    -------
    (height_mm, log_odds) or None
        Where they likeliest end, and the logarithm of the odds for that against the known height; None where none
        stands out in both pictures, or where they go on to the pictures' rim.

    Notes
    -----
    As `upper_edge_beyond`, of all edges together, and of both pictures the one that speaks for it less: what lies in
    line with an edge in one of them, farther away, does not in the other.
    """
    per_px = _mm_per_row(world, own)
    known = int(own[Own.HEIGHT] / max(per_px, _LEAST)) if per_px > 0 else 0
    if known < _LEAST_PX:
        return None
    heights = own[Own.HEIGHT] + per_px * np.arange(1 - known, 1 + int(_BEYOND_PX))
    total = _uprights_go_on(light, world, own, ends, heights, known)
    best = 0 if total is None else int(total.argmax())
    return None if total is None or best == len(total) - 1 else (float(heights[known - 1 + best]), float(total[best]))


def uprights_below(
    light: Light, world: World, own: Float64, ends: Iterable[Edge], followed_mm: float
) -> tuple[float, float] | None:
    """How far down the upright edges of a box go, below where its faces could be followed.

    Parameters
    ----------
    light, world, own, ends
        As of `uprights_beyond`.
    followed_mm : float
        Height down to which they were followed.

    Returns
    -------
    (height_mm, log_odds) or None
        Where they likeliest end, 0 being the floor, and the logarithm of the odds for that against the height to which
        they were followed; None where none stands out above in both pictures.
    """
    per_px = _mm_per_row(world, own)
    known, below = (int(mm / max(per_px, _LEAST)) for mm in (own[Own.HEIGHT] - followed_mm, followed_mm))
    if per_px <= 0 or known < _LEAST_PX:
        return None
    heights = followed_mm + per_px * np.arange(known - 1, -1 - below, -1.0)
    total = _uprights_go_on(light, world, own, ends, heights, known)
    best = 0 if total is None else int(total.argmax())
    return None if total is None else (float(heights[known - 1 + best]), float(total[best]))


def _mm_per_row(world: World, own: Float64) -> float:
    """How many millimetres a box's corner is high where a row of the picture shows it; not positive behind it."""
    off_mm = np.array([*own[[Own.X, Own.Y]], own[Own.HEIGHT]]) - [0.0, 0.0, float(world.camera_height)]
    return float(off_mm @ world.axes[:, 2]) / float(world.focal)


def _uprights_go_on(
    light: Light, world: World, own: Float64, ends: Iterable[Edge], heights: Float64, known: int
) -> Float64 | None:
    """Logarithm of the odds that upright edges go on to each of the heights beyond the first, known ones; from 0 on.

    None where none stands out in both pictures.
    """
    eye_mm, votes = np.array([0.0, 0.0, float(world.camera_height)]), list[Float64]()
    for edge in ends:
        line = np.column_stack([np.tile(Box(own).edge(edge)[0, :2], (len(heights), 1)), heights])
        if ((line - eye_mm) @ world.axes[:, 2]).min() < _LEAST_AHEAD_MM:
            continue
        odds = [
            _odds(picture, world.pixels(line, right), known)
            for picture, right in zip(light, (False, True), strict=True)
            if picture is not None
        ]
        shown = [each for each in odds if each is not None]
        if len(shown) == len(odds):
            n = min(len(each) for each in shown)
            votes.append(np.min([each[:n] for each in shown], axis=0))
    if not votes:
        return None
    n = min(len(each) for each in votes)
    return np.concatenate([[0.0], np.cumsum(np.sum([each[:n] for each in votes], axis=0))])


def matched_beyond(
    region: ObjectRegion, world: World, own: Float64, side: Side, edges: Iterable[Edge]
) -> dict[Edge, tuple[float, float]]:
    """How far the disparity map goes on with a face beyond its edges.

    Parameters
    ----------
    region : ObjectRegion
        What was matched of the object.
    world : World
        One, real.
    own : (8,) float64
        The box, in the order of `Own`.
    side : Side
        The face.
    edges : iterable of Edge
        Of its `top`, its `end`, and the corner.

    Returns
    -------
    dict of (beyond_px, more_mm)
        Area beyond an edge that lies on the face's plane to 1.5 px of disparity, over the edge's length: the first four
        pixels are not counted, SGBM spills over outlines; nor, beyond the corner, what may be the other face. And by
        how much the face is larger to where that ends, in the median column or row. Empty for a face that is less than
        8 px wide or high.
    """
    corners = np.zeros((len(_SQUARE), 3))
    corners[:, 0 if side is Side.RIGHT else 1], corners[:, 2] = _SQUARE.T
    box, pixels = Box(own), np.column_stack([region.u, region.v, np.ones(len(region.u))])
    quad = world.pixels(box.points(corners)).astype(np.float32)
    face, other = (world.disparity_plane(*box.plane(each)) for each in (side, side.other))
    if min(np.ptp(quad[:2, 0]), np.ptp(quad[1:3, 1])) < _LEAST_PX:
        return {}
    pixels = pixels[np.abs(region.disparity_px - pixels @ face) < _ON_FACE_PX]
    across, up, w = cv2.getPerspectiveTransform(quad, _SQUARE.astype(np.float32)) @ pixels.T
    across, up = across / w, up / w
    lies = {side.top: ([3, 2], across, up), side.end: ([1, 2], up, across), Edge.CORNER: ([0, 3], up, 1 - across)}
    found = dict[Edge, tuple[float, float]]()
    for edge in edges:
        ends, along, outwards = lies[edge]
        start, last = quad[ends]
        length_px = float(np.hypot(*(last - start)))
        off_px = np.abs((pixels[:, :2] - start) @ [start[1] - last[1], last[0] - start[0]]) / length_px
        beyond = (along > 0) & (along < 1) & (outwards > 1) & (off_px > _SPILL_PX)
        if edge is Edge.CORNER:
            beyond &= np.abs(pixels @ (face - other)) > 2 * _ON_FACE_PX
        lines, at = np.unique(pixels[beyond, 0 if edge is side.top else 1], return_inverse=True)
        farthest = np.ones(len(lines))
        np.maximum.at(farthest, at, outwards[beyond])
        more = float(np.median(farthest)) - 1.0 if len(lines) else 0.0
        known_mm = float(own[Own.HEIGHT if edge is side.top else side.extent])
        found[edge] = float(beyond.sum()) * STEP**2 / length_px, known_mm * more
    return found


def shown_beyond(views: Views, world: World, own: Float64, side: Side, edge: Edge, more_mm: float) -> float:
    """How many lines beyond an edge of a face both pictures show alike, if it goes on there, less those that differ.

    Parameters
    ----------
    views : Views
    world : World
        One, real.
    own : (8,) float64
        The box, in the order of `Own`.
    side : Side
        The face.
    edge : Edge
        Its `top`, its `end`, or the corner.
    more_mm : float
        How far it may go on.

    Returns
    -------
    float
        Lines a pixel apart, from the fifth pixel on. Plain ones count for nothing: SGBM takes what is plain beside a
        surface for that surface. All differ where they show the top there as well, or better.
    """
    count = int(more_mm / _mm_per_px(world, own, side, edge, more_mm))
    if count <= _SPILL_PX:
        return 0.0
    beyond, lines = _INSIDE_PX + int(_SPILL_PX) + 1, np.arange(-_INSIDE_PX, count + 1.0) * more_mm / count
    points = _along(own, side, edge, lines)
    along = agreement(views, world, points)
    if edge.is_top and float(world.camera_height) - own[Own.HEIGHT] > 1.5 * more_mm:  # what lies there may be the top
        top = agreement(views, world, _on_top(world, own, points[beyond:]))
        if np.nansum(top.whole) >= np.nansum(along.whole[beyond:]):
            return -float(len(points) - beyond)
    return float(along.votes(_INSIDE_PX)[beyond:].sum())


def is_matched_otherwise(views: Views, world: World, own: Float64, side: Side, extent_mm: float) -> bool:
    """Whether the disparity map has something else, before or behind a face, where that would have to go on.

    Parameters
    ----------
    views : Views
    world : World
        One, real.
    own : (8,) float64
        The box, in the order of `Own`.
    side : Side
        The face.
    extent_mm : float
        To which it may go on.

    Returns
    -------
    bool
        On more than half of the lines, a pixel apart, where anything was matched.
    """
    more_mm = extent_mm - float(own[side.extent])
    count = int(more_mm / _mm_per_px(world, own, side, side.end, more_mm)) if more_mm > 0 else 0
    lines = _along(own, side, side.end, np.arange(_SPILL_PX, count + 1.0) * more_mm / max(count, 1))
    return count > _SPILL_PX and agreement(views, world, lines).matched_share() < 1 / 2


def is_other_beyond(views: Views, world: World, own: Float64, side: Side, edge: Edge) -> bool:
    """Whether the left picture has another colour beyond an edge of a face than on it: it is no line on it then.

    Parameters
    ----------
    views : Views
    world : World
        One, real.
    own : (8,) float64
        The box, in the order of `Own`.
    side : Side
        The face.
    edge : Edge
        Its `top`, its `end`, or the corner.

    Returns
    -------
    bool
        Of the pixels 3 to 12 px beyond, less than a fifth has a colour that the face has, between its tenths from
        either end, to four grey levels. Not so where half of them lie outside of the picture.
    """
    size_mm = float(own[Own.HEIGHT if edge is side.top else side.extent])
    per_px = _mm_per_px(world, own, side, edge, -0.9 * size_mm)

    def colors(beyond_mm: Float64) -> Float64:
        found = _colors(views, world, _along(own, side, edge, beyond_mm))
        return found[np.isfinite(found).all(axis=-1)]

    face, beyond = colors(np.linspace(-0.95, -0.05, _INSIDE_PX) * size_mm), colors(per_px * _BESIDE)
    if not len(face) or len(beyond) < len(_BESIDE) * _SAMPLES / 2:
        return False
    return bool(_has_colors_of(face, beyond).mean() < _ALIKE)


def other_inside_mm(views: Views, world: World, own: Float64, side: Side) -> float:
    """By how much a face would be narrower if it ended where, before its end, another colour begins.

    Parameters
    ----------
    views : Views
    world : World
        One, real.
    own : (8,) float64
        The box, in the order of `Own`.
    side : Side
        The face.

    Returns
    -------
    float
        0 where it has its own colours throughout, but for the 4 px that an edge is wide. Another one tells, over its
        whole height, beside the end from 4 px on, farther in from 8 px on: be it a stripe on the face, or the gap
        between two things, no picture tells. The one that shows the face wider is looked at.
    """
    from scipy.ndimage import find_objects, label

    size_mm = float(own[side.extent])
    per_px = _mm_per_px(world, own, side, side.end, -0.9 * size_mm)
    count = int(size_mm / per_px - _SPILL_PX)  # beside the corner the other face may show
    if _MOST_INSIDE * size_mm <= _SPILL_PX * per_px:
        return 0.0
    ends = _along(own, side, side.end, np.array([0.0, -size_mm]))[:, 0]
    widths = [np.ptp(world.pixels(ends, right)[:, 0]) for right in (False, True)]
    right = bool(widths[1] > widths[0])
    inside = _along(own, side, side.end, -per_px * np.arange(1.0, count))
    face = _colors(
        views, world, _along(own, side, side.end, np.linspace(-0.95, -_MOST_INSIDE, _INSIDE_PX) * size_mm), right
    )
    face = face[np.isfinite(face).all(axis=-1)]
    if not len(face):
        return 0.0
    other = _has_colors_of(face, _colors(views, world, inside, right)).mean(axis=1) < _ALIKE
    stripes = [stripe for (stripe,) in find_objects(label(other)[0])]
    least = [_LEAST_OTHER_PX if stripe.start < _SPILL_PX else _LEAST_GAP_PX for stripe in stripes]
    wide = [stripe.stop for stripe, px in zip(stripes, least, strict=True) if stripe.stop - stripe.start >= px]
    return float(per_px * max(wide, default=0))


def _colors(views: Views, world: World, points_mm: Float64, right: bool = False) -> Float64:
    """Colours at points (..., 3) in one picture: (..., channels), NaN outside of it."""
    picture = views.right if right else views.left
    u, v = world.pixels(points_mm.reshape(-1, 3), right).astype(np.float32).T[:, None]
    inside = (u[0] >= 0) & (v[0] >= 0) & (u[0] < picture.shape[1]) & (v[0] < picture.shape[0])
    found = cv2.remap(picture, u, v, cv2.INTER_LINEAR).reshape(u.size, -1).astype(np.float64)
    found[~inside] = np.nan
    return np.asarray(found.reshape(*points_mm.shape[:-1], -1))


def _has_colors_of(face: Float64, colors: Float64) -> Bools:
    """Which colours (..., channels) a face (N, channels) has: between its tenths from either end, nearly."""
    darkest, lightest = np.quantile(face, _FACE_COLORS, axis=0)
    return np.asarray(((colors > darkest - _SAME_GREY) & (colors < lightest + _SAME_GREY)).all(axis=-1))


def _along(own: Float64, side: Side, edge: Edge, beyond_mm: Float64) -> Float64:
    """Points along an edge of a face, moved outwards over it by (N,) mm: (N, samples, 3)."""
    outwards = edge_direction(edge, own, side) * (-1.0 if edge is Edge.CORNER else 1.0)
    ends = Box(own + beyond_mm[:, None] * outwards).edge(edge)
    share = (np.arange(_SAMPLES)[:, None] + 0.5) / _SAMPLES
    return np.asarray(ends[:, :1] + share * (ends[:, 1:] - ends[:, :1]))


def _on_top(world: World, own: Float64, points_mm: Float64) -> Float64:
    """The points of a box's top that the left picture shows where it would show others, above it: (..., 3)."""
    eye_mm = np.array([0.0, 0.0, float(world.camera_height)])
    off_mm = points_mm - eye_mm
    return np.asarray(eye_mm + off_mm * ((own[Own.HEIGHT] - eye_mm[2]) / off_mm[..., 2:]))


def _mm_per_px(world: World, own: Float64, side: Side, edge: Edge, beyond_mm: float) -> float:
    """Over how many mm of a face an edge moves by a pixel, on the way so far outwards."""
    here, there = world.pixels(_along(own, side, edge, np.array([0.0, beyond_mm])).mean(axis=1))
    return abs(beyond_mm) / max(float(np.hypot(*(there - here))), 1.0)


def _odds(picture: Picture, line_px: Float64, known: int) -> Float64 | None:
    """Logarithm of the odds that points of a line are the edge that the first ones are, of those beyond, a pixel each.

    None where it does not stand out from what is beside it, and where the picture ends.
    """
    strength = _strength(picture, line_px)
    if strength.shape[1] <= known:
        return None
    off = np.abs(_ACROSS_PX[_STEPS:] + _ACROSS_PX[:-_STEPS]) / 2
    highest = np.maximum(np.maximum(strength[:-2], strength[1:-1]), strength[2:])  # to half a pixel it may lie aside
    on_edge, sure = highest[off[1:-1].argmin()], slice(round(_SURE[0] * known), round(_SURE[1] * known))
    S, T = float(np.median(on_edge[sure])), max(float(np.median(highest[off[1:-1] > _BESIDE_PX, sure])), _LEAST)
    if S < _STANDS_OUT * T:
        return None
    return np.asarray(_WEIGHT * np.clip(np.log(T / S) + on_edge[known:] * (1 / T - 1 / S), -_MOST, _MOST))


def _strength(picture: Picture, line_px: Float64) -> Float64:
    """Differences across a line at its points (N, 2), as far as the picture shows it: (across, N)."""
    along = line_px[-1] - line_px[0]
    across = np.array([-along[1], along[0]]) / np.hypot(*along)
    u, v = np.moveaxis((line_px + _ACROSS_PX[:, None, None] * across).astype(np.float32), 2, 0)
    (height, width), n = picture.shape[:2], len(line_px)
    inside = ((u > 1) & (u < width - 2) & (v > 1) & (v < height - 2)).all(axis=0)
    shown = n if inside.all() else int(inside.argmin())
    if shown == 0:
        return np.zeros((len(_ACROSS_PX) - _STEPS, 0))
    light = light_at(picture, u[:, :shown], v[:, :shown]).reshape(len(_ACROSS_PX), shown, -1)
    return np.asarray(np.abs(light[_STEPS:] - light[:-_STEPS]).mean(axis=2), np.float64)
