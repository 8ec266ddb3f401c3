"""The ledger judges fairly, keeps what it is given, and shows every word of it."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib import paper
from stereolib.paper import compare_with_paper, published


def test_verdicts():
    rows = compare_with_paper(
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
        compare_with_paper({"stereo.T": np.add(printed, [0, 0, 0.19])}),
        compare_with_paper({"stereo.T": np.add(printed, [0.1, 0, 0])}),
    )
    assert along.loc[0, ["difference", "tolerance", "verdict"]].tolist() == ["max 0.19", "0.03 to 0.2", "reproduced"]
    assert across.loc[0, "verdict"] == "differs"


@pytest.mark.parametrize("side", [-1, 1])
def test_the_tolerance_itself_counts(side):
    assert compare_with_paper({"scale.width_px": 362 + side * 4.0}).loc[0, "verdict"] == "reproduced"
    assert compare_with_paper({"scale.width_px": 362 + side * 4.01}).loc[0, "verdict"] == "differs"


def test_nan_differs():
    assert compare_with_paper({"scale.width_px": np.nan}).loc[0, "verdict"] == "differs"


def test_numbers_are_rounded_and_minus_zero_is_not_shown():
    printed = np.array(published()["stereo.F"].value)
    first, second = (compare_with_paper({"stereo.F": printed - e}) for e in (1e-9, -1e-9))
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
        compare_with_paper(values)


def test_reason_without_row_is_refused():
    with pytest.raises(ValueError, match="not compared"):
        compare_with_paper({"fig.4": True}, reasons={"fig.5": "why"})


def test_recorded_prefers_the_notebook_that_owns_the_id(tmp_path):
    assert published()["fig.4"].notebook == "03_sgbm_parameters"
    paper.record_rows(compare_with_paper({"fig.4": "no: a visitor"}), "01_calibration", tmp_path)
    paper.record_rows(compare_with_paper({"fig.4": True, "eq.depth": True}), "03_sgbm_parameters", tmp_path)
    paper.record_rows(compare_with_paper({"fig.4": "no: another", "fig.1": True}), "09_real_recordings", tmp_path)
    rows = paper.recorded_rows(tmp_path)
    assert rows["id"].tolist() == ["fig.1", "eq.depth", "fig.4"]  # the paper's order
    assert rows["notebook"].tolist() == ["09_real_recordings", "03_sgbm_parameters", "03_sgbm_parameters"]
    assert rows["ours"].tolist() == ["yes", "yes", "yes"]


def test_record_keeps_rows_as_they_are(tmp_path):
    values = {"setup.camera_height": 'a, "b"\u00b0', "claim.low_computation": None, "stereo.R": np.eye(3)}
    rows = compare_with_paper(values)
    paper.record_rows(rows, "07_pixel_cm", tmp_path)
    back = paper.recorded_rows(tmp_path).set_index("id").loc[rows["id"]].reset_index()
    assert back[rows.columns.tolist()].equals(rows)


def test_record_goes_to_the_figures_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("STEREOLIB_FIGURES", str(tmp_path))
    paper.record_rows(compare_with_paper({"fig.1": True}), "01_calibration")
    assert (tmp_path / "tables" / "ledger_01_calibration.csv").is_file()
    assert paper.recorded_rows()["id"].tolist() == ["fig.1"]


@pytest.mark.parametrize("name", ["calibration", "../01_x", "01_calibration.ipynb"])
def test_record_refuses_a_name_that_is_no_notebook(name, tmp_path):
    with pytest.raises(ValueError, match="01_calibration"):
        paper.record_rows(compare_with_paper({"fig.1": True}), name, tmp_path)


def test_record_refuses_other_rows(tmp_path):
    with pytest.raises(ValueError, match=r"compare_with_paper\(\)"):
        paper.record_rows(compare_with_paper({"fig.1": True}).drop(columns="reason"), "01_calibration", tmp_path)


def test_recorded_refuses_nothing_and_strangers(tmp_path):
    with pytest.raises(ValueError, match="run the notebooks"):
        paper.recorded_rows(tmp_path)
    (tmp_path / "tables").mkdir()
    (tmp_path / "tables" / "ledger_01_x.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ValueError, match=r"ledger_01_x\.csv is not a ledger"):
        paper.recorded_rows(tmp_path)


def test_show_fits_and_loses_no_word():
    rows = compare_with_paper({"claim.disparities_fall_with_distance": True, "stereo.E": paper.printed_essential()})
    table = repr(paper.show_rows(rows))
    assert max(map(len, table.splitlines())) <= 120
    head, *blocks = (block.splitlines() for block in table.split("\n\n"))
    assert head[0].split() == ["id", "paper", "ours", "difference", "tolerance", "verdict", "reason"]
    starts = [head[0].index(name) for name in head[0].split()]
    for row, block in zip(rows.to_dict("records"), blocks, strict=True):
        for name, start, end in zip(head[0].split(), starts, [*starts[1:], None], strict=True):
            parts = [line[start:end].strip() for line in block]
            joined = ("" if name == "id" else " ").join(part for part in parts if part)
            assert joined == row[name]
