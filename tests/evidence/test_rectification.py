"""Verdicts of notebook 02 turn with the boards, the cube and the maps."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from support.corners import draw_poses, draw_rig, project_boards
from support.verdicts import assert_turns, verdict_of

from stereolib import evidence
from stereolib.calibration import BoardViews, calibrate_stereo, hold_out_rigs
from stereolib.matching import Score, SGBMParams, compute_disparity, score
from stereolib.measurement import HeightAttempt, attempt_height
from stereolib.paper import paper_rig, published
from stereolib.rig import Camera, StereoRig
from stereolib.virtual import recordings

SHAPE = (120, 320)


def views_of(*rigs: StereoRig, noise_px: float = 0.034) -> BoardViews:
    """Twenty boards, shared out among rigs: one and the same, or one that moves meanwhile."""
    poses = draw_poses(rigs[0], 20, np.random.default_rng(1))
    sides = [project_boards(rigs[k % len(rigs)], [pose]) for k, pose in enumerate(poses)]
    left, right = (np.concatenate(side) for side in zip(*sides, strict=True))
    noise = np.random.default_rng(2).normal(0, noise_px, (2, *left.shape))
    pixels = [(a + b).astype(np.float32) for a, b in zip((left, right), noise, strict=True)]
    names = tuple(f"pair {k}" for k in range(len(poses)))
    return BoardViews(recordings.BOARD, rigs[0].left.size, pixels[0], pixels[1], names, ())


def test_rows_are_aligned_unless_the_rig_moves_between_the_boards():
    rig = paper_rig()
    nod = cv2.Rodrigues(np.array([0.004, 0, 0]))[0]  # a quarter of a degree
    moving = StereoRig(rig.left, rig.right, nod @ rig.R, nod @ rig.T)
    still, moved = (evidence.rows_left_out(hold_out_rigs(views_of(*rigs))) for rigs in ((rig,), (rig, moving)))
    assert_turns("claim.rows_aligned", still, moved)


TRUE_MM = 300.0, 700.0  # the cube's edge, and the distance of the near one


def cube_by(rig: StereoRig) -> HeightAttempt:
    rectified = rig.rectify()
    return attempt_height(*rectified.rectify(*recordings.load_pair("conditions/texture")), rectified)


def test_depth_equation_is_refuted_by_squares_told_wrong():
    """Told 31 mm for squares of 25 mm, every size comes out a quarter too large."""
    views = views_of(paper_rig())
    sizes = []
    for told_mm in (25.0, 31.0):
        told = replace(views, board=replace(views.board, square_mm=told_mm))
        cube = cube_by(calibrate_stereo(told).rig)
        sizes.append(evidence.sizes_by_depth_equation(hold_out_rigs(told), recordings.BOARD, cube, TRUE_MM))
    assert_turns("eq.depth", *sizes)
    assert all(size == pytest.approx(24, abs=1) for size in sizes[1].values())


def test_of_the_cube_only_its_distance_sees_a_wrong_focal_length():
    held_out, sizes = hold_out_rigs(views_of(paper_rig())), []
    for factor in (1.0, 1.01):
        focal = np.array([[factor, 1, 1], [1, factor, 1], [1, 1, 1]])
        lenses = [replace(camera, K=focal * camera.K) for camera in (paper_rig().left, paper_rig().right)]
        cube = cube_by(replace(paper_rig(), left=lenses[0], right=lenses[1]))
        sizes.append(evidence.sizes_by_depth_equation(held_out, recordings.BOARD, cube, TRUE_MM))
    assert sizes[1]["distance_pct"] == pytest.approx(1, abs=0.25) and sizes[0]["distance_pct"] < 0.14
    assert max(size["width_pct"] for size in sizes) < 0.3


def test_a_refused_cube_gives_no_verdict_in_favour():
    blank = np.zeros((480, 640, 3), np.uint8)
    refused = attempt_height(blank, blank, paper_rig().rectify())
    sizes = evidence.sizes_by_depth_equation(hold_out_rigs(views_of(paper_rig())), recordings.BOARD, refused, TRUE_MM)
    assert verdict_of("eq.depth", sizes) == "follows in part" and np.isnan(sizes["distance_pct"])


def test_a_wrong_equation_is_refuted_too(monkeypatch):
    """``Z = f B / (d + 2)``: a shift of the disparity, as from principal points that differ."""
    held_out, cube = hold_out_rigs(views_of(paper_rig())), cube_by(paper_rig())
    right = evidence.sizes_by_depth_equation(held_out, recordings.BOARD, cube, TRUE_MM)
    rectified = type(paper_rig().rectify())
    plain = rectified.triangulate
    monkeypatch.setattr(rectified, "triangulate", lambda self, pixels, d: plain(self, pixels, np.asarray(d) + 2))
    wrong = evidence.sizes_by_depth_equation(held_out, recordings.BOARD, cube, TRUE_MM)
    assert right["squares_pct"] < 0.1 < 1 < wrong["squares_pct"]


def test_limits_are_what_their_reasons_say():
    (rows,), sizes = published()["claim.rows_aligned"].conditions.values(), published()["eq.depth"].conditions
    assert rows.most == 1 / cv2.StereoMatcher_DISP_SCALE
    assert {c.most for c in sizes.values()} == {round(100 * 1 / (1000 * published()["setup.distance"].value), 2)}


def test_depths_of_boards_left_out_are_held_against_true_ones():
    """Without noise nothing is off; told squares a tenth too large, every depth is; a board upside down is no error."""
    corners = {f"pair {k}": one for k, one in enumerate(true_corners(20))}
    for told_mm, off_pct in ((25.0, 0.0), (27.5, 10.0)):
        views = views_of(paper_rig(), noise_px=0.0)
        held_out = hold_out_rigs(replace(views, board=replace(views.board, square_mm=told_mm)))
        for order in (1, -1):
            given = {name: one[::order] for name, one in corners.items()}
            true_mm, error_mm = evidence.depth_errors_left_out(held_out, given)
            assert true_mm.shape == error_mm.shape == (20 * 54,)
            np.testing.assert_allclose(100 * error_mm / true_mm, off_pct, atol=0.02)


def true_corners(count: int) -> list[np.ndarray]:
    """Corners of the boards of `views_of`, in the left camera's frame."""
    centred = (recordings.BOARD.points_mm - recordings.BOARD.points_mm.mean(axis=0)) * [1.0, -1.0, 1.0]
    poses = draw_poses(paper_rig(), count, np.random.default_rng(1))
    return [centred @ T[:3, :3].T + T[:3, 3] for T in poses]


# --- matching without rectification


def matched(rows_off: float) -> Score:
    """Score of a random texture whose right picture is 12 px to the left, and some rows lower."""
    rng = np.random.default_rng(7)
    left = cv2.GaussianBlur(rng.integers(0, 256, SHAPE, dtype=np.uint8), (0, 0), 1.0)
    left = cv2.normalize(left, None, 0, 255, cv2.NORM_MINMAX)
    right = cv2.warpAffine(
        left, np.array([[1.0, 0, -12], [0, 1, rows_off]]), SHAPE[::-1], borderMode=cv2.BORDER_REFLECT
    )
    seen = np.zeros(SHAPE, bool)
    seen[10:-10, 20:-10] = True
    disparity = compute_disparity(left, right, SGBMParams(32), whole=True)
    return score(disparity, np.full(SHAPE, 12.0), seen)


def test_rectification_is_needed_where_rows_differ_and_not_where_they_agree():
    aligned, apart = matched(0.0), matched(5.0)
    needed = evidence.rectification_gain(apart, apart, aligned)
    assert_turns("claim.rectification_needed", needed, evidence.rectification_gain(aligned, aligned, aligned))


def test_stages_differ_only_in_what_was_done_to_the_pair():
    """On pinholes side by side nothing is to be done: all stages are the same map, and no row differs."""
    camera = Camera([[300, 0, 159.5], [0, 300, 59.5], [0, 0, 1]], [], SHAPE[::-1])
    rig = StereoRig(camera, camera, np.eye(3), [-60.0, 0, 0])
    rng = np.random.default_rng(7)
    left = cv2.GaussianBlur(rng.integers(0, 256, (*SHAPE, 3), dtype=np.uint8), (0, 0), 1.0)
    pair = left, np.roll(left, -12, axis=1)
    truth = np.full(SHAPE, 12.0)
    truth[:, :20] = np.nan
    stages = evidence.match_stages(pair, rig, rig.rectify(), truth, SGBMParams(32))
    assert list(stages) == ["as recorded", "undistorted only", "rectified"]
    for stage in stages.values():
        assert stage.score.bad2_pct < 1 and stage.rows_rms_px < 1e-6
        assert 100 * stage.wrong.sum() / stage.counted.sum() == pytest.approx(stage.score.bad2_pct)


def test_partners_are_where_the_cameras_see_them():
    """A plane's disparity, carried back to the recorded images, against its points projected into both cameras."""
    rig = draw_rig(np.random.default_rng(4))
    rectified = rig.rectify()
    disparity = np.full((480, 640), rectified.f_px * rectified.baseline_mm / 800)  # a plane 800 mm away
    columns, rows = evidence.partner_offsets_px(disparity, rectified, rig.left, rig.right)
    points = np.array([[-50.0, -30, 800], [0, 0, 800], [80, 60, 800]]) @ rectified.R1
    seen_left, seen_right = rig.left.project(points), rig.right.project(points @ rig.R.T + rig.T)
    for a, b in zip(seen_left, seen_right, strict=True):
        at = np.rint(a[::-1]).astype(int)
        np.testing.assert_allclose([columns[*at], rows[*at]], a - b, atol=0.05)
    pinholes = [Camera(c.K, [], c.size) for c in (rectified.left, rectified.left)]
    same = StereoRig(*pinholes, np.eye(3), [-rectified.baseline_mm, 0, 0]).rectify()
    columns, rows = evidence.partner_offsets_px(disparity, same, *pinholes)
    inside = np.isfinite(columns)
    assert inside.mean() > 0.7
    np.testing.assert_allclose(columns[inside], disparity[inside], atol=1e-6)  # rectified images: nothing changes
    np.testing.assert_allclose(rows[inside], 0, atol=1e-6)
