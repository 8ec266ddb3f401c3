"""Verdicts of notebook 03 turn with the maps."""

from __future__ import annotations

import numpy as np
import pytest
from support.verdicts import assert_turns, verdict_of

from stereolib import evidence
from stereolib.matching import KnownView, score, smallest_window
from stereolib.paper import paper_rig, printed_value

TRUTH = np.full((20, 50), 60.0)


def spoilt(share: float) -> np.ndarray:
    """The truth with a share of its rows off by ten pixels."""
    disparity = TRUTH.copy()
    disparity[: round(share * len(disparity))] += 10
    return disparity


def scored(share: float):
    return score(spoilt(share), TRUTH)


GOOD, BAD = scored(0.1), scored(0.5)


def windows(shifts: list[int]) -> list[int]:
    """The smallest window that works for textures at these disparities."""
    texture = np.random.default_rng(0).integers(0, 256, (30, 260), np.uint8)
    everywhere, found = np.ones(texture.shape, bool), []
    everywhere[:, :100] = False
    for shift in shifts:
        truth = np.full(texture.shape, float(shift))
        found.append(smallest_window(texture, np.roll(texture, -shift, axis=1), truth, everywhere))
    return found


def test_disparities_fall_with_distance():
    distances = [500, 600, 700, 800, 900, 1000]
    nearer_is_more = evidence.disparities_fall(distances, windows([90, 75, 64, 56, 50, 45]))
    everywhere_alike = evidence.disparities_fall(distances, windows([40] * 6))
    assert verdict_of("claim.disparities_fall_with_distance", nearer_is_more) == "follows"
    assert verdict_of("claim.disparities_fall_with_distance", everywhere_alike) == "does not follow"
    assert nearer_is_more["falls_px"] == 48  # from 96 to 48
    up_and_down = evidence.disparities_fall(distances, windows([90, 40, 90, 40, 90, 40]))
    assert verdict_of("claim.disparities_fall_with_distance", up_and_down) == "follows in part"


def test_the_trend_does_not_hang_on_the_order_of_the_distances():
    there = evidence.disparities_fall([500, 700, 1000], [160, 112, 112])
    assert there == pytest.approx(evidence.disparities_fall([1000, 500, 700], [112, 160, 112]))
    assert there["rank"] == pytest.approx(-np.sqrt(3) / 2)


def cube_view() -> KnownView:
    """Faces that recede by 30 px of disparity to either side of an edge at column 25."""
    columns = np.abs(np.arange(50) - 25)
    truth = np.broadcast_to(100 - 30 * columns / 25, (20, 50))
    cube, edge = np.ones(truth.shape, bool), np.broadcast_to(columns < 3, truth.shape)
    grey = np.zeros(truth.shape, np.uint8)
    return KnownView("cube", grey, grey, truth, cube, {"cube": cube, "edge": edge})


def test_relative_depth():
    view = cube_view()
    truth = view.truth_px
    laser = np.where(view.regions["edge"], truth, np.nan)  # it knows the edge alone
    steeper = 100 + 1.5 * (truth - 100)
    shifted, bent = (evidence.relative_depth(view, d, laser) for d in (truth + 2, steeper))
    assert verdict_of("claim.relative_depth_suffices", shifted) == "follows"
    assert verdict_of("claim.relative_depth_suffices", bent) == "does not follow"


def test_relative_depth_needs_a_laser_that_is_right():
    view = cube_view()
    found = evidence.relative_depth(view, view.truth_px + 2, view.truth_px + 5)
    assert verdict_of("claim.relative_depth_suffices", found) == "does not follow"


def test_the_laser_sets_the_window():
    view = cube_view()
    missing = np.where(np.arange(50) < 10, np.nan, view.truth_px)
    views, wide = [view, view], [view.truth_px, view.truth_px]
    assert_turns(
        "claim.laser_sets_window",
        evidence.cut_window(views, wide, wide),
        evidence.cut_window(views, wide, [view.truth_px, missing]),  # at one distance
    )


def bad_with(blocks: dict[int, float]) -> list[float]:
    return [scored(share).bad2_pct for share in blocks.values()]


def test_block_size_follows_texture():
    fine, coarse = bad_with({3: 0.0, 9: 0.05, 15: 0.4}), bad_with({3: 0.6, 9: 0.3, 15: 0.05})
    apart, alike = {"fine": fine, "coarse": coarse}, {"fine": fine, "coarse": fine}
    assert_turns(
        "claim.block_size_follows_texture",
        evidence.block_choice(apart, apart),
        evidence.block_choice(alike, alike),
    )
    assert evidence.block_choice(apart, alike) == pytest.approx({"good_light_points": 55, "dim_light_points": 0})


def test_glare_on_the_object():
    assert_turns("claim.glare_on_object", evidence.points_lost(GOOD, BAD), evidence.points_lost(GOOD, GOOD))


def test_glare_on_the_ground():
    assert_turns("claim.glare_on_ground", evidence.points_lost(GOOD, BAD), evidence.points_lost(BAD, GOOD))


def test_one_colour():
    assert_turns(
        "claim.unicolour_is_hard",
        evidence.one_colour({0.0: BAD, 0.05: scored(0.3), 0.45: GOOD}),
        evidence.one_colour({0.0: scored(0.15), 0.05: GOOD, 0.45: GOOD}),
    )


def test_matt_texture():
    assert_turns(
        "claim.matt_texture_recommended",
        evidence.surfaces_gain([scored(0.05), BAD, scored(0.2)], [GOOD, BAD]),
        evidence.surfaces_gain([GOOD, GOOD, BAD], [scored(0.2), GOOD]),
    )


def test_figure_4():
    best = {"texture": GOOD, "plain": BAD, "poor_light": BAD, "glare": GOOD}
    assert_turns("fig.4", evidence.factors_of_fig4(best), evidence.factors_of_fig4(dict.fromkeys(best, GOOD)))


def test_captions_are_read_from_what_is_printed():
    printed = printed_value("misprint.fig4_captions")
    id, found = "misprint.fig4_captions", evidence.captions_of_fig4(printed)
    assert found == {"labels": 3, "contents": 3}
    assert verdict_of(id, found) == "paper contradicts itself"
    mended = printed.replace("4(c) no texture", "4(c) glare").replace("4(c) texture", "4(d) texture")
    assert verdict_of(id, evidence.captions_of_fig4(mended)) == "consistent"


def cube_at(distance_mm: float, right_of: int, noise_mm: float = 0.0) -> float:
    """Share of a flat object that is right, matched from a column on, with a wave of so many mm."""
    rectified = paper_rig().rectify()
    depth = np.full((60, 80), distance_mm)
    wave = noise_mm * np.sin(np.arange(60))[:, None]
    disparity = np.where(np.arange(80) < right_of, np.nan, rectified.f_px * rectified.baseline_mm / (depth + wave))
    on_object = np.zeros(depth.shape, bool)
    on_object[10:50, 20:60] = True
    return evidence.share_within_cm(disparity, depth, on_object, rectified)


def behind(shares_pct: dict[int, float]) -> dict[str, float]:
    """What is judged of it."""
    return {"behind_points": evidence.recommended_distance(shares_pct)["behind_points"]}


def test_recommended_distance():
    best_there = {50: cube_at(500, 40), 75: cube_at(750, 0), 100: cube_at(1000, 0, 30)}
    assert_turns(
        "setup.recommended_distance",
        behind(best_there),
        behind({50: cube_at(500, 0), 75: cube_at(750, 40), 100: cube_at(1000, 0)}),
    )
    assert best_there[50] == 50 and best_there[75] == 100


def test_an_object_that_the_picture_cuts_has_no_share():
    disparity, on_object = np.full((6, 8), 100.0), np.ones((6, 8), bool)
    share = evidence.share_within_cm(disparity, disparity, on_object, paper_rig().rectify())
    assert np.isnan(share)
    assert evidence.recommended_distance({50: 80.0, 75: 99.0, 100: share})["farther_points"] == 99


def test_distance_over_scale():
    def shares(nearest_mm: int) -> dict[float, float]:
        return {mm / 10: cube_at(mm, 0 if mm >= nearest_mm else 30) for mm in (500, 600, 700, 800)}

    larger_farther = evidence.distance_over_scale({20: shares(500), 40: shares(700)})
    alike = evidence.distance_over_scale({20: shares(600), 40: shares(600)})
    assert verdict_of("claim.distance_depends_on_scale", larger_farther) == "follows"
    assert verdict_of("claim.distance_depends_on_scale", alike) == "does not follow"
    nowhere = evidence.distance_over_scale({20: shares(600), 40: shares(9000)})
    assert verdict_of("claim.distance_depends_on_scale", nowhere) == "does not follow"
