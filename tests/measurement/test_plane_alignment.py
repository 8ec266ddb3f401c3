"""Planes aligned over two pictures: against a pair made by an exact plane."""

from __future__ import annotations

import numpy as np
import pytest
from support.ground import GRID, pictures_of_plane, textured

from stereolib.base import Float64
from stereolib.measurement.plane_alignment import AlignedPair, align, cell_of

PLANE = np.array([0.02, 0.30, 20.0])


def on_plane() -> tuple[Float64, Float64, Float64]:
    """Pixels u, v, and what `PLANE` is multiplied by."""
    u, v = (a[250:450:2, 250:600:2].ravel() for a in GRID)
    return u, v, np.stack([u, v, np.ones_like(u)], axis=1)


def test_every_cell_of_24_pixels_has_a_number_of_its_own():
    u, v = (a.ravel() for a in np.mgrid[0:100, 0:60].astype(float))
    numbers = cell_of(u, v)
    cells = {}
    for number, cell in zip(numbers.tolist(), zip((u // 24).tolist(), (v // 24).tolist(), strict=True), strict=True):
        assert cells.setdefault(number, cell) == cell
    assert len(cells) == 5 * 3


def test_alignment_finds_a_slanted_plane_to_a_hundredth():
    """A right picture made from the left by an exact plane, gain and noise; the start is 1.5 px off."""
    draw, (u, v, x) = np.random.default_rng(3), on_plane()
    pair = AlignedPair.of(*pictures_of_plane(PLANE, textured(draw, 40.0, (2.0, 2.0)), draw, noise=2.0))
    fit = align(pair, u, v, x, PLANE + np.array([0, 0, 1.5]))
    off = fit.parameters - PLANE
    assert np.abs(x @ off).max() < 0.05 and abs(np.mean(x @ off)) < 0.01
    assert 0.2 < np.sqrt(off @ np.linalg.solve(fit.covariance, off) / 3) < 2  # deviations
    blank = np.full((480, 640), 90, np.uint8)
    with pytest.raises(ValueError, match="no texture"):
        align(AlignedPair.of(blank, blank), u, v, x, PLANE)


@pytest.mark.parametrize(
    ("contrast", "size_px"), [(5.0, (2.0, 2.0)), (25.0, (12.0, 1.5))], ids=["faint", "drawn out along the rows"]
)
def test_noise_does_not_pass_for_texture(contrast, size_px):
    """Where noise has as steep slopes as the texture, the deviations stated are still those found."""
    (u, v, x), squares = on_plane(), []
    for seed in range(30):
        draw = np.random.default_rng([4, seed])
        pair = AlignedPair.of(*pictures_of_plane(PLANE, textured(draw, contrast, size_px), draw, noise=8.0))
        fit = align(pair, u, v, x, PLANE)
        off = fit.parameters - PLANE
        squares.append(off @ np.linalg.solve(fit.covariance, off) / 3)
    assert 0.6 < np.sqrt(np.mean(squares)) < 1.35
