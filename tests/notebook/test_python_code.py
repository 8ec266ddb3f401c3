"""The lines that the bench hands out, run by a fresh Python: the same map to the byte."""

from __future__ import annotations

import base64
import hashlib
import io
import re
import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest

from stereolib.notebook import chain, python_code
from stereolib.notebook.knobs import MOTORCYCLE, OWN, State
from stereolib.plotting import color_disparity
from stereolib.virtual import recordings

TEXTURE = State(source="conditions/texture")
TELL = "\nimport hashlib; print(disparity_px.dtype, hashlib.sha256(disparity_px.tobytes()).hexdigest())"


@pytest.fixture(scope="module")
def states(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own")
    files = [str(folder / f"{side}.png") for side in ("left", "right")]
    for file, image in zip(files, recordings.load_pair("conditions/texture"), strict=True):
        cv2.imwrite(file, image)
    rig = str(recordings.rectified().rig.save(folder / "calibration.json"))
    return {
        "recording": State(source="conditions/plain", p1=4, uniqueness_ratio=5, mode="hh"),
        "filter": State(source="conditions/texture", filter="left_right", kernel_px=7, row_px=0.5),
        "pipeline": State(source="series/fine_700", matcher="fast", filter="closing"),
        "virtual rig": State(distance_mm=800, gloss=0.3, baseline_mm=110, exposure_ev=0.5),
        "laser's window": State(window="around the laser's", laser_yaw_deg=1.0),
        "own pair": State(source=OWN, own=(*files, rig, ""), filter="dilation", kernel_shape="cross"),
        "own pair, wrong baseline": State(source=OWN, own=(*files, rig, ""), baseline_pct=2.0),
        "own pair, laser's window": State(source=OWN, own=(*files, rig, ""), window="around the laser's"),
        "own pair, rectified": State(source=OWN, own=(*files, "", ""), block_size=9),
        "motorcycle": State(source=MOTORCYCLE, num_disparities=64),
    }


@pytest.fixture(scope="module")
def ran(states):
    """What a fresh Python prints of each: the lines alone, none seeing the others' names."""
    codes = [python_code.of(state) + TELL for state in states.values()]
    program = f"for code in {codes!r}:\n    exec(code, {{}})\n    print('---')"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    return dict(zip(states, done.stdout.split("---\n"), strict=False))


NAMES = ("recording", "filter", "pipeline", "virtual rig", "laser's window", "own pair", "own pair, wrong baseline",
         "own pair, laser's window", "own pair, rectified", "motorcycle")  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_code_makes_the_same_map(states, ran, name):
    map_px = chain.filtered(states[name])
    assert ran[name].splitlines()[-1] == f"{map_px.dtype} {hashlib.sha256(map_px.tobytes()).hexdigest()}"


def test_code_reads_what_the_page_reads(states, ran):
    for name in ("filter", "virtual rig"):
        told = ran[name].splitlines()[0]
        assert told.startswith(f"{chain.recipe(states[name]).height_mm:.0f} mm ")
        assert f"{chain.ground_plane(states[name]).height_mm:.1f} ±" in told


def test_files_to_take_away_hold_the_map():
    state = replace(TEXTURE, min_disparity=32)
    links = python_code.download_links(state)
    files = {}
    for link in links:
        name, data = re.fullmatch(r'<a download="([^"]+)" href="data:[^;]+;base64,([^"]+)">[^<]+</a>', link).groups()
        files[name] = base64.b64decode(data)
    map_px = np.load(io.BytesIO(files["disparity.npy"]), allow_pickle=False)
    np.testing.assert_array_equal(map_px, chain.filtered(state))
    colors = cv2.imdecode(np.frombuffer(files["disparity.png"], np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(colors, color_disparity(map_px, *state.colors_px))
    left = cv2.imdecode(np.frombuffer(files["left.png"], np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(left, chain.pair(TEXTURE)[0])
    points = int(re.search(rb"element vertex (\d+)", files["points.ply"])[1])
    assert points == (map_px > 0).sum()
    assert not any("points.ply" in link for link in python_code.download_links(State(source=MOTORCYCLE)))
