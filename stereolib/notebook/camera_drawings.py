"""What the sliders about lenses and rectification draw (notebooks 01 and 02)."""

from __future__ import annotations

import cv2
import numpy as np

from stereolib import paper
from stereolib.base import Float64, UInt8
from stereolib.rig import Camera, StereoRig


def draw_lens(k1: float, k2: float, k3: float, p1: float) -> tuple[UInt8, str]:
    """Notebook 01: straight lines through a lens with the right camera's K and p2.

    Parameters
    ----------
    k1, k2, k3 : float
        Bends along the radius: by its square, its fourth and its sixth power.
    p1 : float
        Bends as a lens does that stands askew to its sensor.

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    from stereolib.plotting import figure_to_image, panels
    from stereolib.plotting.style import OURS, REFUSED, TRUTH, image_axes

    right = paper.paper_rig().right
    K = right.K
    camera = Camera(K, np.array([k1, k2, p1, right.dist[3], k3]), right.size)
    figure, (ax,) = panels(1, width_in=6.2, aspect=0.78)
    for axis, (length, other) in enumerate(((640, 480), (480, 640))):
        for at in np.linspace(0, other - 1, 13):
            line = np.full((81, 2), at)
            line[:, axis] = np.linspace(0, length - 1, 81)
            rays = np.column_stack([(line - K[:2, 2]) / K[[0, 1], [0, 1]], np.ones(81)])
            for color, style, points in ((REFUSED, ":", line), (OURS, "-", camera.project(rays))):
                ax.plot(*points.T, color=color, ls=style, lw=1.2)
    image_axes(right.size, ax, "grid seen by a pinhole (dotted) and by this lens (blue)")
    corners = np.array([[0, 0], [639, 0], [0, 479], [639, 479]], float)
    rays = np.column_stack([(corners - K[:2, 2]) / K[[0, 1], [0, 1]], np.ones(4)])
    moved = np.linalg.norm(camera.project(rays) - corners, axis=1).max()
    grid = _pixel_grid(camera)
    dark = grid[np.isnan(camera.rays(grid)[:, 0])]
    folded = len(dark)
    if 0 < folded < len(grid) // 20:
        ax.plot(*dark.mean(axis=0), "o", ms=30, mfc="none", mec=TRUTH, mew=1.6, clip_on=False)
    return figure_to_image(
        figure
    ), f"worst corner moves {moved:.1f} px; pixels without a direction (the lens folds): {folded}"


def draw_rectification(
    alpha: float, roll_error_deg: float, rows_error_px: float = 0.0, baseline_error_pct: float = 0.0
) -> tuple[UInt8, str]:
    """Notebook 02: the cube pair rectified by a rig that is believed to be another than it is.

    Parameters
    ----------
    alpha : float
        0 keeps only what all pixels see, 1 all that any pixel sees.
    roll_error_deg : float
        The right camera is believed to be turned by so much about its axis.
    rows_error_px : float
        The right camera's principal point is believed to be so many rows lower.
    baseline_error_pct : float
        The baseline is believed to be so much longer.

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    from stereolib.plotting import figure_to_image, panels, plot_rows
    from stereolib.virtual import recordings

    true = paper.paper_rig()
    turn = cv2.Rodrigues(np.array([0.0, 0.0, np.radians(roll_error_deg)]))[0]
    K = true.right.K + np.array([[0, 0, 0], [0, 0, rows_error_px], [0, 0, 0]])
    believed = Camera(K, true.right.dist, true.right.size)
    T = turn @ true.T * (1 + baseline_error_pct / 100)  # it turns where it stands
    rectified = StereoRig(true.left, believed, turn @ true.R, T).rectify(alpha)
    left, right = rectified.rectify(*recordings.load_pair("conditions/texture"))
    depth_mm = np.linspace(700, 1000, 7)  # points all over the left image, at each of these depths
    points = (true.left.rays(_pixel_grid(true.left)[::997]) * depth_mm[:, None, None]).reshape(-1, 3)
    in_right = true.right.project(points @ true.R.T + true.T)
    both = np.all((in_right >= 0) & (in_right <= np.array(true.right.size) - 1), axis=1)
    known = (true.left.project(points[both]), "left"), (in_right[both], "right")
    found = [rectified.rectify_points(pixels, side) for pixels, side in known]
    rms = np.sqrt(np.nanmean((found[0] - found[1])[:, 1] ** 2))
    forward_mm = points[both] @ rectified.R1[2]
    farther = rectified.f_px * rectified.baseline_mm / (found[0] - found[1])[:, 0] / forward_mm - 1
    figure, (ax,) = panels(1, width_in=7, aspect=0.44)
    plot_rows(left, right, ax, range(40, 480, 60), "left and right picture, rectified; the lines are rows")
    text = f"focal length {rectified.f_px:.1f} px; rows differ by {rms:.2f} px rms"
    return figure_to_image(figure), f"{text}; depths come out {round(100 * np.nanmedian(farther), 1) + 0.0:+.1f} %"


def _pixel_grid(camera: Camera) -> Float64:
    width, height = camera.size
    return np.stack(np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float)), -1).reshape(-1, 2)
