"""Poses of a checkerboard held before the rig's two cameras, drawn so that they cover the image."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stereolib.base import Bools, Float64
from stereolib.calibration import Checkerboard
from stereolib.paper import paper_rig
from stereolib.rig import StereoRig, rigid

DISTANCES_MM = (480.0, 600.0, 740.0, 900.0)  # in turn, each varied by 8 %
_VARIED = (0.92, 1.08)
_MOST_TILT_RAD = np.array([0.7, 0.7, 0.35])  # about x, y and z: 40 degrees, and 20 in the image
_RIM = 6.0 / 640  # kept clear of the image's border, share of its width
_INSISTS = 4000  # tries at a pose's own distance, before all distances are tried in turn
_TRIES = 2000  # of a pose, beyond these
_AT_ONCE = 64  # tries that are held against the images together
_OTHER_REGION_EVERY = 40  # tries, where two cameras cannot share a region at that distance


def draw_board_poses(
    count: int,
    rng: np.random.Generator,
    target: Checkerboard,
    rig: StereoRig | None = None,
    *,
    progress: bool = False,
) -> list[Float64]:
    """Draw poses of a hand-held board with good coverage: all image regions, 0.45 to 0.95 m, tilts up to 40 degrees.

    A distance at which the cameras of this rig hardly ever share the board is left for another one.

    Parameters
    ----------
    count : int
    rng : numpy.random.Generator
    target : Checkerboard
    rig : StereoRig, optional
        Default: that of Table I.
    progress : bool
        Show a bar if it takes more than two seconds.

    Returns
    -------
    list of (4, 4) arrays
        ``T_left_board``; the board's frame is at its centre, x right, y up, z towards the camera. Every corner and
        the white rim lie inside both images.

    Raises
    ------
    ValueError
        If the board is too large for the images, or the images have too little in common.

    Examples
    --------
    >>> (T,) = draw_board_poses(1, np.random.default_rng(0), Checkerboard(9, 6, 25.0))
    >>> T.shape
    (4, 4)
    """
    from tqdm.auto import tqdm

    rig = rig or paper_rig()
    half = np.array([(n + 1) * target.square_mm / 2 + 0.5 * target.square_mm for n in (target.columns, target.rows)])
    rim = np.array([[a * half[0], b * half[1], 0.0, 1.0] for a in (-1, 0, 1) for b in (-1, 0, 1)]).T
    poses: list[Float64] = []
    attempt, misses = 0, 0  # of all poses, of this one
    given_up: set[int] = set()  # distances that are insisted on no more
    with tqdm(
        total=count, desc="places for the board", unit="place", delay=2, disable=not progress, leave=False
    ) as bar:
        while (k := len(poses)) < count:
            own = k % len(DISTANCES_MM)
            most = _INSISTS if misses < _INSISTS else _INSISTS + _TRIES
            tries = list[_Try]()
            for more in range(min(_AT_ONCE, most - misses)):
                at = (own + misses + more) % len(DISTANCES_MM) if own in given_up else own
                cell = rng.integers(0, 3, 2) if (attempt + more) % _OTHER_REGION_EVERY == 0 else (k % 3, k // 3 % 3)
                tries.append(_Try.draw(rng, cell, DISTANCES_MM[at]))
            if (inside := np.flatnonzero(_are_inside(_poses(tries, rig), rim, rig))).size:
                first = int(inside[0])
                rng.bit_generator.state = tries[first].then  # as if the rest had not been drawn
                poses.extend(_poses(tries[first : first + 1], rig))
                attempt, misses = attempt + first + 1, 0
                bar.update()
                continue
            attempt, misses = attempt + len(tries), misses + len(tries)
            if misses == _INSISTS:
                given_up.add(own)
            elif misses == _INSISTS + _TRIES:
                raise ValueError(_too_large(target, rig, k, count))
    return poses


class _Try(NamedTuple):
    """A pose that may do: where in the image (shares of its sides), how turned, how far; and the generator after it."""

    place: Float64
    turns_rad: Float64
    distance_mm: float
    varied: float
    then: Mapping[str, Any]

    @classmethod
    def draw(cls, rng: np.random.Generator, cell: ArrayLike, distance_mm: float) -> _Try:
        """Draw one in a cell of the 3 x 3 grid of regions."""
        place = (np.asarray(cell) + rng.uniform(0, 1, 2)) / 3
        turns_rad = rng.uniform(-_MOST_TILT_RAD, _MOST_TILT_RAD)
        return cls(place, turns_rad, distance_mm, rng.uniform(*_VARIED), rng.bit_generator.state)


def _poses(tries: Sequence[_Try], rig: StereoRig) -> Float64:
    """Their ``T_left_board``, (N, 4, 4)."""
    rays = rig.left.rays(np.array([each.place for each in tries]) * rig.left.size, clamp=True)
    facing = [_euler(*each.turns_rad) @ np.diag([1.0, -1.0, -1.0]) for each in tries]
    at = (ray * each.distance_mm * each.varied for ray, each in zip(rays, tries, strict=True))
    return np.array([rigid(*pose) for pose in zip(facing, at, strict=True)])


def _are_inside(T_left_board: Float64, rim: Float64, rig: StereoRig) -> Bools:
    """Which boards, of (4, N) points `rim`, lie inside both images."""
    inside = np.ones(len(T_left_board), bool)
    for camera, T in ((rig.left, T_left_board), (rig.right, rigid(rig.R, rig.T) @ T_left_board)):
        pixels = camera.project(np.moveaxis((T @ rim)[:, :3], 1, 2).reshape(-1, 3)).reshape(len(T), -1, 2)
        rim_px = _RIM * rig.left.size[0]
        inside &= ((pixels > rim_px) & (pixels < np.array(rig.left.size) - 1 - rim_px)).all(axis=(1, 2))
    return inside


def _too_large(target: Checkerboard, rig: StereoRig, found: int, count: int) -> str:
    """What is wrong where no pose is found."""
    board = f"a board of {target.columns}x{target.rows} corners and squares of {target.square_mm:g} mm"
    near, far = DISTANCES_MM[0] / 1000, DISTANCES_MM[-1] / 1000
    return (
        f"{board} is inside both pictures ({rig.left.size[0]}x{rig.left.size[1]}) in only {found} of {count} places, "
        f"{near:.1f} to {far:.1f} m away: use a smaller board, or cameras that see more in common"
    )


def _euler(x: float, y: float, z: float) -> Float64:
    """Rotation about x, then y, then z."""
    cx, cy, cz = np.cos([x, y, z])
    sx, sy, sz = np.sin([x, y, z])
    turn_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    turn_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    turn_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(turn_z @ turn_y @ turn_x)
