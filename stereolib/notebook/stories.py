"""Stories of the bench: a button each, that sets the knobs and says in two sentences what to look at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from stereolib.measurement import Measurement
from stereolib.notebook import chain
from stereolib.notebook.knobs import State
from stereolib.paper import HeightResult


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
    return f"{quality.bad2_pct:.0f} % of the box's pixels" if quality else "of an unknown share of pixels"


def _recipe_cm(state: State) -> str:
    read = chain.recipe(state)
    return f"{read.height_mm / 10:.1f} cm" if isinstance(read, HeightResult) else "nothing"


def _plain(state: State) -> str:
    return (
        f"A plain box gives the matcher nothing to compare: {_bad_pct(state)} are wrong or empty. Only its edges are "
        "matched; click on a face to see a cost curve without a clear minimum."
    )


def _dark(state: State) -> str:
    return (
        f"In poor light noise drowns the texture, and {_bad_pct(state)} are wrong or empty. Raise the light or lower "
        "the uniqueness ratio, and see which helps."
    )


def _glossy(state: State) -> str:
    return (
        f"A highlight stands at another place in each picture, so that {_bad_pct(state)} are wrong or empty. The "
        "specks that match the mirror image are near, and the recipe takes one for the top: it reads "
        f"{_recipe_cm(state)}."
    )


def _textured(state: State) -> str:
    return (
        f"With texture almost the whole box is matched; {_bad_pct(state)} are bad, and most of these are the columns "
        "at the left that have no match for every disparity. Move P1 to 1 and P2 to 2, and see what the paths were for."
    )


def _too_high(state: State) -> str:
    return (
        f"At this threshold the recipe marks the whole near edge, and reads {_recipe_cm(state)} for 30 cm. Its rows "
        "are right, its scale is not: the centimetres per pixel belong to the side corners, which are farther away."
    )


def _accident(state: State) -> str:
    return (
        f"Here the recipe reads {_recipe_cm(state)}, nearly right, by accident: its mark ends halfway up the edge. "
        "Move the threshold by one pixel, and the reading is another."
    )


def _dilated(state: State) -> str:
    quality = chain.quality(state)
    bias = quality.bias_px if quality else np.nan
    return (
        f"Each pixel takes the largest disparity around it, so that the holes close and the box grows by half a "
        f"kernel. What was matched is now {bias:+.1f} px too near on average: look at the red in the error picture."
    )


def _rows(state: State) -> str:
    attempt = chain.ground_plane(state)
    text = f"{attempt.height_mm / 10:.1f} cm" if attempt and not attempt.refused else "nothing"
    return (
        "Rows that disagree by half a pixel cost matches where texture is fine, and shift what is slanted. The ground "
        f"plane's method measures the offset, corrects it, and reads {text}."
    )


def _turned(state: State) -> str:
    measured = chain.measured(state)
    moved = [text for text in measured.warnings if "turned by" in text] if isinstance(measured, Measurement) else []
    return (
        "The laser was turned by 2 degrees, and nobody told the program: its readings no longer lie on the box. It "
        f"finds that from what both sensors see: {moved[0] if moved else 'nothing was found'}."
    )


#: In the order of their buttons.
STORIES = (
    Story("Fig. 4: plain", State(source="conditions/plain"), _plain),
    Story("Fig. 4: poor light", State(source="conditions/poor_light"), _dark),
    Story("Fig. 4: glare", State(source="conditions/glare", tolerance_px=6.5), _glossy),
    Story("Fig. 4: texture", State(source="conditions/texture"), _textured),
    Story("Why 37.7 cm?", State(source="conditions/texture", tolerance_px=6.5), _too_high),
    Story("30 cm by accident", State(source="conditions/texture", tolerance_px=5.4), _accident),
    Story("What dilation destroys", State(source="conditions/texture", filter="dilation", kernel_px=15), _dilated),
    Story("Half a row off", State(source="conditions/texture", row_px=0.5), _rows),
    Story("A turned laser", State(source="conditions/texture", laser_yaw_deg=2.0), _turned),
)
