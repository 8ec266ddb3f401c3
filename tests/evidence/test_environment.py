"""Verdicts of notebook 08 turn with the map, the boxes and what was measured of the cube."""

from __future__ import annotations

import numpy as np
import pytest
from support.measured import measured, the_cube
from support.verdicts import assert_turns
from support.walks import SEEN, truth

from stereolib import evidence, laser
from stereolib.paper import paper_setup, setup_family, solve_pitch
from stereolib.virtual import VirtualLidar, cube_scene, recordings, walk

SIZES, PLACES = (np.array([truth(k)[i] for k in range(5)]) for i in (0, 1))
OUTLINES = np.array([walk.outline_mm(box) for box in walk.objects()])
CUBE = walk.outline_mm(cube_scene().boxes[-1])


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


def recipe_cm(view) -> float:
    """The recipe on a map of a near edge alone, as a camera sees it."""
    disparity = np.full((480, 640), 60.0)
    disparity[evidence.edge_mask(view, disparity.shape)] = 104.0
    return evidence.whole_edge_reading_cm(disparity, view)


def test_sizes_of_the_cube_as_the_paper_meant_them():
    """Right if the camera stood where the scale wants 30 cm of rows, and the beams ended where the faces do."""
    rectified, setup = recordings.rectified(), paper_setup()
    here, high = solve_pitch(rectified, setup), setup_family(rectified, setup, [525.0])[0]
    pose = (0.0, 0.0, float(np.radians(0.5)))
    data = VirtualLidar().scan(cube_scene(), pose, np.random.default_rng(3), turns=5)
    turned = laser.average(laser.turns(laser.decode(data)))
    seen = ((high, recordings.scan("conditions/texture")), (here, turned))
    good, bad = (np.append(evidence.footprint_cm(scan), recipe_cm(view)) for view, scan in seen)
    assert_turns("title.recipe", good, bad)


def test_sizes_of_the_cube_by_both_sensors():
    """A plain cube shows the pair nothing: its height is refused."""
    textured, plain = (evidence.sizes_of_nearest(measured(f"conditions/{n}").objects) for n in ("texture", "plain"))
    assert_turns("title.fused", textured, plain)
    assert np.isnan(evidence.sizes_of_nearest(())).all()
    with pytest.raises(ValueError, match="no object"):
        evidence.nearest_object(())


def test_distances():
    """From the true places to a map 2 mm off, and from places that are 2 cm off."""
    places = np.array([pose[:2] for pose in walk.POSES.values()])
    true, true_cube = evidence.distances_to_boxes(places, OUTLINES), evidence.distances_to_boxes([[0, 0]], [CUBE])
    found = measured("conditions/texture").objects
    assert evidence.nearest_object(found) is the_cube(measured("conditions/texture"))
    cube = evidence.distances_to_boxes([[0, 0]], [evidence.nearest_object(found).outline_mm])
    wrong = evidence.distances_to_boxes(np.add(places, [20, 0]), OUTLINES)
    assert true.shape == (5, 5) and true_cube.item() == pytest.approx(700)
    assert_turns(
        "claim.distance_to_object",
        evidence.distance_errors(cube, true_cube, evidence.distances_to_boxes(places, OUTLINES + 2), true),
        evidence.distance_errors(cube + 10, true_cube, wrong, true),
    )


def test_a_distance_is_that_to_the_nearest_point_of_an_outline():
    """Against the nearest of many points on it."""
    place, share = np.array([100.0, -300.0]), np.linspace(0, 1, 4001)[:, None]
    for outline in OUTLINES:
        sides = zip(outline, np.roll(outline, -1, axis=0), strict=True)
        along = np.concatenate([a + share * (b - a) for a, b in sides])
        nearest = np.linalg.norm(along - place, axis=1).min()
        assert evidence.distances_to_boxes([place], [outline]).item() == pytest.approx(nearest, abs=0.01)
