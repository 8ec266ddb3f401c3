"""Files are read within bounds and written whole."""

from __future__ import annotations

import os
import stat
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from stereolib.base import files, text_formats

pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("missing.bin", "missing.bin: no such file"),
        (".", "is a folder; name a file in it"),
        ("big.bin", r"big.bin: 2 kB, at most 1 kB are read"),
        ("big.bin/x", r"no such file; there is no folder .*big\.bin"),
        ("bigg.bin", r"no such file; did you mean big\.bin\?"),
        ("a\0b", "not the name of a file"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path: Path, name: str, message: str) -> None:
    (tmp_path / "big.bin").write_bytes(bytes(2000))
    with pytest.raises(ValueError, match=message):
        files.read_bytes(tmp_path / name, limit_bytes=1000)


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no /dev/zero here")
def test_a_device_is_no_file() -> None:
    with pytest.raises(ValueError, match="is a device"):
        files.read_bytes("/dev/zero")


@pipes
def test_a_pipe_is_read_to_its_end_also_from_a_late_writer(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Timer(0.2, lambda: pipe.write_bytes(b"scan" * 50_000))
    writer.start()
    assert files.read_bytes(pipe) == b"scan" * 50_000
    writer.join()


@pipes
def test_a_pipe_is_not_waited_for_without_end(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(ValueError, match=r"says nothing for 0\.1 s"):
        files.read_bytes(pipe, silence_s=0.1)


@pipes
def test_a_pipe_that_never_ends_is_left(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)

    def pour() -> None:
        with pytest.raises(BrokenPipeError), pipe.open("wb", buffering=0) as stream:
            while True:
                stream.write(bytes(1000))

    writer = threading.Thread(target=pour)
    writer.start()
    with pytest.raises(ValueError, match="delivers more than 5 kB"):
        files.read_bytes(pipe, limit_bytes=5000)
    writer.join(5)
    assert not writer.is_alive()


@pipes
def test_a_pipe_without_reader_is_not_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    monkeypatch.setattr(files, "SILENCE_S", 0.1)
    with pytest.raises(ValueError, match="nobody reads this pipe"):
        files.write_atomic(pipe, b"x")
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_text_must_be_text(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_bytes(b"\xef\xbb\xbfone\r\ntwo")
    assert files.read_text(path) == "one\ntwo"
    path.write_bytes(b"ab\xff")
    with pytest.raises(ValueError, match=r"notes.txt: not a text file in UTF-8 \(byte 2 is 0xff\)"):
        files.read_text(path)


@pytest.mark.parametrize("text", ["[" * 100_000, '{"a":' * 200, "{", "", "[1, nan x]"])
def test_json_that_is_none(tmp_path: Path, text: str) -> None:
    path = tmp_path / "calibration.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"calibration\.json: not a JSON file"):
        text_formats.read_json(path)


def test_brackets_inside_texts_are_no_nesting(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    path.write_text('{"a": "' + "[" * 500 + '\\"", "b": [1, 2]}')
    assert text_formats.read_json(path)["b"] == [1, 2]


def test_tags_are_counted_as_brackets_are() -> None:
    text_formats.check_nesting('<?xml version="1.0"?>' + "<a>1</a><b/>" * 500)
    with pytest.raises(ValueError, match="nested more than 64"):
        text_formats.check_nesting("<a>" * 65)


BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 9)
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (BOMB, "unfold to more than"),
        ("[" * 1000, "nested more than 64"),
        ("a: !!python/object/apply:os.getcwd []", "not a YAML file of plain values"),
        ("a: [1, 2", "not a YAML file"),
        ("&a [*a]", "not a YAML file"),
    ],
)
def test_yaml_is_bounded(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        text_formats.read_yaml(path)


def test_yaml_with_a_few_aliases_is_read(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text("a: &size [640, 480]\nb: *size\nc: {d: [1, {e: 2}]}\n")
    assert text_formats.read_yaml(path) == {"a": [640, 480], "b": [640, 480], "c": {"d": [1, {"e": 2}]}}


def test_writing_replaces_whole_and_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "new" / "rig.json"
    files.write_atomic(path, "old")
    path.chmod(0o640)
    files.write_atomic(path, "new")
    assert path.read_text() == "new" and stat.S_IMODE(path.stat().st_mode) == 0o640

    def fail(*_: object) -> None:
        raise OSError("disk on fire")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OSError, match="disk on fire"):
        files.write_atomic(path, "newer")
    assert path.read_text() == "new" and list(path.parent.iterdir()) == [path]


def test_new_files_follow_the_umask(tmp_path: Path) -> None:
    before = os.umask(0o077)
    try:
        assert stat.S_IMODE(files.write_atomic(tmp_path / "x", b"").stat().st_mode) == 0o600
    finally:
        os.umask(before)


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "real").write_text("old")
    (tmp_path / "link").symlink_to(tmp_path / "real")
    files.write_atomic(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink() and (tmp_path / "real").read_text() == "new"


@pytest.mark.skipif(not Path("/dev/null").exists(), reason="no /dev/null here")
def test_a_device_is_written_to_and_stays() -> None:
    files.write_atomic("/dev/null", b"gone")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)


def test_a_target_is_tried_before_the_work(tmp_path: Path) -> None:
    files.check_target(tmp_path / "a" / "b.json")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").touch()
    with pytest.raises(ValueError, match="cannot be written"):
        files.check_target(tmp_path / "file" / "b.json")
    with pytest.raises(ValueError, match="is a folder; name a file to write"):
        files.check_target(tmp_path)


def test_a_write_protected_target_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As root every file may be written: what the system says of this one is put in its place."""
    (tmp_path / "rig.json").touch()
    files.check_target(tmp_path / "rig.json")
    monkeypatch.setattr(os, "access", lambda path, mode: not (Path(path).name == "rig.json" and mode == os.W_OK))
    with pytest.raises(ValueError, match=r"rig\.json: cannot be written, it is write-protected; lift that, or choose"):
        files.check_target(tmp_path / "rig.json")
    files.check_target(tmp_path / "other.json")


@pytest.mark.parametrize("data", [b"\x00new\r\n", "new ±\n"])
def test_write_replaces(tmp_path, data):
    path = tmp_path / "new" / "folder" / "a.csv"
    assert files.write_atomic(path, "old, and longer than the new one") == path
    files.write_atomic(path, data)
    assert path.read_bytes() == (data if isinstance(data, bytes) else data.encode())
    assert [p.name for p in path.parent.iterdir()] == ["a.csv"]


@pytest.mark.parametrize("at", ["fdopen", "chmod", "replace"])
@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError(28, "no space left on device")])
def test_interrupted_write_leaves_the_old_file_whole(tmp_path, monkeypatch, at, error):
    path = files.write_atomic(tmp_path / "fig05.png", b"the old picture")
    real = os.fdopen

    def fail(*arguments, **_):
        if at == "fdopen":  # half of it is written when the interruption comes
            with real(arguments[0], "wb") as stream:
                stream.write(b"half")
        raise error

    monkeypatch.setattr(os, at, fail)
    with pytest.raises(error if isinstance(error, type) else OSError) as stopped:
        files.write_atomic(path, b"the new picture, all of it")
    assert getattr(stopped.value, "filename", str(path)) == str(path)
    assert path.read_bytes() == b"the old picture"
    assert [p.name for p in tmp_path.iterdir()] == ["fig05.png"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_is_written_to_and_stays(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with ThreadPoolExecutor(1) as pool:
        read = pool.submit(pipe.read_bytes)
        files.write_atomic(pipe, "through")
        assert read.result(timeout=10) == b"through"
    assert pipe.is_fifo()


@pytest.mark.skipif(os.name == "nt", reason="locks are of Unix")
def test_what_a_killed_writer_left_goes_with_the_next_write(tmp_path):
    target, others = (
        tmp_path / "map.png",
        [tmp_path / name for name in (".map.png.old", ".map.png.0123456z", ".map.pn")],
    )
    for path in (tmp_path / ".map.png.0123abcd", *others):
        path.write_bytes(b"half")
    at_work = tmp_path / ".map.png.fedcba98"
    with at_work.open("wb") as stream:
        assert files.hold(stream)
        files.write_atomic(target, b"new")
        assert set(tmp_path.iterdir()) == {target, at_work, *others}
    files.write_atomic(target, b"newer")
    assert set(tmp_path.iterdir()) == {target, *others}


def test_a_link_that_leads_nowhere_is_not_proposed_in_its_own_place(tmp_path: Path) -> None:
    (tmp_path / "scan.bin").symlink_to("gone.bin")
    with pytest.raises(ValueError, match=r"scan\.bin: no such file; it is a link to gone\.bin, which is not there"):
        files.read_bytes(tmp_path / "scan.bin")
