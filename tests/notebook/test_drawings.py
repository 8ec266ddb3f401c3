"""What the sliders say is what the library measures."""

from __future__ import annotations

import pytest

from stereolib.matching import SMOOTHING_METHODS, SGBMParams, compute_disparity, score, score_repair
from stereolib.matching.filters import close
from stereolib.notebook import draw_dilation, draw_sgbm, draw_two_pictures
from stereolib.virtual import recordings


@pytest.mark.parametrize("condition", ["poor_light", "texture"])
def test_sliders_say_what_the_library_measures(condition: str) -> None:
    truth = recordings.load_truth(f"conditions/{condition}")
    cube = truth.visible & (truth.box == 1)
    pair = recordings.rectified().rectify(*recordings.load_pair(f"conditions/{condition}"))
    before = compute_disparity(*pair, SGBMParams(128, 5))
    quality = score(before, truth.disparity_px, cube)
    picture, text = draw_sgbm(condition, 128, 5, 10)
    assert picture.shape == (480, 1280, 3) and f"{quality.bad2_pct:.1f} %" in text
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


def test_every_filter_can_be_chosen() -> None:
    needing = [method for method, need in SMOOTHING_METHODS.items() if need]
    for method in ["opening_closing", "speckle", *needing]:
        picture, text = draw_dilation("poor_light", method, 5)
        assert picture.ndim == 3 and "% of the cube" in text
