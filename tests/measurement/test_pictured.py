"""One box in both pictures: sizes and place against the virtual rig's truth; what does not stand is refused."""

from __future__ import annotations

import re
from dataclasses import replace
from unittest.mock import Mock

import cv2
import numpy as np
import pytest
from support.boxes import OWN
from support.pictured import HIGH, masks, of_pair, recorded, rendered, true_box

from stereolib.measurement import CannotMeasure, ObjectRegion, Reason, outline, pictured
from stereolib.measurement.agreement import Past
from stereolib.measurement.box import Box, Edge, Level, Own, Shared, Side
from stereolib.measurement.edges import STEP_PX, Peak
from stereolib.measurement.follow import follow_face, look_round
from stereolib.measurement.observations import EdgeSeen, PlaneSeen
from stereolib.measurement.outline import Expected, Found, find_edge, level_tops, of_one_height
from stereolib.measurement.pictured import _move, see_box
from stereolib.virtual import recordings

SERIES = [f"series/{kind}_{mm}" for kind in recordings.TEXTURES_MM for mm in recordings.DISTANCES_MM[1::2]]
CUBE = np.array([0.0, 0.0, np.pi / 4, 300.0, 300.0, 300.0, 0.0, 0.0])
SIX = slice(0, Own.RIGHT_BIAS)


def z(seen, true):
    std = np.sqrt(np.diag(seen.solution.covariance))[len(Shared) :]
    return ((seen.own - true) / std)[SIX]


def test_the_recorded_cubes_within_their_deviations():
    scores = []
    for name in SERIES:
        seen, true = recorded(name).box(), CUBE.copy()
        true[Own.X] = float(name.split("_")[1])
        assert not seen.refused and not seen.doubtful and len(seen.faces) == 2
        assert np.abs(seen.own - true)[[Own.RIGHT, Own.LEFT, Own.HEIGHT]].max() < 1.5
        assert {Edge.CORNER, Edge.RIGHT_END, Edge.LEFT_END, Edge.TOP_RIGHT, Edge.TOP_LEFT} == set(seen.past)
        assert set(seen.past.values()) == {Past.OPEN} and len(seen.edges) == 5
        scores.append(z(seen, true))
    assert 0.4 < np.sqrt(np.mean(np.square(scores))) < 1.6 and np.abs(scores).max() < 4.5


def test_a_sliver_tells_the_depth():
    case = (700.0, (260.0, 260.0, 220.0), -13.0)
    seen, true = rendered(*case).box(), true_box(*case)
    assert seen.first is Side.LEFT and np.abs(z(seen, true)).max() < 4
    assert 0 < seen.solution.covariance[-5, -5] < 8.0**2


@pytest.mark.parametrize(("yaw_deg", "lateral", "right"), [(-3.0, 60.0, True), (4.0, -120.0, False)])
def test_a_sliver_that_one_camera_sees_tells_the_depth_by_its_far_edge(yaw_deg, lateral, right):
    case = (700.0, (260.0, 260.0, 220.0), yaw_deg)
    shown = rendered(*case, lateral=lateral)
    seen = shown.box()
    depth = seen.first.other.extent
    std = np.sqrt(np.diag(seen.solution.covariance))[len(Shared) :]
    assert seen.edges[seen.first.other.end].right is right and look_round_is_vain(shown)
    assert abs(seen.own[depth] - 260) < min(3 * std[depth], 20) and std[depth] < 10


def look_round_is_vain(shown):
    stretch = shown.stretch()
    return all(look_round(shown.views, shown.world, stretch, outwards) is None for outwards in (-1, 1))


@pytest.mark.parametrize(("yaw_deg", "lateral"), [(-3.0, 60.0), (4.0, -120.0)])
def test_the_upper_edge_of_a_sliver_tells_its_depth_better_than_its_width(yaw_deg, lateral):
    """How far a sliver goes back hangs on the turn of the face beside it; where its top ends does not."""
    case = (900.0, (140.0, 260.0, 330.0), yaw_deg)
    shown = rendered(*case, lateral=lateral)
    seen = shown.box()
    depth, std = seen.first.other.extent, np.sqrt(np.diag(seen.solution.covariance))[len(Shared) :]
    assert seen.first.other.top in seen.edges and seen.edges[seen.first.other.top].right is (lateral > 0)
    assert abs(seen.own[depth] - 140) < 3 * std[depth] and std[depth] < 10


@pytest.mark.parametrize(
    ("distance", "size_mm", "yaw_deg"), [(600.0, (110.0, 220.0, 400.0), -3.0), (560.0, (190.0, 200.0, 380.0), -4.0)]
)
def test_no_upper_edge_of_a_sliver_is_looked_for_where_the_picture_ends_below_the_top(distance, size_mm, yaw_deg):
    seen = rendered(distance, size_mm, yaw_deg, lateral=60.0).box()
    assert seen.first.other.end in seen.edges and seen.past[seen.first.top] is Past.CUT
    assert seen.past[seen.first.other.top] is Past.CUT and seen.first.other.top not in seen.edges
    assert np.sqrt(np.diag(seen.solution.covariance))[len(Shared) + Own.HEIGHT] > 500  # nobody sees it


def test_a_face_ends_no_nearer_than_its_upper_edge():
    """Beyond a line on it the pictures disagree, as glare and fine patterns make them; its top tells where it ends."""
    case = (700.0, (260.0, 260.0, 220.0), 30.0)
    shown, own = rendered(*case), true_box(*case)
    line, rng, pictures = own.copy(), np.random.default_rng(5), [p.copy() for p in shown.views.pair.pictures]
    line[Own.RIGHT] *= 0.5
    for right, picture in enumerate(pictures):
        at, end = (shown.world.pixels(Box(x).edge(Edge.RIGHT_END), bool(right)) for x in (line, own))
        beyond, ink = np.zeros(picture.shape[:2], np.uint8), np.zeros(picture.shape[:2], np.uint8)
        cv2.fillPoly(beyond, [np.rint([*at, *end[::-1]]).astype(int)], 1)
        cv2.line(ink, *np.rint(at).astype(int).tolist(), 1, 3)
        noise = cv2.GaussianBlur(rng.normal(0, 60, picture.shape[:2]), (0, 0), 1.5)
        grey = picture[beyond == 1].mean(axis=0)
        picture[beyond == 1] = np.clip(grey + noise[beyond == 1, None], 0, 255)
        picture[ink == 1] = 30
    seen = of_pair(*pictures).box()
    std = np.sqrt(np.diag(seen.solution.covariance))[len(Shared) :]
    assert abs(seen.own[Own.RIGHT] - own[Own.RIGHT]) < max(3 * std[Own.RIGHT], 3.0)


@pytest.mark.parametrize("inside_mm", [12.0, 16.0, 25.0])
def test_a_line_printed_on_a_face_is_not_its_end(inside_mm):
    """It stands out more than the end does, but both pictures agree about the face beyond it."""
    case, expected = (700.0, (260.0, 260.0, 220.0), 30.0), Expected(1.5, low_px=-25.0, high_px=5.0)
    shown, own = rendered(*case), true_box(*case)
    printed, pictures = own.copy(), [picture.copy() for picture in shown.views.pair.pictures]
    printed[Own.RIGHT] -= inside_mm
    for right, picture in enumerate(pictures):
        ink = np.zeros(picture.shape[:2], np.uint8)
        ends = shown.world.pixels(Box(printed).edge(Edge.RIGHT_END), bool(right))
        cv2.line(ink, *np.rint(16 * ends).astype(int).tolist(), 255, 3, cv2.LINE_AA, 4)
        picture[:] = np.rint(picture * (1 - 0.3 * ink[..., None] / 255))
    found = find_edge(of_pair(*pictures).views, shown.world, own, Edge.RIGHT_END, Side.RIGHT, expected)
    assert abs(found.peak.position_px) < 0.5


@pytest.mark.parametrize("below_mm", [15.0, 20.0, 30.0])
def test_a_line_below_the_plain_rim_of_one_face_is_not_its_top(below_mm):
    """It stands out more than the upper edge over the rim does, but the other face is higher."""
    case = (700.0, (260.0, 260.0, 160.0), 40.0)
    shown, own = rendered(*case), true_box(*case)
    printed, pictures = own.copy(), [picture.copy() for picture in shown.views.pair.pictures]
    printed[Own.HEIGHT] -= below_mm
    for right, picture in enumerate(pictures):
        top, line = (shown.world.pixels(Box(x).edge(Edge.TOP_LEFT), bool(right)) for x in (own, printed))
        rim, ink = np.zeros(picture.shape[:2], np.uint8), np.zeros(picture.shape[:2], np.uint8)
        cv2.fillPoly(rim, [np.rint([*line, *top[::-1]]).astype(int)], 1)
        picture[rim == 1] = picture[rim == 1].mean(axis=0)
        cv2.line(ink, *np.rint(16 * line).astype(int).tolist(), 255, 3, cv2.LINE_AA, 4)
        picture[:] = np.rint(picture * (1 - 0.8 * ink[..., None] / 255))
    seen = of_pair(*pictures).box()
    std = np.sqrt(np.diag(seen.solution.covariance))[len(Shared) + Own.HEIGHT]
    assert abs(seen.own[Own.HEIGHT] - own[Own.HEIGHT]) < 4 * std < 3.0


def odds_of(place_mm, *rivals, reach_mm=40.0):
    """Odds along an edge with a peak of logarithm 0, and others of (place, logarithm), a millimetre to the pixel."""
    along = np.arange(-reach_mm, reach_mm + STEP_PX, STEP_PX)
    log_odds = np.max([at - np.abs(along - mm) for mm, at in ((place_mm, 0.0), *rivals)], axis=0)
    move = np.zeros(len(Own))
    move[Own.HEIGHT] = place_mm
    seen = EdgeSeen.through(Edge.TOP_LEFT, np.zeros(2), np.array([10.0, 0.0]), right=False)
    return Found(seen, Peak(place_mm, 0.1, 5.0, 0.0, log_odds), move, along)


def test_two_upper_edges_have_the_height_that_is_likeliest_for_both():
    line, edge = odds_of(0.0, (20.0, -3.0)), odds_of(20.0, (0.0, -9.0))
    assert line.mm_per_px == pytest.approx(1.0)
    higher, rivals = of_one_height([line, edge])
    assert higher == 20.0 and rivals < 2.0
    assert of_one_height([edge, line])[0] == 20.0
    assert of_one_height([edge])[0] == 20.0


def test_where_one_edge_was_not_looked_for_it_is_as_likely_as_at_the_end_of_where_it_was():
    """Another height outvotes none that stands out, and remains a rival: nobody looked there."""
    unsure, near = odds_of(0.0, (20.0, -0.1)), odds_of(1.0, reach_mm=4.0)
    higher, rivals = of_one_height([unsure, near])
    assert higher in (0.0, 1.0) and rivals > 8
    clear = replace(near, peak=replace(near.peak, log_odds=6 * near.peak.log_odds))
    higher, rivals = of_one_height([odds_of(-20.0), clear])
    assert higher == 1.0 and rivals > 10


def test_an_upper_edge_that_was_a_line_is_looked_for_again_at_the_height_of_the_other(monkeypatch):
    """And keeps the rivals that both had before, in whatever stretch it is looked for now."""
    own, tops = np.full(len(Own), 100.0), (Edge.TOP_RIGHT, Edge.TOP_LEFT)
    found = dict(zip(tops, (odds_of(0.0, (20.0, -3.0)), odds_of(20.0, (0.0, -9.0))), strict=True))
    monkeypatch.setattr(outline, "find_edge", lambda *where: odds_of(0.5, reach_mm=4.0))
    now = level_tops(None, None, own, Side.RIGHT, found, {})
    assert [now[edge].move[Own.HEIGHT] for edge in tops] == [20.5, 20.0]
    assert max(each.peak.std_px for each in now.values()) < 2.0
    then = level_tops(None, None, own, Side.RIGHT, found, {Edge.TOP_LEFT: 15.0})
    assert min(each.peak.std_px for each in then.values()) >= 15.0


@pytest.mark.parametrize("inside_mm", [0.0, 20.0, 30.0])
def test_a_streak_on_a_top_is_not_told_as_its_back_edge(inside_mm):
    """It stands out more, but both pictures agree about the top beyond it: no wrong place is told as sure."""
    case, expected = (620.0, (220.0, 330.0, 130.0), -25.0), Expected(1.5, low_px=-12.0, high_px=4.0)
    shown, own = rendered(*case, camera=HIGH), true_box(*case)
    streak, pictures = own.copy(), [picture.copy() for picture in shown.views.pair.pictures]
    streak[Own.LEFT] -= inside_mm
    for right, picture in enumerate(pictures if inside_mm else ()):
        ink = np.zeros(picture.shape[:2], np.uint8)
        ends = shown.world.pixels(Box(streak).edge(Edge.BACK_RIGHT), bool(right))
        cv2.line(ink, *np.rint(16 * ends).astype(int).tolist(), 255, 2, cv2.LINE_AA, 4)
        picture[:] = np.rint(picture * (1 - 0.5 * ink[..., None] / 255))
    found = find_edge(of_pair(*pictures).views, shown.world, own, Edge.BACK_RIGHT, Side.LEFT, expected)
    assert abs(found.peak.position_px) < 3 * found.peak.std_px
    assert inside_mm == 20 or abs(found.peak.position_px) < 0.2  # that one is told, but unsurely


def test_the_top_tells_the_height_where_its_edges_were_not_located(monkeypatch):
    """The camera looks down on it: both pictures show its plane."""
    case = (620.0, (220.0, 330.0, 130.0), -25.0)
    shown, true = rendered(*case, camera=HIGH), true_box(*case)

    def no_upper_edge(views, world, own, edge, *rest):
        return None if edge.is_top or edge.is_back else find_edge(views, world, own, edge, *rest)

    monkeypatch.setattr(pictured, "find_edge", no_upper_edge)
    seen = shown.box()
    std = np.sqrt(np.diag(seen.solution.covariance))[len(Shared) + Own.HEIGHT]
    assert std < 1.0 and abs(seen.own[Own.HEIGHT] - true[Own.HEIGHT]) < 3 * std
    monkeypatch.setattr(pictured, "align_surface", lambda *args: [])
    assert np.sqrt(np.diag(shown.box().solution.covariance))[len(Shared) + Own.HEIGHT] > 2 * std


@pytest.mark.parametrize(("distance", "has"), [(620.0, True), (800.0, False)])
def test_a_top_of_a_few_rows_has_no_plane_of_its_own(distance, has):
    """13 px high it has one row of the cells whose scatter tells how well it is aligned."""
    seen = rendered(distance, (110.0, 200.0, 380.0), -25.0, camera=HIGH).box()
    planes = [o.surface for o in seen.seen.observations if isinstance(o, PlaneSeen)]
    assert (Level.TOP in planes) is has and set(Side) & set(planes)


def test_a_stretch_is_looked_for_in_the_pixels_of_the_picture_that_measures():
    wide = Expected(1.5, low_px=-3.0, high_px=9.0, plain_px=3.0).zoomed(2.0)
    assert wide.places()[[0, -1]] == pytest.approx([-10.5, 22.5]) and wide.std_px == 1.5
    assert wide.belief(np.array([6.0])) == 1.0


def test_a_top_from_above_tells_the_depth():
    case = (620.0, (220.0, 330.0, 130.0), -25.0)
    seen, true = rendered(*case, camera=HIGH).box(), true_box(*case)
    assert np.abs(z(seen, true)).max() < 4 and {Edge.BACK_RIGHT, Edge.BACK_LEFT} & set(seen.edges)


@pytest.mark.parametrize(
    ("distance", "size_mm", "pitch_deg", "height_mm"),
    [(780.0, (190.0, 220.0, 120.0), -42.0, 850.0), (630.0, (240.0, 350.0, 130.0), -38.0, 620.0)],
)
def test_the_edges_of_a_top_that_run_on_from_those_of_a_face_are_not_its_own(distance, size_mm, pitch_deg, height_mm):
    """Seen straight from the front and steeply from above, both nearly lie in line."""
    case, steep = (distance, size_mm, 90.0), (np.radians(pitch_deg), height_mm)
    seen, true = rendered(*case, camera=steep).box(), true_box(*case)
    assert seen.own[Own.HEIGHT] == pytest.approx(true[Own.HEIGHT], rel=0.02) and seen.refused is None


def test_an_end_outside_of_the_picture_is_not_told():
    seen = rendered(520.0, (260.0, 260.0, 220.0), 30.0, lateral=230.0).box()
    side = seen.first
    assert seen.past[side.end] is Past.CUT and side.end not in seen.edges
    std = np.sqrt(np.diag(seen.solution.covariance))[len(Shared) :]
    assert std[side.extent] > 500 and std[Own.HEIGHT] < 1  # its height is known


@pytest.mark.parametrize(
    ("how", "reasons"),
    [
        ({"up_mm": 60.0}, {Reason.IN_THE_AIR}),
        ({"lean_deg": 8.0}, {Reason.LEANS, Reason.IN_THE_AIR}),
        ({"lean_deg": -8.0}, {Reason.LEANS, Reason.IN_THE_AIR}),
    ],
)
def test_what_does_not_stand_is_refused(how, reasons):
    refused = rendered(700.0, (260.0, 260.0, 220.0), 30.0, **how).box().refused
    assert refused.reason in reasons and refused.seen
    if "up_mm" in how:
        assert re.search(r"\b(59|60|61) mm above the floor", refused.seen)


@pytest.mark.parametrize("up_mm", [0.0, 40.0])
def test_what_is_too_plain_to_be_followed_to_its_foot_stands_if_its_upright_edges_go_down_to_the_floor(up_mm):
    """The lower part of its faces is painted, but for what lies beside its outline; held above it, it ends there."""
    case, low_mm = (700.0, (260.0, 260.0, 220.0), 30.0), 60.0
    shown, own = rendered(*case, up_mm=up_mm), true_box(*case)
    lower = own.copy()
    lower[Own.HEIGHT] = up_mm + low_mm
    plain = []
    for picture, inside in zip((shown.views.left, shown.views.right), masks(shown, lower), strict=True):
        foot = own.copy()
        foot[Own.HEIGHT] = max(up_mm, 1.0)
        kept = cv2.erode(inside.astype(np.uint8), np.ones((5, 5))) > cv2.dilate(
            masks(shown, foot)[len(plain)].astype(np.uint8) * (up_mm > 0), np.ones((5, 5))
        )
        painted = picture.copy()
        painted[kept] = np.median(picture[inside], axis=0)
        plain.append(painted)
    seen = of_pair(*plain).box()
    if up_mm:
        assert seen.refused.reason is Reason.IN_THE_AIR
    else:
        assert seen.refused is None and np.abs(seen.own - own)[SIX][3:].max() < 2.0


def test_a_box_whose_edges_are_sharp_and_upright_does_not_lean_to_the_side(monkeypatch):
    """Nor one of which two faces are upright, however its face was followed; one that shows one face alone may lean."""
    shown = rendered(700.0, (260.0, 260.0, 220.0), 30.0)

    def turned(*args):
        return replace(follow_face(*args), lean_rad=np.radians(20), lean_std_rad=np.radians(1))

    monkeypatch.setattr(pictured, "follow_face", turned)
    assert shown.box().refused is None

    def blurred(views, world, own, edge, *rest):
        found = find_edge(views, world, own, edge, *rest)
        if found is None:
            return None
        wide = 2.0 if edge.upright else found.peak.std_px
        return replace(found, seen=replace(found.seen, std_px=wide), peak=replace(found.peak, std_px=wide))

    monkeypatch.setattr(pictured, "find_edge", blurred)
    assert shown.box().refused is None
    for lean_deg in (-5.0, 5.0):
        assert rendered(700.0, (260.0, 260.0, 220.0), 30.0, lean_deg=lean_deg).box().refused
    monkeypatch.setattr(pictured, "align_surface", lambda *_: [])
    refused = shown.box().refused
    assert refused.reason is Reason.LEANS and "to the side" in refused.seen
    monkeypatch.setattr(pictured, "follow_face", follow_face)
    refused = shown.box().refused
    assert refused.reason is Reason.MAY_LEAN and "no upright edge" in refused.seen


def test_of_edges_that_tell_the_same_size_the_mean_is_taken():
    """Two upper edges 4 and 6 mm too low make a box 5 mm higher; an edge that says nothing of it does not count."""
    moves = np.zeros((3, len(Own)))
    moves[0, Own.HEIGHT], moves[1, Own.HEIGHT], moves[2, Own.RIGHT] = 4.0, 6.0, -3.0
    seen, peak = (Mock(spec=kind) for kind in (EdgeSeen, Peak))
    edges = (Edge.TOP_RIGHT, Edge.TOP_LEFT, Edge.RIGHT_END)
    total = _move({edge: Found(seen, peak, move) for edge, move in zip(edges, moves, strict=True)})
    assert total[Own.HEIGHT] == 5 and total[Own.RIGHT] == -3 and np.count_nonzero(total) == 2


def test_without_pixels_there_is_no_face():
    shown = recorded(SERIES[0])
    few = {name: getattr(shown.regions[0], name)[:30] for name in ("u", "v", "disparity_px", "height_mm")}
    with pytest.raises(CannotMeasure, match="no texture"):
        see_box(shown.views, shown.priors, ObjectRegion(**few, position_mm=(700.0, 0.0), bounds=(0, 0, 9, 9)))
    assert len(OWN) == len(CUBE)


def test_a_height_above_which_the_face_s_colour_goes_on_is_unsure(monkeypatch):
    """But where the camera looks down on the top: that has the face's colour."""
    case = (700.0, (260.0, 260.0, 220.0), 30.0)
    low, high = rendered(*case), rendered(*case, camera=HIGH)
    height = (Own.HEIGHT, Own.HEIGHT)
    assert low.box().doubt[height] == high.box().doubt[height] == 0.0
    monkeypatch.setattr(pictured, "is_other_beyond", lambda *where: False)
    unsure = low.box()
    assert (
        unsure.doubt[height] == pytest.approx((0.25 * unsure.own[Own.HEIGHT]) ** 2) and high.box().doubt[height] == 0.0
    )


def test_a_box_before_a_wall_that_shows_nothing_is_told_with_its_top_and_ends():
    """Both pictures agree about a plain wall at any disparity, up to their rim."""
    case, rng = (800.0, (260.0, 240.0, 260.0), 30.0), np.random.default_rng(5)
    shown, true = rendered(*case), true_box(*case)
    pictures = [picture.copy() for picture in shown.views.pair.pictures]
    foot = int(shown.world.pixels(Box(true).points(np.array([[0.9, 0.9, 0.0]])))[0, 1])  # and all rows above
    for picture, box in zip(pictures, masks(shown, true), strict=True):
        wall = np.rint(175 + 2 * rng.standard_normal(picture.shape))
        picture[:foot][~box[:foot]] = wall[:foot][~box[:foot]]
    seen = of_pair(*pictures).box()
    assert not seen.refused and set(seen.past.values()) == {Past.OPEN}
    assert np.abs(seen.own - true)[[Own.RIGHT, Own.LEFT, Own.HEIGHT]].max() < 4


@pytest.mark.parametrize("other", [True, False])
def test_what_is_matched_and_shown_beyond_an_edge_is_no_neighbour_s_only_where_it_has_the_face_s_colour(
    monkeypatch, other
):
    """Another box may stand in line with a face: it once was told 418 mm wide for 250, the neighbour's face with it."""
    shown = rendered(700.0, (260.0, 260.0, 220.0), 30.0)
    plain = shown.box()
    monkeypatch.setattr(pictured, "is_other_beyond", lambda *where: other)
    monkeypatch.setattr(pictured, "matched_beyond", lambda *where: dict.fromkeys(where[-1], (20.0, 60.0)))
    monkeypatch.setattr(pictured, "shown_beyond", lambda *where: 40.0)
    seen = shown.box()
    assert bool(np.abs(seen.own - plain.own).max() < 1e-6 and not seen.doubt.any()) is other
