"""Boards: the corners of a rendered one against where they were, and their order."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from support.corners import corner_set

from stereolib.calibration import Charuco, Checkerboard, find_boards, find_charuco, find_checkerboard, find_in_pairs
from stereolib.calibration.board_views import match_order
from stereolib.rig import Camera, pose_left_world, rigid
from stereolib.virtual import Scene, board_box, render

BOARD = Checkerboard(9, 6, 25.0)
CAMERA = Camera([[365, 0, 161], [0, 364, 113], [0, 0, 1]], [0.06, -0.25, 7e-4, -1e-3, -0.3], (320, 240))
POSE = pose_left_world(0.0, 1000.0)


@pytest.fixture(scope="module")
def clean():
    """A clean picture of a tilted board, and the true pixels of its corners in the order of `points_mm`."""
    turn = cv2.Rodrigues(np.array([0.35, -0.3, 0.15]))[0] @ np.diag([1.0, -1.0, -1.0])
    T_camera_board = rigid(turn, [15.0, -5.0, 420.0])
    scene = Scene((board_box((9, 6), 25.0, np.linalg.inv(POSE) @ T_camera_board),), (), ambient=0.9)
    light = render(scene, CAMERA, POSE, samples=4)
    image = np.rint(255 * np.clip(cv2.GaussianBlur(light, (0, 0), 0.6), 0, 1) ** (1 / 2.2)).astype(np.uint8)
    corners = (BOARD.points_mm - BOARD.points_mm.mean(axis=0)) * [1, -1, 1]  # rows run down, the board's y runs up
    return image, CAMERA.project(corners @ turn.T + T_camera_board[:3, 3])


def off_px(found, truth):
    return min(np.hypot(*(order - truth).T).max() for order in (found, found[::-1]))


def test_corners_on_the_board():
    points = BOARD.points_mm
    assert points.shape == (54, 3)
    np.testing.assert_array_equal(
        points[[0, 1, 8, 9, 53]], [[0, 0, 0], [25, 0, 0], [200, 0, 0], [0, 25, 0], [200, 125, 0]]
    )


def test_rendered_corners_come_back_within_a_tenth_of_a_pixel(clean):
    image, truth = clean
    assert off_px(find_checkerboard(image, BOARD), truth) < 0.1


def test_classic_detector_where_the_other_finds_nothing(clean, monkeypatch):
    image, truth = clean
    monkeypatch.setattr(find_boards.cv2, "findChessboardCornersSB", lambda *_, **__: (False, None))
    assert off_px(find_checkerboard(image, BOARD), truth) < 0.1


def test_noise_and_blur_of_a_webcam(clean):
    image, truth = clean
    noisy = cv2.GaussianBlur(image, (0, 0), 0.7) + np.random.default_rng(0).normal(0, 4, image.shape)
    assert off_px(find_checkerboard(np.clip(noisy, 0, 255).astype(np.uint8), BOARD), truth) < 0.25


def test_no_board(clean):
    image, _ = clean
    assert find_checkerboard(np.full((240, 320), 128, np.uint8), BOARD) is None
    assert find_checkerboard(image, Checkerboard(8, 5, 25.0)) is None
    assert find_checkerboard(image, BOARD) is not None


def test_order_is_mended_after_half_a_turn():
    left = (BOARD.points_mm[:, :2] * 2 + 50).astype(np.float32)
    for angle in np.radians([0, 30, -60]):
        c, s = np.cos(angle), np.sin(angle)
        right = left @ np.float32([[c, s], [-s, c]]) - 20
        np.testing.assert_array_equal(match_order(left, right), right)
        np.testing.assert_array_equal(match_order(left, right[::-1]), right)


def test_pair_with_a_turned_view_is_matched(clean, monkeypatch):
    """The detector may begin at either end of the board; both views must agree."""
    image, _ = clean
    straight = find_in_pairs([(image, image)], BOARD, progress=False)
    np.testing.assert_array_equal(straight.left_px, straight.right_px)
    real, calls = find_boards.find_checkerboard, []

    def turning(view, target):
        calls.append(None)
        found = real(view, target)
        return found[::-1].copy() if view is right else found

    right = image.copy()
    monkeypatch.setattr(find_boards, "find_checkerboard", turning)
    views = find_in_pairs([(image, right)], BOARD, progress=False)
    assert len(calls) == 2
    np.testing.assert_array_equal(views.right_px, straight.right_px)


def test_pairs_without_a_board_are_named(clean):
    image, _ = clean
    blank = np.full_like(image, 128)
    views = find_in_pairs([(image, image), (image, blank), (blank, image)], BOARD, ["a", "b", "c"], progress=False)
    assert (views.names, views.missing, views.size, len(views)) == (("a",), ("b", "c"), (320, 240), 1)
    assert views.only([0]).left_px.shape == (1, 54, 2)
    with pytest.raises(
        ValueError, match=r"no board of 9x6 inner corners .* 2 pairs \(one\.jpg, two\.jpg\): count inner"
    ):
        find_in_pairs([(blank, blank)] * 2, BOARD, ["one.jpg", "two.jpg"], progress=False)


def test_pairs_that_do_not_fit_are_named(clean):
    image, _ = clean
    with pytest.raises(ValueError, match=r"pair 2 \(left\) is 320x240, pair 2 \(right\) is 160x240"):
        find_in_pairs([(image, image), (image, image[:, ::2])], BOARD, progress=False)
    with pytest.raises(ValueError, match="pair 2 is 160x240, pair 1 is 320x240: all pairs must have one size"):
        find_in_pairs([(image, image), (image[:, ::2], image[:, ::2])], BOARD, progress=False)
    with pytest.raises(ValueError, match="no image pairs"):
        find_in_pairs([], BOARD, progress=False)


@pytest.mark.parametrize(
    ("board", "text"),
    [
        ((2, 6, 25), "at least 3x3 inner corners, got 2x6"),
        ((6, 6, 25), "6x6 inner corners looks the same after a quarter turn"),
        ((9, 6, 0), "positive number of mm, got 0"),
        ((9, 6, float("nan")), "positive number of mm"),
    ],
)
def test_refuses(board, text):
    with pytest.raises(ValueError, match=text):
        Checkerboard(*board)


CHARUCO = Charuco(8, 5, 24.0, 17.0)


def charuco_view(quarter_turns=0, crop=0):
    """A ChArUco board seen at a slant, and the true pixels of its corners."""
    scale = 8  # px/mm of the print
    print_ = CHARUCO.printed.generateImage((9 * 24 * scale, 6 * 24 * scale))
    corners = np.float32([[0, 0], [216, 0], [216, 144], [0, 144]])
    seen = np.roll(np.float32([[80, 60], [560, 90], [540, 420], [60, 400]]), quarter_turns, axis=0)
    H = cv2.getPerspectiveTransform(corners, seen)
    # generateImage's print runs to its pixels' outer edges, so a millimetre's place lies half a pixel before
    to_print = np.array([[scale, 0, -0.5], [0, scale, -0.5], [0, 0, 1.0]])
    finer = np.array([[4, 0, 1.5], [0, 4, 1.5], [0, 0, 1.0]])  # four by four samples a pixel
    fine = cv2.warpPerspective(print_, finer @ H @ np.linalg.inv(to_print), (2560, 1920), borderValue=255)
    image = cv2.GaussianBlur(cv2.resize(fine, (640, 480), interpolation=cv2.INTER_AREA), (0, 0), 0.8)
    image[:, 640 - crop :] = 255
    return image, cv2.perspectiveTransform(CHARUCO.points_mm[:, None, :2] + 24, H)[:, 0]


@pytest.mark.parametrize("quarter_turns", [0, 2])
def test_charuco_corners_come_back_with_their_numbers(quarter_turns):
    """Upside down they keep their order: no half turn to mend."""
    image, truth = charuco_view(quarter_turns)
    found = find_charuco(image, CHARUCO)
    assert np.isfinite(found).all()
    assert np.hypot(*(found - truth).T).max() < 0.1


def test_charuco_board_half_out_of_sight():
    image, truth = charuco_view(crop=300)
    found = find_charuco(image, CHARUCO)
    seen = np.isfinite(found).all(axis=1)
    assert 12 < seen.sum() < 30
    assert np.hypot(*(found - truth)[seen].T).max() < 0.1
    views = find_in_pairs([(image, charuco_view()[0])], CHARUCO, progress=False)
    np.testing.assert_array_equal(views.left_px[0], found)
    assert find_charuco(np.full((480, 640), 200, np.uint8), CHARUCO) is None


def test_charuco_corners_without_neighbours_are_none():
    """Of markers that touch at their corners alone: nothing tells how large a window around one may be."""
    image, truth = charuco_view()
    H, _ = cv2.findHomography(CHARUCO.points_mm[:, :2], truth)
    for column, row in np.ndindex(9, 6):
        if (column - row) % 4 == 3:  # every other diagonal of squares with markers
            marker = np.float32([[4, 4], [20, 4], [20, 20], [4, 20]]) + 24 * np.float32([column - 1, row - 1])
            cv2.fillConvexPoly(image, cv2.perspectiveTransform(marker[None], H).round().astype(int), 255)
    _, numbers, *_ = cv2.aruco.CharucoDetector(CHARUCO.printed).detectBoard(image)
    assert len(numbers) == 10
    assert find_charuco(image, CHARUCO) is None


def test_charuco_points_are_those_of_the_print():
    for target in (CHARUCO, Charuco(5, 5, 24.0, 17.0)):  # a square one is no problem here
        printed = target.printed.getChessboardCorners()
        np.testing.assert_allclose(target.points_mm, printed - printed[0], atol=1e-5)


def test_a_stretched_board_keeps_its_mean():
    points = Checkerboard(9, 6, 25.0, 1.02).points_mm
    width, height = points[1, 0], points[9, 1]
    assert height / width == pytest.approx(1.02)
    assert (height + width) / 2 == pytest.approx(25)


@pytest.mark.parametrize(
    ("board", "text"),
    [
        ((1, 6, 25, 20), "at least 2x2 inner corners, got 1x6"),
        ((5.5, 4, 25, 18), "counted in whole numbers, got 5.5 x 4"),
        ((8, 5, 20, 25), "marker must be smaller than its square, both in mm, got 25 and 20"),
        (
            (8, 5, 25, 0.018),
            "marker's edge was given as 0.018, but millimetres are expected: for 0.018 m that is 18",
        ),
        ((8, 5, 25, 20, "9X9_1"), "unknown ArUco dictionary '9X9_1'"),
    ],
)
def test_charuco_refuses(board, text):
    with pytest.raises(ValueError, match=text):
        Charuco(*board)


@pytest.mark.parametrize("image", [np.zeros((48, 64)), [[1, 2], [3, 4]], np.zeros((48, 64, 4), np.uint8)])
def test_what_is_no_picture_is_refused(image):
    for find, board in ((find_checkerboard, BOARD), (find_charuco, CHARUCO)):
        with pytest.raises(ValueError, match="the picture: "):
            find(image, board)


def test_views_that_are_none_are_refused_by_name():
    views = corner_set(np.random.default_rng(4), pairs=5)
    for known in (0, 2, 9):  # none, two, and a row
        left = views.left_px.copy()
        left[3, known:] = np.nan
        with pytest.raises(
            ValueError, match=r"fewer than 4 or all on one line: pair 04 \(left\); leave such pairs out"
        ):
            replace(views, left_px=left)
    with pytest.raises(ValueError, match=r"corners lie outside pictures of 480x640: .*in this order\?"):
        replace(views, size=(480, 640))
    with pytest.raises(ValueError, match="5 left views, 5 right ones and 3 names"):
        replace(views, names=views.names[:3])
    with pytest.raises(ValueError, match=r"9x6 inner corners needs \(views, 54, 2\) of them, NaN .*\(5, 50, 2\)"):
        replace(views, right_px=views.right_px[:, :50])


def test_pairs_are_chosen_by_index_or_mask():
    views = corner_set(np.random.default_rng(4), pairs=5)
    mask = np.array([False, True, False, False, True])
    for chosen in (mask, mask.tolist(), [1, 4], np.array([1, 4]), range(1, 5, 3), (1, -1)):
        some = views.only(chosen)
        assert some.names == ("pair 02", "pair 05")
        np.testing.assert_array_equal(some.left_px, views.left_px[[1, 4]])
        np.testing.assert_array_equal(some.right_px, views.right_px[[1, 4]])
    assert len(views.only([])) == len(views.only([False] * 5)) == 0
    for wrong in ([0, 5], [-6], [True] * 4, [True] * 6, [0.5]):
        with pytest.raises(ValueError, match="pairs are chosen of 5 by their indices, from 0, or by one bool for each"):
            views.only(wrong)


def test_refuses_a_senseless_aspect():
    with pytest.raises(ValueError, match=r"near 1, got 1\.5"):
        Checkerboard(9, 6, 25.0, 1.5)
