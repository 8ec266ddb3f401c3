"""A calibration tried on fresh boards: unmoved rigs stay good, and every movement is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.corners import corner_set, draw_poses, project_boards
from support.knocks import calibrated, knocked

from stereolib.calibration import (
    BoardViews,
    CalibrationRecord,
    Charuco,
    Estimate,
    check_calibration,
    fit_rig,
    triangulate,
)
from stereolib.paper import paper_rig
from stereolib.virtual.recordings import BOARD

PAIRS = pytest.mark.parametrize("pairs", [1, 6])


@pytest.fixture(scope="module")
def paper():
    return calibrated(paper_rig(), np.random.default_rng(3))


def check(paper, fresh):
    return check_calibration(paper[0], fresh, record=paper[1])


@PAIRS
@pytest.mark.parametrize(
    ("change", "what", "value", "says"),
    [
        ({"turn_deg": (0.0785, 0, 0)}, "tilt", np.radians(0.0785), "tilted down by 0.0"),
        ({"turn_deg": (-0.12, 0, 0)}, "tilt", np.radians(-0.12), "tilted up by 0.1"),
        ({"turn_deg": (0, 0, 0.3)}, "roll", np.radians(0.3), "rolled anticlockwise by 0.3"),
        ({"turn_deg": (0, 0.1, 0)}, "yaw", np.radians(0.1), "turned inwards about the vertical axis by "),
        ({"shift_mm": (-1, 0, 0)}, "baseline", 1.0, "boards come out 1.0"),
        ({"shift_mm": (0, -2, 0)}, "rise", -2.0, "moved down by"),
        ({"shift_mm": (0, 0, -6)}, "advance", 6.0, "moved forwards by"),
        ({"left": 0.01}, "left focus", 0.01, "left lens's focal length is"),
        ({"right": 0.01}, "right focus", 0.01, "right lens's focal length is"),
        ({"left": -0.03, "right": -0.03}, "both focus", -0.03, "both lenses is"),
    ],
)
def test_a_movement_is_named(paper, pairs, change, what, value, says):
    rng = np.random.default_rng([5, pairs])
    result = check(paper, corner_set(rng, rig=knocked(paper_rig(), **change), pairs=pairs))
    (moved,) = result.movement.named
    assert what in (moved.what, *(moved.alike if pairs == 1 else ()))
    if moved.what == what:
        assert moved.value == pytest.approx(value, rel=0.1, abs=4 * moved.std)
        assert says in result.findings[0]
    assert result.verdict in ("usable", "recalibrate")


def test_rows_off_by_a_pixel_are_rows_and_a_tilt(paper):
    fresh = corner_set(np.random.default_rng(8), pairs=4)
    result = check(paper, replace(fresh, right_px=fresh.right_px - np.float32([0, 1])))
    assert result.movement.named[0].what == "tilt"
    assert result.findings[0].startswith("rows: the right camera has tilted down by 0.07")
    assert result.verdict == "recalibrate" and "rows differ after rectification by 1.0" in " ".join(result.findings)
    assert result.row_offset_px.value == pytest.approx(1, abs=0.15) and result.row_offset_px.sure


@PAIRS
def test_a_wrong_square_is_a_scale(paper, pairs):
    fresh = corner_set(np.random.default_rng(9), pairs=pairs)
    result = check(paper, replace(fresh, board=replace(BOARD, square_mm=24.0)))
    assert result.movement.named[0].what == "baseline"
    assert result.findings[0].startswith("scale: boards come out 4.1")
    assert "the square's edge is 25.0" in result.findings[0] and result.verdict == "recalibrate"
    assert result.square_pct.value == pytest.approx(100 / 24, abs=max(0.1, 4 * result.square_pct.std))


@pytest.mark.parametrize(("shift_mm", "turn_deg", "said"), [((-15, 0, 0), 0.0, True), ((0, 0, 0), 0.4, True),
                                                        ((-2, 0, 0), 0.1, False)])  # fmt: skip
def test_another_rig_s_calibration_is_doubted(paper, shift_mm, turn_deg, said):
    other = knocked(paper_rig(), shift_mm=shift_mm, turn_deg=(turn_deg, 0, 0))
    findings = check(paper, corner_set(np.random.default_rng(10), rig=other, pairs=4)).findings
    assert ("is the calibration of these cameras" in findings[0]) is said


def bent(rig, rng, pairs, mm):
    """Boards whose short sides stand nearer to the cameras than their middle line by so much."""
    poses, points = draw_poses(rig, pairs, rng), BOARD.points_mm.astype(float)
    points = (points - points.mean(axis=0)) * [1, -1, 1]
    points[:, 2] = mm * (points[:, 0] / points[:, 0].max()) ** 2
    seen = [points @ T[:3, :3].T + T[:3, 3] for T in poses]
    left = np.array([rig.left.project(X) for X in seen])
    right = np.array([rig.right.project(X @ rig.R.T + rig.T) for X in seen])
    noisy = [(p + rng.normal(0, 0.034, p.shape)).astype(np.float32) for p in (left, right)]
    return BoardViews(BOARD, rig.left.size, *noisy, tuple(f"{k}" for k in range(pairs)), ())


@PAIRS
def test_a_bent_board_is_no_ruler(paper, pairs):
    result = check(paper, bent(paper_rig(), np.random.default_rng(2), pairs, 2.0))
    assert result.verdict == "no verdict"
    assert result.findings[0].startswith("the board is not flat, it bends by ")
    assert abs(result.bend_mm["along columns"].value) == pytest.approx(2, abs=0.4)
    assert not [text for text in result.findings if "scale" in text or "depths" in text]
    flat = check(paper, bent(paper_rig(), np.random.default_rng(2), pairs, 0.0))
    assert flat.verdict == "still good" and abs(flat.bend_mm["along columns"].value) < 0.5


def test_a_bent_board_still_shows_its_rows(paper):
    fresh = bent(paper_rig(), np.random.default_rng(2), 3, 2.0)
    result = check(paper, replace(fresh, right_px=fresh.right_px + np.float32([0, 2])))
    assert result.verdict == "recalibrate" and "the board is not flat" in result.findings[0]
    assert [one.name for one in result.checks] == ["rows differ after rectification by"]


def test_what_made_the_calibration_is_refused(paper):
    views, fresh = paper[2], corner_set(np.random.default_rng(4), pairs=2)
    both = replace(
        fresh,
        left_px=np.concatenate([fresh.left_px, views.left_px[[7]]]),
        right_px=np.concatenate([fresh.right_px, views.right_px[[7]]]),
        names=("a.png", "b.png", "old.png"),
    )
    with pytest.raises(ValueError, match=r"1 of 3 pairs made the calibration \(old.png\): take new ones"):
        check(paper, both)
    again = corner_set(np.random.default_rng(5), poses=draw_poses(paper_rig(), 30, np.random.default_rng(3))[:2])
    assert paper[1].made_from(again) == ()  # the same boards taken again differ by their noise
    assert "whether these are fresh cannot be checked" in check_calibration(paper[0], fresh).notes[0]


def test_no_pair_is_no_check(paper):
    with pytest.raises(ValueError, match="there is no pair of the board"):
        check(paper, corner_set(np.random.default_rng(6), pairs=3).only([]))


def test_numbered_boards_may_be_seen_in_part(paper):
    board = Charuco(9, 6, 25.0, 18.0)
    fresh = corner_set(np.random.default_rng(6), pairs=3)
    left, right = fresh.left_px.copy(), fresh.right_px.copy()
    left[:, :9], right[0, ::6] = np.nan, np.nan
    result = check(paper, replace(fresh, board=board, left_px=left, right_px=right))
    assert result.verdict == "still good" and not result.movement.named
    assert np.isnan(result.points_mm[:, :9]).all() and np.isfinite(result.board_pct.std)
    left[1, 9:] = np.nan
    left[1, 16:21] = fresh.left_px[1, 16:21]
    with pytest.raises(ValueError, match=r"too few corners are seen by both cameras, 5 in pair 02: at least 10"):
        check(paper, replace(fresh, board=board, left_px=left, right_px=right))


def test_pairs_that_do_not_belong_together_are_named(paper):
    fresh = corner_set(np.random.default_rng(7), pairs=4)
    right = fresh.right_px.copy()
    right[2] += np.linspace(0, 9, right[2].size).reshape(right[2].shape).astype(np.float32)
    result = check(paper, replace(fresh, right_px=right))
    assert list(result.pairs_refused) == ["pair 03"] and len(result.views) == 3
    assert result.verdict == "still good" and "left and right do not fit together" in result.findings[-1]
    shifted = replace(fresh, right_px=np.roll(fresh.right_px, 1, axis=0))
    with pytest.raises(ValueError, match="do not fit together"):
        check(paper, shifted.only([0]))


@pytest.mark.parametrize(
    ("spoil", "hint"),
    [
        (lambda v: replace(v, size=(1280, 720)), "are 1280x720, the calibration is for 640x480"),
        (lambda v: replace(v, right_px=v.left_px), "same pictures"),
        (lambda v: replace(v, left_px=v.right_px, right_px=v.left_px), "behind the cameras.*exchanged"),
    ],
)
def test_pictures_that_are_no_test_are_refused(paper, spoil, hint):
    with pytest.raises(ValueError, match=hint):
        check(paper, spoil(corner_set(np.random.default_rng(7), pairs=2)))


def test_a_poor_calibration_explains_its_errors():
    """Six pairs with a loose detector: fresh boards come out wrong, but nothing has moved."""
    rng = np.random.default_rng(21)
    rig = paper_rig()
    views = corner_set(rng, rig=rig, pairs=6, noise_px=0.5)
    fit = fit_rig(views, rig)
    result = check_calibration(fit.rig, corner_set(rng, pairs=5), record=CalibrationRecord.of(fit, views))
    assert not result.movement.named and not result.board_pct.sure
    assert "nothing has moved" in " ".join(result.findings)
    blind = check_calibration(fit.rig, corner_set(rng, pairs=5))
    assert blind.movement.named  # without what the calibration states of itself its errors would be movements


def test_deviations_of_the_size_are_those_of_repetition(paper):
    """The same boards seen through drawn rigs, with drawn noise, and no step along an axis."""
    rig, record, _ = paper
    rng = np.random.default_rng(12)
    poses = draw_poses(paper_rig(), 3, rng)
    left, right = project_boards(rig, poses)
    stated = check(paper, corner_set(rng, rig=rig, poses=poses)).board_pct.std
    from stereolib.calibration import board_size_error_pct, moved_rig

    sizes = []
    for step in rng.multivariate_normal(np.zeros(24), record.covariance, 150):
        pixels = [p + rng.normal(0, 0.034, p.shape) for p in (left, right)]
        drawn = moved_rig(rig, step)
        sizes.append(
            np.mean([board_size_error_pct(triangulate(drawn, a, b), BOARD)[1] for a, b in zip(*pixels, strict=True)])
        )
    assert stated == pytest.approx(np.std(sizes), rel=0.3)


def test_an_estimate_is_sure_beyond_four_deviations():
    assert Estimate(-0.5, 0.1).sure and not Estimate(0.3, 0.1).sure
