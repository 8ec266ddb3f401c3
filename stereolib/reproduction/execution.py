"""Execute notebooks so that two executions give the same bytes.

A notebook is read, run in a kernel of this very interpreter and written elsewhere; the original stays as it is.
Times, widget state and versions are left out of what is written. A cell that raises, or writes to stderr, is a
failure that names notebook, cell and error; a kernel that died or stalls gets one more try.
"""

from __future__ import annotations

import asyncio
import re
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from stereolib.base import read_text, work_folder, write_atomic
from stereolib.reproduction.kernels import kernel_environment

CELL_TIMEOUT_S = 240.0
NOTEBOOK_TIMEOUT_S = 600.0
#: Where the user's settings would be: IPython's profile and matplotlib's file.
_SETTINGS = ("IPYTHONDIR", "MPLCONFIGDIR")
_TRACEBACK_LINES, _STDERR_CHARACTERS = 15, 500  # shown of a failure
INDEX = "00_two_pictures"  # shows what all the others recorded, so it runs last

_WIDGET_VIEW = "application/vnd.jupyter.widget-view+json"
_PICTURES = {"image/jpeg", "image/png"}
_HOW_TO_MOVE = "This is the picture of the first values. Run this cell to move the sliders."
_ANSI = re.compile(r"\x1b\[[0-9;]*m")
_METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {
        "file_extension": ".py",
        "mimetype": "text/x-python",
        "name": "python",
        "pygments_lexer": "ipython3",
    },
}


class NotebookError(RuntimeError):
    """A notebook that could not be executed: which, in which cell, and why."""


@dataclass(frozen=True)
class Limits:
    """How long to wait, in seconds: for one cell, for one notebook, for a kernel to start."""

    cell_s: float = CELL_TIMEOUT_S
    notebook_s: float = NOTEBOOK_TIMEOUT_S
    start_s: float = 60.0


def _nbformat() -> Any:
    """The library that reads and writes notebooks; its functions have no types."""
    import nbformat

    return nbformat


def normalise(notebook: Any) -> Any:
    """Take out of an executed notebook, in place, what differs from run to run or shows nothing to a reader.

    Parameters
    ----------
    notebook : nbformat.NotebookNode

    Returns
    -------
    nbformat.NotebookNode
        The same notebook: fixed kernel and language metadata, no widget views (the picture and the text that
        stand beside them stay for readers without a kernel, who are told how to get the sliders), no times, and an
        id in every cell.
    """
    notebook.metadata = _nbformat().from_dict(_METADATA)
    notebook.nbformat_minor = max(notebook.nbformat_minor, 5)
    for number, cell in enumerate(notebook.cells):
        cell.setdefault("id", f"cell-{number:02d}")
        cell.metadata.pop("execution", None)
        if cell.cell_type != "code":
            continue
        cell.outputs = [kept for output in cell.outputs for kept in _without_widget(output)]
    return notebook


def _without_widget(output: Any) -> list[Any]:
    """An output without its widget; before the picture that remains, what it shows and how to make it move."""
    if _WIDGET_VIEW not in output.get("data", {}):
        return [output]
    del output["data"][_WIDGET_VIEW]
    if not output["data"]:
        return []
    if _PICTURES.isdisjoint(output["data"]):
        return [output]
    text = output["data"].get("text/plain", "")
    html = f"<p>{escape(text)}</p>\n<p><small>{_HOW_TO_MOVE}</small></p>"
    said = {"text/html": html, "text/plain": f"{text}\n{_HOW_TO_MOVE}"}
    return [_nbformat().v4.new_output("display_data", data=said), output]


def failures(notebook: Any) -> list[str]:
    """Say which executed cells raised, where their tags do not expect it, or wrote to stderr.

    Parameters
    ----------
    notebook : nbformat.NotebookNode

    Returns
    -------
    list of str
        One text for each of these cells, with the end of the traceback.
    """
    wrong = []
    for number, cell in enumerate(notebook.cells, start=1):
        place = f"cell {number} (In [{cell.get('execution_count')}])"
        for output in cell.get("outputs", []):
            if output.output_type == "error":
                if "raises-exception" in cell.metadata.get("tags", []):  # nbclient runs on after these
                    continue
                lines = _ANSI.sub("", "\n".join(output.traceback)).splitlines()
                wrong.append("\n    ".join([f"{place}: {output.ename}: {output.evalue}", *lines[-_TRACEBACK_LINES:]]))
            elif output.output_type == "stream" and output.name == "stderr":
                wrong.append(f"{place} wrote to stderr: {output.text.strip()[:_STDERR_CHARACTERS]}")
    return wrong


def _make_client(notebook: Any, cwd: Path, connection: Path, limits: Limits, advance: Callable[[], None]) -> Any:
    """Client whose kernel is this interpreter, installed kernels or not, and which leaves signals alone."""
    from jupyter_client.kernelspec import KernelSpec, KernelSpecManager
    from jupyter_client.manager import AsyncKernelManager
    from nbclient import NotebookClient

    class ThisInterpreter(KernelSpecManager):  # type: ignore[misc, unused-ignore]
        def get_kernel_spec(self, kernel_name: str) -> KernelSpec:
            launch = [sys.executable, "-m", "ipykernel_launcher", "--log-level=ERROR"]
            argv = [*launch, "-f", "{connection_file}"]
            return KernelSpec(argv=argv, display_name="Python 3", language="python")

    class Client(NotebookClient):  # type: ignore[misc, unused-ignore]
        # nbclient's own takes over SIGINT for one notebook at a time; here several run in one loop, and an
        # interruption cancels them all.
        @asynccontextmanager
        async def async_setup_kernel(self, **kwargs: Any) -> AsyncIterator[None]:
            self.km = AsyncKernelManager(kernel_spec_manager=ThisInterpreter(), connection_file=str(connection))
            try:
                await self.async_start_new_kernel(**kwargs)
                await self.async_start_new_kernel_client()
                yield
            finally:
                if self.km is not None:
                    await self._async_cleanup_kernel()

    return Client(
        notebook,
        timeout=limits.cell_s,
        startup_timeout=limits.start_s,
        record_timing=False,
        store_widget_state=False,
        coalesce_streams=True,
        shutdown_kernel="immediate",
        resources={"metadata": {"path": str(cwd)}},
        on_cell_executed=lambda **_: advance(),
    )


async def _execute_once(source: Path, env: dict[str, str], limits: Limits, bar: Any) -> Any:
    """Execute one notebook in a new kernel; return it executed, with its errors as outputs."""
    from nbclient.exceptions import CellExecutionError, DeadKernelError

    notebook = _nbformat().reads(read_text(source), as_version=4)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
    bar.reset(total=sum(cell.cell_type == "code" and bool(cell.source.strip()) for cell in notebook.cells))
    connection = Path(env[_SETTINGS[0]]) / f"{source.stem}.json"
    client = _make_client(notebook, source.parent, connection, limits, lambda: bar.update())
    try:
        async with asyncio.timeout(limits.notebook_s) as clock:
            await client.async_execute(env=env)
    except CellExecutionError:
        pass  # the cell's own error is among its outputs, where failures() reads it
    except DeadKernelError as error:
        # nbclient says "dead" of whatever ends it from outside: the clock and the user too.
        if clock.expired():
            raise TimeoutError(f"no end after {limits.notebook_s:g} s") from None
        task = asyncio.current_task()
        if task is not None and task.cancelling():
            raise asyncio.CancelledError from error
        raise
    return notebook


async def _execute(source: Path, env: dict[str, str], limits: Limits, bar: Any) -> Any:
    """Execute one notebook, twice at most; raise NotebookError when that did not work."""
    from nbclient.exceptions import DeadKernelError

    for attempt in (1, 2):
        try:
            notebook = await _execute_once(source, env, limits, bar)
            break
        except (DeadKernelError, TimeoutError, RuntimeError) as error:
            reason = str(error).strip().splitlines()[0] if str(error).strip() else ""
            what = f"{type(error).__name__} {reason}".strip()
            if attempt == 2:
                raise NotebookError(
                    f"{source.name}: the kernel died or stalled twice ({what}); limits are {limits.cell_s:g} s a "
                    f"cell and {limits.notebook_s:g} s a notebook"
                ) from error
            bar.write(f"{source.stem}: {what}; trying once more", file=sys.stderr)
    if wrong := failures(notebook):
        raise NotebookError("\n".join(f"{source.name}, {line}" for line in wrong))
    return normalise(notebook)


async def _execute_all(
    sources: Sequence[Path], target_dir: Path, env: dict[str, str], jobs: int, limits: Limits
) -> list[NotebookError]:
    from tqdm import tqdm

    slots = list(range(jobs))  # lines of the terminal that a progress bar may take
    gate = asyncio.Semaphore(jobs)
    quiet = not sys.stderr.isatty()
    errors: list[NotebookError] = []

    async def one(source: Path) -> None:
        async with gate:
            slot, began = slots.pop(0), time.perf_counter()
            bar = tqdm(desc=source.stem, position=slot, leave=False, unit="cell", disable=quiet)
            if quiet:
                bar.write(f"{source.stem:<24} begins", file=sys.stderr)
            try:
                notebook = await _execute(source, env, limits, bar)
            except NotebookError as error:
                errors.append(error)
                bar.write(f"{source.stem:<24} FAILED", file=sys.stderr)
            else:
                write_atomic(target_dir / source.name, _nbformat().writes(notebook, indent=1) + "\n")
                seconds = time.perf_counter() - began
                bar.write(f"{source.stem:<24} {seconds:6.1f} s", file=sys.stderr)
            finally:
                bar.close()
                slots.append(slot)

    async with asyncio.TaskGroup() as group:
        for source in sources:
            if source.stem != INDEX:
                group.create_task(one(source))
    for source in sources:
        if source.stem == INDEX and not errors:
            await one(source)
    return errors


def execute_notebooks(
    sources: Sequence[Path],
    target_dir: Path,
    figures_dir: Path,
    jobs: int = 2,
    limits: Limits | None = None,
) -> None:
    """Execute notebooks, ``jobs`` at a time and the index last, with a progress bar for each.

    Parameters
    ----------
    sources : sequence of Path
        Notebooks; each kernel's working directory is its notebook's folder. They are not changed.
    target_dir : Path
        Folder that the executed copies are written to.
    figures_dir : Path
        Folder that the kernels write figures and tables to.
    jobs : int
        Notebooks at once, each with one thread.
    limits : Limits, optional
        Time limits; a dead or stalled kernel gets one more try.

    Raises
    ------
    NotebookError
        When a cell raised or wrote to stderr, or a kernel failed twice: notebook, cell and error, for every
        notebook that failed. The others are executed all the same, but not the index.
    ValueError
        If ``jobs`` is below 1.
    """
    if jobs < 1:
        raise ValueError(f"jobs is {jobs}; give the number of notebooks to run at once, 1 or more")
    target_dir.mkdir(parents=True, exist_ok=True)
    with work_folder() as settings:
        # The user's own stay out of it; a home that cannot be written is not asked for.
        env = kernel_environment(figures_dir) | dict.fromkeys(_SETTINGS, str(settings))
        list_fonts = [sys.executable, "-c", "import matplotlib.font_manager"]  # said on stderr where it takes long
        subprocess.run(list_fonts, env=env, capture_output=True, check=False)
        with asyncio.Runner(loop_factory=asyncio.SelectorEventLoop) as runner:
            errors = runner.run(
                _execute_all([Path(s).resolve() for s in sources], target_dir, env, jobs, limits or Limits())
            )
    if errors:
        raise NotebookError("\n".join(str(error) for error in errors))
