"""Poses of the recorded boards: in view, spread over the image, the same for the same seed."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib import paper
from stereolib.calibration import Checkerboard
from stereolib.rig import rigid
from stereolib.virtual import recordings, staged_rig, stereo_boards
from stereolib.virtual.stereo_boards import draw_board_poses


@pytest.fixture(scope="module")
def poses():
    return recordings.board_poses()


def test_boards_stay_in_view_above_the_floor_and_cover_the_image(poses):
    rig, target = paper.paper_rig(), recordings.BOARD
    half = (target.columns + 1) * target.square_mm / 2, (target.rows + 1) * target.square_mm / 2
    rim = np.array([[a * half[0], b * half[1], 0.0] for a in (-1, 1) for b in (-1, 1)])
    inner = (target.points_mm - target.points_mm.mean(axis=0)) * [1, -1, 1]
    seen, tilts = [], []
    for T in poses:
        for camera, M in ((rig.left, T), (rig.right, rigid(rig.R, rig.T) @ T)):
            outer = camera.project(rim @ M[:3, :3].T + M[:3, 3])
            assert ((outer > 0) & (outer < [639, 479])).all()
            # and none by way of the fold: every pixel leads back to its corner
            points = np.vstack([rim, inner]) @ M[:3, :3].T + M[:3, 3]
            np.testing.assert_allclose(camera.rays(camera.project(points)), points / points[:, 2:], atol=1e-6)
        seen.append(rig.left.project(inner @ T[:3, :3].T + T[:3, 3]))
        tilts.append(np.degrees(np.arccos(-T[2, 2])))
        world = np.linalg.inv(recordings.setup("bench")) @ T @ np.column_stack([rim * 1.3, np.ones(4)]).T
        assert world[2].min() > 50
    # the left camera's first columns lie outside the right one's image at these distances
    seen = np.concatenate(seen)
    counts = np.histogram2d(seen[:, 0], seen[:, 1], bins=(4, 3), range=((120, 640), (0, 480)))[0]
    assert (counts > 20).all()
    assert np.percentile(tilts, 25) > 10 and max(tilts) < 60


def test_boards_are_the_same_for_the_same_seed(poses):
    again = draw_board_poses(4, np.random.default_rng(30), recordings.BOARD)
    np.testing.assert_array_equal(again, poses[:4])
    assert not np.allclose(draw_board_poses(1, np.random.default_rng(31), recordings.BOARD)[0], poses[0])


def test_tries_held_against_the_images_together_draw_what_single_ones_draw(monkeypatch):
    """To the last bit, and the generator goes on from the same place; also where a distance is given up."""
    monkeypatch.setattr(stereo_boards, "_INSISTS", 60)
    drawn = []
    for at_once in (64, 1):
        monkeypatch.setattr(stereo_boards, "_AT_ONCE", at_once)
        rng = np.random.default_rng(1)
        drawn.append([T.tobytes() for T in draw_board_poses(2, rng, recordings.BOARD, staged_rig(31))])
        drawn[-1].append(rng.random())
    assert drawn[0] == drawn[1]


def test_board_too_large_for_the_image(monkeypatch):
    monkeypatch.setattr(stereo_boards, "_INSISTS", 100)
    monkeypatch.setattr(stereo_boards, "_TRIES", 400)
    with pytest.raises(
        ValueError, match=r"6x5 corners and squares of 300 mm is inside both pictures \(640x480\) in only 0 of 1 "
    ):
        draw_board_poses(1, np.random.default_rng(0), Checkerboard(6, 5, 300.0))


def test_a_distance_that_the_cameras_do_not_share_is_left_for_another(monkeypatch):
    """Rig 31: of the nearest distance both cameras share a part only, too small for some of the board's regions."""
    monkeypatch.setattr(stereo_boards, "_INSISTS", 60)
    poses = draw_board_poses(16, np.random.default_rng(0), recordings.BOARD, staged_rig(31))
    away = np.array([T[2, 3] for T in poses])
    assert len(poses) == 16 and away.max() > 750 and away.min() < 650
