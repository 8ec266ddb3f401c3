"""The chain behind the bench: nothing is computed twice, half size agrees with full, each source works."""

from __future__ import annotations

import re
import threading
from dataclasses import replace

import cv2
import numpy as np
import pytest

from stereolib.matching import SGBMParams, compute_disparity
from stereolib.measurement import Measurement, Reason
from stereolib.notebook import chain, offered, steps
from stereolib.notebook.explorer_panels import draw_panels
from stereolib.notebook.explorer_results import result_line
from stereolib.notebook.knobs import FILTERS, MOTORCYCLE, OWN, VIRTUAL, State, knobs
from stereolib.virtual import Webcam, recordings

TEXTURE = State(source="conditions/texture")
STEPS = {name: step for name, step in vars(chain).items() if isinstance(step, steps.Step)}


@pytest.fixture
def counted(monkeypatch):
    """How often each step is computed."""
    counts = dict.fromkeys(STEPS, 0)
    for name, step in STEPS.items():

        def make(state, name=name, made=step.make):
            counts[name] += 1
            return made(state)

        monkeypatch.setattr(step, "make", make)
        step._made.clear()
    return counts


def own(tmp_path, *, calibration=True, size=(640, 480)):
    left, right = (cv2.resize(image, size) for image in recordings.load_pair("conditions/texture"))
    files = [str(tmp_path / f"{side}.png") for side in ("left", "right")]
    for file, image in zip(files, (left, right), strict=True):
        cv2.imwrite(file, image)
    rig = str(recordings.rectified().rig.save(tmp_path / "calibration.json")) if calibration else ""
    return State(source=OWN, own=(*files, rig, ""))


@pytest.mark.parametrize(
    ("turned", "again"),
    [
        ({"tolerance_px": 9.0}, {"recipe"}),
        ({"filter": "median"}, {"filtered", "recipe", "quality"}),
        ({"uniqueness_ratio": 20}, {"matched", "disparity", "filtered", "recipe", "quality"}),
        ({"turns": 9}, {"scan", "measured", "disparity", "filtered", "recipe", "quality"}),
    ],
)
def test_only_what_depends_on_the_knob_is_done_again(counted, turned, again):
    state = replace(State(), half=True)
    for step in STEPS.values():
        step(state)
    assert set(counted.values()) == {1}
    for _ in range(2):
        for step in STEPS.values():
            step(replace(state, **turned))
    assert {name for name, count in counted.items() if count == 2} == again
    assert set(counted.values()) == {1, 2}


def test_long_steps_are_taken_once_and_given_up_when_a_newer_state_came(counted):
    state = replace(State(), distance_mm=910)
    assert not chain.is_made(state, lambda: counted["taken"] + counted["known"] == 2)
    assert counted["taken"] == counted["known"] == 1 and counted["matched"] == counted["measured"] == 0
    assert chain.is_made(state, lambda: False)
    assert draw_panels(state) and result_line(state)
    assert {name for name, count in counted.items() if count > 1} == {"scan", "measured"}  # also without the laser
    assert counted["scan"] == counted["measured"] == 2 and counted["ground_plane"] == counted["standing"] == 1


def test_a_long_step_holds_up_no_preview(counted, monkeypatch):
    """While the full map is computed, half sizes are shown, and a newer state does not wait for its end."""
    begun, go_on, made = threading.Event(), threading.Event(), chain.matched.make

    def slow(state):
        if not state.half:
            begun.set()
            assert go_on.wait(20)
        return made(state)

    monkeypatch.setattr(chain.matched, "make", slow)
    state = replace(TEXTURE, uniqueness_ratio=13)
    try:
        assert not chain.is_made(state, begun.is_set)
        assert draw_panels(replace(state, half=True)) and counted["matched"] == 1
    finally:
        go_on.set()
    assert chain.is_made(state, lambda: False) and counted["matched"] == 2


def test_a_step_that_fails_is_tried_again(counted, monkeypatch):
    made, tries = chain.matched.make, iter((True, False))

    def once(state):
        if next(tries):
            raise ValueError("too narrow")
        return made(state)

    monkeypatch.setattr(chain.matched, "make", once)
    state = replace(TEXTURE, half=True, uniqueness_ratio=12)
    with pytest.raises(ValueError, match="too narrow"):
        chain.filtered(state)
    assert chain.filtered(state).shape == (240, 320) and counted["matched"] == 1


def test_two_cameras_at_once_have_the_noise_that_one_after_the_other_has():
    state, rng = State(noise=2, exposure_ev=0.0), np.random.default_rng(4)
    webcam = Webcam(full_well_e=6000 / 4, read_noise_e=12 / 2)
    chain.taken.make(state)  # what draws the noise is kept, and not used up
    taken = chain.taken.make(state)
    for shot, light in zip((taken.left, taken.right), chain.light(state), strict=True):
        np.testing.assert_array_equal(shot, webcam.shoot(light, rng))


def test_results_are_forgotten_at_last(counted):
    for tolerance in range(30):
        chain.recipe(replace(TEXTURE, half=True, tolerance_px=tolerance))
    assert len(chain.recipe._made) <= 6 and counted["filtered"] == 1


def test_two_threads_share_a_step(counted):
    states = [replace(TEXTURE, tolerance_px=k % 9) for k in range(40)]
    faults: list[BaseException] = []

    def ask():
        try:
            for state in states:
                chain.recipe(state)
        except BaseException as fault:
            faults.append(fault)

    threads = [threading.Thread(target=ask) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not faults and counted["disparity"] == 1


def test_map_is_that_of_the_library():
    left, right = recordings.rectified().rectify(*recordings.load_pair("conditions/texture"))
    np.testing.assert_array_equal(
        chain.filtered(TEXTURE), compute_disparity(left, right, SGBMParams(num_disparities=160, block_size=5))
    )


@pytest.mark.parametrize("state", [State(), TEXTURE, State(source=MOTORCYCLE, num_disparities=64)], ids=str)
def test_half_agrees_with_full(state):
    small = replace(state, half=True)
    full, half = chain.filtered(state), chain.filtered(small)
    rows, columns = (2 * length for length in half.shape)
    difference = 2 * half - full[:rows:2, :columns:2]
    assert abs(float(np.nanmedian(difference))) < 0.3
    assert np.nanmedian(np.abs(difference)) < 0.6
    truth, small_truth = chain.known(state), chain.known(small)
    np.testing.assert_allclose(
        np.nanmedian(2 * small_truth.disparity_px - truth.disparity_px[:rows:2, :columns:2]), 0, atol=0.3
    )


@pytest.mark.parametrize("source", [VIRTUAL, "conditions/level", "series/fine_700", "room/1", MOTORCYCLE])
@pytest.mark.parametrize("window", ["all disparities", "around the laser's"])
def test_each_source_is_measured(source, window):
    state = State(source=source, window=window)
    assert source in offered.sources(state)
    for one in (replace(state, half=True), state):
        assert [picture.dtype for picture in draw_panels(one)] == [np.uint8] * 4
        assert "wrong or empty" in result_line(one)
    if source in (VIRTUAL, "conditions/level"):
        assert isinstance(chain.measured(state), Measurement)


def test_own_pair_with_and_without_its_calibration(tmp_path):
    state = own(tmp_path)
    assert OWN in offered.sources(state) and OWN not in offered.sources(TEXTURE)
    measured = chain.measured(state)
    assert isinstance(measured, Measurement)
    assert measured.objects[0].size_mm[2] == pytest.approx(300, abs=3)
    assert "unknown" in result_line(state)
    bare = own(tmp_path, calibration=False)
    assert chain.rectified_rig(bare) is None and chain.measured(bare) == "no calibration"
    assert "needs a calibration" in result_line(bare) and len(draw_panels(bare)) == 4


def test_own_files_are_checked(tmp_path):
    good = own(tmp_path).own
    offered.check_own(good)
    text = tmp_path / "text.png"
    text.write_text("no picture")
    with pytest.raises(ValueError, match=r"text\.png"):
        offered.check_own((good[0], str(text), "", ""))
    with pytest.raises(ValueError, match=r"text\.png"):
        offered.check_own((*good[:2], str(text), ""))
    small = tmp_path / "small.png"
    cv2.imwrite(str(small), cv2.imread(good[1])[::2, ::2])
    with pytest.raises(ValueError, match=r"small\.png"):
        offered.check_own((good[0], str(small), "", ""))
    cv2.imwrite(str(tmp_path / "other.png"), cv2.imread(good[0])[::2, ::2])
    with pytest.raises(ValueError, match=r"other\.png and small\.png do not fit calibration\.json: .*320"):
        offered.check_own((str(tmp_path / "other.png"), str(small), good[2], ""))


@pytest.mark.slow
def test_idle_knobs_change_nothing_and_the_others_are_offered():
    """Every knob is idle in one of these states, or none; where it is, its ends give the same pictures."""
    states = [State(half=True), replace(TEXTURE, half=True), State(source=MOTORCYCLE, half=True, matcher="fast")]
    assert "distance_mm" not in offered.idle(states[0])
    for state in states:
        first = draw_panels(state), chain.filtered(state)
        for name in offered.idle(state):
            knob = knobs()[name]
            value = (not getattr(state, name)) if isinstance(getattr(state, name), bool) else knob.high
            value = knob.choices[-1] if knob.choices else value
            if name in ("min_disparity", "matcher"):  # the colours' range; the state's own
                continue
            turned = replace(state, **{name: value})
            np.testing.assert_array_equal(chain.filtered(turned), first[1], err_msg=name)
            for before, after in zip(first[0], draw_panels(turned), strict=True):
                np.testing.assert_array_equal(before, after, err_msg=name)


@pytest.mark.parametrize("name", FILTERS)
def test_kernel_is_idle_for_the_filters_that_have_none(name):
    state = replace(TEXTURE, half=True, filter=name)
    small, large = (chain.filtered(replace(state, kernel_px=size)) for size in (5, 25))
    assert np.array_equal(small, large, equal_nan=True) == ("kernel_px" in offered.idle(state))


def test_a_wrong_calibration_shows():
    for knob, value in (("roll_deg", 1.0), ("row_px", 3.0)):
        assert chain.quality(replace(TEXTURE, **{knob: value})).bad2_pct > 2 * chain.quality(TEXTURE).bad2_pct
    longer = chain.rectified_rig(replace(TEXTURE, baseline_pct=5.0))
    assert longer.baseline_mm == pytest.approx(1.05 * chain.rectified_rig(TEXTURE).baseline_mm)


@pytest.mark.parametrize("camera_height_mm", [250, 300, 350])
def test_a_box_whose_foot_lies_below_the_picture_is_refused_for_that(camera_height_mm):
    """From 300 mm on no edge of it is seen either."""
    state = State(camera_height_mm=camera_height_mm)
    assert chain.ground_plane(state).why == Reason.FOOT_CUT.value
    assert "in the air" not in result_line(state) and "foot lies below" in result_line(state)


@pytest.mark.parametrize(
    "turned", [{"camera_height_mm": 600}, {"pitch_deg": -25.0}, {"pitch_deg": 15.0}, {"baseline_mm": 200}], ids=str
)
def test_a_camera_at_the_end_of_its_knobs_is_measured_or_refused_with_a_reason(turned):
    state = replace(State(), **turned)
    attempt = chain.ground_plane(state)
    assert attempt.why if attempt.refused else abs(attempt.height_mm - 300) < 5 * attempt.std_mm + 1
    assert len(draw_panels(state)) == 4 and "nan" not in result_line(state)


def test_a_turned_laser_is_found():
    said = " ".join(chain.measured(replace(TEXTURE, laser_yaw_deg=2.0)).warnings)
    turned, std = map(float, re.search(r"turned by ([-\d.]+) ± ([\d.]+) degrees", said).groups())
    assert abs(turned - 2.0) < 1.5 * std < 0.2
