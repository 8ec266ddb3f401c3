"""A chain of steps: each a function of a state, whose last results are kept by what it depends on."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, Generic, TypeVar

from stereolib.notebook.knobs import State

_Made = TypeVar("_Made")
_KEPT = 6  # results of a step


class Step(Generic[_Made]):
    """One step of the chain: a function of a state, its last results kept by the knobs that it depends on.

    Parameters
    ----------
    make : callable
    knobs : sequence of str
    after : sequence of Step
        What it calls; their knobs are its own.
    """

    def __init__(self, make: Callable[[State], _Made], knobs: tuple[str, ...], after: tuple[Step[Any], ...]) -> None:
        self.make, self.__doc__ = make, make.__doc__
        self.knobs: tuple[str, ...] = tuple(
            dict.fromkeys([name for step in after for name in step.knobs] + list(knobs))
        )
        self._made: OrderedDict[tuple[object, ...], Future[_Made]] = OrderedDict()
        self._looking = threading.Lock()  # a click asks while the pictures are being drawn

    def __call__(self, state: State) -> _Made:
        key = tuple(getattr(state, name) for name in self.knobs)
        with self._looking:
            is_new = key not in self._made
            made = self._made.setdefault(key, Future())
            self._made.move_to_end(key)
            while len(self._made) > _KEPT:
                self._made.popitem(last=False)
        if is_new:
            try:
                made.set_result(self.make(state))
            except BaseException as error:
                self._made.pop(key, None)
                made.set_exception(error)
        return made.result()


def step(*knobs: str, after: tuple[Step[Any], ...] = ()) -> Callable[[Callable[[State], _Made]], Step[_Made]]:
    """Make a function of a state a step that depends on some knobs and on other steps."""
    return lambda make: Step(make, knobs, after)
