"""Boards to print: rasterised and measured."""

from __future__ import annotations

import re

import cv2
import numpy as np
import pypdfium2
import pytest

from stereolib.calibration import Charuco, Checkerboard, find_board
from stereolib.plotting import PAPERS_MM, board_sheet, largest_square_mm

DPI = 254  # ten pixels a millimetre
BOARDS = {
    "checkerboard": Checkerboard(9, 6, 23.0),
    "upright": Checkerboard(6, 9, 20.0),
    "charuco": Charuco(9, 6, 22.0, 16.0),
    "legacy": Charuco(7, 5, 22.0, 16.0, legacy=True),
    "upright charuco": Charuco(6, 8, 20.0, 14.0, "4X4_50"),
}


def rasterised(sheet: bytes) -> np.ndarray:
    (page,) = pypdfium2.PdfDocument(sheet)
    return np.ascontiguousarray(page.render(scale=DPI / 72, grayscale=True).to_numpy())


@pytest.mark.parametrize("paper", ["a4", "letter"])
@pytest.mark.parametrize("name", BOARDS)
def test_corners_are_where_they_should_be(name: str, paper: str) -> None:
    board = BOARDS[name]
    picture = rasterised(board_sheet(board, paper))
    assert sorted(np.array(picture.shape) / 10) == pytest.approx(sorted(PAPERS_MM[paper]), abs=0.15)
    found = find_board(cv2.GaussianBlur(picture, (0, 0), 2), board)
    assert found is not None and not np.isnan(found).any()
    if isinstance(board, Checkerboard) and found[0].sum() > found[-1].sum():
        found = found[::-1]  # it may begin at either end
    off_mm = found / 10 - board.points_mm[:, :2]
    assert np.abs(off_mm - off_mm.mean(axis=0)).max() < 0.1  # a pixel, to whose edges parts are drawn


@pytest.mark.parametrize("name", ["checkerboard", "upright"])
def test_the_bar_is_100_mm(name: str) -> None:
    picture = rasterised(board_sheet(BOARDS[name]))
    below = picture[-340:] < 128  # margin and foot
    longest = max(
        right - left
        for row in below
        for left, right in np.flatnonzero(np.diff(np.concatenate([[0], row.astype(int), [0]]))).reshape(-1, 2)
    )
    assert longest / 10 == pytest.approx(100, abs=0.1)


@pytest.mark.parametrize("name", BOARDS)
def test_what_is_to_be_measured_is_what_the_board_has(name: str) -> None:
    board = BOARDS[name]
    (page,) = pypdfium2.PdfDocument(board_sheet(board))
    text = page.get_textpage().get_text_range()
    found = re.search(r"(\d+) squares across are ([\d.]+) mm, (\d+) squares down ([\d.]+) mm", text)
    assert found is not None, text
    across, width, down, height = map(float, found.groups())
    assert (across, down) == (board.columns + 1, board.rows + 1)
    assert (width, height) == pytest.approx((across * board.square_mm, down * board.square_mm))
    assert f"divide by {across:g} and by {down:g}" in text
    picture = rasterised(board_sheet(board)) < 128
    assert not any(rim.any() for rim in (picture[:60], picture[-60:], picture[:, :60], picture[:, -60:])), "6 mm"


def test_the_same_board_makes_the_same_bytes() -> None:
    first, second = (board_sheet(BOARDS["charuco"]) for _ in range(2))
    assert first == second and first.startswith(b"%PDF") and b"/Subtype /Image" not in first  # vectors alone


@pytest.mark.parametrize(("columns", "rows"), [(9, 6), (6, 9), (11, 8)])
@pytest.mark.parametrize("paper", list(PAPERS_MM))
def test_the_largest_square_fits_and_no_larger_one(columns: int, rows: int, paper: str) -> None:
    most = largest_square_mm(columns, rows, paper)
    picture = rasterised(board_sheet(Checkerboard(columns, rows, most), paper))
    dark = np.argwhere(picture < 128) / 10
    assert dark.min() > 4 and (np.array(picture.shape) / 10 - dark.max(axis=0)).min() > 4
    with pytest.raises(ValueError, match=f"do not fit {paper}: {most:g} mm do"):
        board_sheet(Checkerboard(columns, rows, most + 1), paper)


def test_what_cannot_be_printed_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown paper 'a5'; choose one of a4, letter, a3"):
        board_sheet(BOARDS["charuco"], "a5")
    with pytest.raises(ValueError, match="as high as wide"):
        board_sheet(Checkerboard(9, 6, 20.0, 1.01))


def test_nothing_of_the_text_is_cut_off() -> None:
    picture = rasterised(board_sheet(Charuco(9, 6, 22.5, 16.25, "APRILTAG_36h11"), "letter"))
    assert (picture[:, :50] == 255).all() and (picture[:, -50:] == 255).all() and (picture[-50:] == 255).all()
    assert cv2.countNonZero(255 - picture[-300:]) > 5000  # there is some
