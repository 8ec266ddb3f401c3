"""The command that writes a board."""

from __future__ import annotations

from pathlib import Path

import pytest

from stereolib.cli import commands


@pytest.mark.parametrize(
    ("words", "then"),
    [
        ([], "--board 9x6 --square-mm 23"),
        (["--charuco", "--paper", "letter"], "--board 9x6 --square-mm 24 --marker-mm 17.3"),
        (["--board", "7x5", "--square-mm", "20", "--marker-mm", "15"], "--board 7x5 --square-mm 20 --marker-mm 15"),
    ],
)
def test_a_board_is_written_and_the_next_step_told(
    words: list[str], then: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "sheets" / "board.pdf"
    assert commands.main(["board", "--out", str(out), *words]) == 0
    assert out.read_bytes().startswith(b"%PDF")
    assert f"stereolib calibrate left right {then}\n" in capsys.readouterr().out
    assert commands.main(["board", "--out", str(out), *words]) == 2
    assert "would be overwritten" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (["--board", "9by6"], "inner corners, as 9x6"),
        (["--board", "6x6"], "looks the same after a quarter turn"),
        (["--square-mm", "40"], "do not fit a4: 23 mm do"),
        (["--square-mm", "24x25"], "as high as wide"),
        (["--square-mm", "nan"], "positive number of mm"),
        (["--marker-mm", "30"], "a marker must be smaller than its square"),
        (["--paper", "napkin"], "unknown paper 'napkin'"),
        (["--dictionary", "4X4_50"], "--dictionary is about ChArUco boards: add --charuco, or leave it out"),
        (["--charuco", "--dictionary", "9X9"], "unknown ArUco dictionary"),
        (["--charuco", "--board", "20x14", "--dictionary", "4X4_50"], "needs 157 markers, 4X4_50 has 50"),
        (["--out", "board.png"], "the board is written as .pdf"),
        (["--board", "400x300"], "not even squares of 1 mm fit a4"),
    ],
)
def test_wrong_words_are_one_line(
    words: list[str], hint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert commands.main(["board", *words]) == 2
    said = capsys.readouterr().err
    assert hint in said and said.count("\n") == 1
    assert not list(tmp_path.iterdir())
