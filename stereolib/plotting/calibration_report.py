"""The report of a calibration: one HTML page with pictures that needs no other file."""

from __future__ import annotations

import base64
import html
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

import cv2
import jinja2
import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from stereolib import __version__
from stereolib.base import Bools, Float64, write_atomic
from stereolib.calibration import (
    VERDICT_MEANINGS,
    CornerOff,
    Diagnosis,
    board_pose,
    board_text,
    boards_per_cell,
    check_rows,
    result_rows,
)
from stereolib.plotting.curves import plot_curves, plot_dots
from stereolib.plotting.output import show_figure
from stereolib.plotting.pictures import plot_corners, plot_crop, plot_image, plot_points
from stereolib.plotting.quantities import ImageQuantity, plot_arrows, plot_quantity
from stereolib.plotting.style import as_written, panels
from stereolib.rig import Camera, read_image

Files: TypeAlias = Mapping[str, tuple[Path, Path]]
_SHOWN_PAIRS = 6
_SHOWN_CORNERS, _OF_ONE_PAIR = 6, 2
_COLORS = {"good": "#1b6e3c", "usable": "#8a6100", "bad": "#a33a12"}
_NO_VERDICT_COLOR = "#555555"


def write_calibration_report(path: Path, diagnosis: Diagnosis, files: Files) -> Path:
    """Write the report of a calibration: one HTML file that needs no other.

    Parameters
    ----------
    path : Path
    diagnosis : Diagnosis
    files : mapping of pair to (left, right) image files
        For the pictures of the corners; pairs that are missing here are not shown.

    Returns
    -------
    Path
        Where it was written.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("stereolib.plotting"),
        autoescape=True,
        finalize=_escaped,
        trim_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    page = environment.get_template("calibration_report.html").render(
        diagnosis=diagnosis,
        verdict_means=VERDICT_MEANINGS.get(diagnosis.verdict, ""),
        color=_COLORS.get(diagnosis.verdict, _NO_VERDICT_COLOR),
        error=result_rows("errors", diagnosis)[0],
        board=board_text(diagnosis.views.board),
        version=__version__,
        checks=check_rows(diagnosis),
        uncovered=uncovered_text(diagnosis),
        results=[*result_rows("parameters", diagnosis), *result_rows("meaning", diagnosis)],
        refused=[f"left out: {names}: {reason}" for names, reason in diagnosis.left_out_by_reason],
        pictures={
            "corners": _corners(diagnosis, files),
            "coverage": _coverage(diagnosis),
            "errors": _residuals(diagnosis),
            "worst": _worst_corners(diagnosis, files),
            "lenses": _lenses(diagnosis),
            "uncertainty": _uncertainty(diagnosis),
        },
    )
    return write_atomic(path, page)


def _escaped(value: Any) -> Any:
    """Escape what is no markup as `html` does; jinja2 would write quotes otherwise."""
    return value if hasattr(value, "__html__") else Markup(html.escape(str(value)))


def _embedded(figure: Figure) -> str:
    """Encode a figure for an HTML page."""
    return base64.b64encode(show_figure(None, figure).data).decode("ascii")


def _corners(diagnosis: Diagnosis, files: Files) -> list[str]:
    views = diagnosis.views
    known = [k for k, name in enumerate(views.names) if name in files]
    chosen = known[:: max(1, -(-len(known) // _SHOWN_PAIRS))]
    if not chosen:
        return []
    figure, axes = panels(2, -(-len(chosen) // 2), width_in=12, aspect=0.42)
    for ax, k in zip(axes, chosen, strict=False):
        images = [read_image(file, grey=True) for file in files[views.names[k]]]
        plot_image(np.hstack(images), ax, as_written(views.names[k]))
        for corners, shift in ((views.left_px[k], 0), (views.right_px[k], views.size[0])):
            plot_corners(None, corners + np.array([shift, 0]), views.board.columns, ax)
    for ax in axes:
        ax.set_axis_off()
    return [_embedded(figure)]


def _coverage(diagnosis: Diagnosis) -> list[str]:
    views = diagnosis.views
    figure, axes = panels(3, width_in=12, aspect=0.8)
    for ax, side, corners in zip(axes, ("left", "right"), (views.left_px, views.right_px), strict=False):
        plot_points(corners, views.size, ax, f"{side}: corners of {len(views)} pairs")
    about_y, about_x, distances = _tilts(diagnosis)
    plot_dots(
        about_y,
        about_x,
        axes[2],
        color=distances,
        label="distance (mm)",
        title="tilt of the boards",
        xlabel="left (-) or right (+) side nearer (deg)",
        ylabel="upper (-) or lower (+) edge nearer (deg)",
        xlim=(-60, 60),
        ylim=(-60, 60),
    )
    return [_embedded(figure)]


def _tilts(diagnosis: Diagnosis) -> tuple[Float64, Float64, Float64]:
    """Each board's normal against the left camera's axis, sideways and upwards in degrees, and its distance in mm."""
    views, lens = diagnosis.views, diagnosis.rig.left
    tilts = []
    for corners in views.left_px.astype(float):
        known = np.isfinite(corners).all(axis=1)
        points = views.board.points_mm[known].astype(float)
        turn, shift = board_pose(points, corners[known], lens)
        R = cv2.Rodrigues(turn)[0]
        x, y, z = R[:, 2] * np.sign(R[2, 2])
        tilts.append((np.degrees(np.arctan2(x, z)), np.degrees(np.arctan2(y, z)), (R @ points.mean(axis=0) + shift)[2]))
    about_y, about_x, distances = np.array(tilts).T
    return about_y, about_x, distances


def _residuals(diagnosis: Diagnosis) -> list[str]:
    views, numbers = diagnosis.views, np.arange(1, len(diagnosis.views) + 1)
    figure, axes = panels(2, width_in=12, aspect=0.9)
    for ax, side, at, errors in zip(
        axes, ("left", "right"), (views.left_px, views.right_px), diagnosis.residuals_px, strict=True
    ):
        plot_arrows(at, errors, views.size, ax, side)
    bars, (ax,) = panels(1, width_in=12, aspect=0.26)
    worst = int(np.argmax(diagnosis.pair_rms_px.max(axis=1)))
    curves = {side: (numbers, diagnosis.pair_rms_px[:, k]) for k, side in enumerate(("left", "right"))}
    title = f"rms of each pair; the largest is {as_written(views.names[worst])}"
    plot_curves(curves, ax, xlabel="", ylabel="rms (px)", title=title, joined=False, ylim=(0, None))
    ax.set_xticks(numbers, [as_written(name[-16:]) for name in views.names], rotation=70)
    return [_embedded(shown) for shown in (figure, bars)]


def _worst_corners(diagnosis: Diagnosis, files: Files) -> list[str]:
    """Crops of the pictures round the corners that are farthest from where the rig predicts them."""
    shown = Counter[str]()
    worst = list[CornerOff]()
    for corner in diagnosis.worst_corners:  # one bad picture would fill the page
        if corner.pair in files and shown[corner.pair] < _OF_ONE_PAIR and len(worst) < _SHOWN_CORNERS:
            shown[corner.pair] += 1
            worst.append(corner)
    if not worst:
        return []
    figure, axes = panels(3, -(-len(worst) // 3), width_in=12, aspect=1.05)
    for ax, corner in zip(axes, worst, strict=False):
        file = files[corner.pair][corner.side == "right"]
        where = f"corner of column {corner.column}, row {corner.row}"
        left_out = ", left out" * (corner in diagnosis.wrong_corners)
        title = f"{as_written(file.name)} ({corner.side})\n{where}: {corner.off_px:.2f} px off{left_out}"
        plot_crop(read_image(file, grey=True), np.array(corner.found_px), np.array(corner.expected_px), ax, title)
    for ax in axes[len(worst) :]:
        ax.set_axis_off()
    axes[0].legend(loc="lower left", fontsize=8)
    return [_embedded(figure)]


def _lenses(diagnosis: Diagnosis) -> list[str]:
    cameras = diagnosis.rig.left, diagnosis.rig.right
    if not any(camera.dist.any() for camera in cameras):
        return []
    maps, uncovered = [lens_shift_px(camera) for camera in cameras], _uncovered(diagnosis)
    high = float(
        np.nanmax([_largest_covered(shift, hidden) for (_, _, shift), hidden in zip(maps, uncovered, strict=True)])
    )
    figure, axes = panels(2, width_in=12, aspect=0.72)
    for ax, side, (columns, rows, shift), hidden in zip(axes, ("left", "right"), maps, uncovered, strict=True):
        moved = ImageQuantity(shift, columns, rows, diagnosis.views.size, "shift by the lens (px)", hidden)
        plot_quantity(moved, ax, side, high=high)
    return [_embedded(figure)]


def lens_shift_px(camera: Camera, step: int = 10) -> tuple[Float64, Float64, Float64]:
    """Compute how far a lens moves pixels from where a pinhole with the same K has them.

    Parameters
    ----------
    camera : Camera
    step : int
        About the distance of the grid's points, px.

    Returns
    -------
    columns, rows : (w,), (h,) px
        A grid over the image that includes its corners.
    shift : (h, w) px
        NaN where the lens has no direction (it folds over).
    """
    columns, rows = (np.linspace(0, n - 1, max(2, n // step + 1)) for n in camera.size)
    pixels = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    ideal = camera.rays(pixels) @ camera.K[:2].T
    return columns, rows, np.hypot(*(pixels - ideal).T).reshape(len(rows), len(columns))


def _uncertainty(diagnosis: Diagnosis) -> list[str]:
    errors, hidden = diagnosis.error_map, _uncovered(diagnosis)[0]
    figure, axes = panels(2, width_in=12, aspect=0.72)
    for ax, values, what in (
        (axes[0], errors.depth_mm, "depth"),
        (axes[1], errors.length_mm, f"length of {errors.of_mm:g} mm"),
    ):
        where = errors.columns_px, errors.rows_px, diagnosis.views.size
        deviation = ImageQuantity(values, *where, "standard deviation (mm)", hidden)
        plot_quantity(deviation, ax, what, log=True)
    return [_embedded(figure)]


def _uncovered(diagnosis: Diagnosis) -> list[Bools]:
    """Cells of the left and the right image that no board covered, bool."""
    views = diagnosis.views
    return [boards_per_cell(corners, views.size) == 0 for corners in (views.left_px, views.right_px)]


def uncovered_text(diagnosis: Diagnosis) -> str:
    """Say how much of the left image no board reached, which pictures hatch, and what that costs a depth there.

    Parameters
    ----------
    diagnosis : Diagnosis

    Returns
    -------
    str
    """
    errors, hidden = diagnosis.error_map, _uncovered(diagnosis)[0]
    if not hidden.any():
        return "boards were seen in all of the left picture"
    boards, known = _on_grid(~hidden, errors.depth_mm), np.isfinite(errors.depth_mm)
    there, elsewhere = (np.median(errors.depth_mm[known & part]) for part in (~boards, boards))
    said = f"no board was seen in {100 * hidden.mean():.0f} % of the left picture, hatched"
    if not np.isfinite([there, elsewhere]).all():
        return said
    return f"{said}: a depth there is unsure by {there:.2g} mm (median), elsewhere by {elsewhere:.2g} mm"


def _on_grid(cells: Bools, values: Float64) -> Bools:
    """Cells of the image on the grid of these values, bool."""
    shown: Bools = cv2.resize(cells.astype(np.uint8), values.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
    return shown


def _largest_covered(values: Float64, hidden: Bools) -> float:
    """Largest value where boards were, but for the last twentieth; the colours end there."""
    known = values[_on_grid(~hidden, values) & np.isfinite(values)]
    return float(np.percentile(known, 95)) if known.size else float("nan")
