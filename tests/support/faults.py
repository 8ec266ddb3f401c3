"""Board sets with one known fault each, made from virtual corner sets: what a diagnosis must name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from stereolib.base import Bools, Float64, Ints
from stereolib.calibration import BoardViews, Checkerboard, board_pose
from stereolib.paper import paper_rig
from stereolib.rig import StereoRig
from stereolib.virtual.recordings import BOARD
from support.corners import corner_set, draw_poses, project_boards


@dataclass(frozen=True, eq=False)
class Fault:
    """A faulty set, and what a diagnosis must say of it.

    Attributes
    ----------
    name : str
        The fault.
    views : BoardViews
    says : str
        Must stand in the diagnosis's warnings, or in the error if ``refused``.
    refused : bool
        The diagnosis must raise.
    pairs : tuple of str
        Names of the pairs that the diagnosis must leave out, or that form the second group.
    ruler_mm : float, optional
        What a ruler between the lenses read, mm.
    model : str
        The lens model that is asked for.
    """

    name: str
    views: BoardViews
    says: str
    refused: bool = False
    pairs: tuple[str, ...] = ()
    ruler_mm: float | None = None
    model: str = "brown3"


def bad_sets(seed: int = 0) -> Iterator[Fault]:
    """Make seventeen sets of 30 pairs at most, each with one fault.

    Parameters
    ----------
    seed : int

    Yields
    ------
    Fault
    """
    rng = np.random.default_rng([seed, 15])
    rig = paper_rig()
    good = corner_set(rng)
    yield Fault("left and right exchanged", _swapped(good), "exchanged", refused=True)
    yield Fault("lens model too short", good, "pinhole is too short", model="pinhole")
    yield Fault("too few pairs", good.only([3, 20]), "2 pairs of the board are too few", refused=True)
    still = corner_set(rng, poses=[draw_poses(rig, 1, rng)[0]] * 12)
    yield Fault("one pose, twelve times", still, "in only 1 different place(s)", refused=True)
    shifted = replace(good, right_px=np.roll(good.right_px, 1, axis=0))
    yield Fault("files of one side shifted by one", shifted, "do not belong together", refused=True)
    yield _moved(good, rng)
    yield _unsynchronised(good, [7], rng, "one pair whose board moved")
    yield _unsynchronised(good, [2, 11, 25], rng, "three pairs whose boards moved")
    yield _wrong_corners(good)
    wrong = replace(good, board=Checkerboard(BOARD.columns, BOARD.rows, 30.0))
    yield Fault("board measured wrong", wrong, "the board or the ruler is measured wrong", ruler_mm=93.0)
    stretched = replace(corner_set(rng, board=replace(BOARD, aspect=1.01)), board=BOARD)
    yield Fault("board printed out of square", stretched, "1.0 % higher than they are wide")
    pool = draw_poses(rig, 400, rng)
    yield _chosen("no views in the lower right", pool, rng, lambda at, *_: ~((at[:, 0] > 330) & (at[:, 1] > 250)))
    yield _chosen("no views in the left third", pool, rng, lambda at, *_: at[:, 0] > 240)
    yield Fault("no views outside the centre", _central(rng), "no views outside the centre")
    yield _chosen("all boards at one distance", pool, rng, lambda at, mm, _: (mm > 560) & (mm < 640))
    flat = [_facing(T) for T in pool[:30]]
    yield Fault("all boards fronto-parallel", corner_set(rng, poses=flat), "all boards fronto-parallel", refused=True)
    hinged = [T for T in pool if abs(np.arctan2(T[0, 2], -T[2, 2])) < np.radians(7)][:24]
    yield Fault("no boards turned about the vertical axis", corner_set(rng, poses=hinged), "about the vertical axis")


def _swapped(views: BoardViews) -> BoardViews:
    return replace(views, left_px=views.right_px, right_px=views.left_px)


def _moved(good: BoardViews, rng: np.random.Generator) -> Fault:
    """The right camera is knocked by 2 mm and half a degree after two thirds of the pairs."""
    rig = paper_rig()
    knock = cv2.Rodrigues(np.radians([0.1, 0.5, 0.0]))[0]
    knocked = StereoRig(rig.left, rig.right, knock @ rig.R, rig.T + np.array([0.0, 1.0, 1.7]))
    later = corner_set(rng, rig=knocked, pairs=10)
    views = _joined(good.only(range(20)), later)
    return Fault("two positions of the rig", views, "two positions of the rig are mixed", pairs=views.names[20:])


def _joined(first: BoardViews, second: BoardViews) -> BoardViews:
    left, right = (np.concatenate(p) for p in ((first.left_px, second.left_px), (first.right_px, second.right_px)))
    return replace(first, left_px=left, right_px=right, names=tuple(f"pair {k + 1:02d}" for k in range(len(left))))


def _unsynchronised(good: BoardViews, indices: Sequence[int], rng: np.random.Generator, name: str) -> Fault:
    """Between the two shutters the boards of these pairs moved by a few millimetres."""
    right = good.right_px.copy()
    for k in indices:
        turn, shift = board_pose(BOARD.points_mm, good.right_px[k], paper_rig().right)
        moved = shift + rng.uniform(2, 5, 3) * rng.choice([-1, 1], 3)
        right[k] = cv2.projectPoints(BOARD.points_mm, turn, moved, *_lens())[0][:, 0]
    names = tuple(good.names[k] for k in indices)
    return Fault(name, replace(good, right_px=right), f"{len(names)} of 30 pairs were left out", pairs=names)


def _lens() -> tuple[Float64, Float64]:
    right = paper_rig().right
    return right.K, right.dist


def _wrong_corners(good: BoardViews) -> Fault:
    """In one left view the detector took a row of corners for the next one."""
    left = good.left_px.copy().reshape(len(good), BOARD.rows, BOARD.columns, 2)
    left[12, 2] = left[12, 3]
    views = replace(good, left_px=left.reshape(good.left_px.shape))
    return Fault("wrong corners in one view", views, "1 of 30 pairs were left out", pairs=(good.names[12],))


def _chosen(
    name: str, pool: Sequence[Float64], rng: np.random.Generator, keep: Callable[[Float64, Float64, Ints], Bools]
) -> Fault:
    """Thirty poses of the pool of which ``keep(corners' extent, distance, index)`` is true."""
    left, right = project_boards(paper_rig(), pool)
    at = right.min(axis=1) if name.endswith("left third") else left.max(axis=1)  # the camera that sees more of it
    distance = np.array([T[2, 3] for T in pool])
    chosen = np.flatnonzero(keep(at, distance, np.arange(len(pool))))[:30]
    return Fault(name, corner_set(rng, poses=[pool[k] for k in chosen]), name)


def _central(rng: np.random.Generator) -> BoardViews:
    """A small board always in the middle of the image, far away."""
    rig, small = paper_rig(), Checkerboard(BOARD.columns, BOARD.rows, 12.0)
    poses = []
    for T in draw_poses(rig, 30, rng):
        middle = rig.left.rays(rng.uniform([330, 215], [370, 265], (1, 2)))[0] * T[2, 3] * 1.15
        poses.append(np.block([[T[:3, :3], middle[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]]))
    return corner_set(rng, poses=poses, board=small)


def _facing(T_left_board: Float64) -> Float64:
    """The same place, the board parallel to the image and upright."""
    facing = np.eye(4)
    facing[:3, :3], facing[:3, 3] = np.diag([1.0, -1.0, -1.0]), T_left_board[:3, 3]
    return facing
