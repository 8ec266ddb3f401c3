"""The environment that notebooks' kernels get."""

from __future__ import annotations

import platform
import subprocess
import sys
from pathlib import Path

import pytest

from stereolib.reproduction.kernels import kernel_environment


def test_kernels_add_up_as_every_processor_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On x86-64 with AVX2, wider kernels are off; what the user set stays; nothing is printed by what is set."""
    import cv2
    import numpy as np

    for name in ("OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES"):
        monkeypatch.delenv(name, raising=False)
    pinned = kernel_environment(tmp_path)
    if platform.machine().lower() in ("x86_64", "amd64") and cv2.checkHardwareSupport(11):  # AVX2
        assert pinned["OPENBLAS_CORETYPE"] == "Haswell"
        supported = np.show_config(mode="dicts")["SIMD Extensions"].get("found", ())
        wide = {name for name in supported if name.startswith(("X86_V4", "AVX512"))}
        assert set(pinned.get("NPY_DISABLE_CPU_FEATURES", "").split()) == wide
    else:
        assert not {"OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES"} & pinned.keys()
    command = [sys.executable, "-W", "error", "-c", "import numpy, cv2; numpy.eye(3) @ numpy.eye(3)"]
    done = subprocess.run(command, env=pinned, capture_output=True, text=True, check=True)
    assert done.stdout == done.stderr == ""
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Sandybridge")
    monkeypatch.setenv("NPY_DISABLE_CPU_FEATURES", "")
    own = kernel_environment(tmp_path)
    assert (own["OPENBLAS_CORETYPE"], own["NPY_DISABLE_CPU_FEATURES"]) == ("Sandybridge", "")
