"""Calibration boards, and where their corners are in pictures, in the same order in both views."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from threading import Semaphore
from typing import Any

import cv2
import numpy as np

from stereolib.base import Bools, Float32, Floats, UInt8, listed
from stereolib.calibration.refinement import refine
from stereolib.rig import check_image, check_pair, to_grey

_LEAST_NUMBERED = 8  # corners of a ChArUco board: a pose has six unknowns, some are to spare
_LEAST_SQUARE_MM = 1.0  # no camera sees a board of smaller ones at a distance: metres were given
_MOST_SQUARE_MM = 1e6  # a kilometre: no board has larger ones
_LEAST_POSED = 4  # corners of a flat board, not all on one line: fewer have no pose
_ON_A_LINE = 1e-6  # of their spread along it: corners that leave a line by less do not tell how a board is turned
_BEYOND_PX = 1.0  # beyond a picture's outermost pixels: refined to sub-pixel, a corner may end there
_ASPECTS = (0.8, 1.25)  # printers stretch by a per cent, so that anything beyond is a slip


@dataclass(frozen=True)
class Checkerboard:
    """A checkerboard, counted in inner corners.

    Parameters
    ----------
    columns, rows : int
        Inner corners: a board of 10 x 7 squares has 9 x 6.
    square_mm : float
        Edge of a square, the mean of both if a printer stretched them.
    aspect : float
        Height of a square over its width, 1 unless measured: printers stretch by a per cent.

    Examples
    --------
    >>> Checkerboard(9, 6, 25.0).points_mm[:2]
    array([[ 0.,  0.,  0.],
           [25.,  0.,  0.]], dtype=float32)
    """

    columns: int
    rows: int
    square_mm: float
    aspect: float = 1.0

    def __post_init__(self) -> None:
        _check_counted(self.columns, self.rows)
        if self.columns < 3 or self.rows < 3:
            raise ValueError(f"a checkerboard needs at least 3x3 inner corners, got {self.columns}x{self.rows}")
        if self.columns == self.rows:
            why = f"a board of {self.columns}x{self.rows} inner corners looks the same after a quarter turn"
            raise ValueError(f"{why}: use one with different numbers of columns and rows")
        _check_square(self.square_mm)
        if not _ASPECTS[0] < self.aspect < _ASPECTS[1]:
            raise ValueError(f"a square's height over its width must be near 1, got {self.aspect}")

    @property
    def points_mm(self) -> Float32:
        """Corners on the board, row by row from the upper left. (columns * rows, 3) float32, mm, z = 0."""
        width = 2 * self.square_mm / (1 + self.aspect)
        return _grid(self.columns, self.rows, width, width * self.aspect)


@dataclass(frozen=True)
class Charuco:
    """A checkerboard with an ArUco marker in every white square: the corners carry numbers.

    It may leave the image in part, lie upside down, or be square: no corner can be taken for another.

    Parameters
    ----------
    columns, rows : int
        Inner corners, as of a `Checkerboard`.
    square_mm, marker_mm : float
        Edges of a square and of a marker.
    dictionary : str
        A name of `cv2.aruco`, without ``DICT_``.
    legacy : bool
        Printed with OpenCV before 4.6, whose boards with an even number of rows begin with a marker.
    """

    columns: int
    rows: int
    square_mm: float
    marker_mm: float
    dictionary: str = "5X5_100"
    legacy: bool = False

    def __post_init__(self) -> None:
        _check_counted(self.columns, self.rows)
        if self.columns < 2 or self.rows < 2:
            raise ValueError(f"a ChArUco board needs at least 2x2 inner corners, got {self.columns}x{self.rows}")
        _check_square(self.square_mm)
        if not 0 < self.marker_mm < self.square_mm < np.inf:
            why = "a marker must be smaller than its square, both in mm"
            raise ValueError(f"{why}, got {self.marker_mm} and {self.square_mm}")
        if not hasattr(cv2.aruco, f"DICT_{self.dictionary}"):
            raise ValueError(f"unknown ArUco dictionary {self.dictionary!r}; one is called 5X5_100")
        needed = (self.columns + 1) * (self.rows + 1) // 2
        if needed > (there := len(cv2.aruco.getPredefinedDictionary(self._number).bytesList)):
            board = f"a board of {self.columns}x{self.rows} inner corners"
            raise ValueError(f"{board} needs {needed} markers, {self.dictionary} has {there}: choose a larger one")

    @property
    def points_mm(self) -> Float32:
        """Corners on the board, row by row from the upper left. (columns * rows, 3) float32, mm, z = 0."""
        return _grid(self.columns, self.rows, self.square_mm, self.square_mm)

    @property
    def _number(self) -> int:
        return int(getattr(cv2.aruco, f"DICT_{self.dictionary}"))

    @property
    def printed(self) -> Any:
        """The board as `cv2.aruco` has it, for example to print it with its ``generateImage``."""
        dictionary = cv2.aruco.getPredefinedDictionary(self._number)
        squares = self.columns + 1, self.rows + 1
        board = cv2.aruco.CharucoBoard(squares, float(self.square_mm), float(self.marker_mm), dictionary)
        board.setLegacyPattern(self.legacy)
        return board


Board = Checkerboard | Charuco


@dataclass(frozen=True, eq=False)
class BoardViews:
    """Corners of all pairs in which both cameras saw the board.

    Attributes
    ----------
    board : Checkerboard or Charuco
    size : (width, height), px
    left_px, right_px : (n, corners, 2) float32, px
        NaN for corners that were not found (on a checkerboard outermost ones too near its rim).
    names : tuple of str
        Of those pairs.
    missing : tuple of str
        Names of the pairs in which a camera did not see the board.

    Raises
    ------
    ValueError
        If there are not as many names, left and right views, and corners, as there should be; if corners lie outside
        the pictures; or if a view has fewer than four, or all of them on one line.
    """

    board: Board
    size: tuple[int, int]
    left_px: Float32
    right_px: Float32
    names: tuple[str, ...]
    missing: tuple[str, ...]

    def __post_init__(self) -> None:
        if not len(self.left_px) == len(self.right_px) == len(self.names):
            came = f"{len(self.left_px)} left views, {len(self.right_px)} right ones and {len(self.names)} names"
            raise ValueError(f"{came}: every pair needs one of each")
        for side, corners in (("left", self.left_px), ("right", self.right_px)):
            check_corners(self.board, corners, self.size, [f"{name} ({side})" for name in self.names])

    def __len__(self) -> int:
        return len(self.names)

    def only(self, indices: Sequence[int]) -> BoardViews:
        """Choose the pairs of these indices.

        Parameters
        ----------
        indices : sequence of int

        Returns
        -------
        BoardViews
        """
        keep = list(indices)
        names = tuple(self.names[i] for i in keep)
        return replace(self, left_px=self.left_px[keep], right_px=self.right_px[keep], names=names)


def check_corners(board: Board, corners_px: Floats, size: tuple[int, int], names: Sequence[str]) -> None:
    """Refuse views that are none of a board, or of other pictures.

    Parameters
    ----------
    board : Checkerboard or Charuco
    corners_px : (views, corners, 2) array
        NaN where a corner was not found.
    size : (width, height), px
    names : sequence of str
        Of the views.

    Raises
    ------
    ValueError
        If there are other corners than the board's, some lie outside the pictures, or a view has fewer than four, or
        all of them on one line; the views are named.
    """
    corners, count = np.asarray(corners_px, float), board.columns * board.rows
    if corners.shape[1:] != (count, 2):
        why = f"a board of {board.columns}x{board.rows} inner corners needs (views, {count}, 2) of them"
        raise ValueError(f"{why}, NaN where not found; got {corners.shape}")
    outside = (corners < -_BEYOND_PX) | (corners > np.array(size) - 1 + _BEYOND_PX)
    if wrong := [name for name, view in zip(names, outside, strict=True) if view.any()]:
        why = f"corners lie outside pictures of {size[0]}x{size[1]}: {listed(wrong)}"
        raise ValueError(f"{why}; are these the pictures' width and height, in this order?")
    enough = can_be_posed(corners) & can_be_posed(np.where(np.isfinite(corners), board.points_mm[:, :2], np.nan))
    if few := [name for name, is_enough in zip(names, enough, strict=True) if not is_enough]:
        why = f"too few corners of the board, fewer than {_LEAST_POSED} or all on one line: {listed(few)}"
        raise ValueError(f"{why}; leave such pairs out")


def can_be_posed(corners_px: Floats) -> Bools:
    """Tell which views show enough of a board to say where it is: four corners, not all on one line.

    Parameters
    ----------
    corners_px : (views, corners, 2) array
        NaN where a corner was not found.

    Returns
    -------
    (views,) bool

    Examples
    --------
    >>> can_be_posed(np.array([[[0.0, 0], [10, 0], [20, 0], [30, 1]], [[0, 0], [10, 0], [20, 0], [30, 0]]]))
    array([ True, False])
    """
    corners = np.asarray(corners_px, float)
    known = np.isfinite(corners).all(axis=-1, keepdims=True)
    middle = np.where(known, corners, 0).sum(axis=1, keepdims=True) / np.maximum(known.sum(axis=1, keepdims=True), 1)
    off = np.where(known, corners - middle, 0)
    across, along = np.linalg.eigvalsh(off.transpose(0, 2, 1) @ off).T
    return np.asarray((known.sum(axis=(1, 2)) >= _LEAST_POSED) & (across > _ON_A_LINE**2 * along))


def find_checkerboard(image: UInt8, board: Checkerboard) -> Float32 | None:
    """Find the corners of a checkerboard to sub-pixel.

    The sector-based detector goes first (Duda & Frese, BMVC 2018: robust to noise and blur), where it finds nothing
    the classic one. Both are refined on the grey-value gradient (`refine`) in a window that reaches half way to the
    nearest corner, and over no rim of the board: the sector-based corners alone are off by 0.1 px rms and at times by
    pixels on tilted boards, the refined ones by 0.04 px.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
    board : Checkerboard

    Returns
    -------
    (columns * rows, 2) float32, px, or None
        In the order of `Checkerboard.points_mm`, up to a half turn of the board (see `match_order`); NaN for an
        outermost corner too near the board's rim.

    Raises
    ------
    ValueError
        If `image` is no such picture.
    """
    check_image(image)
    grey, inner = to_grey(image), (board.columns, board.rows)
    detected, corners = cv2.findChessboardCornersSB(grey, inner, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
    if not detected:  # stretching the contrast can close the gaps between the squares of an overexposed board
        detected, corners = cv2.findChessboardCornersSB(grey, inner, flags=0)
    if not detected:
        flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
        detected, corners = cv2.findChessboardCorners(grey, inner, flags=flags)
    return refine(grey, corners.reshape(-1, 2), board.rows) if detected else None


def find_charuco(image: UInt8, board: Charuco) -> Float32 | None:
    """Find the corners of a ChArUco board to sub-pixel, by their numbers, refined as those of a checkerboard.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
    board : Charuco

    Returns
    -------
    (columns * rows, 2) float32, px, or None
        In the order of `Charuco.points_mm`; NaN where a corner was not found. None for fewer than eight corners, or
        for corners on one line, which say nothing about a pose.

    Raises
    ------
    ValueError
        If `image` is no such picture.
    """
    check_image(image)
    grey = to_grey(image)
    corners, ids, *_ = cv2.aruco.CharucoDetector(board.printed).detectBoard(grey)
    if ids is None or len(ids) < _LEAST_NUMBERED:
        return None
    row_column = np.unravel_index(ids.ravel(), (board.rows, board.columns))
    if min(len(np.unique(index)) for index in row_column) < 2:
        return None
    all_corners = np.full((board.columns * board.rows, 2), np.nan, np.float32)
    all_corners[ids.ravel()] = corners.reshape(-1, 2)
    # the window reaches no marker, whose edges would pull at it
    return refine(grey, all_corners, board.rows, reach=(1 - board.marker_mm / board.square_mm) / 2)


def find_board(image: UInt8, board: Board) -> Float32 | None:
    """Find a board's corners by `find_checkerboard` or `find_charuco`, as the board is.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
    board : Checkerboard or Charuco

    Returns
    -------
    (columns * rows, 2) float32, px, or None

    Raises
    ------
    ValueError
        If `image` is no such picture.

    Examples
    --------
    >>> find_board(np.full((240, 320), 128, np.uint8), Checkerboard(9, 6, 25.0)) is None
    True
    """
    return find_charuco(image, board) if isinstance(board, Charuco) else find_checkerboard(image, board)


def match_order(left_px: Float32, right_px: Float32) -> Float32:
    """Turn the right view's corners by 180 degrees if they run against the left view's.

    Parameters
    ----------
    left_px, right_px : (N, 2) float32, px
        NaN where a corner was not found.

    Returns
    -------
    (N, 2) float32, px
        The right view's.
    """
    half = len(left_px) // 2
    left, right = (np.nanmean(view[-half:], axis=0) - np.nanmean(view[:half], axis=0) for view in (left_px, right_px))
    return right_px if left @ right > 0 else right_px[::-1].copy()


def find_in_pairs(
    pairs: Iterable[tuple[UInt8, UInt8]], board: Board, names: Sequence[str] | None = None, *, progress: bool = True
) -> BoardViews:
    """Find the board in stereo pairs, two views at a time over all cores.

    Parameters
    ----------
    pairs : iterable of (left, right)
        Images, (H, W) or (H, W, 3) uint8.
    board : Checkerboard or Charuco
    names : sequence of str, optional
        What to call the pairs in messages.
    progress : bool
        Show a bar.

    Returns
    -------
    BoardViews

    Raises
    ------
    ValueError
        If sizes differ, or the board is found in no pair; the pairs are named.
    """
    pairs = list(pairs)
    names = [f"pair {i + 1}" for i in range(len(pairs))] if names is None else list(names)
    if not pairs:
        raise ValueError("no image pairs were given to look for the board in")
    for (left, right), name in zip(pairs, names, strict=True):
        check_pair(left, right, names=(f"{name} (left)", f"{name} (right)"))
        if left.shape[:2] != pairs[0][0].shape[:2]:
            sizes = [f"{image.shape[1]}x{image.shape[0]}" for image in (left, pairs[0][0])]
            raise ValueError(f"{name} is {sizes[0]}, {names[0]} is {sizes[1]}: all pairs must have one size")
    images = [image for pair in pairs for image in pair]
    corners = list(over_cores(lambda image: find_board(image, board), images, "finding boards", progress=progress))
    return pair_views(corners, board, names, pairs[0][0].shape[1::-1])


def over_cores(task: Callable[[Any], Any], items: Sequence[Any], what: str, *, progress: bool) -> Iterator[Any]:
    """Run a task on every item, by threads on all cores; OpenCV lets go of Python's lock.

    OpenCV's own threads rest meanwhile: they and ours would stand in each other's way.

    Parameters
    ----------
    task : callable
    items : sequence
    what : str
        The bar's title.
    progress : bool
        Show a bar.

    Yields
    ------
    object
        The results in the order of the items.
    """
    from joblib import Parallel, cpu_count, delayed
    from tqdm.auto import tqdm

    cores = cpu_count()
    slots = Semaphore(cores)

    def held(item: Any) -> Any:
        with slots:
            return task(item)

    with one_opencv_thread():
        try:
            parallel = Parallel(n_jobs=cores, prefer="threads", return_as="generator")
            running = parallel(delayed(held)(item) for item in items)
            yield from tqdm(running, what, len(items), unit="view", disable=not progress, leave=False)
        finally:
            for _ in range(cores):  # interrupted: OpenCV aborts the process if Python ends under it
                slots.acquire()


@contextmanager
def one_opencv_thread() -> Iterator[None]:
    """Keep OpenCV to one thread: several add up in the order in which they end, and no sum is twice the same."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)


def pair_views(
    corners: Sequence[Float32 | None], board: Board, names: Sequence[str], size: tuple[int, int]
) -> BoardViews:
    """Gather the pairs in which both cameras saw the board.

    Parameters
    ----------
    corners : sequence of (N, 2) float32 or None
        Of left, right, left, right, ... images.
    board : Checkerboard or Charuco
    names : sequence of str
        Of all pairs.
    size : (width, height), px

    Returns
    -------
    BoardViews

    Raises
    ------
    ValueError
        If there is no such pair; they are named.
    """
    views = list(zip(names, corners[::2], corners[1::2], strict=True))
    both = [(name, left, right) for name, left, right in views if left is not None and right is not None]
    missing = tuple(name for name, left, right in views if left is None or right is None)
    pattern = f"{board.columns}x{board.rows} inner corners"
    listed = f"{len(names)} pairs ({', '.join(names[:5])}{', ...' if len(names) > 5 else ''})"
    if not both and isinstance(board, Charuco):
        markers = f"{board.dictionary}, {board.marker_mm:g} mm on squares of {board.square_mm:g} mm"
        why = f"no ChArUco board of {pattern} with markers of {markers}, was found in both views of any of {listed}"
        raise ValueError(
            f"{why}: is the dictionary right, is the board legacy (before OpenCV 4.6), or has it no markers?"
        )
    if not both:
        why = f"no board of {pattern} was found in both views of any of {listed}: count inner corners, not squares"
        raise ValueError(f"{why}, and keep the whole board with a white rim in view; give markers' size if it has any")
    left_px = np.stack([left for _, left, _ in both])
    numbered = isinstance(board, Charuco)
    right_px = np.stack([right if numbered else match_order(left, right) for _, left, right in both])
    return BoardViews(board, size, left_px, right_px, tuple(name for name, _, _ in both), missing)


def _check_counted(columns: int, rows: int) -> None:
    if not all(isinstance(n, int | np.integer) for n in (columns, rows)):
        raise ValueError(f"inner corners are counted in whole numbers, got {columns!r} x {rows!r}")


def _check_square(square_mm: float) -> None:
    if not 0 < square_mm <= _MOST_SQUARE_MM:
        most = f"{_MOST_SQUARE_MM:g} at most"
        raise ValueError(f"the square's edge must be a positive number of mm, got {square_mm}; {most}")
    if square_mm < _LEAST_SQUARE_MM:
        meant = f"for {square_mm:g} m that is {1000 * square_mm:g}"
        raise ValueError(f"the square's edge was given as {square_mm:g}, but millimetres are expected: {meant}")


def _grid(columns: int, rows: int, width_mm: float, height_mm: float) -> Float32:
    grid = np.zeros((columns * rows, 3), np.float32)
    grid[:, :2] = np.mgrid[:columns, :rows].T.reshape(-1, 2) * (width_mm, height_mm)
    return grid
