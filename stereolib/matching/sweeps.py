"""Sweeps: many settings of the matcher over many scenes, measured against the truth and saved as they go."""

from __future__ import annotations

import csv
import hashlib
import io
import itertools
import os
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from stereolib.base import write_atomic
from stereolib.matching.disparity import check_rectified, raw_disparity
from stereolib.matching.ground_truth import FIELDS, METRICS, Ready, View
from stereolib.matching.scoring import (
    Repair,
    Score,
    correlation_length_px,
    fattening_px,
    near_edge,
    overreach_px,
    repair,
    score,
    smallest_window,
)
from stereolib.matching.sgbm import SGBMParams, check_window

if TYPE_CHECKING:
    import pandas as pd

# The measures next door are reached through here too.
__all__ = [
    "FIELDS", "METRICS", "Repair", "Score", "View", "correlation_length_px", "fattening_px", "grid", "near_edge",
    "overreach_px", "random", "repair", "score", "smallest_window", "sweep",
]  # fmt: skip

_FORMAT = "# stereolib.study/1"


def grid(base: SGBMParams | None = None, **choices: Iterable[Any]) -> list[SGBMParams]:
    """Every combination of the choices, for example ``grid(block_size=(3, 5, 7), mode=("sgbm", "hh"))``."""
    _known(choices)
    base = base or SGBMParams()
    return [replace(base, **dict(zip(choices, one, strict=True))) for one in itertools.product(*choices.values())]


def random(
    count: int, rng: np.random.Generator, base: SGBMParams | None = None, **choices: Iterable[Any]
) -> list[SGBMParams]:
    """`count` different combinations of the choices, drawn at random from the grid.

    Raises
    ------
    ValueError
        If the grid holds fewer.
    """
    _known(choices)
    listed = [list(values) for values in choices.values()]
    shape = [len(values) for values in listed]
    most = int(np.prod(shape))
    if not 0 < count <= most:
        raise ValueError(f"{count} combinations are wanted, the choices make {most}")
    drawn = np.unravel_index(rng.choice(most, count, replace=False), shape)
    picks = [
        dict(zip(choices, (v[i] for v, i in zip(listed, at, strict=True)), strict=True))
        for at in zip(*drawn, strict=True)
    ]
    return [replace(base or SGBMParams(), **pick) for pick in picks]


def sweep(
    views: Sequence[View],
    settings: Sequence[SGBMParams],
    *,
    whole: bool = False,
    results: str | os.PathLike[str] | None = None,
    n_jobs: int = -1,
    backend: str = "threading",
    progress: bool = True,
) -> pd.DataFrame:
    """Match every view with every setting and measure the maps.

    Parameters
    ----------
    views : sequence of View
    settings : sequence of SGBMParams
        From `grid`, `random`, or any list.
    whole : bool
        As in `disparity.compute_disparity`.
    results : path, optional
        CSV that gets each match's rows as soon as they are there. What it holds already is not done again, so that an
        interrupted sweep goes on, and a finished one may be given more settings.
    n_jobs : int
        Workers; -1 is one a core. OpenCV itself is kept to one thread meanwhile.
    backend : str
        Any joblib backend by name: ``"threading"`` (SGBM lets other threads run), ``"loky"``, ``"multiprocessing"``,
        or ``"dask"`` inside a `distributed.Client` (``pip install 'stereolib[cluster]'``).
    progress : bool
        A bar with rate and remaining time.

    Returns
    -------
    pandas.DataFrame
        A row for each view, setting and region (column ``where``), in this order: the view's name and what it is
        about, the fields of `SGBMParams` (penalties as in force), and `METRICS`.

    Raises
    ------
    ValueError
        If a pair is exchanged or not rectified (the text names the view), a window does not fit, or `results` is of
        another study.
    RuntimeError
        If a worker dies. Finished rows are kept.
    KeyboardInterrupt
        At Ctrl-C, once the matches under way are done. Finished rows are kept: call again to go on.
    """
    import pandas as pd
    from joblib import Parallel, delayed

    jobs = _listed(views, settings)
    file = None if results is None else _Results(Path(results), views, whole)
    done: dict[str, list[list[float]]] = {} if file is None else file.read()
    todo = {key: job for key, job in jobs.items() if key not in done}
    unsure = {view.name: view for view, _ in todo.values()}.values()
    Parallel(n_jobs, prefer="threads")(delayed(_check_rectified)(view) for view in unsure)
    finished = 0
    kept = "give `results` to keep them" if file is None else f"they are in {file.path}; call again to go on"
    try:
        for key, measured in _run(todo, whole, n_jobs, backend, progress, len(jobs)):
            done[key] = measured
            finished += 1
            if file is not None:
                file.append(key, *jobs[key], measured)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"the sweep was stopped after {finished} of {len(todo)} matches; {kept}") from None
    except Exception as error:
        text = str(error).strip().splitlines()
        raise RuntimeError(
            f"the sweep stopped after {finished} of {len(todo)} matches ({type(error).__name__}: "
            f"{text[0] if text else 'no text'}); {kept}"
        ) from error
    if file is not None:
        file.finish(jobs, done)
    rows = [row for key, (view, params) in jobs.items() for row in _rows(view, params, done[key])]
    return pd.DataFrame(rows)


def _check_rectified(view: View) -> None:
    try:
        check_rectified(view.left, view.right)
    except ValueError as error:
        raise ValueError(f"view {view.name!r}: {error}") from None


def _listed(views: Sequence[View], settings: Sequence[SGBMParams]) -> dict[str, tuple[View, SGBMParams]]:
    """Every match by its key: a fingerprint of the view's name and the settings."""
    names = [view.name for view in views]
    if not names or not settings or len(set(names)) < len(names) or len(set(settings)) < len(settings):
        raise ValueError(f"a sweep takes views with different names and different settings, at least one of each; got "
                         f"{len(names)} views named {', '.join(names)} and {len(settings)} settings")  # fmt: skip
    for view, params in itertools.product(views, settings):
        check_window(params, view.left.shape[1])
    return {
        hashlib.sha256(repr((view.name, params)).encode()).hexdigest()[:16]: (view, params)
        for view, params in itertools.product(views, settings)
    }


def _run(
    todo: Mapping[str, tuple[View, SGBMParams]], whole: bool, n_jobs: int, backend: str, progress: bool, total: int
) -> Iterator[tuple[str, list[list[float]]]]:
    from joblib import Parallel, delayed, parallel_config
    from tqdm.auto import tqdm

    views = {view.name: view for view, _ in todo.values()}
    ready = {name: Ready.of(view) for name, view in views.items()}
    options: dict[str, Any] = {}
    if backend == "dask":
        try:
            import distributed  # noqa: F401
        except ImportError:
            raise ValueError("the backend 'dask' needs dask: pip install 'stereolib[cluster]'") from None
        options["scatter"] = list(ready.values())
    calls = [delayed(_measure)(key, ready[view.name], params, whole) for key, (view, params) in todo.items()]
    bar = tqdm(desc="sweep", total=total, initial=total - len(todo), unit="match", disable=not progress)
    with bar, _one_thread_each(), parallel_config(backend, n_jobs=n_jobs, **options):
        before = threading.enumerate()
        try:
            for one in Parallel(return_as="generator_unordered", batch_size=1)(calls):
                yield one
                bar.update()
        except KeyboardInterrupt:  # a thread inside OpenCV when Python ends aborts the process: let it come out first
            for thread in threading.enumerate():
                if thread not in before:
                    thread.join(timeout=60)
            raise


def _measure(key: str, ready: Ready, params: SGBMParams, whole: bool) -> tuple[str, list[list[float]]]:
    if cv2.getNumThreads() != 1:  # in a worker process
        cv2.setNumThreads(1)
    border = max(0, params.min_disparity + params.num_disparities) if whole else 0
    raw = raw_disparity(ready.left, ready.right, params, border)
    if border:  # a match outside the right image is a match with the border's copies
        raw = np.where(
            raw > 16 * np.arange(raw.shape[1], dtype=np.int16), np.int16(16 * params.min_disparity - 16), raw
        )
    return key, ready.measure(raw, params.min_disparity)


def _rows(view: View, params: SGBMParams, measured: list[list[float]]) -> Iterator[dict[str, Any]]:
    p1, p2 = params.penalties
    settings = {name: getattr(params, name) for name in FIELDS} | {"p1": p1, "p2": p2}
    for where, values in zip(view.masks(), measured, strict=True):
        yield {"view": view.name, **view.about, **settings, "where": where, **dict(zip(METRICS, values, strict=True))}


class _Results:
    """The file of a sweep: a line that names the study, then CSV; a match's rows are written in one piece."""

    def __init__(self, path: Path, views: Sequence[View], whole: bool) -> None:
        self.path = path
        self.about = list(dict.fromkeys(name for view in views for name in view.about))
        self.regions = {view.name: list(view.masks()) for view in views}
        self.columns = ["key", "view", *self.about, *FIELDS, "where", *METRICS]
        digests = sorted(view.digest() for view in views)
        study = hashlib.sha256(repr((digests, whole, self.columns)).encode()).hexdigest()[:16]
        self.head = f"{_FORMAT} {study}\n{','.join(self.columns)}\n"
        self.other: list[str] = []

    def read(self) -> dict[str, list[list[float]]]:
        """Measures of every finished match; a new file is begun, a torn last line is dropped."""
        if not self.path.exists():
            write_atomic(self.path, self.head)
            return {}
        text = self.path.read_text(encoding="utf-8")
        if not text.startswith(_FORMAT):
            raise ValueError(f"{self.path} is no results file of a sweep: give another name")
        if not text.startswith(self.head):
            raise ValueError(
                f"{self.path} holds the results of another study: other views, truths, regions or `whole`. Give "
                f"another name, or the views it was made with"
            )
        text = text[: text.rfind("\n") + 1]
        found: dict[str, dict[str, list[float]]] = {}
        for row in csv.DictReader(io.StringIO(text[len(self.head) :]), self.columns):
            found.setdefault(row["key"] + row["view"], {})[row["where"]] = [float(row[name]) for name in METRICS]
        whole = {k: v for k, v in found.items() if list(v) == self.regions.get(k[16:])}
        lines = text[len(self.head) :].splitlines(keepends=True)
        kept = (
            [line for line in lines if any(line.startswith(f"{key[:16]},") for key in whole)]
            if len(whole) < len(found)
            else lines
        )
        write_atomic(self.path, self.head + "".join(kept))
        self.other = kept
        return {key[:16]: list(measured.values()) for key, measured in whole.items()}

    def lines(self, key: str, view: View, params: SGBMParams, measured: list[list[float]]) -> str:
        stream = io.StringIO()
        writer = csv.DictWriter(stream, self.columns, lineterminator="\n")
        writer.writerows({"key": key, **row} for row in _rows(view, params, measured))
        return stream.getvalue()

    def append(self, key: str, view: View, params: SGBMParams, measured: list[list[float]]) -> None:
        with self.path.open("ab") as stream:
            stream.write(self.lines(key, view, params, measured).encode())

    def finish(self, jobs: Mapping[str, tuple[View, SGBMParams]], done: Mapping[str, list[list[float]]]) -> None:
        """Write the rows again in their order, whoever finished first; rows of other settings stay below."""
        own = "".join(self.lines(key, *job, done[key]) for key, job in jobs.items())
        others = "".join(line for line in self.other if line[:16] not in jobs)
        write_atomic(self.path, self.head + own + others)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def _known(choices: Mapping[str, object]) -> None:
    unknown = set(choices) - set(FIELDS)
    if unknown or not choices:
        raise ValueError(f"unknown fields {sorted(unknown)}: SGBMParams has {', '.join(FIELDS)}")
