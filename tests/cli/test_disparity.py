"""``stereolib disparity``: what it writes against the library, and what it refuses."""

from __future__ import annotations

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from stereolib import paper, plotting
from stereolib.base import data_path
from stereolib.cli import commands
from stereolib.matching import stereo_pipeline
from stereolib.virtual import recordings

NAME = "conditions/texture"


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    folder, files = tmp_path_factory.mktemp("pair"), []
    rectified = recordings.rectified().rectify(*recordings.load_pair(NAME))
    for side, image in zip(("left", "right"), rectified, strict=True):
        files.append(str(folder / f"{side}.png"))
        cv2.imwrite(files[-1], image)
    return files


@pytest.fixture(scope="module")
def half(pair):
    """The pair at half its size: quicker."""
    files = [file.replace(".png", "_half.png") for file in pair]
    for file, smaller in zip(pair, files, strict=True):
        cv2.imwrite(smaller, cv2.resize(cv2.imread(file), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    return files


@pytest.fixture
def undrawn(monkeypatch):
    """Where what is printed is looked at: the picture takes as long as all the rest."""
    monkeypatch.setattr("stereolib.cli.disparity._draw", lambda *_: None)


def run(*words):
    return commands.main(["disparity", *map(str, words)])


def test_a_rectified_pair(pair, tmp_path, capsys):
    out = tmp_path / "d.npy"
    assert run(*pair, "--pipeline", "fast", "--output", out) == 0
    found = np.load(out, allow_pickle=False)
    expected = stereo_pipeline("fast", None)(*(cv2.imread(file) for file in pair)).disparity_px
    assert found.dtype == np.float32
    refused = np.isnan(found)
    np.testing.assert_array_equal(found[~refused], expected[~refused])
    assert refused.mean() < 0.01  # patches that no other matching knows
    assert len(np.unique(cv2.imread(str(tmp_path / "d.png")).reshape(-1, 3), axis=0)) > 100
    assert sorted(path.name for path in tmp_path.glob("d*")) == ["d.npy", "d.png"]
    said = capsys.readouterr().out
    assert "no --calibration, so that nothing is told in millimetres" in said
    shares = [float(share) for share in re.findall(r"([0-9.]+) % (?:matched|filled|refused)", said)]
    assert len(shares) == 3 and sum(shares) == pytest.approx(100, abs=0.2)
    assert shares[0] < 95 and shares[1] > 5 and shares[2] < 1  # what one camera alone sees is filled, and said to be


@pytest.mark.usefixtures("undrawn")
def test_a_range_that_is_too_small_is_told(half, tmp_path, capsys):
    """The nearest surface has 80 px of disparity."""
    words = [*half, "--pipeline", "fast", "--output", tmp_path / "d.npy", "--force"]
    assert run(*words, "--max-disparity", 32) == 0
    assert re.search(r"warning: \d\d\.\d % of the .* beyond --max-disparity 32: .* leave the option out", told(capsys))
    assert run(*words, "--max-disparity", 96) == 0
    assert "warning" not in told(capsys)
    assert run(*words) == 0
    assert "warning" not in told(capsys)
    assert 77 < np.nanmax(np.load(tmp_path / "d.npy", allow_pickle=False)) < 88


def test_a_range_is_a_number_or_auto(pair, capsys):
    with pytest.raises(SystemExit, match="2"):
        run(*pair, "--max-disparity", "many")
    assert "'many' is not a whole number from 1 to 32768 pixels, nor auto" in capsys.readouterr().err


def told(capsys):
    return capsys.readouterr().out


@pytest.fixture
def raw(tmp_path):
    calibration = paper.paper_rig().save(tmp_path / "rig.json")
    return [*(data_path(f"virtual/{NAME}_{side}.jpg") for side in ("left", "right")), "--calibration", calibration]


def test_a_raw_pair_with_its_calibration_in_millimetres(raw, tmp_path, capsys, monkeypatch):
    out, figures, show = tmp_path / "d.npy", [], plotting.show_figure
    monkeypatch.setattr(plotting, "show_figure", lambda name, figure: figures.append(figure) or show(name, figure))
    assert run(*raw, "--pipeline", "paper", "--output", out) == 0
    found, truth, rig = np.load(out, allow_pickle=False), recordings.load_truth(NAME), recordings.rectified()
    seen = truth.visible & np.isfinite(found) & (truth.box == 1)
    assert np.isnan(found).any()  # the columns that OpenCV leaves out
    assert np.median(np.abs(found - truth.disparity_px)[seen]) < 2
    assert "of the rectified left picture" in figures[0].axes[0].get_xlabel()  # whose pixels these are
    assert figures[0].axes[1].get_title() == "depth; hatched: a guess, no depth is told"
    depth_mm = np.load(tmp_path / "d_depth_mm.npy", allow_pickle=False)
    assert depth_mm.dtype == np.float32
    true_mm = rig.f_px * rig.baseline_mm / truth.disparity_px
    seen &= np.isfinite(depth_mm)
    assert np.median(np.abs(depth_mm / true_mm - 1)[seen]) < 0.01
    picture = cv2.imread(str(tmp_path / "d_depth_mm.png"), cv2.IMREAD_UNCHANGED)
    assert picture.dtype == np.uint16
    np.testing.assert_array_equal(picture, np.rint(np.nan_to_num(depth_mm)))
    points = trimesh.load(tmp_path / "d.ply")
    np.testing.assert_allclose(
        np.sort(points.vertices[:, 2]), np.sort(depth_mm[np.isfinite(depth_mm)]) / 1000, atol=1e-6
    )
    assert not list(tmp_path.glob("*std*"))  # the paper's pipeline tells none
    said = capsys.readouterr().out
    assert f"f {rig.f_px:.1f} px, B {rig.baseline_mm:.2f} mm; 98 % of the matched pixels between" in said
    assert re.search(r"median \d+ mm\n", said)
    assert run(*raw, "--pipeline", "paper", "--filled", "--output", out, "--force") == 0
    filled = np.isfinite(np.load(tmp_path / "d_depth_mm.npy", allow_pickle=False))
    np.testing.assert_array_equal(filled, np.load(out, allow_pickle=False) > 0)
    assert filled.sum() > np.isfinite(depth_mm).sum()


@pytest.mark.usefixtures("undrawn")
def test_a_rig_in_centimetres_is_told(raw, tmp_path, capsys):
    left, right, calibration, file = raw
    rig = json.loads(Path(file).read_text())
    tenth = tmp_path / "tenth.json"
    tenth.write_text(json.dumps(rig | {"T_mm": [value / 10 for value in rig["T_mm"]]}))
    assert run(left, right, calibration, tenth, "--pipeline", "paper", "--output", tmp_path / "d.npy") == 0
    assert "warning: the calibration has the cameras 9.3 mm apart" in capsys.readouterr().out


def test_exchanged_pictures_are_told_with_a_calibration_too(raw, tmp_path, capsys):
    assert run(raw[1], raw[0], *raw[2:], "--output", tmp_path / "d.npy") == 2
    assert "left and right are exchanged: " in capsys.readouterr().err
    assert not list(tmp_path.glob("d*"))


def test_a_calibration_for_another_size_is_named(raw, tmp_path, capsys):
    small = [tmp_path / f"{side}.png" for side in ("left", "right")]
    for file, picture in zip(small, raw, strict=False):
        cv2.imwrite(str(file), cv2.imread(str(picture))[::2, ::2])
    assert run(*small, *raw[2:], "--output", tmp_path / "d.npy") == 2
    assert f"the left image is 320x240, {raw[3]} is for 640x480: use images" in capsys.readouterr().err


@pytest.mark.usefixtures("undrawn")
def test_a_picture_of_another_moment_is_told(raw, tmp_path, capsys):
    """A piece of the scene stands 6 px lower in the right picture."""
    right = cv2.imread(str(raw[1]))
    right[206:336, 200:330] = right[200:330, 200:330].copy()
    cv2.imwrite(str(tmp_path / "later.png"), right)
    words = ["--pipeline", "fast", "--output", tmp_path / "d.npy"]
    assert run(raw[0], tmp_path / "later.png", *raw[2:], *words) == 0
    assert re.search(r"warning: \d\d of .* lie [67] px too low in right: something moved", told(capsys))


@pytest.mark.parametrize(("left", "right"), [(3, 2), (3, 5), (1, 2)])
def test_pictures_of_two_places_are_refused(raw, tmp_path, capsys, left, right):
    room = [data_path(f"virtual/room/{name}.jpg") for name in (f"{left}_left", f"{right}_right")]
    assert run(*room, *raw[2:], "--pipeline", "fast", "--output", tmp_path / "d.npy") == 2
    assert re.search(r"[1-4]\.\d % match, as chance has it: are both pictures of one scene", capsys.readouterr().err)
    assert not list(tmp_path.glob("d*"))


def test_where_few_pixels_match_it_is_asked_whether_both_show_one_scene(raw, tmp_path, capsys):
    """Of the right picture a tenth is left, the rest is of another place."""
    right, other = (cv2.imread(str(file)) for file in (raw[1], data_path("virtual/room/5_right.jpg")))
    width = right.shape[1]
    other[:, 45 * width // 100 : 53 * width // 100] = right[:, 45 * width // 100 : 53 * width // 100]
    cv2.imwrite(str(tmp_path / "mixed.png"), other)
    words = ["--pipeline", "fast", "--output", tmp_path / "d.npy"]
    assert run(raw[0], tmp_path / "mixed.png", *raw[2:], *words) == 0
    assert "warning: hardly anything matches: are both pictures of one scene and one moment? What" in told(capsys)
    run(*raw, *words, "--force")
    assert "hardly" not in told(capsys)


def test_best_writes_its_standard_deviation(pair, tmp_path):
    small = []
    for file in pair:  # a quarter of the size: quick
        small.append(file.replace(".png", "_small.png"))
        cv2.imwrite(small[-1], cv2.resize(cv2.imread(file), None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA))
    assert run(*small, "--max-disparity", 48, "--output", tmp_path / "d.npy") == 0
    std = np.load(tmp_path / "d_std.npy", allow_pickle=False)
    known = np.isfinite(np.load(tmp_path / "d.npy", allow_pickle=False))
    assert std.shape == (120, 160) and (std[known] > 0).all() and np.isnan(std[~known]).all()
    assert known.mean() > 0.9  # the floor's nearest strip is refused: half of it is wrong by more than a pixel


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--pipeline", "finest"], "unknown pipeline 'finest'; choose one of paper, fast, best"),
        (["--max-disparity", "100"], "needs a --max-disparity that is a multiple of 16, got 100; near are 96, 112"),
        (["--pipeline", "fast", "--max-disparity", "48"], "multiple of 32, got 48; near are 32, 64"),
        (["--output", "d.tif"], "written as .npy"),
        (["--filled"], "--filled is about depth, which needs --calibration FILE"),
        (["--calibration", "none.json"], "none.json: no such file"),
    ],
)
def test_refuses(pair, tmp_path, monkeypatch, capsys, words, text):
    monkeypatch.chdir(tmp_path)
    assert run(*pair, *words) == 2
    assert text in capsys.readouterr().err
    assert not list(tmp_path.glob("*.npy"))


def test_keeps_what_is_there(half, tmp_path, capsys):
    (tmp_path / "d.png").write_bytes(b"mine")
    assert run(*half, "--pipeline", "fast", "--output", tmp_path / "d.npy") == 2
    assert "d.png would be overwritten" in capsys.readouterr().err
    assert not (tmp_path / "d.npy").exists()
    assert run(*half, "--pipeline", "fast", "--output", tmp_path / "d.npy", "--force") == 0
    assert (tmp_path / "d.png").read_bytes() != b"mine"


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda right: np.roll(right, 5, axis=0), "differ by 5.0 px rms (median +5.0 px), at most 1 px is allowed"),
        (lambda right: turned(right, 1.0), "Rectify it with its rig: --calibration FILE"),
        (lambda right: np.full_like(right, 90), "changed.tif has one grey value, 90: there is nothing to match"),
        (lambda right: right[:400], "a stereo pair must have one size"),
        (lambda right: right.astype(np.uint16) * 257, "the picture has uint16 samples, 8 bits are needed"),
        (lambda right: (right / 255).astype(np.float32), "the picture has float32 samples, 8 bits are needed"),
    ],
)
def test_refuses_a_pair_that_is_none(pair, tmp_path, capsys, change, text):
    right = tmp_path / "changed.tif"
    cv2.imwrite(str(right), change(cv2.imread(pair[1])))
    assert run(pair[0], right, "--output", tmp_path / "d.npy") == 2
    assert text in capsys.readouterr().err
    assert not (tmp_path / "d.npy").exists()


@pytest.mark.parametrize("name", ["paper", "fast", "best"])
def test_refuses_a_window_wider_than_the_pictures(pair, tmp_path, capsys, name):
    assert run(*pair, "--pipeline", name, "--max-disparity", 640, "--output", tmp_path / "d.npy") == 2
    shown = capsys.readouterr().err
    assert "640" in shown and "640 px wide" in shown and "reduce --max-disparity" in shown


def test_refuses_one_picture_twice(pair, tmp_path, capsys):
    assert run(pair[0], pair[0], "--pipeline", "fast", "--output", tmp_path / "d.npy") == 2
    assert "left.png are the same picture, every disparity would be 0" in capsys.readouterr().err
    assert not (tmp_path / "d.npy").exists()


def test_two_pictures_of_one_camera_are_doubted(half, tmp_path, capsys):
    """One webcam that was opened under two numbers: the same view, other noise."""
    left = cv2.imread(str(half[0])).astype(float)
    for side in (0, 1):
        noise = np.random.default_rng(side).normal(0, 3, left.shape)
        cv2.imwrite(str(tmp_path / f"{side}.png"), (left + noise).clip(0, 255).astype(np.uint8))
    assert run(tmp_path / "0.png", tmp_path / "1.png", "--pipeline", "fast", "--output", tmp_path / "d.npy") == 0
    assert "warning: hardly a disparity is over 0.5 px: " in told(capsys)


def test_refuses_exchanged_and_missing_pictures(pair, tmp_path, capsys):
    out = tmp_path / "d.npy"
    assert run(*pair[::-1], "--output", out) == 2
    assert "left.png: left and right are exchanged" in capsys.readouterr().err
    assert run(pair[0], tmp_path / "none.png", "--output", out) == 2
    assert "none.png: no such file" in capsys.readouterr().err
    assert not out.exists()


def test_says_when_the_rows_could_not_be_checked(tmp_path, capsys):
    files = [tmp_path / f"{side}.png" for side in "lr"]
    for file, shift in zip(files, (0, 4), strict=True):
        smooth = cv2.GaussianBlur(np.random.default_rng(1).random((120, 170)).astype(np.float32), (0, 0), 6)
        smooth = smooth[:, shift : shift + 160]
        cv2.imwrite(str(file), cv2.normalize(smooth, None, 100, 130, cv2.NORM_MINMAX).astype(np.uint8))
    assert run(*files, "--pipeline", "fast", "--max-disparity", 32, "--output", tmp_path / "d.npy") == 0
    assert "warning: too few points" in capsys.readouterr().out


def turned(image, degrees):
    height, width = image.shape[:2]
    return cv2.warpAffine(image, cv2.getRotationMatrix2D((width / 2, height / 2), degrees, 1), (width, height))
