"""A notebook of the package as a page: Voila on this machine alone, with a token, for as long as its command lives."""

from __future__ import annotations

import importlib.util
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib.resources import files

HOST = "127.0.0.1"
#: What brings Voila.
INSTALL = "pip install '.[notebooks,explore]' in the project's folder (make explore does it, too)"
_STRANGERS = ["@jupyter-notebook/lab-extension"]  # it needs parts that Voila has not
_END_S = 5.0  # to end its kernels


def has_voila() -> bool:
    """Whether the extra "explore" is installed."""
    return importlib.util.find_spec("voila") is not None


def voila_command(page: str, port: int) -> list[str]:
    """The words that serve one of the package's notebooks; without ``--no-browser`` it is opened as well."""
    options = ["--template=stereolib", "--token", f"--Voila.ip={HOST}", f"--port={port}"]
    options.append("--Voila.port_retries=0")  # else another one, and who listens here is shown the token
    options.append(f"--VoilaConfiguration.extension_denylist={_STRANGERS}")
    return [sys.executable, "-m", "stereolib.cli.voila", str(files("stereolib.notebook") / page), *options]


def voila_environment(more: Mapping[str, str]) -> dict[str, str]:
    """The environment for it: Voila looks for templates below ``voila/templates`` of the folders of JUPYTER_PATH."""
    environment = dict(more)
    paths = [str(files("stereolib.notebook")), environment.get("JUPYTER_PATH", "")]
    return environment | {"JUPYTER_PATH": os.pathsep.join(filter(None, paths))}


def free_port(asked: int) -> int:
    """A port of this machine that nobody listens on: the one that was asked for, or, for 0, any."""
    try:
        with socket.create_server((HOST, asked)) as found:
            return int(found.getsockname()[1])
    except OSError as error:
        why = os.strerror(error.errno or 0)
        raise ValueError(f"--port {asked} cannot be served: {why}; name another, or leave it out") from None


@contextmanager
def serving(
    page: str, port: int, environment: Mapping[str, str], *words: str, quiet: bool = False
) -> Iterator[subprocess.Popen[bytes]]:
    """Serve a page while the block runs.

    The server is of its own group, as Ctrl-C in the terminal is for the command that started it. It ends with that
    one however that ends, killed too: it holds the one end of a pipe, and the other closes then.
    """
    silence = subprocess.DEVNULL if quiet else None
    server = subprocess.Popen(
        [*voila_command(page, port), *words],
        env=voila_environment(environment),
        stdin=subprocess.PIPE,
        stdout=silence,
        stderr=silence,
        start_new_session=True,
    )
    try:
        yield server
    finally:
        server.terminate()
        with suppress(subprocess.TimeoutExpired):
            server.wait(_END_S)
        if server.poll() is None:
            server.kill()
        assert server.stdin is not None
        server.stdin.close()


def _end_with_parent() -> None:
    with suppress(OSError):
        while os.read(0, 1):
            pass
    os.kill(os.getpid(), signal.SIGTERM)  # upon which Voila ends its kernels


def main() -> None:
    """Be the server, until the command that started it has gone."""
    threading.Thread(target=_end_with_parent, daemon=True, name="parent").start()
    from voila.app import main as serve

    serve()


if __name__ == "__main__":
    main()
