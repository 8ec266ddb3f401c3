"""Pages that move without Python: whole, small, the same twice; tests/browser moves them."""

from __future__ import annotations

import base64
import io
import json
import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from stereolib import notebook
from stereolib.cli import main
from stereolib.matching import SGBMParams, compute_disparity, pixel_cost, score
from stereolib.notebook import baked
from stereolib.notebook.baked import PAGES, Baked, bake
from stereolib.virtual import recordings


def tinted(size: int, colour: str) -> tuple[np.ndarray, str]:
    """Draw a plain picture.

    Parameters
    ----------
    size : int
        How "bright" < it is.
    colour : str
    """
    return np.full((40, 60, 3), 10 * size, np.uint8), f"size {size} </script> & {colour}"


PLAIN = Baked("99_plain", "99. Plain", "Turn.", tinted, {"size": (5, (1, 5, 9)), "colour": ("b", ("a", "b"))})


def page_data(text: str) -> dict:
    return json.loads(re.search(r"^const baked = (.*);$", text, re.MULTILINE)[1])


@pytest.fixture(scope="module")
def first_page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return bake(tmp_path_factory.mktemp("baked"), PAGES[:1])[0]


def test_each_chapter_has_its_page_with_a_handful_of_positions() -> None:
    assert [page.stem[:2] for page in PAGES] == [f"{k:02d}" for k in range(11)]
    for page in PAGES:
        assert 8 <= len(page.positions) <= 25 and len(page.knobs) <= 2, page.stem
        assert page.positions[page.first].keys() == page.knobs.keys()


def test_two_bakes_give_the_same_bytes(tmp_path: Path) -> None:
    few = replace(PAGES[0], knobs={"baseline_mm": (100, (100, 200)), "distance_mm": (700, (700, 1400))})
    (first, _), (again, index) = (bake(tmp_path / folder, [few]) for folder in ("first", "again"))
    assert again.read_bytes() == first.read_bytes()
    assert f'href="{again.name}"' in index.read_text(encoding="utf-8")


def test_page_is_small_and_asks_for_nothing(first_page: Path) -> None:
    text = first_page.read_text(encoding="utf-8")
    assert first_page.stat().st_size <= 1_500_000
    outside = re.sub(r"data:image/webp;base64,[\w+/=]+", "", text)
    assert not re.search(r"https?:|//\w|url\(|@import|fetch\(|<link|src=\"(?!\")", outside)
    assert "default-src 'none'" in text


def test_every_position_has_its_text_and_its_picture(first_page: Path) -> None:
    from PIL import Image

    text, page = first_page.read_text(encoding="utf-8"), PAGES[0]
    data = page_data(text)
    (first,) = re.findall(r'<img[^>]* src="([^"]+)"', text)
    assert data["pictures"][page.first] is None
    addresses = [address or first for address in data["pictures"]]
    assert len(set(addresses)) == len(page.positions) == len(data["texts"])
    for position, said in zip(page.positions, data["texts"], strict=True):
        disparity_px = 730 * position["baseline_mm"] / position["distance_mm"]
        assert said.startswith(f"disparity of the near edge {disparity_px:.1f} px")
    picture = Image.open(io.BytesIO(base64.b64decode(addresses[-1].partition(",")[2])))
    assert 900 < picture.width <= baked._WIDEST_PX
    assert f'alt="{data["texts"][page.first]}"' in text  # what stands there without JavaScript


def test_texts_cannot_break_the_page(tmp_path: Path) -> None:
    text = bake(tmp_path, [PLAIN])[0].read_text(encoding="utf-8")
    assert text.count("</script>") == 1
    assert page_data(text)["texts"][3] == "size 5 </script> & b"
    assert unescape(re.search(r'title="([^"]*)"', text)[1]) == 'How "bright" < it is.'
    assert page_data(text)["knobs"] == [["1", "5", "9"], ["a", "b"]]


def test_what_does_not_fit_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (900, 900, 3), np.uint8)
    page = Baked("98_noise", "98. Noise", "Turn.", lambda k: (noise + np.uint8(k), "noise"), {"k": (0, range(25))})
    monkeypatch.setattr(baked, "_QUALITIES", (35,))
    with pytest.raises(ValueError, match=r"98_noise\.html has 25 pictures, too many"):
        bake(tmp_path, [page])


def test_command_writes_pages_and_does_not_replace_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(baked, "PAGES", (PLAIN,))
    monkeypatch.setattr(baked.bake, "__defaults__", ((PLAIN,), *baked.bake.__defaults__[1:]))
    assert main(["bake", str(tmp_path / "new")]) == 0
    assert {path.name for path in (tmp_path / "new").iterdir()} == {"index.html", "99_plain.html"}
    assert main(["bake", str(tmp_path / "new")]) == 2
    assert "would be overwritten" in capsys.readouterr().err
    assert main(["bake", str(tmp_path / "new"), "--force"]) == 0


def test_prices_in_the_wrong_order_are_refused_in_the_sliders_numbers() -> None:
    for refused in (lambda: notebook.draw_prices(8, 4), lambda: notebook.draw_sgbm("texture", 128, 5, 10, 8, 8)):
        with pytest.raises(ValueError, match=r"must be above P1, got P1 8 and P2 [48]$"):
            refused()


def test_prices_say_what_the_matcher_and_its_costs_find() -> None:
    truth = recordings.load_truth("conditions/glare")
    pair = recordings.rectified().rectify(*recordings.load_pair("conditions/glare"))
    params = SGBMParams(128, p1=25 * 4, p2=25 * 26)
    quality = score(compute_disparity(*pair, params), truth.disparity_px, truth.visible & (truth.box == 1))
    picture, text = notebook.draw_prices(4, 26, "glare")
    assert picture.ndim == 3 and text.startswith(f"bad 2 on the cube: {quality.bad2_pct:.1f} %; ")
    assert f"cheapest at {pixel_cost(*pair, (330, 250), params).best_px} px" in text
