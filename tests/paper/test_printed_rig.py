"""The paper's conventions are turned into ours rightly, and back."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from stereolib import paper
from stereolib.paper import compare_with_paper, published


def test_printed_E_is_R_transposed_times_skew_T():
    """facts: within 0.0046; OpenCV's order misses by 0.33."""
    assert paper.max_deviation("stereo.E", paper.printed_essential()) == pytest.approx(0.0046, abs=5e-5)
    assert paper.max_deviation("stereo.E", paper.printed_essential("opencv")) == pytest.approx(0.333, abs=5e-4)
    twisted = -paper.printed_essential("opencv").T  # the two are each other's negative transpose
    np.testing.assert_allclose(twisted, paper.printed_essential(), atol=1e-12)


def test_printed_F_follows_from_printed_E():
    assert paper.max_deviation("stereo.F", paper.printed_fundamental()) == pytest.approx(2.7e-4, abs=5e-6)
    assert paper.printed_fundamental("left-right")[2, 2] == pytest.approx(-0.185, abs=5e-4)


@pytest.mark.parametrize("function", [paper.printed_essential, paper.printed_fundamental])
def test_unknown_convention_is_refused(function):
    with pytest.raises(ValueError, match="must be"):
        function("matlab")


def test_rig_agrees_with_printed_E_and_F():
    rig = paper.paper_rig()
    assert paper.max_deviation("stereo.E", rig.E) < 0.0048
    assert paper.max_deviation("stereo.F", rig.F) < 3e-4
    assert rig.baseline_mm == pytest.approx(np.sqrt(93.1032**2 + 1.2802**2 + 0.1104**2), abs=1e-9)
    assert rig.rectify(alpha=0).f_px == pytest.approx(763.7, abs=0.05)


def test_printed_T_taken_for_opencvs_would_miss_the_printed_E():
    """Why T is turned by R: it is the right null vector of E, not the left one."""
    E, T, rig = (np.array(published()["stereo.E"].value), np.array(published()["stereo.T"].value), paper.paper_rig())
    assert np.abs(E @ T).max() < 0.01 < 20 < np.abs(T @ E).max()
    unturned = np.cross(T, rig.R.T).T  # column by column: skew(T) R
    assert paper.max_deviation("stereo.E", unturned) == pytest.approx(0.337, abs=5e-4)


def test_rotation_is_nearest_to_the_printed_one():
    R = paper.paper_rig().R
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(R.T, published()["stereo.R"].value, atol=5e-5)


@pytest.mark.parametrize("side", ["left", "right"])
def test_distortion_order(side):
    """The paper's equation with its squares restored, coefficient by coefficient, against cv2 with our order."""
    k1, k2, k3, p1, p2 = published()[f"table1.{side}.dist"].value
    fx, fy, cx, cy = (published()[f"table1.{side}.{name}"].value for name in ("fx", "fy", "cx", "cy"))
    camera = getattr(paper.paper_rig(), side)
    for x, y in [(0.2, -0.1), (-0.3, 0.25), (0.05, 0.3)]:
        r2 = x * x + y * y
        radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        u = fx * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)) + cx
        v = fy * (y * radial + 2 * p2 * x * y + p1 * (r2 + 2 * y**2)) + cy
        seen, _ = cv2.projectPoints(np.array([[[x, y, 1.0]]]), np.zeros(3), np.zeros(3), camera.K, camera.dist)
        np.testing.assert_allclose(seen.ravel(), [u, v], atol=1e-9)


def test_printed_form_undoes_paper_rig():
    form = paper.printed_form(paper.paper_rig())
    exact = [id for id in form if id.startswith("table1.") or id == "stereo.T"]
    assert len(exact) == 11
    for id in exact:
        np.testing.assert_allclose(form[id], published()[id].value, rtol=0, atol=1e-12)
    digits = {id: paper.printed_half_width(id) for id in form} | {
        "stereo.E": paper.essential_budget(),
        "stereo.F": np.full((3, 3), 3e-4),  # the printed F misses the printed E by that
    }
    assert set(compare_with_paper(form, tolerances=digits)["verdict"]) == {"recovered"}
