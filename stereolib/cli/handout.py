"""The command ``stereolib handout``: what a class without internet needs, in one archive."""

from __future__ import annotations

import argparse
import os
import stat
import subprocess
import sys
import sysconfig
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path

from stereolib.base import listed
from stereolib.cli.command import Command
from stereolib.cli.errors import DONE
from stereolib.cli.outputs import check_ending, check_outputs

FOLDER = "stereolib-class"  # all of the archive is in it
_PINS = "requirements.txt", "requirements-explore.txt"  # of the notebooks, and of the page of `make explore`
_PARTS = (
    *("bootstrap.py", "Makefile", "pyproject.toml", "hatch_build.py", *_PINS),
    *("README.md", "CONVENTIONS.md", "LICENSE", "LICENSE-text"),
    *("stereolib", "notebooks", "data", "docs", "figures"),
)
_NEEDS_INTERNET = "3.11 or newer, and the internet once"
_PACKED = {".gz", ".jpg", ".png", ".npz", ".whl", ".zip"}  # endings of what does not get smaller
_START = f"""\
Exercises on stereo vision. You need Python {{needs}}.

  python bootstrap.py lab

sets up an environment in {FOLDER}/.venv (some minutes, the first time only) and opens JupyterLab with the first
chapter. The exercises are in notebooks/exercises; begin with 00_two_pictures.ipynb.
"""


def _configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", type=Path, default=Path(f"{FOLDER}.zip"), metavar="ZIP", help=f"default: {FOLDER}.zip")
    parser.add_argument("--no-wheels", action="store_true", help="without the packages; they are fetched in the class")
    parser.add_argument(
        "--platform",
        action="append",
        metavar="NAME",
        help="of the students' machines, as pip calls it (win_amd64; give all that fit); default: like this one",
    )
    parser.add_argument("--python", metavar="3.12", help="of the students' machines (default: like this one)")
    parser.add_argument("--force", action="store_true", help="replace the archive if it is there")


def _run(arguments: argparse.Namespace) -> int:
    from stereolib.base import counted, datasets, work_folder

    check_ending(arguments.out, ".zip", "the handout")
    check_outputs([arguments.out], force=arguments.force, option="--out")
    root, python = datasets.repository(), arguments.python or "{}.{}".format(*sys.version_info)
    part = arguments.out.with_name(f".{arguments.out.name}.part")
    with work_folder() as folder:
        try:
            wheels = [] if arguments.no_wheels else _fetch(root, folder, arguments.platform or [], python)
            _pack(part, root, wheels, _needs(python, arguments.platform) if wheels else _NEEDS_INTERNET)
            os.replace(part, arguments.out)
        finally:
            part.unlink(missing_ok=True)
    size = f"{arguments.out.stat().st_size / 1e6:.0f} MB"
    packages = f"{counted(len(wheels), 'package')} for Python {python}" if wheels else "no packages"
    print(f"written: {arguments.out}, {size}, with {packages}; START.txt in it says how to begin")
    return DONE


def _fetch(root: Path, folder: Path, platforms: list[str], python: str) -> list[Path]:
    """Fetch the pinned packages as wheels, with pip's own progress."""
    print("Fetching the packages (some minutes and 300 MB) ...", flush=True)
    choice = [word for name in platforms for word in ("--platform", name)] + ["--python-version", python]
    wanted = [word for name in _PINS for word in ("--requirement", str(root / name))]
    wanted += ["--dest", str(folder), "--only-binary", ":all:"]
    command = [sys.executable, "-m", "pip", "download", "--no-deps", *wanted, *choice]
    if subprocess.call(command, cwd=root) != 0:
        raise ValueError(
            "the packages could not be fetched: the lines above say why. Without a network here, or for a platform "
            "that lacks one of them, leave them out with --no-wheels"
        )
    return sorted(folder.glob("*.whl"))


def _needs(python: str, platforms: list[str] | None) -> str:
    """Which Python and system the packed packages are for."""
    system = listed(platforms or [sysconfig.get_platform()])
    return (
        f"{python}, and no internet:\nthe packages in the folder wheels are for Python {python} on {system}. With "
        "another Python or system\nthey do not install: delete that folder, and the first command fetches others, "
        "with the internet"
    )


def _pack(target: Path, root: Path, wheels: list[Path], needs: str) -> None:
    """Write the archive, with a bar."""
    from tqdm import tqdm

    target.parent.mkdir(parents=True, exist_ok=True)
    files = [(path, path.relative_to(root).as_posix()) for path in _files(root)]
    files += [(path, f"wheels/{path.name}") for path in wheels]
    with zipfile.ZipFile(target, "w") as archive:
        _add(archive, zipfile.ZipInfo(f"{FOLDER}/START.txt", time.localtime()[:6]), _START.format(needs=needs).encode())
        for path, name in tqdm(files, desc="packing", unit="file", leave=False, disable=None):
            about = zipfile.ZipInfo.from_file(path, f"{FOLDER}/{name}", strict_timestamps=False)
            _add(archive, about, path.read_bytes())


def _add(archive: zipfile.ZipFile, about: zipfile.ZipInfo, data: bytes) -> None:
    """Add a file that everybody may read, whatever its rights are here."""
    about.external_attr = (stat.S_IFREG | 0o644) << 16
    how = zipfile.ZIP_STORED if Path(about.filename).suffix in _PACKED else zipfile.ZIP_DEFLATED
    archive.writestr(about, data, how, compresslevel=1)


def _files(root: Path) -> Iterator[Path]:
    """Yield the files of the handout, without caches and what hides."""
    for part in _PARTS:
        for path in [root / part] if (root / part).is_file() else sorted((root / part).rglob("*")):
            hidden = [name for name in path.relative_to(root).parts if name.startswith((".", "__pycache__"))]
            if path.is_file() and not hidden:
                yield path


HANDOUT = Command(
    "handout",
    "pack what a class without internet needs: the chapters, the exercises, the data, the packages",
    "stereolib handout --out class.zip --platform win_amd64 --python 3.12",
    _run,
    _configure,
    interrupted="no archive was written",
)
