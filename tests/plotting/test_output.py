"""Figures and tables: the same bytes from the same data."""

from __future__ import annotations

import base64
import io

import cv2
import numpy as np
import pandas as pd
import pytest
from PIL import Image

from stereolib import plotting
from stereolib.plotting.style import COLORS, REFUSED


def drawing(noise=0.0):
    figure, (left, right) = plotting.panels(2, width_in=6)
    rng = np.random.default_rng(0)
    disparity = np.where(rng.random((40, 60)) < 0.1, np.nan, rng.uniform(0, 100, (40, 60)) + noise)
    plotting.plot_disparity(disparity, left, "a map", high=100)
    plotting.plot_curves({"ours": ([1, 2, 3], [1, 4, 9]), "paper": ([1, 3], [2, 2])}, right, xlabel="x", ylabel="y")
    return figure


def test_png_is_the_same_bytes_each_time(figures_in_temporary_folder):
    path = figures_in_temporary_folder / "fig.png"
    shown = plotting.save_figure("fig", drawing())
    first = path.read_bytes()
    assert shown.data == first
    plotting.save_figure("fig", drawing())
    assert path.read_bytes() == first
    plotting.save_figure("fig", drawing(noise=3))
    assert path.read_bytes() != first
    image = Image.open(io.BytesIO(first))
    assert (image.format, image.mode) == ("PNG", "P")
    assert not {"Software", "Creation Time", "date"} & set(image.info)


def test_svg_is_the_same_bytes_each_time(figures_in_temporary_folder):
    path = figures_in_temporary_folder / "fig.svg"
    plotting.save_figure("fig", drawing(), svg=True)
    first = path.read_bytes()
    plotting.save_figure("fig", drawing(), svg=True)
    assert path.read_bytes() == first
    assert b"<svg" in first and b"dc:date" not in first


def test_without_a_name_nothing_is_written(figures_in_temporary_folder):
    shown = plotting.show_figure(None, drawing())
    assert not figures_in_temporary_folder.exists()
    bundle, metadata = shown._repr_mimebundle_()
    assert base64.b64decode(bundle["image/png"]) == shown.data
    assert Image.open(io.BytesIO(shown.data)).size == (900, 337)
    assert metadata == {}


def test_a_text_goes_with_the_picture(figures_in_temporary_folder):
    told = "Rays from two cameras at the left meet in P, far to the right"
    shown = plotting.save_figure("fig02", drawing())
    assert shown._repr_mimebundle_()[1]["image/png"]["alt"].startswith(told)
    with Image.open(figures_in_temporary_folder / "fig02.png") as written:
        assert written.text["Description"].startswith(told)


def test_table(figures_in_temporary_folder):
    table = pd.DataFrame({"distance_mm": [500, 700], "note": ["a, b", "±"]})
    assert plotting.save_table("distances", table) is table
    written = (figures_in_temporary_folder / "tables" / "distances.csv").read_bytes()
    assert written == 'distance_mm,note\n500,"a, b"\n700,±\n'.encode()


def test_colours_of_small_things_stay(figures_in_temporary_folder):
    """A map in hundreds of shades, and a mark of few pixels in each colour that means something."""
    figure, (ax,) = plotting.panels(1, width_in=6, aspect=0.7)
    ax.imshow(np.random.default_rng(0).normal(size=(300, 400)).cumsum(axis=1), cmap="viridis", extent=(0, 8, 0, 6))
    for k, color in enumerate((*COLORS, REFUSED)):
        ax.plot(k + 0.5, 3, "s", ms=4, color=color)
    shown = np.array(Image.open(io.BytesIO(plotting.show_figure(None, figure).data)).convert("RGB"), int)
    for color in (*COLORS, REFUSED):
        wanted = np.array([int(color[k : k + 2], 16) for k in (1, 3, 5)])
        assert (np.abs(shown - wanted).max(axis=2) < 12).sum() > 20, color


@pytest.mark.parametrize("size", [(160, 120), (1920, 1080)])
def test_a_photograph_with_axes_keeps_its_pixels_and_the_whole_text(size):
    image = np.random.default_rng(0).integers(0, 256, (size[1], size[0]), dtype=np.uint8)
    text = "a line that is much too long for a picture as small as this one, ± its end " * 3
    data = plotting.picture_with_pixels(image, [(text, "#000000")])
    drawn = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    np.testing.assert_array_equal(drawn[: size[1], : size[0]], np.repeat(image[..., None], 3, axis=2))
    below = drawn[size[1] + (drawn.shape[0] - size[1]) // 2 :]
    columns = (below < 200).any(axis=(0, 2)).nonzero()[0]
    assert 0 < columns[0] < 0.1 * size[0] and 0.7 * size[0] < columns[-1] < drawn.shape[1] - 1
