"""Measured objects drawn into the picture they were measured in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import cv2
import numpy as np

from stereolib.base import Float64, UInt8
from stereolib.measurement.floor import Floor
from stereolib.measurement.measure import Measurement
from stereolib.measurement.measured_object import UNSURE_MM, MeasuredObject
from stereolib.rig import check_image

#: Left, upper, right and lower end of something in a picture, px.
Frame: TypeAlias = tuple[float, float, float, float]
#: Of objects, red-green-blue, in pictures, meshes and maps (Okabe and Ito 2008; the third after Tol 2021, as green are
#: the laser's readings): they differ for the colour-blind too.
OBJECT_RGB = ((0, 114, 178), (213, 94, 0), (136, 34, 85), (204, 121, 167), (230, 159, 0), (86, 180, 233))
_READING_COLOR, _LABEL_COLOR = (115, 158, 0), (30, 30, 30)  # BGR: the laser's readings; behind a text
_NAMELESS = (140, 140, 140)
_FAINT = 0.1375  # share of the picture that shines through the boxes' lines
_LEAST_AHEAD_MM = 100.0  # nearer readings are not drawn: they project to anywhere
_FAR_PX = 1e4  # what projects farther from the picture is not drawn: OpenCV's coordinates overflow
_CROSS_PX, _DASH_PX = 12, 5  # half of a length's end with room around it; of an edge that is hidden
_ALONG = 100  # points of a line that its text must not cover
_FONT, _FONT_SCALE = cv2.FONT_HERSHEY_SIMPLEX, 0.7
_CAPTION_SCALE, _MARGIN_PX = 0.5, 6  # of a text below the picture, and around it
_NO_SIZE = "no size"
_WIDTH_PX = 640  # of a picture with texts of these sizes; they grow with it


def size_text(measured: MeasuredObject) -> str:
    """Say an object's sizes, ``"302 x 198 x 251 mm"``; a question mark where one is unknown.

    One that is known to 5 mm only, or worse, has its standard deviation with it: ``"302 x 198+-7 x 251 mm"``.

    Parameters
    ----------
    measured : MeasuredObject

    Returns
    -------
    str
    """
    told = [
        "?" if np.isnan(size) else f"{size:.0f}" + (f"+-{std:.0f}" if std >= UNSURE_MM else "")
        for size, std in zip(measured.size_mm, measured.std_mm, strict=True)
    ]
    return " x ".join(told) + " mm"


def why_text(measured: MeasuredObject) -> str:
    """Say why an object has no sizes, ``"no size: no texture"``.

    Parameters
    ----------
    measured : MeasuredObject

    Returns
    -------
    str
    """
    reasons = dict.fromkeys(why.reason.short for why in measured.reasons.values())
    return f"{_NO_SIZE}: {', '.join(reasons) or 'piece of a wall'}"


def draw_objects(measured: Measurement, *, scan: bool = True, names: Sequence[str] = (), sizes: bool = True) -> UInt8:
    """Draw a wire box and the sizes (length x width x height) of each object into the rectified left picture.

    Edges that the object itself hides are thin and dashed. Near objects are drawn over far ones, of which, without
    `names`, nothing shines through. Where more than one has sizes, each begins with a number, 1 being the nearest of
    these.

    Parameters
    ----------
    measured : Measurement
    scan : bool
        Also the laser's readings, as points on the floor.
    names : sequence of str
        What the objects are called in a map (`stereolib.mapping.Map.names_of`), one each: the first letter, A to Z,
        gives the colour; what has none is grey. By default the colours follow the objects' order.
    sizes : bool
        Also the sizes as a text, or why there are none; that short where the whole would lie on another object.

    Returns
    -------
    (H, W, 3) uint8
        The picture alone where no floor was seen: then nothing tells where the objects stand in it.
    """
    picture = cv2.cvtColor(measured.left, cv2.COLOR_GRAY2BGR) if measured.left.ndim == 2 else measured.left.copy()
    floor = measured.floor
    if floor is None:
        return picture
    if scan and len(measured.scan_mm):
        for u, v in _pixels(floor, measured.scan_mm[measured.scan_mm[:, 0] > _LEAST_AHEAD_MM], 0.0):
            if -_FAR_PX < u < _FAR_PX and -_FAR_PX < v < _FAR_PX:
                cv2.circle(picture, (round(u), round(v)), 2, _READING_COLOR, -1, cv2.LINE_AA)
    shown = list[tuple[tuple[str, ...], tuple[int, int, int], Float64]]()
    sized = [k for k, entry in enumerate(measured.objects) if np.isfinite(entry.size_mm).any()]
    pictured = [(k, entry) for k, entry in enumerate(measured.objects) if is_pictured(measured, entry)]
    outlines = [_rings(floor, entry) for _, entry in pictured]
    for (k, entry), rings in reversed(list(zip(pictured, outlines, strict=True))):
        name = names[k] if names else chr(ord("A") + k)
        color = OBJECT_RGB[(ord(name[0]) - ord("A")) % len(OBJECT_RGB)][::-1] if name else _NAMELESS
        layer = picture.copy()
        _draw_edges(layer, entry, rings[0], rings[1], color)
        nearer = [] if names else outlines[: len(outlines) - len(shown) - 1]
        _hide_behind(layer, picture, nearer)
        picture = cv2.addWeighted(layer, 1 - _FAINT, picture, _FAINT, 0)
        said = [size_text(entry)] if k in sized else [why_text(entry), _NO_SIZE]
        title = name if names else f"{sized.index(k) + 1}:" if k in sized and len(sized) > 1 else ""
        shown.append((tuple(f"{title} {text}".strip() for text in said), color, np.concatenate(rings)))
    taken = list[Frame]()
    for texts, color, ring in reversed(shown) if sizes else []:
        others = [(*other.min(axis=0), *other.max(axis=0)) for _, _, other in shown if other is not ring]
        _label(picture, texts, ring, color, taken, others)
    return picture


def is_pictured(measured: Measurement, item: MeasuredObject) -> bool:
    """Tell whether the rectified left picture shows an object, or a corner of it; a scan sees beside it, too.

    Parameters
    ----------
    measured : Measurement
    item : MeasuredObject
        Of its objects.

    Returns
    -------
    bool
        False where no floor was seen: then nothing tells.
    """
    if measured.floor is None:
        return False
    rings = _rings(measured.floor, item)
    inside = ((rings >= 0) & (rings < measured.left.shape[1::-1])).all(axis=-1)
    return bool(np.isfinite(rings).all() and np.abs(rings).max() <= _FAR_PX and inside.any())


def draw_length(left: UInt8, pixels: Sequence[tuple[float, float]], text: str) -> UInt8:
    """Draw a line between two pixels, and a text beside its middle.

    Parameters
    ----------
    left : (H, W) or (H, W, 3) uint8
    pixels : two of (column, row), px
    text : str

    Returns
    -------
    (H, W, 3) uint8

    Raises
    ------
    ValueError
        If it is no picture, or a pixel is none.
    """
    check_image(left)
    if not np.isfinite(pixels).all():
        raise ValueError(f"a line needs two pixels, got {pixels}")
    picture = cv2.cvtColor(left, cv2.COLOR_GRAY2BGR) if left.ndim == 2 else left.copy()
    ends = np.array(pixels, float)
    whole = np.rint(np.clip(ends, -_FAR_PX, _FAR_PX)).astype(int).tolist()
    cv2.line(picture, whole[0], whole[1], (255, 255, 255), 3, cv2.LINE_AA)
    cv2.line(picture, whole[0], whole[1], OBJECT_RGB[0][::-1], 1, cv2.LINE_AA)
    for end in whole:
        cv2.drawMarker(picture, end, OBJECT_RGB[1][::-1], cv2.MARKER_CROSS, 15, 2, cv2.LINE_AA)
    _label(picture, (text,), _beside(picture, text, ends), OBJECT_RGB[0][::-1], [], [])
    return picture


def add_caption(picture: UInt8, text: str) -> UInt8:
    """Add a line of text below a picture, whose own pixels stay where they are.

    Parameters
    ----------
    picture : (H, W) or (H, W, 3) uint8
    text : str
        Shrunk to the picture's width; nothing is added if there is none.

    Returns
    -------
    (H + h, W, 3) uint8
    """
    picture = picture if picture.ndim == 3 else np.repeat(picture[..., None], 3, axis=2)
    if not text:
        return picture
    (wide, high), low = cv2.getTextSize(text, _FONT, 1.0, 1)
    width = picture.shape[1]
    scale = min(_CAPTION_SCALE * _larger(picture), (width - 2 * _MARGIN_PX) / wide)
    strip = np.full((round((high + low) * scale) + 2 * _MARGIN_PX, width, 3), 255, np.uint8)
    cv2.putText(
        strip,
        text,
        (_MARGIN_PX, _MARGIN_PX + round(high * scale)),
        _FONT,
        scale,
        _LABEL_COLOR,
        _pen(picture),
        cv2.LINE_AA,
    )
    return np.vstack([picture, strip])


def _beside(picture: UInt8, text: str, ends: Float64) -> Float64:
    """Where a text hides no part of a line: beside its middle, above or below the whole of it; else not its ends."""
    (width, height), _ = cv2.getTextSize(text, _FONT, _FONT_SCALE * _larger(picture), _pen(picture))
    (x, y), line = ends.mean(axis=0), np.linspace(ends[0], ends[1], _ALONG)
    aside, far = width / 2 + 2 * _CROSS_PX, height + 8 + _CROSS_PX
    middle = y + height / 2 + 8
    over = [(x, ends[:, 1].min() - far + height), (x, ends[:, 1].max() + far + height)]
    places = [(x + aside, middle), (x - aside, middle), *over, (x, y), (x, 0.0), (x, picture.shape[0] - 1.0)]
    for points in (line, ends):
        for place in places:
            left, top, right, bottom = _frame(picture, width, height, *place)
            apart = np.maximum([left, top] - points, points - [right, bottom]).max(axis=1)
            if (apart > _CROSS_PX).all():
                return np.array([place])
    return np.array([(x, y)])


def _draw_edges(layer: UInt8, entry: MeasuredObject, bottom: Float64, top: Float64, color: Sequence[int]) -> None:
    """A solid's edges in the picture, from the rings of its foot and of its top."""
    is_closed = entry.shape in ("box", "circle")
    edges = [(ring[k - 1], ring[k], k) for ring in (bottom, top) for k in range(0 if is_closed else 1, len(ring))]
    is_seen = [True] * len(edges)
    uprights = list(zip(bottom, top, strict=True)) if entry.shape in ("box", "face") else []
    upright_seen = [True] * len(uprights)
    if is_closed and np.isfinite(entry.size_mm[2]):
        outwards = np.sign(_area(entry.outline_mm))  # of a ring that is seen from its outside, rows counting down
        sides = [
            outwards * _area(np.array([bottom[k - 1], bottom[k], top[k], top[k - 1]])) < 0 for k in range(len(top))
        ]
        is_top = outwards * _area(top) < 0
        is_seen = [*sides, *(side or is_top for side in sides)]
        upright_seen = [sides[k] or sides[(k + 1) % len(sides)] for k in range(len(uprights))]
    lines = [(start, end, seen) for (start, end, _), seen in zip(edges, is_seen, strict=True)]
    lines += [(start, end, seen) for (start, end), seen in zip(uprights, upright_seen, strict=True)]
    for start, end, seen in sorted(lines, key=lambda line: line[2]):  # what is seen lies over what is not
        count = 1 if seen else max(1, round(float(np.linalg.norm(end - start)) / (2 * _DASH_PX)))
        for k in range(count):
            part = [start + (end - start) * share for share in ((k, k + 1) if seen else (k / count, (k + 0.5) / count))]
            one, other = (tuple(np.rint(point).astype(int).tolist()) for point in part)
            cv2.line(layer, one, other, color, 2 if seen else 1, cv2.LINE_AA)


def _hide_behind(layer: UInt8, picture: UInt8, nearer: Sequence[Float64]) -> None:
    """Put the picture back where these rings of solids stand."""
    hidden = np.zeros(layer.shape[:2], np.uint8)
    for rings in nearer:
        cv2.fillConvexPoly(hidden, cv2.convexHull(np.rint(rings.reshape(-1, 2)).astype(np.int32)), 1)
    layer[hidden > 0] = picture[hidden > 0]


def _rings(floor: Floor, item: MeasuredObject) -> Float64:
    """Where the picture has an outline on the floor, and at the object's height if that is known: (2, corners, 2)."""
    height = item.size_mm[2]
    return np.stack([_pixels(floor, item.outline_mm, z) for z in (0.0, 0.0 if np.isnan(height) else height)])


def _area(ring: Float64) -> float:
    """Area of a polygon, positive where it turns from the first axis to the second."""
    x, y = ring.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2


def _pixels(floor: Floor, points_mm: Float64, z_mm: float) -> Float64:
    return floor.pixels(np.column_stack([points_mm, np.full(len(points_mm), z_mm)]))


def _frame(picture: UInt8, width: int, height: int, x: float, y: float) -> tuple[int, int, int, int]:
    """Left, upper, right and lower end of a text of this size above a pixel, inside the picture."""
    left = int(np.clip(x - width / 2, 4, picture.shape[1] - width - 4))
    bottom = int(np.clip(y - 8, height + 4, picture.shape[0] - 6))
    return left, bottom - height, left + width, bottom


def _label(
    picture: UInt8,
    texts: Sequence[str],
    corners: Float64,
    color: Sequence[int],
    taken: list[Frame],
    others: Sequence[Frame],
) -> None:
    """The first text that covers no others above an object or below it, else the last, where it covers less of them.

    One of several, which tell why there is no size, may stand a line farther off.

    It stays inside the picture, and below other texts.
    """
    for text in texts:
        (width, height), _ = cv2.getTextSize(text, _FONT, _FONT_SCALE * _larger(picture), _pen(picture))
        x, above, below = float(corners[:, 0].mean()), corners[:, 1].min(), corners[:, 1].max() + height + 16
        rows = [above, below, above - height - 8, below + height + 8][: 2 * min(len(texts), 2)]
        frames = [_frame(picture, width, height, x, float(y)) for y in rows]
        covered = [_overlap(_bordered(frame), [*others, *taken]) for frame in frames]
        left, top, right, bottom = frames[int(np.argmin(covered))]
        if min(covered) == 0:
            break
    while _overlap((left - 3, top - 5, right + 3, bottom + 5), taken):
        top, bottom = top + height + 6, bottom + height + 6
    taken.append((left, top, right, bottom))
    start, end = np.reshape(_bordered((left, top, right, bottom)), (2, 2)).tolist()
    cv2.rectangle(picture, start, end, _LABEL_COLOR, -1)
    cv2.rectangle(picture, start, end, color, 2)
    scale = _FONT_SCALE * _larger(picture)
    cv2.putText(picture, text, (left, bottom), _FONT, scale, (255, 255, 255), _pen(picture), cv2.LINE_AA)


def _bordered(frame: tuple[int, int, int, int]) -> tuple[int, int, int, int]:
    """A text's frame with the border drawn round it."""
    left, top, right, bottom = frame
    return left - 3, top - 4, right + 3, bottom + 5


def _overlap(frame: Frame, others: Sequence[Frame]) -> float:
    """Area of a frame that others cover, px^2."""
    mine, theirs = np.array(frame), np.array(others, float).reshape(-1, 4)
    shared = np.minimum(mine[2:], theirs[:, 2:]) - np.maximum(mine[:2], theirs[:, :2])
    return float(np.maximum(shared, 0).prod(axis=1).sum())


def _larger(picture: UInt8) -> float:
    """How many times as large texts are as in a picture of 640 columns, so that they can be read in a smaller view."""
    return float(max(1.0, picture.shape[1] / _WIDTH_PX))


def _pen(picture: UInt8) -> int:
    """Width of their strokes, px."""
    return round(_larger(picture))
