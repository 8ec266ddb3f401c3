"""``stereolib explore``: what it refuses before it opens anything, and what it hands to the page."""

from __future__ import annotations

import argparse
import importlib.util
import io
import json
import os
import signal
import socket
import subprocess
import sys
import time

import cv2
import psutil
import pytest

from stereolib.base import data_path
from stereolib.cli import commands
from stereolib.cli.live_page import live_page
from stereolib.notebook.offered import OWN_FILES
from stereolib.virtual import recordings

PAIR = [str(data_path(f"virtual/conditions/texture_{side}.jpg")) for side in ("left", "right")]


@pytest.fixture
def served(monkeypatch):
    """Instead of a server: the words and the environment that it would get."""
    calls = []
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: object())

    class Server(io.BytesIO):
        def __init__(self, words, env, **_):
            super().__init__()
            self.stdin = io.BytesIO()
            calls.append((words, env))

        def wait(self, _=None):
            return 0

        terminate, poll = io.BytesIO.close, wait

    monkeypatch.setattr(subprocess, "Popen", Server)
    return calls


def run(*words):
    return commands.main(["explore", *map(str, words)])


def test_no_file_opens_the_virtual_rig_on_this_machine_alone(served, monkeypatch):
    monkeypatch.delenv(OWN_FILES, raising=False)
    assert run("--no-browser", "--port", "8765") == 0
    ((words, environment),) = served
    assert OWN_FILES not in environment
    assert {"--port=8765", "--no-browser", "--token", "--Voila.ip=127.0.0.1"} <= set(words)
    assert "--Voila.port_retries=0" in words, "on another port nobody would look for it"
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


def test_a_port_that_is_taken_is_refused(served, capsys):
    """Else Voila takes the next one, and a live page's address, with its token, goes to whoever listens here."""
    arguments = argparse.Namespace(no_preview=False, no_browser=True, port=0)
    with socket.create_server(("127.0.0.1", 0)) as other:
        arguments.port = other.getsockname()[1]
        with pytest.raises(ValueError, match=f"--port {arguments.port} cannot be served"), live_page(arguments, "", {}):
            pass
        assert run("--port", arguments.port) == 2
    told = capsys.readouterr().err
    assert "name another, or leave it out" in told and told.count("\n") == 1
    assert not served


def test_missing_voila_is_named_with_its_fix(monkeypatch, capsys):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert run() == 2
    assert "make explore" in capsys.readouterr().err


def _heard():
    """Let a command hear of the signals that a background shell or nohup keeps from its children."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def _runs(process):
    """Whether a process runs still; it may end between two questions of it."""
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP", "SIGKILL"])
def test_the_server_ends_with_the_command_however_that_ends(tmp_path, name):
    (tmp_path / "voila").mkdir()
    (tmp_path / "voila" / "__init__.py").touch()
    forever = "import os, time\n\ndef main():\n    print(os.getpid(), flush=True)\n    time.sleep(600)\n"
    (tmp_path / "voila" / "app.py").write_text(forever)
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    command = subprocess.Popen(
        [sys.executable, "-m", "stereolib", "explore", "--no-browser"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": path},
        text=True,
        preexec_fn=_heard,
    )
    server = psutil.Process(int(command.stdout.readline()))
    assert os.getsid(server.pid) != os.getsid(command.pid), "Ctrl-C in the terminal is the command's"
    command.send_signal(getattr(signal, name))
    until_s = time.monotonic() + 20
    while _runs(server) and time.monotonic() < until_s:
        time.sleep(0.02)
    is_left = _runs(server)
    if is_left:
        server.kill()
    told = command.communicate(timeout=20)[1]
    assert not is_left
    if name != "SIGKILL":
        assert (command.returncode, told) == (130, "stereolib: interrupted\n")


def test_help_has_an_example(capsys):
    with pytest.raises(SystemExit):
        run("--help")
    assert "stereolib explore walk/3_left.jpg walk/3_right.jpg --calibration" in capsys.readouterr().out
