"""What the first boards tell already: exchanged cameras, a wrong count of corners; and what they must not claim."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from support.corners import corner_set

from stereolib.base import data_path
from stereolib.calibration import Checkerboard
from stereolib.calibration.first_boards import check_first_boards, check_sides, exchanged_mm
from stereolib.rig import PairFile, find_pairs
from stereolib.virtual.staged import draw_rig


def exchanged(views):
    return replace(views, left_px=views.right_px, right_px=views.left_px)


@pytest.mark.parametrize("count", [3, 6, 20])
def test_cameras_that_are_exchanged_are_told_by_three_boards_and_others_never_are(count):
    told = []
    for seed in range(8):
        rng = np.random.default_rng([seed, count])
        rig = draw_rig(rng)
        views = corner_set(rng, rig=rig)
        some = views.only(rng.choice(len(views), count, replace=False).tolist())
        assert np.isnan(exchanged_mm(some))
        told.append(exchanged_mm(exchanged(some)) / rig.baseline_mm)
    assert 0.6 < np.median(told) < 1.5 and np.isfinite(told).all()


def test_two_boards_and_cameras_above_each_other_tell_nothing():
    rng = np.random.default_rng(0)
    views = exchanged(corner_set(rng, rig=draw_rig(rng)))
    assert np.isnan(exchanged_mm(views.only([0, 1]))) and np.isfinite(exchanged_mm(views.only([0, 1, 2])))
    upright = views.left_px[..., ::-1].copy(), views.right_px[..., ::-1].copy()  # turned onto its side
    board = replace(views.board, columns=views.board.rows, rows=views.board.columns)
    order = np.arange(54).reshape(6, 9).T.ravel()
    aside = replace(views, board=board, left_px=upright[0][:, order], right_px=upright[1][:, order], size=(480, 640))
    assert np.isnan(exchanged_mm(aside))


def test_the_sides_are_named():
    rng = np.random.default_rng(0)
    views = corner_set(rng, rig=draw_rig(rng))
    check_sides(views, "a and b")
    text = r"^left and right are exchanged in a and b: by 20 pairs .* other way round.* or mirror"
    with pytest.raises(ValueError, match=text):
        check_sides(exchanged(views).only(range(20)), "a and b")


def test_a_wrong_count_of_corners_is_told_by_the_first_pictures_with_the_right_one(tmp_path: Path):
    for of_what, names in (("boards", ("01", "03", "05")), ("room", ("1", "3", "4"))):
        (tmp_path / of_what).mkdir()
        for name in names:
            for side in ("left", "right"):
                picture = cv2.imread(str(data_path(f"virtual/{of_what}/{name}_{side}.jpg")), cv2.IMREAD_GRAYSCALE)
                cv2.imwrite(str(tmp_path / of_what / f"{side}{name}.png"), picture[::2, ::2])
    boards, room = (find_pairs(tmp_path / of_what) for of_what in ("boards", "room"))
    with pytest.raises(
        ValueError,
        match=r"^my: none of the 3 pairs looked at first \(left01.png ...\) shows a board of 8x5 .* of 9x6\. Say so",
    ):
        check_first_boards(boards, Checkerboard(8, 5, 25.0), "my")
    check_first_boards(boards, Checkerboard(9, 6, 25.0), "my")
    check_first_boards(room, Checkerboard(8, 5, 25.0), "my")  # no board, so no claim
    with pytest.raises(ValueError, match="left and right are exchanged in my"):
        check_first_boards([PairFile(right, left) for left, right in boards], Checkerboard(9, 6, 25.0), "my")
