"""``stereolib explore``: what it refuses before it opens anything, and what it hands to the page."""

from __future__ import annotations

import importlib.util
import json
import subprocess

import cv2
import pytest

from stereolib.base import data_path
from stereolib.cli import commands
from stereolib.notebook.offered import OWN_FILES
from stereolib.virtual import recordings

PAIR = [str(data_path(f"virtual/conditions/texture_{side}.jpg")) for side in ("left", "right")]


@pytest.fixture
def served(monkeypatch):
    """Instead of a server: the words and the environment that it would get."""
    calls = []
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: object())
    monkeypatch.setattr(subprocess, "call", lambda words, env: calls.append((words, env)) or 0)
    return calls


def run(*words):
    return commands.main(["explore", *map(str, words)])


def test_no_file_opens_the_virtual_rig_on_this_machine_alone(served, monkeypatch):
    monkeypatch.delenv(OWN_FILES, raising=False)
    assert run("--no-browser", "--port", "8765") == 0
    ((words, environment),) = served
    assert OWN_FILES not in environment
    assert {"--port=8765", "--no-browser", "--token", "--Voila.ip=127.0.0.1"} <= set(words)
    assert any(word.endswith("explore.ipynb") for word in words)


def test_own_pair_is_handed_over_with_whole_paths(served, tmp_path, monkeypatch):
    rig = recordings.rectified().rig.save(tmp_path / "rig.json")
    monkeypatch.chdir(tmp_path)
    assert run(*PAIR, "--calibration", "rig.json") == 0
    ((words, environment),) = served
    assert json.loads(environment[OWN_FILES]) == [*PAIR, str(rig.resolve()), ""]
    assert "--no-browser" not in words


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--calibration", "rig.json"], "--calibration and --scan belong to a pair: add LEFT RIGHT"),
        (["--scan", "scan.bin"], "belong to a pair"),
        ([*PAIR, PAIR[0]], "LEFT RIGHT are two pictures, got 3"),
        (PAIR[:1], "texture_left.jpg is 640x480, the picture of one camera"),
        (["none.jpg", PAIR[1]], "none.jpg: no such file"),
        ([PAIR[0], "small.png"], "small.png"),
        ([PAIR[0], "text.png"], "text.png"),
        ([*PAIR, "--calibration", "none.json"], "none.json: no such file"),
        ([*PAIR, "--calibration", "text.png"], "text.png"),
        ([*PAIR, "--scan", "none.bin"], "none.bin"),
    ],
)
def test_refuses_with_a_line_that_names_the_file(served, tmp_path, monkeypatch, capsys, words, text):
    monkeypatch.chdir(tmp_path)
    cv2.imwrite("small.png", cv2.imread(PAIR[1])[::2, ::2])
    (tmp_path / "text.png").write_text("no picture")
    assert run(*words) == 2
    told = capsys.readouterr().err
    assert text in told and told.count("\n") == 1
    assert not served


def test_missing_voila_is_named_with_its_fix(monkeypatch, capsys):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert run() == 2
    assert "make explore" in capsys.readouterr().err


def test_help_has_an_example(capsys):
    with pytest.raises(SystemExit):
        run("--help")
    assert "stereolib explore left.jpg right.jpg --calibration" in capsys.readouterr().out
