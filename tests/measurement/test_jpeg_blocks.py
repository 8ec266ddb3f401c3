"""The steps that JPEG leaves at its blocks' rims: taken off, and nothing else."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from stereolib.measurement.jpeg_blocks import without_blocks


def smooth(seed=3, shape=(120, 160)):
    """A picture of little detail, of which JPEG keeps hardly more than its blocks' means."""
    noise = np.random.default_rng(seed).normal(0, 1, shape)
    soft = cv2.GaussianBlur(noise, (0, 0), 6)
    return np.rint(128 + 25 * soft / soft.std()).clip(0, 255).astype(np.uint8)


def sent(picture, quality):
    data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    return cv2.imdecode(data, cv2.IMREAD_UNCHANGED)


def off(a, b):
    return float(np.sqrt(np.mean((a.astype(float) - b) ** 2)))


def at_rims(picture):
    """By how much it steps at the rims of blocks more than beside them."""
    p = picture.astype(float)
    rims = np.arange(8, p.shape[1] - 7, 8)
    return float(np.abs(p[:, rims] - p[:, rims - 1] - (p[:, rims + 1] - p[:, rims - 2]) / 3).mean())


@pytest.mark.parametrize("quality", [10, 20, 40])
def test_what_jpeg_left_becomes_less(quality):
    true = smooth()
    blocks = sent(true, quality)
    mended = without_blocks(blocks)
    assert off(mended, true) < off(blocks, true)
    assert at_rims(mended) < 0.85 * at_rims(blocks) and at_rims(mended) > at_rims(true)


def test_a_picture_without_blocks_stays_as_it_is():
    assert without_blocks(smooth()) is not None and np.array_equal(without_blocks(smooth()), smooth())
    tiny = np.arange(49, dtype=np.uint8).reshape(7, 7)
    assert np.array_equal(without_blocks(tiny), tiny)


def test_blocks_that_begin_elsewhere_are_left():
    """As of a picture that was cut out: their rims are where those of this one are not."""
    moved = sent(smooth(), 20)[3:, 4:]
    assert np.array_equal(without_blocks(moved), moved)


def test_an_edge_at_a_rim_remains():
    true = smooth()
    true[:, 80:] = np.clip(true[:, 80:].astype(int) + 90, 0, 255)
    blocks = sent(true, 20)
    mended = without_blocks(blocks)
    step = [float((p[:, 80].astype(int) - p[:, 79]).mean()) for p in (blocks, mended)]
    assert step[1] == pytest.approx(step[0], abs=2.0) and step[0] > 60


def test_colours_keep_their_differences():
    colour = cv2.merge([sent(smooth(k), 20) // 2 + 60 for k in range(3)])
    changed = without_blocks(colour).astype(int) - colour
    assert np.abs(changed).max() > 0 and np.ptp(changed, axis=2).max() == 0  # brightness alone
    grey = cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY)
    assert np.abs(without_blocks(grey).astype(int) - grey - changed[..., 0]).max() <= 1
