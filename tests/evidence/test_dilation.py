"""Verdicts of notebook 04 turn with the maps."""

from __future__ import annotations

import numpy as np
import pytest
from support.verdicts import assert_turns, verdict_of

from stereolib import evidence
from stereolib.matching import dilate, dilate_set, median_filter, score

TRUTH = np.broadcast_to(80 + np.arange(120) / 20, (90, 120))  # a slanted face
OBJECT = np.zeros(TRUTH.shape, bool)
OBJECT[5:85, 5:115] = True
NAMES = ("poor_light", "glare", "plain")
KERNELS = (3, 9)


def with_holes(share: float, seed: int = 0) -> np.ndarray:
    """Single pixels missing here and there."""
    return np.where(np.random.default_rng(seed).random(TRUTH.shape) < share, np.nan, TRUTH)


def without_a_half() -> np.ndarray:
    """Everything beyond a column missing: more than a kernel reaches."""
    return np.where(np.arange(120) < 60, TRUTH, np.nan)


def test_dilation_removes_noise():
    scattered = {name: with_holes(0.3) for name in NAMES}
    whole_faces = dict.fromkeys(NAMES, without_a_half())

    def left(before):
        after = {name: [dilate(d, size) for size in KERNELS] for name, d in before.items()}
        return evidence.noise_left(before, after, TRUTH, OBJECT)

    assert_turns("claim.dilation_removes_noise", left(scattered), left(whole_faces))
    mixed = left(scattered | {"plain": without_a_half()})
    assert verdict_of("claim.dilation_removes_noise", mixed) == "holds in part"


def mechanism(smooth, found: np.ndarray) -> dict[str, float]:
    """Specks planted on the face and bad pixels of a map, before and after a filter."""
    specks = {"dark": -10.0, "bright": 10.0, "hole": np.nan}
    planted = {}
    for name, step in specks.items():
        spoilt, where = evidence.plant_specks(TRUTH, OBJECT, step)
        assert 0 < where.sum() < OBJECT.sum() / 4
        planted[name] = smooth(spoilt), where
    kinds = evidence.noise_kinds(found, TRUTH, OBJECT)
    return evidence.filled_out(planted, [kinds], [smooth(found)], TRUTH)


def test_dilation_mechanism():
    fills_all = mechanism(lambda d: median_filter(d, 9), with_holes(0.3))
    fills_none = mechanism(lambda d: d, with_holes(0.1) - 20.0)  # wrong everywhere, mostly smoothly so
    assert_turns("claim.dilation_mechanism", fills_all, fills_none)


def test_a_maximum_fills_dark_specks_and_holes_and_never_bright_ones():
    found = mechanism(lambda d: dilate(d, 9), with_holes(0.3))
    assert found["dark_pct"] == found["hole_pct"] == 100
    assert found["bright_pct"] == 0
    assert verdict_of("claim.dilation_mechanism", found) == "holds in part"


def test_bad_pixels_are_sorted_by_what_is_around_them():
    spoilt = TRUTH.copy()
    spoilt[20, 20], spoilt[20, 40], spoilt[20, 60], spoilt[60:, 60:] = np.nan, 50, 120, TRUTH[60:, 60:] + 20
    kinds = evidence.noise_kinds(spoilt, TRUTH, OBJECT)
    assert [kinds[name][20, column] for name, column in (("hole", 20), ("below", 40), ("above", 60))] == [True] * 3
    assert kinds["alike"][75, 90] and not kinds["alike"][:50].any()
    assert sum(mask.astype(int) for mask in kinds.values()).max() == 1


def test_dilation_is_cheap():
    good, bad = score(with_holes(0.02), TRUTH, OBJECT), score(with_holes(0.4), TRUTH, OBJECT)
    assert_turns(
        "claim.dilation_is_cheap",
        evidence.cost_and_replacement(0.001, 0.06, good, good),
        evidence.cost_and_replacement(0.09, 0.06, bad, good),
    )
    assert evidence.cost_and_replacement(0.004, 0.06, bad, good)["share"] == 0.1


@pytest.mark.parametrize(("other", "verdict"), [("rect", "consistent"), ("cross", "paper contradicts itself")])
def test_the_union_of_translates_is_the_maximum_of_the_same_kernel(other, verdict):
    levels = np.random.default_rng(0).integers(0, 5, (12, 15)).astype(float)
    stacked = np.sum([dilate_set(levels >= level, 3) for level in range(1, 5)], axis=0)
    assert verdict_of("eq.dilation", evidence.pixels_unlike(stacked, dilate(levels, 3, shape=other))) == verdict
