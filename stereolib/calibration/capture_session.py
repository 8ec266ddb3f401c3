"""Pairs from live cameras into a folder: of a board by themselves, else one after the other; it can be resumed."""

from __future__ import annotations

import json
import math
import sys
import time
import zlib
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import cv2

from stereolib.base import UInt8, check_target, counted, listed, read_json, write_atomic
from stereolib.calibration.board_files import find_in_files
from stereolib.calibration.board_watch import NOT_SEEN, PLACE_TAKEN, BoardLook, BoardWatch
from stereolib.calibration.boards import Board, Charuco
from stereolib.calibration.first_boards import exchanged_mm, size_seen
from stereolib.rig import CameraError, LivePair, LiveRig, to_grey

_SIDES = ("left", "right")
_LONGER = "hold it a little longer, or nearer"
CAPTURE_NOTES = "capture.json"
_MOST = 2  # times the pairs asked for, as long as something is missing
_AGAIN_OF = 20  # pictures, of which half must have been sent before
_FROZEN_OF = 3  # pictures: the same ones nearer than that are a camera that hangs
_RECORDED_HZ = 10.0  # pictures a second that a recording without moments is taken for
_LEAST_OTHERS = 2  # pictures with a board of another count of corners, which chance hardly shows alike twice
_PNG_EFFORT = [cv2.IMWRITE_PNG_COMPRESSION, 1]  # fast: cameras wait meanwhile


@dataclass(frozen=True, eq=False)
class CaptureState:
    """How a capture stands after a pair.

    Attributes
    ----------
    pair : LivePair
    look : BoardLook or None
        What was seen of the board; None without one.
    taken : int
        Pairs in the folder.
    name : str
        Of the pair, if it was taken; else "".
    said : str
        One sentence: what is missing, or what to do.
    stuck : str
        Where nothing new came for a while: why, and which place is still empty; else "".
    """

    pair: LivePair
    look: BoardLook | None
    taken: int
    name: str
    said: str
    stuck: str = ""


class CaptureSession:
    """Takes pairs until there are enough; what is taken is on the disk at once.

    Parameters
    ----------
    folder : path
        Pairs go into its folders ``left`` and ``right`` as ``01.png`` and so on; ``capture.json`` has the notes. What
        is there of the same board is gone on with.
    rig : LiveRig
    board : Checkerboard or Charuco, optional
        A pair is taken when the board is still, sharp and somewhere new. Without one every pair is taken.
    pairs : int
        How many; of a board up to twice as many, as long as its coverage lacks something.
    patience_s : float
        How long nothing new may come, s: with `pairs` taken it ends then, before that it says what is missing.
    every_s : float
        Time between two pairs without a board, s; infinite: only when asked.

    Attributes
    ----------
    watch : BoardWatch or None
    taken : int
        Pairs in the folder.
    before : tuple of str
        The cameras that took those which were there, the left one first, if they were others; else empty.
    ended : str
        Why the last `run` ended before there were enough; else "".

    Raises
    ------
    ValueError
        If the folder holds other files, pictures of another size, those of another board, or pairs that were taken
        with left and right exchanged.
    """

    def __init__(
        self,
        folder: str | PathLike[str],
        rig: LiveRig,
        board: Board | None = None,
        *,
        pairs: int = 20,
        patience_s: float = 20.0,
        every_s: float = 0.0,
    ) -> None:
        if pairs < 1:
            raise ValueError(f"at least one pair must be taken, got {pairs}")
        self.folder, self.rig, self.wanted, self._every_s = Path(folder), rig, pairs, every_s
        self.watch = BoardWatch(board, rig.size) if board else None
        self._about = _described(board)
        self._is_asked, self._is_finished = False, False
        self._next_s = math.inf if math.isinf(every_s) else -math.inf
        self._now_s, self._new_s, self._patience_s = 0.0, math.nan, patience_s
        self._whys = Counter[str]()  # since then: how often nothing was taken for which reason
        self._sent, self._again = dict[int, int](), deque[bool](maxlen=_AGAIN_OF)  # checksums: when sent last
        self._looks, self.ended = 0, ""
        self._blind, self._others = 0, Counter[tuple[int, int]]()  # pairs without the board; others seen in them
        self.before: tuple[str, ...] = ()
        self.taken = self._resumed()

    @property
    def folders(self) -> tuple[Path, Path]:
        """Where the pictures of the left and of the right camera go."""
        return self.folder / _SIDES[0], self.folder / _SIDES[1]

    @property
    def other_board(self) -> str:
        """Which other checkerboard is there while none of the count asked for is seen; "" where none is."""
        (size, count), *_ = self._others.most_common(1) or [((0, 0), 0)]
        is_told = self.taken == 0 and count >= _LEAST_OTHERS
        return f"a board of {size[0]}x{size[1]} is there" if is_told else ""

    def take_now(self) -> None:
        """Take the next pair in which both see the board, still or not."""
        self._is_asked = True

    def finish(self) -> None:
        """End after the pair that is looked at."""
        self._is_finished = True

    def run(self) -> Iterator[CaptureState]:
        """Look at pairs until there are enough, or a recording ends.

        Yields
        ------
        CaptureState
            For each pair that was looked at.

        Raises
        ------
        CameraError
            If a camera falls silent; the text says what is kept.
        ValueError
            If a file cannot be written; or the first pairs of the board show that left and right are exchanged.
        """
        self._check_sides()
        if self._is_enough():
            return
        pairs, self._is_finished, self._new_s, self.ended = self.rig.pairs(), False, math.nan, ""
        while True:
            try:
                pair = next(pairs, None)
            except CameraError as error:
                kept = f"kept in {self.folder}: {counted(self.taken, 'pair')}; run it again and it goes on"
                raise CameraError(f"{error}; {kept}") from error
            if pair is None:
                self.ended = "since the recording ended"
                return
            self._now_s = self._now_s + 1 / _RECORDED_HZ if self.rig.recorded else time.monotonic()
            self._new_s = self._now_s if math.isnan(self._new_s) else self._new_s
            yield self._with_board(self.watch, pair) if self.watch else self._in_turn(pair)
            if self._is_enough():
                return
            if self._is_finished or self._plays_again(pair):
                self.ended = "as was asked" if self._is_finished else "since the same pictures come again: a recording"
                return

    def _with_board(self, watch: BoardWatch, pair: LivePair) -> CaptureState:
        look = watch.look(pair.left, pair.right, self._now_s)
        is_seen = all(corners is not None for corners in look.corners_px)
        if not is_seen and look.corners_px[0] is None:
            self._look_for_others(watch.board, pair.left)
        if look.advice and not (self._is_asked and is_seen):
            return CaptureState(pair, look, self.taken, "", look.advice, self._stuck(watch, look.advice))
        if (corners := watch.find(pair.left, pair.right)) is None:
            return CaptureState(pair, look, self.taken, "", _LONGER, self._stuck(watch, _LONGER))
        name = self._write(pair)
        watch.add(name, *corners)
        self._check_sides()
        self._is_asked = False
        coverage = watch.coverage
        advice = coverage.advice if coverage else ()
        said = f"so far, {advice[0]}" if advice else "nothing more is needed" if coverage else ""
        return CaptureState(pair, look, self.taken, name, said)

    def _look_for_others(self, board: Board, left: UInt8) -> None:
        """Look for a checkerboard of any count, which takes long: in the 1st, 2nd, 4th, 8th ... pair without ours."""
        self._blind += 1
        if self.taken or isinstance(board, Charuco) or self._blind & (self._blind - 1):
            return
        if (size := size_seen(to_grey(left))) and sorted(size) != sorted((board.columns, board.rows)):
            self._others[size] += 1

    def _stuck(self, watch: BoardWatch, advice: str) -> str:
        """Why nothing new has come for too long, and what to do."""
        self._whys[advice.partition(";")[0]] += 1
        if not (waited_s := self._now_s - self._new_s) > self._patience_s:
            return ""
        why = self._whys.most_common(1)[0][0]
        if self._whys[PLACE_TAKEN]:
            why = f"still empty: {watch.empty}"
        elif why == NOT_SEEN:
            corners = f"{watch.board.columns}x{watch.board.rows} inner corners"
            remedy = self.other_board or "hold it whole and flat, in good light"
            why = f"no board of {corners} is seen: count corners, not squares; {remedy}"
        return f"nothing new for {waited_s:.0f} s, {self.taken} of {counted(self.wanted, 'pair')} taken; {why}"

    def _plays_again(self, pair: LivePair) -> bool:
        """Whether nothing new can come: what is sent was sent before, bit by bit, which no sensor does."""
        if self.watch is None:
            return False
        self._looks, key = self._looks + 1, zlib.crc32(pair.left.tobytes())
        self._again.append(self._looks - self._sent.get(key, self._looks) > _FROZEN_OF)
        self._sent[key] = self._looks
        is_late = self._now_s - self._new_s > self._patience_s
        return is_late and len(self._again) == _AGAIN_OF and sum(self._again) > _AGAIN_OF / 2

    def _in_turn(self, pair: LivePair) -> CaptureState:
        if (wait_s := self._next_s - self._now_s) > 0 and not self._is_asked:
            said = "" if math.isinf(wait_s) else f"the next pair in {wait_s:.0f} s"
            return CaptureState(pair, None, self.taken, "", said)
        self._next_s, self._is_asked = self._now_s + self._every_s, False
        return CaptureState(pair, None, self.taken, self._write(pair), "")

    def _is_enough(self) -> bool:
        if self.watch is None or self.taken < self.wanted:
            return self.taken >= self.wanted
        if self.taken >= _MOST * self.wanted or self._now_s - self._new_s > self._patience_s:
            return True
        return (coverage := self.watch.coverage) is None or not coverage.advice

    def _check_sides(self) -> None:
        """Refuse cameras of which the first pairs of the board show that left and right are exchanged."""
        if self.watch is None or math.isnan(off_mm := exchanged_mm(self.watch.views)):
            return
        (left, right), folders = self._sources, self.folders
        self._note(is_exchanged=True)
        raise ValueError(
            f"left and right are exchanged: by {counted(self.taken, 'pair')} of the board, {left} stands some "
            f"{off_mm:.0f} mm to the right of {right} (or both hang upside down, or mirror). Name {right} first, and "
            f"another folder than {self.folder}; or let {folders[0]} and {folders[1]} change names, and it goes on"
        )

    def _write(self, pair: LivePair) -> str:
        """Write a pair under the first number that one of both sides lacks."""
        number = 1
        while all((folder / _file(number)).is_file() for folder in self.folders):
            number += 1
        if not (self.folder / CAPTURE_NOTES).is_file():
            self._note()  # first, so that whatever is there says what it is of
        for folder, picture in zip(self.folders, (pair.left, pair.right), strict=True):
            write_atomic(folder / _file(number), _png(picture))
        self.taken, self._new_s, self._whys = self.taken + 1, self._now_s, Counter()
        self._note()
        return Path(_file(number)).stem

    @property
    def _sources(self) -> tuple[str, ...]:
        return tuple(camera.source for camera in self.rig.cameras)

    def _note(self, *, is_exchanged: bool = False) -> None:
        rig = self.rig
        p95, rates = rig.skew_p95_ms, rig.rates_hz
        notes: dict[str, Any] = {
            "board": self._about,
            "size": list(rig.size),
            "sources": list(self._sources),
            "exchanged": is_exchanged,
            "refused": [list(camera.refused) for camera in rig.cameras],
            "pairs": self.taken,
            "skew": rig.skew_name,
            "skew_p95_ms": None if math.isnan(p95) else round(p95, 1),
            "dropped_for_skew": rig.dropped,
            "rates_hz": [None if math.isnan(rate) else round(rate, 1) for rate in rates],
        }
        write_atomic(self.folder / CAPTURE_NOTES, json.dumps(notes, indent=1) + "\n")

    def _resumed(self) -> int:
        """Pairs that are there already, given to the watch; refuses what is not of this capture."""
        self._check_folder()
        numbers = [{path.name for path in folder.glob("*.png")} for folder in self.folders]
        names = sorted(numbers[0] & numbers[1])
        if not names:
            return 0
        notes = read_json(self.folder / CAPTURE_NOTES)
        if not isinstance(notes, dict) or (notes.get("board"), notes.get("size")) != (self._about, list(self.rig.size)):
            raise ValueError(
                f"{self.folder} holds {counted(len(names), 'pair')} of another board or size "
                f"({self.folder / CAPTURE_NOTES} says which): name another folder, or give the same ones"
            )
        if self.watch:
            left, right = ([folder / name for name in names] for folder in self.folders)
            views = find_in_files(left, right, self.watch.board, progress=sys.stderr.isatty())
            for name, left_px, right_px in zip(views.names, views.left_px, views.right_px, strict=True):
                self.watch.add(Path(name).stem, left_px, right_px)
        self._check_sources(notes, len(names))
        return len(names)

    def _check_sources(self, notes: dict[str, Any], count: int) -> None:
        """Refuse to go on after pairs that were taken the other way round, unless their folders have changed names."""
        before, now = self._noted_sources(notes), self._sources
        if before == now:
            return
        self.before = before
        shows_exchanged = self.watch is not None and not math.isnan(exchanged_mm(self.watch.views))
        is_renamed = self.watch is not None and notes.get("exchanged", False)
        if shows_exchanged or (before == now[::-1] and not is_renamed):
            ways = "left = {}, right = {}; now it is left = {}, right = {}".format(*before, *now)
            which = f"the {counted(count, 'pair')} in {self.folder} {'was' if count == 1 else 'were'} taken with {ways}"
            raise ValueError(f"{which}: give another folder, or delete {'it' if count == 1 else 'them'}")

    def _noted_sources(self, notes: dict[str, Any]) -> tuple[str, ...]:
        names = notes.get("sources", list(self._sources))
        if not (isinstance(names, list) and len(names) == 2 and all(isinstance(name, str) for name in names)):
            raise ValueError(
                f"{self.folder / CAPTURE_NOTES}: two names of cameras are expected as sources, got {names!r}: "
                f"mend it there, or name another folder"
            )
        return tuple(names)

    def _check_folder(self) -> None:
        for folder in self.folders:
            there = [path.name for path in folder.iterdir() if path.name[0] != "."] if folder.is_dir() else []
            if others := sorted(name for name in there if not (Path(name).stem.isdecimal() and name.endswith(".png"))):
                raise ValueError(f"{folder} holds files of something else ({listed(others, 3)}): name another folder")
            check_target(folder / _file(1))
        is_begun = any(any(folder.glob("*.png")) for folder in self.folders)
        if is_begun and not (self.folder / CAPTURE_NOTES).is_file():
            raise ValueError(f"{self.folder} holds pictures, but no {CAPTURE_NOTES}: name another folder")


def _file(number: int) -> str:
    return f"{number:02d}.png"


def _png(picture: UInt8) -> bytes:
    return cv2.imencode(".png", picture, _PNG_EFFORT)[1].tobytes()


def _described(board: Board | None) -> dict[str, Any] | None:
    """All that makes a board what it is, ready for JSON."""
    if board is None:
        return None
    return {"kind": "charuco" if isinstance(board, Charuco) else "checkerboard"} | asdict(board)
