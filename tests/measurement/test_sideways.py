"""How far a face goes on sideways where all is plain beside it: as far as its foot stands on the floor."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib.measurement import sideways
from stereolib.measurement.agreement import Agreement, Past
from stereolib.measurement.sideways import heights_aside, reach_aside, upright

N, AT = 100, np.arange(100)
POINTS = upright(np.column_stack([np.full(N, 800.0), AT]), heights_aside(0.0, 220.0))


def lines(ends, until=N, relief=1.0):
    """A surface of 50 px with texture up to a line, then plain up to another one, from which on pictures disagree."""
    at = np.arange(N)
    textured = (at < ends) | (at >= until)
    contrast, there = np.where(textured, 1.0, 0.05), np.full(N, 50.0)
    return Agreement(np.where(at < ends, 0.95, 0.0), np.where(at < ends, 0.95, 0.0), contrast, relief * contrast,
                     there, there, there, np.zeros(N))  # fmt: skip


def reach(monkeypatch, face, foot):
    seen = []
    monkeypatch.setattr(sideways, "agreement", lambda views, world, points: seen.append(points) or foot)
    return reach_aside(None, None, POINTS, face, 16), seen


def test_a_face_goes_as_far_as_its_foot_where_all_is_plain_beside_it(monkeypatch):
    found, (low,) = reach(monkeypatch, lines(40, 80), lines(42, 42))
    assert lines(40, 80).reach(16).stop == 79
    assert found.last == 37 and found.stop == 41 + 12 - 1 and found.past is Past.OPEN
    assert low[0, :, 2].max() == pytest.approx(0.12 * 220.0) and (low[:, 0, 1] == AT).all()  # just above the floor


def test_also_where_it_would_be_followed_to_the_picture_s_rim(monkeypatch):
    rim = lines(40)
    for values in (rim.fine, rim.whole):
        values[90:] = np.nan
    found, _ = reach(monkeypatch, rim, lines(42, 42))
    assert rim.reach(16).past is Past.CUT and found.past is Past.OPEN and found.stop < 60


def test_what_goes_on_with_texture_of_its_own_needs_no_foot(monkeypatch):
    """It may stand in a shadow, and disagree there."""
    found, seen = reach(monkeypatch, lines(70, 70), lines(30, 30))
    assert found == lines(70, 70).reach(16, aside=True) and not seen
    found, seen = reach(monkeypatch, lines(70, 90), lines(30, 30))
    assert found == lines(70, 90).reach(16, aside=True) and seen


def test_the_trace_of_an_edge_is_plain(monkeypatch):
    """Both pictures agree about a shade, at any disparity."""
    shade = lines(70, 70, relief=np.where(AT < 40, 1.0, 0.1))
    found, _ = reach(monkeypatch, shade, lines(42, 42))
    assert shade.reach(16).last == 67 and found.stop == 41 + 12 - 1


def test_a_floor_as_plain_as_the_wall_tells_nothing(monkeypatch):
    found, _ = reach(monkeypatch, lines(40, 80), lines(42, 80))
    assert found == lines(40, 80).reach(16, aside=True)
