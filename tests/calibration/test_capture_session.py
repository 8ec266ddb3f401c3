"""Pairs taken into a folder: which, how often, and what is kept, gone on with and refused."""

from __future__ import annotations

import json
from contextlib import suppress
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest
from support.shows import small_show, write_show

from stereolib.base import UInt8
from stereolib.calibration import BoardLook, CaptureSession, Checkerboard, find_in_files
from stereolib.rig import CameraError, LiveRig, find_pairs
from stereolib.virtual import recordings

PLACES, HELD, ON_THE_WAY = 4, 6, 2  # of the show: pictures in a place, and to the next one


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    return write_show(tmp_path_factory.mktemp("show"), small_show(PLACES))


def session(
    folder: Path, sources: tuple[str, str], pairs: int = 2 * PLACES, board: Checkerboard | None = recordings.BOARD
) -> CaptureSession:
    return CaptureSession(folder, LiveRig(*sources), board, pairs=pairs)


def written(folder: Path) -> list[tuple[UInt8, UInt8]]:
    return [(cv2.imread(str(left)), cv2.imread(str(right))) for left, right in find_pairs(folder)]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, sources: tuple[str, str]) -> tuple[Path, list[tuple[int, str]]]:
    """A capture to the end of the show: its folder, and at which picture a pair was taken."""
    folder = tmp_path_factory.mktemp("whole") / "rig"
    states = list(session(folder, sources).run())
    return folder, [(k, state.name) for k, state in enumerate(states) if state.name]


def test_each_place_is_taken_once_while_the_board_is_still(whole: tuple[Path, list[tuple[int, str]]]) -> None:
    folder, taken = whole
    assert [name for _, name in taken] == [f"{k + 1:02d}" for k in range(PLACES)]
    places = [divmod(k, HELD + ON_THE_WAY) for k, _ in taken]
    assert [place for place, _ in places] == list(range(PLACES))
    assert all(0 < step < HELD for _, step in places), "not on the way, and not at the first sight of it"
    show = small_show(PLACES)
    for (k, _), pair in zip(taken, written(folder), strict=True):
        for seen, sent in zip(pair, (show.left[k], show.right[k]), strict=True):
            np.testing.assert_array_equal(seen, cv2.imdecode(np.frombuffer(sent, np.uint8), cv2.IMREAD_COLOR))


def test_the_notes_say_what_it_is_of(whole: tuple[Path, list[tuple[int, str]]], sources: tuple[str, str]) -> None:
    notes = json.loads((whole[0] / "capture.json").read_text())
    assert notes["board"] == {"kind": "checkerboard", "columns": 9, "rows": 6, "square_mm": 25.0, "aspect": 1.0}
    assert (notes["pairs"], notes["size"], notes["sources"]) == (PLACES, [320, 240], list(sources))
    assert notes["skew_p95_ms"] is None, "a recording has no moments"


def test_interrupted_nothing_taken_is_lost_and_it_goes_on(tmp_path: Path, sources: tuple[str, str]) -> None:
    first = session(tmp_path, sources)
    for state in first.run():
        if state.taken == 2:
            break
    before = written(tmp_path)
    again = session(tmp_path, sources)
    assert again.taken == 2
    names = [state.name for state in again.run() if state.name]
    assert names == ["03", "04"], "the places that it has are not taken again"
    for kept, old in zip(written(tmp_path), before, strict=False):
        np.testing.assert_array_equal(kept, old)
    views = find_in_files(*zip(*find_pairs(tmp_path), strict=True), recordings.BOARD, progress=False)
    assert again.watch is not None
    np.testing.assert_allclose(again.watch.views.left_px, views.left_px, atol=1e-3)
    np.testing.assert_allclose(again.watch.views.right_px, views.right_px, atol=1e-3)


def test_exchanged_cameras_are_told_after_the_third_pair(tmp_path: Path, sources: tuple[str, str]) -> None:
    """They are named, and what to do with what was taken; done so, it goes on."""
    other = session(tmp_path, (sources[1], sources[0]))
    with pytest.raises(ValueError, match=r"^left and right are exchanged: by 3 pairs of the board, ") as told:
        list(other.run())
    assert f"Name {sources[0]} first, and another folder than {tmp_path}" in str(told.value)
    with pytest.raises(ValueError, match="are exchanged"):
        list(session(tmp_path, (sources[1], sources[0])).run())
    (tmp_path / "left").rename(tmp_path / "between")
    (tmp_path / "right").rename(tmp_path / "left")
    (tmp_path / "between").rename(tmp_path / "right")
    assert [state.name for state in session(tmp_path, sources).run() if state.name] == ["04"]


def test_pairs_taken_the_other_way_round_are_not_gone_on_with(tmp_path: Path, sources: tuple[str, str]) -> None:
    """Whichever of both ways was the right one; with other cameras it goes on, unless the pairs show the wrong one."""
    swapped = sources[::-1]
    for name, first in (("wrong", swapped), ("right", sources)):
        with suppress(ValueError):
            list(islice(session(tmp_path / name, first, 4).run(), 30))
        with pytest.raises(ValueError, match=r"^the \d pairs in .* were taken with left = ") as told:
            session(tmp_path / name, first[::-1])
        now = f"left = {first[1]}, right = {first[0]}"
        assert f"{tmp_path / name} were taken with left = {first[0]}, right = {first[1]}; now it is {now}" in str(
            told.value
        )
    other = write_show(tmp_path / "other_show", small_show(PLACES))
    assert session(tmp_path / "right", other).before == sources
    with pytest.raises(ValueError, match="give another folder, or delete them"):
        session(tmp_path / "wrong", other)


def test_without_a_board_the_order_is_known_by_the_notes(tmp_path: Path, sources: tuple[str, str]) -> None:
    list(session(tmp_path, sources, 1, board=None).run())
    assert session(tmp_path, sources, 2, board=None).before == ()
    with pytest.raises(ValueError, match=r"^the 1 pair in .* was taken with left = .*delete it$"):
        session(tmp_path, sources[::-1], 2, board=None)


@pytest.mark.parametrize("damaged", [5, None, "ab", ["1"], [1, 2]])
def test_notes_without_two_sources_are_refused(tmp_path: Path, sources: tuple[str, str], damaged: object) -> None:
    list(session(tmp_path, sources, 1, board=None).run())
    notes = json.loads((tmp_path / "capture.json").read_text())
    (tmp_path / "capture.json").write_text(json.dumps(notes | {"sources": damaged}))
    with pytest.raises(ValueError, match=r"^.*capture\.json: two names of cameras are expected as sources, got "):
        session(tmp_path, sources, 2, board=None)


def test_a_side_without_a_partner_is_replaced(tmp_path: Path, sources: tuple[str, str]) -> None:
    list(islice(session(tmp_path, sources, 2).run(), 12))
    (tmp_path / "right" / "02.png").unlink()
    again = session(tmp_path, sources, 2)
    assert again.taken == 1
    assert [state.name for state in again.run() if state.name][:1] == ["02"]
    assert len(written(tmp_path)) >= 2


def test_what_is_lacking_is_waited_for_up_to_twice_as_many_pairs(tmp_path: Path, sources: tuple[str, str]) -> None:
    few = session(tmp_path / "few", sources, 2)
    states = list(few.run())
    assert few.watch is not None and few.watch.coverage is not None
    assert few.taken == 4 and few.watch.coverage.missing and states[-1].said.startswith("so far, no ")
    hasty = CaptureSession(tmp_path / "hasty", LiveRig(*sources), recordings.BOARD, pairs=2, patience_s=0.25)
    list(hasty.run())
    assert hasty.taken == 2


def test_where_nothing_new_comes_it_says_what_is_still_empty(tmp_path: Path, sources: tuple[str, str]) -> None:
    first = session(tmp_path, sources)
    assert not [state.stuck for state in first.run() if state.stuck]
    assert first.ended == "since the recording ended"
    again = CaptureSession(tmp_path, LiveRig(*sources), recordings.BOARD, patience_s=0.45)
    stuck = [state.stuck for state in islice(again.run(), 7)]
    assert not any(stuck[:5]) and all(stuck[5:]) and again.taken == PLACES
    assert again.watch is not None and again.watch.coverage is not None and again.watch.coverage.missing
    missing = again.watch.coverage.missing
    assert stuck[-1].startswith(f"nothing new for 1 s, {PLACES} of 20 pairs taken; still empty: {missing[0]}")
    assert all(text in stuck[-1] for text in missing)


def test_a_board_that_is_never_seen_is_said_with_what_it_should_be(tmp_path: Path, sources: tuple[str, str]) -> None:
    wrong = CaptureSession(tmp_path, LiveRig(*sources), Checkerboard(11, 8, 25.0), patience_s=0.5)
    *_, last = (state.stuck for state in islice(wrong.run(), 7))
    assert "no board of 11x8 inner corners is seen: count corners, not squares; a board of 9x6 is there" in last


@pytest.mark.parametrize("noise", [0, 1])
def test_a_film_that_begins_again_ends_it_and_a_camera_that_sees_the_same_does_not(
    tmp_path: Path, sources: tuple[str, str], noise: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    again = CaptureSession(tmp_path, LiveRig(*sources), recordings.BOARD, patience_s=1.0)
    shown, rng = list(LiveRig(*sources).pairs()), np.random.default_rng(0)
    look = BoardLook((None, None), 0.0, (1.0, 1.0), None, "this place is taken; so far, no views")
    assert again.watch is not None
    monkeypatch.setattr(again.watch, "look", lambda *_: look)
    frozen = [shown[-1]] * 40 if noise else []

    def pairs():
        for pair in [*shown * 3, *frozen]:
            yield pair._replace(left=pair.left + rng.integers(0, 2, pair.left.shape, np.uint8) * noise)

    again.rig.pairs = pairs  # type: ignore[method-assign]
    seen = sum(1 for _ in again.run())
    if noise:
        assert (seen, again.ended) == (len(shown) * 3 + 40, "since the recording ended")
    else:
        assert len(shown) < seen < 2 * len(shown) and again.ended.startswith("since the same pictures come again")


def test_a_pair_is_taken_when_asked_though_the_board_moves(tmp_path: Path, sources: tuple[str, str]) -> None:
    asked = session(tmp_path, sources)
    asked.take_now()
    states = asked.run()
    assert next(states).name == "01", "the first look, at which nothing is still yet"
    asked.finish()
    assert not list(states)
    assert not next(asked.run()).name, "one pair for one press"


def test_without_a_board_pairs_are_taken_in_turn(tmp_path: Path, sources: tuple[str, str]) -> None:
    turn = CaptureSession(tmp_path, LiveRig(*sources), pairs=4, every_s=0.25)
    assert [bool(state.name) for state in turn.run()] == [True, False, False] * 3 + [True]
    assert len(written(tmp_path)) == turn.taken == 4


def test_a_camera_that_fails_says_what_is_kept(tmp_path: Path, sources: tuple[str, str]) -> None:
    failing = session(tmp_path, sources)

    def pairs():
        yield from islice(LiveRig(*sources).pairs(), 12)
        raise CameraError("the right camera has gone")

    failing.rig.pairs = pairs  # type: ignore[method-assign]
    with pytest.raises(CameraError, match=r"has gone; kept in .*: 2 pairs; run it again and it goes on"):
        list(failing.run())
    assert len(written(tmp_path)) == 2


@pytest.mark.parametrize("board", [Checkerboard(8, 5, 25.0), Checkerboard(9, 6, 30.0), None])
def test_a_folder_of_another_board_is_refused(
    whole: tuple[Path, list[tuple[int, str]]], sources: tuple[str, str], board: Checkerboard | None
) -> None:
    with pytest.raises(ValueError, match=r"4 pairs of another board or size \(.*capture.json says which\)"):
        session(whole[0], sources, board=board)


@pytest.mark.parametrize(
    ("files", "text"),
    [
        (["left/holiday.jpg"], r"files of something else \(holiday.jpg\)"),
        (["right/03.jpg"], r"files of something else \(03.jpg\)"),
        (["left/01.png", "right/01.png"], "holds pictures, but no capture.json"),
        (["left"], "left"),
    ],
)
def test_a_folder_of_something_else_is_left_alone(
    tmp_path: Path, sources: tuple[str, str], files: list[str], text: str
) -> None:
    for name in files:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"mine")
    with pytest.raises((ValueError, OSError), match=text):
        list(session(tmp_path, sources).run())
    assert all((tmp_path / name).read_bytes() == b"mine" for name in files)
    assert sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()) == sorted(files)
