"""Boards in files: kept as they are found, found again without searching, bad files listed together."""

from __future__ import annotations

import shutil

import cv2
import numpy as np
import pytest

from stereolib.base import data_path
from stereolib.calibration import Checkerboard, board_files, find_in_files, find_in_pairs
from stereolib.calibration.board_files import CACHE
from stereolib.virtual import recordings

BOARD = recordings.BOARD


@pytest.fixture
def files(tmp_path):
    """Three pairs of recorded boards in two folders."""
    sides = []
    for side in ("left", "right"):
        (tmp_path / side).mkdir()
        names = [f"{k:02d}.jpg" for k in (1, 2, 3)]
        for name in names:
            shutil.copy(data_path(f"virtual/boards/{name[:2]}_{side}.jpg"), tmp_path / side / name)
        sides.append([tmp_path / side / name for name in names])
    return sides


@pytest.fixture
def counted(monkeypatch):
    """How often an image is really searched."""
    calls, real = [], board_files.find_board

    def find(image, board):
        calls.append(board)
        return real(image, board)

    monkeypatch.setattr(board_files, "find_board", find)
    return calls


def test_the_second_run_reads_what_the_first_one_kept(files, counted):
    first = find_in_files(*files, BOARD, progress=False)
    assert len(counted) == 6
    second = find_in_files(*files, BOARD, progress=False)
    assert len(counted) == 6
    np.testing.assert_array_equal(first.left_px, second.left_px)
    np.testing.assert_array_equal(first.right_px, second.right_px)
    assert first.names == second.names == ("01.jpg", "02.jpg", "03.jpg")
    pairs, names = recordings.load_boards()
    np.testing.assert_array_equal(first.right_px, find_in_pairs(pairs[:3], BOARD, names[:3], progress=False).right_px)


def test_the_size_in_mm_does_not_search_again(files, counted):
    first = find_in_files(*files, BOARD, progress=False)
    again = find_in_files(*files, Checkerboard(9, 6, 30.0, 1.01), progress=False)
    assert len(counted) == 6 and again.board.square_mm == 30.0
    np.testing.assert_array_equal(first.left_px, again.left_px)


def test_other_content_other_board_or_a_broken_file_is_searched_anew(files, counted):
    find_in_files(*files, BOARD, progress=False)
    files[0][0].write_bytes(files[0][1].read_bytes())  # under the name of another: known by its content
    find_in_files(*files, BOARD, progress=False)
    assert len(counted) == 6
    cv2.imwrite(str(files[0][0]), np.full((480, 640), 99, np.uint8))
    assert find_in_files(*files, BOARD, progress=False).missing == ("01.jpg",)
    assert find_in_files(*files, BOARD, progress=False).missing == ("01.jpg",)  # "no board" is kept too
    assert len(counted) == 7
    with pytest.raises(ValueError, match="no board of 8x5"):
        find_in_files([files[0][0]], [files[1][0]], Checkerboard(8, 5, 25.0), progress=False)
    assert len(counted) == 9
    for kept in (files[1][0].parent / CACHE).iterdir():
        kept.write_bytes(kept.read_bytes()[:40])
    find_in_files(*files, BOARD, progress=False)
    assert len(counted) == 12
    find_in_files(*files, BOARD, progress=False, cache=False)
    assert len(counted) == 18


@pytest.mark.parametrize(
    "content",
    [b"", b"words, not corners", b"PK\x03\x04", "scalar", {"corners": "twelve", "size": [640, 480]},
     {"corners": 3.0, "size": [640, 480]}, {"corners": np.zeros((54, 2), np.float32), "size": 640},
     {"corners": np.zeros((40, 2), np.float32), "size": [640, 480]}],
    ids=["empty", "text", "cut zip", "scalar", "strings", "number", "one size", "another board"],
)  # fmt: skip
def test_a_kept_view_that_is_none_is_searched_again_and_replaced(files, counted, content):
    first = find_in_files(*files, BOARD, progress=False)
    (kept, *_) = sorted((files[0][0].parent / CACHE).iterdir())
    good = kept.read_bytes()
    if isinstance(content, bytes):
        kept.write_bytes(content)
    else:
        with kept.open("wb") as stream:
            np.save(stream, 3.0) if content == "scalar" else np.savez(stream, **content)
    again = find_in_files(*files, BOARD, progress=False)
    assert len(counted) == 7
    np.testing.assert_array_equal(again.left_px, first.left_px)
    assert kept.read_bytes() == good
    find_in_files(*files, BOARD, progress=False)
    assert len(counted) == 7


def test_an_interruption_loses_nothing(files, monkeypatch):
    calls, real = [], board_files.find_board

    def find(image, board):
        if len(calls) == 4:
            raise KeyboardInterrupt
        calls.append(None)
        return real(image, board)

    monkeypatch.setattr(board_files, "find_board", find)
    monkeypatch.setattr(board_files, "over_cores", lambda task, items, *_, **__: map(task, items))
    with pytest.raises(KeyboardInterrupt):
        find_in_files(*files, BOARD, progress=False)
    monkeypatch.setattr(board_files, "find_board", lambda image, board: calls.append(None) or real(image, board))
    assert len(find_in_files(*files, BOARD, progress=False)) == 3
    assert len(calls) == 6  # four before, and the two that were left


def test_a_folder_for_reading_only_is_searched_all_the_same(files, counted, monkeypatch):
    def refuse(path, data):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(board_files, "write_atomic", refuse)
    assert len(find_in_files(*files, BOARD, progress=False)) == 3


def test_bad_files_are_listed_together(files):
    files[0][1].write_bytes(b"no picture")
    files[1][2].write_bytes(files[1][2].read_bytes()[:2000])
    files[1][0].unlink()
    with pytest.raises(ValueError, match="3 of 6 files are no readable images") as caught:
        find_in_files(*files, BOARD, progress=False)
    text = str(caught.value)
    assert all(
        part in text for part in ("left/02.jpg: not a", "right/03.jpg: the JPEG is cut", "right/01.jpg: no such")
    )


def test_mixed_sizes_are_listed(files):
    small = cv2.imread(str(files[0][2]))[:240]
    cv2.imwrite(str(files[0][2]), small)
    with pytest.raises(ValueError, match=r"most are 640x480, but:\n.*left/03.jpg is 640x240"):
        find_in_files(*files, BOARD, progress=False)


def test_unpaired_lists(files):
    with pytest.raises(ValueError, match="got 3 left and 2 right"):
        find_in_files(files[0], files[1][:2], BOARD, progress=False)


def test_one_file_is_no_list_of_files(files):
    with pytest.raises(ValueError, match="put it into a list"):
        find_in_files(files[0][0], files[1][0], BOARD)
