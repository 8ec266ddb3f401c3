"""Rows that disagree: found as they were moved, with honest deviations; where little tells of them, not claimed."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from support.pairs import rectified_cube

from stereolib.base import clustered_covariance
from stereolib.matching import RowOffset, SGBMParams, compute_disparity, find_rows
from stereolib.matching.rows import _Cells, measure_rows
from stereolib.virtual import recordings

MOVES = [(0.0, 0.0), (0.8, 0.0), (-2.5, 0.0), (0.0, 0.3), (1.2, -0.5), (3.5, 0.5), (-5.0, 0.0)]
ROOM_RAD = np.radians(0.015)  # OpenCV looks up on a grid of 1/32 px, of the half size: a step along the picture


def moved(picture, offset_px, roll_deg):
    """What a right camera shows that was shifted, and turned about its middle."""
    height, width = picture.shape[:2]
    warp = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), -roll_deg, 1)
    warp[1, 2] += offset_px
    return cv2.warpAffine(picture, warp, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


def drawn(seed, offset_px, roll_rad):
    """A slanted textured plane: 240 x 320, the rows of right moved, and noise in both."""
    rng, (height, width) = np.random.default_rng(seed), (240, 320)
    texture = cv2.GaussianBlur(rng.normal(0, 1, (300, 480)).astype(np.float32), (0, 0), 1.2)
    texture = 110 + 40 * texture / texture.std()
    u, v = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    row = v - offset_px - np.tan(roll_rad) * (u - (width - 1) / 2)
    column = (u + 30 + 0.01 * row - 0.02 * width / 2) / 0.98
    maps = (column + 80).astype(np.float32), (row + 30).astype(np.float32)
    pair = texture[30 : 30 + height, 80 : 80 + width], cv2.remap(texture, *maps, cv2.INTER_CUBIC)
    return [np.clip(p + rng.normal(0, 3, p.shape), 0, 255).astype(np.uint8) for p in pair]


@pytest.mark.parametrize(("offset_px", "roll_deg"), MOVES)
def test_a_recorded_pair_s_rows_are_found_as_they_were_moved(offset_px, roll_deg):
    left, right = rectified_cube()
    found, _ = find_rows(left, moved(right, offset_px, roll_deg))
    assert abs(found.offset_px - offset_px) < 3 * found.std_px < 0.06
    assert abs(found.roll_rad - np.radians(roll_deg)) < ROOM_RAD
    told = f"{abs(offset_px):.1f} px too {'low' if offset_px > 0 else 'high'}"
    said = " ".join(found.warnings)
    assert (told in said) == (abs(offset_px) > 0.3) and ("px too" in said) == (abs(offset_px) > 0.3)
    assert (f"turned by {abs(roll_deg):.1f} degrees" in said) == (abs(roll_deg) > 0.1)
    assert "larger" not in said and "smaller" not in said


@pytest.mark.parametrize("offset_px", [8, -8, 10, -10, 12])
def test_rows_of_which_the_quarter_size_tells_a_part_are_found(offset_px):
    left, right = rectified_cube()
    found, _ = find_rows(left, moved(right, offset_px, 0.0))
    assert abs(found.offset_px - offset_px) < 5 * found.std_px < 0.15


@pytest.mark.parametrize("offset_px", [-16, 16, 25, 40])
def test_rows_beyond_what_is_found_are_not_known(offset_px):
    """Chance matches alone had told +1.2 ± 0.4 px of rows that were off by 25 px."""
    left, right = rectified_cube()
    found, _ = find_rows(left, moved(right, offset_px, 0.0))
    assert not found.is_known and found.offset_px == 0 and found.std_px > 3


@pytest.mark.parametrize("name", ["conditions/poor_light", "conditions/plain", "room/1", "room/3", "series/fine_500"])
def test_exchanged_or_far_off_rows_are_known_of_no_recorded_pair(name):
    left, right = recordings.rectified().rectify(*recordings.load_pair(name))
    assert find_rows(left, right)[0].is_known
    for pair in ((right, left), (left, moved(right, 25, 0.0))):
        assert not find_rows(*pair)[0].is_known


@pytest.mark.parametrize("share", [0.005, -0.005, 0.02])
def test_a_lens_with_another_focus_is_told_and_evened_out(share):
    left, right = rectified_cube()
    height, width = right.shape[:2]
    M = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), 0.0, 1 + share)
    found, _ = find_rows(left, cv2.warpAffine(right, M, (width, height), borderMode=cv2.BORDER_REPLICATE))
    assert found.zoom == pytest.approx(share, abs=0.0005)
    how = "larger" if share > 0 else "smaller"
    (said,) = found.warnings
    assert f"right is {100 * abs(share):.1f} % {how} than left" in said and "focus" in said
    (along_u, _, _), (_, along_v, _) = found.warp
    assert along_u == pytest.approx(1 + share, abs=0.0005) and along_v == pytest.approx(1 + share, abs=0.0005)
    assert find_rows(left, right)[0].warnings == () and abs(find_rows(left, right)[0].warp[0, 0] - 1) < 2e-5


def test_deviations_hold_over_many_pairs():
    """Neither too small nor too large by a third: the root mean square of errors in deviations, of 60 pairs."""
    rng, z, rolls = np.random.default_rng(1), [], []
    for seed in range(60):
        offset_px, roll_rad = rng.uniform(-2, 2), np.radians(rng.uniform(-0.5, 0.5))
        found, _ = find_rows(*drawn(seed, offset_px, roll_rad))
        z.append((found.offset_px - offset_px) / found.std_px)
        rolls.append(found.roll_rad - roll_rad)
    assert 0.75 < np.sqrt(np.mean(np.square(z))) < 1.3 and np.abs(z).max() < 4
    assert np.sqrt(np.mean(np.square(rolls))) < ROOM_RAD


def test_correcting_brings_the_disparities_back():
    left, right = rectified_cube()
    truth = recordings.load_truth("conditions/texture").disparity_px
    tilted = moved(right, 1.5, -0.4)
    found, _ = find_rows(left, tilted)

    def off_by_a_pixel(picture):
        return (np.abs(compute_disparity(left, picture, SGBMParams(176)) - truth) > 1)[np.isfinite(truth)].mean()

    as_it_was, disturbed, corrected = map(off_by_a_pixel, (right, tilted, found.correct(tilted)))
    assert disturbed > as_it_was + 0.1 and corrected < as_it_was + 0.02
    again, _ = find_rows(left, found.correct(tilted))
    assert abs(again.offset_px) < 3 * again.std_px and abs(again.roll_rad) < ROOM_RAD and again.warnings == ()


def test_what_turns_about_another_point_than_the_middle_leaves_a_shift_of_the_columns():
    """A roll and a zoom about a lens's axis: the shift that is left lies within its deviation; none without them."""
    left, right = rectified_cube()
    height, width = right.shape[:2]
    axis = (width - 1) / 2 - 10.0, (height - 1) / 2 + 12.0
    for roll_deg, share in ((1.0, 0.0), (0.0, 0.02)):
        M = cv2.getRotationMatrix2D(axis, -roll_deg, 1 + share)
        found, _ = find_rows(left, cv2.warpAffine(right, M, (width, height), borderMode=cv2.BORDER_REPLICATE))
        there = found.warp @ [*found.centre, 1.0] - M @ [
            *found.centre,
            1.0,
        ]  # of the middle, as sought
        assert 0.1 < abs(there[0]) < 2 * found.columns_std_px < 1 and abs(there[1]) < 0.1
    assert find_rows(left, right)[0].columns_std_px < 0.002


def test_a_roll_that_may_be_chance_moves_no_column():
    """One of three deviations counts by half; the rows follow the slope in any case. So does a zoom."""
    for stds, share in ((0.1, 0.0), (3.0, 0.5), (100.0, 1.0)):
        slope = 0.004
        rows = RowOffset(np.array([slope, 0.001, 0.2]), np.diag([slope / stds, 1.0, 1.0]) ** 2, (319.5, 239.5))
        (along_u, shear, back), along_v = rows.warp
        assert shear == pytest.approx(-share * slope, abs=0.002 * slope)
        assert along_u == pytest.approx(np.sqrt(1 - shear**2), abs=1e-8)  # as long as it was
        assert (along_u - 1) * 319.5 + shear * 239.5 + back == pytest.approx(0)  # about the middle
        np.testing.assert_allclose(along_v, [slope, 1.001, 0.2])


def test_the_same_offset_in_a_picture_of_twice_the_size():
    small = RowOffset(np.array([0.004, -0.002, 0.3]), np.diag([1e-4, 2e-4, 0.05]) ** 2, (159.5, 119.5))
    large = small.doubled()
    assert large.centre == (319.5, 239.5)
    assert large.offset_px == pytest.approx(2 * small.offset_px) and large.std_px == pytest.approx(2 * small.std_px)
    for u, v in ((10.0, 20.0), (150.0, 200.0)):  # of the small picture
        moves = rows_off(small, u, v), rows_off(large, 2 * u + 0.5, 2 * v + 0.5)
        assert moves[1] == pytest.approx(2 * moves[0])


def rows_off(rows, u, v):
    return rows.coefficients @ [u, v, 1.0]


def test_corrected_twice_is_corrected_once_by_both():
    centre, certain = (159.5, 119.5), np.diag([1e-9, 1e-9, 0.01]) ** 2
    first = RowOffset(np.array([0.003, 0.001, 0.7]), certain, centre)
    second = RowOffset(np.array([-0.001, 0.0, 0.2]), certain, centre)
    both = second.after(first)
    u, v = 50.0, 80.0
    once = second.warp @ [u, v, 1.0]
    twice = first.warp @ [*once, 1.0]
    assert v + rows_off(both, u, v) == pytest.approx(twice[1])
    grid = 2 * (1 / 32) ** 2 / 12  # either correction rounds where it looks the picture up
    assert both.std_px**2 == pytest.approx(second.std_px**2 + grid)


def test_errors_that_neighbours_share_count_as_one():
    """Four cells each way err together: as many rows as independent cells would be four times too sure of."""
    left, right = drawn(0, 0.0, 0.0)
    cells = _Cells.of(left, right, compute_disparity(left, right, SGBMParams(64)))
    across, down = cells.some % cells.shape[0], cells.some // cells.shape[0]
    blocks = across // 4 + 100 * (down // 4)
    rest = np.random.default_rng(3).normal(0, 0.1, 1000)[blocks]
    found = cells.covariance(rest, np.zeros(len(rest)))
    np.testing.assert_allclose(found, clustered_covariance(cells.at, rest, cells.weight**0.5, blocks), rtol=1e-9)
    alone = clustered_covariance(cells.at, rest, cells.weight**0.5, np.arange(len(rest)))
    assert found[2, 2] > 4 * alone[2, 2]


def noise(seed):
    return list(np.random.default_rng(seed).integers(0, 256, (2, 240, 320), np.uint8))


def stripes():
    """Nothing along the columns by which a row is known."""
    light = np.random.default_rng(0).integers(0, 256, (1, 400), np.uint8).repeat(240, axis=0)
    light = cv2.GaussianBlur(light, (0, 0), 1.5)
    return light[:, :320].copy(), light[:, 20:340].copy()


def few_points():
    """Texture in a corner alone."""
    pair = drawn(0, 1.0, 0.0)
    for picture in pair:
        picture[40:] = 120
        picture[:, 40:] = 120
    return pair


@pytest.mark.parametrize(
    "pair",
    [
        noise(0),
        noise(1),
        stripes(),
        few_points(),
        [np.full((240, 320), 120, np.uint8)],
        [noise(2)[0][:90, :90]],
    ],
    ids=["noise", "more noise", "stripes", "few points", "plain", "a small picture"],
)
def test_where_nothing_tells_no_offset_is_claimed(pair):
    rows, _ = find_rows(pair[0], pair[-1])
    assert rows.offset_px == 0 and rows.roll_rad == 0 and rows.std_px >= 3 and rows.warnings == ()
    np.testing.assert_array_equal(rows.correct(pair[-1]), pair[-1])


def test_cells_below_the_least_number_tell_nothing():
    left, right = drawn(0, 1.0, 0.0)
    disparity = compute_disparity(left, right, SGBMParams(64))
    some = np.full_like(disparity, np.nan)
    some[60:96, 120:168] = disparity[60:96, 120:168]  # three rows of four cells
    found = measure_rows(left, right, some)
    assert found.std_px < 1 and found.offset_px == pytest.approx(1, abs=0.5)
    some[60:72, 120:132] = np.nan
    assert measure_rows(left, right, some).std_px >= 3


def test_exchanged_sides_are_no_moved_rows():
    left, right = rectified_cube()
    rows, _ = find_rows(right, left)
    assert rows.warnings == () and not rows.is_known


@pytest.mark.parametrize("period_px", [8, 12, 16, 24, 40])
@pytest.mark.parametrize("offset_px", [0, 1, 3])
def test_of_a_repetitive_texture_no_more_is_said_than_it_shows(period_px, offset_px):
    """It looks the same half a period lower: an offset is told up to that, or not."""
    v, u = np.mgrid[:480, :670] * (2 * np.pi / period_px)
    light = 127 + 60 * np.sin(u) * np.sin(v)
    rng = np.random.default_rng(period_px)
    pair = light[:, :640], np.roll(light, offset_px, axis=0)[:, 30:]
    rows, _ = find_rows(*(np.clip(p + rng.normal(0, 2, p.shape), 0, 255).astype(np.uint8) for p in pair))
    half = period_px / 2
    off = (rows.offset_px - offset_px + half / 2) % half - half / 2
    assert abs(off) < 0.15 or rows.warnings == ()
    assert abs(off) < 0.05 or period_px < 24


def test_one_textured_place_tells_no_rows():
    """The jackknife cannot leave out the only block of cells: rows are unknown, not a singular matrix."""
    left = np.full((120, 160), 90, np.uint8)
    left[:46, :47] = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 255, (46, 47), np.uint8), (0, 0), 1)
    found = measure_rows(left, left, np.zeros(left.shape, np.float32))
    assert found.offset_px == 0 and found.std_px >= 3
