"""Loops as machine code: what a user sees of it."""

from __future__ import annotations

import sys

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
def test_a_terminal_is_told_once_that_loops_are_compiled(anew, capsys, is_terminal):
    anew.setattr("sys.stderr.isatty", lambda: is_terminal, raising=False)
    out = np.zeros(3, np.uint8)
    for _ in range(2):
        loops = eval("lambda values, out: out.fill(values.size)")  # of no file, so that it was never kept
        compiled(loops)(np.arange(3, dtype=np.uint8), out)
    assert (out == 3).all()
    assert capsys.readouterr().err.count("compiling") == is_terminal


def test_loops_run_where_nothing_can_be_kept(anew):
    import numba

    def njit(*loops, cache=False):
        if cache:
            raise RuntimeError("cannot cache function 'doubled': no locator available")
        return real(*loops)

    real = numba.njit
    anew.setattr(numba, "njit", njit)
    out = np.zeros(3, np.uint8)
    compiled(doubled)(np.arange(3, dtype=np.uint8), out)
    assert out.tolist() == [0, 2, 4]
