"""Scans and maps, seen from above."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Ellipse, Patch, Polygon

from stereolib.base import Float64, Floats
from stereolib.mapping import FREE, OCCUPIED, UNKNOWN, Map, OccupancyGrid, Station, station_names
from stereolib.measurement import OBJECT_RGB, Measurement, draw_objects
from stereolib.plotting.pictures import plot_image
from stereolib.plotting.style import LASER, OURS, RIVAL, as_written, default_style

_DISC_MM, _HEADING_MM = 65, 330  # of a station: its radius, and how far its line reaches, beyond a neighbour's disc
_TIMES, _LONGEST_MM = (100.0, 50.0, 20.0, 10.0, 5.0, 2.0), 250.0  # an ellipse is enlarged so, and is then no longer
_OVER_RING: dict[str, Any] = {"facecolor": "white", "lw": 0, "pad": 1}
_ROW_STEP = 0.34  # between the series of `plot_sizes`, in rows
_SERIES_COLORS = (RIVAL, OURS, LASER)
_STATION_COLORS = ("#332288", "#CC6677", "#44AA99", "#AA7711", "#77AADD")  # not the boxes'; after Tol (2021)


@default_style
def plot_scan(
    points_mm: Float64,
    ax: Axes,
    title: str = "",
    *,
    label: str | None = None,
    color: str = LASER,
    zoom_mm: tuple[float, float, float, float] | None = None,
) -> Axes:
    """Draw laser readings from above; forward is up, as the robot looks.

    Parameters
    ----------
    points_mm : (N, 2) float, mm
    ax : matplotlib.axes.Axes
    title : str
    label : str, optional
        For the legend.
    color : str
    zoom_mm : (left, right, rear, front), optional
        Ends of a part that is shown enlarged in the rear of the room: to the right and forward, mm.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax.scatter(-points_mm[:, 1], points_mm[:, 0], s=5, color=color, label=label, lw=0)
    if zoom_mm:
        glass = ax.inset_axes((0.2, 0.13, 0.45, 0.26))
        glass.scatter(-points_mm[:, 1], points_mm[:, 0], s=8, color=color, lw=0)
        glass.set(xlim=zoom_mm[:2], ylim=zoom_mm[2:], xticks=zoom_mm[:2], yticks=zoom_mm[2:])
        glass.tick_params(labelsize=8)
        ax.indicate_inset_zoom(glass, edgecolor="black", alpha=1.0)
    ax.plot(0, 0, "^", color="black", ms=8)
    ax.set(title=title, xlabel="to the right (mm)", ylabel="forward (mm)", aspect="equal")
    ax.grid(alpha=0.3)
    return ax


@default_style
def plot_scan_polar(angles_rad: Float64, ranges_mm: Float64, ax: Axes, title: str = "", *, color: str = LASER) -> Axes:
    """Draw laser readings in the sensor's own polar frame; dropouts are crosses on the rim, named below.

    Parameters
    ----------
    angles_rad : (N,) float, rad
    ranges_mm : (N,) float, mm
        NaN is a dropout.
    ax : matplotlib.axes.Axes
        With ``projection="polar"``.
    title : str
    color : str

    Returns
    -------
    matplotlib.axes.Axes
    """
    polar: Any = ax
    polar.set_theta_zero_location("N")
    polar.scatter(angles_rad, ranges_mm, s=5, color=color, lw=0)
    lost = ~np.isfinite(ranges_mm)
    rim = 1.0 if lost.all() else 1.05 * np.nanmax(ranges_mm)
    polar.scatter(angles_rad[lost], np.full(lost.sum(), rim), s=36, marker="x", color="black", lw=1.2)
    polar.set_title(title, pad=14)
    polar.set_xlabel("\N{MULTIPLICATION SIGN}: no reading" if lost.any() else "")
    rings_mm = np.arange(1000.0, max(1001.0, rim), 1000.0)
    polar.set_rgrids(rings_mm, labels=[])
    angle = _free_angle_rad(angles_rad, ranges_mm, rings_mm)
    for ring in rings_mm:
        polar.text(angle, ring, f"{ring:.0f}", ha="center", va="center", fontsize=9, bbox=_OVER_RING)
    polar.tick_params(labelsize=9)
    return ax


def _free_angle_rad(angles_rad: Float64, ranges_mm: Float64, rings_mm: Floats) -> float:
    """Where the rings' labels are farthest from any reading."""
    x, y = ranges_mm * np.cos(angles_rad), ranges_mm * np.sin(angles_rad)
    seen = np.isfinite(x)
    candidates = np.radians(np.arange(0, 360, 3.0))
    apart = [
        np.hypot(x[seen] - ring * np.cos(a), y[seen] - ring * np.sin(a)).min(initial=np.inf)
        for a in candidates
        for ring in rings_mm
    ]
    return float(candidates[np.reshape(apart, (len(candidates), -1)).min(axis=1).argmax()])


@default_style
def plot_top_view(room: Map, ax: Axes, title: str = "", *, true_mm: list[Float64] | None = None) -> Axes:
    """Draw a map from above: walls, outlines with names and sizes, stations with their heading, errors as ellipses.

    Ellipses are so many standard deviations of an object's place, up to 100, as make the largest one no longer than a
    small box; the legend says how many.

    Parameters
    ----------
    room : Map
    ax : matplotlib.axes.Axes
    title : str
    true_mm : list of (N, 2) arrays, optional
        True outlines, dotted.

    Returns
    -------
    matplotlib.axes.Axes
    """
    times, readings = _enlarged(room), room.readings_mm
    if len(readings):  # over the walls on which most of them lie
        dots: dict[str, Any] = {"s": 4, "facecolor": "white", "edgecolor": "0.25", "lw": 0.4, "zorder": 3.5}
        ax.scatter(readings[:, 0], readings[:, 1], **dots, label="the laser's readings")
    for wall in room.walls:
        ax.plot(*wall.ends_mm.T, color="0.25", lw=2.5, solid_capstyle="projecting", zorder=2)
    for k, (name, item) in enumerate(zip(room.names, room.measured, strict=True)):
        color = tuple(c / 255 for c in OBJECT_RGB[k % len(OBJECT_RGB)])
        outline = item.outline_mm[np.isfinite(item.outline_mm).all(axis=1)]
        ax.add_patch(Polygon(outline, closed=len(outline) > 2, fc=(*color, 0.35), ec=color, lw=1.8, zorder=3))
        _ellipse(item.position_mm, times**2 * np.nan_to_num(item.position_covariance), ax, color)
        sizes = " x ".join(f"{v:.0f}" if np.isfinite(v) else "?" for v in item.size_mm)
        ax.plot([], [], "s", color=color, label=f"{name}  {sizes} mm")
        end = outline[outline[:, 1].argmax()] if len(outline) else item.position_mm
        ax.annotate(
            name,
            (float(end[0]), float(end[1])),
            (0, 3),
            ha="center",
            textcoords="offset points",
            weight="bold",
            color=color,
            zorder=6,
        )
    for outline in true_mm or []:
        ax.add_patch(Polygon(outline, fill=False, ec="black", ls=":", lw=1.0, zorder=4))
    if true_mm:
        ax.plot([], [], ":", color="black", lw=1.0, label="the true outlines")
    for station, name in zip(room.stations, station_names(room.stations), strict=True):
        plot_station(station, ax, name)
    ax.plot([], [], "-", color="black", lw=1.5, label="from a station,\nwhere its camera looks")
    if room.objects:
        larger = f",\n{times:g} times enlarged" if times > 1 else ""
        label = f"ellipse: standard\ndeviation of a place{larger}"
        ax.plot([], [], "o", mfc="none", mec="0.25", label=label)
    if room.objects or len(readings):
        ax.legend(
            title="length x width x height" if room.objects else "",
            loc="upper left",
            bbox_to_anchor=(1.01, 1.0),
            frameon=False,
            fontsize=10,
            borderaxespad=0,
        )
    return _floor_axes(ax, title)


@default_style
def plot_station(station: Station, ax: Axes, name: str, *, color: Any = "black") -> Axes:
    """Draw a station as a disc with its number; the line points to where the camera looks.

    Parameters
    ----------
    station : Station
    ax : matplotlib.axes.Axes
    name : str
    color : str or (red, green, blue)

    Returns
    -------
    matplotlib.axes.Axes
    """
    x, y, yaw = station.pose
    end = x + _HEADING_MM * np.cos(yaw), y + _HEADING_MM * np.sin(yaw)
    ax.plot([x, end[0]], [y, end[1]], color=color, lw=1.5, zorder=4.5)  # behind all discs, those of neighbours too
    ax.add_patch(Circle((x, y), _DISC_MM, fc=color, ec="white", zorder=5))
    ax.text(x, y, as_written(name), color="white", ha="center", va="center", fontsize=8, zorder=6)
    return ax


@default_style
def plot_scans(stations: Sequence[Station], ax: Axes, title: str = "") -> Axes:
    """Draw the readings of all stations in the map, a colour each: where poses are wrong, walls are double.

    Parameters
    ----------
    stations : sequence of Station
    ax : matplotlib.axes.Axes
    title : str

    Returns
    -------
    matplotlib.axes.Axes
    """
    for k, (station, name) in enumerate(zip(stations, station_names(stations), strict=True)):
        color = _STATION_COLORS[k % len(_STATION_COLORS)]
        readings = station.to_map(station.scan_mm)
        ax.scatter(readings[:, 0], readings[:, 1], s=6, color=color, lw=0, label=f"station {as_written(name)}")
        plot_station(station, ax, name, color=color)
    return _floor_axes(ax, title)


@default_style
def plot_sightings(
    measured: Measurement, names: Sequence[str], ax: Axes, title: str = "", *, pixels: bool = False
) -> Axes:
    """Draw a station's picture with the boxes whose height the picture gave; what the laser alone saw is left out.

    Parameters
    ----------
    measured : Measurement
    names : sequence of str
        Of all its objects, from `Map.names_of`.
    ax : matplotlib.axes.Axes
    title : str
    pixels : bool
        Draw the axes, by which pixels can be read off.

    Returns
    -------
    matplotlib.axes.Axes
    """
    seen = [k for k, thing in enumerate(measured.objects) if np.isfinite(thing.size_mm[2])]
    pictured = replace(measured, objects=tuple(measured.objects[k] for k in seen))
    plot_image(draw_objects(pictured, names=[names[k] for k in seen]), ax, title)
    if not pixels:
        ax.set_axis_off()
    return ax


@default_style
def plot_occupancy(grid: OccupancyGrid, ax: Axes, title: str = "") -> Axes:
    """Draw an occupancy grid: taken cells black, free ones white, unknown ones grey, as the legend below it says.

    Parameters
    ----------
    grid : OccupancyGrid
    ax : matplotlib.axes.Axes
    title : str

    Returns
    -------
    matplotlib.axes.Axes
    """
    rows, columns = grid.cells.shape
    x, y = grid.origin_mm
    extent = (x, x + columns * grid.resolution_mm, y, y + rows * grid.resolution_mm)
    ax.imshow(grid.cells, cmap="gray", vmin=OCCUPIED, vmax=FREE, origin="lower", extent=extent, interpolation="nearest")
    kinds = {"taken": OCCUPIED, "free": FREE, "unknown": UNKNOWN}
    grey = {name: str((level - OCCUPIED) / (FREE - OCCUPIED)) for name, level in kinds.items()}
    keys = [Patch(facecolor=grey[name], edgecolor="0.5", lw=0.5, label=name) for name in kinds]
    ax.legend(handles=keys, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=len(keys), frameon=False)
    return _floor_axes(ax, title)


@default_style
def plot_sizes(labels: Sequence[str], series: Mapping[str, tuple[Any, ...]], ax: Axes) -> Axes:
    """Draw errors of sizes with bars of 1.96 standard deviations, one row a size; the truth is the line at zero.

    Parameters
    ----------
    labels : sequence of str
        One a size.
    series : mapping of str to (errors, standard deviations) or (errors, standard deviations, open), mm
        At most three, each with one value a size; where ``open`` is true the dot is empty.
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
    """
    for k, (name, (errors_mm, std_mm, *hollow)) in enumerate(series.items()):
        rows = np.arange(len(labels)) + _ROW_STEP * (k - (len(series) - 1) / 2)
        look: dict[str, Any] = {"fmt": "o", "ms": 5, "lw": 2, "capsize": 3, "color": _SERIES_COLORS[k], "label": name}
        ax.errorbar(errors_mm, rows, xerr=1.96 * np.asarray(std_mm), **look)
        for empty in hollow:
            ax.plot(errors_mm[empty], rows[empty], "o", ms=3, color="white", zorder=3)
        ax.axvline(0, color="0.4", lw=0.8)
    ax.set_yticks(np.arange(len(labels)), labels)
    ax.set(ylim=(len(labels) - 0.4, -0.6), xlabel="error and 95 % interval (mm)")
    ax.grid(alpha=0.3, axis="x")
    return ax


def _enlarged(room: Map) -> float:
    """How many times ellipses are enlarged: a round number that leaves the largest no longer than a small box."""
    covariances = [np.nan_to_num(item.position_covariance) for item in room.measured]
    most_mm = 2 * np.sqrt(max((np.linalg.eigvalsh(each)[-1] for each in covariances), default=0.0))
    return next((times for times in _TIMES if times * most_mm <= _LONGEST_MM), 1.0)


def _ellipse(centre: Float64, covariance: Float64, ax: Axes, color: Any) -> None:
    values, vectors = np.linalg.eigh(covariance)
    angle = float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])))
    width, height = 2 * np.sqrt(np.maximum(values[::-1], 0))
    ax.add_patch(
        Ellipse(
            (float(centre[0]), float(centre[1])), width, height, angle=angle, fill=False, ec=color, lw=1.2, zorder=5
        )
    )


def _floor_axes(ax: Axes, title: str) -> Axes:
    ax.set(title=title, xlabel="x, forward (mm)", ylabel="y, left (mm)", aspect="equal")
    ax.margins(0.04)
    return ax
