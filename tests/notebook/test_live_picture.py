"""Live pictures: what is sent to the page, and what its messages do."""

from __future__ import annotations

import cv2
import numpy as np

from stereolib.notebook.live_picture import LivePicture


def test_one_message_holds_all_that_belongs_together(monkeypatch):
    picture, sent = LivePicture("a pair"), []
    monkeypatch.setattr(picture, "send_state", lambda key=None: sent.append(set(key or ())))
    grey, color = np.full((40, 60), 90, np.uint8), np.zeros((30, 50, 3), np.uint8)
    color[..., 2] = 200
    picture.show([grey, color], ["left", "right"], quality="preview", about="distance_mm=800")
    assert sent == [{"frames", "captions", "quality", "about", "number"}]
    assert picture.number == 1 and picture.captions == ["left", "right"]
    shown = [cv2.imdecode(np.frombuffer(frame, np.uint8), cv2.IMREAD_COLOR) for frame in picture.frames]
    assert [image.shape for image in shown] == [(40, 60, 3), (30, 50, 3)]
    np.testing.assert_allclose(shown[0], 90, atol=2)
    np.testing.assert_allclose(shown[1].mean((0, 1)), [0, 0, 200], atol=4)


def test_previews_are_smaller_than_full_pictures():
    noise = np.random.default_rng(0).integers(0, 255, (200, 300, 3), dtype=np.uint8)
    sizes = []
    for quality in ("preview", "full"):
        picture = LivePicture()
        picture.show([noise], quality=quality)
        sizes.append(len(picture.frames[0]))
    assert sizes[0] < sizes[1]


def test_clicks_and_moves_are_told_apart_and_others_ignored():
    told = []
    picture = LivePicture("a pair", lambda *words: told.append(words))
    picture._told(None, {"kind": "click", "picture": 1, "x": 20, "y": 30}, [])
    picture._told(None, {"kind": "move", "picture": 1, "x": 22, "y": 30}, [])
    picture._told(None, {"kind": "wave"}, [])
    assert told == [(1, 20, 30, True), (1, 22, 30, False)]
    LivePicture()._told(None, {"kind": "click", "picture": 0, "x": 1, "y": 1}, [])  # nobody asked to be told


def test_waiting_ends_when_the_page_has_painted():
    picture = LivePicture()
    picture.show([np.zeros((4, 4), np.uint8)])
    picture.painted = picture.number
    assert picture._seen.is_set()
    picture.show([np.zeros((4, 4), np.uint8)])
    assert not picture._seen.is_set()
