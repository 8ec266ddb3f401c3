"""Verdicts of notebook 03 turn with the maps."""

from __future__ import annotations

import numpy as np
from support.verdicts import assert_turns

from stereolib import evidence
from stereolib.matching import score

TRUTH = np.full((20, 50), 60.0)


def spoilt(share: float) -> np.ndarray:
    """The truth with a share of its rows off by ten pixels."""
    disparity = TRUTH.copy()
    disparity[: round(share * len(disparity))] += 10
    return disparity


def test_glare_on_the_object():
    matt, glossy = score(spoilt(0.1), TRUTH), score(spoilt(0.5), TRUTH)
    assert_turns("claim.glare_on_object", evidence.glare_times(matt, glossy), evidence.glare_times(matt, matt))
    assert_turns("claim.glare_on_ground", evidence.glare_times(matt, glossy), evidence.glare_times(glossy, matt))
