"""The paper's numbers are typed rightly, and a bad file of them is refused."""

from __future__ import annotations

import re

import cv2
import numpy as np
import pytest

from stereolib.base.datasets import ROOT
from stereolib.paper import published
from stereolib.paper.printed_values import parse_published

# Typed a second time from the paper's text, so that a slip in published.toml shows.
PRINTED = """
table1.left.dist 0.0644 -0.2494 -0.6359 0.00069078 -0.0011
table1.left.fx 729.9077 | table1.left.fy 729.4782 | table1.left.cx 322.5457 | table1.left.cy 226.0965
table1.right.dist -0.0101 0.3192 -2.2780 -0.0048 -0.0035
table1.right.fx 733.1340 | table1.right.fy 732.8580 | table1.right.cx 303.3310 | table1.right.cy 224.2269
stereo.R 1.0000 0.0027 -0.0036 -0.0027 1.0000 0.0016 0.0036 -0.0016 1.0000
stereo.T -93.1032 1.2802 0.1104
stereo.E -0.0048 -0.4414 1.0334 0.1125 0.1493 93.1061 -1.2801 -93.1021 0.1459
stereo.F 0 0 0.0016 0 0 0.1269 -0.0018 -0.1274 0.6250
setup.cube 30 30 30 | setup.distance 0.70 | setup.camera_height 8.5 | setup.max_distance 1
lrf.realizations 5 | height.constant_rows 53
scale.width_px 362 | scale.width_cm 42 | scale.cm_per_px 0.116
"""


@pytest.mark.parametrize("entry", [e.strip() for e in re.split(r"[|\n]", PRINTED) if e.strip()])
def test_published_values(entry):
    id, *numbers = entry.split()
    assert np.ravel(published()[id].value).tolist() == [float(n) for n in numbers]


def test_every_figure_is_published_and_has_a_picture():
    figures = {item.id: item.figure for item in published().values() if item.id.startswith("fig.")}
    assert figures == {f"fig.{n}": f"fig0{n}" for n in range(1, 10)}
    assert {item.figure for item in published().values()} <= {"", *figures.values()}
    drawn = [cv2.imread(str(ROOT / "figures" / f"{name}.png")) for name in figures.values()]
    for picture in drawn:
        assert picture.shape[0] > 200 and picture.std() > 10  # grey levels; a blank page has none
    assert len({picture.tobytes() for picture in drawn}) == 9


def test_published_file_names_a_notebook_for_everything():
    assert all(re.fullmatch(r"0[0-9]_\w+", item.notebook) for item in published().values())


GOOD = """["a.b"]
value = 1
where = "I"
kind = "argument"
against = "itself"
atol = 1.0
reason = "r"
notebook = "01_x"
"""
CONDITION = '["a.b".conditions.c]\nsays = "{} px"\nleast = 1\nbecause = "so"\n'


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("reason", "raison"), "a.b: unknown .'raison'"),
        (('where = "I"\n', ""), "a.b: .*where"),
        (('"argument"', '"loose"'), "a.b: kind 'loose'"),
        (('"itself"', '"fate"'), "a.b: against 'fate'"),
        (("atol = 1.0\n", ""), "a.b: .*either atol or rtol"),
        (("atol = 1.0\n", "atol = 1.0\nrtol = 1.0\n"), "a.b: .*either atol or rtol"),
        (("1.0", '"loose"'), "a.b: .*computed"),
        (('"r"', '""'), "a.b: .*reason"),
        (('"argument"', '"redrawn"'), "a.b: .*redrawn"),
        (('"itself"', '"nothing"'), "a.b: .*neither"),
        (('"itself"', '"claim"'), "a.b: .*needs conditions"),
        (('"01_x"\n', '"01_x"\n' + CONDITION), "a.b: .*1 tolerances, 1 conditions"),
    ],
)
def test_a_bad_published_file_names_its_entry(change, message):
    assert list(parse_published(GOOD)) == ["a.b"]
    with pytest.raises(ValueError, match=message):
        parse_published(GOOD.replace(*change))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("{} px", "px"), "needs one {}"),
        (("{} px", "{} {} px"), "needs one {}"),
        (("least = 1\n", ""), "needs least, most or both"),
        (('"so"', '""'), "needs its reason"),
        (("least", "lest"), "lest"),
    ],
)
def test_a_bad_condition_names_its_entry(change, message):
    claim = GOOD.replace("atol = 1.0\n", "") + CONDITION
    assert parse_published(claim)["a.b"].conditions["c"].limit == "at least 1"
    with pytest.raises(ValueError, match=f"a.b: .*{message}"):
        parse_published(claim.replace(*change))
