"""Two pixels to a length: what lies between two clicks, with no floor and no box assumed."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from stereolib.base import Float32, Float64, UInt8
from stereolib.matching import SGBMParams, compute_disparity
from stereolib.measurement.camera_moves import see_pair
from stereolib.measurement.instrument import Instrument, SystematicUncertainty
from stereolib.measurement.plane_alignment import CannotMeasure, align
from stereolib.measurement.views import Views
from stereolib.rig import RectifiedRig

_NEAREST_PX = 2  # of a pixel at an outline: the nearer surface within it is meant
_AROUND_PX = 12  # half edge of the windows in which the surface is looked for: around the pixel, and beside it
_SHIFTS = tuple((u, v) for u in (0, -1, 1) for v in (0, -1, 1))
_PREFER = 0.1  # by how much worse a window may fit for each step that it is nearer
_ROUNDS = 4  # of the fit, in which pixels come and go
_OFF_PX = 1.0  # from the surface, beyond which a disparity belongs to another one
_FIRST_OFF_PX = 3.0  # the same, before the plane is known: of steep faces
_LEAST_SHARE = 0.5  # of a window's pixels that lie on its plane
_LEAST_STD_PX = 0.04  # of a disparity: what neither the pictures nor the matcher show, as a surface that is not plane
_MOST_STD_PX = 0.7  # beyond which nothing is said
_CLICK_STD_PX = 0.5  # of the picked column and row: a hand and an eye hit a mark no better
_STEP_PX = 3.0  # of disparity, between a near surface and a far one in a window


@dataclass(frozen=True, eq=False)
class SurfacePoint:
    """A point of a surface, by its pixel.

    Attributes
    ----------
    pixel : (2,) float64
        Column and row in the rectified left picture, px.
    disparity_px, std_px : float
        Of the surface there, and its standard deviation.
    name : str
        What errors call it; by default its pixel in the rectified picture.
    slope : (2,) float64
        By how much the disparity grows with each column and row: a pixel picked beside the one that was meant lies
        elsewhere on the surface.
    """

    pixel: Float64
    disparity_px: float
    std_px: float
    name: str = ""
    slope: Float64 = field(default_factory=lambda: np.zeros(2))


@dataclass(frozen=True, eq=False)
class Between:
    """What lies between two points.

    Attributes
    ----------
    points_mm : (2, 3) float64
        In the rectified left camera's frame.
    disparity_px : (2,) float64
        Of both points.
    length_mm, std_mm : float
        The standard deviation holds the matcher's scatter, 0.5 px of picking in each column and row (along the
        surface, so that its depth changes with it), and what the calibration leaves open.
    warnings : tuple of str
        What speaks against the pair or the rig.
    """

    points_mm: Float64
    disparity_px: Float64
    length_mm: float
    std_mm: float
    warnings: tuple[str, ...] = ()

    @property
    def depth_mm(self) -> Float64:
        """Of both points. (2,), mm."""
        return self.points_mm[:, 2]


def find_surface(views: Views, disparity_px: Float32, pixel: npt.ArrayLike, name: str = "") -> SurfacePoint:
    """Find the surface at a pixel: the nearer one, at an outline.

    Parameters
    ----------
    views : Views
    disparity_px : (H, W) float
        Of its left picture, as `match_views` finds it, px; NaN where nothing was matched.
    pixel : (2,) array_like, px
        Column and row in the rectified left picture.
    name : str
        What errors call it; by default this pixel.

    Returns
    -------
    SurfacePoint

    Raises
    ------
    ValueError
        If the pixel is outside the picture, nothing was matched there, or the pictures show too little to be sure; the
        text says whether it is hidden from the right camera, outside of its picture, at a step, or too plain.

    Notes
    -----
    A plane ``d = a u + b v + c`` through the disparities of a window around the pixel, or of one of eight beside it, of
    which the best plane is taken: on an edge that of one face. Least squares, with those left out that are off by more
    than 1 px; then both pictures are aligned over it (`align`). The variance at the pixel is that of the alignment,
    plus the square of what it moved, plus ``0.04^2``.

    References
    ----------
    Kanade, Okutomi: A stereo matching algorithm with an adaptive window. IEEE PAMI 16 (1994), doi:10.1109/34.310690.
    """
    at = np.asarray(pixel, np.float64)
    height, width = disparity_px.shape
    u, v = (int(np.rint(c)) if np.isfinite(c) else -1 for c in at)
    where = name or _rectified_name(at)
    if not (0 <= u < width and 0 <= v < height):
        raise ValueError(
            f"{where} is outside what is left of the picture once it is rectified: choose one farther inside"
        )
    near = disparity_px[_around(v, _NEAREST_PX, height), _around(u, _NEAREST_PX, width)]
    if not np.isfinite(near).any():
        raise ValueError(f"{where}: nothing was matched there: {_why_none(disparity_px, u, v)}")
    tried = (_fit_plane(disparity_px, at, shift, float(np.nanmax(near))) for shift in _SHIFTS)
    if not (planes := [plane for plane in tried if plane is not None]):
        raise ValueError(f"{where}: hardly anything was matched around it: {_why_none(disparity_px, u, v)}")
    best = min(planes, key=lambda plane: plane.rms_px)
    try:
        fit = align(views.pair, best.columns, best.rows, best.sides, best.parameters)
    except CannotMeasure as error:
        raise ValueError(f"{where}: {error}: {_why_none(disparity_px, u, v)}") from None
    found = float(fit.parameters[2])
    std = float(np.sqrt(fit.covariance[2, 2] + (found - best.parameters[2]) ** 2 + _LEAST_STD_PX**2))
    if not std < _MOST_STD_PX:
        raise ValueError(f"{where}: its depth is not sure: {_why_none(disparity_px, u, v)}")
    return SurfacePoint(at, found, std, name, fit.parameters[:2])


def _why_none(disparity_px: Float32, u: int, v: int) -> str:
    """Why a pixel's depth is not told, as the disparities beside it in its row show, and what helps."""
    row, columns = disparity_px[v], np.arange(disparity_px.shape[1])
    known = np.isfinite(row)
    beside = [*columns[known & (columns <= u)][-1:], *columns[known & (columns >= u)][:1]]
    own = float(row[beside].min(initial=np.inf))  # a hole belongs to what is farther
    around = row[_around(u, _AROUND_PX, len(row))]
    covers = (columns > u) & (row > own + _STEP_PX) & (np.abs(row - own - (columns - u)) <= _OFF_PX)
    if covers.any():  # it comes to lie on the same column of the right picture
        return "the right camera does not see it, as something nearer stands before it: choose one that both see"
    if np.isfinite(own) and u < own:
        return "the right camera's picture does not reach so far: choose one farther to the right"
    if np.isfinite(around).any() and np.nanmax(around) - np.nanmin(around) > _STEP_PX:
        return "it lies at a step between something near and something far: choose one a few pixels inside a surface"
    return "too little texture around it: choose another one, or more light"


def _rectified_name(at: Float64) -> str:
    return f"pixel {at[0]:g},{at[1]:g} of the rectified left picture"


class _Plane(NamedTuple):
    """Pixels of a window and the plane through their disparities: the last parameter is its value at the pixel."""

    parameters: Float64
    rms_px: float
    columns: Float64
    rows: Float64
    sides: Float64


def _fit_plane(disparity_px: Float32, at: Float64, shift: tuple[int, int], start_px: float) -> _Plane | None:
    """The plane in a window beside or around a pixel; None where hardly anything fits it there."""
    u, v = np.rint(at).astype(int) + np.multiply(shift, _AROUND_PX)
    window = _around(v, _AROUND_PX, disparity_px.shape[0]), _around(u, _AROUND_PX, disparity_px.shape[1])
    rows, columns = (grid.ravel().astype(float) for grid in np.mgrid[window])
    d = disparity_px[window].ravel()
    sides = np.column_stack([columns - at[0], rows - at[1], np.ones(d.size)])
    plane, off_px = np.array([0.0, 0.0, start_px]), _FIRST_OFF_PX
    for _ in range(_ROUNDS):
        on = np.abs(d - sides @ plane) < off_px
        if on.sum() < _LEAST_SHARE * d.size:
            return None
        plane, off_px = np.linalg.lstsq(sides[on], d[on], rcond=None)[0], _OFF_PX
    if abs(plane[2] - start_px) > _FIRST_OFF_PX:
        return None
    rms = float(np.sqrt(np.mean((d[on] - sides[on] @ plane) ** 2)))
    return _Plane(plane, rms * (1 + _PREFER * np.abs(shift).sum()), columns[on], rows[on], sides[on])


def _around(at: int, by: int, most: int) -> slice:
    return slice(max(at - by, 0), min(at + by + 1, most))


def measure_between(
    one: SurfacePoint,
    other: SurfacePoint,
    rectified: RectifiedRig,
    uncertainty: SystematicUncertainty | None = None,
    *,
    columns_std_px: float = 0.0,
) -> Between:
    """Measure how far two points lie apart.

    Parameters
    ----------
    one, other : SurfacePoint
    rectified : RectifiedRig
    uncertainty : SystematicUncertainty, optional
        What the calibration leaves open.
    columns_std_px : float
        Standard deviation of something else that shifts all disparities.

    Returns
    -------
    Between

    Raises
    ------
    ValueError
        If a disparity is not positive and finite: such a point lies nowhere; or both are one point, of whose length,
        0, no deviation can be told.

    Notes
    -----
    ``X = (u - c_x) B / d, Y = (v - c_y) B / d, Z = f B / d`` (`RectifiedRig`); derivatives of the length by central
    differences. Where the errors from place to place are known, those of f, B and an offset are left out for them: the
    length errs by what both points do along it (`DisparityErrors.of_points`).
    """
    for point in (one, other):
        if not 0 < point.disparity_px < np.inf:
            where = point.name or _rectified_name(point.pixel)
            raise ValueError(f"{where} has a disparity of {point.disparity_px:.1f} px: too far to measure")
    if one.disparity_px == other.disparity_px and np.array_equal(one.pixel, other.pixel):
        raise ValueError(f"both ends are {one.name or _rectified_name(one.pixel)}: a length has two")
    known = uncertainty or SystematicUncertainty()
    alike = (known if known.errors is None else SystematicUncertainty()).with_offset(columns_std_px)
    K = rectified.P1[:, :3]

    def points(values: Float64) -> Float64:
        u, v, d = values[:6].reshape(2, 3).T
        f, B, offset = values[6] + rectified.f_px, values[7] + rectified.baseline_mm, values[8]
        depth = f * B / (d - offset)
        return np.column_stack([(u - K[0, 2]) / f * depth, (v - K[1, 2]) / f * depth, depth])

    def length(values: Float64) -> float:
        return float(np.linalg.norm(np.subtract(*points(values))))

    at = np.array([*one.pixel, one.disparity_px, *other.pixel, other.disparity_px, 0.0, 0.0, 0.0])
    covariance = np.zeros((9, 9))
    each = [_CLICK_STD_PX, _CLICK_STD_PX, one.std_px, _CLICK_STD_PX, _CLICK_STD_PX, other.std_px]
    covariance[:6, :6], covariance[6:, 6:] = np.diag(np.square(each)), alike.covariance
    for first, point in ((0, one), (3, other)):  # what is picked beside it lies on the same surface
        moved = _CLICK_STD_PX * np.column_stack([np.eye(2), point.slope]).T  # of u, v and d
        covariance[first : first + 3, first : first + 3] = moved @ moved.T + np.diag([0.0, 0.0, point.std_px**2])
    steps = 1e-3 * np.eye(9)
    slope = np.array([(length(at + step) - length(at - step)) / 2e-3 for step in steps])
    variance = float(slope @ covariance @ slope)
    if known.errors is not None:
        moved = np.subtract(*known.errors.of_points(*at[:6].reshape(2, 3).T))
        variance += float(np.square(np.subtract(*points(at)) / length(at) @ moved).sum())
    return Between(points(at), at[[2, 5]], length(at), float(np.sqrt(variance)))


def length_between(
    left: UInt8, right: UInt8, pixels: npt.ArrayLike, instrument: Instrument, *, is_rectified: bool = False
) -> Between:
    """Measure what lies between two pixels of a pair as the cameras gave it.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
    pixels : (2, 2) array_like, px
        Columns and rows in the left picture, as the camera gave it.
    instrument : Instrument
    is_rectified : bool
        The pixels are those of the rectified left picture, as `measure_objects` returns it of this pair.

    Returns
    -------
    Between

    Raises
    ------
    ValueError
        As `find_surface` and `measure_between`, naming pixels as they were given; if one is outside the left picture,
        or pictures and calibration do not fit together.
    """
    views, instrument = see_pair(left, right, instrument)
    rectified, given = instrument.rectified, np.asarray(pixels, np.float64)
    frame = "rectified left picture" if is_rectified else "left picture"
    width, height = rectified.size if is_rectified else left.shape[1::-1]
    names = [f"pixel {column:g},{row:g} of the {frame}" for column, row in given]
    for column, row in given:
        if not (-0.5 <= column < width - 0.5 and -0.5 <= row < height - 0.5):
            raise ValueError(f"pixel {column:g},{row:g} is outside the {frame}, which is {width}x{height}")
    ends = given if is_rectified else rectified.rectify_points(given, "left")
    map_px = match_views(views)
    one, other = (find_surface(views, map_px, at, name) for at, name in zip(ends, names, strict=True))
    columns_std_px = float(np.hypot(views.rows.columns_std_px, instrument.turn_std_px))
    found = measure_between(one, other, rectified, instrument.uncertainty, columns_std_px=columns_std_px)
    unseen = instrument.turned_unseen(float(found.depth_mm.mean()))
    return replace(found, warnings=(*views.rows.warnings, *instrument.warnings, unseen))


def match_views(views: Views) -> Float32:
    """Match a pair in full size, in a window that holds what the half size saw.

    Parameters
    ----------
    views : Views

    Returns
    -------
    (H, W) float32, px
        NaN where nothing was matched.
    """
    seen = views.disparity_px[np.isfinite(views.disparity_px)]
    most = float(seen.max(initial=0.0))
    room = (views.left.shape[1] - 16) // 16 * 16
    return compute_disparity(
        views.left, views.right, SGBMParams(min(max(64, 16 * -(-int(most + 8) // 16)), room), mode="hh"), whole=True
    )
