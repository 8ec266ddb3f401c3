"""Sizes, volumes and surfaces with their deviations: against drawn boxes and many draws."""

from __future__ import annotations

import numpy as np
import pytest
from support.boxes import a_box

from stereolib.measurement import MeasuredObject
from stereolib.measurement.fusion import Fused, corners_mm
from stereolib.measurement.measured_object import from_faces


def test_corners_of_the_drawn_box():
    p = corners_mm(a_box().x)
    np.testing.assert_allclose(p[1], [700, 20], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(np.diff(p, axis=0), axis=1), [300, 200], atol=1e-9)
    thing = from_faces(a_box(), (250.0, 0.5), {}, 0.0)
    np.testing.assert_allclose(thing.size_mm, [300, 200, 250], atol=1e-9)
    np.testing.assert_allclose(thing.outline_mm.mean(axis=0), thing.position_mm)
    assert thing.volume_l[0] == pytest.approx(15) and np.degrees(thing.yaw_rad) == pytest.approx(-50)


def test_deviations_of_sizes_volume_and_surface_against_draws():
    spread = np.array([0.002, 0.6, 0.4, 0.0004, 0.0004])
    thing = from_faces(a_box(np.diag(spread**2)), (250.0, 0.5), {}, 0.0)
    rng = np.random.default_rng(8)
    sizes = []
    for x in a_box().x + rng.normal(0, 1, (4000, 5)) * spread:
        sizes.append(np.linalg.norm(np.diff(corners_mm(x), axis=0), axis=1))
    sizes = np.column_stack([sizes, 250 + rng.normal(0, 0.5, 4000)])
    np.testing.assert_allclose(thing.std_mm, sizes.std(axis=0), rtol=0.05)
    assert thing.volume_l[1] == pytest.approx(sizes.prod(axis=1).std() / 1e6, rel=0.05)
    area = 2 * (sizes[:, 0] + sizes[:, 1]) * sizes[:, 2] + sizes[:, 0] * sizes[:, 1]
    assert thing.surface_m2[1] == pytest.approx(area.std() / 1e6, rel=0.05)


def test_a_side_too_vague_is_refused_and_the_other_stays():
    thing = from_faces(a_box(np.diag([0, 0, 0, 0, 0.03**2])), (250.0, 0.5), {}, 0.0)
    assert thing.shape == "face" and np.isnan(thing.size_mm[0]) and thing.size_mm[1] == pytest.approx(300)
    assert "±" in thing.reasons["length"] and np.isnan(thing.volume_l[0]) and len(thing.outline_mm) == 2


def test_a_hidden_end_gives_no_size():
    hidden = Fused(a_box().x, np.zeros((5, 5)), {}, (True, True), "")
    thing = from_faces(hidden, (np.nan, np.nan), {}, 0.0)
    assert np.isnan(thing.size_mm).all() and "hidden" in thing.reasons["length"] and "hidden" in thing.reasons["width"]


def test_a_cylinder_s_volume_and_surface():
    std = np.array([1.0, 1.0, 2.0])
    C = np.outer(std, std) * [[1, 1, 0], [1, 1, 0], [0, 0, 1]]
    nothing = np.zeros(2)
    thing = MeasuredObject("circle", np.array([200.0, 200, 300]), C, nothing, np.eye(2), np.nan, np.nan, nothing[None])
    r = 100 + np.random.default_rng(1).normal(0, 0.5, 200_000)
    h = 300 + np.random.default_rng(2).normal(0, 2, 200_000)
    for told, drawn_values in (
        (thing.volume_l, np.pi * r**2 * h / 1e6),
        (thing.surface_m2, (2 * np.pi * r * h + np.pi * r**2) / 1e6),
    ):
        assert told[0] == pytest.approx(drawn_values.mean(), rel=1e-3) and told[1] == pytest.approx(
            drawn_values.std(), rel=0.02
        )
