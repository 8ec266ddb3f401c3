"""The finding says what the tables hold."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from stereolib.base import ROOT
from stereolib.reproduction.finding import finding


@pytest.fixture
def figures(tmp_path: Path) -> Path:
    shutil.copytree(ROOT / "figures" / "tables", tmp_path / "tables")
    return tmp_path


@pytest.mark.parametrize(
    ("table", "row", "column", "says"),
    [
        ("recipe_family", {"set-ups": "camera 8.5 cm up"}, "reads least cm", "alone gives 1.1 to "),
        (
            "recipe_family",
            {"set-ups": "0.70 m to its nearest point"},
            "reads most cm",
            " to 1.1 cm. With the true pose",
        ),
        ("recipe_thresholds", {"map": "perfect", "camera": "8.5 cm up"}, "cm", "px, gives 1.1 cm from perfect"),
        ("recipe_thresholds", {"map": "perfect", "camera": "8.5 cm up"}, "until px", "to 1.1 px below"),
        ("recipe_thresholds", {"map": "SGBM", "camera": "8.5 cm up"}, "cm", "1.1 cm from matched"),
        ("height_recordings", {"distance mm": 700}, "recipe off cm", "is 1.1 cm or more"),
        ("height_recordings", {}, "plane off mm", "measures 8 of these 8 and 23 of all 23, to within 1.10 mm"),
        ("recipe_family", {"set-ups": "0.70 m to the edge's line"}, "highest cm", "to 1 cm above the floor"),
    ],
)
def test_every_number_comes_from_its_table(figures: Path, table: str, row: dict, column: str, says: str) -> None:
    assert says not in finding(figures)
    path = figures / "tables" / f"{table}.csv"
    rows = pd.read_csv(path, dtype=object, keep_default_na=False)
    chosen = np.all([rows[name] == str(value) for name, value in row.items()] or [rows[column] != "x"], axis=0)
    rows.loc[chosen, column] = "1.1"
    rows.to_csv(path, index=False)
    assert says in finding(figures)


@pytest.mark.parametrize("table", ["recipe_family", "recipe_thresholds", "recipe_one_threshold", "height_recordings"])
def test_a_missing_or_other_table_is_named(figures: Path, table: str) -> None:
    path = figures / "tables" / f"{table}.csv"
    for spoil in (lambda: path.write_text("a,b\n1,2\n"), path.unlink):
        spoil()
        with pytest.raises(ValueError, match=r"make reproduce|no such file"):
            finding(figures)
