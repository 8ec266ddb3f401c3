"""A length that a rig's folder asks for: between two pixels of a left picture, beside what a ruler says."""

from __future__ import annotations

from dataclasses import dataclass

from stereolib.base import UInt8
from stereolib.measurement import Between, Instrument, length_between

_MOST_STD = 3.0  # a length and a ruler that differ by more of its standard deviations contradict each other


@dataclass(frozen=True)
class AskedLength:
    """A length that is asked for.

    Attributes
    ----------
    pair : str
        The pair's name, as `pair_name` tells it.
    pixels : two of (column, row), px
        In the left picture, as the camera gave it.
    ruler_mm : float or None
        What a ruler says.
    is_rectified : bool
        The pixels are those of the rectified left picture.
    """

    pair: str
    pixels: tuple[tuple[float, float], tuple[float, float]]
    ruler_mm: float | None = None
    is_rectified: bool = False

    def measure(self, pair: tuple[UInt8, UInt8], instrument: Instrument) -> Between:
        """Measure it.

        Parameters
        ----------
        pair : (left, right), (H, W) or (H, W, 3) uint8
            As the cameras gave it.
        instrument : Instrument

        Returns
        -------
        Between

        Raises
        ------
        ValueError
            As `length_between`.
        """
        return length_between(*pair, self.pixels, instrument, is_rectified=self.is_rectified)

    def told(self, found: Between) -> str:
        """Say what was found, and hold it against the ruler: they agree within three standard deviations.

        Parameters
        ----------
        found : Between
            From `measure`.

        Returns
        -------
        str

        Examples
        --------
        >>> import numpy as np
        >>> found = Between(np.zeros((2, 3)), np.zeros(2), 239.0, 0.5)
        >>> AskedLength("3", ((0, 0), (1, 1)), 240.0).told(found)
        '239.0 ± 0.5 mm; the ruler says 240.0 mm: -1.0 mm off, within 3 standard deviations (1.5 mm)'
        """
        text = f"{found.length_mm:.1f} ± {found.std_mm:.1f} mm"
        if self.ruler_mm is None:
            return text
        most = _MOST_STD * found.std_mm
        is_within = abs(found.length_mm - self.ruler_mm) <= most
        limit = f"{'within' if is_within else 'which is more than'} {_MOST_STD:g} standard deviations ({most:.1f} mm)"
        ends = "" if is_within else ". Do the pixels lie at the ends that the ruler touched?"
        return f"{text}; {beside_ruler(found.length_mm, self.ruler_mm)}, {limit}{ends}"


def beside_ruler(length_mm: float, ruler_mm: float) -> str:
    """Say how far a length is from what a ruler says.

    Parameters
    ----------
    length_mm, ruler_mm : float

    Returns
    -------
    str

    Examples
    --------
    >>> beside_ruler(73.1, 73)
    'the ruler says 73.0 mm: +0.1 mm off'
    """
    return f"the ruler says {ruler_mm:.1f} mm: {length_mm - ruler_mm:+.1f} mm off"
