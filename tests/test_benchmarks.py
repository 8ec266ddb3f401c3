"""The benchmarks still fit the library: they are run rarely, and would break unseen."""

from __future__ import annotations

import importlib
import sys
from dataclasses import replace
from functools import cache
from types import ModuleType

import cv2
import numpy as np
import pytest
from support.box_scenes import (
    SEEN_PX,
    WIDE_PX,
    BoxScene,
    Shot,
    corners_mm,
    held_scene,
    is_measurable,
    leaning_scene,
    scan,
)
from support.disturbances import ROWS, Told
from support.instruments import INSTRUMENT

from stereolib import paper
from stereolib.base import ROOT
from stereolib.reproduction import bench_tables
from stereolib.virtual import cube_scene, recordings

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
    shot = dimensions.shoot(dimensions.box_scene(0))
    ahead = np.r_[shot.scan.ranges_mm[:25], shot.scan.ranges_mm[-25:]]
    assert abs(np.nanmin(ahead) - shot.truth.distance_mm) < 25  # the box's nearest point lies between two beams
    assert all(100 <= side <= 400 for side in shot.truth.size_mm) and shot.left.std() > 10


@cache
def a_shot() -> Shot:
    """A recording of the virtual rig, and a laser that stood straight below the camera."""
    truth = BoxScene(1, cube_scene(), 700.0, recordings.setup(), paper.paper_rig())
    return Shot(*recordings.load_pair("conditions/texture"), scan(truth, np.random.default_rng(0)), truth)


def disturbed(row: str) -> Shot:
    return ROWS[row].disturb(a_shot(), INSTRUMENT, np.random.default_rng(1))[0]


def clipped_pct(picture: np.ndarray) -> float:
    return 100 * float((picture.max(axis=2) == 255).mean())


@pytest.mark.parametrize("gain", [0.5, 0.7, 1.4, 2])
def test_two_exposures_differ_by_their_gain_and_hardly_clip(gain: float) -> None:
    shot, plain = disturbed(f"gain_{gain:g}"), a_shot()
    light = shot.left.mean() / plain.left.mean()
    assert shot.right.mean() / plain.right.mean() / light == pytest.approx(gain, rel=0.02)
    assert max(map(clipped_pct, (shot.left, shot.right))) <= 5
    assert clipped_pct(disturbed("clipped_15").right) == pytest.approx(15, abs=1)


@pytest.mark.parametrize(("row", "moved"), [("rows_0.5", (0, 0.5)), ("rows_2", (0, 2)), ("columns_1", (1, 0))])
def test_the_right_picture_moves_as_far_as_the_row_says(row: str, moved: tuple[float, float]) -> None:
    before, after = (cv2.GaussianBlur(shot.right[..., 1], (0, 0), 2.0) for shot in (a_shot(), disturbed(row)))
    _, M = cv2.findTransformECC(before, after, np.eye(2, 3, dtype=np.float32), cv2.MOTION_TRANSLATION)
    np.testing.assert_allclose(np.abs(M[:, 2]), moved, atol=0.05)
    np.testing.assert_array_equal(disturbed(row).left, a_shot().left)


def test_a_turned_laser_sees_the_same_from_other_beams() -> None:
    before, after = a_shot().scan, disturbed("laser_yaw_5").scan
    turned = [np.nanmedian(np.abs(np.roll(after.ranges_mm, k) - before.ranges_mm)) for k in range(-8, 9)]
    assert abs(int(np.argmin(turned)) - 8) == 5 and min(turned) < 5


def test_a_shifted_laser_sees_the_walls_nearer_or_farther() -> None:
    before, after = a_shot().scan.ranges_mm, disturbed("laser_side_30").scan.ranges_mm
    assert abs(after[90] - before[90]) == pytest.approx(30, abs=15) and abs(after[180] - before[180]) < 15


def test_what_does_not_stand_does_not_stand() -> None:
    for stage, lowest in ((held_scene, (20, 150)), (leaning_scene, (-1e-6, 1e-6))):
        heights = [corners_mm(stage(k).box)[:, 2] for k in range(10)]
        assert all(lowest[0] <= z.min() <= lowest[1] for z in heights)
    assert all(np.ptp(np.sort(z)[:4]) > 5 for z in heights)  # it leans: its foot is not level


def test_a_box_is_measurable_when_it_is_whole_in_both_pictures_and_no_size_is_hidden() -> None:
    def measurable(distance: float, yaw: float, lateral: float = 0.0, least_px: float = SEEN_PX) -> bool:
        scene = cube_scene(distance, size_mm=(200.0, 200.0, 200.0), yaw_rad=yaw, lateral_mm=lateral)
        return is_measurable(replace(a_shot().truth, scene=scene), least_px)

    assert measurable(700, np.pi / 4)
    assert not measurable(700, np.pi / 4, 400.0)  # cut by the rim
    assert not measurable(350, np.pi / 4)  # its top is cut
    assert not measurable(700, 0.0, -45.0)  # both cameras stand before its one face
    assert measurable(700, np.radians(5), -45.0) and not measurable(700, np.radians(5), -45.0, WIDE_PX)  # a sliver
    assert measurable(700, np.pi / 4, 0.0, WIDE_PX)
    assert f"second face {WIDE_PX:g} px wide" in bench_tables.rigs_table(
        ROOT / "benchmarks" / "results"
    )  # as its column says


def test_the_goal_of_intervals_is_the_one_that_the_readme_names(bench) -> None:
    low, high = bench("common").COVERAGE
    assert f"{100 * low:g} to {100 * high:g}" == bench_tables._quoted()["rigs"]["within_2_sigma_pct"]


@pytest.mark.parametrize(("inside", "chance"), [(95, 1.0), (90, 1.0), (100, 0.630), (88, 0.503), (80, 0.0023)])
def test_a_share_is_outside_of_its_goal_by_chance_or_not(bench, inside: int, chance: float) -> None:
    """Of a hundred intervals that are to hold 90 to 99 times: against the nearer end."""
    assert bench("common").chance_outside(inside, 100) == pytest.approx(chance, rel=0.01)


@pytest.mark.parametrize("number", [0, 3])
def test_the_hard_scenes_are_worse_in_one_way(bench, number: int) -> None:
    dimensions = bench("bench_dimensions")
    plain, hard = (dimensions.shoot(dimensions.box_scene(1, **how)) for how in ({}, dimensions.HARD[number]))
    np.testing.assert_array_equal(plain.truth.size_mm, hard.truth.size_mm)
    assert np.abs(plain.left.astype(float) - hard.left).mean() > 1


def test_the_rival_s_window_is_the_narrowest_that_holds_the_cube(bench) -> None:
    study = bench("bench_study")
    view = recordings.view("series/medium_700")
    params, seen = study.cut(view), view.truth_px[view.regions["cube"]]
    low, high = params.min_disparity, params.min_disparity + params.num_disparities
    assert low + 8 <= seen.min() < low + 9 and high - 8 - 16 <= seen.max() <= high - 8


def test_the_bench_of_rigs_goes_on_where_it_was_interrupted(bench, tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    rigs, asked = bench("bench_rigs"), []

    def of_scene(rows: tuple[str, ...], number: int) -> tuple[dict[str, Told], set[str]]:
        asked.append((rows, number))
        told = Told({"height": (np.float64(number), 0.5)}, True, True, "", False)
        return dict.fromkeys(rows, told), {"base/files.py"}

    monkeypatch.setattr(rigs, "of_scene", of_scene)
    monkeypatch.setattr(rigs, "CACHE", tmp_path)
    first = rigs.run(["cartons"], 50, 2, 1)
    (file,) = tmp_path.iterdir()
    file.write_text(file.read_text() + '\n{"row": "car')
    assert rigs.run(["cartons"], 50, 2, 1) == first and asked == [(("cartons",), 50), (("cartons",), 51)]
    more, _ = rigs.run(["cartons", "cartons_rows_1"], 50, 3, 1)
    both = ("cartons", "cartons_rows_1")
    assert asked[2:] == [(("cartons_rows_1",), 50), (("cartons_rows_1",), 51), (both, 52)]
    assert more["cartons"]["height"]["told"] == 3 and rigs.kept(file)[1] == {"base/files.py"}
    monkeypatch.setattr(rigs, "code_sha256", lambda rooms: "another")
    assert rigs.run(["cartons"], 50, 2, 1) == first and len(asked) == 7
