"""Work for a finger that moves: always on the newest value, first quickly, then well; nothing ever queues."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable
from functools import partial
from typing import Any, Generic, TypeVar

_Value = TypeVar("_Value")
_REST_S = 0.12  # so long without a new value, and the finger rests
_LEAST_REST = 0.25  # share of it that is left to the finger after what was quickly shown


class Latest(Generic[_Value]):
    """A thread that works on the newest of the values it is given and drops the others.

    Parameters
    ----------
    quick : callable
        Shows a value at once, while the finger moves.
    full : callable
        Shows it well, when the finger rests; takes a function beside it that tells whether a newer value has come.
    rest_s : float
        How long without a new value is a rest; a quarter of it at least follows what was quickly shown.

    Examples
    --------
    >>> shown = []
    >>> worker = Latest(shown.append, lambda value, is_old: shown.append(-value), rest_s=0.2)
    >>> worker.ask(1); worker.ask(2); worker.settle()
    True
    >>> shown[-2:]
    [2, -2]
    """

    def __init__(
        self,
        quick: Callable[[_Value], object],
        full: Callable[[_Value, Callable[[], bool]], object],
        *,
        rest_s: float = _REST_S,
    ) -> None:
        self._quick, self._full, self._rest_s = quick, full, rest_s
        self._asked: list[_Value] = []
        self._generation, self._done = 0, 0
        self._changed, self._asked_at_s = threading.Condition(), 0.0
        self._thread: threading.Thread | None = None

    def ask(self, value: _Value) -> None:
        """Ask for a value; returns at once.

        Parameters
        ----------
        value : object
        """
        with self._changed:
            self._asked, self._generation = [value], self._generation + 1
            self._asked_at_s = time.monotonic()
            if self._thread is None or not self._thread.is_alive():
                self._thread = threading.Thread(target=self._run, daemon=True, name="latest")
                self._thread.start()
            self._changed.notify_all()

    def settle(self, timeout_s: float = 60.0) -> bool:
        """Wait until the newest value has been shown well.

        Parameters
        ----------
        timeout_s : float

        Returns
        -------
        bool
            Whether it has.
        """
        with self._changed:
            return self._changed.wait_for(lambda: self._done == self._generation, timeout_s)

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._done != self._generation)
                value, generation = self._asked[0], self._generation
            is_old = partial(self._is_past, generation)
            self._safely(self._quick, value)
            with self._changed:
                rested_s = time.monotonic() - self._asked_at_s
                if self._changed.wait_for(is_old, max(self._rest_s - rested_s, _LEAST_REST * self._rest_s)):
                    continue
            self._safely(self._full, value, is_old)
            with self._changed:
                if not is_old():
                    self._done = generation
                    self._changed.notify_all()

    def _is_past(self, generation: int) -> bool:
        return self._generation != generation

    @staticmethod
    def _safely(show: Callable[..., object], *arguments: Any) -> None:
        """Show, and keep the thread alive whatever happens: the fault stands on the standard error."""
        try:
            show(*arguments)
        except Exception:
            traceback.print_exc()
