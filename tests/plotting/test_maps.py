"""Scans are drawn the right way round."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib import plotting
from stereolib.mapping import Station


@pytest.fixture
def ax():
    return plotting.panels(1)[1][0]


def test_scan_from_above_has_left_on_the_left(ax):
    plotting.plot_scan(np.array([[1000.0, 300.0]]), ax, label="room")  # ahead, to the left
    np.testing.assert_allclose(ax.collections[0].get_offsets(), [[-300, 1000]])


def test_polar_labels_stand_off_the_readings():
    ax = plotting.panels(1, subplot_kw={"projection": "polar"})[1][0]
    angles = np.radians(np.arange(360.0))
    plotting.plot_scan_polar(angles, np.where(abs(angles - np.pi) < 0.3, np.nan, 2000.0), ax)
    places = {text.get_text(): text.get_position() for text in ax.texts}
    assert places == {"1000": (pytest.approx(np.pi, abs=0.1), 1000), "2000": (pytest.approx(np.pi, abs=0.1), 2000)}


def test_polar_scan_marks_dropouts():
    ax = plotting.panels(1, subplot_kw={"projection": "polar"})[1][0]
    plotting.plot_scan_polar(np.radians([0.0, 90, 180]), np.array([1000.0, np.nan, 500]), ax)
    readings, lost = (np.ma.getdata(points.get_offsets()) for points in ax.collections)
    np.testing.assert_allclose(readings[[0, 2]], [[0, 1000], [np.pi, 500]])
    np.testing.assert_allclose(lost, [[np.pi / 2, 1050]])
    centre, forward, left = ax.transData.transform([[0, 0], [0, 1000], [np.pi / 2, 1000]])
    assert forward[1] > centre[1] + 10 and left[0] < centre[0] - 10  # up, and counter-clockwise
    np.testing.assert_allclose([forward[0], left[1]], centre, atol=1e-6)


def test_a_part_of_a_scan_is_enlarged(ax):
    plotting.plot_scan(np.array([[1000.0, 300.0]]), ax, zoom_mm=(-400, -200, 900, 1100))
    (glass,) = ax.child_axes
    assert glass.get_xlim() == (-400, -200) and glass.get_ylim() == (900, 1100)
    np.testing.assert_allclose(glass.collections[0].get_offsets(), [[-300, 1000]])


def test_plan_shows_boxes_by_letter_and_stations_by_number(ax):
    stations = [Station(np.array([500.0, -200.0, 0.0]), (), np.zeros((0, 2)), np.zeros(2))]
    corners = np.array([[0.0, 0.0], [200, 0], [200, 100], [0, 100]])
    plotting.plot_plan(stations, {"B": corners}, ax)
    places = {text.get_text(): text.get_position() for text in ax.texts}
    assert set(places) == {"B", "1"} and places["1"] == (500, -200)
    assert next(text for text in ax.texts if text.get_text() == "B").xy == (100, 50)
