"""Objects drawn into the picture: where they are."""

from __future__ import annotations

import numpy as np
import pytest
from support.measured import measured, the_cube

from stereolib.measurement import OBJECT_RGB, add_caption, draw_objects
from stereolib.measurement.overlay import size_text
from stereolib.virtual import recordings


def test_the_boxes_are_drawn_where_the_cube_is():
    found = measured()
    drawn = (draw_objects(found, scan=False) != found.left).any(axis=2)
    rows, columns = np.nonzero(drawn)
    truth = recordings.load_truth("conditions/texture").box == 1
    seen_rows, seen_columns = np.nonzero(truth)
    assert abs(columns.min() - seen_columns.min()) < 5 and abs(columns.max() - seen_columns.max()) < 5
    assert abs(rows.max() - seen_rows.max()) < 5 and size_text(the_cube(found)).endswith(" mm")


def test_a_name_gives_the_colour_and_what_has_none_is_grey():
    found = measured()
    for name, rgb in (("A", OBJECT_RGB[0]), ("C", OBJECT_RGB[2]), ("", (140, 140, 140))):
        drawn = draw_objects(found, scan=False, names=[name] * len(found.objects))
        changed = drawn[(drawn != found.left).any(axis=2)].astype(int)
        assert (np.abs(changed - rgb[::-1]).max(axis=1) < 20).sum() > 500, name


@pytest.mark.parametrize("width", [160, 640])
def test_a_caption_leaves_the_pictures_pixels_where_they_are(width):
    picture = np.random.default_rng(0).integers(0, 256, (60, width, 3), np.uint8)
    drawn = add_caption(picture, "rectified: its pixels are not those of LEFT")
    np.testing.assert_array_equal(drawn[:60], picture)
    ink = np.flatnonzero((drawn[60:] < 128).any(axis=(0, 2)))
    assert len(ink) > 60 and ink.min() > 3 and ink.max() < width - 3  # all of its letters
