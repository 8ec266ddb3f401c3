"""Stories: each number in a sentence, computed again another way."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from stereolib.notebook import chain
from stereolib.notebook.knobs import knobs
from stereolib.notebook.stories import STORIES
from stereolib.paper import height_by_maximum, printed_value
from stereolib.virtual import recordings

STORY = {story.name: story for story in STORIES}


def numbers(name):
    return [float(text) for text in re.findall(r"(?<![A-Za-z\d.])[-+]?\d+(?:\.\d+)?", STORY[name].sentence)]


def bad(state):
    """Share of the box's pixels that are wrong or empty, %."""
    known, map_px = chain.known(state), chain.filtered(state)
    right = np.abs(map_px - known.disparity_px) <= 2
    return 100 * (1 - right[known.region].mean())


def recipe_cm(state):
    height = height_by_maximum(
        chain.filtered(state), printed_value("scale.cm_per_px"), state.constant_rows, tolerance_px=state.tolerance_px
    )
    return height.height_mm / 10


def test_plain():
    state, textured = STORY["Fig. 4: plain"].state, STORY["Fig. 4: texture"].state
    known = chain.known(state)
    found = 100 * np.isfinite(chain.filtered(state))[known.region].mean()
    told = [found, bad(state), recipe_cm(state), recipe_cm(textured)]
    assert numbers("Fig. 4: plain") == pytest.approx(told, abs=0.051)


def test_poor_light():
    state = STORY["Fig. 4: poor light"].state
    told = numbers("Fig. 4: poor light")
    large = replace(state, block_size=15)
    assert told == pytest.approx([bad(state), 15, bad(large), recipe_cm(state), recipe_cm(large)], abs=0.051)
    assert abs(told[4] - 30) > abs(told[3] - 30) and told[2] < told[0] and 15 in knobs()["block_size"].choices


def test_glare():
    state = STORY["Fig. 4: glare"].state
    share, near, right, cm = numbers("Fig. 4: glare")
    assert share == pytest.approx(bad(state), abs=0.051) and cm == pytest.approx(recipe_cm(state), abs=0.051)
    mask = chain.recipe(state).mask
    assert near > right + 20 and mask.sum() < 300
    assert right == pytest.approx(np.median(chain.known(state).disparity_px[mask]), abs=0.51)
    assert chain.known(state).region[mask].all()  # they lie on the box


def test_texture():
    state = STORY["Fig. 4: texture"].state
    share, *_, held, p1, p2, loose = numbers("Fig. 4: texture")
    assert share == pytest.approx(bad(state), abs=0.051) and (p1, p2) == (1, 2) and held > loose + 5
    known, map_px = chain.known(state), chain.filtered(state)
    wrong = known.region & ~(np.abs(map_px - known.disparity_px) <= 2)
    assert wrong[:, : state.num_disparities + 10].sum() > 0.9 * wrong.sum()
    small = replace(state, block_size=1, p1=1, p2=2)
    assert loose == pytest.approx(100 * np.isfinite(chain.filtered(small)).mean(), abs=0.051)


def test_too_high():
    story = STORY["Why 37.7 cm?"]
    assert f"reads {recipe_cm(story.state):.1f} cm" in story.sentence and "37.7" in story.sentence
    assert chain.true_scene(story.state).boxes[1].size_mm[2] == 300
    rows = np.nonzero(chain.known(story.state).region[:, 300:325].any(axis=1))[0]
    assert chain.recipe(story.state).top_row == pytest.approx(rows[0], abs=4)  # the whole near edge


def test_accident():
    state = STORY["30 cm by accident"].state
    rows, near, right, reads, specks, without = numbers("30 cm by accident")
    assert state.source == "series/medium_900" and chain.true_scene(state).boxes[1].size_mm[2] == 300
    assert rows == state.constant_rows == 53
    counted, truth = chain.filtered(state)[: -state.constant_rows], recordings.load_truth(state.source)
    row, column = np.unravel_index(np.nanargmax(counted), counted.shape)
    assert truth.box[row, column] == 0 and (truth.box[row] == 1).any()  # beside the box
    assert [near, right] == pytest.approx([counted[row, column], truth.disparity_px[row, column]], abs=0.051)
    assert reads == 30 and recipe_cm(state) == pytest.approx(30, abs=0.051)
    assert without == pytest.approx(recipe_cm(replace(state, speckle_window_size=int(specks))), abs=0.051)
    assert without < reads - 20


def test_dilation():
    state = STORY["What dilation destroys"].state
    plain = replace(state, filter="none")
    held, left, now, before, rows, reads, without = numbers("What dilation destroys")
    assert [held, left] == pytest.approx([bad(plain), bad(state)], abs=0.051)
    for one, told in ((state, now), (plain, before)):
        error = (chain.filtered(one) - chain.known(one).disparity_px)[chain.known(one).region]
        assert told == pytest.approx(np.mean(error[np.abs(error) <= 4]), abs=0.0051)
    assert now > before + 0.5 and rows == 53
    assert [reads, without] == pytest.approx([recipe_cm(state), recipe_cm(plain)], abs=0.051)
    read, map_px = chain.recipe(state), chain.filtered(plain)
    assert read.height_px == state.kernel_px // 2  # the floor, by which it grew above the rows cut off
    right = chain.known(state).disparity_px[read.top_row, read.column]
    below = map_px[-state.constant_rows + 1, read.column - 7 : read.column + 8]
    assert read.disparity_px > right + 2 and read.disparity_px <= np.nanmax(below)


def test_rows():
    state = STORY["Half a row off"].state
    scatter, without, cm = numbers("Half a row off")
    for one, told in ((state, scatter), (replace(state, row_px=0), without)):
        error = (chain.filtered(one) - chain.known(one).disparity_px)[chain.known(one).region]
        assert told == pytest.approx(np.std(error[np.abs(error) <= 4]), abs=0.0051)
    assert scatter > without + 0.02 and cm == pytest.approx(30, abs=0.1)
    assert f"{chain.ground_plane(state).height_mm / 10:.1f}" == f"{cm:.1f}"


def test_turned():
    story = STORY["A turned laser"]
    assert story.state.laser_yaw_deg == 2
    assert re.search(r"turned by (1\.9|2\.0|2\.1) ± 0\.\d degrees", story.sentence)


def test_sentences_stay_whole_where_nothing_can_be_told():
    """A visitor may look at an own pair, of which nobody knows the truth."""
    for story in STORIES:
        assert "nan" not in story.sentence
    assert len({story.name for story in STORIES}) == len(STORIES)
