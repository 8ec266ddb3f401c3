"""What the README says of the benchmarks: with its goal, of today's code or not, and what was not told beside it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from stereolib.base import ROOT
from stereolib.reproduction import bench_tables, code_sha256

RESULTS = ROOT / "benchmarks" / "results"
LINES = [line for lines in bench_tables.bench_topics().values() for line in lines]
FILES = sorted({line.file for line in LINES})


def the_row(folder: Path, code: dict[str, object] | None, value: float = 0.02) -> str:
    (folder / "accuracy.json").write_text(json.dumps({"focal_error_pct": value} | ({"code": code} if code else {})))
    return folded(bench_tables.bench_table(folder))[0]


def folded(block: str) -> list[str]:
    """The rows of a block's folded tables."""
    rows = block.partition("<details>")[2].splitlines()
    return [row for row in rows if row.startswith("| ")][1:]


def test_a_row_says_when_the_code_has_changed_since(tmp_path: Path) -> None:
    rooms = ["base", "rig"]
    today = {"rooms": rooms, "sha256": code_sha256(rooms)}
    assert the_row(tmp_path, today) == "| focal lengths calibrated from virtual boards | 0.02 % off | at most 0.1 |"
    gone = {"rooms": [*rooms, "base/gone.py"]}
    for older in (None, today | {"sha256": "0" * 64}, today | {"rooms": ["base"]}, today | gone):
        assert "| 0.02 % off, measured with older code |" in the_row(tmp_path, older)


def test_the_count_says_how_much_is_of_older_code(tmp_path: Path) -> None:
    today = {"rooms": ["base"], "sha256": code_sha256(["base"])}
    (tmp_path / "dimensions.json").write_text(json.dumps({"silent_error_pct": 0, "code": today}))
    assert bench_tables.bench_table(tmp_path).startswith("**1 of 1 goals are met.**\n\n<details>")
    (tmp_path / "accuracy.json").write_text(json.dumps({"focal_error_pct": 0.02}))
    assert bench_tables.bench_table(tmp_path).startswith(
        "**2 of 2 goals are met.** Of the 2, 1 were measured with older"
    )


def test_a_row_says_when_its_goal_is_missed(tmp_path: Path) -> None:
    assert the_row(tmp_path, None, 0.11).endswith("| at most 0.1, **missed** |")


def test_what_misses_its_goal_stands_unfolded_and_is_counted(tmp_path: Path) -> None:
    """Of three goals one is missed; a line without a goal is in the fold only, one not measured nowhere."""
    (tmp_path / "accuracy.json").write_text(json.dumps({"focal_error_pct": 0.11, "baseline_error_mm": 0.01}))
    (tmp_path / "dimensions.json").write_text(json.dumps({"refused_pct": 20, "silent_error_pct": 0, "scenes": 9}))
    block = bench_tables.bench_table(tmp_path)
    shown, _, fold = block.partition("<details>")
    assert shown.startswith("**2 of 3 goals are met.**") and shown.count("\n| ") == 2 and "focal lengths" in shown
    assert "<summary>Calibration: 1 of 2 goals met</summary>" in fold
    assert "<summary>Sizes of virtual boxes: 1 of 1 goals met</summary>" in fold
    assert block.count("<details>") == block.count("</details>") == 2 and len(fold.split("lack a size")) == 2
    (tmp_path / "accuracy.json").unlink()
    head = "**1 of 1 goals are met.** Of the 1, all were measured with older code.\n\n<details>"
    assert bench_tables.bench_table(tmp_path).startswith(head)


def test_every_goal_can_be_missed() -> None:
    goals = {line.goal for line in LINES if line.goal}
    for goal in goals:
        assert not all(bench_tables.meets(value, goal) for value in (-1e9, 1e9)), goal


@pytest.mark.parametrize("name", FILES)
def test_every_result_is_there_with_the_values_that_labels_quote(name: str) -> None:
    result = json.loads((ROOT / "benchmarks" / "results" / f"{name}.json").read_text(encoding="utf-8"))
    for label, file, key, unit, _ in LINES:
        if file == name and bench_tables._look_up(result, key) is not None:
            for hole in bench_tables._HOLE.findall(label + unit):
                assert bench_tables._look_up(result, hole) is not None, (label, hole)


def test_virtual_stands_where_a_figure_comes_from_the_virtual_rig() -> None:
    from_pictures = ("accuracy", "dimensions", "study")
    for label, name, *_ in LINES:
        if name in from_pictures:
            assert "virtual" in label, label


def a_rig(**changed: object) -> dict[str, object]:
    """A row as `benchmarks/bench_rigs.py` writes it."""
    row = {
        "about": "nothing is wrong", "scenes": 200, "sizes": 500, "p95_pct": 1.5, "within_1_sigma_pct": 68.0,
        "within_2_sigma_pct": 95.0, "binomial_p": 1.0, "silent": 0, "silent_beyond_pct": 10.0, "refused": 3,
        "measurable": 150, "measurable_lacking_pct": 6.0, "wide": 140, "wide_lacking": 2,
        **{size: {"told": 100, "median_pct": 0.1} for size in ("length", "width", "height")}, "volume": {"told": 0},
    }  # fmt: skip
    return row | changed


def the_rig(folder: Path, name: str = "undisturbed", **changed: object) -> str:
    (folder / "rigs.json").write_text(json.dumps({"rows": {name: a_rig(**changed)}}))
    return folded(bench_tables.rigs_table(folder))[0]


def test_a_disturbed_rig_has_its_refusals_beside_its_errors(tmp_path: Path) -> None:
    row = the_rig(tmp_path)
    assert row == (
        "| nothing is wrong | 3 of 200 | 6 % of 150 (at most 10) | 2 of 140 | 500 | 0.1 / 0.1 / 0.1 / - | 1.5 | 95.0 "
        "| 68.0 | 0 beyond 10 % |"
    )


@pytest.mark.parametrize(
    "changed",
    [{"silent": 1}, {"measurable_lacking_pct": 10.1}, {"within_2_sigma_pct": 89.9, "binomial_p": 0.009},
     {"within_2_sigma_pct": 99.5, "binomial_p": 0.001}],
)  # fmt: skip
def test_a_disturbed_rig_says_which_goal_it_misses(tmp_path: Path, changed: dict[str, object]) -> None:
    assert the_rig(tmp_path, **changed).count("**missed**") == 1
    shown = bench_tables.rigs_table(tmp_path).partition("<details>")[0]
    assert shown.startswith("**0 of 1 rows meet all their goals.**") and shown.count("\n| nothing is wrong | ") == 1
    assert "missed" not in the_rig(tmp_path, within_2_sigma_pct=89.9, binomial_p=0.011)  # chance alone does that


def test_a_row_without_a_size_is_shown(tmp_path: Path) -> None:
    nothing = {size: {"told": 0} for size in ("length", "width", "height", "volume")}
    row = a_rig(sizes=0, binomial_p=None, refused=200, **nothing)
    del row["p95_pct"], row["within_1_sigma_pct"], row["within_2_sigma_pct"]
    (tmp_path / "rigs.json").write_text(json.dumps({"rows": {"undisturbed": row}}))
    assert "| 200 of 200 |" in bench_tables.rigs_table(tmp_path) and "- / - / - / -" in bench_tables.rigs_table(
        tmp_path
    )
