"""Hold the notebooks to what they show: run them with nbval, then compare the tables that they wrote.

``make test`` runs this file. The committed figures stay as they are: the kernels write into a temporary folder.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from stereolib.base import datasets
from stereolib.reproduction import build_report, compare_tables
from stereolib.reproduction.execution import CELL_TIMEOUT_S, INDEX
from stereolib.reproduction.kernels import kernel_environment
from stereolib.reproduction.regenerate import find_notebooks

OUTER_TIMEOUT_S = 1200.0  # a slow machine with two cores, busy with other tests, takes half of it


def run_nbval(paths: list[Path], figures_dir: Path) -> int:
    """Compare the checked cells of some notebooks; a stalled run is killed and tried once more."""
    # xdist's workers and nbval's own deprecated calls warn: the notebooks are asked here, not their runner.
    options = ["-q", "-W", "default", "-p", "no:cacheprovider", "--timeout=0"]
    options += ["-n", "2", "--dist", "loadfile"] if len(paths) > 1 else []
    options += ["--nbval-lax", "--nbval-current-env", "--nbval-sanitize-with", "nbval.cfg"]
    options += [f"--nbval-cell-timeout={CELL_TIMEOUT_S:.0f}"]
    command = [sys.executable, "-m", "pytest", *options, *map(str, paths)]
    for attempt in (1, 2):
        try:
            return subprocess.run(
                command,
                cwd=datasets.ROOT,
                env=kernel_environment(figures_dir),
                timeout=OUTER_TIMEOUT_S,
            ).returncode
        except subprocess.TimeoutExpired:
            print(f"notebooks stalled for {OUTER_TIMEOUT_S:.0f} s, attempt {attempt} of 2", file=sys.stderr)
    return 1


def main() -> int:
    paths = [path.relative_to(datasets.ROOT) for path in find_notebooks(datasets.ROOT / "notebooks")]
    with tempfile.TemporaryDirectory() as folder:
        figures_dir = Path(folder) / "figures"
        figures_dir.mkdir()
        code = run_nbval([path for path in paths if path.stem != INDEX], figures_dir)
        code |= run_nbval([path for path in paths if path.stem == INDEX], figures_dir)
        if code:
            return code
        build_report(figures_dir)
        changed = compare_tables(datasets.ROOT / "figures", figures_dir)
    print(*changed, sep="\n", end="\n" if changed else "")
    print(f"figures/: {len(changed)} committed numbers changed beyond the repeat tolerance")
    return 1 if changed else 0


if __name__ == "__main__":
    sys.exit(main())
