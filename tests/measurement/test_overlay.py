"""Objects drawn into the picture: where they are."""

from __future__ import annotations

import numpy as np
from support.measured import measured, the_cube

from stereolib.measurement import OBJECT_RGB, draw_objects
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
