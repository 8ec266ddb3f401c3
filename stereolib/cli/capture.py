"""The command ``stereolib capture``: two live cameras in, pairs of a board and a calibrated rig out."""

from __future__ import annotations

import argparse
import io
import math
import re
import sys
import time
from contextlib import redirect_stdout
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from stereolib.base import counted
from stereolib.cli.boards import add_board, board_of
from stereolib.cli.calibrate import CALIBRATE
from stereolib.cli.command import Command
from stereolib.cli.errors import DONE, REFUSED, Ended
from stereolib.cli.live_page import add_page, live_page
from stereolib.cli.ranges import MM, number
from stereolib.cli.voila import INSTALL

if TYPE_CHECKING:
    from stereolib.calibration import Board, CaptureSession, CaptureState
    from stereolib.notebook.live_link import LiveLink
    from stereolib.rig import CameraWish, LiveRig

_SAY_EVERY_S, _SAY_STUCK_S = 5.0, 20.0  # where no line can be written over, and that nothing new comes
_KEPT = "the pairs taken so far are kept: run it again and it goes on"
_HOW_TO_END = 'Ctrl-C, or "enough" on its page, ends it and calibrates with what was taken'
_NOTES = f"""a camera is a number from 0 on, a device (/dev/video2), an address (http://...), a video, or a pattern of
numbered pictures (left_%02d.png).

with a board: hold it before both cameras. A pair is taken by itself when the board is still, sharp and somewhere new,
until there are enough. Where then a part of a picture, a distance or a tilt is missing, it goes on, up to twice as many
or until nothing new comes for --patience-s. Then the rig is calibrated and judged, as stereolib calibrate does it;
earlier where a recording ends, and with Ctrl-C or the preview's button "enough", as soon as there are 5 pairs.
Without a board, pairs are taken by the button of the preview, or --every-s apart; with --no-preview at once.

the preview is a page in the browser, served to this machine alone, with a token: what is covered, what to do next, and
buttons that take a pair at once or end. It needs Voila: {INSTALL};
without it, all goes on without a page.

two webcams:  stereolib capture 0 2 --board 9x6 --square-mm 24.9x25.1 --size 640x480 --output rig
none at all:  stereolib emulate-cameras prints addresses, and the line that captures from them

what is taken is on the disk at once: OUTPUT/left/01.png, OUTPUT/right/01.png and so on. Interrupted, run it again
and it goes on. exit code: 0 done, 1 the calibration is bad, 2 wrong input or a camera that fails."""


def _configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("left", metavar="LEFT", help="the left camera (of both, seen from behind them)")
    parser.add_argument("right", metavar="RIGHT", help="the right one")
    add_board(parser, required=False)
    parser.add_argument("--output", type=Path, required=True, metavar="DIR", help="where the pairs go")
    parser.add_argument("--pairs", type=int, metavar="N", help="how many (default: 20 of a board, else 1)")
    parser.add_argument(
        "--patience-s",
        type=float,
        default=20.0,
        metavar="S",
        help="nothing new for so long: with N pairs it ends, before that it says what is missing (20)",
    )
    parser.add_argument("--every-s", type=float, metavar="S", help="between two pairs without a board")
    parser.add_argument("--max-skew-ms", type=float, default=50.0, metavar="MS", help="pairs farther apart are dropped")
    parser.add_argument("--size", metavar="640x480", help="of the pictures (default: what the cameras give)")
    parser.add_argument("--fps", type=float, metavar="N", help="pictures a second asked for")
    parser.add_argument("--code", default="MJPG", metavar="MJPG", help="format on the cable (default: MJPG)")
    for name, unit in (("exposure", "driver's units"), ("focus", "driver's units"), ("white-balance", "kelvin")):
        parser.add_argument(f"--{name}", type=float, metavar="X", help=f"fixed at this, {unit} (default: as it stands)")
    parser.add_argument("--automatic", action="store_true", help="leave exposure, focus and white balance automatic")
    add_page(parser)
    parser.add_argument(
        "--ruler-mm", type=number(1, MM), metavar="MM", help="distance of the lenses by a ruler: a check"
    )


def _run(arguments: argparse.Namespace) -> int:
    board = _board(arguments)
    pairs = arguments.pairs if arguments.pairs is not None else 20 if board else 1
    if pairs < 1:
        raise ValueError(f"--pairs must be 1 or more, got {pairs}")
    for name, value in (("--every-s", arguments.every_s), ("--patience-s", arguments.patience_s)):
        if value is not None and not 0 <= value < float("inf"):
            raise ValueError(f"{name} must be 0 or more, in seconds, got {value:g}")
    if in_the_way := [path for path in (arguments.output, *arguments.output.parents) if path.is_file()]:
        raise ValueError(f"--output must name a folder, but {in_the_way[0]} is a file")
    wish = _wish(arguments)

    from stereolib.calibration import CaptureSession
    from stereolib.notebook.capture_view import CAPTURE_BUTTONS, CAPTURE_TITLE
    from stereolib.rig import LiveRig

    rig = LiveRig(arguments.left, arguments.right, wish, max_skew_ms=arguments.max_skew_ms)
    try:
        _say_cameras(rig)
        with live_page(arguments, CAPTURE_TITLE, CAPTURE_BUTTONS) as page:
            by_hand = 0.0 if page is None else float("inf")
            waits = {"patience_s": arguments.patience_s, "every_s": by_hand}
            waits |= {} if arguments.every_s is None else {"every_s": arguments.every_s}
            session = CaptureSession(arguments.output, rig, board, pairs=pairs, **waits)
            if board is None and session.taken >= pairs:  # another thing may stand there now
                held = f"{arguments.output} holds {session.taken} of the {pairs} pairs asked for already"
                raise FileExistsError(f"{held}: choose another --output, or ask for more with --pairs")
            try:
                return _finished(arguments, session, page, _take(session, page))
            except KeyboardInterrupt as error:
                raise type(error)(_KEPT if session.taken else "no pair was taken") from error
    finally:
        rig.close()


def _finished(arguments: argparse.Namespace, session: CaptureSession, page: LiveLink | None, ended: str) -> int:
    """Calibrate, and say on the page as well what is said here."""
    session.rig.close()
    if session.watch is not None and not session.taken:
        seen = f"; {other}" if (other := session.other_board) else ", whole in both pictures, and held still?"
        ask = f"is it one of {arguments.board} inner corners{seen}"
        raise ValueError(f"no pair was taken, {ended}: no board was found that stood still in both cameras: {ask}")
    _say_pairs(session, ended)
    if session.watch is None:
        return DONE
    said = io.StringIO()
    _show_text(page, said_now := "calibrating: this takes some seconds")
    print(said_now, file=sys.stderr, flush=True)
    with redirect_stdout(said):
        code = _calibrated(arguments, session)
    print(said.getvalue(), end="")
    _show_text(page, said.getvalue() or "no calibration: the terminal says why")
    return code


def _show_text(page: LiveLink | None, text: str) -> None:
    from stereolib.notebook.live_link import LiveView

    if page is not None:
        page.show(LiveView(html=f"<pre>{escape(text)}</pre>"))


def _board(arguments: argparse.Namespace) -> Board | None:
    if (arguments.board is None) != (arguments.square_mm is None):
        raise ValueError("a board is told by both --board and --square-mm; without them every pair is taken")
    of_boards = {"--marker-mm": arguments.marker_mm, "--dictionary": arguments.dictionary}
    of_boards |= {"--legacy": arguments.legacy, "--ruler-mm": arguments.ruler_mm}
    if stray := [name for name, value in of_boards.items() if value] if arguments.board is None else []:
        raise ValueError(f"{stray[0]} is about a board: tell it by --board and --square-mm, or leave it out")
    return board_of(arguments) if arguments.board else None


def _wish(arguments: argparse.Namespace) -> CameraWish:
    from stereolib.rig import CameraWish

    size = None
    if arguments.size is not None:
        if not (found := re.fullmatch(r"(\d{1,5})[xX×](\d{1,5})", arguments.size.strip())):
            raise ValueError(f"--size is width x height in px, as 640x480; got {arguments.size!r}")
        size = int(found[1]), int(found[2])
    fixed = (arguments.exposure, arguments.focus, arguments.white_balance)
    if arguments.automatic and any(value is not None for value in fixed):
        raise ValueError("--automatic contradicts --exposure, --focus and --white-balance: leave it out, or them")
    return CameraWish(size, arguments.fps, *fixed, not arguments.automatic, arguments.code)


def _say_cameras(rig: LiveRig) -> None:
    for camera in rig.cameras:
        print(f"{camera.name}: {camera.source}, {camera.size[0]}x{camera.size[1]}", file=sys.stderr)
        for text in camera.refused:
            print(f"  not taken: {text}", file=sys.stderr)


def _take(session: CaptureSession, page: LiveLink | None) -> str:
    """Take pairs; Ctrl-C ends that too, where there are enough for a calibration. What ended it is returned."""
    from stereolib.calibration import MIN_PAIRS

    try:
        _watch(session, page)
    except Ended:
        raise
    except KeyboardInterrupt:
        if session.watch is None or session.taken < MIN_PAIRS:
            raise
        print("ended by Ctrl-C; once more, and it does not calibrate either", file=sys.stderr, flush=True)
        return "as was asked"
    return session.ended


def _watch(session: CaptureSession, page: LiveLink | None) -> None:
    """Take pairs, and say how it stands: in one line that changes, or where there is no terminal, now and then."""
    from stereolib.notebook.capture_view import draw_capture, press

    if session.taken:
        others = ", taken with left = {}, right = {}".format(*session.before) if session.before else ""
        there = f"{counted(session.taken, 'pair')} that {_are(session.taken)} there{others}"
        print(f"going on after {there}", file=sys.stderr)
    live, said, said_s, stuck_s = sys.stderr.isatty(), "", 0.0, -math.inf
    for state in session.run():
        if page is not None:
            page.show(draw_capture(session, state))
            for name in page.pressed():
                press(session, name)
        now_s = time.monotonic()
        if state.name:
            print(f"{_cleared(live)}pair {state.name} taken{_colon(state.said)}", file=sys.stderr)
        elif state.stuck and not session.rig.recorded and now_s - stuck_s > _SAY_STUCK_S:
            print(f"{_cleared(live)}{state.stuck}. {_HOW_TO_END}", file=sys.stderr, flush=True)
            stuck_s = now_s
        elif live:
            print(f"{_cleared(live)}{_line(session, state)}", end="", file=sys.stderr, flush=True)
        elif state.said != said and now_s - said_s > _SAY_EVERY_S:
            print(_line(session, state), file=sys.stderr)
            said, said_s = state.said, now_s
    print(_cleared(live), end="", file=sys.stderr)


def _are(count: int) -> str:
    return "is" if count == 1 else "are"


def _line(session: CaptureSession, state: CaptureState) -> str:
    return f"{state.taken} of {session.wanted} pairs{_colon(state.said)}"


def _colon(text: str) -> str:
    return f": {text}" if text else ""


def _cleared(live: bool) -> str:
    return f"\r{'':100}\r" if live else ""


def _say_pairs(session: CaptureSession, ended: str) -> None:
    rig = session.rig
    left, right = session.folders
    fewer = f": fewer than the {session.wanted} wanted, {ended}" if session.taken < session.wanted else ""
    print(f"{counted(session.taken, 'pair')} in {left} and {right}{fewer}")
    if not rig.recorded:
        dropped = f"; {counted(rig.dropped, 'pair')} beyond {rig.max_skew_ms:g} ms dropped" if rig.dropped else ""
        print(f"skew {rig.skew_name}: 95 % up to {rig.skew_p95_ms:.1f} ms{dropped}")
    if session.watch is not None and session.watch.coverage:
        print(f"coverage: {session.watch.coverage}")


def _calibrated(arguments: argparse.Namespace, session: CaptureSession) -> int:
    """Calibrate as ``stereolib calibrate`` does; what an earlier round of this capture wrote is replaced."""
    from stereolib.calibration import MIN_PAIRS

    if session.taken < MIN_PAIRS:
        print(f"too few for a calibration, which needs {MIN_PAIRS}: run it again and it goes on", file=sys.stderr)
        return REFUSED
    words = [*map(str, session.folders), "--board", arguments.board, "--square-mm", arguments.square_mm]
    if arguments.marker_mm is not None:
        words += ["--marker-mm", str(arguments.marker_mm)]
        words += ["--dictionary", arguments.dictionary] if arguments.dictionary else []
        words += ["--legacy"] if arguments.legacy else []
    words += ["--ruler-mm", str(arguments.ruler_mm)] if arguments.ruler_mm is not None else []
    parser = argparse.ArgumentParser()
    assert CALIBRATE.configure is not None and CALIBRATE.run is not None
    CALIBRATE.configure(parser)
    return CALIBRATE.run(parser.parse_args([*words, "--output", str(arguments.output), "--force"]))


CAPTURE = Command(
    "capture",
    "take pairs with two live cameras, of a board by themselves, and calibrate",
    "stereolib capture walk/%d_left.jpg walk/%d_right.jpg --pairs 5 --output taken --no-preview",
    _run,
    _configure,
    notes=_NOTES,
    before=("stereolib data walk walk",),
)
