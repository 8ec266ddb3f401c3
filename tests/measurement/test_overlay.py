"""Objects drawn into the picture: where they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.measured import measured, the_cube

from stereolib.measurement import OBJECT_RGB, add_caption, draw_length, draw_objects, overlay
from stereolib.measurement.overlay import _draw_edges, _label, size_text
from stereolib.virtual import recordings


def test_the_boxes_are_drawn_where_the_cube_is():
    found = measured()
    drawn = (draw_objects(found, scan=False) != found.left).any(axis=2)
    rows, columns = np.nonzero(drawn)
    truth = recordings.load_truth("conditions/texture").box == 1
    seen_rows, seen_columns = np.nonzero(truth)
    assert abs(columns.min() - seen_columns.min()) < 5 and abs(columns.max() - seen_columns.max()) < 5
    assert abs(rows.max() - seen_rows.max()) < 5 and size_text(the_cube(found)).endswith(" mm")


def test_a_size_that_is_not_well_known_has_its_deviation_with_it():
    cube = the_cube(measured())
    vague = replace(cube, covariance=np.diag([49.0, 1.0, 16.0]))
    assert "+-" not in size_text(cube) and size_text(vague) == size_text(cube).replace(" x", "+-7 x", 1)
    assert size_text(replace(vague, size_mm=np.array([np.nan, 1.0, 2.0]))) == "? x 1 x 2 mm"


def test_a_name_gives_the_colour_and_what_has_none_is_grey():
    found = measured()
    for name, rgb in (("A", OBJECT_RGB[0]), ("C", OBJECT_RGB[2]), ("", (140, 140, 140))):
        drawn = draw_objects(found, scan=False, names=[name] * len(found.objects))
        changed = drawn[(drawn != found.left).any(axis=2)].astype(int)
        assert (np.abs(changed - rgb[::-1]).max(axis=1) < 20).sum() > 500, name


def test_near_objects_are_drawn_over_far_ones_and_numbered(monkeypatch):
    """The same box twice, as the nearest and as the farthest: the nearest one's colour is on top."""
    found, cube, texts = measured(), the_cube(measured()), []
    monkeypatch.setattr(overlay, "_label", lambda _, text, *rest: texts.append(text[0]))
    unknown = replace(cube, size_mm=np.full(3, np.nan))
    drawn = draw_objects(replace(found, objects=(cube, unknown, cube)), scan=False)
    changed = drawn[(drawn != found.left).any(axis=2)].astype(int)
    of_each = [(np.abs(changed - rgb[::-1]).max(axis=1) < 30).sum() for rgb in OBJECT_RGB[:3]]
    assert of_each[0] > 500 and max(of_each[1:]) < 0.2 * of_each[0]
    assert texts == [f"1: {size_text(cube)}", overlay.why_text(unknown), f"2: {size_text(cube)}"]
    draw_objects(replace(found, objects=(cube, unknown)), scan=False)
    assert texts[3] == size_text(cube)  # there is but one with sizes


@pytest.mark.parametrize("width", [160, 640])
def test_a_caption_leaves_the_pictures_pixels_where_they_are(width):
    picture = np.random.default_rng(0).integers(0, 256, (60, width, 3), np.uint8)
    drawn = add_caption(picture, "rectified: its pixels are not those of LEFT")
    np.testing.assert_array_equal(drawn[:60], picture)
    ink = np.flatnonzero((drawn[60:] < 128).any(axis=(0, 2)))
    assert len(ink) > 60 and ink.min() > 3 and ink.max() < width - 3  # all of its letters


def rings(height_mm: float, camera_mm: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A box half a metre ahead, a corner towards the camera: its foot on the floor, and foot and top in the picture."""
    around = np.radians([45, 135, 225, 315])
    foot_mm = np.column_stack([600 + 100 * np.cos(around + 0.6), 100 * np.sin(around + 0.6)])
    both = [
        np.column_stack([320 - 500 * foot_mm[:, 1] / foot_mm[:, 0], 200 + 500 * (camera_mm - z) / foot_mm[:, 0]])
        for z in (0.0, height_mm)
    ]
    return foot_mm, both[0], both[1]


@pytest.mark.parametrize("turned", [1, -1])
@pytest.mark.parametrize(("camera_mm", "seen"), [(250.0, 9), (80.0, 7)])
def test_edges_that_the_box_hides_are_dashed(turned, camera_mm, seen):
    """From above nine of twelve edges are seen, from below its top seven, as the top's far two are hidden then."""
    foot_mm, foot, top = (ring[::turned] for ring in rings(150.0, camera_mm))
    entry = replace(the_cube(measured()), outline_mm=foot_mm)
    layer = np.zeros((480, 640, 3), np.uint8)
    _draw_edges(layer, entry, foot, top, (255, 255, 255))
    edges = [(ring[k - 1], ring[k]) for ring in (foot, top) for k in range(4)] + list(zip(foot, top, strict=True))
    shares = []
    for start, end in edges:  # between a fifth and four fifths of it, so that neighbours do not count
        at = np.rint(start + np.linspace(0.2, 0.8, 60)[:, None] * (end - start)).astype(int)
        shares.append((layer[at[:, 1], at[:, 0], 0] > 200).mean())
    assert sum(share > 0.95 for share in shares) == seen, shares
    far = int(np.argmax(foot_mm[:, 0]))
    assert max(shares[far], shares[(far + 1) % 4], shares[8 + far]) < 0.8, "the three edges at the far foot"


@pytest.mark.parametrize(
    "ends", [((300.0, 200.0), (310.0, 170.0)), ((20.0, 20.0), (600.0, 25.0)), ((320.0, 5.0), (322.0, 470.0))]
)
def test_a_lengths_text_hides_neither_of_its_ends(ends):
    plain = np.full((480, 640, 3), 127, np.uint8)
    drawn = draw_length(plain, ends, "123.4 +- 5.6 mm")
    for end in np.array(ends, int):
        rows, columns = (np.clip(end[k] + np.arange(-6, 7), 0, (640, 480)[k] - 1) for k in (1, 0))
        cross = [*drawn[rows, end[0]], *drawn[end[1], columns]]
        assert sum(np.abs(pixel.astype(int) - OBJECT_RGB[1][::-1]).max() < 60 for pixel in cross) > 20


@pytest.mark.parametrize("ends", [((298.0, 368.0), (298.0, 218.0)), ((170.0, 300.0), (540.0, 330.0))])
def test_a_lengths_text_stands_beside_its_line(ends):
    drawn = draw_length(np.full((480, 640, 3), 127, np.uint8), ends, "239.8 mm (std 1.1)").astype(int)
    for column, row in np.rint(np.linspace(*np.array(ends), 50)[3:-3]).astype(int):
        assert np.abs(drawn[row, column] - OBJECT_RGB[0][::-1]).max() < 90


def test_what_is_farther_ends_at_a_nearer_box(monkeypatch):
    """A thing of which no size is known goes from side to side behind the cube: there its own edges alone are seen."""
    found, cube = measured(), the_cube(measured())
    monkeypatch.setattr(overlay, "_label", lambda *_: None)
    x, y = cube.outline_mm.mean(axis=0)
    across = np.array([[x + 50.0, y + 300.0], [x + 50.0, y - 300.0]])
    wall = replace(cube, shape="face", size_mm=np.full(3, np.nan), outline_mm=across)
    alone, both, named = (
        draw_objects(replace(found, objects=objects), scan=False, names=names)
        for objects, names in (((cube,), ()), ((cube, wall), ()), ((cube, wall), ("A", "B")))
    )
    rows, columns = np.nonzero((alone != found.left).any(axis=2))
    middle = slice(rows.min() + 5, rows.max() - 5), slice(columns.min() + 5, columns.max() - 5)
    assert np.array_equal(both[middle], alone[middle]) and not np.array_equal(named[middle], alone[middle])
    assert not np.array_equal(both, alone)


def test_a_text_of_no_size_stands_a_line_farther_off_rather_than_on_a_box():
    corners, box = np.array([[300.0, 230.0], [640.0, 240.0]]), (400.0, 150.0, 560.0, 250.0)
    frames = []
    for texts in (("no size: cut", "no size"), ("? x 400 x ? mm",)):
        taken = []
        _label(np.zeros((480, 640, 3), np.uint8), texts, corners, (255, 0, 0), taken, [box])
        frames.append(taken[0])
    assert frames[0][1] > box[3] + 5 and frames[1][1] < box[3] + 5


def test_texts_grow_with_the_picture():
    """In a picture of three times the size they take the same share of it; small pictures keep theirs."""
    marked = []
    for width in (320, 640, 1920):
        picture = np.full((width * 3 // 4, width, 3), 128, np.uint8)
        strip = add_caption(picture, "its pixels")[len(picture) :]
        ink = np.argwhere((strip < 128).any(axis=2))
        label = np.argwhere(draw_length(picture, [(width / 4, 100), (width * 3 / 4, 100)], "123.4 mm") == 30)
        marked.append([np.ptp(ink[:, 1]), np.ptp(label[:, 1])])
    small, usual, large = np.array(marked)
    assert np.abs(large / (3 * usual) - 1).max() < 0.2 and np.abs(small / usual - 1).max() < 0.02


@pytest.mark.parametrize(
    ("other", "where"), [((400.0, 100.0, 560.0, 300.0), "below"), ((50.0, 100.0, 200.0, 300.0), "above")]
)
def test_a_text_covers_its_own_object_rather_than_another(other, where):
    picture, corners = np.full((480, 640, 3), 128, np.uint8), np.array([[600.0, 150.0], [660.0, 310.0]])
    _label(picture, ("B ? x 401 x 300 mm",), corners, (255, 0, 0), [], [other])
    rows = np.flatnonzero((picture != 128).any(axis=(1, 2)))
    assert rows.min() > 310 if where == "below" else rows.max() < 150


def test_two_texts_at_one_place_stand_below_each_other():
    picture, corners, taken = np.full((480, 640, 3), 128, np.uint8), np.array([[300.0, 450.0], [340.0, 470.0]]), []
    for text in ("first", "second", "third"):
        _label(picture, (text,), corners, (255, 0, 0), taken, [])
    tops, bottoms = np.sort([frame[1] for frame in taken]), np.sort([frame[3] for frame in taken])
    assert (tops[1:] > bottoms[:-1]).all()


@pytest.mark.parametrize(("beside", "short"), [(60, True), (500, False)])
def test_a_text_that_would_cover_another_object_is_shortened(beside, short):
    """Something at the picture's rim, from top to bottom, and a box beside it."""
    picture, corners = np.zeros((300, 640, 3), np.uint8), np.array([[0.0, 60.0], [0.0, 250.0], [40.0, 250.0]])
    taken = []
    _label(picture, ("no size: depth hidden, cut", "-"), corners, (255, 0, 0), taken, [(beside, 0, 640, 300)])
    ((left, _, right, _),) = taken
    assert (right - left < 40) is short and right < beside


def test_a_line_of_no_pixels_and_an_empty_caption():
    picture = np.zeros((40, 60, 3), np.uint8)
    with pytest.raises(ValueError, match="two pixels"):
        draw_length(picture, [(np.nan, 3.0), (20.0, 10.0)], "1 mm")
    assert add_caption(picture, "") is picture


def test_a_grey_picture_gets_its_caption_too():
    grey = np.full((60, 200), 90, np.uint8)
    drawn = add_caption(grey, "grey")
    assert drawn.shape[0] > 60 and drawn.shape[1:] == (200, 3) and (drawn[:60] == 90).all()
