"""Loops as machine code: what a user sees of it."""

from __future__ import annotations

import subprocess
import sys

import cv2
import numpy as np
import pytest

from stereolib.matching import compiled as module
from stereolib.matching.compiled import compiled


def doubled(values, out):
    for k in range(values.size):
        out[k] = np.uint8(2 * values[k])


@pytest.fixture
def anew(monkeypatch):
    """As in a process that has not compiled anything yet."""
    from numba.core import event

    before, event._registered["numba:compile"][:] = list(event._registered["numba:compile"]), []
    module._numba.cache_clear()
    yield monkeypatch
    event._registered["numba:compile"][:] = before
    module._numba.cache_clear()


def test_without_numba_best_says_what_it_needs(anew):
    anew.setitem(sys.modules, "numba", None)
    with pytest.raises(ImportError, match=r'"best" needs numba, .*pip install numba.*; "fast" and "paper" do without'):
        compiled(doubled)(np.zeros(1, np.uint8), np.zeros(1, np.uint8))


@pytest.mark.parametrize("is_terminal", [True, False])
def test_a_terminal_is_told_once_a_process_that_loops_are_compiled(anew, capsys, is_terminal):
    anew.setattr("sys.stderr.isatty", lambda: is_terminal, raising=False)
    out = np.zeros(3, np.uint8)
    for _ in range(2):
        loops = eval("lambda values, out: out.fill(values.size)")  # of no file, so that it was never kept
        loops.__module__ = "stereolib.matching.tried"
        compiled(loops)(np.arange(3, dtype=np.uint8), out)
    assert (out == 3).all()
    assert capsys.readouterr().err.count("compiling") == is_terminal


def test_loops_run_where_nothing_can_be_kept(anew):
    import numba

    def njit(cache=False):
        def refuses(_):
            raise RuntimeError("cannot cache function 'doubled': no locator available")

        return refuses if cache else real()

    real = numba.njit
    anew.setattr(numba, "njit", njit)
    out = np.zeros(3, np.uint8)
    compiled(doubled)(np.arange(3, dtype=np.uint8), out)
    assert out.tolist() == [0, 2, 4]


@pytest.mark.parametrize(
    "error", [OSError(28, "No space left on device"), EOFError("Ran out of input"), ValueError("bad marshal data")]
)
def test_loops_run_where_what_was_kept_is_damaged_or_the_disk_is_full(anew, error):
    """And it is tried once, not at every call."""
    import numba

    tried = []

    def njit(cache=False):
        def fails(*_):
            tried.append(error)
            raise error

        return (lambda _: fails) if cache else real()

    real = numba.njit
    anew.setattr(numba, "njit", njit)
    out = np.zeros(3, np.uint8)
    loops = compiled(doubled)
    for _ in range(2):
        loops(np.arange(3, dtype=np.uint8), out)
    assert out.tolist() == [0, 2, 4] and tried == [error]


def test_other_peoples_loops_and_a_missing_stderr_are_nothing_to_tell(anew, capsys):
    out = np.zeros(3, np.uint8)
    anew.setattr("sys.stderr.isatty", lambda: True, raising=False)
    compiled(eval("lambda values, out: out.fill(values.size)"))(np.arange(3, dtype=np.uint8), out)
    assert capsys.readouterr().err == ""
    anew.setattr(sys, "stderr", None)
    ours = eval("lambda values, out: out.fill(2 * values.size)")
    ours.__module__ = "stereolib.matching.tried"
    compiled(ours)(np.arange(3, dtype=np.uint8), out)
    assert (out == 6).all()


def test_the_command_says_in_a_line_that_numba_is_missing(tmp_path):
    """In a process of its own: in this one, loops may be compiled already."""
    rng = np.random.default_rng(0)
    wide = cv2.GaussianBlur(rng.integers(0, 256, (120, 200, 3), dtype=np.uint8), (0, 0), 1.0)
    for name, k in (("left", 0), ("right", 8)):
        cv2.imwrite(str(tmp_path / f"{name}.png"), wide[:, k : k + 180])
    without = "import sys; sys.modules['numba'] = None; from stereolib.cli import main; sys.exit(main(sys.argv[1:]))"
    files = [str(tmp_path / name) for name in ("left.png", "right.png", "o.npy")]
    done = subprocess.run(
        [sys.executable, "-c", without, "disparity", *files[:2], "--output", files[2]], capture_output=True, text=True
    )
    assert done.returncode == 2 and '"best" needs numba' in done.stderr and "Traceback" not in done.stderr
