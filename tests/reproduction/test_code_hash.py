"""The hash of a room's code changes with what it does, and with nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from stereolib.reproduction import code_sha256

CODE = '"""What it is."""\n\n\ndef f(x: int) -> str:\n    """Do it."""\n    return f"{x:>{x}} {x!r}"\n'


def written(folder: Path, text: str, name: str = "a.py") -> str:
    (folder / "room").mkdir(parents=True, exist_ok=True)
    (folder / "room" / name).write_text(text, encoding="utf-8")
    return code_sha256(["room"], folder)


@pytest.mark.parametrize(
    "other",
    [
        CODE.replace("What it is.", "What it was."),
        CODE.replace('    """Do it."""\n', ""),
        CODE.replace("return", "# because\n    return"),
        CODE.replace("\n\n\n", "\n\n"),
    ],
)
def test_words_and_layout_leave_it(tmp_path: Path, other: str) -> None:
    assert other != CODE and written(tmp_path / "one", CODE) == written(tmp_path / "two", other)


@pytest.mark.parametrize(
    "other", [CODE.replace("!r", "!s"), CODE.replace("x:>", "x:<"), CODE.replace("int", "float"), CODE + "Y = 1\n"]
)
def test_another_code_changes_it(tmp_path: Path, other: str) -> None:
    assert written(tmp_path / "one", CODE) != written(tmp_path / "two", other)


def test_a_file_that_is_written_again_is_read_again(tmp_path: Path) -> None:
    before = written(tmp_path, CODE)
    assert written(tmp_path, CODE + "Y = 1\n") != before
    assert written(tmp_path, CODE) == before


def test_another_module_changes_it_and_a_name_is_part_of_it(tmp_path: Path) -> None:
    first, second = written(tmp_path / "one", CODE), written(tmp_path / "two", CODE, "b.py")
    assert len({first, second, written(tmp_path / "one", CODE, "b.py")}) == 3


def test_what_a_room_reads_counts_byte_by_byte(tmp_path: Path) -> None:
    alone = written(tmp_path, CODE)
    laws = [written(tmp_path, text, "laws.json") for text in ("[1]", "[2]", "[2] ")]
    assert len({alone, *laws}) == 4 and code_sha256(["room/laws.json"], tmp_path) != laws[2]


def test_it_does_not_depend_on_the_version_of_python(tmp_path: Path) -> None:
    known = "971b58f34ca20ed5bc87db27957f11e800ce65dea21a626b796051d28b2b717f"
    assert written(tmp_path, CODE) == known


def test_a_room_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no room 'attic'"):
        code_sha256(["attic"])


def test_a_single_module_stands_for_itself(tmp_path: Path) -> None:
    written(tmp_path, CODE)
    alone = code_sha256(["room/a.py"], tmp_path)
    assert alone == written(tmp_path, CODE)
    written(tmp_path, CODE, "b.py")
    assert alone == code_sha256(["room/a.py"], tmp_path) != code_sha256(["room"], tmp_path)
