"""What the live judge of boards says of pictures whose board, motion and blur are known."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from stereolib.base import UInt8
from stereolib.calibration import BoardWatch, Charuco, find_board
from stereolib.paper import paper_rig
from stereolib.virtual import recordings

SIZE = (640, 480)


@cache
def pairs() -> list[tuple[UInt8, UInt8]]:
    return recordings.load_boards()[0]


@pytest.fixture
def watch() -> BoardWatch:
    return BoardWatch(recordings.BOARD, SIZE)


def moved(image: UInt8, by_px: float) -> UInt8:
    return np.asarray(cv2.warpAffine(image, np.float32([[1, 0, by_px], [0, 1, 0]]), SIZE, borderMode=1), np.uint8)


def test_a_board_is_ready_when_it_stands_still(watch: BoardWatch) -> None:
    left, right = pairs()[0]
    assert watch.look(left, right, 0.0).advice == "hold it still", "one look tells no motion"
    look = watch.look(left, right, 0.1)
    assert (look.advice, look.speed) == ("", 0.0)
    at_once = watch.look(left, right, 0.1)
    assert at_once.advice == "hold it still" and np.isnan(at_once.speed), "no time has passed"
    again = watch.look(moved(left, 8.0), moved(right, 8.0), 0.3)
    assert again.advice == "hold it still"
    assert again.speed == pytest.approx(8.0 / 640 / 0.2, rel=0.01)


def test_what_shows_no_board_is_not_remembered(watch: BoardWatch) -> None:
    corners = find_board(pairs()[0][0], recordings.BOARD)
    assert corners is not None
    with pytest.raises(ValueError, match=r"too few corners of the board, .*: empty \(left\)"):
        watch.add("empty", np.full_like(corners, np.nan), corners)
    assert len(watch.views) == 0 and not watch.places.size


def test_the_side_that_does_not_see_it_is_named(watch: BoardWatch) -> None:
    left, right = pairs()[0]
    grey = np.full_like(left, 120)
    assert watch.look(grey, grey, 0.0).advice == "show the board to both cameras"
    assert watch.look(left, grey, 0.1).advice == "the right camera does not see it"
    assert watch.look(grey, right, 0.2).advice == "the left camera does not see it"


@pytest.mark.parametrize("side", [0, 1])
def test_a_camera_s_first_look_tells_no_motion(watch: BoardWatch, side: int) -> None:
    pair = list(pairs()[0])
    alone = [np.full_like(picture, 120) if k == side else picture for k, picture in enumerate(pair)]
    watch.look(alone[0], alone[1], 0.0)
    look = watch.look(pair[0], pair[1], 0.1)
    assert np.isnan(look.speed) and look.advice == "hold it still"
    assert watch.look(pair[0], pair[1], 0.2).advice == ""


def test_a_blurred_picture_is_not_taken(watch: BoardWatch) -> None:
    left, right = pairs()[0]
    blurred = cv2.GaussianBlur(right, (0, 0), 2.0)
    watch.look(left, blurred, 0.0)
    look = watch.look(left, blurred, 0.1)
    assert look.advice.startswith("blurred in the right picture")
    sharp, soft = look.edge_px
    assert 2 * sharp < soft


def test_a_place_is_taken_once_and_another_is_new(watch: BoardWatch) -> None:
    for k in (0, 1):
        left, right = pairs()[k]
        watch.look(left, right, 10.0 * k)
        assert watch.look(left, right, 10.0 * k + 0.1).advice == ""
        found = watch.find(left, right)
        assert found is not None
        watch.add(f"{k}", *found)
        assert watch.look(left, right, 10.0 * k + 0.2).advice.startswith("this place is taken")
    assert watch.views.names == ("0", "1")
    np.testing.assert_array_equal(watch.views.left_px[1], find_board(pairs()[1][0], recordings.BOARD))


def test_what_is_missing_is_told_as_the_diagnosis_tells_it(watch: BoardWatch) -> None:
    assert watch.coverage is None
    for k in range(4):
        found = watch.find(*pairs()[k])
        assert found is not None
        watch.add(f"{k}", *found)
    before = watch.coverage
    assert before is not None and before.missing
    left, right = pairs()[0]
    watch.look(left, right, 0.0)
    assert before.missing[0] in watch.look(left, right, 0.1).advice


def test_distance_and_tilt_are_near_the_truth(watch: BoardWatch) -> None:
    tilts_deg = np.array([[0, 0], [30, 0], [0, -25], [-20, 20], [10, 35]])  # about the vertical, the horizontal axis
    away_mm = np.array([500.0, 600, 700, 850, 1000])
    board = recordings.BOARD.points_mm - recordings.BOARD.points_mm.mean(axis=0)
    for (vertical, horizontal), z in zip(tilts_deg, away_mm, strict=True):
        turn = Rotation.from_euler("yx", [vertical, -horizontal], degrees=True).as_matrix()
        seen = paper_rig().left.project(board @ turn.T + [20.0, -10.0, z]).astype(np.float32)
        watch.add(f"{z}", seen, seen)
    guessed = watch.places[:, 2] - np.log(away_mm)
    np.testing.assert_allclose(guessed, guessed.mean(), atol=0.06, err_msg="the lens is guessed: one factor for all")
    turned = [Rotation.from_euler("yx", [v, -h], degrees=True).as_matrix()[:, 2] for v, h in tilts_deg]
    true = [np.arctan2(normal[:2], normal[2]) for normal in turned]
    np.testing.assert_allclose(watch.places[:, 3:], true, atol=np.radians(8))


def test_large_pictures_are_searched_in_reduced_size() -> None:
    left, right = (cv2.resize(side, None, fx=3, fy=3, interpolation=cv2.INTER_CUBIC) for side in pairs()[0])
    look = BoardWatch(recordings.BOARD, (1920, 1440)).look(left, right, 0.0)
    whole = find_board(left, recordings.BOARD)
    assert look.corners_px[0] is not None and whole is not None
    off = np.linalg.norm(look.corners_px[0] - whole, axis=1)
    assert np.nanmedian(off) < 1.0 and abs(np.nanmean(look.corners_px[0] - whole)) < 0.5


def test_a_charuco_board_may_leave_the_picture_in_part() -> None:
    board = Charuco(8, 5, 30.0, 22.0)
    drawn = board.printed.generateImage((900, 600), marginSize=30)
    sheet = cv2.warpPerspective(
        cv2.cvtColor(drawn, cv2.COLOR_GRAY2BGR), np.float32([[0.6, 0.03, 250], [0, 0.6, 90], [0, 1e-4, 1]]), SIZE,
        borderValue=(128, 128, 128),
    )  # fmt: skip
    watch = BoardWatch(board, SIZE)
    watch.look(sheet, sheet, 0.0)
    assert watch.look(sheet, sheet, 0.1).advice == ""
    found = watch.find(sheet, sheet)
    assert found is not None and 8 <= np.isfinite(found[0][:, 0]).sum() < 40
    watch.add("1", *found)
    assert watch.look(sheet, sheet, 0.2).advice.startswith("this place is taken")


def held(side: str) -> np.ndarray:
    """Corners of a board half a metre away, turned by 25 degrees: its one side, as it is seen, is nearer."""
    board_mm = recordings.BOARD.points_mm - recordings.BOARD.points_mm.mean(axis=0)
    across, upright = {"left": (-25, 0), "right": (25, 0), "upper": (0, -25), "lower": (0, 25)}[side]
    points = Rotation.from_euler("yx", [across, -upright], degrees=True).apply(board_mm) + np.array([0, 0, 500])
    outer = points[np.argmax({"left": -1, "right": 1}.get(side, 0) * points[:, 0]
                             + {"upper": -1, "lower": 1}.get(side, 0) * points[:, 1])]  # fmt: skip
    assert outer[2] < 480, "y points down, z ahead: it is nearer"
    return np.float32(550 * points[:, :2] / points[:, 2:] + [319.5, 239.5])


@pytest.mark.parametrize("side", ["left", "right", "upper", "lower"])
def test_the_side_that_was_never_nearer_is_named(watch: BoardWatch, monkeypatch: pytest.MonkeyPatch, side: str) -> None:
    for other in {"left", "right", "upper", "lower"} - {side}:
        watch.add(other, held(other), held(other))
    monkeypatch.setattr(BoardWatch, "coverage", None)
    assert f", its {side} side nearer: fewest boards were so" in watch.empty


@pytest.mark.parametrize("part", range(9))
def test_the_part_where_no_board_was_is_named(watch: BoardWatch, monkeypatch: pytest.MonkeyPatch, part: int) -> None:
    names = [f"{row} {column}" for row in ("upper", "middle", "lower") for column in ("left", "centre", "right")]
    names[4] = "centre"
    centres = [((k % 3 + 0.5) / 3, (k // 3 + 0.5) / 3 * SIZE[1] / SIZE[0]) for k in range(9)]
    watch._poses = [np.array([*at, 7.0, 0.3, 0.3]) for k, at in enumerate(centres) if k != part]
    monkeypatch.setattr(BoardWatch, "coverage", None)
    assert watch.empty.startswith(f"hold it in the {names[part]}, its ")
