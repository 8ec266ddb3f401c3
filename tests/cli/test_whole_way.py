"""One emulated rig that nobody has described leads the whole way: boards, laser, depth, a box, the map, the report."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from support.notebooks import execute_without_kernels
from support.shows import write_show

from stereolib import plotting
from stereolib.cli import commands
from stereolib.reproduction import own_rig
from stereolib.rig import StereoRig
from stereolib.virtual import VirtualLidar, camera_emulator, emulator, stage, staged_rig

RIG, BOX, STATION = 7, 4, 3
SCALE = 0.5  # of 640 x 480: quicker


def run(*words: object) -> int:
    return commands.main([str(word) for word in words])


def capture(show: camera_emulator.Show, name: str, *words: object) -> int:
    """From pictures, which keep no clock waiting: live cameras, late and losing pictures, are in test_capture."""
    return run("capture", *write_show(name, show), "--no-preview", *words)


def record(scene: str, number: int, seed: int, file: Path) -> int:
    staged, rng = stage(scene, number, rig=RIG), np.random.default_rng(seed)
    lidar = VirtualLidar(height_mm=staged.laser_height_mm)
    played = emulator.emulate(staged.scene, staged.laser_pose, lidar=lidar, rng=rng)
    with emulator.serve(played, "socket") as served:
        return run("lrf", "record", served.port, file, "--seconds", 3)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_one_rig_leads_from_its_boards_to_the_height_of_a_box(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plotting, "write_calibration_report", lambda *_: None)  # stereolib calibrate's tests look at it
    monkeypatch.setattr(own_rig, "execute_notebooks", execute_without_kernels)
    true, rng = camera_emulator.scaled_rig(staged_rig(RIG), SCALE), np.random.default_rng(2)
    assert run("new", "my_rig") == 0

    boards = camera_emulator.show_boards(9, rng, true, held_s=0.6)
    words = ("--board", "9x6", "--square-mm", 25, "--pairs", 8, "--patience-s", 1, "--output", "my_rig/boards")
    assert capture(boards, "boards", *words) == 0
    told = capsys.readouterr()
    assert "\ngood " in told.out or "\nusable " in told.out
    assert "calibrating: this takes some seconds" in told.err
    found = StereoRig.load("my_rig/boards/calibration.json")
    assert found.baseline_mm == pytest.approx(true.baseline_mm, rel=0.01)

    for number, (scene, at) in enumerate((("box", BOX), ("walk", STATION)), start=1):
        shown = camera_emulator.show_scene(stage(scene, at, rig=RIG), rng, true)
        assert capture(shown, scene, "--output", "my_rig/pairs", "--pairs", number) == 0
        assert record(scene, at, number, tmp_path / "my_rig" / "scans" / f"{number}.bin") == 0
    pair = "my_rig/pairs/left/01.png", "my_rig/pairs/right/01.png"
    rig = ("--calibration", "my_rig/boards/calibration.json")
    assert run("disparity", *pair, *rig) == 0
    depth_mm = np.load("disparity_depth_mm.npy", allow_pickle=False)
    assert 500 < np.nanmedian(depth_mm) < 2500

    capsys.readouterr()
    assert run("measure", *pair, *rig, "--scan", "my_rig/scans/1.bin", "--json") == 0
    objects = json.loads(capsys.readouterr().out)["objects"]
    assert [item for item in objects if item["height_mm"]], objects
    box = max(objects, key=lambda item: item["height_mm"] or 0)
    ((_, _, height_mm),) = stage("box", BOX).sizes_mm
    assert abs(box["height_mm"] - height_mm) < 4 * box["height_std_mm"] + 1
    assert run("measure", *pair, *rig) == 0 and Path("01_measured_2.png").is_file()

    assert run("map", "my_rig", *rig) == 0
    heights = [each["height_mm"] for each in json.loads(Path("my_rig_map/map.json").read_text())["objects"]]
    assert min(abs(height - height_mm) for height in heights if height) < 10

    toml = Path("my_rig/rig.toml")
    toml.write_text(toml.read_text().replace("# square_mm", "square_mm"))
    assert run("report", "my_rig") == 0
    cells = json.loads(Path("my_rig/report/report.ipynb").read_text())["cells"]
    text = "".join("".join(output.get("text", "")) for cell in cells for output in cell.get("outputs", []))
    assert re.search(r"^\w+ length .*height \d+\.\d ± ", text, re.MULTILINE) and "beams, half of them scatter" in text
