"""Loops as machine code: for what goes over every pixel and disparity, where numpy is slow since it does so many times.

A picture of 741 x 500 px and 64 disparities has 24 million cells, and each is seen along eight paths. Array by array,
numpy takes several times as long for that as one loop that does all its steps while a cell is at hand.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache, wraps
from typing import Any, ParamSpec

P = ParamSpec("P")
_MISSING = (
    'the pipeline "best" needs numba, which is not installed ({0}): pip install numba, or, where pip has none for this '
    'machine, as for Macs with Intel, conda install numba; "fast" and "paper" do without'
)


def compiled(loops: Callable[P, None]) -> Callable[P, None]:
    """Have numba compile a function when it is called first, and keep it on disk for the next process.

    Parameters
    ----------
    loops : callable
        Takes arrays and scalars by position, writes into some of the arrays, and calls nothing that is compiled itself.

    Returns
    -------
    callable
        The same. Its first call ever takes a second or so; a terminal is told.

    Raises
    ------
    ImportError
        When it is called, if numba is not installed.

    Notes
    -----
    Values of 8 and 16 bits that are added need their type said again (``np.uint8(a + b)``): numba, like C, adds wider
    numbers, and the loop would go over fewer at a time.

    Examples
    --------
    >>> import numpy as np
    >>> @compiled
    ... def doubled(values, out):
    ...     for k in range(values.size):
    ...         out[k] = np.uint8(2 * values[k])
    >>> out = np.zeros(3, np.uint8)
    >>> doubled(np.arange(3, dtype=np.uint8), out)
    >>> out
    array([0, 2, 4], dtype=uint8)
    """

    @cache
    def machine_code() -> Callable[P, None]:
        numba = _numba()
        try:
            code: Callable[P, None] = numba.njit(cache=True)(loops)
        except RuntimeError:  # no folder to keep it in
            code = numba.njit(loops)
        return code

    @wraps(loops)
    def run(*args: P.args, **kwargs: P.kwargs) -> None:
        machine_code()(*args, **kwargs)

    return run


@cache
def _numba() -> Any:
    """The package, half a second after it is asked for: only those wait for it who match."""
    try:
        import numba
        from numba.core import event
    except ImportError as error:
        raise ImportError(_MISSING.format(error)) from error

    class Notice(event.Listener):
        told = False

        def on_start(self, _: object) -> None:
            if not self.told and sys.stderr.isatty():
                print("compiling the matcher for this machine, once: some seconds ...", file=sys.stderr)
            self.told = True

        def on_end(self, _: object) -> None:
            pass

    known: Any = event
    known.register("numba:compile", Notice())
    return numba
