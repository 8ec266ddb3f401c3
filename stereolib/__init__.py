"""A stereo-vision and laser-ranging paper, reproduced step by step.

The modules carry the names of the paper's steps and are loaded on first use, so that ``import stereolib`` stays fast::

    import stereolib
    rig = stereolib.paper.paper_rig()
"""

from __future__ import annotations

import importlib
import pkgutil
from types import ModuleType

__version__ = "0.1.0"


def __getattr__(name: str) -> ModuleType:
    if name in _modules():
        return importlib.import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_modules()})


def _modules() -> list[str]:
    return [module.name for module in pkgutil.iter_modules(__path__)]
