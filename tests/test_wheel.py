"""The wheel, built and tried in an environment that holds what the package asks for and nothing else."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import zipfile
from importlib.metadata import distribution, packages_distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from stereolib.base import ROOT

TRY = ROOT / "tests" / "support" / "try_package.py"
# The environment borrows the packages of this one; what the wheel does not ask for is hidden.
HIDE = """
import sys
class NotInstalled:
    def find_spec(name, path=None, target=None):
        if name.partition(".")[0] in {names}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, NotInstalled)
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (built,) = folder.glob("*.whl")
    return built


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def closure(requirements: list[str]) -> set[str]:
    """Names of all distributions that some requirements bring."""
    brought: set[str] = set()
    waiting = [Requirement(text) for text in requirements]
    while waiting:
        wanted = waiting.pop()
        here = not wanted.marker or any(wanted.marker.evaluate({"extra": extra}) for extra in ("", *wanted.extras))
        if here and normal(wanted.name) not in brought:
            brought.add(normal(wanted.name))
            waiting += [Requirement(text) for text in distribution(wanted.name).requires or []]
    return brought


def test_it_holds_the_library_and_what_it_reads(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    assert {"stereolib/py.typed", "stereolib/__main__.py", "stereolib/data/paper/published.toml"} <= names
    files = {path.relative_to(ROOT).as_posix() for path in (ROOT / "stereolib").rglob("*") if path.is_file()}
    data = {f"stereolib/data/{name}" for name in ("paper/published.toml", "real/SHA256SUMS", "virtual/SHA256SUMS")}
    data.add("stereolib/data/notebooks/11_your_own_rig.ipynb")
    ours = {name for name in names if not re.match(r"stereolib-[^/]+\.dist-info/", name)}
    assert ours == data | {name for name in files if "__pycache__" not in name}  # stubs and templates too
    assert sum(entry.file_size for entry in zipfile.ZipFile(wheel).infolist()) < 2.8e6
    chapter = json.loads(zipfile.ZipFile(wheel).read("stereolib/data/notebooks/11_your_own_rig.ipynb"))
    code = [cell for cell in chapter["cells"] if cell["cell_type"] == "code"]
    assert code and not any(cell["outputs"] for cell in code)  # its report makes them anew


@pytest.mark.slow
def test_it_works_away_from_the_repository(wheel: Path, tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", tmp_path / "venv"], check=True)
    python = tmp_path / "venv" / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    install = [sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index", "--quiet", wheel]
    subprocess.run(install, check=True)
    where = [str(python), "-c", "import sysconfig; print(sysconfig.get_path('purelib'), end='')"]
    own = Path(subprocess.run(where, check=True, capture_output=True, text=True).stdout)
    (metadata,) = own.glob("stereolib-*.dist-info")
    lines = (metadata / "METADATA").read_text(encoding="utf-8").splitlines()
    asked = [line.partition(": ")[2] for line in lines if line.startswith("Requires-Dist: ")]
    brought = closure([text for text in asked if "extra ==" not in text])
    hidden = {name for name, owners in packages_distributions().items() if not brought & set(map(normal, owners))}
    (own / "hidden.py").write_text(HIDE.format(names=hidden - {"stereolib"}), encoding="utf-8")
    # As plain lines, these folders bring their packages but not the path file of this environment's stereolib.
    borrowed = dict.fromkeys(str(Path(str(distribution(name).locate_file("")))) for name in brought)
    (own / "borrowed.pth").write_text("\n".join([*borrowed, "import hidden", ""]), encoding="utf-8")
    (tmp_path / "work").mkdir()
    subprocess.run([python, "-I", TRY, tmp_path / "work"], check=True)
