"""Lengths between two pixels, against the virtual rig's truth."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from support.corners import corner_set

from stereolib.base import Float64
from stereolib.calibration import fit_rig, rig_covariance
from stereolib.measurement import (
    Instrument,
    SurfacePoint,
    SystematicUncertainty,
    Views,
    find_surface,
    length_between,
    match_views,
    measure_between,
)
from stereolib.paper import paper_rig
from stereolib.virtual import Truth, recordings

RECTIFIED = recordings.rectified()


def seen(name: str) -> tuple[Views, np.ndarray, Truth]:
    views = Views.of(*recordings.load_pair(name), RECTIFIED)
    return views, match_views(views), recordings.load_truth(name)


def pairs_of_pixels(truth: Truth, count: int) -> Float64:
    """Of the cube, in random pairs."""
    on = np.argwhere(np.isfinite(truth.disparity_px) & truth.visible & (truth.box == 1))[:, ::-1]
    return on[np.random.default_rng(3).integers(len(on), size=(count, 2))].astype(float)


def off_and_std(name: str, count: int = 80) -> Float64:
    """Errors of lengths picked to half a pixel, and their deviations, mm, of those that are not refused."""
    views, map_px, truth = seen(name)
    rng = np.random.default_rng(5)
    found = []
    for pixels in pairs_of_pixels(truth, count):
        ends = [SurfacePoint(at, float(truth.disparity_px[int(at[1]), int(at[0])]), 0.0) for at in pixels]
        true_mm = measure_between(*ends, RECTIFIED).length_mm
        try:
            told = measure_between(
                *(find_surface(views, map_px, at + rng.normal(0, 0.5, 2)) for at in pixels), RECTIFIED
            )
        except ValueError:
            continue
        found.append((told.length_mm - true_mm, told.std_mm))
    return np.array(found).reshape(-1, 2)


@pytest.mark.parametrize(
    ("name", "least", "typical_mm"),
    [("conditions/texture", 60, 0.9), ("conditions/glare", 30, 1.1), ("series/coarse_1000", 60, 1.5)],
)
def test_lengths_on_the_cube(name: str, least: int, typical_mm: float) -> None:
    off, std = off_and_std(name).T
    assert len(off) >= least and np.median(np.abs(off)) < typical_mm
    assert np.mean(np.abs(off) < 1.96 * std) >= 0.9
    assert np.median(std) < 3 * typical_mm  # and not by saying nothing


@pytest.mark.parametrize("name", ["conditions/texture", "conditions/glare", "series/coarse_1000"])
def test_points_are_within_their_deviations_more_often_than_by_chance(name: str) -> None:
    """As the README says of the intervals: on the wide side, where chance would leave 68 %."""
    views, map_px, truth = seen(name)
    inside = []
    for at in pairs_of_pixels(truth, 100).reshape(-1, 2):
        try:
            found = find_surface(views, map_px, at)
        except ValueError:
            continue
        inside.append(abs(found.disparity_px - truth.disparity_px[int(at[1]), int(at[0])]) < found.std_px)
    assert len(inside) > 100 and np.mean(inside) > 0.88


@pytest.mark.parametrize("near_px", [55, 70])
def test_what_the_half_size_saw_is_inside_the_window(near_px: int) -> None:
    """Also where the next larger window is needed for it."""
    rng, views = np.random.default_rng(2), seen("conditions/texture")[0]
    right = cv2.GaussianBlur(rng.integers(0, 256, (120, 320, 3), np.uint8), (0, 0), 1.0)
    left = np.roll(right, near_px, axis=1)
    half = np.full((120, 320), near_px, np.float32)
    found = match_views(replace(views, left=left, right=right, disparity_px=half))
    assert np.mean(np.abs(found[20:100, 120:300] - near_px) < 0.5) > 0.9


@pytest.mark.parametrize(("name", "most"), [("conditions/plain", 2), ("conditions/poor_light", 30)])
def test_what_shows_too_little_is_refused(name: str, most: int) -> None:
    off, std = off_and_std(name).T
    assert len(off) <= most and (np.abs(off) < 3 * std).all()


@pytest.mark.parametrize("name", ["conditions/texture", "room/4"])
def test_a_pixel_that_the_right_camera_does_not_see_is_refused_as_such(name: str) -> None:
    """Where only the left one sees it, and not where both do, be it as plain as it may."""
    views, map_px, truth = seen(name)
    known, rng = np.isfinite(truth.disparity_px), np.random.default_rng(4)
    share = {}
    for both_see in (False, True):
        some = np.argwhere(known & (truth.visible == both_see))[:, ::-1]
        said = []
        for at in some[rng.integers(len(some), size=120)]:
            try:
                find_surface(views, map_px, at)
            except ValueError as error:
                said.append("the right camera" in str(error))
        share[both_see] = np.mean(said)
    assert len(said) > 20 and share[False] > 0.8 and share[True] < 0.2


def test_the_edge_of_the_cube_between_two_marks() -> None:
    views, map_px, _ = seen("conditions/texture")
    setup = recordings.setup()
    top_and_foot = np.array([(700.0, 0.0, z) for z in (20.0, 280.0)])
    seen_mm = (top_and_foot @ setup[:3, :3].T + setup[:3, 3]) @ RECTIFIED.R1.T
    pixels = seen_mm @ RECTIFIED.P1[:, :3].T
    found = measure_between(*(find_surface(views, map_px, at[:2] / at[2]) for at in pixels), RECTIFIED)
    assert found.length_mm == pytest.approx(260.0, abs=2 * found.std_mm) and found.std_mm < 3


def test_the_deviation_is_what_chance_does_to_the_length() -> None:
    """Pixels picked to half a pixel, on surfaces that slope, disparities and calibration by their deviations."""
    rng, n = np.random.default_rng(8), 20_000
    known = SystematicUncertainty(3.0, 0.2, 0.15, correlation=(0.5, -0.3, 0.2))
    ends = [SurfacePoint(np.array([250.0, 180]), 85.0, 0.2, slope=np.array([0.4, 0.1])),
            SurfacePoint(np.array([420.0, 330]), 70.0, 0.3)]  # fmt: skip
    told = measure_between(*ends, RECTIFIED, known).std_mm
    f, B, offset = rng.multivariate_normal([RECTIFIED.f_px, RECTIFIED.baseline_mm, 0], known.covariance, n).T
    places = []
    for end in ends:
        picked = rng.normal(0, 0.5, (n, 2))
        u, v = (end.pixel + picked).T
        depth = f * B / (end.disparity_px + picked @ end.slope + rng.normal(0, end.std_px, n) - offset)
        places.append(np.stack([(u - RECTIFIED.P1[0, 2]) / f * depth, (v - RECTIFIED.P1[1, 2]) / f * depth, depth]))
    assert np.linalg.norm(places[0] - places[1], axis=0).std() == pytest.approx(told, rel=0.03)


def test_the_calibration_widens_the_interval() -> None:
    one, other = SurfacePoint(np.array([300.0, 200]), 80.0, 0.05), SurfacePoint(np.array([300.0, 400]), 80.0, 0.05)
    bare = measure_between(one, other, RECTIFIED)
    known = measure_between(one, other, RECTIFIED, SystematicUncertainty(baseline_mm=0.01 * RECTIFIED.baseline_mm))
    assert known.length_mm == bare.length_mm
    assert known.std_mm == pytest.approx(np.hypot(bare.std_mm, 0.01 * bare.length_mm), rel=1e-3)


def test_errors_from_place_to_place_take_the_place_of_those_of_the_whole_picture() -> None:
    fit = fit_rig(corner_set(np.random.default_rng(5), rig=paper_rig(), noise_px=0.15), paper_rig())
    rectified, covariance = fit.rig.rectify(), rig_covariance(fit)
    known = SystematicUncertainty.of(rectified, covariance)
    one, other = SurfacePoint(np.array([560.0, 60]), 80.0, 0.05), SurfacePoint(np.array([600.0, 400]), 80.0, 0.05)
    bare = measure_between(one, other, rectified)
    found = measure_between(one, other, rectified, known, columns_std_px=0.2)
    moved = np.subtract(*known.errors.of_points(*np.array([[560.0, 60, 80], [600, 400, 80]]).T))
    along = np.subtract(*bare.points_mm) / bare.length_mm @ moved
    shift = 0.2 / 80 * bare.length_mm  # of both disparities alike
    assert found.std_mm == pytest.approx(np.sqrt(bare.std_mm**2 + along @ along + shift**2), rel=1e-3)


def test_what_cannot_be_told() -> None:
    views, map_px, _ = seen("conditions/texture")
    with pytest.raises(ValueError, match=r"pixel 900,10 of the rectified left picture is outside what is left"):
        find_surface(views, map_px, (900, 10))
    with pytest.raises(ValueError, match="is outside what is left of the picture"):
        find_surface(views, map_px, (np.nan, 10))
    with pytest.raises(
        ValueError, match="pixel 300,200 of the rectified left picture: nothing was matched there: too little texture"
    ):
        find_surface(views, np.full_like(map_px, np.nan), (300, 200))
    lonely = np.full_like(map_px, np.nan)
    lonely[200, 300] = 50
    with pytest.raises(ValueError, match="pixel 300,200 of the rectified left picture: hardly anything was matched"):
        find_surface(views, lonely, (300, 200))
    for far_px in (-0.5, 0.0):
        far = SurfacePoint(np.array([10.0, 10.0]), far_px, 0.1)
        with pytest.raises(
            ValueError, match=rf"pixel 10,10 of the rectified left picture has a disparity of {far_px} px: too far"
        ):
            measure_between(far, far, RECTIFIED)


def test_pixels_of_either_frame_make_the_same_length_and_are_named_as_they_were_given() -> None:
    pair, instrument = recordings.load_pair("conditions/texture"), Instrument(RECTIFIED)
    raw = np.array([[330.0, 330.0], [332.0, 200.0]])
    flat = RECTIFIED.rectify_points(raw, "left")
    assert np.abs(flat - raw).max() > 5  # so that taking one for the other would show
    one = length_between(*pair, raw, instrument)
    np.testing.assert_allclose(length_between(*pair, flat, instrument, is_rectified=True).points_mm, one.points_mm)
    assert abs(length_between(*pair, raw, instrument, is_rectified=True).length_mm - one.length_mm) > 2 * one.std_mm
    with pytest.raises(ValueError, match=r"pixel 5000,10\.5 is outside the left picture, which is 640x480"):
        length_between(*pair, [(5000, 10.5), (330, 200)], instrument)
    corner = [(0.0, 0.0), (330.0, 200.0)]
    assert not ((RECTIFIED.rectify_points(corner, "left")[0] >= 0).all())
    with pytest.raises(ValueError, match=r"^pixel 0,0 of the left picture is outside what is left"):
        length_between(*pair, corner, instrument)
    dark = tuple(np.zeros_like(side) for side in pair)
    with pytest.raises(ValueError, match=r"^pixel 330,330 of the left picture: no texture"):
        length_between(*dark, raw, instrument)


def test_one_point_has_no_length():
    point = SurfacePoint(np.array([300.0, 200.0]), 100.0, 0.1)
    with pytest.raises(ValueError, match="both ends are pixel 300,200 of the rectified left picture: a length has two"):
        measure_between(point, replace(point, std_px=0.2), RECTIFIED)
