"""Work over all cores: OpenCV's own threads rest meanwhile, and come back."""

from __future__ import annotations

from threading import Event, Thread

import cv2
import pytest

from stereolib.rig import one_opencv_thread, over_cores


@pytest.fixture
def three_threads():
    before = cv2.getNumThreads()
    cv2.setNumThreads(3)
    yield
    cv2.setNumThreads(before)


def test_results_come_in_the_order_of_the_items(three_threads):
    seen = list(over_cores(lambda item: (item, cv2.getNumThreads()), range(9), "items", progress=False))
    assert seen == [(item, 1) for item in range(9)]
    assert cv2.getNumThreads() == 3


def test_a_failing_item_gives_the_threads_back(three_threads):
    def fail(item):
        raise ValueError(f"item {item}")

    with pytest.raises(ValueError, match="item"):
        list(over_cores(fail, range(4), "items", progress=False))
    assert cv2.getNumThreads() == 3


def test_two_at_once_give_back_what_was_there_before_both(three_threads):
    """The one that began second ends last: what it found was already one."""
    begun, first_ended = Event(), Event()

    def second():
        with one_opencv_thread():
            begun.set()
            first_ended.wait(10)
            assert cv2.getNumThreads() == 1

    other = Thread(target=second)
    with one_opencv_thread():
        other.start()
        assert begun.wait(10)
    assert cv2.getNumThreads() == 1  # the second still asks for it
    first_ended.set()
    other.join()
    assert cv2.getNumThreads() == 3
