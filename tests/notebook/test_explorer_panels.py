"""The bench's pictures: their number and shape."""

from __future__ import annotations

from dataclasses import replace

from stereolib.notebook.explorer_panels import CAPTIONS, WIDTH, draw_panels, scale_of
from stereolib.notebook.knobs import State

TEXTURE = State(source="conditions/texture")


def test_pictures_have_one_height_and_the_captions_number():
    for state in (TEXTURE, replace(TEXTURE, half=True)):
        pictures = draw_panels(state)
        assert len(pictures) == len(CAPTIONS)
        assert pictures[0].shape == (round(480 * WIDTH / 640), WIDTH, 3)
        assert pictures[1].shape == pictures[2].shape == pictures[3].shape == (len(pictures[0]), 640, 3)
    assert scale_of(TEXTURE) == WIDTH / 640 == scale_of(replace(TEXTURE, half=True)) / 2
