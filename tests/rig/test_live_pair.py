"""Two live cameras as one rig: what is paired, dropped, refused and told of a camera that fails."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from support.shows import small_show, write_show

from stereolib.rig import CameraError, CameraWish, LiveRig, live_camera, live_pair
from stereolib.virtual.camera_emulator import CameraFaults, serve_cameras

NEVER = 10**9
NEVER_SO_MANY = 1000


@dataclass
class Driver:
    """A driver in place of `cv2.VideoCapture`: picture k is all grey level k, taken at `first_ms` + k `step_ms`."""

    backend: str = "V4L2"
    first_ms: float = 5000.0
    step_ms: float = 100.0
    pictures: int = NEVER
    refuses: tuple[int, ...] = ()
    settings: dict[int, float] = field(default_factory=dict)
    k: int = -1

    def isOpened(self) -> bool:
        return True

    def getBackendName(self) -> str:
        return self.backend

    def set(self, setting: int, value: float) -> bool:
        if setting not in self.refuses:
            self.settings[setting] = value
        return setting not in self.refuses

    def get(self, setting: int) -> float:
        if setting == cv2.CAP_PROP_POS_MSEC:
            return self.first_ms + self.k * self.step_ms
        return self.settings.get(setting, 8.0)

    def grab(self) -> bool:
        time.sleep(0.002)
        self.k += self.k < self.pictures
        return self.k < self.pictures

    def retrieve(self) -> tuple[bool, Any]:
        return True, np.full((6, 8, 3), self.k % 256, np.uint8)

    def release(self) -> None:
        pass


@pytest.fixture
def drivers(monkeypatch: pytest.MonkeyPatch) -> dict[str, Driver]:
    """Cameras 0 and 1."""
    made = {"0": Driver(), "1": Driver()}
    monkeypatch.setattr(live_camera, "_open", lambda source: made[source])
    monkeypatch.setattr(live_camera, "_SETTLED_S", 0.0)
    return made


@pytest.mark.parametrize("late_ms", [3.0, 50.0])
def test_the_drivers_stamps_tell_the_skew(drivers: dict[str, Driver], late_ms: float) -> None:
    drivers["1"].first_ms += late_ms
    rig = LiveRig("0", "1", max_skew_ms=1e6)
    pairs = list(islice(rig.pairs(), 20))
    rig.close()
    moments = [[drivers[k].first_ms + side[0, 0, 0] * 100.0 for k, side in zip("01", pair[:2], strict=True)]
               for pair in pairs]  # fmt: skip
    np.testing.assert_allclose([pair.skew_ms for pair in pairs], [abs(b - a) for a, b in moments], atol=1e-6)
    assert rig.skew_p95_ms == pytest.approx(np.percentile([pair.skew_ms for pair in pairs], 95))
    assert rig.skew_name == "by the drivers' time stamps"
    newest = [left[0, 0, 0] for left, _, _ in pairs]
    assert newest == sorted(set(newest)), "no picture comes twice, none from before"


def test_pairs_too_far_apart_are_dropped_and_counted(drivers: dict[str, Driver]) -> None:
    drivers["1"].first_ms += 50.0  # always 50 ms, or more by whole steps
    drivers["0"].pictures = drivers["1"].pictures = 60
    rig, came = LiveRig("0", "1", max_skew_ms=30.0), []
    with pytest.raises(CameraError, match="has gone: it was unplugged"):
        came += rig.pairs()
    assert not came and rig.dropped > 0
    rig.close()


def test_arrivals_are_named_as_such_where_drivers_tell_no_time(drivers: dict[str, Driver]) -> None:
    drivers["1"].backend = "DSHOW"
    rig = LiveRig("0", "1")
    assert rig.skew_name == "between the arrivals of both pictures"
    rig.close()


def test_what_a_camera_refuses_is_said_and_the_rest_is_set(drivers: dict[str, Driver]) -> None:
    drivers["0"].refuses = (cv2.CAP_PROP_FOURCC, cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_AUTOFOCUS, cv2.CAP_PROP_FOCUS)
    drivers["0"].settings[cv2.CAP_PROP_FRAME_WIDTH] = 640
    rig = LiveRig("0", "1", CameraWish((1280, 720), 15.0, exposure=120.0, focus=30.0))
    assert rig.cameras[0].refused == (
        "the format MJPG",
        "the width 1280 (it stays at 640)",
        "a fixed focus: it stays automatic",
        "the focus 30 (it stays at 8)",
    )
    assert rig.cameras[1].refused == ()
    for driver in drivers.values():
        assert driver.settings[cv2.CAP_PROP_FRAME_HEIGHT] == 720 and driver.settings[cv2.CAP_PROP_FPS] == 15
        assert driver.settings[cv2.CAP_PROP_EXPOSURE] == 120 and driver.settings[cv2.CAP_PROP_AUTO_EXPOSURE] == 1
    assert drivers["1"].settings[cv2.CAP_PROP_FOURCC] == cv2.VideoWriter.fourcc(*"MJPG")
    assert drivers["1"].settings[cv2.CAP_PROP_WB_TEMPERATURE] == 8.0, "fixed where the automatic had it"
    rig.close()


def test_a_recording_is_paired_picture_by_picture(tmp_path: Path) -> None:
    show = small_show()
    rig = LiveRig(*write_show(tmp_path, show))
    pairs = list(rig.pairs())
    assert len(pairs) == len(show.left)
    for k in (0, len(pairs) - 1):
        for seen, sent in zip(pairs[k][:2], (show.left[k], show.right[k]), strict=True):
            np.testing.assert_array_equal(seen, cv2.imdecode(np.frombuffer(sent, np.uint8), cv2.IMREAD_COLOR))
    assert np.isnan(rig.skew_p95_ms) and np.isnan([pair.skew_ms for pair in pairs]).all()
    rig.close()


def test_streams_are_paired_and_both_sides_move_on() -> None:
    show = small_show()
    with serve_cameras(show) as addresses:
        rig = LiveRig(*addresses)
        pairs = list(islice(rig.pairs(), 5))
        rig.close()
    assert rig.size == (320, 240) == pairs[0].left.shape[1::-1]
    sent = [[cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR) for jpeg in side]
            for side in (show.left, show.right)]  # fmt: skip
    which = [[int(np.argmin([np.abs(seen.astype(int) - known).max() for known in side]))
              for seen, side in zip(pair[:2], sent, strict=True)] for pair in pairs]  # fmt: skip
    for (left, right), pair in zip(which, pairs, strict=True):
        np.testing.assert_allclose(pair.left, sent[0][left], atol=12)  # its decoder rounds colours another way
        np.testing.assert_allclose(pair.right, sent[1][right], atol=12)
    assert "an address has no settings" in rig.cameras[0].refused[0]


@pytest.mark.parametrize(
    ("faults", "text"),
    [
        (CameraFaults(freeze_after_s=1.5), "the right camera .* (has sent nothing for|has gone)"),
        (CameraFaults(unplug_after_s=1.5), "the right camera .* has gone: it was unplugged"),
    ],
)
def test_a_camera_that_fails_is_named(monkeypatch: pytest.MonkeyPatch, faults: CameraFaults, text: str) -> None:
    monkeypatch.setattr(live_pair, "_SILENT_S", 1.0)
    monkeypatch.setattr(live_camera, "_READ_MS", 1500)
    with serve_cameras(small_show(), (CameraFaults(), faults)) as addresses:
        rig = LiveRig(*addresses)
        with pytest.raises(CameraError, match=text):
            list(rig.pairs())
        rig.close()


def test_a_cable_that_carries_one_camera_only_is_recognised(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_pair, "_FIRST_S", 2.5)
    monkeypatch.setattr(live_camera, "_READ_MS", 1500)
    show = small_show()
    one = np.mean([len(picture) for picture in show.left]) * show.fps
    said = r"right camera .* delivers alone, but nothing while both run.*another port.*MJPG.*--size"
    with serve_cameras(show, bus_bytes_per_s=1.5 * one) as addresses, pytest.raises(CameraError, match=said):
        LiveRig(*addresses)
    with serve_cameras(show, bus_bytes_per_s=2.5 * one) as addresses:
        LiveRig(*addresses).close()


def test_two_devices_on_one_cable_are_told_from_a_broken_one(
    drivers: dict[str, Driver], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_pair, "_FIRST_S", 0.5)
    monkeypatch.setattr(live_camera, "_open", lambda source: replace(drivers[source]))
    drivers["1"].pictures = 0
    with pytest.raises(CameraError, match=r"right camera \(1\) opens but sends no picture, alone either"):
        LiveRig("0", "1")
    opened = []

    def starved(source: str) -> Driver:
        """The second that is opened, and only that, gets nothing."""
        opened.append(source)
        return Driver(pictures=0 if len(opened) == 2 else NEVER)

    monkeypatch.setattr(live_camera, "_open", starved)
    with pytest.raises(CameraError, match="delivers alone, but nothing while both run"):
        LiveRig("0", "1")
    assert opened == ["0", "1", "1"]


@pytest.mark.parametrize(
    ("left", "right", "text"),
    [
        ("{0}/left_%04d.jpg", "{0}/left_%04d.jpg", "was given for both cameras"),
        ("{0}/left_%04d.jpg", "{0}/none_%04d.jpg", "right camera .* no picture of this pattern"),
        ("{0}/left_%04d.jpg", "{0}/small_%04d.jpg", "sends 320x240 and .* sends 160x120: both must have one size"),
        ("{0}/left_%04d.jpg", "{0}/text.mp4", "right camera .* not a readable video"),
        ("87", "88", "left camera 87 cannot be opened: (no camera was found|cameras found)"),
        ("http://127.0.0.1:1/x", "0", "does the address open in a browser"),
    ],
)
def test_wrong_sources_are_refused_by_name(tmp_path: Path, left: str, right: str, text: str, capfd: Any) -> None:
    write_show(tmp_path, small_show())
    first = cv2.imread(str(tmp_path / "left_0000.jpg"))
    cv2.imwrite(str(tmp_path / "small_0000.jpg"), first[::2, ::2])
    (tmp_path / "text.mp4").write_text("no video")
    with pytest.raises((CameraError, ValueError), match=text):
        LiveRig(left.format(tmp_path), right.format(tmp_path))
    assert capfd.readouterr().err == "", "OpenCV's own words would bury the one line"


def test_a_file_and_a_live_camera_share_no_moment(tmp_path: Path) -> None:
    left, _ = write_show(tmp_path, small_show())
    with serve_cameras(small_show()) as (_, right), pytest.raises(ValueError, match="one is a file, the other live"):
        LiveRig(left, right)


def test_a_rig_none_of_whose_pairs_is_of_one_moment_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = LiveRig(*write_show(tmp_path, small_show(1)), max_skew_ms=50)
    near, apart = (next(rig.pairs())._replace(skew_ms=ms) for ms in (20.0, 80.0))
    told = iter([near, apart, apart, near, *[apart] * NEVER_SO_MANY])

    def late() -> live_pair.LivePair:
        time.sleep(0.01)
        rig._skews_ms.append((pair := next(told)).skew_ms)
        return pair

    monkeypatch.setattr(rig, "_recorded_pair", late)
    monkeypatch.setattr(live_pair, "_APART_S", 0.1)
    pairs = rig.pairs()
    assert [next(pairs).skew_ms, next(pairs).skew_ms] == [20.0, 20.0] and rig.dropped == 2
    with pytest.raises(CameraError, match=r"80 ms apart .* within 50 ms: .*--fps.*--max-skew-ms 160"):
        next(pairs)
    rig.close()


@pytest.mark.parametrize(("left", "right"), [("0", "/dev/video0"), ("a.mp4", "./a.mp4")])
def test_one_camera_under_two_names_is_refused(left: str, right: str) -> None:
    with pytest.raises(ValueError, match=f"{left} and {right} are one camera"):
        LiveRig(left, right)
