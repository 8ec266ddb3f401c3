"""The environment of a notebook's kernel: one thread, one hash seed, and the same arithmetic on every processor."""

from __future__ import annotations

import os
import platform
from pathlib import Path

#: Environment variables that keep numpy and its like to one thread each, which also fixes the order of every sum: for
#: processes that run beside each other, or have threads of their own.
ONE_THREAD = {
    f"{library}_THREADS": "1" for library in ("OMP_NUM", "OPENBLAS_NUM", "MKL_NUM", "VECLIB_MAXIMUM", "NUMEXPR_NUM")
}
#: The kernels of OpenBLAS (numpy's, scipy's and the older one in OpenCV's wheel) that every processor with AVX2 has.
_BLAS_KERNELS = "Haswell"
_CV_CPU_AVX2 = 11  # OpenCV's number of it, for which Python has no name
_BEYOND_AVX2 = ("X86_V4", "AVX512")  # how the names of numpy's wider kernels begin
#: The user's variables that would change what a kernel computes, draws or says.
_CLEARED = ("MPLBACKEND", "MATPLOTLIBRC", "OPENCV_IPP", "PYTHONWARNINGS", "PYTHONIOENCODING", "PYTHONSTARTUP")


def _one_processor() -> dict[str, str]:
    """Variables that let every x86-64 processor with AVX2 add up in the same order.

    What a processor lacks must not be switched off, as numpy warns of it, nor its kernels asked for: they would crash.
    """
    import cv2
    import numpy as np

    if platform.machine().lower() not in ("x86_64", "amd64") or not cv2.checkHardwareSupport(_CV_CPU_AVX2):
        return {}
    supported = np.show_config(mode="dicts")["SIMD Extensions"].get("found", ())
    wide = [name for name in supported if name.startswith(_BEYOND_AVX2)]
    return {"OPENBLAS_CORETYPE": _BLAS_KERNELS} | ({"NPY_DISABLE_CPU_FEATURES": " ".join(wide)} if wide else {})


def kernel_environment(figures_dir: str | os.PathLike[str]) -> dict[str, str]:
    """Environment variables of a kernel that draws into ``figures_dir``.

    Parameters
    ----------
    figures_dir : path
        Becomes ``STEREOLIB_FIGURES``.

    Returns
    -------
    dict
        This process's variables with one thread per kernel, a fixed hash seed, UTF-8, no settings of the user's, and on
        x86-64 the arithmetic of a processor with AVX2, unless the user chose another (``OPENBLAS_CORETYPE``,
        ``NPY_DISABLE_CPU_FEATURES``).
    """
    user = {name: value for name, value in os.environ.items() if name not in _CLEARED}
    return (
        _one_processor()
        | user
        | ONE_THREAD
        | {
            "STEREOLIB_FIGURES": str(Path(figures_dir).resolve()),
            "PYTHONHASHSEED": "0",
            "PYTHONUTF8": "1",
            "OPENCV_FOR_THREADS_NUM": "1",  # its calibration adds up in the order in which threads come
            "PYDEVD_DISABLE_FILE_VALIDATION": "1",
        }
    )
