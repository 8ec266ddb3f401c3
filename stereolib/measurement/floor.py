"""The floor as the pair sees it: a plane in disparity space, found robustly, and what it says about the camera."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stereolib.base import finite_array, set_frozen
from stereolib.measurement.plane_alignment import AlignedPair, CannotMeasure, align, cell_of, clustered_covariance
from stereolib.rig import RectifiedRig

Array = np.ndarray
_STEP = 7  # every seventh pixel, every seventh row


@dataclass(frozen=True, eq=False)
class Floor:
    """The floor's plane: ``disparity = plane . (u, v, 1)`` in the rectified left image.

    Attributes
    ----------
    rectified : RectifiedRig
    plane : (3,) float64
        px per px, px per px, px.
    covariance : (3, 3) float64
        Of `plane`; what the scatter of the disparities leaves open, without any common error.
    support : float
        Share of the image's pixels that lie on it, 0..1 (NaN if it was not fitted).

    Notes
    -----
    A plane ``n . X = 1`` has ``1/Z = n . K^-1 (u, v, 1)``, so that ``plane = f B K^-T n``: disparity is linear in the
    pixel on every plane. The camera stands ``1 / |n|`` above it, and ``n / |n|`` points down.
    """

    rectified: RectifiedRig
    plane: Array
    covariance: Array
    support: float = np.nan

    def __post_init__(self) -> None:
        set_frozen(self, plane=finite_array(self.plane, (3,), "plane"))
        set_frozen(self, covariance=finite_array(self.covariance, (3, 3), "covariance"))
        if not self.down[1] > 0:
            raise ValueError(f"the floor must lie below the camera; the plane {self.plane} has it above")

    @cached_property
    def _n(self) -> Array:
        return self.rectified.P1[:, :3].T @ self.plane / (self.rectified.f_px * self.rectified.baseline_mm)

    @cached_property
    def camera_height_mm(self) -> float:
        """Height of the left optical centre above the floor, mm."""
        return float(1 / np.linalg.norm(self._n))

    @cached_property
    def down(self) -> Array:
        """Unit vector straight down, in the rectified left camera's frame. (3,)."""
        return self._n / np.linalg.norm(self._n)

    @property
    def pitch_rad(self) -> float:
        """Angle of the optical axis above the horizontal, rad."""
        return float(-np.arcsin(self.down[2]))

    @property
    def roll_rad(self) -> float:
        """How far the camera leans to the right, rad: 0 with the baseline level."""
        return float(np.arctan2(self.down[0], self.down[1]))

    @cached_property
    def axes(self) -> Array:
        """World axes forward, left, up as rows, in the rectified left camera's frame. (3, 3).

        Forward is the optical axis laid flat on the floor.
        """
        forward = np.array([0.0, 0.0, 1.0]) - self.down[2] * self.down
        forward /= np.linalg.norm(forward)
        return np.stack([forward, np.cross(forward, self.down), -self.down])

    @cached_property
    def along(self) -> Array:
        """Rows that give, of a pixel's (u, v, 1), how far its ray goes forward and left per unit of depth. (2, 3)."""
        return np.asarray(self.axes[:2] @ np.linalg.inv(self.rectified.P1[:, :3]))

    def disparity(self, u: Array, v: Array) -> Array:
        """Disparity of the floor at pixels, px; zero and less at and above the horizon."""
        return self.plane[0] * u + self.plane[1] * v + self.plane[2]

    def height_mm(self, u: Array, v: Array, disparity_px: Array) -> Array:
        """Height above the floor of what pixels show, ``(1 - d_floor / d) / |n|``, mm."""
        return self.camera_height_mm * (1 - self.disparity(u, v) / disparity_px)

    def pixels(self, points_mm: Array) -> Array:
        """Pixels (N, 2) of the rectified left image of points (N, 3): forward, left, up from below the camera, mm."""
        ray = (np.asarray(points_mm, float) - [0.0, 0.0, self.camera_height_mm]) @ self.axes
        ahead = np.where(ray[:, 2:] > 0, ray[:, 2:], np.nan)
        return np.asarray(ray[:, :2] / ahead * self.rectified.f_px + self.rectified.P1[:2, 2])


def floor_from_pose(
    rectified: RectifiedRig,
    T_left_world: Array,
    *,
    height_std_mm: float = 0.0,
    pitch_std_rad: float = 0.0,
    roll_std_rad: float = 0.0,
) -> Floor:
    """The floor of a camera whose place is known, as from a board on the floor or a ruler.

    Parameters
    ----------
    rectified : RectifiedRig
    T_left_world : (4, 4) array
        World z = 0 is the floor.
    height_std_mm, pitch_std_rad, roll_std_rad : float
        How well the pose is known.
    """
    down = -(rectified.R1 @ T_left_world[:3, 2])
    origin = T_left_world[:3, :3].T @ T_left_world[:3, 3]
    height = -float(origin[2])
    if not height > 0:
        raise ValueError(f"the camera must stand above the floor (world z = 0), this pose has it at {height:.1f} mm")
    scale = rectified.f_px * rectified.baseline_mm
    to_plane = scale * np.linalg.inv(rectified.P1[:, :3]).T / height
    right = np.array([1.0, 0.0, 0.0]) - down[0] * down
    right /= np.linalg.norm(right)
    ahead = np.cross(right, down)
    columns = to_plane @ np.stack(
        [down * (height_std_mm / height), ahead * pitch_std_rad, right * roll_std_rad], axis=1
    )
    return Floor(rectified, to_plane @ down, columns @ columns.T)


def fit_floor(
    disparity_px: Array,
    rectified: RectifiedRig,
    *,
    rng: np.random.Generator,
    pair: AlignedPair | None = None,
    max_tilt_rad: float = np.deg2rad(50.0),
    max_roll_rad: float = np.deg2rad(15.0),
    max_camera_height_mm: float = 1000.0,
    least_support: float = 0.02,
    trials: int = 300,
) -> Floor:
    """Find the floor in a disparity map.

    Planes through three random pixels compete (RANSAC): a pixel near a plane counts for it, one that would lie under
    it counts against it, as nothing lies under a floor. The best is refined by least squares with Tukey's weights and,
    if the pictures are given, by aligning them (`stereolib.alignment.align`).

    Parameters
    ----------
    disparity_px : (H, W) float, px
        Of the rectified left image, NaN where invalid.
    rectified : RectifiedRig
    rng : numpy.random.Generator
        Draws the pixels.
    pair : AlignedPair, optional
        The rectified pictures. On a floor seen at a grazing angle block matching errs by a pixel and more, always to
        the same side; alignment does not.
    max_tilt_rad, max_roll_rad, max_camera_height_mm : float
        How steeply the camera may look up or down, lean aside, and how high it may stand; tells floors from walls.
    least_support : float
        Share of the image that must show the floor.
    trials : int
        Planes tried.

    Raises
    ------
    ValueError
        If the map does not fit the rig.
    CannotMeasure
        If no floor is visible.
    """
    disparity = checked_disparity(disparity_px, rectified)
    height, width = disparity.shape
    sparse = disparity[::_STEP, ::_STEP]
    row, column = np.nonzero(np.isfinite(sparse))
    d = sparse[row, column].astype(float)
    u, v = float(_STEP) * column, float(_STEP) * row
    x = scaled_pixels(u, v, rectified)
    limits = (max_tilt_rad, max_roll_rad, max_camera_height_mm)
    least = max(50, int(least_support * height * width / _STEP**2))
    try:
        return _fit(x, d, u, v, rectified, limits, least, trials, rng, pair)
    except CannotMeasure:  # a small floor may need more luck
        return _fit(x, d, u, v, rectified, limits, least, 6 * trials, rng, pair)


def _fit(
    x: Array, d: Array, u: Array, v: Array, rectified: RectifiedRig, limits: tuple[float, float, float], least: int,
    trials: int, rng: np.random.Generator, pair: AlignedPair | None,
) -> Floor:  # fmt: skip
    """The best plane of some trials, refined; CannotMeasure if it is not a floor."""
    share_of_one = _STEP**2 / (rectified.size[0] * rectified.size[1])
    plane = _ransac(x, d, rectified, limits, trials, rng) if len(d) > 50 else None
    tolerance = _tolerance_px(d)
    for reach in (2.0, 1.5, 1.5):
        off = np.inf if plane is None else (d - x @ plane) / (reach * tolerance)
        weight = np.maximum(1 - off**2, 0) ** 2
        count = np.count_nonzero(weight)
        if plane is None or count < least:
            raise CannotMeasure("no floor", _NO_FLOOR.format(f"{100 * count * share_of_one:.1f} %"))
        root = x * weight[:, None]
        plane = np.linalg.solve(root.T @ x, root.T @ d)
    assert plane is not None
    if pair is None:
        covariance = clustered_covariance(x, d - x @ plane, weight, cell_of(u, v))
    else:
        near = weight > 0
        fit = align(pair, u[near], v[near], x[near], plane)
        plane, covariance = fit.parameters, fit.covariance
    expected = x @ plane
    under = np.count_nonzero((d < expected - 3 * tolerance) & (expected > 0))
    if not _plausible(plane[None], rectified, limits)[0] or under > 0.3 * count:
        raise CannotMeasure("no floor", _NO_FLOOR.format("no large part"))
    back = scaled_pixels(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), rectified)
    back = np.stack([back[0] - back[2], back[1] - back[2], back[2]])  # planes per scaled pixel -> per pixel
    return Floor(rectified, back @ plane, back @ covariance @ back.T, count * share_of_one)


def scaled_pixels(u: Array, v: Array, rectified: RectifiedRig) -> Array:
    """Rows ``((u - cx) / f, (v - cy) / f, 1)``: the rays of pixels, (N, 3)."""
    f, (cx, cy) = rectified.f_px, rectified.P1[:2, 2]
    return np.stack([(u - cx) / f, (v - cy) / f, np.ones(len(u))]).T


def _tolerance_px(d: Array) -> Array:
    """How far a disparity may lie off its plane: block matching errs more where a floor comes near. px."""
    return 0.4 + 0.015 * d


_NO_FLOOR = (
    "{} of the image fits a plane below the camera. Tilt the camera down or step back, see that "
    "the floor has texture and the pictures are of one moment, left one first; in Python, floor_from_pose gives a floor"
)


def checked_disparity(disparity_px: Array, rectified: RectifiedRig) -> Array:
    """The map itself, if it is (H, W) floats of the rig's size; ValueError if not."""
    disparity = np.asarray(disparity_px)
    if disparity.shape != rectified.size[::-1]:
        raise ValueError(
            f"the disparity map has shape {disparity.shape}, the calibration is for images of "
            f"{rectified.size[0]}x{rectified.size[1]}: use a map of that size or calibrate again"
        )
    if disparity.dtype.kind != "f":
        raise ValueError(f"the disparity is {disparity.dtype}: give float pixels with NaN for invalid ones")
    return disparity


def _plausible(planes: Array, rectified: RectifiedRig, limits: tuple[float, float, float]) -> Array:
    """Which planes (N, 3), per ray, may be a floor: below, not too steep, not too far. (N,) bool."""
    size = np.maximum(np.linalg.norm(planes, axis=1), 1e-9)
    down = planes / size[:, None]
    allowed = (down[:, 1] > 0) & (np.abs(np.arcsin(down[:, 2])) < limits[0])
    allowed &= np.abs(np.arctan2(down[:, 0], down[:, 1])) < limits[1]
    return np.asarray(allowed & (rectified.f_px * rectified.baseline_mm / size < limits[2]))


def _ransac(
    x: Array, d: Array, rectified: RectifiedRig, limits: tuple[float, float, float], trials: int,
    rng: np.random.Generator,
) -> Array | None:  # fmt: skip
    """Best plane (3,) for the rays x (N, 3) and disparities d (N,), row by row of the picture, or None."""
    some = rng.integers(len(d), size=400)
    low, lowest = len(d) // 2, int(0.85 * len(d))  # the pixels come row by row, and floors are low
    first = np.array([[low, low, low], [lowest, lowest, low], [lowest, low, 0]]).repeat(trials // 3 + 1, axis=0)
    corners, xyd = rng.integers(first, len(d)).T, np.stack([x[:, 0], x[:, 1], d])
    x0, y0, d0 = start = xyd[:, corners[0]]
    (x1, y1, d1), (x2, y2, d2) = (xyd[:, k] - start for k in corners[1:])
    area = x1 * y2 - x2 * y1
    area[np.abs(area) < 1e-3] = np.nan
    a, b = (d1 * y2 - d2 * y1) / area, (x1 * d2 - x2 * d1) / area
    planes = np.stack([a, b, d0 - a * x0 - b * y0]).T
    planes = planes[_plausible(planes, rectified, limits)]
    if not len(planes):
        return None
    voters = d[some].astype(np.float32)
    expected = planes.astype(np.float32) @ x[some].T.astype(np.float32)
    off = (voters - expected) / _tolerance_px(voters)
    on, under = np.abs(off) < 1, (off < -3) & (expected > 0)
    return planes[(on @ voters - under @ voters).argmax()]
