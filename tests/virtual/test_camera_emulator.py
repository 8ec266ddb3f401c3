"""The emulated webcams: what they send, in which order, and their faults."""

from __future__ import annotations

import re
from urllib.error import HTTPError
from urllib.request import urlopen

import numpy as np
import pytest
from support.shows import small_show, write_show

from stereolib.paper import paper_rig
from stereolib.rig import read_image
from stereolib.virtual.camera_emulator import CameraFaults, Show, scaled_rig, serve_cameras, show_boards

FAST = Show(tuple(b"L%03d" % k for k in range(200)), tuple(b"R%03d" % k for k in range(200)), paper_rig(), 100.0)


def numbers(address: str, count: int) -> list[int]:
    """Which pictures of `FAST` a camera sends, the first so many."""
    found: list[int] = []
    with urlopen(address, timeout=10) as stream:
        assert stream.headers["Content-Type"] == "multipart/x-mixed-replace; boundary=picture"
        while len(found) < count and (line := stream.readline()):
            if told := re.match(rb"Content-Length: (\d+)", line):
                stream.readline()
                found.append(int(stream.read(int(told[1]))[1:]))
    return found


def test_pictures_come_in_their_order_and_begin_again() -> None:
    with serve_cameras(FAST) as (left, right):
        for address in (left, right):
            got = np.array(numbers(address, 250))
            assert (np.diff(got) % 200 == 1).all()


def test_who_does_not_know_the_addresses_sees_nothing() -> None:
    with serve_cameras(FAST) as (left, right), serve_cameras(FAST) as (other, _):
        tokens = [re.fullmatch(r"http://127\.0\.0\.1:\d+/([0-9a-f]{16})/\w+\.mjpg", at) for at in (left, right, other)]
        assert all(tokens) and tokens[0][1] == tokens[1][1] != tokens[2][1]
        for guess in (left.replace(tokens[0][1], tokens[2][1]), left.replace(f"/{tokens[0][1]}", "")):
            with pytest.raises(HTTPError, match="403"):
                urlopen(guess, timeout=10)


def test_lost_pictures_are_missing_and_the_seed_repeats_them() -> None:
    losses = []
    for seed in (1, 1, 2):
        with serve_cameras(FAST, (CameraFaults(drop_rate=0.3), CameraFaults()), seed=seed) as (left, _):
            got = np.array(numbers(left, 140))
        steps = np.diff(got) % 200
        losses.append(tuple(steps[:100]))
        assert 0.2 < 1 - len(steps) / steps.sum() < 0.4
    assert losses[0] == losses[1] != losses[2]


def test_a_camera_that_is_unplugged_ends_its_stream_and_is_gone() -> None:
    with serve_cameras(FAST, (CameraFaults(unplug_after_s=0.5), CameraFaults())) as (left, right):
        got = numbers(left, 1000)
        assert got and max(got) < 50
        with pytest.raises(HTTPError, match="404"):
            urlopen(left, timeout=10)
        assert len(numbers(right, 3)) == 3


def test_a_late_camera_sends_what_was() -> None:
    """At any moment the newest picture of a camera 0.5 s late is 50 pictures older: it starts that much later."""
    with serve_cameras(FAST, (CameraFaults(), CameraFaults(late_s=0.5))) as (left, right):
        first = numbers(left, 100)[-1]
        assert first - numbers(right, 1)[0] > 20


def test_one_place_looks_the_same_and_the_next_one_not() -> None:
    show = small_show()
    images = [read_left(show, k) for k in (0, 5, 8)]
    assert np.abs(images[0] - images[1]).mean() < 4 < np.abs(images[0] - images[2]).mean()
    assert show.left[0] != show.left[5], "with noise of its own"


def read_left(show: Show, k: int) -> np.ndarray:
    import cv2

    return cv2.imdecode(np.frombuffer(show.left[k], np.uint8), cv2.IMREAD_GRAYSCALE).astype(float)


def test_the_pattern_holds_the_pictures(tmp_path) -> None:
    show = small_show()
    left, right = write_show(tmp_path, show)
    assert (tmp_path / (right.rsplit("/", 1)[-1] % 7)).read_bytes() == show.right[7]
    assert read_image(left % 0).shape == (240, 320, 3)


def test_a_smaller_rig_sees_the_same_directions() -> None:
    whole, half = paper_rig(), scaled_rig(paper_rig(), 0.5)
    points = np.array([[100.0, -80, 900], [-200, 50, 1200]])
    at, small = whole.right.project(points), half.right.project(points)
    np.testing.assert_allclose(small, (at + 0.5) / 2 - 0.5, atol=1e-9)
    assert half.left.size == (320, 240)


@pytest.mark.parametrize("wrong", [{"late_s": -1.0}, {"drop_rate": 1.5}, {"freeze_after_s": float("nan")}])
def test_faults_out_of_range_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(wrong))} must be 0"):
        CameraFaults(**wrong)


@pytest.mark.parametrize(
    ("count", "fps", "text"), [(0, 10.0, "1 to 1000 places"), (2, 0.0, "up to 120 pictures a second")]
)
def test_a_show_out_of_range_is_refused(count: int, fps: float, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        show_boards(count, np.random.default_rng(0), fps=fps)


def test_a_rig_of_no_size_is_refused() -> None:
    with pytest.raises(ValueError, match=r"a scale of 0\.1 to 4"):
        scaled_rig(paper_rig(), 0.0)
