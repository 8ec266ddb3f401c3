"""Residuals: none where the model is right, derivatives against differences, sizes against their errors."""

from __future__ import annotations

import numpy as np
import pytest
from support.boxes import GAP_MM, HERE, OWN, PRIORS, STILL, edges, ends, everything, planes, readings, shared

from stereolib.measurement.box import Box, Edge, Own, Shared, Side, derivatives
from stereolib.measurement.observations import OwnPrior, PlaneSeen, weak_priors, whitening

WORLD = PRIORS.world(STILL)
FLOOR_SEEN = PlaneSeen(np.array([300.0, 400.0]), np.array([0.0, 0.3, 60.0]), whitening(np.diag([1e-8, 1e-8, 4e-4])))
KINDS = {
    "plane": planes(WORLD, OWN)[0], "other plane": planes(WORLD, OWN)[1], "floor": FLOOR_SEEN,
    **{edge.name: edges(WORLD, OWN, some=[edge])[0] for edge in Edge},
    "ranges": readings(WORLD, OWN)[0], "other ranges": readings(WORLD, OWN)[1],
    "end": ends(WORLD, OWN)[0], "corner": ends(WORLD, OWN, some=[(Side.LEFT, True)])[0],
    "prior": OwnPrior(Own.HEIGHT, 240.0, 5.0),
}  # fmt: skip
N = len(Shared)


def residuals_of(seen, world, box):
    return seen.together((seen,))(world, box)


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_are_those_of_central_differences(kind):
    rng = np.random.default_rng(3)
    scale = np.array([*[1e-3] * 3, 1, 1, 1e-3, 1e-3, 0.1, 0.1, 1e-3, 1e-3, 1, 1, 1e-3, 1, 1, 1, 0.5, 0.5])
    x = np.concatenate([STILL, OWN]) + scale * rng.normal(0, 1, N + len(Own))

    def residuals(y):
        return residuals_of(KINDS[kind], PRIORS.world(y[..., :N]), Box(y[..., N:]))

    values, J = derivatives(residuals, x)
    assert values == pytest.approx(residuals(x))
    for k, step in enumerate(1e-3 * scale):
        move = step * np.eye(len(x))[k]
        slope = (residuals(x + move) - residuals(x - move)) / (2 * step)
        assert J[:, k] == pytest.approx(slope, rel=1e-4, abs=1e-5 * max(np.abs(J).max(), 1))


def test_the_truth_leaves_no_residual():
    """Of every kind, also where cameras and laser are not where they were calibrated."""
    for x in (STILL, shared(pitch=0.01, offset=0.3, focal=0.002, laser_x=8.0, laser_yaw=0.05, laser_scale=0.02)):
        world = PRIORS.world(x)
        for seen in everything(world)[7:]:
            assert np.abs(residuals_of(seen, world, Box(OWN))).max() < 1e-9


def test_residuals_count_standard_deviations():
    higher = OWN.copy()
    higher[Own.HEIGHT] += 1.0
    top = edges(WORLD, OWN, some=[Edge.TOP_LEFT])[0]
    rise = WORLD.pixels(Box(higher).edge(Edge.TOP_LEFT))[0] - WORLD.pixels(Box(OWN).edge(Edge.TOP_LEFT))[0]
    off = residuals_of(top, WORLD, Box(higher))[0] * top.std_px
    assert abs(off) == pytest.approx(abs(rise @ top.across), rel=0.1)
    nearer = OWN.copy()
    nearer[[Own.X, Own.Y]] -= 6.0 * Box(OWN).normal(Side.RIGHT)
    seen = readings(WORLD, OWN)[0]
    along = 6.0 / (seen.beams @ Box(OWN).normal(Side.RIGHT)) / seen.sigma_mm
    assert -residuals_of(seen, WORLD, Box(nearer)) == pytest.approx(along)
    longer = OWN.copy()
    longer[Own.RIGHT] += GAP_MM / 12**0.5
    assert residuals_of(ends(WORLD, OWN)[0], WORLD, Box(longer)) == pytest.approx(1.0)


def test_a_bias_shifts_all_readings_of_its_face():
    biased = OWN.copy()
    biased[Own.RIGHT_BIAS] = 1.5
    right, left = readings(WORLD, biased)
    assert np.abs(residuals_of(right, WORLD, Box(biased))).max() < 1e-9
    assert -residuals_of(right, WORLD, Box(OWN)) == pytest.approx(1.5 / right.sigma_mm)
    assert np.abs(residuals_of(left, WORLD, Box(OWN))).max() < 1e-9


def test_whitening_makes_errors_of_one_sigma():
    rng = np.random.default_rng(1)
    A = rng.normal(0, 1, (3, 3)) * [1e-4, 1.0, 30.0]
    root = whitening(A.T @ A)
    assert root.T @ (A.T @ A) @ root == pytest.approx(np.eye(3), abs=1e-5)
    assert np.isfinite(whitening(np.diag([0.0, 1.0, 4.0]))).all()


def test_who_saw_what():
    kinds = {type(o).__name__: (o.robust, o.of_scan) for o in everything(WORLD)}
    assert kinds == {
        "OwnPrior": (False, False), "PlaneSeen": (True, False), "EdgeSeen": (True, False),
        "RangesSeen": (True, True), "EndBetweenBeams": (True, True),
    }  # fmt: skip
    assert not FLOOR_SEEN.robust
    assert {o.name for o in weak_priors(OWN, HERE.bias_mm)} == set(Own) - {Own.TURN}


def test_many_at_once_are_each_by_itself():
    """Of either face and the floor, real and complex, from a world and a box that are off."""
    x = np.concatenate([shared(pitch=0.01, offset=0.3, laser_x=8.0, laser_yaw=0.05, laser_scale=0.02), OWN + 1e-3])
    kinds = {kind: [o for o in everything(WORLD) if type(o) is kind] for kind in map(type, everything(WORLD))}
    kinds[PlaneSeen].append(FLOOR_SEEN)
    for y in (x, x + 1j * 1e-30 * np.eye(len(x))):
        world, box = PRIORS.world(y[..., :N]), Box(y[..., N:])
        for kind, some in kinds.items():
            each = [residuals_of(o, world, box) for o in some]
            assert [r.shape[-1] for r in each] == [o.count for o in some] and len(some) > 1
            assert kind.together(some)(world, box) == pytest.approx(np.concatenate(each, axis=-1), rel=1e-9)
