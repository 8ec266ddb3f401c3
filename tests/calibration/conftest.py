"""What tests of the joint fit and of boards' poses share."""

from __future__ import annotations

import numpy as np
import pytest
from support.corners import corner_set, draw_rig


@pytest.fixture(scope="module")
def rig():
    return draw_rig(np.random.default_rng(1))


@pytest.fixture(scope="module")
def views(rig):
    return corner_set(np.random.default_rng(2), rig=rig, pairs=15)
