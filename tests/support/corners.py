"""Virtual corner sets: boards projected through a rig, with a detector's noise, without rendering a picture."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from stereolib.base import Float64
from stereolib.calibration import BoardViews, Checkerboard
from stereolib.paper import paper_rig
from stereolib.rig import StereoRig, rigid
from stereolib.virtual import draw_rig as draw_rig
from stereolib.virtual.recordings import BOARD

#: What the detector leaves on rendered boards, per coordinate; measured by `benchmarks/bench_calibration.py`.
NOISE_PX = 0.034


def draw_poses(rig: StereoRig, pairs: int, rng: np.random.Generator, board: Checkerboard = BOARD) -> list[Float64]:
    """Draw poses of a hand-held board that both cameras see whole: all over the image, 0.44 to 0.97 m.

    As `stereolib.virtual.stereo_boards.draw_board_poses`, but thousands at a time: the image in nine regions, four
    distances, tilts to 40 degrees; candidates that leave an image are dropped.

    Parameters
    ----------
    rig : StereoRig
    pairs : int
        Number of poses.
    rng : numpy.random.Generator
    board : Checkerboard

    Returns
    -------
    list of (4, 4) arrays
        ``T_left_board``.

    Raises
    ------
    ValueError
        If the board is too large for the images.
    """
    half = (np.array([board.columns, board.rows]) + 2) * board.square_mm / 2
    rim = np.array([[a * half[0], b * half[1], 0.0] for a in (-1, 0, 1) for b in (-1, 0, 1)])
    distances, poses = np.array([480.0, 600.0, 740.0, 900.0]), list[Float64]()
    for _ in range(200):
        tries = 1000
        kind = rng.integers(0, [3, 3, 4], (tries, 3))
        pixels = (kind[:, :2] + rng.uniform(0, 1, (tries, 2))) / 3 * rig.left.size
        centres = rig.left.rays(pixels, clamp=True) * (distances[kind[:, 2]] * rng.uniform(0.92, 1.08, tries))[:, None]
        angles = rng.uniform([-0.7, -0.7, -0.35], [0.7, 0.7, 0.35], (tries, 3))
        turns = np.array([cv2.Rodrigues(a)[0] for a in angles]) @ np.diag([1.0, -1.0, -1.0])
        points = rim @ turns.transpose(0, 2, 1) + centres[:, None]
        inside = np.ones(tries, bool)
        for camera, corners in ((rig.left, points), (rig.right, points @ rig.R.T + rig.T)):
            where = camera.project(corners.reshape(-1, 3)).reshape(tries, -1, 2)
            inside &= ((where > 6) & (where < np.array(camera.size) - 7)).all(axis=(1, 2))
        wanted = [(k % 3, k // 3 % 3, k % 4) for k in range(len(poses), pairs)]
        for region in wanted:
            at = np.flatnonzero(inside & (kind == region).all(axis=1))
            at = at if at.size else np.flatnonzero(inside)  # a region that two cameras cannot share at that distance
            if at.size:
                poses.append(rigid(turns[at[0]], centres[at[0]]))
                inside[at[0]] = False
        if len(poses) == pairs:
            return poses
    raise ValueError(f"only {len(poses)} of {pairs} poses keep the {board} inside both images: use a smaller board")


def project_boards(rig: StereoRig, poses: Sequence[Float64], board: Checkerboard = BOARD) -> tuple[Float64, Float64]:
    """Project the corners of boards into both cameras, without noise.

    Parameters
    ----------
    rig : StereoRig
    poses : sequence of (4, 4) arrays
        ``T_left_board``, as `draw_poses` gives them.
    board : Checkerboard

    Returns
    -------
    left, right : (poses, corners, 2) float64, px
    """
    centred = (board.points_mm - board.points_mm.mean(axis=0)) * [1.0, -1.0, 1.0]  # in the virtual board's frame
    moves = (rig.left, np.eye(4)), (rig.right, rigid(rig.R, rig.T))
    left, right = (
        np.array([camera.project(centred @ (M @ T)[:3, :3].T + (M @ T)[:3, 3]) for T in poses]) for camera, M in moves
    )
    return left, right


def corner_set(
    rng: np.random.Generator,
    *,
    rig: StereoRig | None = None,
    pairs: int = 30,
    poses: Sequence[Float64] | None = None,
    noise_px: float = NOISE_PX,
    board: Checkerboard = BOARD,
) -> BoardViews:
    """Make a virtual corner set: well spread poses through a rig, normal noise added.

    Parameters
    ----------
    rng : numpy.random.Generator
    rig : StereoRig, optional
        By default the paper's.
    pairs : int
        Number of poses that are drawn.
    poses : sequence of (4, 4) arrays, optional
        ``T_left_board`` of the boards, instead of drawn ones.
    noise_px : float
        Standard deviation of each coordinate, px.
    board : Checkerboard

    Returns
    -------
    BoardViews
    """
    rig = rig or paper_rig()
    poses = draw_poses(rig, pairs, rng, board) if poses is None else poses
    left, right = (
        (pixels + rng.normal(0, noise_px, pixels.shape)).astype(np.float32)
        for pixels in project_boards(rig, poses, board)
    )
    names = tuple(f"pair {k + 1:02d}" for k in range(len(poses)))
    return BoardViews(board, rig.left.size, left, right, names, ())
