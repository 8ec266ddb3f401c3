"""Stories of the bench: a button each, that sets the knobs and says in two sentences what to look at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from stereolib.measurement import Measurement
from stereolib.notebook import chain
from stereolib.notebook.knobs import State, knobs
from stereolib.paper import HeightResult


@dataclass(frozen=True)
class Story:
    """A state worth looking at.

    Attributes
    ----------
    name : str
    state : State
        It sets every knob.
    tell : callable
        Takes the state and those of `then`, returns two or three sentences; what they count is computed from these.
    then : tuple of State
        Where the sentences send the reader next, or what they compare with.
    """

    name: str
    state: State
    tell: Callable[..., str]
    then: tuple[State, ...] = ()

    @property
    def sentence(self) -> str:
        """What to look at."""
        return self.tell(self.state, *self.then)

    @property
    def set_knobs(self) -> tuple[str, ...]:
        """Knobs that it turns away from the paper's set-up."""
        return tuple(name for name in knobs() if getattr(self.state, name) != getattr(State(), name))

    @property
    def next_knobs(self) -> tuple[str, ...]:
        """Knobs that the reader turns to get to `then`."""
        return tuple(n for n in knobs() if any(getattr(one, n) != getattr(self.state, n) for one in self.then))


def _bad_pct(state: State) -> str:
    quality = chain.quality(state)
    return f"{quality.bad2_pct:.1f} %" if quality else "an unknown share"


def _recipe_cm(state: State) -> str:
    read = chain.recipe(state)
    return f"{read.height_mm / 10:.1f} cm" if isinstance(read, HeightResult) else "nothing"


def _plain(state: State, textured: State) -> str:
    quality = chain.quality(state)
    found = quality.density_pct if quality else np.nan
    return (
        f"A plain box gives the matcher nothing to compare: it finds a disparity for {found:.1f} % of the box's "
        f"pixels, and {_bad_pct(state)} are wrong or empty. Click on a face: its cost curve has no clear minimum. The "
        f"recipe reads {_recipe_cm(state)} all the same, {_recipe_cm(textured)} with texture: it asks for one topmost "
        "pixel."
    )


def _dark(state: State, large: State) -> str:
    return (
        f"In poor light noise drowns the texture, and {_bad_pct(state)} of the box's pixels are wrong or empty. Larger "
        f"blocks average the noise: set the block size to {large.block_size}, and {_bad_pct(large)} are. The recipe is "
        f"no better for it: a few pixels too near are enough, and it reads {_recipe_cm(state)} before and "
        f"{_recipe_cm(large)} after."
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


def _textured(state: State, small: State, free: State) -> str:
    held, loose = (100 * np.isfinite(chain.filtered(one)).mean() for one in (small, free))
    return (
        f"With texture almost the whole box is matched: {_bad_pct(state)} of its pixels are wrong or empty, nearly all "
        "of them in the columns at the left: both cameras see them, but not every disparity that is searched has a "
        "partner inside the right picture there, and OpenCV leaves them out. Set the block size to "
        f"{small.block_size}, and {held:.1f} % of all pixels still have a disparity; move P1 to {free.p1} and P2 to "
        f"{free.p2} then, and it is {loose:.1f} %: that is what the paths do."
    )


def _too_high(state: State) -> str:
    return (
        f"At this threshold the recipe counts the whole near edge, and reads {_recipe_cm(state)} for 30 cm. Its rows "
        "are right, its scale is not: the centimetres per pixel belong to the side corners, which are farther away."
    )


def _accident(state: State, cleaned: State) -> str:
    read, truth = chain.recipe(state), chain.known(state)
    near, right = np.nan, np.nan
    if isinstance(read, HeightResult) and truth is not None:
        near, right = read.disparity_px, float(truth.disparity_px[read.top_row, read.column])
    return (
        f"Right, by accident: above the {state.constant_rows} rows cut off, the map's greatest disparity is one stray "
        f"patch on the wall beside the box, at {near:.1f} px where {right:.1f} px would be right, and it lies in the "
        f"row in which the recipe reads {_recipe_cm(state)}. Remove specks below {cleaned.speckle_window_size} pixels, "
        f"and it reads {_recipe_cm(cleaned)}."
    )


def _dilated(state: State, plain: State) -> str:
    mean = [f"{q.bias_px:+z.2f}" if (q := chain.quality(one)) else "?" for one in (state, plain)]
    return (
        "Each pixel takes the largest disparity around it, so that holes close, "
        f"{_bad_pct(plain)} wrong or empty become {_bad_pct(state)}, and the box grows by half a kernel. But the mean "
        f"error is {mean[0]} px now and {mean[1]} px without the filter: red in the error's picture. The floor "
        f"grows too, by half a kernel above the {state.constant_rows} rows cut off, where the recipe takes it for the "
        f"near edge and reads {_recipe_cm(state)}; without the filter it reads {_recipe_cm(plain)}."
    )


def _rows(state: State, level: State) -> str:
    attempt = chain.ground_plane(state)
    text = f"{attempt.height_mm / 10:.1f} cm" if attempt and not attempt.refused else "nothing"
    scatter = [q.scatter_px if (q := chain.quality(one)) else np.nan for one in (state, level)]
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


_PLAIN, _DARK, _GLARE, _TEXTURE = (
    State(source=f"conditions/{name}") for name in ("plain", "poor_light", "glare", "texture")
)
_SMALL_BLOCK, _DILATED = (
    replace(_TEXTURE, block_size=1),
    replace(_TEXTURE, filter="dilation", kernel_px=15, tolerance_px=7),
)
#: The recipe as printed: the dilated map, and no threshold below its maximum.
_ACCIDENT = State(source="series/medium_900", tolerance_px=0, filter="dilation", kernel_px=9)
#: In the order of their buttons.
STORIES = (
    Story("Fig. 4: plain", _PLAIN, _plain, (_TEXTURE,)),
    Story("Fig. 4: poor light", _DARK, _dark, (replace(_DARK, block_size=15),)),
    Story("Fig. 4: glare", replace(_GLARE, tolerance_px=6.5), _glossy),
    Story("Fig. 4: texture", _TEXTURE, _textured, (_SMALL_BLOCK, replace(_SMALL_BLOCK, p1=1, p2=2))),
    Story("Why 37.7 cm?", replace(_TEXTURE, tolerance_px=6.5), _too_high),
    Story("30 cm by accident", _ACCIDENT, _accident, (replace(_ACCIDENT, speckle_window_size=150),)),
    Story("What dilation destroys", _DILATED, _dilated, (replace(_DILATED, filter="none"),)),
    Story("Half a row off", replace(_TEXTURE, row_px=0.5), _rows, (_TEXTURE,)),
    Story("A turned laser", replace(_TEXTURE, laser_yaw_deg=2.0), _turned),
)
