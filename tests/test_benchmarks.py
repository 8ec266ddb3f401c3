"""The benchmarks still fit the library: they are run rarely, and would break unseen."""

from __future__ import annotations

import importlib
import sys
from types import ModuleType

import numpy as np
import pytest

from stereolib.base import ROOT
from stereolib.virtual import recordings

NAMES = sorted(path.stem for path in (ROOT / "benchmarks").glob("bench_*.py"))


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sys, "path", [str(ROOT / "benchmarks"), *sys.path])

    def load(name: str) -> ModuleType:
        return importlib.import_module(name)

    return load


@pytest.mark.parametrize("name", NAMES)
def test_it_imports_and_says_what_it_measures(bench, name: str) -> None:
    assert bench(name).__doc__


def test_only_one_of_accuracy_and_time_can_be_asked_for(bench, monkeypatch: pytest.MonkeyPatch) -> None:
    common = bench("common")
    for words, wanted in (([], {"accuracy", "time"}), (["--only", "time"], {"time"})):
        monkeypatch.setattr(sys, "argv", ["bench", *words])
        assert common.asked("what it measures") == wanted


def test_a_virtual_box_stands_where_it_is_said_to_stand(bench) -> None:
    dimensions = bench("bench_dimensions")
    shot = dimensions.shoot(0)
    ahead = np.r_[shot.scan.ranges_mm[:25], shot.scan.ranges_mm[-25:]]
    assert abs(np.nanmin(ahead) - shot.distance_mm) < 25  # the box's nearest point lies between two beams
    assert all(100 <= side <= 400 for side in shot.size_mm) and shot.left.std() > 10


@pytest.mark.parametrize("number", [0, 3])
def test_the_hard_scenes_are_worse_in_one_way(bench, number: int) -> None:
    dimensions = bench("bench_dimensions")
    plain, hard = (dimensions.shoot(1, **how) for how in ({}, dimensions.HARD[number]))
    np.testing.assert_array_equal(plain.size_mm, hard.size_mm)
    assert np.abs(plain.left.astype(float) - hard.left).mean() > 1


def test_the_rival_s_window_is_the_narrowest_that_holds_the_cube(bench) -> None:
    study = bench("bench_study")
    view = recordings.view("series/medium_700")
    params, seen = study.cut(view), view.truth_px[view.regions["cube"]]
    low, high = params.min_disparity, params.min_disparity + params.num_disparities
    assert low + 8 <= seen.min() < low + 9 and high - 8 - 16 <= seen.max() <= high - 8
