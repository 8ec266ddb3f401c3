"""Board sets with one known fault each, made from virtual corner sets: what a diagnosis must name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from stereolib.base import Bools, Float64, Ints
from stereolib.calibration import BoardViews, Checkerboard, board_pose
from stereolib.paper import paper_rig
from stereolib.rig import Camera, StereoRig
from stereolib.virtual.recordings import BOARD
from support.corners import corner_set, draw_poses, draw_rig, project_boards


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
    verdict : str
        What the rest of the set is good for; empty where chance decides.
    """

    name: str
    views: BoardViews
    says: str
    refused: bool = False
    pairs: tuple[str, ...] = ()
    ruler_mm: float | None = None
    model: str = "brown3"
    verdict: str = "good"


def bad_sets(seed: int = 0) -> Iterator[Fault]:
    """Make 28 sets of 30 pairs at most, each with one fault.

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
    yield Fault("lens model too short", good, "pinhole is too short", model="pinhole", verdict="")
    few = good.only([3, 9, 16, 20])
    yield Fault("too few pairs", few, "4 pairs of the board are too few (pair 04, pair 10", refused=True)
    still = corner_set(rng, poses=[draw_poses(rig, 1, rng)[0]] * 12)
    yield Fault("one pose, twelve times", still, "in only 1 different place:", refused=True)
    shifted = replace(good, right_px=np.roll(good.right_px, 1, axis=0))
    yield Fault("files of one side shifted by one", shifted, "do not belong together", refused=True)
    yield _moved(good, rng)
    yield _unsynchronised(good, [7], rng, "one pair whose board moved")
    yield _unsynchronised(good, [2, 11, 25], rng, "three pairs whose boards moved")
    yield _wrong_corners(good)
    wrong = replace(good, board=Checkerboard(BOARD.columns, BOARD.rows, 30.0))
    yield Fault("board measured wrong", wrong, "the board or the ruler is measured wrong", ruler_mm=93.0, verdict="bad")
    stretched = replace(corner_set(rng, board=replace(BOARD, aspect=1.01)), board=BOARD)
    yield Fault("board printed out of square", stretched, "1.0 % higher than they are wide", verdict="usable")
    pool = draw_poses(rig, 400, rng)
    yield _chosen("no views in the lower right", pool, rng, lambda at, *_: ~((at[:, 0] > 330) & (at[:, 1] > 250)))
    yield _chosen("no views in the left third", pool, rng, lambda at, *_: at[:, 0] > 240)
    yield Fault("no views outside the centre", _central(rng), "no views outside the centre", verdict="bad")
    yield _chosen("all boards at one distance", pool, rng, lambda at, mm, _: (mm > 560) & (mm < 640))
    flat = [_facing(T) for T in pool[:30]]
    yield Fault("all boards fronto-parallel", corner_set(rng, poses=flat), "all boards fronto-parallel", refused=True)
    hinged = [T for T in pool if abs(np.arctan2(T[0, 2], -T[2, 2])) < np.radians(7)][:24]
    yield Fault("no boards turned about the vertical axis", corner_set(rng, poses=hinged), "about the vertical axis")
    yield from misfit_sets(seed)
    yield from _converging(np.random.default_rng([seed, 17]))


def misfit_sets(seed: int = 0) -> Iterator[Fault]:
    """Make sets in which some of 15 pairs show something else than the others, or the same.

    Parameters
    ----------
    seed : int

    Yields
    ------
    Fault
    """
    rng = np.random.default_rng([seed, 16])
    rig = draw_rig(rng)
    poses = draw_poses(rig, 15, rng)
    good, three = corner_set(rng, rig=rig, poses=poses), (3, 8, 12)
    for name, left, right in (
        ("both cameras", 1.03, 1.03),
        ("the left camera", 1.03, 1.0),
        ("the right camera", 1.0, 1.03),
    ):
        refocused = StereoRig(_refocused(rig.left, left), _refocused(rig.right, right), rig.R, rig.T)
        other, says = corner_set(rng, rig=refocused, poses=poses), "taken with another focus, the focal length "
        yield _mixed(f"another focus of {name}", good, other, three, says)
    yield _mixed("mirrored pairs", good, _mirrored(good), three, "both pictures are mirrored")
    yield _mixed("an exchanged pair", good, _swapped(good), (5,), "left and right are exchanged")
    nudged = [T + np.array([[0, 0, 0, 0.3]] * 2 + [[0, 0, 0, 0]] * 2) for T in (poses[4], poses[9], poses[9])]
    held = corner_set(rng, rig=rig, poses=[*poses, *nudged])  # moved by some tenths of a pixel, as hands do
    copied = replace(good.only([*range(15), 4]), names=held.names[:16])
    for name, views in (("a pair twice", copied), ("a board held still", held)):
        says = f"{len(views) - 15} of {len(views)} pairs show the board where another does (pair 16 as pair 05"
        yield Fault(name, views, says, pairs=views.names[15:])


def _mixed(name: str, good: BoardViews, other: BoardViews, bad: Sequence[int], says: str) -> Fault:
    """A good set in which some pairs are the other's."""
    left, right = good.left_px.copy(), good.right_px.copy()
    left[list(bad)], right[list(bad)] = other.left_px[list(bad)], other.right_px[list(bad)]
    views = replace(good, left_px=left, right_px=right)
    return Fault(name, views, says, pairs=tuple(good.names[k] for k in bad))


def _refocused(camera: Camera, by: float) -> Camera:
    return Camera(camera.K * np.array([[by, 1, 1], [1, by, 1], [1, 1, 1]]), camera.dist, camera.size)


def _mirrored(views: BoardViews) -> BoardViews:
    """What a detector finds in mirrored pictures: it numbers every row from the other end."""
    order = np.arange(views.board.columns * views.board.rows).reshape(views.board.rows, -1)[:, ::-1].ravel()
    left, right = (
        np.stack([views.size[0] - 1 - at[..., 0], at[..., 1]], -1)[:, order] for at in (views.left_px, views.right_px)
    )
    return replace(views, left_px=left, right_px=right)


def _converging(rng: np.random.Generator) -> Iterator[Fault]:
    """Cameras far apart, both turned in by so many degrees that their axes meet where the boards are."""
    for degrees in (17, 20, 27, 33):
        rig, turn = draw_rig(rng), np.radians(degrees)
        half = cv2.Rodrigues(np.array([0.0, turn, 0.0]))[0]
        apart = np.array([2 * 650 * np.tan(turn), 0.0, 0.0])
        toed_in = StereoRig(rig.left, rig.right, rig.R @ half @ half, -rig.R @ half @ apart)
        says = "degrees: too much for this rectification"
        yield Fault(
            f"cameras turned in by {degrees} degrees each", corner_set(rng, rig=toed_in, pairs=15), says, verdict="bad"
        )


def _swapped(views: BoardViews) -> BoardViews:
    return replace(views, left_px=views.right_px, right_px=views.left_px)


def _moved(good: BoardViews, rng: np.random.Generator) -> Fault:
    """The right camera is knocked by 2 mm and half a degree after two thirds of the pairs."""
    rig = paper_rig()
    knock = cv2.Rodrigues(np.radians([0.1, 0.5, 0.0]))[0]
    knocked = StereoRig(rig.left, rig.right, knock @ rig.R, rig.T + np.array([0.0, 1.0, 1.7]))
    later = corner_set(rng, rig=knocked, pairs=10)
    views = _joined(good.only(range(20)), later)
    return Fault(
        "two positions of the rig", views, "two positions of the rig are mixed", pairs=views.names[20:], verdict="bad"
    )


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
