"""Corners of a board in all pairs of a rig, in the same order in both views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stereolib.base import Float32, Floats, counted, listed
from stereolib.calibration.board_poses import LEAST_POSED, can_be_posed
from stereolib.calibration.boards import Board, Charuco

_BEYOND_PX = 1.0  # beyond a picture's outermost pixels: refined to sub-pixel, a corner may end there


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
        indices : sequence of int, or of bool
            Their numbers, or for each pair if it is chosen.

        Returns
        -------
        BoardViews

        Raises
        ------
        ValueError
            If there is no pair of such an index, or not one bool for each pair.
        """
        try:
            keep = np.arange(len(self))[list(indices)]
        except IndexError as error:
            wanted = f"pairs are chosen of {len(self)} by their indices, from 0, or by one bool for each"
            raise ValueError(f"{wanted}: {error}") from error
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
        why = f"too few corners of the board, fewer than {LEAST_POSED} or all on one line: {listed(few)}"
        raise ValueError(f"{why}; leave such pairs out")


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
    listed = f"{counted(len(names), 'pair')} ({', '.join(names[:5])}{', ...' if len(names) > 5 else ''})"
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
