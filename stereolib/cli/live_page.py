"""The page of a command that shows something live: Voila beside it, on this machine alone, with a token."""

from __future__ import annotations

import os
import secrets
import socket
import subprocess
import sys
import threading
import time
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from stereolib.cli.ranges import whole
from stereolib.cli.voila import HOST, INSTALL, free_port, has_voila, serving

if TYPE_CHECKING:
    import argparse

    from stereolib.notebook.live_link import LiveLink

_START_S, _POLL_S = 30.0, 0.1


def add_page(parser: argparse.ArgumentParser) -> None:
    """Add the options of a live page."""
    parser.add_argument("--no-preview", action="store_true", help="show nothing in the browser")
    parser.add_argument("--no-browser", action="store_true", help="print the page's address and open nothing")
    parser.add_argument(
        "--port", type=whole(0, 65535), default=0, metavar="N", help="of the page (default: a free one)"
    )


@contextmanager
def live_page(arguments: argparse.Namespace, title: str, buttons: dict[str, str]) -> Iterator[LiveLink | None]:
    """Serve the page while the block runs; None with ``--no-preview``, and where Voila is missing, which is said."""
    if arguments.no_preview:
        yield None
        return
    if not has_voila():
        print(f"no preview: it needs Voila, {INSTALL}; going on without it", file=sys.stderr)
        yield None
        return
    from stereolib.notebook.live_link import LiveLink

    link, token, port = LiveLink(title, buttons), secrets.token_hex(16), free_port(arguments.port)
    environment = dict(os.environ) | link.environment | {"JUPYTER_TOKEN": token}
    words = "--no-browser", "--Voila.log_level=ERROR"
    with serving("live.ipynb", port, environment, *words, quiet=True) as server:  # it warns of its own settings
        ending = threading.Event()
        told = f"http://{HOST}:{port}/?token={token}", port, server, ending, not arguments.no_browser
        threading.Thread(target=_announce, args=told, daemon=True, name="announce").start()
        try:
            yield link
        finally:
            ending.set()
            link.close()


def _announce(address: str, port: int, server: subprocess.Popen[bytes], ending: threading.Event, opens: bool) -> None:
    """Say the address once somebody answers there, and open it."""
    until_s = time.monotonic() + _START_S
    while time.monotonic() < until_s and server.poll() is None:
        with suppress(OSError), socket.create_connection((HOST, port), _POLL_S):
            print(f"preview: {address}", file=sys.stderr, flush=True)
            if opens:
                webbrowser.open(address)
            return
        if ending.wait(_POLL_S):
            return
    print(f"no preview: its server did not start (port {port}); going on without it", file=sys.stderr, flush=True)
