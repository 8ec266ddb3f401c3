"""What notebook 03 holds against the paper's conclusions on matching."""

from __future__ import annotations

from stereolib.matching import Score


def glare_times(matt: Score, glossy: Score) -> dict[str, float]:
    """How many times the bad pixels of a matt surface a glossy one has.

    Parameters
    ----------
    matt, glossy : Score
        Of the same pixels.

    Returns
    -------
    dict
        ``times``: ratio of the two `bad2_pct`; the matt one counts as at least 0.1 %, about one exposure's scatter.
    """
    return {"times": glossy.bad2_pct / max(matt.bad2_pct, 0.1)}
