"""What a set of boards covers: image, distance and tilt, and what is missing, by name."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Coverage:
    """Scores from 0 to 1, and what is missing in words.

    ``image`` is the share of both images' area that boards reached, ``distance`` and ``tilt`` the share of the spread
    that a good set has; ``score`` is their mean. ``missing`` names parts, as ``"no views in the lower right"``.
    """

    image: float
    distance: float
    tilt: float
    missing: tuple[str, ...]

    @property
    def score(self) -> float:
        """Mean of the three, 0 to 1."""
        return (self.image + self.distance + self.tilt) / 3
