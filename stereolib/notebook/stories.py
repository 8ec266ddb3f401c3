"""Stories of the bench: a button each, that sets the knobs and says in two sentences what to look at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from stereolib.measurement import Measurement
from stereolib.notebook import chain
from stereolib.notebook.knobs import State
from stereolib.paper import HeightResult

_LARGE_BLOCK = 15
_LARGE_SPECK = 150  # pixels


@dataclass(frozen=True)
class Story:
    """A state worth looking at.

    Attributes
    ----------
    name : str
    state : State
    tell : callable
        Takes the state, returns two sentences; what they count is computed from it.
    """

    name: str
    state: State
    tell: Callable[[State], str]


def _bad_pct(state: State) -> str:
    quality = chain.quality(state)
    return f"{quality.bad2_pct:.0f} %" if quality else "an unknown share"


def _recipe_cm(state: State) -> str:
    read = chain.recipe(state)
    return f"{read.height_mm / 10:.1f} cm" if isinstance(read, HeightResult) else "nothing"


def _plain(state: State) -> str:
    quality = chain.quality(state)
    found, right = (quality.density_pct, 100 - quality.bad2_pct) if quality else (np.nan, np.nan)
    return (
        f"A plain box gives the matcher nothing to compare: it finds a disparity for {found:.0f} % of its pixels, "
        f"and for {right:.0f} % one that is right to 2 px. Click on a face to see a cost curve without a clear minimum."
    )


def _dark(state: State) -> str:
    large = replace(state, block_size=_LARGE_BLOCK)
    return (
        f"In poor light noise drowns the texture, and {_bad_pct(state)} of the box's pixels are wrong or empty. Larger "
        f"blocks average the noise: set the block size to {large.block_size}, and {_bad_pct(large)} are."
    )


def _glossy(state: State) -> str:
    read, truth = chain.recipe(state), chain.known(state)
    near, right = np.nan, np.nan
    if isinstance(read, HeightResult) and truth is not None:
        near, right = (float(np.median(px[read.mask])) for px in (chain.filtered(state), truth.disparity_px))
    return (
        f"A highlight stands at another place in each picture, so that {_bad_pct(state)} of the box's pixels are wrong "
        f"or empty. A few specks match far too near, at {near:.0f} px where {right:.0f} px would be right: the recipe "
        f"takes them for the near edge and reads {_recipe_cm(state)}."
    )


def _textured(state: State) -> str:
    small = replace(state, block_size=1)
    held, loose = (100 * np.isfinite(chain.filtered(one)).mean() for one in (small, replace(small, p1=1, p2=2)))
    return (
        f"With texture almost the whole box is matched: {_bad_pct(state)} of its pixels are wrong or empty, nearly all "
        "of them in the columns at the left, which have no partner for every disparity. Set the block size to 1, and "
        f"{held:.0f} % of all pixels are still matched; move P1 to 1 and P2 to 2 then, and it is {loose:.0f} %: that "
        "is what the paths do."
    )


def _too_high(state: State) -> str:
    return (
        f"At this threshold the recipe marks the whole near edge, and reads {_recipe_cm(state)} for 30 cm. Its rows "
        "are right, its scale is not: the centimetres per pixel belong to the side corners, which are farther away."
    )


def _accident(state: State) -> str:
    read, truth = chain.recipe(state), chain.known(state)
    cleaned, near, right = replace(state, speckle_window_size=_LARGE_SPECK), np.nan, np.nan
    if isinstance(read, HeightResult) and truth is not None:
        near, right = read.disparity_px, float(truth.disparity_px[read.top_row, read.column])
    return (
        f"Right, by accident: the map's maximum is one stray patch on the wall beside the box, at {near:.0f} px where "
        f"{right:.0f} px would be right, and it lies in the row in which the recipe reads {_recipe_cm(state)}. Remove "
        f"specks below {cleaned.speckle_window_size} pixels, and it reads {_recipe_cm(cleaned)}."
    )


def _dilated(state: State) -> str:
    quality = chain.quality(state)
    bias = quality.bias_px if quality else np.nan
    return (
        f"Each pixel takes the largest disparity around it, so that holes close and the box grows by half a kernel. "
        f"What was matched is now {bias:+.1f} px too near on average: look at the red in the error picture."
    )


def _rows(state: State) -> str:
    attempt = chain.ground_plane(state)
    text = f"{attempt.height_mm / 10:.1f} cm" if attempt and not attempt.refused else "nothing"
    scatter = [q.rms_px if (q := chain.quality(one)) else np.nan for one in (state, replace(state, row_px=0))]
    return (
        f"Where the rows disagree by half a pixel, disparities on the box scatter by {scatter[0]:.2f} px in place of "
        f"{scatter[1]:.2f} px. The ground plane's method measures the offset, corrects it, and reads {text}."
    )


def _turned(state: State) -> str:
    measured = chain.measured(state)
    moved = [text for text in measured.warnings if "turned by" in text] if isinstance(measured, Measurement) else []
    return (
        "The laser was turned by 2 degrees, and nobody told the program: its readings no longer lie on the box. It "
        f"finds that from what both sensors see: {moved[0] if moved else 'nothing was found'}."
    )


#: The recipe as printed: the dilated map, and no threshold below its maximum.
_ACCIDENT = State(source="series/medium_900", tolerance_px=0, filter="dilation", kernel_px=9)
#: In the order of their buttons.
STORIES = (
    Story("Fig. 4: plain", State(source="conditions/plain"), _plain),
    Story("Fig. 4: poor light", State(source="conditions/poor_light"), _dark),
    Story("Fig. 4: glare", State(source="conditions/glare", tolerance_px=6.5), _glossy),
    Story("Fig. 4: texture", State(source="conditions/texture"), _textured),
    Story("Why 37.7 cm?", State(source="conditions/texture", tolerance_px=6.5), _too_high),
    Story("30 cm by accident", _ACCIDENT, _accident),
    Story("What dilation destroys", State(source="conditions/texture", filter="dilation", kernel_px=15), _dilated),
    Story("Half a row off", State(source="conditions/texture", row_px=0.5), _rows),
    Story("A turned laser", State(source="conditions/texture", laser_yaw_deg=2.0), _turned),
)
