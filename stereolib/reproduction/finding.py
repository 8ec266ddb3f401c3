"""The main finding in words, every number taken from the tables that the notebooks wrote."""

from __future__ import annotations

from html import escape
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jinja2
from markupsafe import Markup

from stereolib.base import read_text
from stereolib.paper import recorded_rows

if TYPE_CHECKING:
    import pandas as pd

_PRINTED = "camera 8.5 cm up"  # how notebook 06 names the set-ups with the printed camera height ...
_LINE = "0.70 m to the edge's line"  # ... those with any ...
_WIDEST = "0.70 m to its nearest point"  # ... and with any, in the other reading of the distance
_CAMERA = "8.5 cm up"
_STDS_95 = 1.96  # standard deviations that hold 95 %


def finding(figures: Path, *, short: bool = False) -> str:
    """What the paper's recipe reads, over every threshold and every camera that fits what is printed.

    Parameters
    ----------
    figures : Path
        With ``tables/recipe_*.csv``, ``tables/height_recordings.csv`` and the recorded ledger.
    short : bool
        In three sentences.

    Returns
    -------
    str
        One paragraph, plain text.

    Raises
    ------
    ValueError
        If a table is missing or lacks what is quoted: run notebook 06.
    """
    try:
        name = "finding_short.txt.jinja" if short else "finding.txt.jinja"
        text = templates().get_template(name).render(**_quoted(figures))
    except (KeyError, IndexError) as error:
        raise ValueError(f"{figures / 'tables'} lacks what notebook 06 writes ({error}): run make reproduce") from error
    return " ".join(text.split())


def _quoted(figures: Path) -> dict[str, Any]:
    """What the template quotes."""
    names = "recipe_family", "recipe_thresholds", "recipe_one_threshold", "height_recordings"
    family, thresholds, one, seen = (_table(figures, name) for name in names)
    printed, line, widest = (family[family["set-ups"] == name] for name in (_PRINTED, _LINE, _WIDEST))
    at_camera = thresholds[thresholds["camera"] == _CAMERA].set_index("map")
    meant, known = seen[seen["distance mm"] == 700], seen["plane off mm"].notna()
    rows = recorded_rows(figures).set_index("id")
    return {
        "printed_cm": (printed["reads least cm"].min(), printed["reads most cm"].max()),
        "perfect": at_camera.loc["perfect"].to_dict(),
        "sgbm": at_camera.loc["SGBM"].to_dict(),
        "other_cm": one.set_index("seen").loc["cube of 20 cm"].iloc[0],
        "line": line.iloc[0].to_dict(),
        "widest": widest.iloc[0].to_dict(),
        "off_px": rows["difference"]["scale.width_px"].lstrip("+-"),
        "plane_cm": rows["ours"]["height.plane"],
        "ray_cm": rows["ours"]["height.cube"].split(),
        "meant": len(meant),
        "meant_measured": int(meant["plane off mm"].notna().sum()),
        "meant_least_cm": meant["recipe off cm"].min(),
        "every": len(seen),
        "measured": int(known.sum()),
        "worst_mm": seen["plane off mm"].abs().max(),
        "held": int((seen["plane off mm"].abs() <= _STDS_95 * seen["plane std mm"]).sum()),
        "mean_mm": seen["plane off mm"].mean(),
    }


def _table(figures: Path, name: str) -> pd.DataFrame:
    import pandas as pd

    return pd.read_csv(StringIO(read_text(figures / "tables" / f"{name}.csv")))


def templates() -> jinja2.Environment:
    """Templates of this room; quotes become the entities of `html.escape`, which the committed report has."""
    return jinja2.Environment(
        loader=jinja2.PackageLoader(__package__),
        autoescape=True,
        finalize=lambda value: value if isinstance(value, Markup) else Markup(escape(str(value))),
        trim_blocks=True,
        keep_trailing_newline=True,
    )
