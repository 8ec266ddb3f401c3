"""Sweeps: every measure against its slow twin, and nothing done twice or lost."""

from __future__ import annotations

import os
import time
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
from support.views import small_view

from stereolib.matching import (
    KnownView,
    SGBMParams,
    Workers,
    compute_disparity,
    fattening_px,
    score,
    settings_grid,
    sweep,
    sweeps,
)
from stereolib.matching.ground_truth import METRICS

SETTINGS = settings_grid(SGBMParams(32), block_size=(3, 5), uniqueness_ratio=(0, 15))


@pytest.mark.parametrize("whole", [False, True])
def test_rows_equal_the_slow_twins(whole):
    both = [small_view(), small_view("other", 7, seed=1)]
    settings = [*SETTINGS, SGBMParams(16, 5, 10)]
    rows = sweep(both, settings, whole=whole, progress=False, workers=Workers(2))
    assert len(rows) == 2 * 5 * 3
    assert rows["where"].tolist() == ["all", "visible", "patch"] * 10
    assert rows["disparity_px"].tolist() == [12] * 15 + [7] * 15
    at = iter(rows.to_dict("records"))
    for view in both:
        for params in settings:
            found = compute_disparity(view.left, view.right, params, whole=whole)
            fat = fattening_px(found, view.truth_px, view.visible)
            for mask in (np.isfinite(view.truth_px), view.visible, view.regions["patch"]):
                row = next(at)
                expected = [*vars(score(found, view.truth_px, mask)).values(), fat]
                np.testing.assert_allclose([row[m] for m in METRICS], expected, rtol=1e-4, atol=1e-4)
                assert (row["block_size"], row["p2"]) == (params.block_size, params.penalties[1])
    assert rows["fattening_px"].max() > 0 and rows["bad2_pct"].nunique() > 5


def test_nothing_matched_is_all_bad():
    blank = np.zeros((60, 120), np.uint8)
    row = sweep(
        [KnownView("blank", blank, blank, np.full((60, 120), 99.0))], [SGBMParams(16, 5, 40)], progress=False
    ).iloc[0]
    assert row["bad4_pct"] == 100 and np.isnan(row["fattening_px"])


def test_grid():
    assert [(p.block_size, p.mode) for p in settings_grid(block_size=(3, 5), mode=("sgbm", "hh"))] == [
        (3, "sgbm"), (3, "hh"), (5, "sgbm"), (5, "hh")]  # fmt: skip
    assert all(p.num_disparities == 32 for p in SETTINGS)
    with pytest.raises(ValueError, match="multiple of 16"):
        settings_grid(num_disparities=(16, 20))
    with pytest.raises(ValueError, match=r"unknown fields \['blocksize'\]: SGBMParams has num_disparities"):
        settings_grid(blocksize=(3,))


@pytest.mark.parametrize("backend", ["threading", "loky", "sequential"])
def test_every_backend_gives_the_same_rows(backend):
    jobs = [small_view(), small_view("other", 7, seed=1)], SETTINGS
    expected = sweep(*jobs, workers=Workers(1), progress=False)
    pd.testing.assert_frame_equal(sweep(*jobs, workers=Workers(2, backend), progress=False), expected)


@pytest.mark.slow
@pytest.mark.parametrize("processes", [False, True])
def test_a_dask_cluster_gives_the_same_rows(processes):
    distributed = pytest.importorskip("distributed")
    jobs = [small_view(), small_view("other", 7, seed=1)], SETTINGS
    expected = sweep(*jobs, workers=Workers(2), progress=False)
    with (
        distributed.LocalCluster(2, threads_per_worker=1, dashboard_address=None, processes=processes) as cluster,
        distributed.Client(cluster),
    ):
        pd.testing.assert_frame_equal(sweep(*jobs, workers=Workers(backend="dask"), progress=False), expected)


def test_dask_that_is_not_there_is_told(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises((ValueError, RuntimeError), match=r"pip install 'stereolib\[cluster\]'"):
        sweep([small_view()], SETTINGS, workers=Workers(backend="dask"), progress=False)


def counted(monkeypatch, fail_at: int | None = None, error: type[BaseException] = KeyboardInterrupt) -> list[str]:
    """Count the matches, and stop at one of them."""
    done: list[str] = []
    measure = sweeps._measure

    def slow(key, *rest):
        if len(done) == fail_at:
            raise error("stopped")
        done.append(key)
        return measure(key, *rest)

    monkeypatch.setattr(sweeps, "_measure", slow)
    return done


def test_an_interrupted_sweep_goes_on_and_redoes_nothing(tmp_path: Path, monkeypatch):
    jobs, path = ([small_view(), small_view("other", 7, seed=1)], SETTINGS), tmp_path / "rows.csv"
    expected = sweep(*jobs, progress=False, workers=Workers(1))
    first = counted(monkeypatch, fail_at=5)
    with pytest.raises(KeyboardInterrupt, match=r"stopped after 5 of 8 matches; they are in .*rows.csv; call again"):
        sweep(*jobs, results=path, progress=False, workers=Workers(1))
    assert len(first) == 5
    monkeypatch.undo()
    second = counted(monkeypatch)
    pd.testing.assert_frame_equal(sweep(*jobs, results=path, progress=False, workers=Workers(1)), expected)
    assert len(second) == 3 and not set(first) & set(second)
    assert sweep(*jobs, results=path, progress=False).equals(expected) and len(second) == 3  # nothing left to do
    more = sweep(jobs[0], [*SETTINGS, SGBMParams(16)], results=path, progress=False)
    assert len(second) == 5 and len(more) == 30
    saved = pd.read_csv(path, comment="#")
    pd.testing.assert_frame_equal(saved.drop(columns="key"), more, check_dtype=False)


def test_a_line_torn_by_a_crash_is_done_again(tmp_path: Path):
    jobs, path = ([small_view()], SETTINGS), tmp_path / "rows.csv"
    expected = sweep(*jobs, results=path, progress=False)
    whole = path.read_bytes()
    for cut in (-1, -40, -len(whole) // 3):
        path.write_bytes(whole[:cut])
        pd.testing.assert_frame_equal(sweep(*jobs, results=path, progress=False), expected)
        assert path.read_bytes() == whole


def test_a_worker_that_dies_loses_no_finished_row(tmp_path: Path, monkeypatch):
    marks, path, jobs = tmp_path / "marks", tmp_path / "rows.csv", ([small_view()], SETTINGS)
    marks.mkdir()
    expected, measure = sweep(*jobs, progress=False), sweeps._measure

    def die_after_two(key, *rest):  # a local function goes to the workers by value
        if len(list(marks.iterdir())) == 2:
            time.sleep(0.7)  # what was finished is on its way
            os._exit(1)
        (marks / key).touch()
        return measure(key, *rest)

    monkeypatch.setattr(sweeps, "_measure", die_after_two)
    with pytest.raises(RuntimeError, match=r"the sweep stopped after 2 of 4 matches \(Terminated.*call again to go on"):
        sweep(*jobs, results=path, workers=Workers(2, "loky"), progress=False)
    finished = pd.read_csv(path, comment="#")["key"].unique()
    assert len(finished) == 2
    monkeypatch.undo()
    again = counted(monkeypatch)
    pd.testing.assert_frame_equal(sweep(*jobs, results=path, progress=False), expected)
    assert not set(finished) & set(again) and len(again) == 4 - len(finished)


def test_results_of_another_study_are_refused(tmp_path: Path):
    path = tmp_path / "rows.csv"
    sweep([small_view()], SETTINGS[:1], results=path, progress=False)
    before = path.read_bytes()
    for others in ([small_view(seed=5)], [small_view(regions={})], [small_view(about={})], [small_view("b")]):
        with pytest.raises(ValueError, match="holds the results of another study"):
            sweep(others, SETTINGS[:1], results=path, progress=False)
    with pytest.raises(ValueError, match="holds the results of another study"):
        sweep([small_view()], SETTINGS[:1], results=path, whole=True, progress=False)
    assert path.read_bytes() == before
    for damage in ("abc", before.decode().splitlines()[-1].rpartition(",")[0] + ",many"):
        path.write_bytes(before + damage.encode() + b"\n")
        with pytest.raises(ValueError, match=rf"rows.csv: line {before.count(10) + 1} is damaged: delete it"):
            sweep([small_view()], SETTINGS[:1], results=path, progress=False)
    path.write_text("a,b\n1,2\n")
    with pytest.raises(ValueError, match="is no results file of a sweep"):
        sweep([small_view()], SETTINGS[:1], results=path, progress=False)


def test_bar_shows_rate_and_remaining_time(capsys):
    sweep([small_view()], SETTINGS)
    assert "4/4" in (shown := capsys.readouterr().err) and "match/s" in shown and "<" in shown


def test_sweeps_that_cannot_be_are_refused():
    view = small_view()
    with pytest.raises(ValueError, match="different names"):
        sweep([view, view], SETTINGS)
    with pytest.raises(ValueError, match="at least one of each"):
        sweep([view], [])
    with pytest.raises(ValueError, match="search window ends at 240 px, the image is 220 px wide"):
        sweep([view], [SGBMParams(240)])
    exchanged = [cv2.resize(image, None, fx=2, fy=2) for image in (view.right, view.left)]
    with pytest.raises(ValueError, match="view 'exchanged': left and right are exchanged"):
        sweep([KnownView("exchanged", *exchanged, np.ones((200, 440)))], SETTINGS)
