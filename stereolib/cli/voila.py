"""A notebook of the package as a page: Voila on this machine alone, with a token."""

from __future__ import annotations

import importlib.util
import os
import socket
import sys
from collections.abc import Mapping
from importlib.resources import files

HOST = "127.0.0.1"
_STRANGERS = ["@jupyter-notebook/lab-extension"]  # it needs parts that Voila has not


def has_voila() -> bool:
    """Whether the extra "explore" is installed."""
    return importlib.util.find_spec("voila") is not None


def voila_command(page: str, port: int) -> list[str]:
    """The words that serve one of the package's notebooks; without ``--no-browser`` it is opened as well."""
    options = ["--template=stereolib", "--token", f"--Voila.ip={HOST}", f"--port={port}"]
    options.append(f"--VoilaConfiguration.extension_denylist={_STRANGERS}")
    return [sys.executable, "-m", "voila", str(files("stereolib.notebook") / page), *options]


def voila_environment(more: Mapping[str, str]) -> dict[str, str]:
    """The environment for it: Voila looks for templates below ``voila/templates`` of the folders of JUPYTER_PATH."""
    environment = dict(more)
    paths = [str(files("stereolib.notebook")), environment.get("JUPYTER_PATH", "")]
    return environment | {"JUPYTER_PATH": os.pathsep.join(filter(None, paths))}


def free_port() -> int:
    """A port of this machine that nobody listens on."""
    with socket.socket() as asked:
        asked.bind((HOST, 0))
        return int(asked.getsockname()[1])
