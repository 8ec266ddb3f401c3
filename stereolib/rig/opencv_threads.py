"""Work over all cores, each with an OpenCV that keeps to one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from threading import Lock, Semaphore
from typing import Any

import cv2


def over_cores(task: Callable[[Any], Any], items: Sequence[Any], what: str, *, progress: bool) -> Iterator[Any]:
    """Run a task on every item, by threads on all cores; OpenCV lets go of Python's lock.

    OpenCV's own threads rest meanwhile: they and ours would stand in each other's way.

    Parameters
    ----------
    task : callable
    items : sequence
    what : str
        The bar's title.
    progress : bool
        Show a bar.

    Yields
    ------
    object
        The results in the order of the items.
    """
    from joblib import Parallel, cpu_count, delayed
    from tqdm.auto import tqdm

    cores = cpu_count()
    slots = Semaphore(cores)

    def held(item: Any) -> Any:
        with slots:
            return task(item)

    with one_opencv_thread():
        try:
            parallel = Parallel(n_jobs=cores, prefer="threads", return_as="generator")
            running = parallel(delayed(held)(item) for item in items)
            yield from tqdm(running, what, len(items), unit="view", disable=not progress, leave=False)
        finally:
            for _ in range(cores):  # interrupted: OpenCV aborts the process if Python ends under it
                slots.acquire()


class _Held:
    """How many ask OpenCV to keep to one thread, and how many it had before the first of them."""

    lock, count, before = Lock(), 0, 0


@contextmanager
def one_opencv_thread() -> Iterator[None]:
    """Keep OpenCV to one thread: several add up in the order in which they end, and no sum is twice the same.

    OpenCV has one number for the whole process. It comes back when the last that asked is done.

    Yields
    ------
    None

    Examples
    --------
    >>> with one_opencv_thread():
    ...     cv2.getNumThreads()
    1
    """
    with _Held.lock:
        if not _Held.count:
            _Held.before = cv2.getNumThreads()
            cv2.setNumThreads(1)
        _Held.count += 1
    try:
        yield
    finally:
        with _Held.lock:
            _Held.count -= 1
            if not _Held.count:
                cv2.setNumThreads(_Held.before)
