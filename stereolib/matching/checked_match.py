"""A rectified pair matched, with what is to be said of the pair and of the range that was searched."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stereolib.base import Bools, UInt8
from stereolib.matching.islands import beyond_range, unsupported
from stereolib.matching.pair_checks import Exchanged, check_matchable, check_rectified, moved_between
from stereolib.matching.pipelines import DisparityEstimate, stereo_pipeline
from stereolib.matching.rows import find_rows

_BEYOND = 0.005  # share of the roughly matched pixels that may lie beyond the range before it is told
_NOTHING, _LITTLE = 0.01, 0.2  # share of matched pixels: with less the pair tells nothing, with less it is said


@dataclass(frozen=True, eq=False)
class CheckedMatch:
    """A disparity map, and what speaks against it.

    Attributes
    ----------
    estimate : DisparityEstimate
    notes : tuple of str
        Rows that could not be compared or do not agree, parts of another moment, a range that was too small, little
        that was matched.
    columns_std_px : float
        Standard deviation of a shift of all disparities that correcting the rows may have left.
    """

    estimate: DisparityEstimate
    notes: tuple[str, ...]
    columns_std_px: float = 0.0

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
    limit_px: float = 1.0,
    exchanged: Exchanged | None = None,
) -> CheckedMatch:
    """Match a rectified pair once it has been looked at.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        Rectified.
    pipeline, num_disparities
        As for `stereo_pipeline`; None takes the range that a rough match of the pair tells.
    limit_px, exchanged
        As for `check_rectified`.

    Returns
    -------
    CheckedMatch

    Raises
    ------
    ValueError
        As `check_matchable`, `check_rectified` and `stereo_pipeline`; or if hardly a pixel was matched.

    Notes
    -----
    Patches that a rough matching of the pair does not know are refused (`unsupported`), whatever the pipeline; so is
    what that finds to be nearer than `num_disparities` (`beyond_range`), if it is more than 0.5 %. "best" corrects rows
    itself.
    """
    run, notes = stereo_pipeline(pipeline, num_disparities), list[str]()
    corrects = pipeline == "best"
    check_matchable(left, right)
    if np.isnan(check_rectified(left, right, limit_px, exchanged=exchanged)):
        told = "whether the pair is rectified, and of one place and moment"
        notes.append(f"too few points of the two pictures could be matched to tell {told}")
    rows, half_px = find_rows(left, right)
    estimate = run(left, right)
    estimate = _without(unsupported(estimate.disparity_px, estimate.matched, half_px), estimate)
    rough_px, beyond = 2 * half_px[np.isfinite(half_px)], ""
    if num_disparities and rough_px.size and (share := float((rough_px > num_disparities).mean())) > _BEYOND:
        estimate = _without(beyond_range(half_px, num_disparities, left.shape[:2]), estimate)
        lost = f"{100 * share:.1f} % of the roughly matched pixels lie beyond num_disparities {num_disparities}"
        beyond = f"{lost}: they are refused, and what is told beside them may be wrong; leave it out or give more"
    matched = float((estimate.matched & np.isfinite(estimate.disparity_px)).mean())
    only = f"only {100 * matched:.1f} % of the pixels were matched"
    if matched < _NOTHING:
        remedy = "check that they are a stereo pair, left one first, and show things with texture"
        raise ValueError(f"{only}: nothing can be measured; {beyond or remedy}")
    if matched < _LITTLE and not beyond:
        notes.append(f"{only}: more light or texture helps, and pictures of one moment of one place")
    said = [*notes, *(rows.warnings if corrects else ()), beyond, moved_between(left, right)]
    return CheckedMatch(estimate, tuple(filter(None, said)), rows.columns_std_px if corrects else 0.0)


def _without(refused: Bools, estimate: DisparityEstimate) -> DisparityEstimate:
    disparity, std = (
        None if a is None else np.where(refused, np.float32(np.nan), a)
        for a in (estimate.disparity_px, estimate.std_px)
    )
    assert disparity is not None
    return replace(estimate, disparity_px=disparity, matched=estimate.matched & ~refused, std_px=std)
