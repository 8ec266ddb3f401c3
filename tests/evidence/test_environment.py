"""Verdicts of notebook 08 turn with the map, the boxes and what was measured of the cube."""

from __future__ import annotations

import numpy as np
import pytest
from support.measured import measured
from support.verdicts import assert_turns
from support.walks import SEEN, truth

from stereolib import evidence
from stereolib.paper import height_by_maximum, printed_value
from stereolib.virtual import recordings

SIZES, PLACES = (np.array([truth(k)[i] for k in range(5)]) for i in (0, 1))
TOLERANCE_CM = [evidence.half_beam_step_cm(700, 300)] * 2 + [4 * 0.116]


def test_map_and_volumes():
    rng = np.random.default_rng(1)
    places, sizes = PLACES + rng.normal(0, 3, PLACES.shape), SIZES + rng.normal(0, 0.2, SIZES.shape)
    astray = (places[:4] + 80, sizes[:4] + np.array([0, 0, 30]))
    assert len(SEEN) == len(SIZES)
    assert_turns(
        "future.map_3d",
        evidence.map_of_boxes(places, sizes, PLACES, SIZES),
        evidence.map_of_boxes(*astray, PLACES, SIZES),
    )
    assert_turns(
        "future.volume_surface",
        evidence.volume_and_surface(sizes, SIZES),
        evidence.volume_and_surface(1.02 * sizes, SIZES),
    )


def test_a_box_of_which_a_size_is_unknown_is_not_counted():
    sizes = SIZES.copy()
    sizes[2, 0] = np.nan
    assert evidence.map_of_boxes(PLACES, sizes, PLACES, SIZES)["boxes"] == 4
    assert evidence.map_of_boxes(PLACES, np.full((5, 3), np.nan), PLACES, SIZES)["boxes"] == 0


def test_two_looks_at_one_box_are_one_box():
    places, sizes = np.vstack([PLACES[:2], PLACES[:1] + 5]), np.vstack([SIZES[:2], SIZES[:1]])
    assert evidence.map_of_boxes(places, sizes, PLACES, SIZES)["boxes"] == 2


@pytest.mark.parametrize("stated", [0.5, 1.0, 2.0])
def test_scores_of_errors(stated):
    errors = np.random.default_rng(2).normal(0, 1, 20000)
    assert evidence.rms_of_scores(errors, np.full(20000, stated)) == pytest.approx(1 / stated, rel=0.02)


def recipe_on(rows: int):
    """The recipe on a map with a near edge of so many rows, above its 53 rows of floor."""
    disparity = np.full((480, 640), 60.0)
    disparity[427 - rows : 427, 320] = 104.0
    return height_by_maximum(disparity, printed_value("scale.cm_per_px"), 53)


def test_sizes_of_the_cube_as_the_paper_meant_them():
    """Right if the edge had as many rows as the scale wants for 30 cm; it has more (the brick is wrong as well)."""
    cube, brick = (evidence.footprint_cm(recordings.scan(n)) for n in ("conditions/texture", "room/2"))
    good, bad = evidence.sizes_by_the_paper(cube, recipe_on(259)), evidence.sizes_by_the_paper(brick, recipe_on(325))
    assert_turns("title.recipe", good, bad, tolerances={"title.recipe": TOLERANCE_CM})


def test_sizes_of_the_cube_by_both_sensors():
    """A plain cube shows the pair nothing: its height is refused."""
    textured, plain = (evidence.sizes_of_nearest(measured(f"conditions/{n}").objects) for n in ("texture", "plain"))
    assert_turns("title.fused", textured, plain, tolerances={"title.fused": TOLERANCE_CM})
    assert np.isnan(evidence.sizes_of_nearest(())).all()
