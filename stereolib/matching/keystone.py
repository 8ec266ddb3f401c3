"""Rows that drift apart towards the corners: what a camera that was turned sideways leaves in a rectified pair."""

from __future__ import annotations

from dataclasses import dataclass, replace

from stereolib.base import Float64


@dataclass(frozen=True, eq=False)
class Keystone:
    """What a plane leaves of a pair's row offsets: ``k (u - cu) (v - cv)`` in the right picture.

    A right camera that was turned about its upright axis by w shifts what it sees by ``w f`` in its middle, which looks
    like another depth. But it shifts by ``w f (1 + x^2, x y)`` at ``x = (u - cu) / f`` and ``y = (v - cv) / f``: the
    rows tell of it, by ``k = w / f``.

    Attributes
    ----------
    per_px : float
        k, px for each px^2.
    std_per_px : float
        Its standard deviation, as the pictures scatter.
    right_px : (N, 2) float64
        Columns and rows in the right picture of all cells that took part.
    left_u_px : (N,) float64
        Their columns in the left one.
    gain : (N,) float64
        k is the sum of the cells' row offsets, each times its gain.
    """

    per_px: float
    std_per_px: float
    right_px: Float64
    left_u_px: Float64
    gain: Float64

    def doubled(self) -> Keystone:
        """Tell the same in a picture of twice the size.

        Returns
        -------
        Keystone
        """
        right_px, left_u_px = 2 * self.right_px + 0.5, 2 * self.left_u_px + 0.5
        per_px, std_per_px, gain = self.per_px / 2, self.std_per_px / 2, self.gain / 4
        return replace(self, per_px=per_px, std_per_px=std_per_px, right_px=right_px, left_u_px=left_u_px, gain=gain)
