"""The bench's pictures: their number and shape, and what is true in them."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from stereolib.notebook import chain
from stereolib.notebook.explorer_panels import CAPTIONS, WIDTH, draw_panels, scale_of, true_outlines
from stereolib.notebook.knobs import State
from stereolib.plotting import color_disparity

TEXTURE = State(source="conditions/texture")


def test_pictures_have_one_height_and_the_captions_number():
    for state in (TEXTURE, replace(TEXTURE, half=True)):
        pictures = draw_panels(state)
        assert len(pictures) == len(CAPTIONS)
        assert pictures[0].shape == (round(480 * WIDTH / 640), WIDTH, 3)
        assert pictures[1].shape == pictures[2].shape == pictures[3].shape == (len(pictures[0]), 640, 3)
    assert scale_of(TEXTURE) == WIDTH / 640 == scale_of(replace(TEXTURE, half=True)) / 2


@pytest.mark.parametrize(
    ("least", "count", "ends"), [(0, 64, (0, 64)), (32, 64, (32, 96)), (-16, 64, (0, 48)), (-16, 16, (-16, 0))]
)
def test_colours_end_where_the_search_does(least, count, ends):
    state = replace(TEXTURE, min_disparity=least, num_disparities=count)
    assert state.colors_px == ends
    shown = draw_panels(state)[1]  # without a span, dividing by it would warn
    wanted = color_disparity(chain.filtered(state), *ends)
    assert (shown[:, :WIDTH] == cv2.resize(wanted, (WIDTH, len(shown)), interpolation=cv2.INTER_NEAREST)).all()
    assert (shown[[-1, 0], WIDTH + 10] == color_disparity(np.array([ends]), *ends)[0]).all()


@pytest.mark.parametrize("source", ["virtual rig", "conditions/level", "room/1", "room/3"])
def test_true_outlines_lie_where_the_boxes_are_measured(source):
    state = State(source=source)
    nearest = next(thing for thing in chain.measured(state).objects if thing.shape == "box")
    off_mm = [np.linalg.norm(outline.mean(axis=0) - nearest.position_mm) for outline in true_outlines(state)]
    assert min(off_mm) < 5
