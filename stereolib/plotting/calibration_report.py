"""The report of a calibration: one HTML page with pictures that needs no other file."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

import cv2
import numpy as np

from stereolib import __version__
from stereolib.base import write_atomic
from stereolib.calibration import (
    VERDICT_MEANINGS,
    Diagnosis,
    board_pose,
    board_text,
    boards_per_cell,
    check_rows,
    meaning_rows,
    parameter_rows,
)
from stereolib.rig import Camera, read_image

Array = np.ndarray
Files = Mapping[str, tuple[Path, Path]]
_SHOWN_PAIRS = 6
_COLORS = {"good": "#1b6e3c", "usable": "#8a6100", "bad": "#a33a12"}
_STYLE = """
body { margin: 2rem auto; max-width: 66rem; padding: 0 1.5rem; background: #fff; color: #1a1a1a;
       font: 16px/1.5 system-ui, sans-serif; }
h1 { line-height: 1.2; margin-bottom: 0.3rem; } h2 { margin-top: 2.2rem; border-bottom: 1px solid #ccc; }
figure { margin: 1rem 0; } img { max-width: 100%; height: auto; } figcaption { color: #444; }
.rows { overflow-x: auto; } table { border-collapse: collapse; font-size: 0.92rem; }
th, td { text-align: left; padding: 0.25rem 0.9rem 0.25rem 0; border-bottom: 1px solid #ddd; vertical-align: top; }
td.n { font-variant-numeric: tabular-nums; white-space: pre-wrap; } td small { color: #555; }
b.verdict { font-size: 1.3rem; } li { overflow-wrap: anywhere; }
@media print { body { max-width: none; font-size: 11px; } figure, tr { break-inside: avoid; } }
"""


def build(path: Path, diagnosis: Diagnosis, files: Files) -> Path:
    """Write the report: one HTML file that needs no other.

    Parameters
    ----------
    path : Path
    diagnosis : Diagnosis
    files : mapping of pair to (left, right) image files
        For the pictures of the corners; pairs that are missing here are not shown.
    """
    sections = (
        ("Corners found", _corners(diagnosis, files), "In the order in which they were matched; the first is ringed."),
        ("Coverage", _coverage(diagnosis), f"{diagnosis.coverage}. Tilt 0, 0 is a board parallel to the image."),
        ("Errors", _residuals(diagnosis), "Found minus predicted, to the scale of the key: grey each corner, in colour "
         "the mean of a region. A good lens model leaves chance alone, whose means vanish. Pairs that stand out: look "
         "at their pictures, and take them away if they are blurred."),
        ("Lenses", _lenses(diagnosis), "How far the lens moves each pixel from where a pinhole would have it. Hatched: "
         "no board was seen there, the lens is a guess. Grey: it has no direction there, the model folds over."),
        ("Uncertainty", _uncertainty(diagnosis), "One standard deviation of what is measured at "
         f"{diagnosis.error_map.at_mm:g} mm, over the left image, from the calibration alone: matching adds its own, "
         "and a lens model that does not fit is not in it. Hatched: no board was seen there. Grey: out of the right "
         "camera's sight."),
    )  # fmt: skip
    pictures = "\n".join(
        f"<h2>{title}</h2>\n<figure>{''.join(_img(data, title) for data in drawn)}\n"
        f"<figcaption>{escape(caption)}</figcaption></figure>"
        for title, drawn, caption in sections
        if drawn
    )
    color, meaning = _COLORS.get(diagnosis.verdict, "#555555"), VERDICT_MEANINGS.get(diagnosis.verdict, "")
    notes, left_out = [*diagnosis.reasons, *diagnosis.remarks], diagnosis.pairs_left_out
    width, height = diagnosis.views.size
    used = f"{len(diagnosis.pairs_used)} of {len(diagnosis.pairs_used) + len(left_out)} pairs"
    page = f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Stereo calibration: {escape(diagnosis.verdict)}</title>
<style>{_STYLE}</style>
</head>
<body>
<h1>Stereo calibration</h1>
<p><b class="verdict" style="color: {color}">{escape(diagnosis.verdict)}</b>: {meaning}</p>
{_list(notes)}
<p>{escape(board_text(diagnosis.views.board))}; {used} of {width} x {height} px; lens model {escape(diagnosis.model)};
stereolib {__version__}</p>
<h2>Checked</h2>
{_grid(("", "measured", "good up to", "usable up to"), check_rows(diagnosis))}
<h2>Result</h2>
<p>± is one standard deviation.</p>
{_table([*parameter_rows(diagnosis), *meaning_rows(diagnosis)])}
{pictures}
<h2>Pairs</h2>
<p>Used: {escape(", ".join(diagnosis.pairs_used))}.</p>
{_list([f"refused: {name}: {reason}" for name, reason in left_out.items()])}
</body>
</html>
"""
    return write_atomic(path, page)


def _corners(diagnosis: Diagnosis, files: Files) -> list[bytes]:
    from stereolib.plotting import charts

    views = diagnosis.views
    known = [k for k, name in enumerate(views.names) if name in files]
    chosen = known[:: max(1, -(-len(known) // _SHOWN_PAIRS))]
    if not chosen:
        return []
    figure, axes = charts.panels(2, -(-len(chosen) // 2), width_in=12, aspect=0.42)
    for ax, k in zip(axes, chosen, strict=False):
        images = [read_image(file, grey=True) for file in files[views.names[k]]]
        charts.plot_image(np.hstack(images), ax, views.names[k])
        for corners, shift in ((views.left_px[k], 0), (views.right_px[k], views.size[0])):
            charts.plot_corners(None, corners + np.array([shift, 0]), views.board.columns, ax)
    for ax in axes:
        ax.set_axis_off()
    return [charts.save_figure(None, figure).data]


def _coverage(diagnosis: Diagnosis) -> list[bytes]:
    from stereolib.plotting import charts

    views = diagnosis.views
    figure, axes = charts.panels(3, width_in=12, aspect=0.8)
    for ax, side, corners in zip(axes, ("left", "right"), (views.left_px, views.right_px), strict=False):
        charts.plot_points(corners, views.size, ax, f"{side}: corners of {len(views)} pairs")
    about_y, about_x, distances = _tilts(diagnosis)
    charts.plot_dots(about_y, about_x, axes[2], color=distances, label="distance (mm)", title="tilt of the boards",
                       xlabel="left (-) or right (+) side nearer (deg)",
                       ylabel="upper (-) or lower (+) edge nearer (deg)",
                       xlim=(-60, 60), ylim=(-60, 60))  # fmt: skip
    return [charts.save_figure(None, figure).data]


def _tilts(diagnosis: Diagnosis) -> tuple[Array, Array, Array]:
    """Each board's normal against the left camera's axis, sideways and upwards in degrees, and its distance in mm."""
    views, lens = diagnosis.views, diagnosis.rig.left
    found = []
    for corners in views.left_px.astype(float):
        seen = np.isfinite(corners).all(axis=1)
        points = views.board.points_mm[seen].astype(float)
        turn, shift = board_pose(points, corners[seen], lens)
        R = cv2.Rodrigues(turn)[0]
        x, y, z = R[:, 2] * np.sign(R[2, 2])
        found.append((np.degrees(np.arctan2(x, z)), np.degrees(np.arctan2(y, z)), (R @ points.mean(axis=0) + shift)[2]))
    about_y, about_x, distances = np.array(found).T
    return about_y, about_x, distances


def _residuals(diagnosis: Diagnosis) -> list[bytes]:
    from stereolib.plotting import charts

    views, numbers = diagnosis.views, np.arange(1, len(diagnosis.views) + 1)
    figure, axes = charts.panels(2, width_in=12, aspect=0.8)
    for ax, side, at, errors in zip(
        axes, ("left", "right"), (views.left_px, views.right_px), diagnosis.residuals_px, strict=True
    ):
        charts.plot_arrows(at, errors, views.size, ax, side)
    bars, (ax,) = charts.panels(1, width_in=12, aspect=0.26)
    worst = int(np.argmax(diagnosis.pair_rms_px.max(axis=1)))
    curves = {side: (numbers, diagnosis.pair_rms_px[:, k]) for k, side in enumerate(("left", "right"))}
    title = f"rms of each pair; the largest is {views.names[worst]}"
    charts.plot_curves(curves, ax, xlabel="", ylabel="rms (px)", title=title, joined=False, ylim=(0, None))
    ax.set_xticks(numbers, [name[-16:] for name in views.names], rotation=70)
    return [charts.save_figure(None, shown).data for shown in (figure, bars)]


def _lenses(diagnosis: Diagnosis) -> list[bytes]:
    from stereolib.plotting import charts

    cameras = diagnosis.rig.left, diagnosis.rig.right
    if not any(camera.dist.any() for camera in cameras):
        return []
    maps, unseen = [lens_shift_px(camera) for camera in cameras], _unseen(diagnosis)
    high = float(np.nanmax([_largest_seen(shift, hidden) for (_, _, shift), hidden in zip(maps, unseen, strict=True)]))
    figure, axes = charts.panels(2, width_in=12, aspect=0.66)
    for ax, side, (columns, rows, shift), hidden in zip(axes, ("left", "right"), maps, unseen, strict=True):
        charts.plot_map(shift, columns, rows, diagnosis.views.size, ax, side, label="shift by the lens (px)",
                          high=high, unseen=hidden)  # fmt: skip
    return [charts.save_figure(None, figure).data]


def lens_shift_px(camera: Camera, step: int = 10) -> tuple[Array, Array, Array]:
    """How far the lens moves pixels from where a pinhole with the same K has them.

    Returns
    -------
    columns, rows : (w,), (h,) px
        A grid over the image, about `step` apart, that includes its corners.
    shift : (h, w) px
        NaN where the lens has no direction (it folds over).
    """
    columns, rows = (np.linspace(0, n - 1, max(2, n // step + 1)) for n in camera.size)
    pixels = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    ideal = camera.rays(pixels) @ camera.K[:2].T
    return columns, rows, np.hypot(*(pixels - ideal).T).reshape(len(rows), len(columns))


def _uncertainty(diagnosis: Diagnosis) -> list[bytes]:
    from stereolib.plotting import charts

    errors, size = diagnosis.error_map, diagnosis.views.size
    hidden = _unseen(diagnosis)[0]
    figure, axes = charts.panels(2, width_in=12, aspect=0.66)
    for ax, values, what in (
        (axes[0], errors.depth_mm, "depth"),
        (axes[1], errors.length_mm, f"length of {errors.of_mm:g} mm"),
    ):
        charts.plot_map(values, errors.columns_px, errors.rows_px, size, ax, what, label="standard deviation (mm)",
                          high=_largest_seen(values, hidden), unseen=hidden)  # fmt: skip
    return [charts.save_figure(None, figure).data]


def _unseen(diagnosis: Diagnosis) -> list[Array]:
    """Cells of the left and the right image that no board covered, bool."""
    views = diagnosis.views
    return [boards_per_cell(corners, views.size) == 0 for corners in (views.left_px, views.right_px)]


def _largest_seen(values: Array, hidden: Array) -> float:
    """Largest value where boards were seen, but for the last twentieth; the colours end there."""
    seen = cv2.resize((~hidden).astype(np.uint8), values.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
    known = values[seen & np.isfinite(values)]
    return float(np.percentile(known, 95)) if known.size else float("nan")


def _img(data: bytes, title: str) -> str:
    return f'<img alt="{title}" src="data:image/png;base64,{base64.b64encode(data).decode("ascii")}">'


def _list(texts: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{escape(text)}</li>" for text in texts) + "</ul>" if texts else ""


def _grid(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    top = "".join(f"<th>{escape(name)}</th>" for name in head)
    cells = "".join("<tr>" + "".join(f'<td class="n">{escape(text)}</td>' for text in row) + "</tr>\n" for row in rows)
    return f'<div class="rows"><table>\n<tr>{top}</tr>\n{cells}</table></div>'


def _table(rows: Sequence[tuple[str, str]]) -> str:
    cells = "".join(f'<tr><th>{escape(name)}</th><td class="n">{escape(text)}</td></tr>\n' for name, text in rows)
    return f'<div class="rows"><table>\n{cells}</table></div>'
