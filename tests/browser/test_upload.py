"""An own pair, uploaded: refused with its reason, or measured."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from support.browser import Page

from stereolib.notebook.explorer_controls import UPLOADS
from stereolib.notebook.knobs import OWN, VIRTUAL
from stereolib.virtual import recordings

NAME = "conditions/texture"


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    """A good pair with its calibration, and what is wrong with others."""
    left, right = recordings.load_pair(NAME)
    made = {name: tmp_path / f"{name}.png" for name in ("left", "right", "small", "text")}
    for name, picture in (("left", left), ("right", right), ("small", right[::2, ::2])):
        cv2.imwrite(str(made[name]), picture)
    made["text"].write_text("no picture")
    made["calibration"] = recordings.rectified().rig.save(tmp_path / "calibration.json")
    made["wrong"] = tmp_path / "wrong.json"
    made["wrong"].write_text('{"camera": 1}')
    return made


def upload(bench: Page, **chosen: Path) -> None:
    """Choose files, none left of an earlier test, and use them once the kernel has named each."""
    clear(bench)
    for name, path in chosen.items():
        with bench.page.expect_file_chooser() as chooser:
            bench.page.get_by_role("button", name=f"{name} (0)").click()
        chooser.value.set_files(str(path))
        bench.page.get_by_role("button", name=f"{name} (1)").wait_for()
        bench.page.locator(".stereolib-file").nth(UPLOADS.index(name)).get_by_text(path.name, exact=True).wait_for()
    bench.page.get_by_role("button", name="use this pair").click()


def clear(bench: Page) -> None:
    """Take the files out; a click that comes while the page changes may be lost, and is repeated once."""
    from playwright.sync_api import TimeoutError  # the other tests do without it

    bench.open_group("Own pair")
    button = bench.page.get_by_role("button", name="clear files")
    button.click()
    try:
        wait_until_empty(bench, timeout_ms=10_000)
    except TimeoutError:
        button.click()
        wait_until_empty(bench, timeout_ms=30_000)


def wait_until_empty(bench: Page, timeout_ms: int) -> None:
    for name in UPLOADS:
        bench.page.get_by_role("button", name=f"{name} (0)").wait_for(timeout=timeout_ms)
    bench.page.wait_for_function(
        "[...document.querySelectorAll('.stereolib-file')].every(one => one.innerText === 'no file')",
        timeout=timeout_ms,
    )


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"right": "text"}, "text.png"),
        ({"right": "small"}, "small.png"),
        ({"calibration": "wrong"}, "wrong.json"),
    ],
)
def test_what_cannot_be_used_is_said(bench: Page, files: dict[str, Path], wrong: dict[str, str], reason: str) -> None:
    chosen = {"left": files["left"], "right": files["right"]} | {name: files[bad] for name, bad in wrong.items()}
    upload(bench, **chosen)
    bench.page.locator(".stereolib-upload", has_text="Not used").wait_for()
    bench.page.wait_for_function(
        "reason => document.querySelector('.stereolib-upload').innerText.includes(reason)", arg=reason
    )
    assert OWN not in bench.page.locator(".stereolib-stories select option").all_inner_texts()
    assert "Traceback" not in bench.text("upload") and "/" not in bench.text("upload")  # no folder of ours


def test_a_good_pair_is_measured(bench: Page, files: dict[str, Path]) -> None:
    upload(bench, left=files["left"], right=files["right"], calibration=files["calibration"])
    bench.wait_for(f"source={OWN}")
    bench.page.locator(".stereolib-results", has_text="unknown").wait_for()
    assert bench.page.locator(".stereolib-stories select").input_value() == OWN
    assert "30.0" in bench.text("results").partition("ground plane")[2].split("cm")[0]
    assert bench.text("upload") == "" and not bench.problems
    assert "calibration calibration.json, no scan" in bench.text("said")


def test_files_are_named_and_can_be_taken_out_again(bench: Page, files: dict[str, Path]) -> None:
    upload(bench, left=files["left"], right=files["right"], calibration=files["calibration"])
    bench.wait_for(f"source={OWN}")
    names = bench.page.locator(".stereolib-file")
    assert names.all_inner_texts() == ["left.png", "right.png", "calibration.json", "no file"]
    clear(bench)
    assert names.all_inner_texts() == ["no file"] * 4
    upload(bench, left=files["left"], right=files["right"])
    bench.page.locator(".stereolib-results", has_text="needs a calibration").wait_for()
    bench.page.locator(".stereolib-said", has_text="no calibration, no scan").wait_for()


def test_reset_goes_to_the_start_also_after_an_upload(bench: Page, files: dict[str, Path]) -> None:
    upload(bench, left=files["left"], right=files["right"])
    bench.wait_for(f"source={OWN}")
    bench.page.get_by_role("button", name="Reset", exact=True).click()
    bench.wait_for("")
    assert bench.page.locator(".stereolib-stories select").input_value() == VIRTUAL


def test_a_pair_that_is_not_rectified_is_said_to_be_none(bench: Page, files: dict[str, Path], tmp_path: Path) -> None:
    right = tmp_path / "lower.png"
    left, moved = recordings.rectified().rectify(*recordings.load_pair(NAME))
    cv2.imwrite(str(files["left"]), left)
    cv2.imwrite(str(right), np.roll(moved, 4, axis=0))
    upload(bench, left=files["left"], right=right)
    bench.wait_for(f"source={OWN}")
    bench.page.locator(".stereolib-warnings", has_text="not rectified: the rows of right are 4.0 px too low").wait_for()
    assert "set-up's alone" in bench.text("results")
