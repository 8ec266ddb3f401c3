"""A rectified pair matched, with what is to be said of the pair and of the range that was searched."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolib.base import UInt8
from stereolib.matching.pair_checks import Exchanged, check_rectified, moved_between
from stereolib.matching.pipelines import DisparityEstimate, stereo_pipeline
from stereolib.matching.rows import find_rows

_BEYOND = 0.005  # share of the roughly matched pixels that may lie beyond the range before it is told


@dataclass(frozen=True, eq=False)
class CheckedMatch:
    """A disparity map, and what speaks against it.

    Attributes
    ----------
    estimate : DisparityEstimate
    notes : tuple of str
        Rows that could not be compared or do not agree, parts of another moment, a range that was too small.
    """

    estimate: DisparityEstimate
    notes: tuple[str, ...]

    @property
    def shares(self) -> dict[str, float]:
        """Share of the pixels that were matched, that were filled by a guess, and of which nothing is told."""
        valid, matched = np.isfinite(self.estimate.disparity_px), self.estimate.matched
        kinds = {"matched": matched & valid, "filled": valid & ~matched, "refused": ~valid}
        return {kind: float(mask.mean()) for kind, mask in kinds.items()}


def match_checked(
    left: UInt8,
    right: UInt8,
    pipeline: str = "best",
    num_disparities: int | None = None,
    *,
    exchanged: Exchanged | None = None,
) -> CheckedMatch:
    """Match a rectified pair once it has been looked at.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        Rectified.
    pipeline, num_disparities
        As for `stereo_pipeline`; None takes the range that a rough match of the pair tells.
    exchanged : callable, optional
        As for `check_rectified`.

    Returns
    -------
    CheckedMatch

    Raises
    ------
    ValueError
        As `check_rectified` and `stereo_pipeline`; or if no pixel was matched.
    """
    run, notes = stereo_pipeline(pipeline, num_disparities), list[str]()
    if np.isnan(check_rectified(left, right, exchanged=exchanged)):
        told = "whether the pair is rectified, and of one place and moment"
        notes.append(f"too few points of the two pictures could be matched to tell {told}")
    estimate = run(left, right)
    if not np.isfinite(estimate.disparity_px).any():
        raise ValueError("no pixel was matched; check that they are a stereo pair, left one first")
    rows, half_px = find_rows(left, right)
    corrected = [rows.warning] if pipeline == "best" else []
    rough_px = 2 * half_px[np.isfinite(half_px)]
    if num_disparities and rough_px.size and (beyond := float((rough_px > num_disparities).mean())) > _BEYOND:
        lost = f"{100 * beyond:.1f} % of the roughly matched pixels lie beyond num_disparities {num_disparities}"
        corrected.append(f"{lost}: what stands there is wrong; leave it out or give more")
    return CheckedMatch(estimate, tuple(filter(None, [*notes, *corrected, moved_between(left, right)])))
