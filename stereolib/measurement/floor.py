"""The floor as the pair sees it: a plane in disparity space, found robustly, and what it says about the camera."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from stereolib.base import Bools, Float64, Floats, clustered_covariance, finite_array, set_frozen
from stereolib.measurement.disparity_map import check_disparity_map, pixel_rays
from stereolib.measurement.plane_alignment import AlignedPair, CannotMeasure, align, cell_of
from stereolib.rig import RectifiedRig

_STEP = 7  # every seventh pixel, every seventh row
_DENSE = 3  # every third one is aligned: the pictures are smoothed over as many
_FINE, _PATCH_PX = 4, 24  # patches that vote, and their pixels
_MATCHED = 0.5  # share of a patch that must be matched
_LEAST_SUPPORT = 0.02  # share of the image that must show the floor
_LEAST_PIXELS = 50  # of the sparse ones
_MOST_PIXELS = 5000  # that are aligned: more add nothing but time
_REACHES = (3.0, 2.0, 1.5, 1.5)  # Tukey's weights end at so many tolerances, from step to step of the refinement
_UNDER = 3.0  # a patch so many tolerances under a plane lies below it, where nothing is
_ABOVE = 1.5  # and a pixel so many above it stands on it
_SPECKS = np.ones((3, 3), np.uint8)  # of the seventh ones: fewer that lie above are wrong matches
_BESIDE = np.ones((5, 9), np.uint8)  # and so far around the others is not taken for floor
_GAPS = _BESIDE  # so large are those that a floor of long structures, as planks have them, is matched with
_NO_FLOOR = (
    "no large part of the image fits a plane below the camera. Tilt the camera down or step back, see that "
    "the floor has texture and the pictures are of one moment, left one first; in Python, floor_from_pose gives a floor"
)


@dataclass(frozen=True)
class FloorLimits:
    """How a camera may stand over a floor; tells floors from walls and ceilings.

    Attributes
    ----------
    tilt_rad : float
        How steeply it may look up or down.
    roll_rad : float
        How far it may lean aside.
    camera_height_mm : float
        How high it may stand.
    """

    tilt_rad: float = float(np.deg2rad(50.0))
    roll_rad: float = float(np.deg2rad(15.0))
    camera_height_mm: float = 1000.0


@dataclass(frozen=True, eq=False)
class Floor:
    """The floor's plane: ``disparity = plane @ (u, v, 1)`` in the rectified left image.

    Attributes
    ----------
    rectified : RectifiedRig
    plane : (3,) float64
        px per px, px per px, px.
    covariance : (3, 3) float64
        Of `plane`; what the scatter of the disparities leaves open, without any common error.

    Notes
    -----
    A plane ``n . X = 1`` has ``1/Z = n . K^-1 (u, v, 1)``, so that ``plane = f B K^-T n``: disparity is linear in the
    pixel on every plane. The camera stands ``1 / |n|`` above it, and ``n / |n|`` points down.
    """

    rectified: RectifiedRig
    plane: Float64
    covariance: Float64

    def __post_init__(self) -> None:
        set_frozen(self, plane=finite_array(self.plane, (3,), "plane"))
        set_frozen(self, covariance=finite_array(self.covariance, (3, 3), "covariance"))
        if not self.down[1] > 0:
            raise ValueError(f"the floor must lie below the camera; the plane {self.plane} has it above")

    def seen_by(self, rectified: RectifiedRig) -> Floor:
        """The same floor in the rectified pictures of a rig whose left camera is turned otherwise (`R1`).

        Parameters
        ----------
        rectified : RectifiedRig
            Of the same focal length, centre and baseline.

        Returns
        -------
        Floor
        """
        K = self.rectified.P1[:, :3]
        turn = np.linalg.inv(K).T @ rectified.R1 @ self.rectified.R1.T @ K.T
        return Floor(rectified, turn @ self.plane, turn @ self.covariance @ turn.T)

    @cached_property
    def _n(self) -> Float64:
        return np.asarray(self.rectified.P1[:, :3].T @ self.plane / (self.rectified.f_px * self.rectified.baseline_mm))

    @cached_property
    def camera_height_mm(self) -> float:
        """Height of the left optical centre above the floor, mm."""
        return float(1 / np.linalg.norm(self._n))

    @cached_property
    def down(self) -> Float64:
        """Unit vector straight down, in the rectified left camera's frame. (3,)."""
        return np.asarray(self._n / np.linalg.norm(self._n))

    @property
    def pitch_rad(self) -> float:
        """Angle of the optical axis above the horizontal, rad."""
        return float(-np.arcsin(self.down[2]))

    @property
    def roll_rad(self) -> float:
        """How far the camera leans to the right, rad: 0 with the baseline level."""
        return float(np.arctan2(self.down[0], self.down[1]))

    @cached_property
    def axes(self) -> Float64:
        """World axes forward, left, up as rows, in the rectified left camera's frame. (3, 3).

        Forward is the optical axis laid flat on the floor.
        """
        forward = np.array([0.0, 0.0, 1.0]) - self.down[2] * self.down
        forward /= np.linalg.norm(forward)
        return np.stack([forward, np.cross(forward, self.down), -self.down])

    @cached_property
    def along(self) -> Float64:
        """Rows that give, of a pixel's (u, v, 1), how far its ray goes forward and left per unit of depth. (2, 3)."""
        return np.asarray(self.axes[:2] @ np.linalg.inv(self.rectified.P1[:, :3]))

    def disparity(self, u: Floats | float, v: Floats | float) -> Floats:
        """Disparity of the floor at pixels, px; zero and less at and above the horizon.

        Parameters
        ----------
        u, v : float or arrays of one shape, px
            Columns and rows of the rectified left image.

        Returns
        -------
        array like `u` and `v`, px
        """
        return np.asarray(self.plane[0] * u + self.plane[1] * v + self.plane[2])

    def height_mm(self, u: Float64, v: Float64, disparity_px: Floats) -> Floats:
        """Height above the floor of what pixels show, ``(1 - d_floor / d) / |n|``.

        Parameters
        ----------
        u, v : (N,) float64, px
            Columns and rows of the rectified left image.
        disparity_px : (N,) float, px

        Returns
        -------
        (N,) float64, mm
        """
        return np.asarray(self.camera_height_mm * (1 - self.disparity(u, v) / disparity_px))

    def rays(self, u: Float64, v: Float64) -> Float64:
        """How far the rays of pixels go forward and left along the floor per unit of depth.

        Parameters
        ----------
        u, v : (N,) float64, px
            Columns and rows of the rectified left image.

        Returns
        -------
        (2, N) float64
        """
        of_u, of_v, constant = self.along.T[..., None]
        return np.asarray(of_u * u + of_v * v + constant)

    def pixels(self, points_mm: Floats) -> Float64:
        """Project points into the rectified left image.

        Parameters
        ----------
        points_mm : (N, 3) float, mm
            Forward, left, up from below the camera.

        Returns
        -------
        (N, 2) float64, px
            NaN for what lies behind the camera.
        """
        ray = (np.asarray(points_mm, float) - [0.0, 0.0, self.camera_height_mm]) @ self.axes
        ahead = np.where(ray[:, 2:] > 0, ray[:, 2:], np.nan)
        return np.asarray(ray[:, :2] / ahead * self.rectified.f_px + self.rectified.P1[:2, 2])


def floor_from_pose(
    rectified: RectifiedRig,
    T_left_world: Float64,
    *,
    height_std_mm: float = 0.0,
    pitch_std_rad: float = 0.0,
    roll_std_rad: float = 0.0,
) -> Floor:
    """The floor of a camera whose place is known, as from a board on the floor or a ruler.

    Parameters
    ----------
    rectified : RectifiedRig
    T_left_world : (4, 4) float64
        The left camera's extrinsic matrix; world z = 0 is the floor.
    height_std_mm, pitch_std_rad, roll_std_rad : float
        How well the pose is known: standard deviations; the roll's about the horizontal axis ahead.

    Returns
    -------
    Floor

    Raises
    ------
    ValueError
        If the camera stands below the floor.

    Examples
    --------
    >>> from stereolib.paper import paper_rig, rig_pose
    >>> rig = paper_rig().rectify()
    >>> floor = floor_from_pose(rig, rig_pose(rig, pitch_rad=-0.2, camera_height_mm=400.0))
    >>> round(floor.camera_height_mm, 6), round(floor.pitch_rad, 6)
    (400.0, -0.2)
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
    turns = [down * (height_std_mm / height), ahead * pitch_std_rad, right * roll_std_rad]
    columns = to_plane @ np.stack(turns, axis=1)
    return Floor(rectified, to_plane @ down, columns @ columns.T)


def fit_floor(
    disparity_px: Floats,
    rectified: RectifiedRig,
    *,
    pair: AlignedPair | None = None,
    limits: FloorLimits | None = None,
) -> Floor:
    """Find the floor in a disparity map.

    Each small patch of the map proposes the plane through it, and all patches vote: one near a plane counts for it, one
    that would lie under it counts against it, as nothing lies under a floor. The best is refined by least squares with
    Tukey's weights and, if the pictures are given, by aligning them over it.

    Parameters
    ----------
    disparity_px : (H, W) float, px
        Of the rectified left image, NaN where invalid.
    rectified : RectifiedRig
    pair : AlignedPair, optional
        The rectified pictures. On a floor seen at a grazing angle block matching errs by a pixel and more, always to
        the same side; alignment does not.
    limits : FloorLimits, optional
        How the camera may stand; by default `FloorLimits()`.

    Returns
    -------
    Floor

    Raises
    ------
    ValueError
        If the map does not fit the rig.
    CannotMeasure
        "no floor", if none is visible.

    References
    ----------
    Labayrade, Aubert, Tarel: Real time obstacle detection in stereovision on non flat road geometry through
    "v-disparity" representation. IEEE Intelligent Vehicle Symposium (2002), doi:10.1109/IVS.2002.1188024.

    Examples
    --------
    >>> from stereolib.paper import paper_rig, rig_pose
    >>> rig = paper_rig().rectify()
    >>> truth = floor_from_pose(rig, rig_pose(rig, pitch_rad=-0.2, camera_height_mm=400.0))
    >>> disparity = truth.disparity(*np.meshgrid(np.arange(640.0), np.arange(480.0)))
    >>> floor = fit_floor(disparity, rig)
    >>> round(floor.camera_height_mm, 3), round(floor.pitch_rad, 6)
    (400.0, -0.2)
    """
    disparity = check_disparity_map(disparity_px, rectified)
    limits = limits or FloorLimits()
    pixels = _Pixels.of(disparity, rectified)
    plane, weight = pixels.refined(_vote(disparity, rectified, limits), int(_LEAST_SUPPORT * disparity.size / _STEP**2))
    if pair is None:
        rest, root = pixels.d - pixels.rays @ plane, np.sqrt(weight)
        bend = root * (5 * root - 4)  # derivative of the weighted residual
        try:
            covariance = clustered_covariance(pixels.rays, rest, weight, cell_of(pixels.u, pixels.v), bend)
        except np.linalg.LinAlgError:  # all of it lies in one place
            raise CannotMeasure("no floor", _NO_FLOOR) from None
    else:
        u, v = pixels.of_floor(plane, weight > 0, disparity.shape)
        fit = align(pair, u, v, pixel_rays(u, v, rectified), plane, most=_MOST_PIXELS)
        plane, covariance = fit.parameters, fit.covariance
    if not _plausible(plane[None], rectified, limits)[0]:
        raise CannotMeasure("no floor", _NO_FLOOR)
    back = pixel_rays(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), rectified)
    back = np.stack([back[0] - back[2], back[1] - back[2], back[2]])  # planes per ray -> per pixel
    return Floor(rectified, back @ plane, back @ covariance @ back.T)


@dataclass(frozen=True, eq=False)
class _Pixels:
    """Every seventh matched pixel: u, v, disparity d, (N,) each, and its ray, (N, 3)."""

    u: Float64
    v: Float64
    d: Float64
    rays: Float64

    @classmethod
    def of(cls, disparity_px: Floats, rectified: RectifiedRig) -> _Pixels:
        sparse = disparity_px[::_STEP, ::_STEP]
        row, column = np.nonzero(np.isfinite(sparse))
        u, v = _STEP * column.astype(float), _STEP * row.astype(float)
        return cls(u, v, sparse[row, column].astype(float), pixel_rays(u, v, rectified))

    def refined(self, plane: Float64, least: int) -> tuple[Float64, Float64]:
        """The plane fitted with Tukey's weights, which end ever nearer to it, and the weights; CannotMeasure if few."""
        for reach in _REACHES:
            off = (self.d - self.rays @ plane) / (reach * floor_tolerance_px(self.d))
            weight = np.maximum(1 - off**2, 0) ** 2
            if np.count_nonzero(weight) < least:
                raise CannotMeasure("no floor", _NO_FLOOR)
            scaled = (self.rays * weight[:, None]).T
            plane = np.asarray(np.linalg.solve(scaled @ self.rays, scaled @ self.d))
        return plane, np.asarray(weight)

    def of_floor(self, plane: Float64, on: Bools, shape: tuple[int, ...]) -> tuple[Float64, Float64]:
        """Pixels u, v of the floor, matched or not, but for those beside what stands on it.

        Only matched ones would be those whose noise agrees; and the foot of an object still looks like floor.
        """
        row, column = (np.asarray(a / _STEP, int) for a in (self.v, self.u))
        floor, above = (np.zeros((-(-shape[0] // _STEP), -(-shape[1] // _STEP)), np.uint8) for _ in range(2))
        floor[row, column] = on
        above[row, column] = self.d - self.rays @ plane > _ABOVE * floor_tolerance_px(self.d)
        floor = cv2.morphologyEx(floor, cv2.MORPH_CLOSE, _GAPS)
        free = floor & ~cv2.dilate(cv2.morphologyEx(above, cv2.MORPH_OPEN, _SPECKS), _BESIDE)
        if np.count_nonzero(free) < _LEAST_PIXELS:
            free = floor
        v, u = (_DENSE * np.arange(-(-size // _DENSE)) for size in shape)
        row, column = np.nonzero(free[np.ix_(v // _STEP, u // _STEP)])
        return u[column].astype(float), v[row].astype(float)


def _vote(disparity_px: Floats, rectified: RectifiedRig, limits: FloorLimits) -> Float64:
    """The plane (3,), per ray, for which most patches of the map speak; CannotMeasure if there is none."""
    rows, columns = (size // _PATCH_PX * _PATCH_PX for size in disparity_px.shape)
    d = disparity_px[:rows:_FINE, :columns:_FINE].astype(float)
    matched = np.isfinite(d)
    (x0, y0, _), (x1, y1, _) = pixel_rays(np.array([0.0, _FINE]), np.array([0.0, _FINE]), rectified)
    y, x = np.meshgrid(y0 + (y1 - y0) * np.arange(d.shape[0]), x0 + (x1 - x0) * np.arange(d.shape[1]), indexing="ij")
    a = np.stack([x, y, np.ones_like(x), np.where(matched, d, 0.0)]) * matched
    side = _PATCH_PX // _FINE
    grid = d.shape[0] // side, d.shape[1] // side
    patches = a.reshape(4, grid[0], side, grid[1], side).transpose(1, 3, 0, 2, 4).reshape(*grid, 4, side**2)
    sums = patches @ np.swapaxes(patches, -1, -2)  # moments of (x, y, 1, d) in each patch
    wide = sums[:-1, :-1] + sums[1:, :-1] + sums[:-1, 1:] + sums[1:, 1:]
    every = np.concatenate([sums.reshape(-1, 4, 4), wide.reshape(-1, 4, 4)])
    full = np.concatenate([np.full(sums[..., 0, 0].size, side**2), np.full(wide[..., 0, 0].size, 4 * side**2)])
    every = every[every[:, 2, 2] > _MATCHED * full]
    planes = np.linalg.solve(every[:, :3, :3], every[:, :3, 3:])[..., 0]
    planes = planes[_plausible(planes, rectified, limits)]
    mean = sums.reshape(-1, 4, 4)[:, 2]
    mean = mean[mean[:, 2] > _MATCHED * side**2]
    if not len(planes) or not len(mean):
        raise CannotMeasure("no floor", _NO_FLOOR)
    voters = mean / mean[:, 2:3]
    each = (voters / floor_tolerance_px(voters[:, 3:])).T
    off = each[3] - planes @ each[:3]
    votes = np.subtract(np.abs(off) < 1, off < -_UNDER, dtype=np.float32)
    return np.asarray(planes[(votes @ voters[:, 3].astype(np.float32)).argmax()])


def floor_tolerance_px(disparity_px: Floats) -> Floats:
    """How far a pixel of a floor may lie off its plane: block matching errs more where a floor comes near.

    Parameters
    ----------
    disparity_px : array, px

    Returns
    -------
    array of the same shape, px

    Examples
    --------
    >>> floor_tolerance_px(np.array([0.0, 100.0]))
    array([0.4, 1.9])
    """
    return np.asarray(0.4 + 0.015 * disparity_px)


def _plausible(planes: Float64, rectified: RectifiedRig, limits: FloorLimits) -> Bools:
    """Which planes (N, 3), per ray, may be a floor: below, not too steep, not too far. (N,) bool."""
    size = np.maximum(np.linalg.norm(planes, axis=1), 1e-9)
    down = planes / size[:, None]
    allowed = (down[:, 1] > 0) & (np.abs(np.arcsin(down[:, 2])) < limits.tilt_rad)
    allowed &= np.abs(np.arctan2(down[:, 0], down[:, 1])) < limits.roll_rad
    return np.asarray(allowed & (rectified.f_px * rectified.baseline_mm / size < limits.camera_height_mm))
