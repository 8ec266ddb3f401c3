"""A capture as a page shows it: what is drawn, said and pressed."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from support.shows import small_show, write_show

from stereolib.calibration import CaptureSession, CaptureState, boards_per_cell
from stereolib.notebook import capture_view
from stereolib.notebook.capture_view import CAPTURE_BUTTONS, CAPTURE_TITLE, draw_capture
from stereolib.notebook.live_link import LINK, LiveLink, LiveView
from stereolib.notebook.live_page import LivePage, open_live_page
from stereolib.rig import LiveRig
from stereolib.virtual import recordings


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    return write_show(tmp_path_factory.mktemp("show"), small_show(4))


@pytest.fixture(scope="module")
def captured(
    tmp_path_factory: pytest.TempPathFactory, sources: tuple[str, str]
) -> tuple[CaptureSession, list[tuple[CaptureState, LiveView]]]:
    """A capture until its second pair, each state as it was drawn then."""
    session = CaptureSession(tmp_path_factory.mktemp("rig"), LiveRig(*sources), recordings.BOARD)
    drawn = []
    for state in session.run():
        drawn.append((state, draw_capture(session, state)))
        if state.taken == 2:
            break
    return session, drawn


def green(image: np.ndarray, plain: np.ndarray) -> np.ndarray:
    """Where the picture was tinted."""
    return (image.astype(int) - plain)[..., 1] - (image.astype(int) - plain)[..., 2] > 10


def test_what_boards_covered_is_green_in_both_pictures(captured) -> None:
    session, drawn = captured
    state, view = drawn[-1]
    views = session.watch.views
    for k, corners_px in enumerate((views.left_px, views.right_px)):
        plain = cv2.resize(state.pair[k], (560, 420), interpolation=cv2.INTER_LINEAR)
        covered = cv2.resize(
            (boards_per_cell(corners_px, (320, 240)) > 0).astype(np.uint8), (560, 420), interpolation=cv2.INTER_NEAREST
        ).astype(bool)
        tinted = green(view.images[k], plain)
        assert tinted[covered].mean() > 0.7 and tinted[~covered].mean() < 0.1
    first = drawn[0][1].images[0]
    assert not green(first, cv2.resize(drawn[0][0].pair.left, (560, 420))).mean() > 0.1, "nothing is taken yet"


def test_the_corners_are_drawn_where_they_are_ready_or_not(captured) -> None:
    _, drawn = captured
    for state, view in (drawn[0], drawn[-1]):
        color = capture_view._READY if state.name else capture_view._WAITING
        at = np.rint(state.look.corners_px[0] * (560 / 320)).astype(int)
        np.testing.assert_allclose(view.images[0][at[:, 1], at[:, 0]], np.tile(color, (len(at), 1)), atol=40)


def test_the_chart_has_a_dot_for_each_pair_and_a_red_one_for_now(captured) -> None:
    session, drawn = captured
    chart = drawn[-1][1].images[2].astype(int)
    red = (np.abs(chart - capture_view._NOW).max(axis=2) < 40).astype(np.uint8)
    count, _, _, centres = cv2.connectedComponentsWithStats(red)
    assert count == 3, "beside the paper: one for the tilt, one for the distance"
    tilt_deg = np.degrees(session.watch.places[-1, 3:])
    plane = np.array([[46, 24], [560 - 16, 420 - 2 * 40 - 30]])
    where = plane.mean(axis=0) + (plane[1] - plane[0]) / 2 * tilt_deg / 50
    assert np.linalg.norm(centres[1:] - where, axis=1).min() < 3


def test_the_page_says_what_to_do_and_what_was_taken(captured) -> None:
    session, drawn = captured
    assert "hold it still" in drawn[0][1].html and "0 of 20 pairs taken" in drawn[0][1].html
    last = drawn[-1][1].html
    assert "pair 02 is taken" in last and "2 of 20 pairs taken" in last
    assert str(session.watch.coverage) in last


def buttons(page: LivePage) -> dict[str, object]:
    return {button.description: button for button in page._row.children}


def test_its_end_is_shown_and_the_buttons_work(tmp_path: Path, sources: tuple[str, str]) -> None:
    session = CaptureSession(tmp_path, LiveRig(*sources), pairs=3)
    page, last = LivePage(CAPTURE_TITLE, CAPTURE_BUTTONS, lambda name: capture_view.press(session, name)), LiveView()
    for state in session.run():
        page.show(last := draw_capture(session, state))
    page.show(replace(last, is_last=True))
    for _ in range(500):
        if "has ended" in page._ended.value:
            break
        page._pictures._seen.wait(0.02)
    assert session.taken == 3 and len(list((tmp_path / "left").iterdir())) == 3
    assert all(button.disabled for button in buttons(page).values())
    again = CaptureSession(tmp_path / "more", LiveRig(*sources), pairs=3, every_s=float("inf"))
    waiting = LivePage(CAPTURE_TITLE, CAPTURE_BUTTONS, lambda name: capture_view.press(again, name))
    states = again.run()
    assert not next(states).name
    buttons(waiting)["take this pair"].click()
    assert next(states).name == "01" and not next(states).name
    buttons(waiting)["enough"].click()
    assert next(states, None) is None


def test_the_page_of_a_command_follows_it(monkeypatch: pytest.MonkeyPatch) -> None:
    link = LiveLink("cameras & co", {"take": "takes"})
    monkeypatch.setenv(LINK, link.environment[LINK])
    page = open_live_page()
    assert page is not None and "cameras &amp; co" in page.page.children[0].value
    buttons(page)["take"].click()
    pressed: list[str] = []
    for k in range(200):
        link.show(LiveView((np.full((8, 8, 3), 90, np.uint8),), ("grey",), f"<p>{k}</p>"))
        if pressed := link.pressed():
            break
        page._pictures._seen.wait(0.02)
    link.close()
    for _ in range(500):
        if page._ended.value:
            break
        page._pictures._seen.wait(0.02)
    assert pressed == ["take"] and page._pictures.captions == ["grey"]
    assert re.fullmatch(r"<p>\d+</p>", page._said.value) and "has ended" in page._ended.value


def test_without_a_command_the_page_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv(LINK, raising=False)
    assert open_live_page() is None
    assert "stereolib capture" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["live", "explore"])
def test_a_page_has_a_title_for_readers(name: str) -> None:
    told = json.loads((Path(capture_view.__file__).parent / f"{name}.ipynb").read_text(encoding="utf-8"))
    assert told["metadata"]["title"].startswith("stereolib: "), "else the tab shows the file's name"
