"""The ledger judges fairly, keeps what it is given, and shows every word of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stereolib import paper
from stereolib.paper import compare_with_paper, ledger, published
from stereolib.paper.printed_values import Condition

GLARE = {"points": 82.4}
DILATION = {name: 0.0 for name in published()["claim.dilation_removes_noise"].conditions}


def test_verdicts():
    """Every verdict, from numbers alone."""
    rows = compare_with_paper(
        {
            "table1.left.fx": 729.9077 * 1.0007,
            "table1.left.fy": 729.4782 * 1.0009,
            "scale.cm_per_px": 42 / 362,
            "scale.width_cm": 43.0,
            "height.cube": [30.05, 30.0],
            "scale.width_faces": 42.6,
            "claim.glare_on_object": GLARE,
            "claim.glare_on_ground": {"points": 1.0},
            "claim.low_computation": None,
            "fig.1": None,
        },
        reasons={"scale.cm_per_px": "a quotient"},
        tolerances={"table1.left.fx": 0.55, "table1.left.fy": 0.57},
    ).set_index("id")
    assert rows["verdict"].tolist() == [
        *(
            "recovered",
            "not recovered",
            "consistent",
            "paper contradicts itself",
            "meets the truth",
            "misses the truth",
        ),
        *("agrees", "does not hold", "not comparable", "redrawn"),
    ]
    row = rows.loc["scale.cm_per_px"]
    assert row.tolist() == [
        "IV",
        "argument",
        "print",
        "0.116",
        "0.1160",
        "+0.0000",
        "0.0005",
        "cm/px",
        "consistent",
        "a quotient",
    ]
    assert rows.loc["table1.left.fy", "reason"] == published()["table1.left.fy"].reason
    assert rows.loc["claim.low_computation", "ours"] == "-"


@pytest.mark.parametrize("held", range(4))
def test_a_claim_holds_by_its_conditions_alone(held, monkeypatch):
    """All three hold, two, one, none: the verdict counts them, and the text says which."""
    because = ("so", "as above", "so")
    conditions = {f"c{k}": {"says": f"{k}: {{}} px", "because": because[k], "least": 1.0} for k in range(3)}
    item = replace(published()["lrf.resolution"], conditions=conditions)
    monkeypatch.setattr(ledger, "printed_item", lambda id: item)
    (row,) = compare_with_paper({"lrf.resolution": {f"c{k}": float(k < held) for k in range(3)}}).to_dict("records")
    assert row["verdict"] == ("does not hold", "holds in part", "holds in part", "agrees")[held]
    assert row["ours"] == "; ".join(f"{k}: {int(k < held)} px: {'yes' if k < held else 'no'}" for k in range(3))
    assert row["difference"] == f"{held} of 3 hold"
    assert row["tolerance"] == "at least 1; at least 1; at least 1"
    assert row["reason"].endswith("At least 1: so. At least 1: so.")
    assert "as above" not in row["reason"]


@pytest.mark.parametrize(
    ("limits", "value", "holds"),
    [
        ({"least": 2}, 2.0, True),
        ({"least": 2}, 1.99, False),
        ({"most": 2}, 2.0, True),
        ({"most": 2}, 2.01, False),
        ({"least": 1, "most": 2}, 1.5, True),
        ({"least": 1, "most": 2}, 2.5, False),
        ({"least": 1, "most": 2}, 0.5, False),
        ({"most": 2}, np.nan, False),
        ({"least": 2}, np.nan, False),
        ({"least": 2}, np.inf, True),
    ],
)
def test_a_condition_keeps_its_limits(limits, value, holds):
    assert Condition("{}", "so", **limits).holds(value) is holds


def test_a_computed_tolerance_decides():
    printed = np.array(published()["check.F_from_E_K"].value)
    off = printed + 2e-4
    for tolerance, verdict in ((3e-4, "consistent"), (1e-4, "paper contradicts itself")):
        rows = compare_with_paper(
            {"check.F_from_E_K": off}, tolerances={"check.F_from_E_K": np.full((3, 3), tolerance)}
        )
        assert rows.loc[0, "verdict"] == verdict
    with pytest.raises(ValueError, match="its tolerance is computed"):
        compare_with_paper({"check.F_from_E_K": off})
    with pytest.raises(ValueError, match="its tolerance is not computed"):
        compare_with_paper({"scale.cm_per_px": 1.0}, tolerances={"scale.cm_per_px": 1.0})


def test_matrix_tolerance_is_element_by_element():
    """stereo.T may move 0.2 mm along the axis but 0.04 mm across it."""
    printed, allowed = published()["stereo.T"].value, {"stereo.T": [0.04, 0.03, 0.2]}
    along, across = (
        compare_with_paper({"stereo.T": np.add(printed, [0, 0, 0.19])}, tolerances=allowed),
        compare_with_paper({"stereo.T": np.add(printed, [0.1, 0, 0])}, tolerances=allowed),
    )
    assert along.loc[0, ["difference", "tolerance", "verdict"]].tolist() == ["max 0.19", "0.03 to 0.2", "recovered"]
    assert across.loc[0, "verdict"] == "not recovered"


@pytest.mark.parametrize("side", [-1, 1])
def test_the_tolerance_itself_counts(side):
    assert compare_with_paper({"scale.width_cm": 42 + side * 0.5}).loc[0, "verdict"] == "consistent"
    assert compare_with_paper({"scale.width_cm": 42 + side * 0.501}).loc[0, "verdict"] == "paper contradicts itself"


def test_nan_is_never_right():
    assert compare_with_paper({"scale.width_faces": np.nan}).loc[0, "verdict"] == "misses the truth"
    assert compare_with_paper({"claim.glare_on_object": {"points": np.nan}}).loc[0, "verdict"] == "does not hold"


def test_numbers_are_rounded_and_minus_zero_is_not_shown():
    printed = np.array(published()["stereo.F"].value)
    allowed = {"stereo.F": np.full((3, 3), 1e-4)}
    first, second = (compare_with_paper({"stereo.F": printed - e}, tolerances=allowed) for e in (1e-9, -1e-9))
    assert first.equals(second)
    assert "-0.0000" not in first.to_csv()
    assert first.loc[0, "paper"] == "0.0000 0.0000 0.0016; 0.0000 0.0000 0.1269; -0.0018 -0.1274 0.6250"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"table1.left.fz": 1.0}, "near it: .*table1.left.fx"),
        ({"setup.cube": [1, 2]}, r"shape \(3,\)"),
        ({"scale.cm_per_px": [0.116]}, "a single number"),
        ({"scale.cm_per_px": "0.116"}, "a single number"),
        ({"scale.cm_per_px": None}, "a single number"),
        ({"claim.glare_on_object": 3.0}, r"is a claim: give \['points'\]"),
        ({"claim.glare_on_object": True}, "is a claim"),
        ({"claim.glare_on_object": "yes: certainly"}, "is a claim"),
        ({"claim.glare_on_object": {}}, "is a claim"),
        ({"claim.glare_on_object": {"points": 3.0, "more": 1.0}}, "is a claim"),
    ],
)
def test_bad_answers_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        compare_with_paper(values)


def test_reason_without_row_is_refused():
    with pytest.raises(ValueError, match="not compared"):
        compare_with_paper({"fig.1": None}, reasons={"fig.5": "why"})


def test_recorded_prefers_the_notebook_that_owns_the_id(tmp_path):
    id = "claim.glare_on_object"
    assert published()[id].notebook == "03_sgbm_parameters"
    paper.record_rows(compare_with_paper({id: {"points": 1.0}}), "01_calibration", tmp_path)
    paper.record_rows(compare_with_paper({id: GLARE, "fig.2": None}), "03_sgbm_parameters", tmp_path)
    paper.record_rows(compare_with_paper({id: {"points": 2.0}, "fig.1": None}), "09_real_recordings", tmp_path)
    rows = paper.recorded_rows(tmp_path)
    assert rows["id"].tolist() == ["fig.1", "fig.2", id]  # the paper's order
    assert rows["notebook"].tolist() == ["09_real_recordings", "03_sgbm_parameters", "03_sgbm_parameters"]
    assert rows["ours"].tolist()[-1].startswith("82 points")


def test_record_keeps_rows_as_they_are(tmp_path):
    values = {"height.printed": 'a, "b"\u00b0', "claim.low_computation": None, "stereo.R": np.eye(3)}
    rows = compare_with_paper(values, tolerances={"stereo.R": np.full((3, 3), 0.01)})
    paper.record_rows(rows, "07_pixel_cm", tmp_path)
    back = paper.recorded_rows(tmp_path).set_index("id").loc[rows["id"]].reset_index()
    assert back[rows.columns.tolist()].equals(rows)


def test_record_goes_to_the_figures_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("STEREOLIB_FIGURES", str(tmp_path))
    paper.record_rows(compare_with_paper({"fig.1": None}), "01_calibration")
    assert (tmp_path / "tables" / "ledger_01_calibration.csv").is_file()
    assert paper.recorded_rows()["id"].tolist() == ["fig.1"]


@pytest.mark.parametrize("name", ["calibration", "../01_x", "01_calibration.ipynb"])
def test_record_refuses_a_name_that_is_no_notebook(name, tmp_path):
    with pytest.raises(ValueError, match="01_calibration"):
        paper.record_rows(compare_with_paper({"fig.1": None}), name, tmp_path)


def test_record_refuses_other_rows(tmp_path):
    with pytest.raises(ValueError, match=r"compare_with_paper\(\)"):
        paper.record_rows(compare_with_paper({"fig.1": None}).drop(columns="reason"), "01_calibration", tmp_path)


def test_recorded_refuses_nothing_and_strangers(tmp_path):
    with pytest.raises(ValueError, match="run the notebooks"):
        paper.recorded_rows(tmp_path)
    (tmp_path / "tables").mkdir()
    (tmp_path / "tables" / "ledger_01_x.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ValueError, match=r"ledger_01_x\.csv is not a ledger"):
        paper.recorded_rows(tmp_path)


def test_show_fits_and_loses_no_word():
    values = {"claim.dilation_removes_noise": DILATION, "check.E_from_R_T": paper.printed_essential()}
    rows = compare_with_paper(values, tolerances={"check.E_from_R_T": paper.essential_budget()})
    table = repr(paper.show_rows(rows))
    assert max(map(len, table.splitlines())) <= 120
    head, *blocks = (block.splitlines() for block in table.split("\n\n"))
    assert head[0].split() == ["id", "kind", "paper", "ours", "difference", "tolerance", "verdict", "reason"]
    starts = [head[0].index(name) for name in head[0].split()]
    for row, block in zip(rows.to_dict("records"), blocks, strict=True):
        for name, start, end in zip(head[0].split(), starts, [*starts[1:], None], strict=True):
            parts = [line[start:end].strip() for line in block]
            joined = ("" if name == "id" else " ").join(part for part in parts if part)
            assert joined == row[name]


def test_what_is_not_known_does_not_hold_and_says_so():
    (row,) = compare_with_paper({"claim.glare_on_object": {"points": np.nan}}).to_dict("records")
    assert row["ours"].startswith("unknown points") and row["ours"].endswith(": no")


@pytest.mark.parametrize(
    ("kind", "against", "verdicts"),
    [
        ("test", "truth", ["misses the truth", "misses the truth", "meets the truth"]),
        ("built in", "claim", ["does not follow", "follows in part", "follows"]),
        ("argument", "itself", ["paper contradicts itself", "paper contradicts itself", "consistent"]),
    ],
)
def test_conditions_have_the_words_of_what_they_are_held_against(kind, against, verdicts, monkeypatch):
    conditions = {name: {"says": "{} px", "because": "so", "least": 1.0} for name in "ab"}
    item = replace(published()["fig.4"], kind=kind, against=against, conditions=conditions)
    monkeypatch.setattr(ledger, "printed_item", lambda id: item)
    values = ({"a": 0, "b": 0}, {"a": 1, "b": 0}, {"a": 1, "b": 1})
    assert [compare_with_paper({"fig.4": ours}).loc[0, "verdict"] for ours in values] == verdicts


def test_data_are_named():
    rows = compare_with_paper({"scale.cm_per_px": 42 / 362, "setup.distance": 0.7, "fig.1": None})
    assert rows["data"].tolist() == ["print", "virtual rig", "virtual rig"]
    with pytest.raises(ValueError, match="data 'guess' is none of"):
        replace(published()["fig.4"], data="guess")


def test_a_row_of_the_library_s_own_method_tells_its_reader_so():
    with pytest.raises(ValueError, match="method 'ours' is none of"):
        replace(published()["fig.4"], method="ours")
    for name, item in published().items():
        assert ("stereolib" in (item.what or str(item.value))) is (item.method == "stereolib's"), name
