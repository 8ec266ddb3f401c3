"""The ledger holds the paper's numbers, converts them rightly and judges fairly."""

from __future__ import annotations

import re

import cv2
import numpy as np
import pytest

from stereolib import paper
from stereolib.paper import compare, published

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


def test_published_file_names_a_notebook_for_everything():
    assert all(re.fullmatch(r"0[0-9]_\w+", item.notebook) for item in published().values())


def test_printed_E_is_R_transposed_times_skew_T():
    """facts: within 0.0046; OpenCV's order misses by 0.33."""
    assert paper.max_deviation("stereo.E", paper.printed_essential()) == pytest.approx(0.0046, abs=5e-5)
    assert paper.max_deviation("stereo.E", paper.printed_essential("opencv")) == pytest.approx(0.333, abs=5e-4)
    twisted = -paper.printed_essential("opencv").T  # the two are each other's negative transpose
    np.testing.assert_allclose(twisted, paper.printed_essential(), atol=1e-12)


def test_printed_F_follows_from_printed_E():
    assert paper.max_deviation("stereo.F", paper.printed_fundamental()) == pytest.approx(2.7e-4, abs=5e-6)
    assert paper.printed_fundamental("left-right")[2, 2] == pytest.approx(-0.185, abs=5e-4)


@pytest.mark.parametrize("function", [paper.printed_essential, paper.printed_fundamental])
def test_unknown_convention_is_refused(function):
    with pytest.raises(ValueError, match="must be"):
        function("matlab")


def test_rig_agrees_with_printed_E_and_F():
    rig = paper.paper_rig()
    assert paper.max_deviation("stereo.E", rig.E) < 0.0048
    assert paper.max_deviation("stereo.F", rig.F) < 3e-4
    assert rig.baseline_mm == pytest.approx(np.sqrt(93.1032**2 + 1.2802**2 + 0.1104**2), abs=1e-9)
    assert rig.rectify(alpha=0).f_px == pytest.approx(763.7, abs=0.05)


def test_printed_T_taken_for_opencvs_would_miss_the_printed_E():
    """Why T is turned by R: it is the right null vector of E, not the left one."""
    E, T, rig = (np.array(published()["stereo.E"].value), np.array(published()["stereo.T"].value), paper.paper_rig())
    assert np.abs(E @ T).max() < 0.01 < 20 < np.abs(T @ E).max()
    unturned = np.cross(T, rig.R.T).T  # column by column: skew(T) R
    assert paper.max_deviation("stereo.E", unturned) == pytest.approx(0.337, abs=5e-4)


def test_rotation_is_nearest_to_the_printed_one():
    R = paper.paper_rig().R
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(R.T, published()["stereo.R"].value, atol=5e-5)


@pytest.mark.parametrize("side", ["left", "right"])
def test_distortion_order(side):
    """The paper's equation with its squares restored, coefficient by coefficient, against cv2 with our order."""
    k1, k2, k3, p1, p2 = published()[f"table1.{side}.dist"].value
    fx, fy, cx, cy = (published()[f"table1.{side}.{name}"].value for name in ("fx", "fy", "cx", "cy"))
    camera = getattr(paper.paper_rig(), side)
    for x, y in [(0.2, -0.1), (-0.3, 0.25), (0.05, 0.3)]:
        r2 = x * x + y * y
        radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        u = fx * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)) + cx
        v = fy * (y * radial + 2 * p2 * x * y + p1 * (r2 + 2 * y**2)) + cy
        seen, _ = cv2.projectPoints(np.array([[[x, y, 1.0]]]), np.zeros(3), np.zeros(3), camera.K, camera.dist)
        np.testing.assert_allclose(seen.ravel(), [u, v], atol=1e-9)


def test_printed_form_undoes_paper_rig():
    form = paper.printed_form(paper.paper_rig())
    exact = [id for id in form if id.startswith("table1.") or id == "stereo.T"]
    assert len(exact) == 11
    for id in exact:
        np.testing.assert_allclose(form[id], published()[id].value, rtol=0, atol=1e-12)
    assert set(compare(form)["verdict"]) == {"reproduced"}


def test_verdicts():
    rows = compare(
        {
            "table1.left.fx": 729.9077 * 1.0007,
            "table1.left.fy": 729.4782 * 1.0009,
            "scale.cm_per_px": 42 / 362,
            "claim.glare_on_object": True,
            "claim.canny_box_varies": np.False_,
            "lrf.max_range": "in part: 1.2 %",
            "claim.time_of_flight": "no: it triangulates",
            "setup.camera_height": 19.0,
            "misprint.tangential": "2 x'^2",
            "claim.low_computation": None,
        },
        reasons={"scale.cm_per_px": "a quotient"},
    ).set_index("id")
    assert rows["verdict"].tolist() == [
        *("reproduced", "differs", "reproduced", "agrees", "does not hold", "holds in part", "does not hold"),
        *("paper contradicts itself", "paper contradicts itself", "not comparable"),
    ]
    row = rows.loc["scale.cm_per_px"]
    assert row.tolist() == ["IV", "0.116", "0.1160", "+0.0000", "0.0005", "cm/px", "reproduced", "a quotient"]
    assert rows.loc["table1.left.fy", "reason"] == published()["table1.left.fy"].reason
    assert rows.loc["claim.low_computation", "ours"] == "-"


def test_matrix_tolerance_is_element_by_element():
    """stereo.T may move 0.2 mm along the axis but 0.04 mm across it."""
    printed = published()["stereo.T"].value
    along, across = (
        compare({"stereo.T": np.add(printed, [0, 0, 0.19])}),
        compare({"stereo.T": np.add(printed, [0.1, 0, 0])}),
    )
    assert along.loc[0, ["difference", "tolerance", "verdict"]].tolist() == ["max 0.19", "0.03 to 0.2", "reproduced"]
    assert across.loc[0, "verdict"] == "differs"


@pytest.mark.parametrize("side", [-1, 1])
def test_the_tolerance_itself_counts(side):
    assert compare({"scale.width_px": 362 + side * 4.0}).loc[0, "verdict"] == "reproduced"
    assert compare({"scale.width_px": 362 + side * 4.01}).loc[0, "verdict"] == "differs"


def test_nan_differs():
    assert compare({"scale.width_px": np.nan}).loc[0, "verdict"] == "differs"


def test_numbers_are_rounded_and_minus_zero_is_not_shown():
    first, second = (compare({"stereo.F": np.array(published()["stereo.F"].value) - e}) for e in (1e-9, -1e-9))
    assert first.equals(second)
    assert "-0.0000" not in first.to_csv()
    assert first.loc[0, "paper"] == "0.0000 0.0000 0.0016; 0.0000 0.0000 0.1269; -0.0018 -0.1274 0.6250"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"table1.left.fz": 1.0}, "near it: .*table1.left.fx"),
        ({"stereo.R": [1, 2, 3]}, r"shape \(3, 3\)"),
        ({"table1.left.fx": [729.9]}, "a single number"),
        ({"table1.left.fx": "729.9"}, "a single number"),
        ({"table1.left.fx": None}, "a single number"),
        ({"fig.4": 3.0}, "is a claim"),
        ({"fig.4": "maybe"}, "is a claim"),
        ({"fig.4": "nothing"}, "is a claim"),
    ],
)
def test_bad_answers_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        compare(values)


def test_reason_without_row_is_refused():
    with pytest.raises(ValueError, match="not compared"):
        compare({"fig.4": True}, reasons={"fig.5": "why"})


GOOD = '["a.b"]\nvalue = 1\nwhere = "I"\ncomparability = "exact"\natol = 1.0\nreason = "r"\nnotebook = "01_x"\n'


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("reason", "raison"), "a.b: unknown .'raison'"),
        (('where = "I"\n', ""), "a.b: .*where"),
        (('"exact"', '"loose"'), "a.b: comparability 'loose'"),
        (("atol = 1.0\n", ""), "a.b: .*either atol or rtol"),
        (('"r"', '""'), "a.b: .*reason"),
    ],
)
def test_a_bad_published_file_names_its_entry(change, message):
    assert list(paper.parse(GOOD)) == ["a.b"]
    with pytest.raises(ValueError, match=message):
        paper.parse(GOOD.replace(*change))


def test_recorded_prefers_the_notebook_that_owns_the_id(tmp_path):
    assert published()["fig.4"].notebook == "03_sgbm_parameters"
    paper.record(compare({"fig.4": "no: a visitor"}), "01_calibration", tmp_path)
    paper.record(compare({"fig.4": True, "eq.depth": True}), "03_sgbm_parameters", tmp_path)
    paper.record(compare({"fig.4": "no: another", "fig.1": True}), "09_real_recordings", tmp_path)
    rows = paper.recorded(tmp_path)
    assert rows["id"].tolist() == ["fig.1", "eq.depth", "fig.4"]  # the paper's order
    assert rows["notebook"].tolist() == ["09_real_recordings", "03_sgbm_parameters", "03_sgbm_parameters"]
    assert rows["ours"].tolist() == ["yes", "yes", "yes"]


def test_record_keeps_rows_as_they_are(tmp_path):
    rows = compare({"setup.camera_height": 'a, "b"\u00b0', "claim.low_computation": None, "stereo.R": np.eye(3)})
    paper.record(rows, "07_pixel_cm", tmp_path)
    back = paper.recorded(tmp_path).set_index("id").loc[rows["id"]].reset_index()
    assert back[rows.columns.tolist()].equals(rows)


def test_record_goes_to_the_figures_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("STEREOLIB_FIGURES", str(tmp_path))
    paper.record(compare({"fig.1": True}), "01_calibration")
    assert (tmp_path / "tables" / "ledger_01_calibration.csv").is_file()
    assert paper.recorded()["id"].tolist() == ["fig.1"]


@pytest.mark.parametrize("name", ["calibration", "../01_x", "01_calibration.ipynb"])
def test_record_refuses_a_name_that_is_no_notebook(name, tmp_path):
    with pytest.raises(ValueError, match="01_calibration"):
        paper.record(compare({"fig.1": True}), name, tmp_path)


def test_record_refuses_other_rows(tmp_path):
    with pytest.raises(ValueError, match=r"compare\(\)"):
        paper.record(compare({"fig.1": True}).drop(columns="reason"), "01_calibration", tmp_path)


def test_recorded_refuses_nothing_and_strangers(tmp_path):
    with pytest.raises(ValueError, match="run the notebooks"):
        paper.recorded(tmp_path)
    (tmp_path / "tables").mkdir()
    (tmp_path / "tables" / "ledger_01_x.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ValueError, match=r"ledger_01_x\.csv is not a ledger"):
        paper.recorded(tmp_path)


def test_show_fits_and_loses_no_word():
    rows = compare({"claim.disparities_fall_with_distance": True, "stereo.E": paper.printed_essential()})
    table = repr(paper.show(rows))
    assert max(map(len, table.splitlines())) <= 120
    head, *blocks = (block.splitlines() for block in table.split("\n\n"))
    assert head[0].split() == ["id", "paper", "ours", "difference", "tolerance", "verdict", "reason"]
    starts = [head[0].index(name) for name in head[0].split()]
    for row, block in zip(rows.to_dict("records"), blocks, strict=True):
        for name, start, end in zip(head[0].split(), starts, [*starts[1:], None], strict=True):
            parts = [line[start:end].strip() for line in block]
            joined = ("" if name == "id" else " ").join(part for part in parts if part)
            assert joined == row[name]
