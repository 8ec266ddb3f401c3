"""Verdicts of notebook 01 turn with the corners, and with other printed numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.corners import corner_set, draw_poses
from support.verdicts import verdict_of

from stereolib import evidence, paper
from stereolib.calibration import BoardViews, calibrate_stereo, hold_out_errors, hold_out_splits, rig_covariance
from stereolib.paper import compare_with_paper, printed_values, published
from stereolib.rig import Camera


@pytest.fixture(scope="module")
def views() -> BoardViews:
    return corner_set(np.random.default_rng(5))


def printed_otherwise(monkeypatch: pytest.MonkeyPatch, **values: object) -> None:
    """Let the paper print other values for some ids (``stereo_R`` for ``stereo.R``)."""
    others = {id.replace("_", ".", 1): value for id, value in values.items()}
    changed = {id: replace(item, value=others.get(id, item.value)) for id, item in published().items()}
    monkeypatch.setattr(printed_values, "published", lambda: changed)
    monkeypatch.setattr("stereolib.paper.ledger.published", lambda: changed)


# --- the cameras


@pytest.mark.parametrize("fixed", [False, True], ids=["jointly", "in two parts"])
def test_cameras_come_back_from_right_boards_and_not_from_a_wrong_one(views, fixed):
    """Squares told 1 % too large: T and E are 1 % off and so is F; lenses and R are not."""
    truth, calibrated = paper.paper_rig(), calibrate_stereo(views)
    allowed = evidence.recovery_tolerances(calibrated.rig, rig_covariance(calibrated.fit), truth)
    exact = corner_set(np.random.default_rng(5), pairs=12, noise_px=0.0) if fixed else views
    verdicts = []
    for told_mm in (25.0, 25.25):
        told = replace(exact, board=replace(exact.board, square_mm=told_mm))
        ours, limits = paper.printed_form(calibrate_stereo(told, fixed=fixed).rig), allowed
        if fixed:
            ours, limits = ({f"twopart.{n}": of[f"stereo.{n}"] for n in "RT"} for of in (ours, limits))
        rows = compare_with_paper(ours, tolerances=limits)
        verdicts.append(dict(zip(rows["id"], rows["verdict"], strict=True)))
    right, wrong = verdicts
    assert set(right.values()) == {"recovered"}
    scaled = {"twopart.T"} if fixed else {"stereo.T", "stereo.E", "stereo.F"}
    assert {id for id, verdict in wrong.items() if verdict == "not recovered"} == scaled


def test_tolerances_are_four_standard_deviations(views):
    calibrated = calibrate_stereo(views)
    covariance, rig = rig_covariance(calibrated.fit), calibrated.rig
    allowed = evidence.recovery_tolerances(rig, covariance, paper.paper_rig())
    std = np.sqrt(np.diag(covariance))
    by_hand = {"table1.left.fx": std[0], "table1.right.cy": std[12], "table1.left.dist": std[[4, 5, 8, 6, 7]]}
    for id, expected in by_hand.items():
        over = allowed[id] / (4 * expected)
        assert ((over >= 1) & (over < 1.1)).all(), id  # rounded up to two digits
    drawn = [
        calibrate_stereo(evidence.redrawn_corners(views, calibrated.fit, np.random.default_rng(k))).rig
        for k in range(10)
    ]
    scatter = np.std([paper.printed_form(one)["stereo.E"] for one in drawn], axis=0)
    assert np.median(allowed["stereo.E"] / (4 * scatter)) == pytest.approx(1.1, abs=0.35)  # ten draws
    # what the truth itself is off stands in the tolerance: R is no rotation in the print
    assert allowed["stereo.R"][0, 0] >= abs(paper.paper_rig().R[0, 0] - 1)


def test_two_parts_come_less_near_than_all_together(views):
    truth, rng, some = paper.paper_rig(), np.random.default_rng(8), views.only(range(12))
    ways = evidence.joint_and_two_parts_redrawn(some, calibrate_stereo(some).fit, rng, draws=5).set_index("way")
    joint, parts = ways.iloc[0], ways.iloc[1]
    assert (parts[["R off by (mrad)", "T off by (mm)"]] > 1.5 * joint[["R off by (mrad)", "T off by (mm)"]]).all()
    poses = draw_poses(truth, 10, np.random.default_rng(9))
    exact = corner_set(rng, poses=poses, noise_px=0.0)
    table = evidence.joint_and_two_parts(exact, truth, [pose[2, 3] for pose in poses])
    assert (table.iloc[:, 1:] < 2e-3).all(axis=None)  # without noise both find the truth, to float32
    wrong = evidence.joint_and_two_parts(exact, truth, [1.01 * pose[2, 3] for pose in poses])
    assert (wrong["depths off by (mm)"] > 5).all()  # depths told 1 % too large


# --- printed numbers against each other


def test_essential_budget_is_the_worst_that_the_digits_allow():
    """Random choices of what was rounded stay within it, the worst choice reaches it."""
    rng, R, T = np.random.default_rng(0), *(np.array(paper.printed_value(f"stereo.{name}")) for name in "RT")
    wide, budget = paper.printed_half_width("stereo.E"), paper.essential_budget()
    skew = lambda t: np.cross(np.eye(3), t)  # noqa: E731  rows e_i x t make -skew(t)' = skew(t)
    moved = [
        (R + rng.uniform(-5e-5, 5e-5, (3, 3))).T @ skew(T + rng.uniform(-5e-5, 5e-5, 3)) - R.T @ skew(T)
        for _ in range(2000)
    ]
    most = np.abs(moved).max(axis=0)
    assert (most <= budget - wide).all() and (most > 0.6 * (budget - wide)).all()


def test_fundamental_budget_is_the_worst_that_the_digits_allow():
    rng, E = np.random.default_rng(0), np.array(paper.printed_value("stereo.E"))
    K = {side: paper.printed_camera_matrix(side) for side in ("left", "right")}
    free = np.array([[1, 0, 1], [0, 1, 1], [0, 0, 0]])
    plain, most = paper.printed_fundamental(), np.zeros((3, 3))
    for _ in range(4000):
        left, right = (matrix + free * rng.choice([-5e-5, 5e-5], (3, 3)) for matrix in K.values())
        F = np.linalg.inv(right).T @ (E + rng.choice([-5e-5, 5e-5], (3, 3))) @ np.linalg.inv(left)
        most = np.maximum(most, np.abs(F - plain))
    budget = paper.fundamental_budget() - paper.printed_half_width("stereo.F")
    assert (most <= budget * (1 + 1e-6)).all() and most[2, 2] > 0.8 * budget[2, 2]


def test_printed_E_follows_from_R_and_T_and_would_not_from_others(monkeypatch):
    id = "check.E_from_R_T"
    budget = {id: paper.essential_budget()}
    assert verdict_of(id, paper.printed_essential(), tolerances=budget) == "consistent"
    assert verdict_of(id, paper.printed_essential("opencv"), tolerances=budget) == "paper contradicts itself"
    printed_otherwise(monkeypatch, stereo_T=[-93.1132, 1.2802, 0.1104])  # a hundredth of a millimetre
    assert (
        verdict_of(id, paper.printed_essential(), tolerances={id: paper.essential_budget()})
        == "paper contradicts itself"
    )


def test_printed_F_does_not_follow_from_E_and_another_one_would(monkeypatch):
    id = "check.F_from_E_K"
    assert (
        verdict_of(id, paper.printed_fundamental(), tolerances={id: paper.fundamental_budget()})
        == "paper contradicts itself"
    )
    off = np.abs(paper.printed_fundamental() - np.array(paper.printed_value("stereo.F")))
    assert ((off > paper.fundamental_budget()) == (np.indices((3, 3)).sum(axis=0) == 4)).all()  # F33 alone
    near = paper.printed_fundamental() - np.diag([0, 0, 1e-4])
    assert verdict_of(id, near, tolerances={id: paper.fundamental_budget()}) == "consistent"


def test_printed_F_follows_from_R_T_and_K_and_would_not_from_others(monkeypatch):
    id, allowed = "check.F_from_R_T_K", {"check.F_from_R_T_K": paper.printed_half_width("stereo.F")}
    assert verdict_of(id, evidence.fundamental_from_pose(), tolerances=allowed) == "consistent"
    assert verdict_of(id, paper.printed_fundamental(), tolerances=allowed) == "paper contradicts itself"
    R = np.array(paper.printed_value("stereo.R"))
    R[0, 2] += 1e-4  # one unit of the last digit
    printed_otherwise(monkeypatch, stereo_R=R.tolist())
    assert verdict_of(id, evidence.fundamental_from_pose(), tolerances=allowed) == "paper contradicts itself"


def test_readings_of_F_name_what_would_explain_it():
    table = evidence.fundamental_readings().set_index("reading")["times the digits"]
    explains = table[table <= 1].index.tolist()
    assert [name.split()[0] for name in explains] == ["pixels", "a", "E"] and "0.5 px" in explains[0]
    assert table["as printed"] == pytest.approx(1.23, abs=5e-3)
    rounded = evidence.fundamental_from_pose().round(4)  # all nine elements as printed
    np.testing.assert_allclose(rounded, paper.printed_value("stereo.F"), atol=1e-9)


def test_pose_by_words(monkeypatch):
    """R as camera 2's axes fits, T points the wrong way."""
    assert verdict_of("check.R_direction", evidence.pose_by_words()) == "paper contradicts itself"
    assert evidence.pose_by_words()["axes"] < 1 and evidence.pose_by_words()["place_mm"] < 0
    T = -np.array(published()["stereo.T"].value)
    E = (-np.array(published()["stereo.E"].value)).tolist()
    printed_otherwise(monkeypatch, stereo_T=T.tolist(), stereo_E=E)
    assert verdict_of("check.R_direction", evidence.pose_by_words()) == "consistent"


def test_translation_is_between_centres_unless_the_printed_E_says_otherwise(monkeypatch):
    """An E made with the vector between the centres of cameras with pixels of 5 um, T between principal points."""
    id = "claim.T_is_distance"
    assert verdict_of(id, evidence.translation_between_principal_points()) == "paper contradicts itself"
    rig, pitch_mm = paper.paper_rig(), 5e-3
    axis = rig.R.T[:, 2]  # camera 2's, seen from camera 1
    ahead = pitch_mm * (rig.right.K[0, 0] * axis - rig.left.K[0, 0] * np.array([0, 0, 1]))
    centres = np.array(paper.printed_value("stereo.T"))
    E = rig.R @ np.cross(np.eye(3), centres)
    printed_otherwise(monkeypatch, stereo_T=(centres - ahead).round(4).tolist(), stereo_E=E.round(4).tolist())
    assert evidence.translation_between_principal_points()["pixel_um"] == pytest.approx(5, abs=0.2)
    assert verdict_of(id, evidence.translation_between_principal_points()) == "consistent"


def test_pose_readings_decide_for_the_left_frame():
    table = evidence.pose_readings()
    fits = table[table["times the digits"] <= 1]["should hold"].tolist()
    assert fits == ["R' skew(T) = E", "E T = 0"]
    assert table["misses by"].iloc[:3].round(4).tolist() == [0.3331, 0.3373, 0.0046]


# --- what the text says of the cameras


def test_distortions_are_needed_by_these_lenses_and_not_by_straight_ones():
    rig = paper.paper_rig()
    K = np.array([[730, 0, 319.5], [0, 730, 239.5], [0, 0, 1.0]])
    ideal = Camera(K, [], rig.left.size)
    straight = evidence.pinhole_misses(replace(rig, left=ideal, right=ideal))
    needed = [verdict_of("claim.distortion_needed", one) for one in (evidence.pinhole_misses(rig), straight)]
    assert needed == ["agrees", "does not hold"]
    aside = Camera(K + np.outer([1, 0, 0], [0, 0, 5.0]), [], rig.left.size)
    assert evidence.principal_points_beside(replace(rig, left=aside, right=ideal)) == {"left_px": 5.0, "right_px": 0.0}


def test_limit_of_distortions_is_what_moves_a_depth_by_the_scales_precision():
    rectified, z_mm = paper.paper_rig().rectify(), 1000 * paper.printed_value("setup.distance")
    share = 0.0005 / paper.printed_value("scale.cm_per_px")
    (limit,) = {c.least for c in published()["claim.distortion_needed"].conditions.values()}
    assert limit == pytest.approx(share * rectified.f_px * rectified.baseline_mm / z_mm, rel=0.1)


def test_pinhole_takes_what_a_focal_length_can_take():
    """Half of a small radial distortion is a focal length: the nearest pinhole misses less than the same K bare."""
    K, size = np.array([[730, 0, 319.5], [0, 730, 239.5], [0, 0, 1.0]]), (640, 480)
    lens, rig = Camera(K, [0.05, 0, 0, 0], size), paper.paper_rig()
    found = evidence.pinhole_misses(replace(rig, left=lens, right=lens))
    corner = np.array([319.5, 239.5]) / 730
    bare_px = 730 * 0.05 * np.hypot(*corner) ** 3
    assert 0.2 * bare_px < found["corner_px"] < 0.8 * bare_px


# --- the printed equation


def test_printed_projection_is_opencvs_once_its_squares_stand(monkeypatch):
    assert evidence.projection_restored()["restored_px"] < 1e-9
    as_printed = paper.printed_projection
    monkeypatch.setattr(paper, "printed_projection", lambda camera, xy, squares=False: as_printed(camera, xy))
    assert evidence.projection_restored()["restored_px"] > 1


def test_equation_as_printed_is_wrong_where_there_is_tangential_distortion(monkeypatch):
    rig = paper.paper_rig()
    assert verdict_of("eq.projection", evidence.projection_as_printed(rig)) == "paper contradicts itself"
    faint = [replace(c, dist=c.dist * [1, 1, 0.01, 0.01, 1]) for c in (rig.left, rig.right)]
    quiet = evidence.projection_as_printed(replace(rig, left=faint[0], right=faint[1]))
    assert quiet["right_px"] == pytest.approx(0.01 * evidence.projection_as_printed(rig)["right_px"], rel=0.1)
    with_squares = paper.printed_projection
    monkeypatch.setattr(
        paper, "printed_projection", lambda camera, xy, squares=False: with_squares(camera, xy, squares=True)
    )
    assert verdict_of("eq.projection", evidence.projection_as_printed(rig)) == "consistent"


def test_limit_of_the_tangential_misprint_is_what_the_digits_of_p1_and_p2_leave():
    """Half of 1e-4 in p1 and p2, where in the two images it moves a pixel farthest."""
    most = 0.0
    for camera in (paper.paper_rig().left, paper.paper_rig().right):
        pixels = np.stack(np.meshgrid(np.arange(0, 640, 9), np.arange(0, 480, 9)), -1).reshape(-1, 2)
        x, y = np.abs(camera.rays(pixels)[:, :2]).T
        r2 = x**2 + y**2
        terms = (2 * x * y + r2 + 2 * x**2, 2 * x * y + r2 + 2 * y**2)
        most = max(most, float(np.nanmax(camera.K[0, 0] * 5e-5 * np.hypot(*terms))))
    (limit,) = {c.most for c in published()["eq.projection"].conditions.values()}
    assert most <= limit < most + 0.01


def test_coefficients_are_counted_where_they_are_printed(monkeypatch):
    counts = paper.printed_counts()
    assert counts == {"listed": 5, "equation": 8, "radial": 6}
    claims = {"claim.fourteen_coefficients": ("listed", "equation"), "misprint.radial_count": ("radial",)}
    given = {id: {name: counts[name] for name in names} for id, names in claims.items()}
    assert {verdict_of(id, ours) for id, ours in given.items()} == {"paper contradicts itself"}
    equation = " + ".join(f"k{n}" for n in range(1, 15))
    printed_otherwise(monkeypatch, eq_projection=equation, table1_left_dist=[0.0] * 5)
    changed = {id: replace(item, value=[0.1] * 14) for id, item in published().items() if id == "table1.left.dist"}
    more = printed_values.published() | changed
    monkeypatch.setattr(printed_values, "published", lambda: more)
    counts = paper.printed_counts()
    given = {id: {name: counts[name] for name in names} for id, names in claims.items()}
    assert {verdict_of(id, ours) for id, ours in given.items()} == {"consistent"}


# --- the denominator


def test_a_denominator_helps_where_the_lens_has_one_and_corners_are_sharp():
    rig, models, splits = paper.paper_rig(), ["brown3", "rational8"], hold_out_splits(16, 2)
    poses = draw_poses(rig, 16, np.random.default_rng(3))
    strong = np.array([0.5, 0, 5e-4, -5e-4, 0, 1.5, 3, 10])
    divided = replace(rig, left=replace(rig.left, dist=strong), right=replace(rig.right, dist=strong))
    gains = []
    for lens, noise_px in ((divided, 0.003), (rig, 0.034)):
        views = corner_set(np.random.default_rng(3), rig=lens, poses=poses, noise_px=noise_px)
        gains.append(evidence.denominator_gain(hold_out_errors(views, models, splits))["less_pct"])
    assert gains[0] > 2 > 0.5 > gains[1]
    assert verdict_of("claim.denominator", f"{gains[1]:.0f} %") == "not comparable"
