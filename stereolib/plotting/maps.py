"""Figures of maps, seen from above."""

from __future__ import annotations

from typing import Any

import numpy as np

from stereolib.mapping import COLORS as RGB
from stereolib.mapping import FREE, OCCUPIED, Map, OccupancyGrid, Station
from stereolib.plotting.charts import Axes, Circle, Ellipse, Polygon

Array = np.ndarray


def plot_top_view(
    found: Map, ax: Axes, title: str = "", *, times: float = 10.0, true_mm: list[Array] | None = None
) -> Axes:
    """A map from above: walls, outlines with names and sizes, stations with their heading, errors as ellipses.

    Parameters
    ----------
    found : Map
    times : float
        Ellipses are so many standard deviations of an object's place, as one would not be visible.
    true_mm : list of (N, 2) arrays, optional
        True outlines, dotted.
    """
    readings = found.readings_mm
    ax.scatter(readings[:, 0], readings[:, 1], s=2, color="0.75", lw=0, zorder=1)
    for wall in found.walls:
        ax.plot(*wall.ends_mm.T, color="0.25", lw=2.5, solid_capstyle="projecting", zorder=2)
    for k, (name, thing) in enumerate(zip(found.names, found.measured, strict=True)):
        color = tuple(c / 255 for c in RGB[k % len(RGB)])
        outline = thing.outline_mm[np.isfinite(thing.outline_mm).all(axis=1)]
        ax.add_patch(Polygon(outline, closed=len(outline) > 2, fc=(*color, 0.35), ec=color, lw=1.8, zorder=3))
        _ellipse(thing.position_mm, times**2 * np.nan_to_num(thing.position_covariance), ax, color)
        sizes = " x ".join(f"{v / 10:.1f}" if np.isfinite(v) else "?" for v in thing.size_mm)
        ax.plot([], [], "s", color=color, label=f"{name}  {sizes} cm")
        top = outline[:, 1].max() if len(outline) else thing.position_mm[1]
        ax.annotate(name, (float(thing.position_mm[0]), float(top)), (0, 3), ha="center", va="bottom",
                    textcoords="offset points", weight="bold", color=color, zorder=6)  # fmt: skip
    for outline in true_mm or []:
        ax.add_patch(Polygon(outline, fill=False, ec="black", ls=":", lw=1.0, zorder=4))
    for k, station in enumerate(found.stations, start=1):
        plot_station(station, ax, str(k))
    if found.objects:
        ax.legend(
            title="length x width x height", loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False, fontsize=9,
            borderaxespad=0,
        )  # fmt: skip
    return _floor_axes(ax, title)


def plot_station(station: Station, ax: Axes, name: str, *, color: str = "black") -> Axes:
    """A station as a disc with its number; the line points to where the camera looks."""
    x, y, yaw = station.pose
    ax.plot([x, x + 230 * np.cos(yaw)], [y, y + 230 * np.sin(yaw)], color=color, lw=1.5, zorder=5)
    ax.add_patch(Circle((x, y), 65, fc=color, ec="white", zorder=5))
    ax.text(x, y, name, color="white", ha="center", va="center", fontsize=8, zorder=6)
    return ax


def plot_scans(stations: tuple[Station, ...], ax: Axes, title: str = "") -> Axes:
    """The readings of all stations in the map, a colour each: where poses are wrong, walls are double."""
    for k, station in enumerate(stations, start=1):
        color = tuple(c / 255 for c in RGB[(k - 1) % len(RGB)])
        readings = station.to_map(station.scan_mm)
        ax.scatter(readings[:, 0], readings[:, 1], s=3, color=color, lw=0, label=f"station {k}")
        plot_station(station, ax, str(k), color=color)  # type: ignore[arg-type]
    return _floor_axes(ax, title)


def plot_grid(grid: OccupancyGrid, ax: Axes, title: str = "") -> Axes:
    """An occupancy grid: taken cells black, free ones white, unknown ones grey."""
    rows, columns = grid.cells.shape
    x, y = grid.origin_mm
    extent = (x, x + columns * grid.resolution_mm, y, y + rows * grid.resolution_mm)
    ax.imshow(grid.cells, cmap="gray", vmin=OCCUPIED, vmax=FREE, origin="lower", extent=extent, interpolation="nearest")
    return _floor_axes(ax, title)


def plot_sizes(
    labels: list[str], errors_mm: Array, std_mm: Array, ax: Axes, *, color: Any, name: str, shift: float = 0.0
) -> Axes:
    """Errors of sizes with bars of 1.96 standard deviations, one row a size; the truth is the line at zero."""
    rows = np.arange(len(labels)) + shift
    ax.errorbar(
        errors_mm, rows, xerr=1.96 * np.asarray(std_mm), fmt="o", ms=4, lw=1.2, capsize=2, color=color, label=name
    )
    ax.axvline(0, color="0.4", lw=0.8)
    ax.set_yticks(np.arange(len(labels)), labels, fontsize=8)
    ax.set(ylim=(len(labels) - 0.4, -0.6), xlabel="error, with 95 % interval (mm)")
    ax.grid(alpha=0.3, axis="x")
    return ax


def _ellipse(centre: Array, covariance: Array, ax: Axes, color: Any) -> None:
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
