"""A board before live cameras: where it is, whether it is still, sharp and somewhere new, and what to do next."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.base import Float32, Float64, UInt8
from stereolib.calibration.board_poses import board_poses
from stereolib.calibration.board_views import BoardViews, match_order
from stereolib.calibration.boards import Board, Charuco
from stereolib.calibration.coverage import Coverage, judge_coverage
from stereolib.calibration.find_boards import find_board, find_charuco
from stereolib.calibration.first_boards import guessed_camera
from stereolib.rig import to_grey

_QUICK_PX = 640  # wider pictures are searched in reduced size while the board moves
_STILL = 0.015  # picture widths a second: 0.3 px within 30 ms in pictures 640 px wide
_SHARP_PX, _SHARP_SHARE = 4.0, 0.006  # edges between squares: at most so wide, or such a share of the picture
_UNKNOWN_EDGE = 1000.0  # OpenCV's answer where no edge could be followed is above
_NEW_PLACE, _NEW_DISTANCE, _NEW_TILT_RAD = 0.08, 0.1, np.radians(6.0)  # picture widths, share, and angle
NOT_SEEN, PLACE_TAKEN = "show the board to both cameras", "this place is taken"
_SIDES = ("left", "right")
_PARTS = {(row, column): f"{upright} {across}".replace("middle centre", "centre")
          for row, upright in enumerate(("upper", "middle", "lower"))
          for column, across in enumerate(("left", "centre", "right"))}  # fmt: skip
_TILTED_RAD = np.radians(10.0)
_NEARER = ("right", "lower", "left", "upper")  # side of a board whose normal points to the right, down, left, up


@dataclass(frozen=True, eq=False)
class BoardLook:
    """What a glance at both pictures tells of the board.

    Attributes
    ----------
    corners_px : (left, right)
        Each (corners, 2) float32, px, or None where the board was not found.
    speed : float
        Of the board in the pictures, in widths of a picture a second; NaN at a camera's first sight of it.
    edge_px : (left, right)
        Width of the edges between its squares, px; NaN where not known.
    place : (5,) float64 or None
        Where it is, as `BoardWatch.places` has it; None where the left camera does not see it.
    advice : str
        What to do so that the pair can be taken; "" if it can.
    """

    corners_px: tuple[Float32 | None, Float32 | None]
    speed: float
    edge_px: tuple[float, float]
    place: Float64 | None
    advice: str


class BoardWatch:
    """Judges live pairs of a board, and remembers those that were taken.

    Parameters
    ----------
    board : Checkerboard or Charuco
    size : (width, height), px
        Of the pictures.

    Examples
    --------
    >>> from stereolib.calibration import Checkerboard
    >>> watch, grey = BoardWatch(Checkerboard(9, 6, 25.0), (320, 240)), np.full((240, 320), 128, np.uint8)
    >>> watch.look(grey, grey, 0.0).advice
    'show the board to both cameras'
    """

    def __init__(self, board: Board, size: tuple[int, int]) -> None:
        self.board, self.size = board, size
        self._names, self._corners = list[str](), list[tuple[Float32, Float32]]()
        self._poses = list[Float64]()
        self._before: tuple[float, tuple[Float32 | None, Float32 | None]] = (math.nan, (None, None))
        self._camera = guessed_camera(size)

    @property
    def views(self) -> BoardViews:
        """The pairs taken so far."""
        count = self.board.columns * self.board.rows
        left, right = (
            np.array([corners[k] for corners in self._corners], np.float32).reshape(-1, count, 2) for k in (0, 1)
        )
        return BoardViews(self.board, self.size, left, right, tuple(self._names), ())

    @property
    def places(self) -> Float64:
        """Of each pair taken, (n, 5): column and row of the board in picture widths, log of its distance (mm), and
        the angles of its tilt about the vertical and the horizontal axis (rad). Distance and tilt are estimates, for a
        lens of 58 degrees."""
        return np.array(self._poses).reshape(-1, 5)

    @property
    def coverage(self) -> Coverage | None:
        """What the pairs taken cover, by the lens that is guessed; None before the second."""
        if len(self._names) < 2:
            return None
        views = self.views
        return judge_coverage(views, *board_poses(self.board.points_mm, views.left_px, self._camera))

    @property
    def empty(self) -> str:
        """Where no board taken is, and how to hold it; where all of that is covered, which part has the fewest."""
        coverage = self.coverage
        if coverage is not None and coverage.advice:
            return "; ".join(coverage.advice)
        places = self.places
        thirds = np.clip(np.floor(3 * places[:, :2] / np.array([1, self.size[1] / self.size[0]])).astype(int), 0, 2)
        at = [((thirds == [column, row]).all(axis=1).sum(), name) for (row, column), name in _PARTS.items()]
        turned = [(tilt >= _TILTED_RAD).sum() for tilt in (*places[:, 3:].T, *-places[:, 3:].T)]
        _, part = min(at, key=lambda each: each[0])
        return f"hold it in the {part}, its {_NEARER[int(np.argmin(turned))]} side nearer: fewest boards were so"

    def look(self, left: UInt8, right: UInt8, at_s: float) -> BoardLook:
        """Judge a pair, quickly.

        Parameters
        ----------
        left, right : (H, W) or (H, W, 3) uint8
        at_s : float
            When it was taken, s.

        Returns
        -------
        BoardLook
        """
        with ThreadPoolExecutor(2) as both:
            found = list(both.map(self._quick, (left, right)))
        corners = found[0], found[1]
        then_s, before = self._before
        moved = [self._moved(now, earlier) for now, earlier in zip(corners, before, strict=True)]
        passed_s = at_s - then_s
        speed = float(np.max(moved)) / passed_s if passed_s > 0 else math.nan  # NaN if one of both is
        self._before = at_s, corners
        edges = self._edge_px(left, corners[0]), self._edge_px(right, corners[1])
        place = None if corners[0] is None else self._place(corners[0])
        return BoardLook(corners, speed, edges, place, self._advice(corners, speed, edges))

    def find(self, left: UInt8, right: UInt8) -> tuple[Float32, Float32] | None:
        """Find the board in both pictures as a calibration does.

        Parameters
        ----------
        left, right : (H, W) or (H, W, 3) uint8

        Returns
        -------
        (left, right) or None
            Each (corners, 2) float32, px.
        """
        with ThreadPoolExecutor(2) as both:
            a, b = both.map(find_board, (left, right), (self.board, self.board))
        if a is None or b is None:
            return None
        return a, (b if isinstance(self.board, Charuco) else match_order(a, b))

    def add(self, name: str, left_px: Float32, right_px: Float32) -> None:
        """Remember a pair that was taken.

        Parameters
        ----------
        name : str
        left_px, right_px : (corners, 2) float32, px

        Raises
        ------
        ValueError
            As `BoardViews`.
        """
        BoardViews(self.board, self.size, left_px[None], right_px[None], (name,), ())  # or it would spoil all others
        self._names.append(name)
        self._corners.append((left_px, right_px))
        self._poses.append(self._place(left_px))

    def _quick(self, image: UInt8) -> Float32 | None:
        grey = to_grey(image)
        factor = -(-grey.shape[1] // _QUICK_PX)
        small = cv2.resize(grey, None, fx=1 / factor, fy=1 / factor, interpolation=cv2.INTER_AREA)
        if isinstance(self.board, Charuco):
            corners = find_charuco(small, self.board)
        else:
            inner = self.board.columns, self.board.rows
            is_found, found = cv2.findChessboardCornersSB(small, inner, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
            corners = found.reshape(-1, 2) if is_found else None
        return None if corners is None else np.asarray(corners * factor + (factor - 1) / 2, np.float32)

    def _moved(self, now: Float32 | None, before: Float32 | None) -> float:
        """How far the corners moved, in picture widths; NaN if one of both is not known."""
        if now is None or before is None:
            return math.nan
        shift = np.linalg.norm(match_order(now, before) - now, axis=1)
        return float(np.nanmedian(shift)) / self.size[0] if np.isfinite(shift).any() else math.nan

    def _edge_px(self, image: UInt8, corners: Float32 | None) -> float:
        """Width of the edges between the squares; a ChArUco's markers would be taken for edges."""
        if corners is None or isinstance(self.board, Charuco):
            return math.nan
        inner = self.board.columns, self.board.rows
        edge_px = float(cv2.estimateChessboardSharpness(to_grey(image), inner, corners.reshape(-1, 1, 2))[0][0])
        return edge_px if edge_px < _UNKNOWN_EDGE else math.nan

    def _place(self, left_px: Float32) -> Float64:
        (turn,), (shift,) = board_poses(self.board.points_mm, left_px[None], self._camera)
        normal = turn[:, 2] * np.sign(turn[2, 2])
        centre = np.nanmean(left_px, axis=0) / self.size[0]
        away = np.log(max((shift + turn @ self.board.points_mm.mean(axis=0))[2], 1.0))
        return np.array([*centre, away, *np.arctan2(normal[:2], normal[2])])

    def _is_new(self, left_px: Float32) -> bool:
        steps = np.array([_NEW_PLACE, _NEW_PLACE, _NEW_DISTANCE, _NEW_TILT_RAD, _NEW_TILT_RAD])
        apart = np.abs(self.places - self._place(left_px)) / steps
        return bool((apart.max(axis=1, initial=0.0) >= 1).all())

    def _advice(self, corners: tuple[Float32 | None, Float32 | None], speed: float, edges: tuple[float, float]) -> str:
        if (left := corners[0]) is None or corners[1] is None:
            unseen = [side for side, found in zip(_SIDES, corners, strict=True) if found is None]
            return NOT_SEEN if len(unseen) == 2 else f"the {unseen[0]} camera does not see it"
        if not speed <= _STILL:
            return "hold it still"
        limit_px = max(_SHARP_PX, _SHARP_SHARE * self.size[0])
        blurred = [side for side, edge in zip(_SIDES, edges, strict=True) if edge > limit_px]
        if blurred:
            return f"blurred in the {' and '.join(blurred)} picture: more light, or set the focus"
        if not self._is_new(left):
            return f"{PLACE_TAKEN}; {_next(self.coverage)}"
        return ""


def _next(coverage: Coverage | None) -> str:
    advice = coverage.advice if coverage else ()
    return f"so far, {advice[0]}" if advice else "move it, tilt it, or take it nearer or farther"
