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
LIGHTS = ("darkest", "middle", "brightest")
NAMES = ("poor_light", "glare", "plain", *LIGHTS, "unchecked")


def with_holes(share: float, seed: int = 0) -> np.ndarray:
    """Single pixels missing here and there."""
    return np.where(np.random.default_rng(seed).random(TRUTH.shape) < share, np.nan, TRUTH)


def without_a_half() -> np.ndarray:
    """Everything beyond a column missing: more than a kernel reaches."""
    return np.where(np.arange(120) < 60, TRUTH, np.nan)


def test_dilation_removes_noise():
    scattered = {name: [with_holes(0.3)] for name in NAMES}
    whole_faces = {name: [without_a_half()] for name in NAMES}

    def left(before):
        after = {name: [dilate(d, 9) for d in some] for name, some in before.items()}
        return evidence.noise_left(before, after, TRUTH, OBJECT)

    assert_turns("claim.dilation_removes_noise", left(scattered), left(whole_faces))
    mixed = left(scattered | {"plain": [with_holes(0.3), without_a_half()]})
    assert verdict_of("claim.dilation_removes_noise", mixed) == "holds in part"


def mechanism(smooth, found: np.ndarray) -> dict[str, float]:
    """Bad pixels of a map, before and after a filter."""
    kinds, after = evidence.noise_kinds(found, TRUTH, OBJECT), smooth(found)
    return evidence.filled_out(
        {"texture": kinds} | dict.fromkeys(NAMES[:3], kinds), dict.fromkeys(NAMES[:3], after), TRUTH
    )


def test_dilation_mechanism():
    fills_all = mechanism(lambda d: median_filter(d, 9), with_holes(0.3))
    fills_none = mechanism(lambda d: d, with_holes(0.1) - 20.0)  # wrong everywhere, mostly smoothly so
    assert_turns("claim.dilation_mechanism", fills_all, fills_none)


def test_half_a_mechanism():
    kept = mechanism(lambda d: d, with_holes(0.3))
    assert verdict_of("claim.dilation_mechanism", kept) == "holds in part"


@pytest.mark.parametrize(("step", "right"), [(-10.0, 100), (np.nan, 100), (10.0, 0)])
def test_a_maximum_fills_dark_specks_and_holes_and_never_bright_ones(step, right):
    spoilt, where = evidence.plant_specks(TRUTH, OBJECT, step)
    assert 0 < where.sum() < OBJECT.sum() / 4
    assert evidence.right_pct(dilate(spoilt, 9), TRUTH, where) == right


def test_bad_pixels_are_sorted_by_what_is_around_them():
    spoilt = TRUTH.copy()
    spoilt[20, 20], spoilt[20, 40], spoilt[20, 60], spoilt[60:, 60:] = np.nan, 50, 120, TRUTH[60:, 60:] + 20
    kinds = evidence.noise_kinds(spoilt, TRUTH, OBJECT)
    assert [kinds[name][20, column] for name, column in (("hole", 20), ("below", 40), ("above", 60))] == [True] * 3
    assert kinds["alike"][75, 90] and not kinds["alike"][:50].any()
    assert sum(mask.astype(int) for mask in kinds.values()).max() == 1


def test_dilation_is_cheap():
    good, poor, bad = (dict.fromkeys(LIGHTS, score(with_holes(share), TRUTH, OBJECT)) for share in (0.02, 0.2, 0.4))
    mended, spoilt = evidence.behind_exposures(poor, good, good), evidence.behind_exposures(poor, bad, good)
    assert_turns("claim.dilation_is_cheap", mended, spoilt)
    mixed = evidence.behind_exposures(poor, good | {"darkest": bad["darkest"]}, good)
    assert verdict_of("claim.dilation_is_cheap", mixed) == "holds in part"


@pytest.mark.parametrize(("other", "verdict"), [("rect", "consistent"), ("cross", "paper contradicts itself")])
def test_the_union_of_translates_is_the_maximum_of_the_same_kernel(other, verdict):
    levels = np.random.default_rng(0).integers(0, 5, (12, 15)).astype(float)
    stacked = np.sum([dilate_set(levels >= level, 3) for level in range(1, 5)], axis=0)
    assert verdict_of("eq.dilation", evidence.pixels_unlike(stacked, dilate(levels, 3, shape=other))) == verdict
