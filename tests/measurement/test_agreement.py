"""How far pictures agree: surfaces that end, are cut, are hidden, are plain in between; and over a drawn plane."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from support.boxes import FLOOR, RECT

from stereolib.measurement import Views
from stereolib.measurement.agreement import Agreement, Look, Past, Samples, agreement
from stereolib.measurement.box import Shared, World

N = 60


def lines(alike, contrast=None, matched=50.0, noise=0.0):
    """Correlations, one a line, on a surface of 50 px."""
    alike = np.asarray(alike, float)
    contrast = np.ones(N) if contrast is None else contrast
    there = np.broadcast_to(matched, N).astype(float)
    return Agreement(alike, alike, contrast, contrast, np.full(N, 50.0), there, there, np.full(N, noise))


def until(last, then):
    return np.where(np.arange(N) < last, 0.95, then)


def test_a_surface_that_ends():
    reach = lines(until(30, 0.1)).reach(16)
    assert reach.past is Past.OPEN and reach.last == 27 and reach.stop == 29  # two lines of the window go on
    assert lines(until(30, 0.7)).reach(16).last == 27  # in between nothing is told
    assert lines(until(0, 0.1)).reach(16).last < 0


def test_a_surface_that_the_picture_cuts():
    reach = lines(until(30, np.nan)).reach(16)
    assert reach.past is Past.CUT and reach.stop == 29


def test_a_surface_that_something_nearer_hides():
    matched = np.where(np.arange(N) < 30, 50.0, 70.0)
    assert lines(until(30, 0.1), matched=matched).reach(16).past is Past.HIDDEN
    farther = np.where(np.arange(N) < 30, 50.0, 30.0)
    assert lines(until(30, 0.1), matched=farther).reach(16).past is Past.OPEN
    unknown = np.where(np.arange(N) < 30, 50.0, np.nan)
    assert lines(until(30, 0.1), matched=unknown).reach(16).past is Past.OPEN


def test_beside_a_surface_something_nearer_is_nearer_than_what_was_matched_on_it():
    """Over what is plain, the map drifts away from a surface, and goes on as it did there."""
    at = np.arange(N)
    drifted = np.where(at < 12, 50.0, 54.0)
    assert lines(until(30, 0.1), matched=drifted).reach(16).past is Past.HIDDEN
    assert lines(until(30, 0.1), matched=drifted).reach(16, aside=True).past is Past.OPEN
    jumps = np.where(at < 30, drifted, 60.0)
    assert lines(until(30, 0.1), matched=jumps).reach(16, aside=True).past is Past.HIDDEN


@pytest.mark.parametrize(("matched", "hidden"), [(70.0, True), (56.0, False)])
def test_beside_a_surface_what_is_nearer_than_all_of_it_hides_it_where_some_lines_show_it(matched, hidden):
    at = np.arange(N)
    there = np.where(at < 30, 50.0, matched)
    covering = np.where((at >= 30) & (at < 40), np.nan, there)  # less than half of these lines was matched
    along = replace(lines(until(30, 0.1), matched=there), covering_px=covering)
    along = replace(along, predicted_px=np.linspace(58.0, 46.0, N))
    assert (along.reach(16, aside=True).past is Past.HIDDEN) is hidden
    assert along.reach(16).past is Past.OPEN


@pytest.mark.parametrize("elsewhere", [50.0, 30.0])
def test_beside_a_surface_what_agrees_again_behind_another_is_not_of_it(elsewhere):
    at = np.arange(N)
    gap = (at >= 24) & (at < 30)
    along = lines(np.where(gap, 0.0, until(44, 0.1)), matched=np.where(gap, elsewhere, 50.0))
    assert along.reach(16).last == 41
    assert along.reach(16, aside=True).last == (41 if elsewhere == 50.0 else 21)


def test_a_surface_that_disagrees_just_before_the_rim_is_cut():
    """There each line is compared with fewer neighbours."""
    nearly = np.where(np.arange(N) < 30, 0.95, np.where(np.arange(N) < 34, 0.5, np.nan))
    assert lines(nearly).reach(16).past is Past.OPEN
    assert lines(nearly).reach(16, aside=True).past is Past.CUT


@pytest.mark.parametrize(
    ("matched", "rim", "past"),
    [(50.0, 40, Past.CUT), (np.nan, 40, Past.CUT), (30.0, 40, Past.OPEN), (np.nan, 70, Past.OPEN)],
)
def test_near_the_rim_a_surface_that_disagrees_may_go_on_unless_something_farther_was_matched(matched, rim, past):
    """Noise and JPEG disagree where a face is nearly plain."""
    at = np.arange(80)
    alike = np.where(at < 20, 0.95, np.where(at < rim, 0.3, np.nan))
    there, flat = np.where(at < 24, 50.0, matched), np.ones(80)
    along = Agreement(alike, alike, flat, flat, 50 * flat, there, there, 0 * flat)
    assert along.reach(16, aside=True).past is past and along.reach(16, aside=True).last == 17
    assert along.reach(16).past is Past.OPEN


def test_the_disparity_of_a_line_is_that_of_what_both_pictures_show(wall):
    """At a rim they show a part of a line that leans."""
    views, world, plane = wall
    points = np.empty((40, 16, 3))
    points[..., 0], points[..., 2] = 800.0, np.linspace(50, 250, 16)
    points[..., 1] = np.linspace(150.0, 400.0, 40)[:, None] + np.linspace(0.0, 60.0, 16)  # over the right picture's rim
    found, inside = agreement(views, world, points), Samples.of(views, world, points).inside
    partly = inside.any(axis=1)
    assert (partly & ~inside.all(axis=1)).any()
    assert found.predicted_px[partly] == pytest.approx(plane[2] + plane[0] * 320, rel=0.1)


def test_an_edge_s_trace_has_no_texture_of_its_own():
    """Beside it, both pictures agree, as they would about a plain wall's shade."""
    at = np.arange(N)
    along = replace(lines(until(40, 0.1)), relief=np.where(at < 30, 1.0, 0.1))
    assert along.shows(16).sum() == 30 and along.shows(16)[:30].all()


def test_the_share_on_which_a_surface_was_matched():
    at = np.arange(N)
    matched = np.where(at < 20, 50.0, np.where(at < 30, 70.0, np.nan))
    assert lines(until(60, 0.1), matched=matched).matched_share() == pytest.approx(2 / 3)
    assert np.isnan(lines(until(60, 0.1), matched=np.nan).matched_share())


def test_a_plain_part_is_bridged():
    at = np.arange(N)
    plain = (at >= 20) & (at < 35)
    alike, contrast = np.where(plain, 0.0, until(50, 0.1)), np.where(plain, 0.05, 1.0)
    assert lines(alike, contrast).reach(16).last == 47
    assert lines(alike).reach(16).last == 17  # with contrast it is another surface
    ends_plain = lines(np.where(at >= 20, 0.0, 0.95), np.where(at < 40, np.where(at >= 20, 0.05, 1.0), 1.0)).reach(16)
    assert ends_plain.last == 17 and ends_plain.stop == 39  # somewhere in between


def test_what_is_no_more_than_noise_is_plain():
    """JPEG leaves something in parts that it made plain: it disagrees, and ends no surface."""
    at, unknown = np.arange(N), np.where(np.arange(N) < 20, 50.0, np.nan)
    left_over = (at >= 20) & (at < 35)
    alike, contrast = np.where(left_over, 0.0, until(45, 0.1)), np.where(left_over, 0.4, 1.0)
    assert lines(alike, contrast, unknown).reach(16).stop == 19
    assert lines(alike, contrast, unknown, noise=0.3).reach(16).last == 42


def test_what_is_behind_is_matched_over_a_plain_part_too():
    at = np.arange(N)
    plain = (at >= 20) & (at < 35)
    alike, contrast = np.where(plain, 0.0, until(45, 0.1)), np.where(plain, 0.1, 1.0)
    farther = np.where(plain, 30.0, 50.0)
    assert lines(alike, contrast, farther).reach(16).stop == 19
    assert lines(alike, contrast, farther, noise=0.1).reach(16).last == 42
    assert lines(alike, 6 * contrast, farther, noise=0.1).reach(16).stop == 19  # with texture it is another surface


def test_one_line_of_strong_contrast_makes_the_others_not_plain():
    """What is typical of a surface is told by all lines that are known to lie on it."""
    contrast = np.where(np.arange(N) == 0, 5.0, 1.0)
    assert lines(until(30, 0.1), contrast).reach(16) == lines(until(30, 0.1)).reach(16)


def test_a_surface_goes_on_beyond_a_faint_gap():
    at = np.arange(N)
    gap = (at >= 20) & (at < 25)
    assert lines(np.where(gap, 0.3, until(45, 0.1))).reach(16).last == 42
    assert lines(np.where(gap, 0.3, until(29, 0.1))).reach(16).last == 17  # a chance that is as short tells nothing
    assert lines(np.where(gap, 0.3, 0.1 + 0.0 * until(45, 0.1))).reach(16).last < 0


def test_lines_speak_for_a_surface_or_against_it():
    at = np.arange(N)
    contrast = np.where((at >= 20) & (at < 30), 0.05, 1.0)
    said = lines(until(40, 0.1), contrast).evidence()
    assert (
        (said[:20] > 0.3).all() and (said[20:30] == 0).all() and (said[30:40] > 0.3).all() and (said[40:] < -0.3).all()
    )
    farther = np.where((at >= 20) & (at < 30), 30.0, 50.0)
    assert (lines(until(20, 0.1), contrast, farther).evidence()[20:30] < 0).all()
    assert (lines(until(40, np.nan), contrast).evidence()[40:] == 0).all()


def test_noise_and_jpeg_end_nothing_where_the_surface_was_matched():
    """A part without print: what little is in it disagrees, but the disparity map has the surface there."""
    at = np.arange(N)
    blank = (at >= 20) & (at < 35)
    alike, contrast = np.where(blank, 0.2, until(50, 0.1)), np.where(blank, 0.5, 1.0)
    elsewhere = np.where(blank, np.nan, 50.0)
    assert lines(alike, contrast).reach(16).last == 47
    assert lines(alike, contrast, elsewhere).reach(16).last == 17  # nothing was matched: it ends there
    assert (lines(alike, contrast).evidence()[blank] == 0).all()
    assert (lines(alike, contrast, elsewhere).evidence()[blank] < 0).all()
    assert (lines(alike, matched=50.0).evidence()[blank] < 0).all()  # nor may what has as much contrast as all else


def test_a_surface_may_end_as_far_out_as_it_was_matched():
    at = np.arange(N)
    blank = lines(until(20, 0.1), matched=np.where(at < 45, 50.0, 30.0))
    reach = blank.reach(16)
    assert (reach.last, reach.stop, blank.carried_on(reach).stop) == (17, 19, 44)
    fattened = lines(until(20, 0.1), matched=np.where(at < 28, 50.0, 30.0))  # as blocks of pixels are matched
    assert fattened.carried_on(fattened.reach(16)).stop == 19
    gap = lines(until(20, 0.1), matched=np.where(at < 45, np.where((at > 25) & (at < 31), np.nan, 50.0), 30.0))
    assert gap.carried_on(gap.reach(16)).stop == 44
    cut = lines(until(30, np.nan))
    assert cut.carried_on(cut.reach(16)) == cut.reach(16)


def test_single_lines_that_disagree_end_nothing():
    alike = until(40, 0.1)
    alike[[10, 11, 20, 30]] = 0.0
    assert lines(alike).reach(16).last == 37


def test_a_surface_that_is_only_predicted_may_agree_less():
    alike = until(30, 0.1) - 0.35
    assert lines(alike).reach(16).last < 0 and lines(alike).reach(16, Look.SECOND).last == 27


def test_what_both_pictures_show_less_alike_is_held_against_itself():
    """As JPEG, noise or slants have it, of which the threshold of clean pictures leaves next to nothing."""
    rng = np.random.default_rng(0)
    faint = lines(until(30, 0.0) - 0.2 + rng.uniform(-0.06, 0.06, N))
    assert [faint.reach(16, look).last for look in (Look.FIRST, Look.AGAIN)] == [27, 27]
    slanted = lines(until(30, 0.0) - 0.42 + rng.uniform(-0.06, 0.06, N))
    assert slanted.reach(16).last < 5 and slanted.reach(16, Look.AGAIN).last == 27


def test_parts_may_run_backwards():
    alike = until(30, 0.1)[::-1]
    assert lines(alike).part(slice(None, None, -1)).reach(16) == lines(alike[::-1]).reach(16)


@pytest.fixture(scope="module")
def wall():
    """A textured wall 800 mm ahead, to the left of column 400 of the left picture; beside it another moment."""
    world = World.of(FLOOR, np.zeros(2), 0.0, np.zeros(len(Shared)))
    plane = world.disparity_plane(np.array([1.0, 0.0, 0.0]), np.array(800.0))
    texture = cv2.GaussianBlur(np.random.default_rng(3).normal(0, 1, (480, 900)), (0, 0), 1.5)
    texture = np.clip(128 + 45 * texture / texture.std(), 0, 255).astype(np.float32)
    u, v = np.meshgrid(np.arange(640, dtype=np.float32), np.arange(480, dtype=np.float32))
    source = (u + plane[1] * v + plane[2]) / (1 - plane[0])
    right = cv2.remap(texture, source.astype(np.float32), v, cv2.INTER_CUBIC)
    other = cv2.GaussianBlur(np.random.default_rng(4).normal(0, 1, (480, 640)), (0, 0), 1.5)
    right[source >= 400] = (128 + 45 * other / other.std())[source >= 400]
    left, right = (np.clip(picture, 0, 255).round().astype(np.uint8) for picture in (texture[:, :640], right))
    return Views.of_rectified(left, right), world, plane


def test_over_a_wall_pictures_agree_until_it_ends(wall):
    views, world, plane = wall
    columns = np.arange(300.0, 500.0)
    t = (world.centre_px[0] - columns) / RECT.f_px
    points = np.empty((len(t), 16, 3))
    points[..., 0], points[..., 1] = 800.0, 800.0 * t[:, None] * np.hypot(1, world.axes[0, 1] / world.axes[0, 2])
    points[..., 2] = np.linspace(50, 250, 16)
    found = agreement(views, world, points)
    u = world.pixels(points[:, 8])
    assert found.predicted_px == pytest.approx(plane[0] * u[:, 0] + plane[1] * u[:, 1] + plane[2], abs=1.0)
    inside = u[:, 0] < 395
    assert found.fine[inside].min() > 0.9 and np.nanmax(found.fine[u[:, 0] > 405]) < 0.6
    assert found.matched_px[inside] == pytest.approx(found.predicted_px[inside], abs=2)
    reach = found.reach(40)
    assert u[reach.last, 0] == pytest.approx(397, abs=2.5)


def test_behind_the_camera_and_outside_of_the_pictures_nothing_is_told(wall):
    views, world, _ = wall
    behind = np.tile([-500.0, 0.0, 100.0], (6, 16, 1))
    aside = np.tile([500.0, 900.0, 100.0], (6, 16, 1))
    for points in (behind, aside):
        assert np.isnan(agreement(views, world, points).fine).all()


def test_a_part_of_the_samples_is_compared_as_if_alone(wall):
    views, world, _ = wall
    points = np.empty((60, 16, 3))
    points[..., 0], points[..., 1] = 800.0, np.linspace(-50, 10, 60)[:, None]
    points[..., 2] = np.linspace(50, 250, 16)
    some = Samples.of(views, world, np.stack([points, points + 5.0])).part(slice(4))
    alone = agreement(views, world, points[:, :4])
    assert some.correlations[0, :, 1] == pytest.approx(alone.fine, rel=1e-5)
    assert Samples.of(views, world, points).part(slice(4)).agreement().contrast == pytest.approx(
        alone.contrast, rel=1e-5
    )


@pytest.mark.parametrize(("shared", "past"), [(0.2, Past.OPEN), (1.0, Past.HIDDEN)])
def test_what_few_pixels_beyond_an_end_were_matched_with_hides_nothing(wall, shared, past):
    """Beside an end one camera alone sees what is behind: single pixels there are matched with anything."""
    views, world, _ = wall
    points = np.empty((160, 16, 3))
    points[..., 0], points[..., 1] = 800.0, np.linspace(40.0, -120.0, 160)[:, None]  # over the wall's end
    points[..., 2] = np.linspace(50, 250, 16)
    seen = Samples.of(views, world, points)
    ends = agreement(views, world, points).reach(40).last
    matched = np.full_like(seen.matched_px, np.nan)
    matched[: ends + 3] = seen.matched_px[: ends + 3]
    matched[ends + 3 :, : round(shared * 16)] = seen.predicted_px[ends + 3 :, : round(shared * 16)] + 9.0
    reach = replace(seen, matched_px=matched).agreement().reach(40)
    assert reach.past is past and reach.last == ends


@pytest.mark.parametrize(("samples", "hides"), [(2, False), (4, False), (6, True), (10, True)])
def test_what_is_matched_nearer_in_less_than_half_of_a_line_hides_no_end(samples, hides):
    """As the floor before a face's foot; a quarter is enough to tell that something farther shows."""
    matched = np.full((N, 10), np.nan, np.float32)
    matched[:, :samples] = 60.0
    texture = np.random.default_rng(4).normal(size=(N, 10, 2)).astype(np.float32)
    other = np.where((np.arange(N) < 30)[:, None, None], texture, -texture)
    flat = np.ones((N, 10), np.float32)
    seen = Samples(texture, other, flat, flat > 0, 50 * flat, matched, 0.0).agreement()
    assert np.isfinite(seen.matched_px).all() == (samples > 2)
    assert seen.reach(20).past is (Past.HIDDEN if hides else Past.OPEN)


@pytest.mark.parametrize("lines", [1, 2])
def test_a_face_of_hardly_a_line_is_followed_nowhere(lines):
    """As a floor that was told far too steep makes it."""
    flat = np.ones(lines)
    reach = Agreement(flat, flat, flat, flat, flat, flat, flat, flat).reach(0)
    assert reach.last <= 0 and reach.past is Past.OPEN
