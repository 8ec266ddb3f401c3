"""The lens in both directions, against OpenCV's own and against the fold of Table I's right camera."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from stereolib.paper import paper_rig
from stereolib.rig import Camera, distort

K = np.array([[730.0, 0.0, 322.0], [0.0, 728.0, 231.0], [0.0, 0.0, 1.0]])
LENSES = {
    0: [],
    4: [0.06, -0.2, 7e-4, -1e-3],
    5: [0.06, -0.25, 7e-4, -1e-3, 0.1],
    8: [0.3, -0.1, 7e-4, -1e-3, 0.05, 0.2, -0.05, 0.02],
    12: [0.3, -0.1, 7e-4, -1e-3, 0.05, 0.2, -0.05, 0.02, 2e-3, -1e-3, -2e-3, 1e-3],
    14: [0.3, -0.1, 7e-4, -1e-3, 0.05, 0.2, -0.05, 0.02, 2e-3, -1e-3, -2e-3, 1e-3, 0.04, -0.03],
}


def camera(count: int) -> Camera:
    return Camera(K, LENSES[count], (640, 480))


def opencv(points_mm, lens: Camera) -> np.ndarray:
    dist = lens.dist if lens.dist.size else None
    return cv2.projectPoints(points_mm[:, None], np.zeros(3), np.zeros(3), lens.K, dist)[0][:, 0]


@pytest.fixture
def points_mm():
    rng = np.random.default_rng(1)
    z = rng.uniform(300, 3000, 400)
    return np.column_stack([rng.uniform(-0.45, 0.45, 400) * z, rng.uniform(-0.33, 0.33, 400) * z, z])


@pytest.mark.parametrize("count", LENSES)
def test_projection_is_opencvs(count, points_mm):
    lens = camera(count)
    np.testing.assert_allclose(lens.project(points_mm), opencv(points_mm, lens), atol=1e-9)


@pytest.mark.parametrize("count", LENSES)
def test_rays_undo_opencvs_projection(count, points_mm):
    lens = camera(count)
    rays = lens.rays(opencv(points_mm, lens))
    np.testing.assert_allclose(rays, points_mm / points_mm[:, 2:], atol=1e-11)


@pytest.mark.parametrize("count", [5, 8, 12])
def test_jacobian_against_differences(count, points_mm):
    xy, step = points_mm[:, :2] / points_mm[:, 2:], 1e-6
    _, jacobian = distort(xy, np.array(LENSES[count]))
    for axis in (0, 1):
        there, back = (distort(xy + s * step * np.eye(2)[axis], np.array(LENSES[count]))[0] for s in (1, -1))
        np.testing.assert_allclose(jacobian[[axis, 2 + axis]].T, (there - back) / (2 * step), atol=1e-8)


def test_points_behind_the_camera_are_nan():
    pixels = camera(5).project([[0, 0, 1000], [10, 0, 0], [10, 0, -500]])
    np.testing.assert_array_equal(np.isnan(pixels), [[False, False], [True, True], [True, True]])
    np.testing.assert_allclose(pixels[0], K[:2, 2])


def grid(lens: Camera) -> np.ndarray:
    return np.stack(np.meshgrid(*map(np.arange, lens.size)), -1).reshape(-1, 2).astype(float)


def test_table_1_right_lens_folds_over_in_60_pixels():
    lens = paper_rig().right
    pixels = grid(lens)
    rays = lens.rays(pixels)
    folded = np.isnan(rays[:, 0])
    assert folded.sum() == 60
    assert pixels[folded].min(axis=0).tolist() > [600, 450]  # the bottom right corner
    # all others come back through OpenCV's own forward model
    assert np.abs(opencv(rays[~folded], lens) - pixels[~folded]).max() < 1e-6
    # and clamped ones stand at the fold, the others as before
    clamped = lens.rays(pixels, clamp=True)
    np.testing.assert_allclose(np.hypot(*clamped[folded, :2].T), lens.fold_radius, rtol=1e-9)
    np.testing.assert_array_equal(clamped[~folded], rays[~folded])


def test_no_direction_leads_to_a_folded_pixel():
    """Brute force: of all ideal coordinates, none lands nearer than the one that the clamp gives."""
    lens = paper_rig().right
    pixels = grid(lens)
    folded = pixels[np.isnan(lens.rays(pixels)[:, 0])]
    r, angle = np.meshgrid(np.linspace(0.4, 0.75, 351), np.radians(np.linspace(25, 50, 251)))
    everywhere = np.column_stack([(r * np.cos(angle)).ravel(), (r * np.sin(angle)).ravel(), np.ones(r.size)])
    landed = opencv(everywhere, lens)
    # the pixel nearest to the fold misses it by hundredths of a pixel only, the corner by 7 px
    nearest = np.array([np.hypot(*(landed - pixel).T).min() for pixel in folded])
    by_clamp = np.hypot(*(lens.project(lens.rays(folded, clamp=True)) - folded).T)
    assert 6 < nearest.max() < 8
    assert (by_clamp < nearest + 0.05).all()


def test_opencvs_inverse_is_wrong_by_pixels_at_the_fold():
    lens = paper_rig().right
    pixels = grid(lens)[-20 * 640 :].reshape(20, 640, 2)[:, -30:].reshape(-1, 2)
    xy = cv2.undistortPoints(pixels[:, None], lens.K, lens.dist)[:, 0]
    off = np.hypot(*(opencv(np.column_stack([xy, np.ones(len(xy))]), lens) - pixels).T)
    ours = lens.rays(pixels)
    has_direction = np.isfinite(ours[:, 0])
    assert off.max() > 5
    assert off[has_direction].max() > 1.5  # not only where there is no answer
    assert 730 * np.hypot(*(xy - ours[:, :2])[has_direction].T).max() > 5
    assert np.hypot(*(lens.project(ours[has_direction]) - pixels[has_direction]).T).max() < 1e-6


@pytest.mark.parametrize(
    "dist", [[-0.32731821, -0.04706196, 0, 0, 0.04496969], [-0.134, -0.27, 0, 0, 0.118], [-0.3, -0.05, 0, 0, 0.04]]
)
def test_a_lens_that_nearly_folds_reaches_every_pixel(dist):
    """Newton's whole steps leap to and fro where the derivative comes near 0."""
    lens = Camera([[350, 0, 320], [0, 350, 240], [0, 0, 1]], dist, (640, 480))
    assert lens.fold_radius == np.inf
    for clamp in (False, True):
        np.testing.assert_allclose(lens.project(lens.rays(grid(lens), clamp=clamp)), grid(lens), atol=1e-4)


def test_clamped_rays_are_finite_though_no_direction_leads_to_the_pixel():
    """Far out this lens draws everything to a circle of 88 px and never folds."""
    lens = Camera([[350, 0, 320], [0, 350, 240], [0, 0, 1]], [0, 0, 0, 0, 0, 16.0, 0, 0], (640, 480))
    assert np.isnan(lens.rays([[100.0, 50.0]])).any() and np.isfinite(lens.rays(grid(lens), clamp=True)).all()
    assert np.isfinite(lens.rays([[np.nan, 1.0], [330.0, 240.0]])[1]).all()


def test_left_lens_reaches_every_pixel():
    lens = paper_rig().left
    np.testing.assert_allclose(opencv(lens.rays(grid(lens)), lens), grid(lens), atol=1e-6)


def test_fold_radius_is_the_root_of_the_derivative():
    lens = paper_rig().right
    k1, k2, _, _, k3 = lens.dist
    roots = np.roots([7 * k3, 5 * k2, 3 * k1, 1])  # of d(r + k1 r^3 + k2 r^5 + k3 r^7)/dr in r^2
    real = np.sqrt(min(r.real for r in roots if abs(r.imag) < 1e-12 and r.real > 0))
    assert lens.fold_radius == pytest.approx(real, abs=5e-4)
    assert camera(0).fold_radius == np.inf
    assert Camera(K, [0.1, 0, 0, 0, 0], (640, 480)).fold_radius == np.inf


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"K": np.eye(2)}, r"K must be \(3, 3\)"),
        ({"K": np.full((3, 3), np.nan)}, "K must be"),
        ({"K": np.diag([-1.0, 1, 1])}, "focal lengths must be positive"),
        ({"dist": [1, 2, 3]}, "dist has 3 coefficients"),
        ({"dist": [np.inf] * 5}, "dist must be"),
        ({"size": (640, 0)}, "size must be"),
        ({"size": (640.5, 480)}, "size must be"),
        ({"size": (640,)}, "size must be"),
    ],
)
def test_refuses(change, text):
    with pytest.raises(ValueError, match=text):
        Camera(**{"K": K, "dist": [], "size": (640, 480), **change})


def test_arrays_of_another_orientation_are_refused():
    lens = camera(5)
    with pytest.raises(ValueError, match=r"points_mm must be \(N, 3\).*\(3, 5\): transpose it"):
        lens.project(np.ones((3, 5)))
    with pytest.raises(ValueError, match=r"pixels must be \(N, 2\).*\(2, 3\): transpose it"):
        lens.rays(np.ones((2, 3)))
    with pytest.raises(ValueError, match=r"xy must be \(N, 2\).*\(4,\): give 2 numbers"):
        distort(np.ones(4), lens.dist)
    assert lens.rays([1.0, 2.0]).shape == lens.rays(np.ones((1, 1, 2))).shape == (1, 3)
    assert lens.project([]).shape == (0, 2)


def test_distortion_may_come_in_a_row_as_opencv_gives_it():
    for one, other in zip(distort([[0.1, 0.2]], [LENSES[5]]), distort([[0.1, 0.2]], LENSES[5]), strict=True):
        np.testing.assert_array_equal(one, other)


def test_is_a_read_only_copy():
    own = K.copy()
    lens = Camera(own, [], (640, 480))
    own[0, 0] = 1
    assert lens.K[0, 0] == 730
    with pytest.raises(ValueError, match="read-only"):
        lens.K[0, 0] = 1
