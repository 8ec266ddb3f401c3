"""What the first slider of the course draws: a box before two pinhole cameras (notebook 00)."""

from __future__ import annotations

from typing import Any

import numpy as np

from stereolib.base import Float64, UInt8

_SIZE = 640, 480  # of both pictures, px
_SIDE_MM, _CAMERA_UP_MM = 300.0, 150.0
_PANEL_IN = 9.5 / 3  # width of a panel
_POST_MM = 1500.0, 4000.0  # a post far behind the box: to the right, forward


def draw_two_pictures(baseline_mm: int, focal_length_px: int, distance_mm: int, columns: int = 3) -> tuple[UInt8, str]:
    """Notebook 00: a box and a far post as two level pinhole cameras see them, and from above.

    Parameters
    ----------
    baseline_mm : int
        Between the two cameras.
    focal_length_px : int
        Of both cameras. The longer, the larger and narrower the view.
    distance_mm : int
        From the cameras to the box's near edge.
    columns : int
        Panels beside each other.

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    from stereolib.plotting import figure_to_image, panels

    figure, axes = panels(columns, -(-3 // columns), width_in=columns * _PANEL_IN, aspect=0.9)
    for empty in axes[3:]:
        empty.remove()
    middle_mm, outside = baseline_mm / 2, ""
    for name, ax, at_mm in (("left", axes[0], 0.0), ("right", axes[1], float(baseline_mm))):
        _draw_picture(ax, focal_length_px, distance_mm, at_mm, middle_mm)
        edge = _pixels(np.array([[middle_mm, 0.0, distance_mm]]), focal_length_px, at_mm)[0, 0]
        ax.axvline(edge, color="black", ls=":")
        is_seen = 0 <= edge <= _SIZE[0] - 1
        outside = outside if is_seen else f"the near edge is outside the {name} picture: no partner. "
        ax.set(title=f"{name}: near edge {f'in column {edge:.1f}' if is_seen else 'outside'}", xlabel="column (px)")
    axes[0].set_ylabel("row (px)")
    _draw_from_above(axes[2], baseline_mm, focal_length_px, distance_mm)
    disparity_px, far_px = (focal_length_px * baseline_mm / z for z in (distance_mm, _POST_MM[1]))
    nearer_mm = distance_mm - focal_length_px * baseline_mm / (disparity_px + 1)
    text = f"disparity of the near edge {disparity_px:.1f} px, of the post {far_px:.1f} px; "
    return figure_to_image(
        figure
    ), outside + text + f"one pixel more, and the edge would seem {nearer_mm:.1f} mm nearer"


def _pixels(points_mm: Float64, f_px: float, at_mm: float) -> Float64:
    """Where a level pinhole camera `at_mm` to the right sees points."""
    x, y, z = points_mm.T
    return np.asarray(np.stack([f_px * (x - at_mm) / z + _SIZE[0] / 2, f_px * y / z + _SIZE[1] / 2], -1))


def _corners(distance_mm: float, middle_mm: float) -> Float64:
    """Left, near, right and far corner of the box from above: (4, 2), mm to the right and forward."""
    half = _SIDE_MM / np.sqrt(2)
    shape = np.array([[-half, half], [0, 0], [half, half], [0, 2 * half]])
    corners: Float64 = shape + np.array([middle_mm, distance_mm])
    return corners


def _draw_picture(ax: Any, f_px: float, distance_mm: float, at_mm: float, middle_mm: float) -> None:
    """One camera's picture: floor, post, and the two faces that it sees."""
    top, foot = _CAMERA_UP_MM - _SIDE_MM, _CAMERA_UP_MM  # y runs down
    ax.axhspan(_SIZE[1] / 2 + f_px * foot / 6000, _SIZE[1], color="0.85")
    post = [[_POST_MM[0] + x, y, _POST_MM[1]] for x, y in ((-60, -900), (60, -900), (60, foot), (-60, foot))]
    ax.fill(*_pixels(np.array(post), f_px, at_mm).T, color="0.35")
    corners = _corners(distance_mm, middle_mm)
    for pair, shade in ((corners[:2], "#c9a26b"), (corners[1:3], "#a67f4a")):
        (x0, z0), (x1, z1) = pair
        face = np.array([[x0, top, z0], [x1, top, z1], [x1, foot, z1], [x0, foot, z0]])
        ax.fill(*_pixels(face, f_px, at_mm).T, color=shade)
    ax.set(xlim=(0, _SIZE[0]), ylim=(_SIZE[1], 0), aspect="equal")


def _draw_from_above(ax: Any, baseline_mm: float, f_px: float, distance_mm: float) -> None:
    """Both cameras with what they see, the box and the post, to scale."""
    from stereolib.plotting.two_views import LEFT, RIGHT

    reach = 4500.0
    for at, color in ((0, LEFT), (baseline_mm, RIGHT)):
        wide = reach * _SIZE[0] / 2 / f_px
        ax.fill([at, at - wide, at + wide], [0, reach, reach], color=color, alpha=0.25, lw=0)
        ax.plot(at, 0, "o", color=color)
    ax.fill(*_corners(distance_mm, baseline_mm / 2).T, color="#a67f4a")
    ax.plot(*_POST_MM, "s", color="0.35")
    ax.set(xlim=(-1900, 2100), ylim=(-150, reach), aspect="equal", title="from above")
    ax.set(xlabel="to the right (mm)", ylabel="forward (mm)")
