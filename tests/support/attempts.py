"""Recorded pairs with their attempts at a height, each made once."""

from __future__ import annotations

from functools import cache

from stereolib.measurement import attempt_height
from stereolib.virtual import recordings
from support.ground import RECT


@cache
def attempted(name):
    return attempt_height(*RECT.rectify(*recordings.load_pair(name)), RECT)
