"""Where the rows of a pair were compared, cell by cell, and how far they disagree there."""

from __future__ import annotations

from dataclasses import dataclass, replace

from stereolib.base import Float64, Ints


@dataclass(frozen=True, eq=False)
class RowCells:
    """Row offsets of the N cells of a pair that tell one.

    Attributes
    ----------
    right_px : (N, 2) float64
        Columns and rows of the cells in the right picture.
    left_u_px : (N,) float64
        Their columns in the left one.
    offset_px : (N,) float64
        Rows by which the right picture is too low there.
    weight : (N,) float64
        How much each tells: the square root of its squared slopes.
    block : (N,) int
        Number of the block of neighbours that err together.
    """

    right_px: Float64
    left_u_px: Float64
    offset_px: Float64
    weight: Float64
    block: Ints

    def doubled(self) -> RowCells:
        """Tell the same in a picture of twice the size.

        Returns
        -------
        RowCells
        """
        right_px, left_u_px = 2 * self.right_px + 0.5, 2 * self.left_u_px + 0.5
        return replace(self, right_px=right_px, left_u_px=left_u_px, offset_px=2 * self.offset_px)
