"""Loops as machine code: for what goes over every pixel and disparity, where numpy is slow since it does so many times.

A picture of 741 x 500 px and 64 disparities has 24 million cells, and each is seen along four paths. Array by array,
numpy takes several times as long for that as one loop that does all its steps while a cell is at hand.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache, wraps
from typing import Any, ParamSpec

P = ParamSpec("P")
_MISSING = (
    'the pipeline "best" needs numba, which cannot be loaded ({0}): pip install numba, or, where pip has none for this '
    'machine, as for Macs with Intel, conda install numba; "fast" and "paper" do without'
)


def compiled(loops: Callable[P, None]) -> Callable[P, None]:
    """Have numba compile a function when it is called first, and keep it on disk, if it can, for the next process.

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
        When it is called, if numba cannot be loaded.

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
    def machine_code(*, kept: bool) -> Callable[P, None]:
        code: Callable[P, None] = _numba().njit(cache=kept)(loops)
        return code

    is_kept = True

    @wraps(loops)
    def run(*args: P.args, **kwargs: P.kwargs) -> None:
        nonlocal is_kept
        if is_kept:
            try:
                machine_code(kept=True)(*args, **kwargs)
                return
            except Exception:  # no folder, a full disk, a damaged file, or the loops' own fault, which shows again
                is_kept = False
        machine_code(kept=False)(*args, **kwargs)

    return run


@cache
def _numba() -> Any:
    """The package, half a second after it is asked for: only those wait for it who match."""
    try:
        import numba
        from numba.core import event
    except ImportError as error:
        raise ImportError(_MISSING.format(error)) from error  # without a name: said as it stands

    class Notice(event.Listener):
        told = False

        def on_start(self, started: Any) -> None:
            ours = str(started.data["dispatcher"].py_func.__module__).startswith("stereolib.")
            if ours and not self.told and sys.stderr is not None and sys.stderr.isatty():
                print("compiling the matcher for this machine: some seconds ...", file=sys.stderr)
            self.told |= ours

        def on_end(self, _: object) -> None:
            pass

    known: Any = event
    known.register("numba:compile", Notice())
    return numba
