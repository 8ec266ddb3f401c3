"""Where data comes from: committed files, whole writes, and recordings of others with or without a network."""

from __future__ import annotations

import hashlib
import re
import socket
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pooch
import pytest

from stereolib.base import datasets

CONTENT = b"a recording\n"
NAME = "xv11/turns.txt"


@pytest.fixture
def registry(tmp_path, monkeypatch):
    """A registry of one recording, an empty cache, no folder of the user's, and a server that refuses."""
    monkeypatch.setattr(datasets, "_registry", lambda: {NAME: hashlib.sha256(CONTENT).hexdigest()})
    monkeypatch.setattr(pooch, "os_cache", lambda name: tmp_path / "cache" / name)
    monkeypatch.delenv("STEREOLIB_DATA", raising=False)
    monkeypatch.setenv("NO_PROXY", "*")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        free = probe.getsockname()[1]
    monkeypatch.setattr(datasets, "_XV11", f"http://127.0.0.1:{free}")


@pytest.fixture
def server(registry, tmp_path, monkeypatch):
    """A web server with the recording; returns its folder."""

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    folder = tmp_path / "web"
    folder.mkdir()
    (folder / "turns.txt").write_bytes(CONTENT)
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=folder)) as httpd:
        monkeypatch.setattr(datasets, "_XV11", f"http://127.0.0.1:{httpd.server_port}")
        thread = threading.Thread(target=httpd.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield folder
        httpd.shutdown()
        thread.join()


def test_committed_file_or_how_to_get_it_back():
    assert datasets.data_path("paper/published.toml").is_file()
    with pytest.raises(ValueError, match=r"data/virtual/no\.jpg is missing .*git checkout.*stereolib data build"):
        datasets.data_path("virtual/no.jpg")


def test_figures_go_where_the_environment_says(tmp_path, monkeypatch):
    monkeypatch.setenv("STEREOLIB_FIGURES", str(tmp_path / "elsewhere"))
    assert datasets.figures_dir() == tmp_path / "elsewhere"
    assert datasets.figures_dir().is_dir()
    monkeypatch.delenv("STEREOLIB_FIGURES")
    monkeypatch.setattr(datasets, "ROOT", tmp_path / "repository")
    assert datasets.figures_dir() == tmp_path / "repository" / "figures"


def test_own_folder_comes_first_and_is_checked(registry, tmp_path, monkeypatch):
    own = tmp_path / "own" / NAME
    own.parent.mkdir(parents=True)
    own.write_bytes(CONTENT)
    monkeypatch.setenv("STEREOLIB_DATA", str(tmp_path / "own"))
    assert datasets.real_recording(NAME) == own
    assert datasets.real_recordings("xv11") == [own]
    own.write_bytes(CONTENT + b"more")
    with pytest.raises(ValueError, match=r"turns\.txt is not the recording it should be: its sha256 differs"):
        datasets.real_recording(NAME)


def test_no_network_is_told_at_once(registry, tmp_path, monkeypatch):
    """The server refuses: that is passed on, not waited for."""
    said = r"xv11/turns\.txt is not available: STEREOLIB_DATA is not set.*failed \(ConnectionError\)"
    with pytest.raises(datasets.NotAvailable, match=said):
        datasets.real_recording(NAME)
    monkeypatch.setenv("STEREOLIB_DATA", str(tmp_path))
    with pytest.raises(datasets.NotAvailable, match=r"STEREOLIB_DATA has no such file.*Connect to the network"):
        datasets.real_recordings("xv11")


def test_default_patience_is_under_five_seconds():
    import inspect

    assert inspect.signature(datasets.real_recording).parameters["timeout_s"].default < 5


def test_a_server_that_never_answers(registry, monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as silent:
        monkeypatch.setattr(datasets, "_XV11", f"http://127.0.0.1:{silent.getsockname()[1]}")
        with pytest.raises(datasets.NotAvailable, match="Timeout") as caught:
            datasets.real_recording(NAME, timeout_s=0.3)
    assert re.search(r"within 0\.3 s|read timeout=0\.3\b", str(caught.value.__cause__))  # given up when it was asked to


def test_a_name_that_takes_long_to_look_up(registry, monkeypatch):
    """A request's own timeout does not cover the look-up."""
    done, looked_up = threading.Event(), []

    def slow(*_, **__):
        done.wait(20)
        looked_up.append(True)
        raise socket.gaierror("no such host")

    monkeypatch.setattr(socket, "getaddrinfo", slow)
    with pytest.raises(datasets.NotAvailable, match="TimeoutError"):
        datasets.real_recording(NAME, timeout_s=0.3)
    assert not looked_up  # it was left behind
    done.set()


def test_download_is_kept_for_the_next_time(server, tmp_path):
    path = datasets.real_recording(NAME)
    assert path.read_bytes() == CONTENT
    assert tmp_path / "cache" in path.parents
    (server / "turns.txt").unlink()
    assert datasets.real_recording(NAME) == path


@pytest.fixture
def installed(server, tmp_path, monkeypatch):
    """A package with the sums of a demo rig of two files, which the server has; returns the server's folder."""
    files = {"rig.toml": b"[board]\n", "boards/1_left.jpg": b"a picture"}
    for folder in (server / "virtual", tmp_path / "package" / "virtual"):
        folder.mkdir(parents=True)
    (server / "virtual" / "boards").mkdir()
    for name, data in files.items():
        (server / "virtual" / name).write_bytes(data)
    sums = "".join(f"{hashlib.sha256(data).hexdigest()}  {name}\n" for name, data in files.items())
    (tmp_path / "package" / "virtual" / "SHA256SUMS").write_text(sums)
    monkeypatch.setattr(datasets, "INSTALLED", True)
    monkeypatch.setattr(datasets, "_PACKAGED", tmp_path / "package")
    monkeypatch.setenv("STEREOLIB_DATA_URL", datasets._XV11 + "/")
    return server


def test_an_installed_package_fetches_the_demo_rig_once(installed, tmp_path, monkeypatch):
    folder = datasets.demo_rig()
    assert tmp_path / "cache" in folder.parents and (folder / "boards" / "1_left.jpg").read_bytes() == b"a picture"
    monkeypatch.setenv("STEREOLIB_DATA_URL", "http://127.0.0.1:9")
    assert datasets.demo_rig() == folder  # nothing is asked for again
    monkeypatch.delenv("STEREOLIB_DATA_URL")
    with pytest.raises(ValueError, match=r"virtual/none\.jpg is missing: .* or STEREOLIB_DATA_URL to the address"):
        datasets.data_path("virtual/none.jpg")


def test_a_demo_rig_of_something_else_is_refused(installed):
    (installed / "virtual" / "boards" / "1_left.jpg").write_bytes(b"another")
    with pytest.raises(datasets.NotAvailable, match=r"boards/1_left\.jpg is not available"):
        datasets.demo_rig()


def test_download_of_something_else_is_refused(server, tmp_path):
    (server / "turns.txt").write_bytes(b"<html>please log in</html>")
    with pytest.raises(datasets.NotAvailable, match="download failed"):
        datasets.real_recording(NAME)
    assert not [p for p in (tmp_path / "cache").rglob("*") if p.is_file()]


def test_a_download_without_end_is_left(server, tmp_path, monkeypatch):
    monkeypatch.setattr(datasets, "_LARGEST_BYTES", len(CONTENT) - 1)
    with pytest.raises(datasets.NotAvailable, match="download failed"):
        datasets.real_recording(NAME)
    assert not [p for p in (tmp_path / "cache").rglob("*") if p.is_file()]


def test_names(registry):
    with pytest.raises(ValueError, match=r"no recording 'nothing'; known are"):
        datasets.real_recording("nothing")
    with pytest.raises(ValueError, match="no recordings under 'minoru'"):
        datasets.real_recordings("minoru")


def test_committed_sums_name_both_cameras_in_order():
    names = list(datasets._registry())
    for side in ("left", "right"):
        assert [n for n in names if f"/{side}/" in n] == [f"minoru3d/{side}/{i}.jpg" for i in range(1, 31)]
    assert "xv11/hand_in_box.txt" in names
    assert all(len(digest) == 64 for digest in datasets._registry().values())
