"""A calibration board to print: vectors, true to scale, with a bar to check the printer and what to do on the sheet."""

from __future__ import annotations

import io
from collections.abc import Iterator

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from stereolib.calibration import Board, Charuco, Checkerboard
from stereolib.plotting.style import default_style

#: Sheets, the longer side first, mm.
PAPERS_MM = {"a4": (297.0, 210.0), "letter": (279.4, 215.9), "a3": (420.0, 297.0)}
BAR_MM = 100.0
_MARGIN_MM, _FOOT_MM = 10.0, 24.0  # which no printer reaches; what the bar and the text take
_INCH_MM, _POINTS = 25.4, 7.5
_TICK_MM = 0.2
_OVERLAP_MM = 0.005  # by which neighbouring parts of a marker overlap, so that no viewer shows a seam


def largest_square_mm(columns: int, rows: int, paper: str = "a4") -> float:
    """Tell the largest square that fits a sheet.

    Parameters
    ----------
    columns, rows : int
        Inner corners of the board.
    paper : str
        A name of `PAPERS_MM`.

    Returns
    -------
    float
        Edge in whole mm.

    Raises
    ------
    ValueError
        If not even one of 1 mm fits, or there is no such paper.

    Examples
    --------
    >>> largest_square_mm(9, 6)
    23.0
    """
    width, height = _sheet_mm(columns, rows, paper)
    room = width - 2 * _MARGIN_MM, height - 2 * _MARGIN_MM - _FOOT_MM
    edge = float(np.floor(min(room[0] / (columns + 1), room[1] / (rows + 1))))
    if edge < 1:
        raise ValueError(f"{columns}x{rows} inner corners: not even squares of 1 mm fit {paper}")
    return edge


@default_style
def board_sheet(board: Board, paper: str = "a4") -> bytes:
    """Draw a board onto a sheet.

    Parameters
    ----------
    board : Checkerboard or Charuco
    paper : str
        A name of `PAPERS_MM`; it lies with its longer side along the board's.

    Returns
    -------
    bytes
        A PDF of one page, the same from the same board.

    Raises
    ------
    ValueError
        If the board does not fit, or its squares are not as high as wide.
    """
    if isinstance(board, Checkerboard) and board.aspect != 1:
        raise ValueError(f"a board is printed with squares as high as wide, got {board.aspect:g} times as high")
    most = largest_square_mm(board.columns, board.rows, paper)
    if board.square_mm > most:
        size = f"{board.columns}x{board.rows} inner corners"
        raise ValueError(f"{size} with squares of {board.square_mm:g} mm do not fit {paper}: {most:g} mm do")
    width, height = _sheet_mm(board.columns, board.rows, paper)
    figure = Figure(figsize=(width / _INCH_MM, height / _INCH_MM))
    ax = figure.add_axes((0, 0, 1, 1), xlim=(0, width), ylim=(height, 0))
    ax.axis("off")
    across, down = (board.columns + 1) * board.square_mm, (board.rows + 1) * board.square_mm
    corner = np.array([(width - across) / 2, (height - _FOOT_MM - down) / 2])
    ax.add_collection(PolyCollection([corner + part for part in _black_mm(board)], facecolors="k", linewidths=0))
    _add_foot(ax, board, width, height)
    stream = io.BytesIO()
    figure.savefig(stream, format="pdf", metadata={"CreationDate": None, "Creator": None, "Producer": None})
    return stream.getvalue()


def board_words(board: Board) -> str:
    """Say what a board is as the commands want to be told.

    Parameters
    ----------
    board : Checkerboard or Charuco

    Returns
    -------
    str

    Examples
    --------
    >>> board_words(Charuco(9, 6, 24, 17.5))
    '--board 9x6 --square-mm 24 --marker-mm 17.5'
    """
    words = f"--board {board.columns}x{board.rows} --square-mm {board.square_mm:g}"
    if isinstance(board, Charuco):
        words += f" --marker-mm {board.marker_mm:g}"
        words += f" --dictionary {board.dictionary}" if board.dictionary != Charuco.dictionary else ""
        words += " --legacy" if board.legacy else ""
    return words


def measures(board: Board) -> str:
    """Say how large a whole board is to be, by a ruler.

    Parameters
    ----------
    board : Checkerboard or Charuco

    Returns
    -------
    str

    Examples
    --------
    >>> measures(Checkerboard(9, 6, 23))
    '10 squares across are 230 mm, 7 squares down 161 mm'
    """
    across, down = board.columns + 1, board.rows + 1
    edge = board.square_mm
    return f"{across} squares across are {across * edge:g} mm, {down} squares down {down * edge:g} mm"


def _sheet_mm(columns: int, rows: int, paper: str) -> tuple[float, float]:
    if paper not in PAPERS_MM:
        raise ValueError(f"unknown paper {paper!r}; choose one of {', '.join(PAPERS_MM)}")
    longer, shorter = PAPERS_MM[paper]
    return (longer, shorter) if columns >= rows else (shorter, longer)


def _black_mm(board: Board) -> Iterator[np.ndarray]:
    """Corners of what is black, from the upper left corner of the board: (4, 2) each, mm."""
    white = set()
    if isinstance(board, Charuco):
        printed = board.printed
        dictionary = printed.getDictionary()
        parts = dictionary.markerSize + 2  # with its black rim
        for number, place in zip(printed.getIds().ravel(), printed.getObjPoints(), strict=True):
            left, top = np.min(place, axis=0)[:2]
            white.add((int(top // board.square_mm), int(left // board.square_mm)))
            bits = cv2.aruco.generateImageMarker(dictionary, int(number), parts)
            step = board.marker_mm / parts
            for v, u in np.argwhere(bits == 0):
                yield _square(left + u * step, top + v * step, step, _OVERLAP_MM)
    for row in range(board.rows + 1):
        for column in range(board.columns + 1):
            if (row, column) not in white if white else (row + column) % 2 == 0:
                yield _square(column * board.square_mm, row * board.square_mm, board.square_mm)


def _square(left: float, top: float, edge: float, more: float = 0.0) -> np.ndarray:
    low, high = np.array([left, top]) - more, np.array([left, top]) + edge + more
    return np.array([low, (high[0], low[1]), high, (low[0], high[1])])


def _add_foot(ax: Axes, board: Board, width: float, height: float) -> None:
    """The bar, and what to do."""
    top, left = height - _MARGIN_MM - _FOOT_MM + 6, _MARGIN_MM + 2
    ax.add_collection(
        PolyCollection([part + np.array([left, top]) for part in _bar_mm()], facecolors="k", linewidths=0)
    )
    ax.text(left, top + 2, f"{BAR_MM:g} mm from end to end: measure it", size=_POINTS, va="top")
    size = f"{board.columns}x{board.rows}"
    counts, others = (board.columns + 1, board.rows + 1), (board.square_mm - 0.1, board.square_mm + 0.1)
    what = " (width x height)" if isinstance(board, Checkerboard) else ", the mean of both,"
    given = "x".join(f"{edge:g}" for edge in others[: 2 if isinstance(board, Checkerboard) else 1])
    lines = (
        f"{size} inner corners, squares of {board.square_mm:g} mm. Print in actual size, not fitted to the page.",
        f"Glue it onto something flat and stiff. Measure the board: {measures(board)}.",
        f"If not, divide by {counts[0]} and by {counts[1]}, and give what one square is{what} as --square-mm {given}:",
        f"stereolib calibrate left right {board_words(board)}",
    )
    beside = width > height
    place = (left + BAR_MM + 8, top - 4) if beside else (left, top + 7)
    ax.text(*place, "\n".join(lines), size=_POINTS, va="top", linespacing=1.25)


def _bar_mm() -> Iterator[np.ndarray]:
    """The bar and its ticks, one a centimetre, the outer ones flush with its ends."""
    yield np.array([(0, 0), (BAR_MM, 0), (BAR_MM, 1), (0, 1)])
    for k in range(11):
        left = k / 10 * (BAR_MM - _TICK_MM)
        yield np.array(
            [(left, 0), (left + _TICK_MM, 0), (left + _TICK_MM, (high := -3 if k % 5 == 0 else -1.5)), (left, high)]
        )
