"""Folders of recordings to one map: pairs and scans, one of both, and what lies below the laser's plane."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from support import walks

from stereolib.mapping import (
    OCCUPIED,
    NothingToMap,
    RecordedMap,
    list_stations,
    map_recordings,
    merge_stations,
    occupancy_grid,
)
from stereolib.measurement import Instrument, LaserOnFloor, Measurement, Reason, ScanFit, Source, disagreement
from stereolib.paper import paper_rig
from stereolib.virtual import (
    Material,
    Scene,
    VirtualLidar,
    Webcam,
    box_on_floor,
    recordings,
    render_pair,
    walk,
    walk_folder,
    walk_laser,
)

INSTRUMENT = Instrument(recordings.rectified(), walk_laser())
LOW, HIGH = ((220.0, 160.0, 40.0), (820.0, 60.0)), ((200.0, 150.0, 180.0), (900.0, -190.0))


@pytest.fixture
def walked(tmp_path):
    walk_folder.write_walk(tmp_path)
    return tmp_path


MORE = (-300.0, 700.0, -0.6)  # one more place in the room of the walk


def remove(folder, *names):
    for name in names:
        (folder / name).unlink()


def mapped(folder, poses=None):
    return map_recordings(list_stations(folder, poses).stations, INSTRUMENT)


def true_sizes(recorded, to_room):
    return [walk.nearest_box(to_room(thing.position_mm)).size_mm for thing in recorded.room.measured]


def test_scans_place_pairs_and_scans_alone(walked):
    """Stations 1 and 3 with pictures, another by its scan alone, 2 without a scan: where it stood nobody knows."""
    remove(walked, "2_scan.bin", *(f"{k}_{part}" for k in "45" for part in ("left.jpg", "right.jpg", "scan.bin")))
    (walked / "more_scan.bin").write_bytes(walks.more_scan_bytes(MORE))
    recorded = mapped(walked)
    assert [s.name for s in recorded.room.stations] == ["1", "3", "more"]
    assert recorded.left_out == {"2": "it has no scan to be placed by: give its pose"}
    assert list(recorded.apart) == ["2"]  # what it measured is told all the same
    tall = max(recorded.apart["2"].objects, key=lambda thing: np.nan_to_num(thing.size_mm[2]))
    assert (np.abs(tall.size_mm - (280, 180, 380)) < 4 * tall.std_mm).all()
    c, s = np.cos(walk.POSES["room/1"][2]), np.sin(walk.POSES["room/1"][2])
    boxes = true_sizes(recorded, lambda p: np.array([[c, -s], [s, c]]) @ p + walk.POSES["room/1"][:2])
    whole = [(thing, true) for thing, true in zip(recorded.room.measured, boxes, strict=True) if thing.shape == "box"]
    assert {true for _, true in whole} >= {(400, 250, 300), (300, 200, 200), (200, 160, 100)}
    for thing, true in whole:
        assert (np.abs(thing.size_mm - true) < 4 * thing.std_mm)[np.isfinite(thing.size_mm)].all()
    scanned = recorded.room.stations[2]
    assert scanned.objects and all(np.isnan(thing.size_mm[2]) for thing in scanned.objects)
    assert {thing.reasons["height"].reason for thing in scanned.objects} == {Reason.NO_FLOOR}
    assert {str(thing.reasons["height"]) for thing in scanned.objects} == {
        f"the station has no pictures: {Reason.NO_FLOOR.value}"
    }
    assert recorded.measured["more"].warnings == () and recorded.measured["more"].floor is None
    assert len(recorded.cloud().points_mm) > 1000


def test_given_poses_bring_pictures_alone_into_the_map(walked):
    parts = ("left.jpg", "right.jpg", "scan.bin")
    remove(walked, "1_left.jpg", "1_right.jpg", "3_scan.bin", *(f"{k}_{part}" for k in "245" for part in parts))
    poses = walked / "true_poses.csv"
    poses.write_text("\n".join(line for line in poses.read_text().splitlines() if line[0] in "s13"))
    recorded = mapped(walked, poses)
    assert not recorded.left_out and len(recorded.room.stations[1].scan_mm) == 0
    boxes = true_sizes(recorded, lambda p: p)
    thing = recorded.room.measured[boxes.index((400.0, 250.0, 300.0))]
    assert thing.size_mm == pytest.approx((400, 250, 300), abs=4)
    assert thing.sources["station 3"] is Source.IMAGE


def test_pictures_whose_scan_is_of_another_place_add_nothing_unless_their_pose_is_given(walked):
    """The scan of station 3 beside the pictures of 5: laid over the others it says where those never stood."""
    remove(walked, *(f"{k}_{part}" for k in "24" for part in ("left.jpg", "right.jpg", "scan.bin")))
    (walked / "5_scan.bin").write_bytes((walked / "3_scan.bin").read_bytes())
    lost = mapped(walked)
    assert [s.name for s in lost.room.stations] == ["1", "3"] and list(lost.left_out) == ["5"]
    assert "agrees with nothing" in lost.left_out["5"] and "give its pose" in lost.left_out["5"]
    assert lost.apart["5"].scan_fit is ScanFit.OPPOSES and lost.measured["3"].scan_fit is ScanFit.AGREES
    assert all("5" not in {seen.name for seen in each.sightings} for each in lost.room.objects)
    poses = walked / "true_poses.csv"
    poses.write_text("\n".join(line for line in poses.read_text().splitlines() if line[0] in "s135"))
    given = mapped(walked, poses)
    assert not given.left_out and any("agrees with nothing" in text for text in given.warnings)
    station = given.room.stations[2]
    assert len(station.scan_mm) == 0
    for item in station.objects:  # of what the pictures alone refuse nothing is told, by no sensor
        assert item.sources["lines"] is not Source.SCAN if item.sources else np.isnan(item.size_mm).all()
    for thing, true in zip(given.room.measured, true_sizes(given, lambda p: p), strict=True):
        assert (np.abs(thing.size_mm - true) < 4 * thing.std_mm)[np.isfinite(thing.size_mm)].all()


def test_scans_that_are_all_turned_are_told_so_once(walked):
    stations = list_stations(walked).stations
    for each in stations:
        ranges_mm = np.roll(each.read_scan().ranges_mm, 180)
        table = "\n".join(f"{k},{mm:.0f}" for k, mm in enumerate(ranges_mm) if np.isfinite(mm))
        each.scan.with_suffix(".csv").write_text(f"angle_deg,range_mm\n{table}\n")
        each.scan.unlink()
    unknown = replace(INSTRUMENT, lidar=None)
    found = map_recordings(list_stations(walked).stations, unknown)
    assert "with 0 where the cameras look" in found.warnings[0]
    assert len(found.left_out) == 4 and all("see the first warning" in text for text in found.left_out.values())
    assert not found.room.walls and len(found.room.measured) == 1


@pytest.fixture
def low(tmp_path):
    """A station before a box that is lower than the laser's plane, and one that is not."""
    material = Material((0.34, 0.46, 0.58), 0.4, 6.0, 3)
    boxes = [box_on_floor(size, *place, 0.5, material) for size, place in (LOW, HIGH)]
    room = walk.walk_scene()
    scene = Scene((room.boxes[0], *boxes), room.lights, ambient=0.3)
    lights = render_pair(scene, paper_rig(), recordings.setup(), samples=1, light_samples=1)
    for side, light in zip(("left", "right"), lights, strict=True):
        cv2.imwrite(str(tmp_path / f"a_{side}.png"), Webcam().shoot(light, np.random.default_rng(len(side))))
    sensor = VirtualLidar(height_mm=walk.LASER_HEIGHT_MM)
    (tmp_path / "a_scan.bin").write_bytes(sensor.scan(scene, (0.0, 0.0, 0.0), np.random.default_rng(2), turns=5))
    return tmp_path


def test_a_box_below_the_laser_is_measured_by_the_pair(low):
    recorded = mapped(low)
    found = {tuple(np.rint(thing.position_mm / 50)): thing for thing in recorded.room.measured}
    assert len(found) == 2
    for (size, place), below in ((LOW, True), (HIGH, False)):
        thing = min(found.values(), key=lambda each: float(np.linalg.norm(each.position_mm - place)))
        assert thing.size_mm == pytest.approx(size, abs=3)
        assert thing.sources["lines"] is (Source.IMAGE if below else Source.BOTH)
        assert ("object" in thing.reasons) is below
        for objects, taken in (((), False), (recorded.room.measured, True)):  # beams pass over the low one
            grid = occupancy_grid(recorded.room.stations, objects=objects)
            assert (grid.at(np.array([place]))[0] == OCCUPIED) is np.bool_(taken)


def test_a_pair_that_does_not_fit_leaves_out_its_own_station(walked):
    def exchange(name):
        sides = [walked / f"{name}_{side}.jpg" for side in ("left", "right")]
        left, right = (side.read_bytes() for side in sides)
        sides[0].write_bytes(right), sides[1].write_bytes(left)

    remove(walked, *(f"{k}_{part}" for k in "25" for part in ("left.jpg", "right.jpg", "scan.bin")))
    exchange("3")
    recorded = mapped(walked)
    assert [s.name for s in recorded.room.stations] == ["1", "4"] and list(recorded.left_out) == ["3"]
    assert "left and right are exchanged" in recorded.left_out["3"] and recorded.room.measured
    remove(walked, *(f"{k}_{part}" for k in "14" for part in ("left.jpg", "right.jpg", "scan.bin")))
    with pytest.raises(ValueError, match=r"^station 3: left and right are exchanged"):
        mapped(walked)


def test_a_station_without_a_floor_whose_scan_cannot_be_read_says_both(walked):
    remove(walked, *(f"{k}_{part}" for k in "345" for part in ("left.jpg", "right.jpg", "scan.bin")))
    for side in ("left", "right"):
        cv2.imwrite(str(walked / f"2_{side}.jpg"), np.full((480, 640, 3), 90, np.uint8))
    (walked / "2_scan.bin").write_bytes(b"no laser" * 99)
    recorded = mapped(walked)
    assert [s.name for s in recorded.room.stations] == ["1"] and list(recorded.left_out) == ["2"]
    assert "2_scan.bin (792 bytes) is no XV-11 recording" in recorded.left_out["2"]
    assert "; no floor" in recorded.left_out["2"] and not any("2_scan" in text for text in recorded.warnings)


def test_nothing_to_map_is_said_with_its_reasons(tmp_path):
    grey = np.full((480, 640, 3), 90, np.uint8)
    for side in ("left", "right"):
        cv2.imwrite(str(tmp_path / f"hall_{side}.png"), grey)
    with pytest.raises(NothingToMap, match=r"no station could be measured\. station hall: no floor"):
        mapped(tmp_path)
    for side in ("left", "right"):
        cv2.imwrite(str(tmp_path / f"door_{side}.png"), grey)
    with pytest.raises(NothingToMap) as refused:  # once, of both
        mapped(tmp_path)
    assert "stations door, hall: no floor" in str(refused.value) and str(refused.value).count("no floor") == 1


def test_a_warning_of_an_object_has_its_station_and_what_the_map_calls_it():
    rng = np.random.default_rng(0)
    room = merge_stations([replace(walks.station(k, rng), name=f"at {k}") for k in walks.SEEN], rng=rng)
    seen = room.stations[2].objects
    nothing = np.zeros((1, 1), np.uint8)
    here = LaserOnFloor(np.eye(2), np.zeros(2), np.eye(4))
    told = seen[0], replace(seen[1], disagrees=True), *seen[2:]
    found = Measurement(
        told, ("rows are off",), None, here, np.zeros((0, 2)), nothing, nothing, nothing.astype(np.float32)
    )
    letter = room.names[(3, 0, 1, 4, 2).index(list(walks.SEEN[3])[1])]  # boxes by their distance from the origin
    assert RecordedMap(room, {"at 3": found}, {}, (), {}).said_of("at 3") == [
        "rows are off",
        disagreement(seen[1], letter),
    ]
