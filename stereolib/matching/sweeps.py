"""Sweeps: many settings of the matcher over many scenes, measured against the truth and saved as they go."""

from __future__ import annotations

import csv
import hashlib
import io
import itertools
import os
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import cv2

from stereolib.base import read_text, write_atomic
from stereolib.matching.ground_truth import FIELDS, METRICS, KnownView, ReadyView
from stereolib.matching.pair_checks import check_rectified
from stereolib.matching.sgbm import SGBMParams, check_window, match_in_steps
from stereolib.rig import one_opencv_thread

if TYPE_CHECKING:
    import pandas as pd

_FORMAT = "# stereolib.study/1"
_LIMIT_BYTES = 256 * 2**20  # of a results file: some 400 bytes a row, half a million rows
_FAREWELL_S = 60  # for a thread inside OpenCV to come out before Python ends
_Scores: TypeAlias = list[list[float]]  # `METRICS` of each region
_Job: TypeAlias = tuple[KnownView, SGBMParams]


@dataclass(frozen=True)
class Workers:
    """Who does the matches of a sweep.

    Parameters
    ----------
    n_jobs : int
        How many; -1 is one a core. OpenCV itself is kept to one thread meanwhile.
    backend : str
        Any joblib backend by name: ``"threading"`` (SGBM lets other threads run), ``"loky"``, ``"multiprocessing"``,
        or ``"dask"`` inside a `distributed.Client` (``pip install 'stereolib[cluster]'``).
    """

    n_jobs: int = -1
    backend: str = "threading"


def settings_grid(base: SGBMParams | None = None, **choices: Iterable[Any]) -> list[SGBMParams]:
    """Make every combination of some choices.

    Parameters
    ----------
    base : SGBMParams, optional
        Holds what is not chosen.
    **choices
        Values by the name of the field.

    Returns
    -------
    list of SGBMParams

    Raises
    ------
    ValueError
        If a name is no field, there is none, or a value is refused.

    Examples
    --------
    >>> [(p.block_size, p.mode) for p in settings_grid(block_size=(3, 5), mode=("sgbm", "hh"))]
    [(3, 'sgbm'), (3, 'hh'), (5, 'sgbm'), (5, 'hh')]
    """
    unknown = set(choices) - set(FIELDS)
    if unknown or not choices:
        raise ValueError(f"unknown fields {sorted(unknown)}: SGBMParams has {', '.join(FIELDS)}")
    base = base or SGBMParams()
    return [replace(base, **dict(zip(choices, one, strict=True))) for one in itertools.product(*choices.values())]


def sweep(
    views: Sequence[KnownView],
    settings: Sequence[SGBMParams],
    *,
    whole: bool = False,
    results: str | os.PathLike[str] | None = None,
    workers: Workers = Workers(),
    progress: bool = True,
) -> pd.DataFrame:
    """Match every view with every setting and measure the maps.

    Parameters
    ----------
    views : sequence of KnownView
    settings : sequence of SGBMParams
        From `settings_grid`, or any list.
    whole : bool
        As in `compute_disparity`.
    results : path, optional
        CSV that gets each match's rows as soon as they are there. What it holds already is not done again, so that an
        interrupted sweep goes on, and a finished one may be given more settings.
    workers : Workers
        How many, and of which kind.
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
    from tqdm.auto import tqdm

    jobs = _listed(views, settings)
    file = None if results is None else _Results(Path(results), views, whole)
    done: dict[str, _Scores] = {} if file is None else file.read()
    todo = {key: job for key, job in jobs.items() if key not in done}
    unsure = {view.name: view for view, _ in todo.values()}.values()
    Parallel(workers.n_jobs, prefer="threads")(delayed(_check_rectified)(view) for view in unsure)
    finished = 0
    kept = "give `results` to keep them" if file is None else f"they are in {file.path}; call again to go on"
    try:
        bar = tqdm(desc="sweep", total=len(jobs), initial=len(done), unit="match", disable=not progress)
        for key, scores in _run(todo, whole, workers, bar):
            done[key] = scores
            finished += 1
            if file is not None:
                file.append(key, jobs[key], scores)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"the sweep was stopped after {finished} of {len(todo)} matches; {kept}") from None
    except Exception as error:
        text = str(error).strip().splitlines()
        why = f"{type(error).__name__}: {text[0] if text else 'no text'}"
        raise RuntimeError(f"the sweep stopped after {finished} of {len(todo)} matches ({why}); {kept}") from error
    if file is not None:
        file.finish(jobs, done)
    return pd.DataFrame([row for key, job in jobs.items() for row in _rows(*job, done[key])])


def _check_rectified(view: KnownView) -> None:
    try:
        check_rectified(view.left, view.right)
    except ValueError as error:
        raise ValueError(f"view {view.name!r}: {error}") from None


def _listed(views: Sequence[KnownView], settings: Sequence[SGBMParams]) -> dict[str, _Job]:
    """Every match by its key: a fingerprint of the view's name and the settings."""
    names = [view.name for view in views]
    if not names or not settings or len(set(names)) < len(names) or len(set(settings)) < len(settings):
        got = f"got {len(names)} views named {', '.join(names)} and {len(settings)} settings"
        needed = "views with different names and different settings, at least one of each"
        raise ValueError(f"a sweep takes {needed}; {got}")
    jobs = list(itertools.product(views, settings))
    for view, params in jobs:
        check_window(params, view.left.shape[1])
    return {hashlib.sha256(repr((job[0].name, job[1])).encode()).hexdigest()[:16]: job for job in jobs}


def _run(todo: Mapping[str, _Job], whole: bool, workers: Workers, bar: Any) -> Iterator[tuple[str, _Scores]]:
    """Match and score; whoever finishes first comes first."""
    from joblib import Parallel, delayed, parallel_config

    views = {view.name: view for view, _ in todo.values()}
    ready = {name: ReadyView.of(view) for name, view in views.items()}
    options: dict[str, Any] = {}
    if workers.backend == "dask":
        try:
            import distributed  # noqa: F401
        except ImportError:
            raise ValueError("the backend 'dask' needs dask: pip install 'stereolib[cluster]'") from None
        options["scatter"] = list(ready.values())
    calls = [delayed(_measure)(key, ready[view.name], params, whole) for key, (view, params) in todo.items()]
    with bar, one_opencv_thread(), parallel_config(workers.backend, n_jobs=workers.n_jobs, **options):
        before = threading.enumerate()
        try:
            for one in Parallel(return_as="generator_unordered", batch_size=1)(calls):
                yield one
                bar.update()
        except KeyboardInterrupt:  # a thread inside OpenCV when Python ends aborts the process: let it come out first
            for thread in threading.enumerate():
                if thread not in before:
                    thread.join(timeout=_FAREWELL_S)
            raise


def _measure(key: str, ready: ReadyView, params: SGBMParams, whole: bool) -> tuple[str, _Scores]:
    if cv2.getNumThreads() != 1:  # in a worker process
        cv2.setNumThreads(1)
    steps = match_in_steps(ready.left, ready.right, params, whole=whole)
    return key, ready.score(steps, params.min_disparity)


def _rows(view: KnownView, params: SGBMParams, scores: _Scores) -> Iterator[dict[str, Any]]:
    p1, p2 = params.penalties
    settings = {name: getattr(params, name) for name in FIELDS} | {"p1": p1, "p2": p2}
    for where, values in zip(view.masks(), scores, strict=True):
        yield {"view": view.name, **view.about, **settings, "where": where, **dict(zip(METRICS, values, strict=True))}


class _Results:
    """The file of a sweep: a line that names the study, then CSV.

    A match's rows are appended in one piece, as soon as they are there: writing the whole file anew for each match
    would take longer than matching. A line torn by a crash is dropped when the file is read again.
    """

    def __init__(self, path: Path, views: Sequence[KnownView], whole: bool) -> None:
        self.path = path
        self.about = list(dict.fromkeys(name for view in views for name in view.about))
        self.regions = {view.name: list(view.masks()) for view in views}
        self.columns = ["key", "view", *self.about, *FIELDS, "where", *METRICS]
        digests = sorted(view.digest() for view in views)
        study = hashlib.sha256(repr((digests, whole, self.columns)).encode()).hexdigest()[:16]
        self.head = f"{_FORMAT} {study}\n{','.join(self.columns)}\n"
        self.kept: list[str] = []

    def read(self) -> dict[str, _Scores]:
        """Measures of every finished match; a new file is begun, a torn last line is dropped."""
        if not self.path.exists():
            write_atomic(self.path, self.head)
            return {}
        text = read_text(self.path, limit_bytes=_LIMIT_BYTES)
        if not text.startswith(_FORMAT):
            raise ValueError(f"{self.path} is no results file of a sweep: give another name")
        if not text.startswith(self.head):
            advice = "Give another name, or the views it was made with"
            why = f"other views, truths, regions or `whole`. {advice}"
            raise ValueError(f"{self.path} holds the results of another study: {why}")
        rows = text[len(self.head) : text.rfind("\n") + 1]
        scores: dict[tuple[str, str], dict[str, list[float]]] = {}
        for at, row in enumerate(csv.DictReader(io.StringIO(rows), self.columns), 1 + self.head.count("\n")):
            regions = scores.setdefault((row["key"], row["view"]), {})
            try:
                regions[row["where"]] = [float(row[name]) for name in METRICS]
            except (TypeError, ValueError):  # too few columns, or no number
                raise ValueError(f"{self.path}: line {at} is damaged: delete it, and its match is done again") from None
        whole = ((key, each) for (key, view), each in scores.items() if list(each) == self.regions.get(view))
        done = {key: list(each.values()) for key, each in whole}
        self.kept = [line for line in rows.splitlines(keepends=True) if line.split(",", 1)[0] in done]
        write_atomic(self.path, self.head + "".join(self.kept))
        return done

    def lines(self, key: str, job: _Job, scores: _Scores) -> str:
        """Write a match's rows as CSV."""
        stream = io.StringIO()
        writer = csv.DictWriter(stream, self.columns, lineterminator="\n")
        writer.writerows({"key": key, **row} for row in _rows(*job, scores))
        return stream.getvalue()

    def append(self, key: str, job: _Job, scores: _Scores) -> None:
        """Add a match's rows at the end."""
        with self.path.open("ab") as stream:
            stream.write(self.lines(key, job, scores).encode())

    def finish(self, jobs: Mapping[str, _Job], done: Mapping[str, _Scores]) -> None:
        """Write the rows again in their order, whoever finished first; rows of other settings stay below."""
        own = "".join(self.lines(key, job, done[key]) for key, job in jobs.items())
        others = "".join(line for line in self.kept if line.split(",", 1)[0] not in jobs)
        write_atomic(self.path, self.head + own + others)
