"""What the sliders about the laser and the map draw (notebooks 05 and 08), and who of the stations saw which box."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from stereolib.base import UInt8, wrap_rad
from stereolib.mapping import disturb_poses, join_clouds, map_solids, merge_stations, refine_poses

if TYPE_CHECKING:
    import pandas as pd

    from stereolib.mapping import Cloud, Map, Solid

_ASTRAY_MM, _ASTRAY_RAD = 50.0, np.radians(3.0)  # from its true pose: a station that matching has not put in its place


def draw_sweep(
    turns: int, albedo: float, distance_mm: int, yaw_deg: int, noise: float = 1.0, bias_mm: float = 0.0
) -> tuple[UInt8, str]:
    """Notebook 05: the laser's sweep over a cube of some darkness, and the error on its faces.

    Parameters
    ----------
    turns : int
        The median of so many is drawn: the more, the less noise.
    albedo : float
        Share of the light that the cube sends back: 0.02 is black.
    distance_mm : int
        From the laser to the cube's near edge.
    yaw_deg : int
        At 45 an edge of the cube is nearest, at 0 a face.
    noise : float
        Of each reading, in times an XV-11's.
    bias_mm : float
        Added to every reading; no number of turns takes it away.

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    from stereolib import laser, virtual
    from stereolib.plotting import TRUTH, figure_to_image, panels, plot_scan
    from stereolib.virtual import VirtualLidar, recordings, walk

    cube = virtual.cube_scene(distance_mm, yaw_rad=np.radians(yaw_deg))
    shade = virtual.Material((albedo,) * 3)
    painted = replace(cube, boxes=(cube.boxes[0], replace(cube.boxes[1], materials=(shade,))))
    usual = VirtualLidar()
    sigmas = {"sigma_mm": noise * usual.sigma_mm, "sigma_per_mm": noise * usual.sigma_per_mm}
    sensor = VirtualLidar(**sigmas, bias_mm=(usual.bias_mm[0] + bias_mm, *usual.bias_mm[1:]))
    data = sensor.scan(painted, recordings.LASER_POSE, np.random.default_rng(0), turns)
    merged = laser.average(laser.turns(laser.decode(data)))
    true_mm = sensor.truth_mm(painted, recordings.LASER_POSE)
    on_cube = true_mm < sensor.truth_mm(replace(cube, boxes=cube.boxes[:1]), recordings.LASER_POSE) - 1
    figure, axes = panels(1, width_in=6, aspect=0.75)
    plot_scan(laser.points_mm(merged), axes[0], "the cube from above (virtual rig)", label=f"median of {turns} turns")
    axes[0].collections[0].set_sizes([20])
    outline = walk.outline_mm(painted.boxes[1])[[0, 1, 2, 3, 0]]
    axes[0].plot(-outline[:, 1], outline[:, 0], color=TRUTH, lw=1, ls=":", label="true outline")
    axes[0].legend(loc="upper right", fontsize=9)
    axes[0].set(xlim=(-350, 350), ylim=(distance_mm - 75, distance_mm + 450))
    error, lost = np.abs(merged.ranges_mm - true_mm)[on_cube], np.isnan(merged.ranges_mm[on_cube]).mean()
    median = f"{np.nanmedian(error):.1f} mm" if lost < 1 else "unknown"
    return figure_to_image(figure), f"{on_cube.sum()} beams meet the cube, {lost:.0%} lost; median error {median}"


def draw_map_view(azimuth_deg: int, elevation_deg: int, show: str) -> tuple[UInt8, str]:
    """Notebook 08: the walk's map in space, as solids or as coloured points.

    Parameters
    ----------
    azimuth_deg : int
        From where one looks, around the room.
    elevation_deg : int
        90 looks straight down.
    show : str
        The boxes as solids, or the points that the pairs matched.

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    from stereolib.mapping import view_map

    merged, made, points = _walk_map()
    shown = points if show == "points" else None
    picture = view_map(merged, made, azimuth_deg=azimuth_deg, elevation_deg=elevation_deg, points=shown)
    (volume, std), (area, area_std) = merged.volume_l, merged.surface_m2
    text = f"{len(merged.objects)} objects, {volume:.2f} ± {std:.2f} litres, {area:.3f} ± {area_std:.3f} m² of surface"
    return picture, text + f"; {len(merged.walls)} walls, {len(points.points_mm)} points"


def draw_matching(off_mm: int, off_deg: float, chance: int) -> tuple[UInt8, str]:
    """Notebook 08: scans of the walk at poses that are off, and after matching.

    Parameters
    ----------
    off_mm : int
        Each station's place is off by up to so much.
    off_deg : float
        Each station's direction is off by up to so much.
    chance : int
        Each number draws other errors.

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    from stereolib.plotting import figure_to_image, panels, plot_scans

    stations = _walk_map()[0].stations
    start = disturb_poses(stations, np.random.default_rng(chance), off_mm, np.radians(off_deg))
    match = refine_poses(start)
    errors = np.abs([a.pose - b.pose for a, b in zip(match.stations, stations, strict=True)])
    errors[:, 2] = np.abs(wrap_rad(errors[:, 2]))
    wrong = [k for k, error in enumerate(errors, start=1) if (error > (_ASTRAY_MM, _ASTRAY_MM, _ASTRAY_RAD)).any()]
    figure, axes = panels(2, width_in=11, aspect=0.85, sharex=True, sharey=True)
    plot_scans(start, axes[0], f"poses off by up to {off_mm} mm and {off_deg:g} degrees")
    plot_scans(match.stations, axes[1], f"after matching: {len(wrong)} of {len(stations)} in a wrong place")
    worst = f"{errors[:, :2].max():.1f} mm and {np.degrees(errors[:, 2].max()):.2f} degrees"
    text = f"readings {match.rms_before_mm:.0f} mm off their lines before and {match.rms_after_mm:.1f} mm after"
    if not wrong:
        return figure_to_image(figure), f"put together: {text}; the worst pose is off by {worst}"
    numbers = " and ".join(map(str, wrong))
    text = f"NOT put together: station {numbers} in a wrong place, the worst off by {worst}, though {text}"
    return figure_to_image(figure), text


def draw_pose(x_mm: int, y_mm: int, yaw_deg: float) -> tuple[UInt8, str]:
    """Notebook 08: the scan of the walk's last station at a pose set by hand, over what the others saw.

    Parameters
    ----------
    x_mm : int
        Where the laser is believed to stand, forward.
    y_mm : int
        Where the laser is believed to stand, to the left.
    yaw_deg : float
        In which direction its beam 0 is believed to look.

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    from scipy.spatial import cKDTree

    from stereolib.plotting import LASER, figure_to_image, panels

    *others, last = _walk_map()[0].stations
    moved = replace(last, pose=np.array([x_mm, y_mm, np.radians(yaw_deg)]))
    seen = np.concatenate([station.to_map(station.scan_mm) for station in others])
    readings = moved.to_map(moved.scan_mm)
    figure, axes = panels(1, width_in=6.5, aspect=0.85)
    axes[0].scatter(*seen.T, s=5, color="0.65", lw=0)
    axes[0].scatter(*readings.T, s=8, color=LASER, lw=0)
    axes[0].set(
        xlabel="x, forward (mm)", ylabel="y, left (mm)", aspect="equal", title="station 5 over what the others saw"
    )
    off_mm = np.median(cKDTree(seen).query(readings)[0])
    return figure_to_image(figure), f"half of the readings lie within {off_mm:.0f} mm of what the others saw"


def who_saw(room: Map) -> pd.DataFrame:
    """Notebook 08: by what each station saw each box of a map.

    Parameters
    ----------
    room : Map

    Returns
    -------
    pandas.DataFrame
        A row a box, a column a station. ``pictures``: they gave its height, with or without the
        laser's help; ``laser``: the scan alone; with a star where the map does not use it; ``-``: not seen.
    """
    import pandas as pd

    stations = range(1, len(room.stations) + 1)
    table = pd.DataFrame("-", index=list(room.names), columns=list(stations))
    used = dict(zip(room.names, (each.stations for each in room.objects), strict=True))
    for k in stations:
        for name, thing in zip(room.names_of(k), room.stations[k - 1].objects, strict=True):
            if name:
                by = "pictures" if np.isfinite(thing.size_mm[2]) else "laser"
                table.loc[name, k] = by + "*" * (k not in used[name])
    return table


@lru_cache(maxsize=1)
def _walk_map() -> tuple[Map, list[Solid], Cloud]:
    """The map of the recorded walk at its known poses, its solids and its points."""
    from stereolib.mapping import Station, colored_cloud
    from stereolib.virtual import measure_walk, walk

    measured = measure_walk()
    stations = [Station.of(each, walk.POSES[name]) for name, each in measured.items()]
    clouds = [
        colored_cloud(m.disparity_px, m.left, m.floor, pose=walk.POSES[n], max_mm=1600.0) for n, m in measured.items()
    ]
    merged = merge_stations(stations, rng=np.random.default_rng(8))
    return merged, map_solids(merged), join_clouds(clouds)
