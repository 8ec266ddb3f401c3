"""Commands `measure` and `calibrate-laser`: from files to sizes, and what is wrong with files."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import cv2
import numpy as np
import pytest
from support.instruments import LIDAR, RECT, SENSOR

from stereolib.base import data_path, write_atomic
from stereolib.cli import commands
from stereolib.cli.calibrate_laser import _paired, apart, place_text, turn_text
from stereolib.cli.told import object_details
from stereolib.mapping import read_scan
from stereolib.measurement import (
    Instrument,
    Reason,
    ScanFit,
    Why,
    draw_objects,
    floor_from_pose,
    measure_objects,
    measure_standing,
    save_laser_pose,
    see_standing,
)
from stereolib.measurement.camera_moves import see_pair
from stereolib.measurement.overlay import why_text
from stereolib.paper import paper_rig
from stereolib.rig import StereoRig, rigid
from stereolib.virtual import recordings, walk, walk_folder
from stereolib.virtual.measured_walk import walk_laser


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    folder = tmp_path_factory.mktemp("original")
    StereoRig.save(
        RECT.rig, folder / "rig.json", calibration={"std": {"rectified": {"f_px": 0.1, "baseline_mm": 0.01}}}
    )
    save_laser_pose(folder / "rig.json", LIDAR)
    for side, image in zip(("left", "right"), recordings.load_pair("conditions/texture"), strict=True):
        cv2.imwrite(str(folder / f"{side}.png"), image)
    scene = recordings.pairs()["conditions/texture"][1]
    (folder / "scan.bin").write_bytes(SENSOR.scan(scene, recordings.LASER_POSE, np.random.default_rng(1), turns=5))
    return folder


@pytest.fixture
def files(original, tmp_path):
    """A copy of what is measured, to be changed."""
    return shutil.copytree(original, tmp_path, dirs_exist_ok=True)


def run(folder, *more, right="right.png", rig="rig.json", scan="scan.bin"):
    words = ["measure", folder / "left.png", folder / right, "--calibration", folder / rig]
    words += ["--scan", folder / scan] if scan else []
    return commands.main([str(word) for word in (*words, "--output", folder / "out.png", *more)])


def test_command_prints_json_and_draws(files, capsys):
    assert run(files, "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    (cube,) = [thing for thing in facts["objects"] if thing["height_mm"]]
    for name in ("length", "width", "height"):
        assert cube[f"{name}_mm"] == pytest.approx(300, abs=3) and 0 < cube[f"{name}_std_mm"] < 3
    assert cube["volume_l"] == pytest.approx(27, abs=0.6) and cube["shape"] == "box"
    drawn, left = cv2.imread(str(files / "out.png")), cv2.imread(str(files / "left.png"))
    flat = RECT.rectify(left, cv2.imread(str(files / "right.png")))[0]
    assert (drawn[:480, :640] == flat).all(axis=2).mean() > 0.5  # its own pixels stay where they are
    right, below = drawn[:480, 640:], drawn[480:, :640]
    assert all((part < 128).any() and part.mean() > 200 for part in (right, below))
    marks = (below[2, :, 0] < 128).nonzero()[0]
    np.testing.assert_allclose(marks[marks % 100 < 2][:6] // 100, [0, 1, 2, 3, 4, 5])
    assert run(files) == 2 and "would be overwritten" in capsys.readouterr().err
    assert run(files, "--force") == 0 and "± one standard deviation" in capsys.readouterr().out


def test_a_floor_by_hand_where_none_is_seen(files, capsys):
    """Under glare the floor is not seen; with it given the cube has a height."""
    for side, image in zip(("left", "right"), recordings.load_pair("conditions/glare"), strict=True):
        cv2.imwrite(str(files / f"{side}.png"), image)
    true = floor_from_pose(RECT, recordings.setup("pitched"))
    assert run(files, "--json") == 0 and "no floor" in capsys.readouterr().out
    by_hand = f"--floor={true.camera_height_mm:.1f},{np.degrees(true.pitch_rad):.2f}"
    assert run(files, by_hand, "--json", "--force") == 0
    facts = json.loads(capsys.readouterr().out)
    assert not any("no floor" in text for text in facts["warnings"])
    (cube,) = [thing for thing in facts["objects"] if thing["height_mm"]]
    assert cube["height_mm"] == pytest.approx(300, abs=3 * cube["height_std_mm"]) and cube["height_std_mm"] > 0.5


def test_a_floor_by_hand_that_the_pictures_contradict_is_said(files, capsys):
    true = floor_from_pose(RECT, recordings.setup("pitched"))
    height, pitch = true.camera_height_mm, np.degrees(true.pitch_rad)
    for off_deg, said in ((0.0, False), (1.5, True)):
        run(files, f"--floor={height:.1f},{pitch + off_deg:.2f}", "--json", "--force")
        warnings = json.loads(capsys.readouterr().out)["warnings"]
        assert any("the given floor contradicts the pictures" in text for text in warnings) is said
    assert run(files, f"--floor={height / 5:.1f},{pitch:.2f}", "--force") == 2
    said = capsys.readouterr().err
    assert "is asked for in millimetres" in said and f"{height / 5:.1f} mm below" in said and "degrees up" in said


def test_where_nothing_can_be_measured_the_code_says_so(files, capsys):
    """All that was given is right: 1, and not the 2 of wrong input."""
    for side, image in zip(("left", "right"), recordings.load_pair("conditions/glare"), strict=True):
        cv2.imwrite(str(files / f"{side}.png"), image)
    assert run(files, scan=None) == 1
    assert "no floor" in (said := capsys.readouterr().err) and said.count("\n") == 1


def test_between_two_pixels_without_a_floor(files, capsys):
    for side, image in zip(("left", "right"), recordings.load_pair("conditions/texture"), strict=True):
        cv2.imwrite(str(files / f"{side}.png"), image)
    setup = recordings.setup()
    marks_mm = np.array([[700.0, 0.0, z] for z in (20.0, 280.0)])  # on the cube's near edge
    words = [f"{u:.1f},{v:.1f}" for u, v in paper_rig().left.project(marks_mm @ setup[:3, :3].T + setup[:3, 3])]
    run_pair = partial(run, files, "--between", *words, "--force", scan=None)
    assert run_pair("--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["length_mm"] == pytest.approx(260, abs=2 * facts["std_mm"]) and 0 < facts["std_mm"] < 3
    assert np.linalg.norm(np.subtract(*facts["points_mm"])) == pytest.approx(facts["length_mm"])
    assert run_pair() == 0 and "at depths of" in (said := capsys.readouterr().out)
    assert "nothing here shows it; each pixel of it changes them by" in said.replace("\n", " ")
    assert "the pixels were taken for those of this picture: left, as the camera gave it" in said
    flat = [
        f"{u:.1f},{v:.1f}" for u, v in RECT.rectify_points([[float(x) for x in w.split(",")] for w in words], "left")
    ]
    assert flat != words and run(files, "--between", *flat, "--rectified", "--json", "--force", scan=None) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["length_mm"] == pytest.approx(facts["length_mm"], abs=0.3)
    assert (facts["pixels_of"], again["pixels_of"]) == ("left, as the camera gave it", "left, rectified")
    assert run(files, "--rectified", "--force") == 2 and "give both, or neither" in capsys.readouterr().err
    assert (
        run(files, "--between", "5,5", "9999,5", "--force", scan=None) == 2
        and "outside the left picture" in capsys.readouterr().err
    )
    with pytest.raises(SystemExit):
        run(files, "--between", "5;5", "6,6")
    assert "is not X,Y" in capsys.readouterr().err
    for more, idle in (((), "--scan"), (("--floor=85,8",), "--scan and --floor")):
        assert (
            run(files, "--between", *words, *more, "--force") == 2 and f"leave {idle} away" in capsys.readouterr().err
        )


def test_between_two_pixels_says_what_speaks_against_pair_and_rig(files, capsys):
    """Rows that are off and a lens with another focus, of which it tells the right length; and a rig in centimetres."""
    left, right = recordings.load_pair("conditions/texture")
    height, width = left.shape[:2]
    M = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), 0.0, 1.01)
    M[1, 2] += 2.0
    cv2.imwrite(str(files / "moved.png"), cv2.warpAffine(right, M, (width, height), borderMode=cv2.BORDER_REPLICATE))
    rig = json.loads((files / "rig.json").read_text())
    (files / "tenth.json").write_text(json.dumps(rig | {"T_mm": [value / 10 for value in rig["T_mm"]]}))
    where, facts = ("--between", "310,400", "310,160", "--json", "--force"), []
    for change in ({}, {"right": "moved.png"}, {"rig": "tenth.json"}):
        assert run(files, *where, scan=None, **change) == 0
        facts.append(json.loads(capsys.readouterr().out))
    plain, moved, tenth = (fact["warnings"] for fact in facts)
    assert len(plain) == 1 and "turned sideways" in plain[0]
    assert "px too low" in moved[0] and "1.0 % larger than left" in moved[1]
    assert facts[1]["length_mm"] == pytest.approx(facts[0]["length_mm"], rel=0.01)
    assert any("9.3 mm apart" in text and "again with millimetres" in text for text in tenth)


def test_pixels_that_may_be_of_the_other_picture_are_told_so(files, capsys):
    hint = "pixels that were read off a rectified picture need --rectified"
    for flags, said in (((), hint), (("--rectified",), "")):
        assert run(files, "--between", "630,470", "320,240", *flags, "--force", scan=None) == 2
        error = capsys.readouterr().err
        assert "pixel 630,470" in error and (hint in error) == bool(said)


@pytest.fixture
def boards(files):
    """Pictures and scans of the laser's boards, and the rig without its laser."""
    StereoRig.save(RECT.rig, files / "rig.json")
    for name, data in walk_folder._boards():  # rendered once for all tests
        write_atomic(files / ("scans" if name.endswith(".bin") else "pictures") / Path(name).name, data)
    return files


def test_how_far_two_poses_lie_apart():
    here, there = np.eye(4), np.eye(4)
    there[:3, :3], there[:3, 3] = cv2.Rodrigues(np.array([0.0, np.radians(3.0), 0.0]))[0], (3.0, 0.0, -4.0)
    assert apart(here, there) == pytest.approx((5.0, 3.0)) and apart(there, there) == pytest.approx((0.0, 0.0))


def test_command_finds_the_laser_from_files(boards, capsys):
    words = ["calibrate-laser", boards / "pictures", boards / "scans", "--calibration", boards / "rig.json"]
    words = [str(word) for word in (*words, "--board", "6x9", "--square-mm", "30")]
    true = recordings.setup() @ rigid(np.eye(3), [0.0, 0.0, walk.LASER_HEIGHT_MM])
    save_laser_pose(boards / "rig.json", replace(LIDAR, T_left_lidar=true))
    assert commands.main([*words, "--margin-mm", "24"]) == 0
    said = capsys.readouterr().out
    found = Instrument.load(boards / "rig.json").lidar
    off_mm = np.linalg.norm((found.T_left_lidar - true)[:3, 3])
    assert "10 poses" in said and f"is replaced: this one lies {off_mm:.1f} mm and 0." in said
    too = "far" if found.scale >= 0 else "near"
    reads = f"it reads {100 * abs(found.scale):.1f} ± {100 * found.std_scale:.1f} % too {too} if the squares are 30 mm"
    assert reads in said
    off = (np.linalg.inv(true) @ found.T_left_lidar)[:3, 3]
    assert (np.abs(off) < 4 * found.std_mm).all() and found.std_mm.max() < 5
    rig = json.loads((boards / "rig.json").read_text())
    (boards / "rig.json").write_text(json.dumps(rig | {"lidar": {"T_left_lidar": "damaged"}}))
    assert commands.main([*words, "--margin-mm", "24"]) == 0 and "is replaced" not in capsys.readouterr().out
    np.testing.assert_array_equal(Instrument.load(boards / "rig.json").lidar.T_left_lidar, found.T_left_lidar)
    scan = read_scan(boards / "scans" / "03.bin")
    told = zip(np.degrees(scan.angles_rad), scan.ranges_mm, strict=True)
    rows = [f"{angle:.1f},{mm:.2f}" if np.isfinite(mm) else f"{angle:.1f}," for angle, mm in told]
    (boards / "scans" / "03.csv").write_text("\n".join(["angle_deg,range_mm", *rows]) + "\n")
    (boards / "scans" / "03.bin").unlink()
    (boards / "scans" / "notes.txt").write_text("the door was open")
    capsys.readouterr()
    assert commands.main([*words, "--margin-mm", "24"]) == 0  # a table is a scan, too
    assert "warning: not read, as no .bin or .csv: notes.txt" in capsys.readouterr().out
    (boards / "scans" / "notes.txt").unlink()
    table = Instrument.load(boards / "rig.json").lidar
    np.testing.assert_allclose(table.T_left_lidar[:3, 3], found.T_left_lidar[:3, 3], atol=0.5)
    (boards / "scans" / "03.csv").rename(boards / "scans" / "03.txt")
    assert commands.main(words) == 2
    told = capsys.readouterr().err
    assert "one scan for each picture" in told and told.rstrip().endswith("not read, as no .bin or .csv: 03.txt")


def test_scans_that_are_mirrored_or_shifted_are_told_so(boards, capsys):
    """A table of clockwise angles fits a laser that hangs upside down; one scan too few at the start shifts all."""
    words = ["calibrate-laser", boards / "pictures", boards / "tables", "--calibration", boards / "rig.json"]
    words = [str(word) for word in (*words, "--board", "6x9", "--square-mm", "30", "--margin-mm", "24")]
    ranges = [read_scan(path).ranges_mm for path in sorted((boards / "scans").iterdir())]
    (boards / "tables").mkdir()

    def write(scans):
        for k, scan in enumerate(scans):
            rows = [f"{angle},{mm:.1f}" if np.isfinite(mm) else f"{angle}," for angle, mm in enumerate(scan)]
            (boards / "tables" / f"{k + 1:02d}.csv").write_text("\n".join(["angle_deg,range_mm", *rows]) + "\n")

    write(ranges)
    assert commands.main(words) == 0 and "clockwise" not in capsys.readouterr().out
    write([np.roll(scan[::-1], 1) for scan in ranges])
    assert commands.main([*words, "--force"]) == 0
    assert "hangs upside down, or its angles run clockwise" in capsys.readouterr().out
    write([*ranges[1:], ranges[0]])
    assert commands.main(words) == 2 and "belong" in capsys.readouterr().err


def test_the_old_name_of_the_picture_is_taken(files, capsys):
    assert run(files, "--picture", files / "mine.png") == 0
    assert f"picture: {files / 'mine.png'}" in capsys.readouterr().out and (files / "mine.png").exists()


def test_exchanged_pictures_and_another_size_are_said_with_their_files(files, capsys):
    for side in ("left", "right"):
        (files / f"{side}.png").rename(files / f"old_{side}.png")
    for side, other in (("left", "right"), ("right", "left")):
        cv2.imwrite(str(files / f"{side}.png"), cv2.imread(str(files / f"old_{other}.png")))
    assert run(files) == 2
    assert "right.png: left and right are exchanged" in capsys.readouterr().err
    for side in ("left", "right"):
        cv2.imwrite(str(files / f"{side}.png"), cv2.imread(str(files / f"old_{side}.png"))[::2, ::2])
    sizes = f"the left image is 320x240, {files / 'rig.json'} is for 640x480"
    for more in ([], ["--floor=450,-20"]):
        assert run(files, *more) == 2
        assert sizes in (said := capsys.readouterr().err) and (more or f"right.png: {sizes}" in said)


def test_places_are_left_or_right_by_a_positive_number(files, capsys):
    for side, image in zip(("left", "right"), recordings.load_pair("room/1"), strict=True):
        cv2.imwrite(str(files / f"{side}.png"), image)
    (files / "scan.bin").write_bytes(walk.scan_bytes("room/1"))
    assert run(files) == 0
    said = capsys.readouterr().out
    assert "mm right" in said and not re.search(r"[-+]\d+ mm (left|right)", said)


def test_a_pair_too_dark_for_the_floor_leaves_the_scan_alone_without_contradiction(files, capsys):
    noise = np.random.default_rng(0).integers(0, 11, (480, 640, 3)).astype(np.uint8)
    cv2.imwrite(str(files / "left.png"), noise)
    run(files, "--json")
    warnings = json.loads(capsys.readouterr().out)["warnings"]
    assert "What follows is the scan's alone" in warnings[0] and not any("pair's alone" in text for text in warnings)


@cache
def seen_in_room(pair):
    """Pair of the walk, matched, and what stands in it: scans are measured with it in a moment."""
    known = Instrument(RECT, walk_laser())
    return see_standing(*see_pair(*recordings.load_pair(f"room/{pair}"), known))


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    return save_laser_pose(StereoRig.save(RECT.rig, tmp_path_factory.mktemp("room") / "rig.json"), walk_laser())


def measure_room(rig, out, pair, scan, *more):
    files = [
        data_path(f"virtual/room/{name}") for name in (f"{pair}_left.jpg", f"{pair}_right.jpg", f"{scan}_scan.bin")
    ]
    words = ["measure", *files[:2], "--scan", files[2], "--calibration", rig, "--output", out, "--force", *more]
    return commands.main([str(word) for word in words])


def test_the_same_of_several_sizes_is_told_once(room):
    _, second, *_ = measure_objects(
        *recordings.load_pair("room/2"), recordings.scan("room/2"), Instrument.load(room)
    ).objects
    assert second.unsure["length"] == second.unsure["width"] and second.reasons["height"]
    told = object_details(replace(second, reasons={"object": Why(Reason.NO_FACE)} | second.reasons), "here")
    assert told[-3:] == [
        f"length and width unsure: {second.unsure['width']}",
        f"no height: {second.reasons['height']}",
        str(Why(Reason.NO_FACE)),
    ]


@pytest.mark.parametrize("pair", range(1, 6))
def test_a_scan_is_told_to_be_of_another_place(pair):
    alone = len(_boxes(measure_standing(seen_in_room(pair), None)))
    for scan in range(1, 6):
        found = measure_standing(seen_in_room(pair), recordings.scan(f"room/{scan}"))
        assert found.scan_fit is (ScanFit.AGREES if scan == pair else ScanFit.OPPOSES), scan
        assert len(_boxes(found)) == alone or scan == pair


def _boxes(measured):
    return [thing.size_mm.tolist() for thing in measured.objects if np.isfinite(thing.size_mm).all()]


@pytest.mark.parametrize("other", [1, 2, 4, 5])
def test_a_scan_of_another_place_adds_no_sizes(other):
    """Nothing but the two boxes in the pictures, which the pair alone measures."""
    found = measure_standing(seen_in_room(3), recordings.scan(f"room/{other}"))
    sized = [thing for thing in found.objects if np.isfinite(thing.size_mm[1])]
    assert sorted(round(thing.size_mm[0], -1) for thing in sized) == [300, 400]
    assert any(
        "is it of this place and moment, its distances in mm, " in text and text.endswith("is left out")
        for text in found.warnings
    )


@pytest.mark.parametrize("turn_deg", [30, 90, 180, 210, 300])
def test_a_turned_scan_takes_no_box_away(turn_deg):
    """A laser fixed the wrong way round: the boxes are the pair's, and it is said that nothing agrees."""
    seen, scan = seen_in_room(3), recordings.scan("room/3")
    alone = measure_standing(seen, None)
    found = measure_standing(seen, replace(scan, ranges_mm=np.roll(scan.ranges_mm, turn_deg)))
    assert len(_boxes(found)) == 2
    np.testing.assert_allclose(sorted(_boxes(found)), sorted(_boxes(alone)), atol=0.5)
    assert found.scan_fit is ScanFit.OPPOSES and any("What it alone shows is left out" in t for t in found.warnings)


def test_what_has_no_size_says_why_in_text_and_picture(room, tmp_path, capsys):
    assert measure_room(room, tmp_path / "out.png", 3, 3) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "left out" not in text
    assert re.search(r"face: \? x 1[56]\d\.\d ± [\d.]+ x \? mm", text)  # beside the pictures: the right scan tells it
    assert re.search(r"also seen, but not measurable: \d+ mm ahead, \d+ mm left: only one face is seen", text)


def test_a_thing_without_sizes_is_labelled_with_its_reason(room):
    measured = measure_objects(*recordings.load_pair("room/3"), recordings.scan("room/1"), Instrument.load(room))
    (nameless,) = [thing for thing in measured.objects if not np.isfinite(thing.size_mm).any()]
    assert why_text(nameless) == "no size: depth hidden, cut, top cut"
    with_all, others = (draw_objects(each) for each in (measured, replace(measured, objects=measured.objects[:-1])))
    assert nameless is measured.objects[-1] and (with_all != others).any()
    brighter = (with_all.astype(int) - others > 60).all(axis=2)
    assert brighter.sum() > 50  # letters


def test_where_the_laser_stands_is_said_without_a_minus():
    assert place_text(-1.2, 24.0, -5.0) == "1 mm left of, 24 mm below and 5 mm behind"
    assert place_text(40.0, -3.0, 5.0) == "40 mm right of, 3 mm above and 5 mm before"


def test_where_the_laser_points_is_said_without_a_minus():
    down, ahead = np.sin(np.radians(-1.25)), np.cos(np.radians(-1.25))
    assert turn_text(0.0, down, ahead) == "0.0 degrees right of and 1.2 degrees above"
    assert turn_text(-0.01, 0.0, -1.0) == "179.4 degrees left of and 0.0 degrees below"  # mounted the other way round
    assert LIDAR.T_left_lidar[2, 0] > 0.98  # its angle 0 is about where the cameras look


def test_pictures_and_scans_are_paired_by_name_or_number_and_never_by_order(tmp_path):
    for name in ("1.jpg", "2.jpg", "03.jpg"):
        (tmp_path / name).write_bytes(b"")
    scans = tmp_path / "scans"
    scans.mkdir()
    for name in ("scan_03.bin", "laser2.bin", "1_scan.bin"):
        (scans / name).write_bytes(b"")
    pictures, files = _paired(str(tmp_path), scans)
    assert [path.name for path in pictures] == ["1.jpg", "2.jpg", "03.jpg"]
    assert [path.name for path in files] == ["1_scan.bin", "laser2.bin", "scan_03.bin"]
    (scans / "laser2.bin").rename(scans / "laser4.bin")
    with pytest.raises(ValueError, match=r"3 pictures .* 3 scans .* without a partner: 2\.jpg(,| and) laser4\.bin"):
        _paired(str(tmp_path), scans)


def test_a_calibration_judged_bad_is_said_before_any_size(files, capsys):
    rig = json.loads((files / "rig.json").read_text())
    rig["calibration"] |= {"verdict": "bad", "reasons": ["squares"]}
    (files / "bad.json").write_text(json.dumps(rig))
    for more in ((), ("--between", "300,250", "320,250", "--force")):
        assert run(files, *more, rig="bad.json", scan=None) == 0
        said = capsys.readouterr().out.splitlines()
        assert said[0].startswith("warning: ") and "was judged bad when it was made (squares)" in " ".join(
            " ".join(said[:2]).split()
        )
        assert sum("judged bad" in line for line in said) == 1
