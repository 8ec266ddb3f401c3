"""Corners beside narrow rims: as right as any other, or not found."""

from __future__ import annotations

import numpy as np
import pytest
from support.board_pictures import Photo, Print, photographed
from support.corners import draw_poses, draw_rig, project_boards

from stereolib.calibration import calibrate_stereo, find_checkerboard, find_in_pairs
from stereolib.calibration.refinement import extrapolated, rim_distance

RIMS = (1.0, 0.5, 0.25)
MARGINS = (1.0, 0.0)
WEBCAM = Photo()


def errors_px(rim: float, margin: float, photo: Photo = WEBCAM) -> tuple[np.ndarray, np.ndarray]:
    """Distances of the inner and of the outermost corners from where they were, over six pairs."""
    rng = np.random.default_rng(4)
    rig, sheet = draw_rig(rng), Print(rim=rim, margin=margin)
    poses = draw_poses(rig, 6, rng)
    views = find_in_pairs(
        photographed(rig, poses, sheet, photo, rng), sheet.board, [str(k) for k in range(6)], progress=False
    )
    true = project_boards(rig, [poses[int(name)] for name in views.names])
    outermost = np.ones((sheet.board.rows, sheet.board.columns), bool)
    outermost[1:-1, 1:-1] = False
    off = []
    for found, truth in zip((views.left_px, views.right_px), true, strict=True):
        for a, b in zip(found, truth, strict=True):
            off.append(min((np.hypot(*(a - c).T) for c in (b, b[::-1])), key=np.nansum))
    at = outermost.ravel()
    return np.array(off)[:, ~at], np.array(off)[:, at]


@pytest.mark.parametrize("margin", MARGINS)
@pytest.mark.parametrize("rim", RIMS)
def test_narrow_rims_do_not_draw_corners_away(rim, margin):
    inner, outermost = errors_px(rim, margin)
    assert np.isfinite(inner).all()
    assert np.isfinite(outermost).mean() > (0.8 if rim < 0.5 else 0.999)
    assert np.nanmax(outermost) < 1.0  # by up to 8 px when the window reaches over the rim
    widened = 3.0 if rim < 0.5 else 1.6  # a window of 2 px sees less than one of 10
    assert np.sqrt(np.nanmean(outermost**2)) < widened * np.sqrt((inner**2).mean())


def test_narrow_rims_in_a_blurred_noisy_picture():
    inner, outermost = errors_px(0.5, 0.3, Photo(blur_px=1.1, noise=4.0, jpeg=70))
    assert np.nanmax(outermost) < 3 * inner.max()


@pytest.mark.parametrize("rim", RIMS)
def test_the_rim_is_found_where_it_is(rim):
    rng = np.random.default_rng(7)
    rig, sheet = draw_rig(rng), Print(rim=rim)
    (pose,) = draw_poses(rig, 1, rng)
    ((left, _),) = photographed(rig, [pose], sheet, Photo(), rng)
    (true,), _ = project_boards(rig, [pose])
    grid = true.astype(np.float32).reshape(sheet.board.rows, sheet.board.columns, 2)
    for turn in range(4):
        assert min(rim_distance(left, np.rot90(grid, turn)), 1.0) == pytest.approx(rim, abs=0.06)  # looked for up to 1


def test_no_rim_is_seen_in_a_picture_without_contrast():
    grid = np.stack(np.meshgrid(np.arange(60, 240, 20.0), np.arange(60, 180, 20.0)), -1).astype(np.float32)
    assert rim_distance(np.full((240, 320), 128, np.uint8), grid) == np.inf


def test_outermost_corners_are_led_on_from_three():
    grid = np.stack(np.meshgrid(np.arange(9.0) ** 2, np.arange(6.0)), -1).astype(np.float32)
    led = extrapolated(grid)
    np.testing.assert_allclose(led[0], grid[0])
    np.testing.assert_allclose(led[:, -1], grid[:, -1])
    assert np.isnan(led[1:-1, 1:-1]).all()
    assert np.isnan(extrapolated(grid[:3])[0, 1:-1]).all()  # the row opposite may be as wrong


def test_a_calibration_with_half_rims_is_as_good_as_with_full_ones():
    rms, baselines = [], []
    for rim in (1.0, 0.5):
        rng = np.random.default_rng(11)
        rig = draw_rig(rng)
        pairs = photographed(rig, draw_poses(rig, 10, rng), Print(rim=rim), Photo(), rng)
        views = find_in_pairs(pairs, Print().board, [str(k) for k in range(len(pairs))], progress=False)
        found = calibrate_stereo(views)
        rms.append(found.rms_px)
        baselines.append(found.rig.baseline_mm)
    assert rms[1] < 1.3 * rms[0]
    assert baselines[1] == pytest.approx(baselines[0], abs=0.15)


def test_a_corner_without_room_is_not_found():
    rng = np.random.default_rng(3)
    rig, sheet = draw_rig(rng), Print(rim=0.18)
    pairs = photographed(rig, draw_poses(rig, 4, rng), sheet, Photo(), rng)
    tried = [find_checkerboard(image, sheet.board) for pair in pairs for image in pair]
    found = np.array([corners for corners in tried if corners is not None])
    grids = found.reshape(len(found), sheet.board.rows, sheet.board.columns, 2)
    assert np.isnan(grids[:, 0]).any()
    assert np.isfinite(grids[:, 1:-1, 1:-1]).all()
