"""The command `map`, and `data walk` that writes something to try it on."""

from __future__ import annotations

import csv
import io
import json
import shutil
from contextlib import redirect_stdout
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import trimesh
import yaml
from support import walks

from stereolib import paper
from stereolib.base import data_path
from stereolib.cli import commands
from stereolib.cli import map as map_command
from stereolib.mapping import laser_alone, list_stations, map_recordings
from stereolib.virtual import walk, walk_folder


@pytest.fixture(scope="module")
def whole_walk(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole") / "walk"
    assert run("data", "walk", folder) == 0
    return folder


@pytest.fixture(scope="module")
def made(whole_walk, tmp_path_factory):
    """Stations 1 and 3 of the walk, and a third by its scan alone; their map, and what was said of it."""
    folder = tmp_path_factory.mktemp("map")
    shutil.copytree(whole_walk, folder / "walk")
    for name in (f"{k}_{part}" for k in "245" for part in ("left.jpg", "right.jpg", "scan.bin")):
        (folder / "walk" / name).unlink()
    (folder / "walk" / "4_scan.bin").write_bytes(walks.more_scan_bytes((-300.0, 700.0, -0.6)))
    with redirect_stdout(io.StringIO()) as said:
        assert run("map", folder / "walk", "--output", folder / "out") == 0
    (folder / "said.txt").write_text(said.getvalue(), encoding="utf-8")
    return folder


def run(*words):
    return commands.main([str(word) for word in words])


def test_files_of_the_map_agree(made):
    facts = json.loads((made / "out" / "map.json").read_text())
    rows = list(csv.DictReader((made / "out" / "objects.csv").read_text().splitlines()))
    assert [row["name"] for row in rows] == [thing["name"] for thing in facts["objects"]]
    cube = next(thing for thing in facts["objects"] if thing["volume_l"] and abs(thing["volume_l"] - 30) < 1)
    row = next(row for row in rows if row["name"] == cube["name"])
    assert float(row["yaw_deg"]) == pytest.approx(np.degrees(cube["yaw_rad"]), abs=0.01)
    for name, true in zip(("length", "width", "height"), (400, 250, 300), strict=True):
        assert abs(cube[f"{name}_mm"] - true) < 4 * cube[f"{name}_std_mm"] < 20
        assert float(row[f"{name}_mm"]) == cube[f"{name}_mm"]
    assert set(cube["seen_from"]) >= {"3"} and row["seen_from"].split() == cube["seen_from"]
    unknown = next(thing for thing in facts["objects"] if thing["height_mm"] is None)
    assert unknown["reasons"]["height"] and unknown["height_std_mm"] is None
    assert [each["name"] for each in facts["stations"]] == ["1", "3", "4"]
    assert facts["stations"][0]["pose"] == {"x_mm": 0.0, "y_mm": 0.0, "yaw_rad": 0.0} and len(facts["walls"]) == 4
    grid = yaml.safe_load((made / "out" / "grid.yaml").read_text())
    assert (made / "out" / grid["image"]).read_bytes().startswith(b"P5")
    assert set(trimesh.load(made / "out" / "map.glb").geometry) >= {cube["name"], "wall 1"}
    for name in ("map.png", "view.png"):
        picture = cv2.imread(str(made / "out" / name))
        assert picture is not None and np.ptp(picture) > 200


def test_a_map_is_not_written_over(made, capsys):
    before = (made / "out" / "map.json").read_bytes()
    assert run("map", made / "walk", "--output", made / "out") == 2
    said = capsys.readouterr().err
    assert "out/map.json" in said and "map.png and 6 more would be overwritten" in said and "--force" in said
    assert (made / "out" / "map.json").read_bytes() == before


def test_pictures_alone_make_a_map(made, tmp_path, capsys):
    """One pair, no scan: no walls, no grid; the grid of an older map does not stay."""
    for name in ("3_left.jpg", "3_right.jpg", "calibration.json"):
        (tmp_path / name).write_bytes((made / "walk" / name).read_bytes())
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "grid.yaml").write_text("old")
    (tmp_path / "notes.txt").write_text("mine")
    assert run("map", tmp_path, "--output", tmp_path / "out", "--force", "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert {round(thing["length_mm"], -1) for thing in facts["objects"] if thing["length_mm"]} >= {400.0, 300.0}
    assert not facts["walls"] and not any("grid" in name for name in facts["written"])
    assert not (tmp_path / "out" / "grid.yaml").exists() and facts["unused_files"] == ["notes.txt"]


def test_a_laser_alone_makes_a_map_without_a_calibration(tmp_path, capsys):
    """Footprints and walls, no heights; what its calibration would take off is within the deviations."""
    for name in "12345":
        shutil.copy(data_path(f"virtual/room/{name}_scan.bin"), tmp_path)
    assert run("map", tmp_path, "--output", tmp_path / "out", "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert [each["name"] for each in facts["stations"]] == [*"12345"] and len(facts["walls"]) >= 4
    box = next(thing for thing in facts["objects"] if thing["length_mm"] and 350 < thing["length_mm"] < 450)
    for name, true in (("length", 400), ("width", 250)):
        assert abs(box[f"{name}_mm"] - true) < 3 * box[f"{name}_std_mm"]
    assert all(thing["height_mm"] is None for thing in facts["objects"])


def test_a_calibration_that_was_given_is_not_unused(made, tmp_path, capsys):
    for name in ("3_left.jpg", "3_right.jpg", "calibration.json"):
        shutil.copy(made / "walk" / name, tmp_path)
    rig = (tmp_path / "calibration.json").rename(tmp_path / "mine.json")
    assert run("map", tmp_path, "--calibration", rig, "--output", tmp_path / "out", "--json") == 0
    assert json.loads(capsys.readouterr().out)["unused_files"] == []


def test_a_bar_is_there_before_the_first_file_is_read(made, tmp_path, capsys):
    (tmp_path / "1_scan.bin").write_bytes(b"no laser" * 99)
    with pytest.raises(ValueError, match="no XV-11 recording"):
        map_recordings(list_stations(tmp_path).stations, laser_alone(), progress=True)
    assert "measuring:   0%" in capsys.readouterr().err


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_boards_that_take_seconds_show_a_bar(tmp_path, monkeypatch, capsys):
    """And a line before it: tqdm draws nothing on a terminal that does not tell its size."""
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setattr(walk_folder, "_boards", walk_folder._boards.__wrapped__)  # not those that are rendered already
    monkeypatch.setattr(walk_folder, "render", lambda *_, **__: np.full((480, 640, 3), 0.4))
    assert run("data", "walk", tmp_path / "a walk") == 0
    assert terminal.getvalue().startswith("rendering boards for the laser, in some seconds ...\n")
    assert "boards:   0%" in terminal.getvalue()
    assert f"stereolib map '{tmp_path / 'a walk'}'\n" in capsys.readouterr().out


@pytest.mark.parametrize("words", [("data", "walk", "walk"), ("map", "walk", "--output", "out")])
def test_ctrl_c_says_that_what_was_written_stays(tmp_path, monkeypatch, capsys, words):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(walk_folder, "write_walk", interrupt)
    monkeypatch.setattr(map_command, "_stations", interrupt)
    assert run(*words) == 130
    assert "files that were written stay; run it again, with --force if there are any" in capsys.readouterr().err


def test_poses_of_a_map_have_no_minus_at_zero():
    station = SimpleNamespace(pose=np.array([-0.3, -0.0, -1e-5]), covariance=np.zeros((3, 3)))
    assert map_command._pose_text(station) == "x 0, y 0 mm, looks 0.0 degrees"


def test_one_of_a_thing_is_not_many(tmp_path, capsys, monkeypatch):
    """The option's beginning is enough, as it was called; a terminal sees what is done."""
    monkeypatch.setattr("sys.stderr", terminal := Terminal())
    for name in ("3_left.jpg", "3_right.jpg"):
        (tmp_path / name).write_bytes(data_path(f"virtual/room/{name}").read_bytes())
    paper.paper_rig().save(tmp_path / "calibration.json")
    assert run("map", tmp_path, "--out", tmp_path / "out") == 0
    assert "0 walls, from 1 station\n" in capsys.readouterr().out
    assert terminal.getvalue().startswith("measuring 1 station, in some seconds ...\n")
    assert terminal.getvalue().endswith("drawing the map, in some seconds ...\n")


@pytest.mark.slow
def test_a_walk_in_order_asks_of_no_station_when_it_was_taken(whole_walk, tmp_path, capsys):
    """Some objects stand behind others there; with the scan of another station it is left out."""
    shutil.copytree(whole_walk, tmp_path / "walk")
    assert run("map", tmp_path / "walk", "--output", tmp_path / "out", "--json") == 0
    assert "same time" not in capsys.readouterr().out
    (tmp_path / "walk" / "1_scan.bin").write_bytes((tmp_path / "walk" / "4_scan.bin").read_bytes())
    assert run("map", tmp_path / "walk", "--output", tmp_path / "other", "--json") == 0
    left_out = json.loads(capsys.readouterr().out)["left_out"]
    assert list(left_out) == ["1"] and "at one place and moment" in left_out["1"]


def test_text_names_sizes_stations_and_what_is_unknown(made, capsys):
    assert run("map", made / "walk", "--output", made / "again", "--poses", made / "walk" / "true_poses.csv") == 2
    assert "there is no station '2', only 1, 3, 4" in capsys.readouterr().err
    said = " ".join((made / "said.txt").read_text(encoding="utf-8").split())
    assert "4 walls, from 3 stations" in said and "station 1: x 0, y 0 mm" in said and "by its scan)" in said
    assert (
        "no height: " in said and "± one standard deviation" in said and "objects of which all sizes are known" in said
    )
    assert "not used, as they belong to no station: true_poses.csv" in said


def test_what_is_said_of_several_stations_is_said_once():
    texts = {"1": ["a: b", "c"], "2": ["a: b"]}
    stations = [SimpleNamespace(name=name) for name in texts]
    recorded = SimpleNamespace(room=SimpleNamespace(stations=stations), said_of=texts.__getitem__)
    assert map_command._said_at_stations(recorded) == ["stations 1, 2: a: b", "station 1: c"]


def test_nothing_mapped_is_exit_code_1(made, tmp_path, capsys):
    (tmp_path / "calibration.json").write_bytes((made / "walk" / "calibration.json").read_bytes())
    for side in ("left", "right"):
        cv2.imwrite(str(tmp_path / f"1_{side}.png"), np.full((480, 640, 3), 90, np.uint8))
    assert run("map", tmp_path, "--output", tmp_path / "out") == 1
    said = capsys.readouterr().err
    assert "nothing was mapped: no station could be measured. station 1: no floor" in said
    assert "--floor" not in said and "in Python" not in said
    assert not (tmp_path / "out").exists()


def test_what_cannot_be_read_is_named_and_the_rest_is_mapped(made, tmp_path, capsys):
    """A scan alone has a place in the map, a pair alone none; where all stations lack a file, nothing is written."""
    for path in data_path("virtual/room/1_scan.bin").parent.iterdir():
        shutil.copy(path, tmp_path)
    shutil.copy(made / "walk" / "calibration.json", tmp_path)
    small = cv2.imencode(".jpg", np.zeros((240, 320, 3), np.uint8))[1].tobytes()
    spoilt = {
        "2_scan.bin": (walk.scan_bytes("room/2")[:900], "of 1 turn none is complete; record longer (a turn takes"),
        "3_left.jpg": ((tmp_path / "3_left.jpg").read_bytes()[:5000], "the JPEG is cut short (5000 bytes, no end"),
        "4_scan.bin": (b"no laser" * 99, "4_scan.bin (792 bytes) is no XV-11 recording"),
        "5_left.jpg": (small, "5_left.jpg is 320x240"),
    }
    for name, (data, _) in spoilt.items():
        (tmp_path / name).write_bytes(data)
    assert run("map", tmp_path, "--output", tmp_path / "out", "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert [each["name"] for each in facts["stations"]] == ["1", "3"] and facts["objects"]
    assert list(facts["left_out"]) == ["2", "4", "5"]
    said = {name: facts["left_out"].get(name[0]) for name in spoilt}
    (said["3_left.jpg"],) = (text for text in facts["warnings"] if text.startswith("station 3: "))
    for name, (_, why) in spoilt.items():
        assert str(tmp_path / name) in said[name] and why in said[name] and "Python" not in said[name]
    assert said["3_left.jpg"].endswith("; mapped without it")
    assert all(said[f"{k}_scan.bin"].endswith("; it has no scan to be placed by: give its pose") for k in "24")
    for path in tmp_path.glob("1_*"):
        path.unlink()
    assert run("map", tmp_path, "--output", tmp_path / "new") == 2
    said = capsys.readouterr().err
    assert f"error: station 2: {tmp_path / '2_scan.bin'}: of 1 turn none" in said and said.count("\n") == 1
    assert not (tmp_path / "new").exists()


def test_pictures_of_another_size_than_the_calibration(made, tmp_path, capsys):
    small = cv2.imencode(".png", np.zeros((240, 320, 3), np.uint8))[1].tobytes()
    for side in ("left", "right"):
        (tmp_path / f"1_{side}.png").write_bytes(small)
    calibration = made / "walk" / "calibration.json"
    assert run("map", tmp_path, "--output", tmp_path / "out", "--calibration", calibration) == 2
    assert f"1_left.png is 320x240, {calibration} is for 640x480" in capsys.readouterr().err


def test_the_walk_is_not_written_over(made, capsys):
    assert run("data", "walk", made / "walk") == 2
    assert "1_left.jpg and 26 more would be overwritten: name another place with FOLDER" in capsys.readouterr().err


def test_a_rig_folder_without_recordings_is_refused_with_both_places(tmp_path, capsys):
    assert run("new", tmp_path) == 0
    assert "lie in" not in capsys.readouterr().out
    assert run("map", tmp_path, "--output", tmp_path / "out") == 2
    said = capsys.readouterr().err
    assert "holds no station: expected 1_left.png" in said and "where its rig.toml says" in said


@pytest.mark.parametrize("pairs", ["*.jpg", "pairs"])
def test_a_template_put_into_a_folder_of_stations_hinders_no_map(made, tmp_path, capsys, pairs):
    """Its file names what lies there; if it does not, that is read all the same."""
    for path in (made / "walk").glob("[13]_*"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    before = [(each.name, each.left, each.scan) for each in map_command._stations(tmp_path, None)[0].stations]
    assert run("new", tmp_path) == 0
    assert "are taken for what is to be measured, as map takes them: *.jpg, *.bin" in capsys.readouterr().out
    text = (tmp_path / "rig.toml").read_text()
    scans = "scans" if pairs == "pairs" else "*.bin"
    (tmp_path / "rig.toml").write_text(text.replace('"*.jpg"', f'"{pairs}"').replace('"*.bin"', f'"{scans}"'))
    found, _ = map_command._stations(tmp_path, None)
    assert [(each.name, each.left, each.scan) for each in found.stations] == before and len(before) == 2
    assert not found.unused


def test_pairs_of_capture_are_entered_by_new_and_never_lost_in_silence(made, tmp_path, capsys):
    """Its folders left/ and right/, with scans/ beside: a template between two maps changes nothing."""
    for k in "13":
        for side in ("left", "right"):
            (tmp_path / side).mkdir(exist_ok=True)
            shutil.copy(made / "walk" / f"{k}_{side}.jpg", tmp_path / side / f"{k}.jpg")
        (tmp_path / "scans").mkdir(exist_ok=True)
        shutil.copy(made / "walk" / f"{k}_scan.bin", tmp_path / "scans" / f"{k}.bin")
    before, _ = map_command._stations(tmp_path, None)
    assert run("new", tmp_path) == 0 and "as map takes them: left/ and right/\n" in capsys.readouterr().out
    found, absent = map_command._stations(tmp_path, None)
    assert [(each.name, each.left.name, each.scan.name) for each in found.stations] == [
        (each.name, each.left.name, each.scan.name) for each in before.stations
    ]
    assert len(found.stations) == 2 and not absent
    text = (tmp_path / "rig.toml").read_text()
    (tmp_path / "rig.toml").write_text(text.replace('pairs = "."', 'pairs = "pairs"'))
    shutil.copy(made / "walk" / "calibration.json", tmp_path)
    assert run("map", tmp_path, "--output", tmp_path / "out") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert (
        "left out: pairs lie in " in said
        and 'left/ and right/: write pairs = "." into its rig.toml' in said
        and "nothing in boards" not in said
    )
