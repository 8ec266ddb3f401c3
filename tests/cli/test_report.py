"""``stereolib new`` and ``stereolib report``: a folder is made, filled, and told of on one page."""

from __future__ import annotations

import json
import re
import shutil

import cv2
import pytest
from support.notebooks import execute_without_kernels

from stereolib import base, paper
from stereolib.base import data_path, datasets
from stereolib.calibration import Checkerboard, find_in_files
from stereolib.cli import commands
from stereolib.paper import ledger
from stereolib.reproduction import own_rig
from stereolib.virtual import recordings


def run(*words):
    return commands.main([str(word) for word in words])


def told(report):
    """All that the cells of an executed notebook print."""
    cells = json.loads(report.read_text(encoding="utf-8"))["cells"]
    return "".join("".join(output.get("text", "")) for cell in cells for output in cell.get("outputs", []))


@pytest.fixture
def folder(tmp_path, capsys):
    assert run("new", tmp_path / "my_rig") == 0
    capsys.readouterr()
    return tmp_path / "my_rig"


@pytest.fixture(scope="module")
def webcam_boards(tmp_path_factory):
    """Every third of the thirty pairs of a Minoru 3D webcam, with their corners, for which it takes seconds to look."""
    folder = tmp_path_factory.mktemp("minoru")
    for side in ("left", "right"):
        (folder / side).mkdir()
        for file in datasets.available(f"minoru3d/{side}")[1::3] or pytest.skip("no real recordings here"):
            (folder / side / file.name).write_bytes(file.read_bytes())
    left, right = (sorted((folder / side).iterdir()) for side in ("left", "right"))
    find_in_files(left, right, Checkerboard(8, 6, 30.0), progress=False)
    return folder


@pytest.fixture
def minoru(folder, webcam_boards):
    """The folder of that rig."""
    shutil.copytree(webcam_boards, folder / "boards", dirs_exist_ok=True)
    told = (folder / "rig.toml").read_text().replace("[9, 6]", "[8, 6]")
    (folder / "rig.toml").write_text(told.replace("# square_mm = [25.0, 25.0]", "square_mm = [29.79, 30.21]"))
    return folder


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(own_rig, "execute_notebooks", execute_without_kernels)


def test_new_makes_folders_and_keeps_what_is_there(folder, capsys):
    assert sorted(path.name for path in folder.iterdir()) == ["boards", "pairs", "rig.toml", "scans"]
    before = (folder / "rig.toml").read_text()
    assert run("new", folder) == 2
    assert "rig.toml is there already: edit it" in capsys.readouterr().err
    assert (folder / "rig.toml").read_text() == before
    assert run("new", folder / "rig.toml" / "deeper") == 2
    assert "rig.toml is a file" in capsys.readouterr().err


def test_lines_to_be_pasted_are_quoted_where_a_shell_needs_it(tmp_path, capsys):
    for name, pasted in (("my_rig", f"{tmp_path / 'my_rig'}"), ("my new rig", f"'{tmp_path / 'my new rig'}'")):
        assert run("report", tmp_path / name) == 2
        assert f"{name} is no folder: stereolib new {pasted} makes one\n" in capsys.readouterr().err
        assert run("new", tmp_path / name) == 0
        assert f"3. stereolib report {pasted}\n" in capsys.readouterr().out
        (tmp_path / name / "rig.toml").unlink()
        assert run("report", tmp_path / name) == 2
        assert f"which says what lies there: stereolib new {pasted} writes one\n" in capsys.readouterr().err


def test_a_broken_file_is_told_with_what_the_command_does_without_it(folder, capsys):
    (folder / "rig.toml").write_text("[board")
    assert run("map", folder) == 2
    assert capsys.readouterr().err.endswith("mend it there, or move the file away: then the folder alone is asked\n")
    assert run("report", folder) == 2
    advice = f"stereolib new {folder}"
    assert capsys.readouterr().err.endswith(f"mend it there, or move the file away: {advice} writes another\n")
    (folder / "rig.toml").unlink()
    assert run(*advice.split()[1:]) == 0 and (folder / "rig.toml").is_file()


def test_report_of_a_laser_alone_leaves_out_the_rest(folder, capsys):
    """Through a kernel, to a page that asks for nothing from elsewhere and explains nothing that is not there."""
    (folder / "scans" / "1.bin").write_bytes(recordings.load_laser("lrf/room"))
    figures = {path: path.stat().st_mtime_ns for path in (datasets.ROOT / "figures").iterdir()}
    assert run("report", folder) == 0
    assert {path: path.stat().st_mtime_ns for path in (datasets.ROOT / "figures").iterdir()} == figures
    said = capsys.readouterr().out
    assert not re.search(r"^(good|usable|bad): ", said, re.MULTILINE)
    assert "0 pairs of the board, 0 pairs to measure, 1 scan\n  nothing in boards: no calibration" in said
    assert said.count("nothing in boards") == 1 and "\nleft out: sizes and the map. without boards" in said
    assert sorted(path.name for path in (folder / "report").iterdir()) == ["report.html", "report.ipynb"]
    text = told(folder / "report" / "report.ipynb")
    assert re.search(r"0\.5 to 1 m: \d+ beams, half of them scatter by less than \d\.\d mm", text)
    assert "left out: sizes and the map. without boards or a calibration.json nothing tells lengths" in text
    page = (folder / "report" / "report.html").read_text(encoding="utf-8")
    assert "whether the scatter grows with the distance" in page and "triangulates" in page
    assert "filled outlines are things" not in page and "The knobs" not in page
    assert "run all cells" not in page and re.search(r"report my_rig</code> makes this page\. Whatever needs", page)
    assert re.findall(r"word-break: ?([\w-]+)", page.partition("</head>")[0])[-1] == "normal"  # of what was printed
    assert not re.findall(r"<(?:script|link|img)[^>]*(?:src|href)=\"?https?:", page)
    assert run("report", folder) == 2
    assert "report.html, " in (error := capsys.readouterr().err) and "would be overwritten" in error


def test_a_wrong_board_and_exchanged_cameras_are_told_before_the_report_begins(folder, capsys, monkeypatch):
    monkeypatch.setattr(own_rig, "execute_notebooks", lambda *_, **__: pytest.fail("the report began"))
    for name in ("01", "03", "05", "07", "09"):
        for side in ("left", "right"):
            picture = cv2.imread(str(data_path(f"virtual/boards/{name}_{side}.jpg")), cv2.IMREAD_GRAYSCALE)
            cv2.imwrite(str(folder / "boards" / f"{side}{name}.png"), picture[::2, ::2])
    text = (folder / "rig.toml").read_text().replace("# square_mm", "square_mm")
    (folder / "rig.toml").write_text(text.replace("[9, 6]", "[10, 7]"))
    assert run("report", folder) == 2
    assert (
        f"{folder / 'boards'}: none of the 5 pairs looked at first (left01.png ...) shows a board of 10x7"
        in capsys.readouterr().err
    )
    (folder / "rig.toml").write_text(text)
    for name in ("01", "03", "05", "07", "09"):
        left, right, between = (folder / "boards" / f"{side}{name}.png" for side in ("left", "right", "between"))
        left.rename(between)
        right.rename(left)
        between.rename(right)
    assert run("report", folder) == 2
    assert f"left and right are exchanged in {folder / 'boards'}" in capsys.readouterr().err


@pytest.mark.slow
def test_an_earlier_run_s_calibration_is_not_told_as_written(folder, capsys, monkeypatch):
    """As after `report --force` in a folder whose boards have gone."""
    out = folder / "report"

    def execute(sources, target, _, jobs):
        target.mkdir()
        for source in sources:
            shutil.copy(source, target)
        if not (out / "calibration.json").is_file():
            base.write_atomic(out / "calibration.json", "{}")

    monkeypatch.setattr(own_rig, "execute_notebooks", execute)
    shutil.copy(data_path("virtual/lrf/room.bin"), folder / "scans")
    for words, files in (
        ([], "report.html, report.ipynb, calibration.json"),
        (["--force"], "report.html, report.ipynb"),
    ):
        assert run("report", folder, *words) == 0
        assert capsys.readouterr().out.endswith(f"written to {out}: {files}\n")


def test_report_of_real_webcams_goes_as_far_as_their_boards(minoru, quick, capsys):
    """A calibration, a verdict, rows and depth, and no sizes."""
    assert run("report", minoru) == 0
    text, said = told(minoru / "report" / "report.ipynb"), capsys.readouterr().out
    verdict = re.search(r"^(good|usable|bad): .*", text, re.MULTILINE)
    reasons = re.findall(r"^because .*", text, re.MULTILINE)
    assert verdict and reasons and "\n".join(("", verdict[0], *reasons, "10 pairs, reprojection error ")) in said
    assert re.search(r"baseline B 6\d\.\d\d mm", text) and re.search(
        r"rows of the right picture are off by [+-]\d", text
    )
    assert re.search(r"\d % matched", text) and "left out: sizes and the map" in text
    assert "left out: no scan of several turns" in text
    calibration = json.loads((minoru / "report" / "calibration.json").read_text())
    assert calibration["calibration"]["board"]["columns"] == 8
    assert not (minoru / "calibration.json").exists()


@pytest.mark.slow
def test_chapter_on_calibration_takes_real_webcams(minoru, quick, capsys, monkeypatch):
    """What needs the true cameras is left out; nothing is held against the paper, nothing of it is recorded."""
    for name in ("record_rows", "compare_with_paper"):
        monkeypatch.setattr(paper, name, refuse)  # first: a room that is asked later would keep the refusal
        monkeypatch.setattr(ledger, name, refuse)
    assert run("report", minoru, "--chapter", "calibration") == 0
    text = told(minoru / "calibration" / "calibration.ipynb")
    assert "10 of 10 pairs show the whole board in both views\na board has 48 corners, 30 mm apart" in text
    assert re.search(r"baseline 6\d\.\d\d mm\n", text) and "in truth" not in text
    assert text.count("left out: it needs the true cameras") >= 3 and "left out: the rest of the appendix" in text
    assert re.search(r"left fx +8\d\d\.\d+ +\d", text) and re.search(r"^(good|usable|bad):$", text, re.MULTILINE)
    assert "729.9" not in text and "built in" not in text
    page = (minoru / "calibration" / "calibration.html").read_text(encoding="utf-8")
    assert "The library's verdict" in page and "The rows of the ledger" not in page
    assert sorted(path.name for path in (minoru / "calibration").iterdir()) == ["calibration.html", "calibration.ipynb"]


def refuse(*_, **__):
    raise AssertionError("a stranger's rig is held against the paper")


@pytest.mark.slow
def test_chapter_on_calibration_takes_the_demo_rig_as_a_strangers(folder, quick, capsys):
    """Twelve of its thirty pairs; the notebooks' own run takes all."""
    for board in range(3, 15):
        for side in ("left", "right"):
            shutil.copy(data_path(f"virtual/boards/{board:02d}_{side}.jpg"), folder / "boards")
    toml = folder / "rig.toml"
    toml.write_text(toml.read_text().replace("# square_mm", "square_mm"))
    assert run("report", folder, "--chapter", "calibration") == 0
    text = told(folder / "calibration" / "calibration.ipynb")
    assert "12 of 12 pairs" in text and re.search(r"baseline 93\.\d\d mm\n", text) and "in truth" not in text
    assert "left out by diagnose: " in text and re.search("^(good|usable):", text, re.MULTILINE)


def test_chapter_on_calibration_needs_boards(folder, capsys):
    (folder / "scans" / "1.bin").write_bytes(recordings.load_laser("lrf/room"))
    assert run("report", folder, "--chapter", "calibration") == 2
    assert "holds no pairs of a board" in capsys.readouterr().err and not (folder / "calibration").exists()


@pytest.mark.parametrize(
    ("files", "why"),
    [
        ({}, "my_rig holds no recordings yet"),
        ({"pairs/1_left.png": b"no picture", "pairs/1_right.png": b"none"}, "no readable images"),
        ({"scans/1.bin": b"no scan"}, "1.bin"),
        (
            {"calibration.json": b"{}", "scans/1.bin": data_path("virtual/room/1_scan.bin").read_bytes()},
            "calibration.json",
        ),
    ],
)
def test_report_refuses_in_one_line(folder, quick, capsys, files, why):
    for name, data in files.items():
        (folder / name).write_bytes(data)
    assert run("report", folder) == 2
    error = capsys.readouterr().err
    assert error.startswith("stereolib: error: ") and error.count("\n") == 1 and why in error
    assert not (folder / "report").exists()


def test_report_needs_a_folder_of_a_rig(tmp_path, capsys):
    assert run("report", tmp_path / "nowhere") == 2
    assert "is no folder: stereolib new" in capsys.readouterr().err
    assert run("report", tmp_path) == 2
    assert "has no rig.toml" in capsys.readouterr().err
