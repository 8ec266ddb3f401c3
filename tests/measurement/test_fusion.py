"""Lines and ends of one object from both sensors: against slow twins and drawn boxes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from stereolib.laser import LaserScan, find_segments, fit_footprint
from stereolib.measurement import Face, MeasuredObject, Uncertainty, floor_from_pose
from stereolib.measurement.face_lines import LaserOnFloor, Lines, combined, pictured_lines, scanned_lines, without
from stereolib.measurement.fusion import Fused, corners_mm, fuse
from stereolib.measurement.measured_object import from_faces
from stereolib.virtual import recordings

RECT = recordings.rectified()
FLOOR = floor_from_pose(RECT, recordings.setup())
HERE = LaserOnFloor(np.eye(2), np.zeros(2), np.diag([0.5**2, 0.5**2, 1e-6]))
#: Near corner at (700, 20), right side 300 mm under 40 degrees, left side 200 mm.
X = np.array(
    [np.radians(40), *(np.array([np.cos(np.radians(a)), np.sin(np.radians(a))]) @ [700, 20] for a in (40, -50))]
)


def drawn(rng, sigma_mm=1.5):
    """A scan of that box: the true ranges of the beams that meet it, with noise."""
    angles = np.radians(np.arange(360.0))
    beam = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    ranges = np.full(360, 2500.0)
    corner = np.array([700.0, 20.0])
    for k, length in ((0, 300.0), (1, 200.0)):
        a = X[0] - k * np.pi / 2
        n, along = np.array([np.cos(a), np.sin(a)]), np.array([-np.sin(a), np.cos(a)]) * (-1 if k == 0 else 1)
        r = X[1 + k] / np.maximum(beam @ n, 1e-9)
        s = (beam * r[:, None] - corner) @ along
        hit = (beam @ n > 0.05) & (s > 0) & (s < length)
        ranges = np.where(hit & (r < ranges), r, ranges)
    return LaserScan(np.rint(ranges + rng.normal(0, sigma_mm, 360)), np.full(360, 500.0))


def the_footprint(seed):
    parts = [part for part in find_segments(drawn(np.random.default_rng(seed)), max_mm=2000) if part.kind == "object"]
    return fit_footprint(parts[0], bias_mm=0.0)


def the_faces(rng, std=1e-8):
    lines = [np.array([np.cos(a), np.sin(a)]) / c for a, c in ((X[0], X[1]), (X[0] - np.pi / 2, X[2]))]
    spans = ((-0.30, 0.0286), (0.0286, 0.22))
    return tuple(
        Face(line + rng.normal(0, std, 2), np.diag([std**2, std**2]), span, 900)
        for line, span in zip(lines, spans, strict=True)
    )


def test_the_laser_lines_hold_the_truth():
    off = []
    for seed in range(60):
        lines = scanned_lines(the_footprint(seed), HERE, 0.0)
        assert lines is not None and lines.seen == (0, 1)
        off.append((lines.x - X) / np.sqrt(np.diag(lines.covariance)))
    assert 0.9 <= (np.abs(off) < 1.96).mean() <= 1.0


def test_a_moved_laser_gives_the_same_lines():
    turn = np.radians(7)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    here, moved = (
        scanned_lines(the_footprint(1), laser, 0.0)
        for laser in (HERE, LaserOnFloor(R, np.array([30.0, -20.0]), HERE.covariance))
    )
    x = here.x.copy()
    x[0] += turn
    x[1:] += [np.array([np.cos(a), np.sin(a)]) @ [30, -20] for a in (x[0], x[0] - np.pi / 2)]
    np.testing.assert_allclose(moved.x, x, atol=1e-9)


def test_the_pair_s_lines_hold_the_truth():
    rng, off = np.random.default_rng(4), []
    for _ in range(200):
        lines = pictured_lines(the_faces(rng), FLOOR, Uncertainty(face_px=0.0))
        off.append((lines.x - X) / np.sqrt(np.diag(lines.covariance)))
    assert 0.92 <= (np.abs(off) < 1.96).mean() <= 0.98


def test_combined_is_the_weighted_mean_that_least_squares_gives():
    rng = np.random.default_rng(5)
    scanned = scanned_lines(the_footprint(3), HERE, 0.0)
    pictured = pictured_lines(the_faces(rng), FLOOR, Uncertainty())
    lines, shares, text = combined(scanned, pictured)
    inverse = [np.linalg.inv(one.covariance) for one in (scanned, pictured)]
    expected = np.linalg.solve(sum(inverse), inverse[0] @ scanned.x + inverse[1] @ pictured.x)
    np.testing.assert_allclose(lines.x, expected, rtol=1e-9)
    assert text == "" and shares.startswith("scan ") and "image" in shares


def test_one_face_finds_its_place_beside_two():
    both = Lines(X, np.diag([1e-6, 0.1, 0.1]))
    left = Lines(np.array([X[0] - np.pi / 2, X[2], np.nan]), np.diag([1e-6, 0.1, 0.0]))
    for a, b in ((both, left), (left, both)):
        lines, _, _ = combined(a, b)
        np.testing.assert_allclose(lines.x, X, atol=1e-9)
        assert lines.covariance[2, 2] < lines.covariance[1, 1]


def test_what_disagrees_is_said_with_both_values_and_not_mixed():
    pictured = Lines(X, np.diag([1e-6, 0.1, 0.1]))
    lines, shares, text = combined(Lines(X + np.array([0, 100, 100]), np.diag([1e-6, 0.1, 0.1])), pictured)
    assert lines is pictured and shares == "image" and f"{X[1] + 100:.0f} and {X[1]:.0f} mm" in text
    lines, _, text = combined(Lines(X + np.array([0, 0, 100]), np.diag([1e-6, 0.1, 0.1])), pictured)
    assert lines.seen == (0,) and lines.x[1] == pytest.approx(X[1]) and f"{X[2] + 100:.0f}" in text


def test_the_left_face_alone_becomes_the_right_one():
    alone = without(Lines(X, np.diag([1e-6, 0.1, 0.2])), 0)
    assert alone.seen == (0,) and alone.x[1] == X[2] and alone.covariance[1, 1] == 0.2
    np.testing.assert_allclose(alone.normal(0), Lines(X, np.eye(3)).normal(1), atol=1e-12)


def a_box(covariance=None):
    right, left = (
        np.array([700.0, 20.0]) + d
        for d in (300 * np.array([np.sin(X[0]), -np.cos(X[0])]), 200 * np.array([np.cos(X[0]), np.sin(X[0])]))
    )
    x = np.append(X, [np.arctan2(*right[::-1]), np.arctan2(*left[::-1])])
    return Fused(x, np.zeros((5, 5)) if covariance is None else covariance, {}, (False, False), "")


def test_corners_of_the_drawn_box():
    p = corners_mm(a_box().x)
    np.testing.assert_allclose(p[1], [700, 20], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(np.diff(p, axis=0), axis=1), [300, 200], atol=1e-9)
    thing = from_faces(a_box(), (250.0, 0.5), {}, 0.0)
    np.testing.assert_allclose(thing.size_mm, [300, 200, 250], atol=1e-9)
    np.testing.assert_allclose(thing.outline_mm.mean(axis=0), thing.position_mm)
    assert thing.volume_l[0] == pytest.approx(15) and np.degrees(thing.yaw_rad) == pytest.approx(-50)


def test_deviations_of_sizes_volume_and_surface_against_draws():
    spread = np.array([0.002, 0.6, 0.4, 0.0004, 0.0004])
    thing = from_faces(a_box(np.diag(spread**2)), (250.0, 0.5), {}, 0.0)
    rng = np.random.default_rng(8)
    sizes = []
    for x in a_box().x + rng.normal(0, 1, (4000, 5)) * spread:
        sizes.append(np.linalg.norm(np.diff(corners_mm(x), axis=0), axis=1))
    sizes = np.column_stack([sizes, 250 + rng.normal(0, 0.5, 4000)])
    np.testing.assert_allclose(thing.std_mm, sizes.std(axis=0), rtol=0.05)
    assert thing.volume_l[1] == pytest.approx(sizes.prod(axis=1).std() / 1e6, rel=0.05)
    area = 2 * (sizes[:, 0] + sizes[:, 1]) * sizes[:, 2] + sizes[:, 0] * sizes[:, 1]
    assert thing.surface_m2[1] == pytest.approx(area.std() / 1e6, rel=0.05)


def test_a_side_too_vague_is_refused_and_the_other_stays():
    thing = from_faces(a_box(np.diag([0, 0, 0, 0, 0.03**2])), (250.0, 0.5), {}, 0.0)
    assert thing.shape == "face" and np.isnan(thing.size_mm[0]) and thing.size_mm[1] == pytest.approx(300)
    assert "±" in thing.reasons["length"] and np.isnan(thing.volume_l[0]) and len(thing.outline_mm) == 2


def test_a_hidden_end_gives_no_size():
    hidden = Fused(a_box().x, np.zeros((5, 5)), {}, (True, True), "")
    thing = from_faces(hidden, (np.nan, np.nan), {}, 0.0)
    assert np.isnan(thing.size_mm).all() and "hidden" in thing.reasons["length"] and "hidden" in thing.reasons["width"]


def test_without_pictures_the_ends_come_from_the_scan():
    fused = fuse((np.zeros((480, 640), np.float32),) * 2, FLOOR, footprint=the_footprint(2), laser=HERE, bias_mm=0.0)
    assert fused.sources == {"lines": "scan", "right end": "scan", "left end": "scan"}
    thing = from_faces(fused, (np.nan, np.nan), {}, 0.0, worst_std=0.1)
    assert (np.abs(thing.size_mm - [300, 200, 0])[:2] < 2 * thing.std_mm[:2]).all() and np.isnan(thing.size_mm[2])
    assert from_faces(fused, (np.nan, np.nan), {}, 0.0).reasons["length"].startswith("too uncertain: 189 ± 10 mm")


def test_nothing_straight_fuses_to_nothing():
    assert fuse((np.zeros((480, 640), np.float32),) * 2, FLOOR) is None


def test_a_cylinder_s_volume_and_surface():
    std = np.array([1.0, 1.0, 2.0])
    C = np.outer(std, std) * [[1, 1, 0], [1, 1, 0], [0, 0, 1]]
    nothing = np.zeros(2)
    thing = MeasuredObject("circle", np.array([200.0, 200, 300]), C, nothing, np.eye(2), np.nan, np.nan, nothing[None])
    r = 100 + np.random.default_rng(1).normal(0, 0.5, 200_000)
    h = 300 + np.random.default_rng(2).normal(0, 2, 200_000)
    for told, drawn_values in (
        (thing.volume_l, np.pi * r**2 * h / 1e6),
        (thing.surface_m2, (2 * np.pi * r * h + np.pi * r**2) / 1e6),
    ):
        assert told[0] == pytest.approx(drawn_values.mean(), rel=1e-3) and told[1] == pytest.approx(
            drawn_values.std(), rel=0.02
        )


def test_the_laser_s_pose_on_the_floor():
    from stereolib.rig import rigid

    pose = recordings.setup() @ rigid(
        [[np.cos(0.1), -np.sin(0.1), 0], [np.sin(0.1), np.cos(0.1), 0], [0, 0, 1]], [-40, 25, 60]
    )
    laser = LaserOnFloor.of(SimpleNamespace(T_left_lidar=pose, covariance=np.diag([0, 0, 1e-4, 4.0, 1.0, 9.0])), FLOOR)
    assert laser.yaw_rad == pytest.approx(0.1, abs=1e-6)
    np.testing.assert_allclose(laser.t, [-40, 25], atol=1e-6)
    np.testing.assert_allclose(np.linalg.eigvalsh(laser.covariance[:2, :2]), [1, 4])
    assert laser.covariance[2, 2] == pytest.approx(1e-4)
