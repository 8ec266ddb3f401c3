"""Sliders without Python: for each chapter one page of HTML that holds its pictures at a handful of positions."""

from __future__ import annotations

import base64
import io
import json
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

import cv2
import jinja2
from markupsafe import Markup

from stereolib.base import UInt8, write_atomic
from stereolib.matching import SMOOTHING_METHODS
from stereolib.notebook import camera_drawings, first_drawings, height_drawings, laser_drawings, matching_drawings
from stereolib.notebook.sliders import Drawing, label, parameter_help, short

#: The page that links all others.
INDEX = "index.html"
_MOST_BYTES = 1_500_000
_WIDEST_PX = 960
_QUALITIES = (85, 75, 65, 55, 45, 35)  # of WebP; the first with which a page is small enough


@dataclass(frozen=True)
class Baked:
    """A chapter's page.

    Parameters
    ----------
    stem : str
        Of its file.
    title : str
    try_this : str
        What to turn, and what to look at.
    draw : callable
        Takes the knobs and what is fixed by name; returns picture and text.
    knobs : dict of str to (first, values)
        What can be turned, and where it begins. One or two.
    fixed : dict of str to object
        Further arguments.
    """

    stem: str
    title: str
    try_this: str
    draw: Drawing
    knobs: dict[str, tuple[Any, Sequence[Any]]]
    fixed: dict[str, Any] = field(default_factory=dict)

    @property
    def file(self) -> str:
        """Name of the page."""
        return f"{self.stem}.html"

    @property
    def positions(self) -> list[dict[str, Any]]:
        """Values of the knobs at each position; those of the last knob change fastest."""
        values = [values for _, values in self.knobs.values()]
        return [dict(zip(self.knobs, chosen, strict=True)) for chosen in product(*values)]

    @property
    def first(self) -> int:
        """Number of the position that is shown first."""
        return self.positions.index({name: first for name, (first, _) in self.knobs.items()})


#: One page a chapter.
PAGES = (
    Baked(
        "00_two_pictures",
        "00. Two pictures",
        "Twice the baseline gives twice the disparity, twice the distance half of it. Which pairs of values give the "
        "same?",
        first_drawings.draw_two_pictures,
        {"baseline_mm": (100, (50, 100, 150, 200, 400)), "distance_mm": (700, (500, 700, 1000, 1400, 2000))},
        {"focal_length_px": 730, "columns": 2},
    ),
    Baked(
        "01_calibration",
        "01. Calibration",
        "Bend a lens: with the printed k3 of -2.28 it folds over in one corner. Bring k3 towards zero.",
        camera_drawings.draw_lens,
        {"k1": (-0.01, (-0.3, -0.01, 0.3)), "k3": (-2.28, (-3.0, -2.28, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0))},
        {"k2": 0.32, "p1": -0.0048},
    ),
    Baked(
        "02_rectification",
        "02. Rectification",
        "Believe, wrongly, that the right camera is turned or stands lower. How little puts a row beside its partner?",
        camera_drawings.draw_rectification,
        {"roll_error_deg": (0.0, (-1.0, -0.5, -0.1, 0.0, 0.1, 0.5, 1.0)), "rows_error_px": (0.0, (-2.0, 0.0, 2.0))},
        {"alpha": 0.0},
    ),
    Baked(
        "03_sgbm_parameters",
        "03. The matcher's prices",
        "P1 is the price of a small step in disparity, P2 that of a jump. With which does the ringed pixel, in the "
        "glare, find its true disparity?",
        matching_drawings.draw_prices,
        {"P1": (8, (1, 4, 8, 16, 24)), "P2": (32, (26, 32, 64, 100, 150))},
        {"condition": "glare"},
    ),
    Baked(
        "04_dilation",
        "04. Dilation and its rivals",
        "Which filter leaves the least of the cube wrong or missing? The paper dilates.",
        matching_drawings.draw_dilation,
        {"method": ("dilation", tuple(SMOOTHING_METHODS)), "size_px": (9, (5, 9))},
        {"condition": "poor_light", "with_truth": False},
    ),
    Baked(
        "05_lrf",
        "05. The laser",
        "More turns take noise away. What do they do about a reading that is always too long?",
        laser_drawings.draw_sweep,
        {"turns": (1, (1, 2, 5, 10, 30)), "bias_mm": (0.0, (0.0, 15.0, 30.0))},
        {"noise": 2.0, "albedo": 0.45, "distance_mm": 700, "yaw_deg": 45},
    ),
    Baked(
        "06_height",
        "06. The height",
        "The paper's recipe counts the rows of all pixels near the map's maximum. Turn the threshold, then tilt the "
        "camera.",
        height_drawings.draw_recipe,
        {"tolerance_px": (7.25, (0.0, 2.0, 5.0, 7.25, 12.0)), "pitch_deg": (8.25, (-20.0, -10.0, 0.0, 8.25, 12.0))},
        {"rows": 53, "dilate_px": 1},
    ),
    Baked(
        "07_pixel_cm",
        "07. Pixels and centimetres",
        "One constant for all distances: how wide does it read the cube as it moves and turns?",
        height_drawings.draw_width,
        {"distance_mm": (700, (500, 600, 700, 800, 1000, 1200)), "yaw_deg": (45, (0, 15, 30, 45))},
        {"pitch_deg": 8.25},
    ),
    Baked(
        "08_environment_map",
        "08. The environment map",
        "Put the laser's scan of station 5 (coloured) where the other stations saw the same walls (grey).",
        laser_drawings.draw_pose,
        {"x_mm": (1875, (1875, 1925, 1975, 2025, 2075)), "yaw_deg": (171.5, (171.5, 176.5, 181.5, 186.5, 191.5))},
        {"y_mm": -495},
    ),
    Baked(
        "09_real_recordings",
        "09. Real recordings",
        "A window that is too small loses the near parts first. A large block fills bare walls and eats the spokes.",
        matching_drawings.draw_motorcycle,
        {"num_disparities": (80, (16, 32, 48, 64, 80, 128)), "block_size": (5, (1, 5, 9, 15))},
        {"uniqueness_ratio": 10},
    ),
    Baked(
        "10_matching_beyond",
        "10. Matching, guided by the laser",
        "Left is what the laser leads to expect, right is what is matched around it. How far may the laser be believed "
        "in a wrong place?",
        matching_drawings.draw_guided,
        {"laser_off_mm": (0, (-120, -90, -60, -30, 0, 30, 60, 90, 120)), "margin_px": (8, (8, 16))},
        {"distance_mm": 700},
    ),
)


def bake(
    folder: Path, pages: Sequence[Baked] = PAGES, advance: Callable[[Baked], object] = lambda page: None
) -> list[Path]:
    """Draw pages at all their positions and write them, each a file that needs no other, and an index of them.

    Parameters
    ----------
    folder : Path
        Made if it is not there.
    pages : sequence of Baked
    advance : callable
        Told the page after each position.

    Returns
    -------
    list of Path
        The pages, then the index.

    Raises
    ------
    ValueError
        If a page has a position at which its knobs are refused, or does not fit into 1.5 MB.
    """
    written = []
    for page in pages:
        drawn = []
        for position in page.positions:
            drawn.append(page.draw(**position, **page.fixed))
            advance(page)
        written.append(write_atomic(folder / page.file, _small_enough(page, drawn)))
    return [*written, write_index(folder, pages)]


def write_index(folder: Path, pages: Sequence[Baked] = PAGES) -> Path:
    """Write the page that links the others.

    Parameters
    ----------
    folder : Path
        Made if it is not there.
    pages : sequence of Baked

    Returns
    -------
    Path
    """
    return write_atomic(folder / INDEX, _templates().get_template("baked_index.html.jinja").render(pages=pages))


def _small_enough(page: Baked, drawn: list[tuple[UInt8, str]]) -> str:
    """The page with the best pictures that fit."""
    texts = dict[int, str]()

    def is_small(quality: int) -> bool:
        texts[quality] = _page(page, drawn, quality)
        return len(texts[quality].encode()) <= _MOST_BYTES

    k = 0 if is_small(_QUALITIES[0]) else bisect_left(_QUALITIES, True, 1, key=is_small)  # mostly the first one fits
    if k < len(_QUALITIES):
        return texts[_QUALITIES[k]]
    raise ValueError(f"{page.file} has {len(drawn)} pictures, too many for {_MOST_BYTES / 1e6} MB")


def _page(page: Baked, drawn: list[tuple[UInt8, str]], quality: int) -> str:
    images = [_narrow(image) for image, _ in drawn]
    height, width = images[page.first].shape[:2]
    pictures = [_webp(image, quality) for image in images]
    first = pictures[page.first]
    others = [None if k == page.first else picture for k, picture in enumerate(pictures)]  # it is in the page already
    hints = parameter_help(page.draw)
    knobs = [
        {
            "name": name,
            "label": label(name),
            "help": hints.get(name, ""),
            "first": list(values).index(first_value),
            "values": [short(value) for value in values],
        }
        for name, (first_value, values) in page.knobs.items()
    ]
    data = {"knobs": [knob["values"] for knob in knobs], "texts": [text for _, text in drawn], "pictures": others}
    return (
        _templates()
        .get_template("baked.html.jinja")
        .render(
            page=page,
            knobs=knobs,
            text=drawn[page.first][1],
            picture={"address": Markup(first), "width": width, "height": height},
            data=Markup(json.dumps(data, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")),
        )
    )


def _narrow(image: UInt8) -> UInt8:
    height, width = image.shape[:2]
    if width <= _WIDEST_PX:
        return image
    narrow: UInt8 = cv2.resize(image, (_WIDEST_PX, round(height * _WIDEST_PX / width)), interpolation=cv2.INTER_AREA)
    return narrow


def _webp(image: UInt8, quality: int) -> str:
    from PIL import Image

    stream = io.BytesIO()
    # Method 2 of 6 takes two thirds of the time of the default 4, for 4 % more bytes.
    Image.fromarray(image[..., ::-1]).save(stream, format="webp", quality=quality, method=2)
    return f"data:image/webp;base64,{base64.b64encode(stream.getvalue()).decode('ascii')}"


def _templates() -> jinja2.Environment:
    return jinja2.Environment(loader=jinja2.PackageLoader(__package__), autoescape=True, trim_blocks=True)
