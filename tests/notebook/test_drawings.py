"""What the sliders say is what the library measures."""

from __future__ import annotations

from types import SimpleNamespace

import nbformat
import numpy as np
import pytest
from support.instruments import INSTRUMENT, RECT

from stereolib.base import ROOT
from stereolib.matching import (
    SMOOTHING_METHODS,
    SGBMParams,
    compute_disparity,
    compute_disparity_guided,
    expected_disparity,
    score,
    score_repair,
)
from stereolib.matching.filters import close
from stereolib.notebook import (
    cube_foot_mm,
    draw_dilation,
    draw_guided,
    draw_own_pair,
    draw_paths,
    draw_rectification,
    draw_sgbm,
    draw_sweep,
    draw_two_pictures,
    toe_in,
    who_saw,
)
from stereolib.paper import paper_rig
from stereolib.virtual import recordings


@pytest.mark.parametrize("condition", ["poor_light", "texture"])
def test_sliders_say_what_the_library_measures(condition: str) -> None:
    truth = recordings.load_truth(f"conditions/{condition}")
    cube = truth.visible & (truth.box == 1)
    pair = recordings.rectified().rectify(*recordings.load_pair(f"conditions/{condition}"))
    before = compute_disparity(*pair, SGBMParams(128, 5))
    quality = score(before, truth.disparity_px, cube)
    picture, text = draw_sgbm(condition, 128, 5, 10)
    assert picture.ndim == 3 and f"{quality.bad2_pct:.1f} %" in text
    picture, text = draw_dilation(condition, "closing", 9)
    done = score_repair(before, close(before, 9), truth.disparity_px, cube)
    assert picture.ndim == 3 and f"{done.shift_px:+.2f} px" in text
    with pytest.raises(ValueError, match="multiple of 16"):
        draw_sgbm(condition, 100, 5, 10)


@pytest.mark.parametrize(("baseline_mm", "f_px", "distance_mm"), [(93, 730, 700), (186, 365, 700), (93, 730, 1400)])
def test_first_slider_says_the_formula(baseline_mm: int, f_px: int, distance_mm: int) -> None:
    picture, text = draw_two_pictures(baseline_mm, f_px, distance_mm)
    assert picture.ndim == 3
    assert (
        f"near edge {f_px * baseline_mm / distance_mm:.1f} px, of the post {f_px * baseline_mm / 4000:.1f} px" in text
    )
    disparity_px = f_px * baseline_mm / distance_mm
    assert f"{distance_mm / (disparity_px + 1):.1f} mm nearer" in text


def test_an_edge_outside_a_picture_has_no_partner() -> None:
    assert "the near edge is outside the right picture: no partner" in draw_two_pictures(400, 1200, 400)[1]
    assert "no partner" not in draw_two_pictures(93, 730, 700)[1]


def test_nearest_that_is_matched_has_the_last_disparity_tried() -> None:
    pair = RECT.rectify(*recordings.load_pair("conditions/texture"))
    text = draw_own_pair(pair, INSTRUMENT, 128, 5, 10)[1]
    assert f"nothing nearer than {RECT.f_px * RECT.baseline_mm / 127:.0f} mm" in text


def test_cameras_turned_inwards_stay_where_they_are() -> None:
    straight = paper_rig()
    toed, T_toed_left = toe_in(straight, 8.0)
    np.testing.assert_allclose(-toed.R.T @ toed.T, T_toed_left[:3, :3] @ (-straight.R.T @ straight.T), atol=1e-9)
    between = np.degrees(np.arccos(toed.R[2, 2])) - np.degrees(np.arccos(straight.R[2, 2]))
    assert abs(between - 8.0) < 0.5 and T_toed_left[0, 2] < 0  # what was ahead now is on the left
    left, near, right = cube_foot_mm()
    np.testing.assert_allclose([np.linalg.norm(left - near), np.linalg.norm(right - near)], 300.0)


@pytest.mark.parametrize(
    ("roll_deg", "rows_px", "baseline_pct"), [(0.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.5, 0.0, 0.0), (0.0, 0.0, 5.0)]
)
def test_slider_of_a_wrong_calibration_says_what_it_does(roll_deg: float, rows_px: float, baseline_pct: float) -> None:
    text = draw_rectification(0.0, roll_deg, rows_px, baseline_pct)[1]
    words = "focal length ", "differ by ", "come out "
    focal, rows, depths = (float(text.partition(before)[2].split()[0]) for before in words)
    assert focal == pytest.approx(763.7, abs=1.0), "a camera that is turned about its axis stays where it is"
    rig = paper_rig()
    scale = 763.7 / rig.right.K[1, 1]  # rows of the rectified picture for one of the camera's
    rolled = np.radians(roll_deg) * 640 / np.sqrt(12)
    assert rows == pytest.approx(scale * rows_px + rolled, rel=0.1, abs=0.005)
    assert depths == pytest.approx(baseline_pct, abs=0.3)


def test_slider_of_the_laser_s_faults_says_what_turns_mend() -> None:
    def error_mm(turns: int, noise: float, bias_mm: float) -> float:
        return float(draw_sweep(turns, 0.45, 700, 45, noise, bias_mm)[1].rpartition("error ")[2].split()[0])

    assert error_mm(20, 4.0, 0.0) < 0.6 * error_mm(1, 4.0, 0.0)
    assert error_mm(20, 1.0, 15.0) == pytest.approx(15, abs=1.5) == error_mm(1, 1.0, 15.0)


def test_every_filter_can_be_chosen() -> None:
    needing = [method for method, need in SMOOTHING_METHODS.items() if need]
    for method in ["opening_closing", "speckle", *needing]:
        picture, text = draw_dilation("poor_light", method, 5)
        assert picture.ndim == 3 and "% of the cube" in text


def by_hand() -> dict:
    """The functions that notebook 03 defines."""
    found = {"np": np, "num_disparities": 16}
    for cell in nbformat.read(ROOT / "notebooks" / "03_sgbm_parameters.ipynb", as_version=4).cells:
        if cell.cell_type == "code" and cell.source.startswith("def "):
            exec(cell.source, found)
    return found


def test_what_notebook_03_writes_by_hand_matches() -> None:
    left = np.random.default_rng(0).integers(0, 256, (12, 60), np.uint8)
    right, hand = np.roll(left, -7, axis=1), by_hand()
    census = [hand["census"](side) for side in (left, right)]
    for cost in (
        hand["cost_volume"](left, right, hand["difference"]),
        hand["cost_volume"](*census, hand["answers_differ"]),
    ):
        assert (hand["four_paths"](cost, 8, 40).argmin(axis=-1)[:, 16:-10] == 7).all()
        np.testing.assert_array_equal(hand["path_sums"](cost, 0, 0).argmin(axis=-1), cost.argmin(axis=-1))


def test_path_is_the_cheapest_way() -> None:
    cost, (p1, p2) = np.random.default_rng(1).integers(0, 30, (1, 5, 4)), (3, 8)
    sums = by_hand()["path_sums"](cost, p1, p2)[0]
    price = np.array([[0, p1, p2, p2], [p1, 0, p1, p2], [p2, p1, 0, p1], [p2, p2, p1, 0]])
    whole = cost[0, 0].astype(int)
    for here in cost[0, 1:]:  # sums without what only keeps the numbers small
        whole = here + (whole[:, None] + np.minimum(price, p2)).min(axis=0)
    np.testing.assert_array_equal(sums[-1] - sums[-1].min(), whole - whole.min())


def test_slider_of_the_paths_says_what_they_find() -> None:
    truth = np.full((3, 40), 5.0)
    volume = np.ones((3, 40, 16))
    volume[..., 5] = 0
    volume[0, 16:, 9] = -1  # a third of it is wrong
    asked = []
    picture, text = draw_paths(lambda *prices: asked.append(prices) or volume, truth, 1, 20, 4, 20)
    assert picture.ndim == 3 and asked == [(4, 20)]
    assert text == "cheapest at 5 px, true 5.0 px; bad 2 in the strip: 33.3 %"


def test_slider_of_the_laser_says_what_the_library_measures() -> None:
    view, rectified = recordings.view("series/medium_700"), recordings.rectified()
    expected = expected_disparity(recordings.scan(view.name), rectified, recordings.setup(), (60.0, 0.0, 0.0))
    found = compute_disparity_guided(view.left, view.right, expected, margin_px=16)
    quality = score(found, view.truth_px, view.regions["cube"])
    picture, text = draw_guided(700, 16, 60)
    assert picture.shape == (480, 1280, 3)
    assert text == f"32 disparities searched; bad 2 on the cube: {quality.bad2_pct:.1f} %"


def test_who_saw_which_box_stars_what_the_map_leaves_out() -> None:
    def thing(height_mm: float) -> SimpleNamespace:
        return SimpleNamespace(size_mm=np.array([200.0, 100.0, height_mm]))

    stations = [SimpleNamespace(objects=[thing(50.0)]), SimpleNamespace(objects=[thing(np.nan), thing(30.0)])]
    names = {1: ["A"], 2: ["A", "B"]}
    objects = [SimpleNamespace(stations=(1,)), SimpleNamespace(stations=(2,))]
    room = SimpleNamespace(names=("A", "B"), stations=stations, objects=objects, names_of=names.__getitem__)
    assert who_saw(room).to_numpy().tolist() == [["pictures", "laser*"], ["-", "pictures"]]
