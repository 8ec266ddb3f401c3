"""The bench's pictures: their number and shape, and what is true in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stereolib.notebook import chain
from stereolib.notebook.explorer_panels import CAPTIONS, WIDTH, draw_panels, scale_of, true_outlines
from stereolib.notebook.knobs import State

TEXTURE = State(source="conditions/texture")


def test_pictures_have_one_height_and_the_captions_number():
    for state in (TEXTURE, replace(TEXTURE, half=True)):
        pictures = draw_panels(state)
        assert len(pictures) == len(CAPTIONS)
        assert pictures[0].shape == (round(480 * WIDTH / 640), WIDTH, 3)
        assert pictures[1].shape == pictures[2].shape == pictures[3].shape == (len(pictures[0]), 640, 3)
    assert scale_of(TEXTURE) == WIDTH / 640 == scale_of(replace(TEXTURE, half=True)) / 2


@pytest.mark.parametrize("source", ["virtual rig", "conditions/level", "room/1", "room/3"])
def test_true_outlines_lie_where_the_boxes_are_measured(source):
    state = State(source=source)
    nearest = next(thing for thing in chain.measured(state).objects if thing.shape == "box")
    off_mm = [np.linalg.norm(outline.mean(axis=0) - nearest.position_mm) for outline in true_outlines(state)]
    assert min(off_mm) < 5
