"""Where data is found: the repository, a folder of the user's, the cache, and the download with its sha256."""

from __future__ import annotations

import os
import time
from functools import cache, partial
from pathlib import Path
from threading import Thread

from stereolib.base.files import read_text

ROOT = Path(__file__).resolve().parents[2]  # the repository, in a checkout
_PACKAGED = ROOT / "stereolib" / "data"  # made by the build: a checkout has data/ instead
INSTALLED = _PACKAGED.is_dir()

# Recordings made by others, fetched for the user and never kept in the repository. See data/README.md.
_MINORU = (
    "https://raw.githubusercontent.com/Carzuiliam/calibrated-stereo-vision-system/"
    "2c3375a1c551ed4e6e13f2241d52e534a170b291/calibration"
)
_XV11 = "https://raw.githubusercontent.com/Xevel/NXV11/b2bc69d1229921f0990f97c3a22ff8979d2ac83c/data"


_LARGEST_BYTES = 32 * 2**20  # of a download; the recordings have some 100 kB each
_LONGEST_S, _CHUNK_BYTES = 300.0, 2**16


class NotAvailable(OSError):
    """A recording is neither in ``STEREOLIB_DATA``, nor in the cache, nor to be had from the network."""


def data_path(name: str) -> Path:
    """Find a data file of the repository.

    It is looked for in the checkout's ``data/`` or, of an installed package, in the few files that it holds, in the
    folder named by ``STEREOLIB_DATA`` and, if the virtual rig recorded it, in the user's cache. Into that it is fetched
    once, by its sha256, from the address named by ``STEREOLIB_DATA_URL`` or by the package as its ``Data``.

    Parameters
    ----------
    name : str
        Its path below ``data/``.

    Returns
    -------
    Path

    Raises
    ------
    ValueError
        If the file is not there; the text says how to get it.
    NotAvailable
        If it is not to be had from that address.

    Examples
    --------
    >>> data_path("paper/published.toml").name
    'published.toml'
    """
    own = os.environ.get("STEREOLIB_DATA")
    folders = [_PACKAGED, *([Path(own)] if own else [])] if INSTALLED else [ROOT / "data"]
    for folder in folders:
        if (folder / name).exists():
            return folder / name
    if INSTALLED and (known := virtual_recordings().get(name)) and (home := _home()):
        return _fetched(f"{home}/{name}", known, Path(_cache()) / name)
    if INSTALLED:
        raise ValueError(
            f"data/{name} is missing: it comes with stereolib's repository, not with the installed package. Clone the "
            f"repository and work there, or set STEREOLIB_DATA to a folder that holds {name}, or STEREOLIB_DATA_URL to "
            f"the address of such a folder; what begins with virtual/ can be made: stereolib data build --help says how"
        )
    raise ValueError(
        f"data/{name} is missing (looked in {folders[0] / name}). Restore it with `git checkout -- data` "
        f"or, if it belongs to the virtual rig, make it again with `stereolib data build`."
    )


def chapter_path(stem: str) -> Path:
    """Find a notebook, also of an installed package, which brings the one of one's own rig.

    Parameters
    ----------
    stem : str
        Its file without ``.ipynb``.

    Returns
    -------
    Path

    Raises
    ------
    ValueError
        If it is not there.
    """
    path = (_PACKAGED if INSTALLED else ROOT) / "notebooks" / f"{stem}.ipynb"
    if not path.is_file():
        raise ValueError(f"notebooks/{path.name} is missing: it comes with stereolib's repository, clone it")
    return path


def repository() -> Path:
    """Find the checkout, for what works on the repository itself.

    Returns
    -------
    Path

    Raises
    ------
    ValueError
        If the library was installed without it.
    """
    if INSTALLED:
        raise ValueError("this needs stereolib's repository, not the installed package: clone it and work there")
    return ROOT


def figures_dir() -> Path:
    """Find, and make, the folder that figures and tables are written to.

    Returns
    -------
    Path
        ``$STEREOLIB_FIGURES``, else the repository's ``figures/`` or, of an installed package, one in the current
        folder.
    """
    path = Path(os.environ.get("STEREOLIB_FIGURES") or (Path.cwd() if INSTALLED else ROOT) / "figures")
    path.mkdir(parents=True, exist_ok=True)
    return path


def real_recording(name: str, timeout_s: float = 4.0) -> Path:
    """Find one recording made by others, fetched on first use.

    It is looked for in the folder named by ``STEREOLIB_DATA``, then in the user's cache, then downloaded from the
    pinned commit; wherever it came from, its sha256 is checked.

    Parameters
    ----------
    name : str
        For example ``"xv11/hand_in_box.txt"`` or ``"minoru3d/left/1.jpg"``.
    timeout_s : float
        Longest wait for the network to answer, s.

    Returns
    -------
    Path

    Raises
    ------
    ValueError
        If there is no such recording, or the file found has another sha256.
    NotAvailable
        If it is not to be had; the text names the two ways to supply it.
    """
    import pooch

    if name not in _registry():
        raise ValueError(
            f"no recording {name!r}; known are xv11/hand_in_box.txt and minoru3d/left|right/1.jpg to 30.jpg"
        )
    known = _registry()[name]
    own = os.environ.get("STEREOLIB_DATA")
    if own and (Path(own) / name).is_file():
        path = Path(own) / name
        if pooch.file_hash(str(path)) != known:
            raise ValueError(
                f"{path} is not the recording it should be: its sha256 differs from {known[:12]}...; "
                f"replace it or unset STEREOLIB_DATA"
            )
        return path
    folder, _, rest = name.partition("/")
    if folder == "minoru3d":
        url = f"{_MINORU}/{rest.replace('left', 'lData').replace('right', 'rData')}"
    else:
        url = f"{_XV11}/{rest}"
    return _fetched(url, known, Path(_cache()) / folder / rest, timeout_s)


def _cache() -> str:
    import pooch

    return str(pooch.os_cache("stereolib"))


def _fetched(url: str, known: str, cached: Path, timeout_s: float = 4.0) -> Path:
    """A file of the cache, put there if need be; its sha256 is checked wherever it came from."""
    import pooch

    pooch.get_logger().setLevel("WARNING")
    try:
        if not cached.is_file():
            _wait_for_answer(url, timeout_s)
        fetched = pooch.retrieve(
            url,
            known_hash=f"sha256:{known}",
            fname=cached.name,
            path=cached.parent,
            downloader=partial(_download, timeout_s=timeout_s),
        )
    except (OSError, ValueError) as error:  # ValueError: what came has another sha256
        own = "has no such file" if os.environ.get("STEREOLIB_DATA") else "is not set"
        raise NotAvailable(
            f"the recording {cached.parent.name}/{cached.name} is not available: STEREOLIB_DATA {own}, the cache "
            f"{cached.parent} has none, and the download failed ({type(error).__name__}). Connect to the network, or "
            f"set STEREOLIB_DATA to a folder that holds it."
        ) from error
    return Path(fetched)


def virtual_recordings() -> dict[str, str]:
    """List the virtual rig's recordings, which are the demo rig.

    Returns
    -------
    dict of str to str
        sha256 by name below ``data/``.
    """
    sums = data_path("virtual/SHA256SUMS")
    pairs = (line.split(maxsplit=1) for line in read_text(sums).splitlines() if line.strip())
    return {f"virtual/{name.strip().removeprefix('*')}": digest for digest, name in pairs}


def demo_rig() -> Path:
    """Find the folder of the demo rig: the virtual rig's recordings, whole.

    Returns
    -------
    Path

    Raises
    ------
    ValueError, NotAvailable
        As `data_path`; an installed package fetches them once.
    """
    from tqdm.auto import tqdm

    names = virtual_recordings() if INSTALLED else ["virtual/rig.toml"]
    paths = [data_path(name) for name in tqdm(names, "demo rig", unit="file", delay=2, leave=False, disable=None)]
    return next(path.parent for path in paths if path.name == "rig.toml")


def _home() -> str:
    """Where the data folder is served: as the user says, or the package."""
    from importlib.metadata import metadata

    if own := os.environ.get("STEREOLIB_DATA_URL"):
        return own.rstrip("/")
    urls = (text.partition(", ") for text in metadata("stereolib").get_all("Project-URL") or [])
    return next((url.rstrip("/") for label, _, url in urls if label == "Data"), "")


def real_recordings(folder: str) -> list[Path]:
    """Find all recordings of a folder, in the order of their numbers.

    The first one decides whether the network is there, so that an offline machine waits once.

    Parameters
    ----------
    folder : str
        For example ``"minoru3d/left"``.

    Returns
    -------
    list of Path

    Raises
    ------
    ValueError, NotAvailable
        As `real_recording`.
    """
    names = [name for name in _registry() if name.startswith(f"{folder}/")]
    if not names:
        raise ValueError(f"no recordings under {folder!r}; known are xv11, minoru3d/left and minoru3d/right")
    return [real_recording(name) for name in names]


def _download(url: str, output_file: str, _: object, *, timeout_s: float) -> None:
    """Fetch a file of bounded size in bounded time, for pooch, which then holds it against its sha256."""
    import requests

    end_s, left = time.monotonic() + _LONGEST_S, _LARGEST_BYTES
    with requests.get(url, stream=True, timeout=timeout_s) as answer, Path(output_file).open("wb") as file:
        answer.raise_for_status()
        for chunk in answer.iter_content(_CHUNK_BYTES):
            left -= len(chunk)
            if left < 0 or time.monotonic() > end_s:
                raise OSError(f"more than {_LARGEST_BYTES / 1e6:.0f} MB, or longer than {_LONGEST_S:.0f} s")
            file.write(chunk)


def _wait_for_answer(url: str, timeout_s: float) -> None:
    """Raise OSError when the server does not answer in time.

    A request's own timeout holds for each address of the server and not at all for the look-up of its name: only
    leaving it behind in a thread keeps the promise.
    """
    import requests

    outcome: list[OSError | None] = []

    def ask() -> None:
        try:
            requests.head(url, timeout=timeout_s).close()
            outcome.append(None)
        except OSError as error:
            outcome.append(error)

    thread = Thread(target=ask, daemon=True)
    thread.start()
    thread.join(timeout_s)
    error = outcome[0] if outcome else TimeoutError(f"no answer within {timeout_s:g} s")
    if error is not None:
        raise error


@cache
def _registry() -> dict[str, str]:
    """sha256 by name, from ``data/real/SHA256SUMS``."""
    lines = read_text(data_path("real/SHA256SUMS")).splitlines()
    pairs = (line.split(maxsplit=1) for line in lines if line.strip())
    return {name.strip(): digest for digest, name in pairs}


def available(folder: str) -> list[Path]:
    """Find recordings as `real_recordings` does, or print that they are skipped: notebooks go on without them.

    Parameters
    ----------
    folder : str
        For example ``"xv11"``.

    Returns
    -------
    list of Path
        Empty where they are not to be had; the line that is printed says how to supply them.
    """
    try:
        return real_recordings(folder)
    except NotAvailable:
        print(f"skipped: {folder} is not available here; `stereolib data fetch` says why and what to do")
        return []
