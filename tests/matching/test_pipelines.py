"""The pipelines against the truth, and their settings against the scripts that chose them."""

from __future__ import annotations

import csv
import importlib
import json
import statistics

import numpy as np
import pytest

from stereolib.base import datasets
from stereolib.matching import census_sgm, compute_disparity, motorcycle_view, pipelines, score
from stereolib.virtual import recordings


def recorded(name):
    return recordings.rectified().rectify(*recordings.load_pair(name)), recordings.load_truth(name).disparity_px


def small_pair(shape=(7, 12), seed=0):
    rng = np.random.default_rng(seed)
    return (rng.integers(0, 256, (*shape, 3), dtype=np.uint8) for _ in range(2))


def test_noise_is_measured():
    rng = np.random.default_rng(4)
    for sigma in (1.5, 4.0):
        picture = np.clip(np.rint(120 + sigma * rng.standard_normal((240, 320))), 0, 255).astype(np.uint8)
        assert 0.75 * sigma < pipelines.noise_grey(picture) <= sigma  # the flattest tenth: a little low
    assert pipelines.noise_grey(np.full((40, 50), 90, np.uint8)) == 0


def test_best_beats_plain_matching_and_is_dense():
    """A scene that was not among those on which the settings were chosen."""
    pair, truth = recorded("conditions/glare")
    found = pipelines.stereo_pipeline("best")(*pair)
    best, plain = score(found.disparity_px, truth), score(compute_disparity(*pair), truth)
    assert best.density_pct == 100
    assert best.bad2_pct < 0.7 * plain.bad2_pct
    assert np.isfinite(found.std_px).all() and found.std_px.dtype == np.float32
    # what it calls uncertain is worse than what it calls certain
    off, sure = np.abs(found.disparity_px - truth), found.std_px < 0.5
    assert (off[~sure] > 2).mean() > 5 * (off[sure] > 2).mean()


def test_best_owns_up_to_its_guesses():
    """Plain faces are filled with the background, 15 px off: nearly all of what is wrong there says more than 5 px."""
    pair, truth = recorded("conditions/plain")
    found, true = pipelines.stereo_pipeline("best")(*pair), recordings.load_truth("conditions/plain")
    wrong = (np.abs(found.disparity_px - truth) > 4) & true.visible & (true.box == 1)
    assert wrong.sum() > 10_000
    assert np.median(found.std_px[wrong]) > 5
    assert (found.std_px[wrong] > 5).mean() > 0.8
    ones = np.ones((40, 64), np.float32)  # the views contradict each other everywhere: nothing may claim to be known
    _, kind, level = pipelines.fill_and_classify(census_sgm.SGMResult(9 * ones, 3 * ones, 300 * ones))
    assert (kind == 2).all() and (level == 5).all()


def test_filled_errors_by_hand(monkeypatch):
    monkeypatch.syspath_prepend(str(datasets.ROOT / "benchmarks"))
    script = importlib.import_module("bench_pipeline")
    errors = [np.array([0.0, 4.0]), np.array([0.0, 0.0]), np.array([3.0, 3.0, 3.0])]  # squares 8 and 0 make 4
    assert script.filled_std_px(errors) == [2.0, 2.0, 3.0]


@pytest.mark.parametrize("name", ["conditions/poor_light", "series/coarse_900"])
def test_fast_loses_nothing(name):
    pair, truth = recorded(name)
    found = pipelines.stereo_pipeline("fast")(*pair)
    assert found.std_px is None and found.disparity_px.shape == truth.shape
    fast, whole = (score(disparity, truth) for disparity in (found.disparity_px, compute_disparity(*pair, whole=True)))
    assert fast.density_pct == 100
    assert fast.bad2_pct <= whole.bad2_pct + 1  # the rival has all columns too: what is missing counts as bad


def test_the_settings_are_those_that_the_script_chose(monkeypatch):
    """Its procedure, gone through again over the file of what it measured, ends at the library's defaults."""
    monkeypatch.syspath_prepend(str(datasets.ROOT / "benchmarks"))
    script = importlib.import_module("choose_best")
    with script.FILE.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    means = {script.key_of(row): float(row["mean"]) for row in rows}
    chosen = script.choose(lambda setting: means[script.key_of(setting)])
    assert chosen.pop("blur_from_grey") == pipelines._BLUR_FROM_GREY
    assert (chosen.pop("speckle_px"), chosen.pop("median_px")) == (pipelines._SPECKLE_PX, pipelines._MEDIAN_PX)
    assert census_sgm.CensusSGM(**chosen) == census_sgm.CensusSGM()
    scenes = [name for name in rows[0] if "@" in name or "/" in name]
    assert len(scenes) == 20  # all of them virtual
    first = [float(rows[0][name]) for name in scenes]
    assert float(rows[0]["mean"]) == pytest.approx(statistics.geometric_mean(first), abs=0.01)


def test_the_benchmark_says_what_the_library_uses():
    """The standard deviations in the code are those that the last run of the benchmark found; its promises hold."""
    text = (datasets.ROOT / "benchmarks" / "results" / "pipeline.json").read_text(encoding="utf-8")
    measured = json.loads(text)
    assert list(pipelines.MARGINS) == measured["margins"]
    for name, values in pipelines.BEST_SIGMA_PX.items():
        np.testing.assert_allclose(values, measured["sigma_px"][name], rtol=0.02, atol=0.01)
    filled = pipelines.BEST_SIGMA_PX["filled"]
    assert list(filled) == sorted(filled)  # the further apart the neighbours, the less is known
    assert measured["motorcycle_best_density_pct"] == 100
    assert 63 <= measured["virtual_inside_pct"] <= 73
    assert measured["fast_times_plain"] >= 2
    assert measured["fast_bad2_pct"] <= measured["plain_bad2_pct"] + 1


def test_best_on_a_real_pair():
    """Photographs that took no part in the settings: at most 6 % bad over all pixels, as the benchmark measured."""
    text = (datasets.ROOT / "benchmarks" / "results" / "pipeline.json").read_text(encoding="utf-8")
    view = motorcycle_view()
    quality = score(pipelines.stereo_pipeline("best")(view.left, view.right).disparity_px, view.truth_px)
    assert quality.density_pct == 100
    assert quality.bad2_pct == pytest.approx(json.loads(text)["motorcycle_best_bad2_pct"], abs=0.05)
    assert quality.bad2_pct <= 6.0


def test_refuses():
    with pytest.raises(ValueError, match="unknown pipeline 'finest'; choose one of paper, fast, best"):
        pipelines.stereo_pipeline("finest")
    with pytest.raises(ValueError, match='"fast" looks for a multiple of 32 disparities, got 48; near are 32, 64'):
        pipelines.stereo_pipeline("fast", 48)
    left, right = small_pair()
    with pytest.raises(ValueError, match="128 disparities were asked for and the image is 12 px wide"):
        pipelines.stereo_pipeline("best")(left, right)
    for name in ("paper", "fast", "best"):
        with pytest.raises(ValueError, match="a stereo pair must have one size"):
            pipelines.stereo_pipeline(name)(left, right[1:])
        with pytest.raises(ValueError, match="must be uint8"):
            pipelines.stereo_pipeline(name)(left.astype(float), right)
    sizes = {"num_disparities": 1}, {"census_px": (4, 7)}, {"census_px": (9, 9)}
    for wrong in (*sizes, {"p1": 90, "p2": 80}, {"p2": 5000}):
        with pytest.raises(ValueError, match=r"must be at least 2|odd edges|0 < p1 < p2|16 bits"):
            census_sgm.CensusSGM(**wrong)
