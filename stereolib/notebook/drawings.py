"""What the notebooks' sliders draw: each function takes a few numbers and returns a picture and a line of text."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np

from stereolib import paper
from stereolib.mapping import disturb_poses, refine_poses
from stereolib.matching import SGBMParams, compute_disparity, repair, score
from stereolib.paper import HeightResult, height_by_maximum, height_of_top
from stereolib.rig import Camera, StereoRig, rigid

if TYPE_CHECKING:
    from stereolib.mapping import Cloud, Map, Solid

Array = np.ndarray


def draw_verdicts(verdict: str) -> tuple[Array, str]:
    """Notebook 00: how many rows of each notebook got a verdict."""
    from stereolib.plotting import panels, picture_of, plot_bars

    rows = paper.recorded()
    chosen = rows[rows["verdict"] == verdict]
    figure, axes = panels(1, width_in=7, aspect=0.45)
    counts = chosen["notebook"].value_counts(sort=False).sort_index()
    plot_bars({str(name): int(n) for name, n in counts.items()}, axes[0], xlabel="rows", title=verdict)
    return picture_of(figure), ", ".join(chosen["id"])


def draw_sweep(turns: int, albedo: float, distance_mm: int, yaw_deg: int) -> tuple[Array, str]:
    """Notebook 05: the laser's sweep over a cube of some darkness, and the error on its faces."""
    from stereolib import laser, virtual
    from stereolib.plotting import panels, picture_of, plot_scan
    from stereolib.virtual import VirtualLidar, recordings

    cube = virtual.cube_scene(distance_mm, yaw_rad=np.radians(yaw_deg))
    shade = virtual.Material((albedo,) * 3)
    painted = replace(cube, boxes=(cube.boxes[0], replace(cube.boxes[1], materials=(shade,))))
    sensor = VirtualLidar()
    data = sensor.scan(painted, recordings.LASER_POSE, np.random.default_rng(0), turns)
    found = laser.average(laser.turns(laser.decode(data)))
    true_mm = sensor.truth_mm(painted, recordings.LASER_POSE)
    on_cube = true_mm < sensor.truth_mm(replace(cube, boxes=cube.boxes[:1]), recordings.LASER_POSE) - 1
    figure, axes = panels(1, width_in=6, aspect=0.9)
    plot_scan(laser.points_mm(found), axes[0], f"median of {turns} turns")
    axes[0].set(xlim=(-700, 700), ylim=(-100, distance_mm + 600))
    error, lost = np.abs(found.ranges_mm - true_mm)[on_cube], np.isnan(found.ranges_mm[on_cube]).mean()
    median = f"{np.nanmedian(error):.1f} mm" if lost < 1 else "unknown"
    return picture_of(figure), f"{on_cube.sum()} beams meet the cube, {lost:.0%} lost; median error {median}"


def draw_lens(k1: float, k2: float, k3: float, p1: float) -> tuple[Array, str]:
    """Notebook 01: straight lines through a lens with the right camera's K and p2."""
    right = paper.paper_rig().right
    K = right.K
    camera = Camera(K, np.array([k1, k2, p1, right.dist[3], k3]), right.size)
    canvas = np.full((480, 640, 3), 255, np.uint8)
    for axis, (length, other) in enumerate(((640, 480), (480, 640))):
        for at in np.linspace(0, other - 1, 13):
            line = np.full((81, 2), at)
            line[:, axis] = np.linspace(0, length - 1, 81)
            rays = np.column_stack([(line - K[:2, 2]) / K[[0, 1], [0, 1]], np.ones(81)])
            for color, points in (((205, 205, 205), line), ((178, 114, 0), camera.project(rays))):
                cv2.polylines(canvas, [np.rint(points * 8).astype(np.int32)], False, color, 1, cv2.LINE_AA, 3)
    corners = np.array([[0, 0], [639, 0], [0, 479], [639, 479]], float)
    rays = np.column_stack([(corners - K[:2, 2]) / K[[0, 1], [0, 1]], np.ones(4)])
    moved = np.linalg.norm(camera.project(rays) - corners, axis=1).max()
    folded = int(np.isnan(camera.rays(_pixel_grid(camera))[:, 0]).sum())
    return canvas, f"worst corner moves {moved:.1f} px; pixels without a direction (the lens folds): {folded}"


def draw_rectification(alpha: float, roll_error_deg: float) -> tuple[Array, str]:
    """Notebook 02: the cube pair rectified by a rig whose right camera is believed to be rolled."""
    from stereolib.virtual import recordings

    true = paper.paper_rig()
    turn = cv2.Rodrigues(np.array([0.0, 0.0, np.radians(roll_error_deg)]))[0]
    rectified = StereoRig(true.left, true.right, turn @ true.R, true.T).rectify(alpha)
    left, right = rectified.rectify(*recordings.load_pair("conditions/texture"))
    points = np.random.default_rng(0).uniform([-250, -150, 700], [250, 150, 1000], (200, 3))
    seen = (
        (true.left.project(points), "left"),
        (true.right.project(points @ true.R.T + true.T), "right"),
    )
    rows = [rectified.rectify_points(pixels, side)[:, 1] for pixels, side in seen]
    rms = np.sqrt(np.mean((rows[0] - rows[1]) ** 2))
    picture = np.hstack([left, right])
    picture[40::60] = (230, 180, 90)
    return picture, f"focal length {rectified.f_px:.1f} px; rows differ by {rms:.2f} px rms"


def draw_motorcycle(num_disparities: int, block_size: int, uniqueness_ratio: int) -> tuple[Array, str]:
    """Notebook 09: the real pair, matched."""
    from skimage.data import stereo_motorcycle

    from stereolib.plotting import colored

    left, right, truth = stereo_motorcycle()
    params = SGBMParams(num_disparities, block_size, uniqueness_ratio=uniqueness_ratio)
    disparity = compute_disparity(left, right, params, whole=True)
    quality = score(disparity, np.where(np.isfinite(truth), truth, np.nan))
    text = f"bad 2: {quality.bad2_pct:.1f} % of the pixels; returned: {quality.density_pct:.0f} %"
    return np.hstack([left[..., ::-1], colored(disparity, 0, 70)]), text


def _pixel_grid(camera: Camera) -> Array:
    width, height = camera.size
    return np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).reshape(-1, 2)


@lru_cache(maxsize=4)
def _cube(
    distance_mm: float, yaw_deg: float, pitch_deg: float, side: str, lateral_mm: float = 0.0, tall_mm: float = 300.0
) -> Array:
    """Rectified picture of the cube from the virtual rig, one ray a pixel; kept for the sliders that change nothing."""
    from stereolib import virtual
    from stereolib.virtual import recordings

    rectified = recordings.rectified()
    rig = rectified.rig  # the same objects every time: the renderer keeps a camera's rays
    pose = paper.rig_pose(rectified, np.radians(pitch_deg), paper.paper_setup().camera_height_mm)
    camera = rig.left if side == "left" else rig.right
    T_camera_world = pose if side == "left" else rigid(rig.R, rig.T) @ pose
    size = (300.0, 300.0, tall_mm)
    cube = virtual.cube_scene(distance_mm, size_mm=size, yaw_rad=np.radians(yaw_deg), lateral_mm=lateral_mm)
    light = virtual.render(cube, camera, T_camera_world, samples=1, light_samples=1)
    picture = virtual.Webcam().shoot(light, np.random.default_rng([6, side == "left"]))
    return rectified.rectify(picture, picture)[side == "right"]


def draw_recipe(set_up: str, rows: int, tolerance_px: float, dilate_px: int) -> tuple[Array, str]:
    """Notebook 06: the paper's recipe with its knobs, on a recording of either set-up."""
    from stereolib.virtual import recordings

    left, right = recordings.rectified().rectify(*recordings.load_pair(f"conditions/{_RECORDED[set_up]}"))
    found = height_by_maximum(
        compute_disparity(left, right, SGBMParams(128)), paper.value("scale.cm_per_px"), rows,
        tolerance_px=tolerance_px, dilate_px=dilate_px,
    )  # fmt: skip
    picture = _marked(left, found)
    ray_mm = height_of_top(recordings.rectified(), recordings.setup(set_up), found)
    text = f"{found.mask.sum()} pixels count, rows {found.top_row} to {found.foot_row}: "
    return picture, text + f"the recipe reads {found.height_mm / 10:.1f} cm, the top pixel's ray {ray_mm / 10:.1f} cm"


_RECORDED = {"pitched": "texture", "level": "level"}


def draw_heights(distance_mm: float, yaw_deg: float, lateral_mm: float, height_mm: float) -> tuple[Array, str]:
    """Notebook 06: a box of some height is moved; the paper's reading and the ground plane's beside the truth."""
    from stereolib.measurement import attempt_height
    from stereolib.plotting import panels, picture_of, plot_found
    from stereolib.virtual import recordings

    rectified = recordings.rectified()
    view = paper.solve_pitch(rectified, paper.paper_setup())
    where = (distance_mm, yaw_deg, float(np.degrees(view.pitch_rad)))
    left, right = (_cube(*where, side, lateral_mm, height_mm) for side in ("left", "right"))
    tolerance = view.disparity_foot_px - view.disparity_top_px + 2  # SGBM's scatter with one ray a pixel
    recipe = height_by_maximum(
        compute_disparity(left, right, SGBMParams(160)), paper.value("scale.cm_per_px"),
        paper.value("height.constant_rows"), tolerance_px=tolerance,
    )  # fmt: skip
    attempt = attempt_height(left, right, rectified)
    figure, axes = panels(1, width_in=6.4)
    plot_found(attempt, axes[0], f"floor, faces, near edge, top: {attempt.refused or 'measured'} (virtual rig)")
    ours = f"{attempt.height_mm / 10:.2f} ± {0.196 * attempt.std_mm:.2f} cm (95 %)"
    ours = f"refused, {attempt.refused}" if attempt.refused else ours
    text = f"true height {height_mm / 10:.1f} cm; the paper's recipe reads {recipe.height_mm / 10:.1f} cm, "
    return np.hstack([_marked(left, recipe), picture_of(figure)]), text + f"the ground plane {ours}"


def _marked(left: Array, found: HeightResult) -> Array:
    """A picture with the pixels that the recipe counted, its two rows, and a ring around its top pixel."""
    picture = left.copy()
    picture[found.mask] = (0, 94, 213)
    for row in (found.top_row, found.foot_row):
        cv2.line(picture, (0, row), (639, row), (233, 180, 86), 1)
    cv2.circle(picture, (found.column, found.top_row), 7, (255, 255, 255), 2, cv2.LINE_AA)
    return picture


def draw_width(distance_mm: float, yaw_deg: float, pitch_deg: float) -> tuple[Array, str]:
    """Notebook 07: width of the cube in pixels, and what a pixel stands for, over distance."""
    from stereolib.virtual import recordings

    left = _cube(distance_mm, yaw_deg, pitch_deg, "left")
    box = paper.canny_bounding_box(left, channel="saturation", blur_px=13)
    setup, f_px = replace(paper.paper_setup(), distance_mm=distance_mm), recordings.rectified().f_px
    view = paper.cube_view(recordings.rectified(), setup, pitch_rad=np.radians(pitch_deg))
    picture = left.copy()
    corner = (box.left + box.width - 1, box.top + box.height - 1)
    cv2.rectangle(picture, (box.left, box.top), corner, (0, 94, 213), 2)
    near_mm = f_px * recordings.rectified().baseline_mm / view.disparity_foot_px
    scales = [float(paper.cm_per_px_at(depth, f_px)) for depth in (view.depth_side_mm, near_mm)]
    text = f"{box.width} px wide; edge-on (yaw 45) {view.width_px:.0f} px are expected. One pixel stands for "
    text += f"{scales[0]:.4f} cm at the side corners and {scales[1]:.4f} cm at the near edge's foot; "
    constant = paper.value("scale.cm_per_px")
    return picture, text + f"{constant} cm/px would read the width as {constant * box.width:.1f} cm"


def draw_sgbm(condition: str, num_disparities: int, block_size: int, uniqueness_ratio: int) -> tuple[Array, str]:
    """Notebook 03: one of Fig. 4's recordings, matched; bad settings are refused with the library's own words."""
    from stereolib.plotting import colored

    left, right, disparity_px, cube = _condition(condition)
    params = SGBMParams(num_disparities, block_size, uniqueness_ratio=uniqueness_ratio)
    disparity = compute_disparity(left, right, params)
    quality = score(disparity, disparity_px, cube)
    text = f"bad 2 on the cube: {quality.bad2_pct:.1f} %; matched: {quality.density_pct:.0f} %; "
    return np.hstack([left, colored(disparity, 0, 160)]), text + f"columns lost at the left: {num_disparities}"


def draw_surface(distance_mm: float, contrast: float, scale_mm: float, light: float) -> tuple[Array, str]:
    """Notebook 03: the cube rendered and matched, one ray a pixel; only a new scene is rendered again."""
    from stereolib import virtual
    from stereolib.plotting import colored
    from stereolib.virtual import recordings

    lights, disparity_px, cube = _surface(distance_mm, contrast, scale_mm)
    rng, webcam = np.random.default_rng(4), virtual.Webcam()
    left, right = recordings.rectified().rectify(*(webcam.shoot(light * view, rng) for view in lights))
    disparity = compute_disparity(left, right, SGBMParams(192), whole=True)
    quality = score(disparity, disparity_px, cube)
    text = f"largest disparity of the cube {disparity_px[cube].max():.1f} px; "
    text += f"bad 2: {quality.bad2_pct:.1f} %; matched: {quality.density_pct:.0f} %"
    return np.hstack([left, colored(disparity, 0, 192)]), text


def draw_dilation(condition: str, method: str, size_px: int) -> tuple[Array, str]:
    """Notebook 04: one of Fig. 4's maps before and after a filter."""
    from stereolib.matching import filters
    from stereolib.plotting import colored

    left, right, disparity_px, cube = _condition(condition)
    before = compute_disparity(left, right)
    after = filters.smooth(before, method, size_px=size_px, image=left)
    done = repair(before, after, disparity_px, cube)
    text = f"holes {done.holes_pct:.0f} % of the cube, filled {done.filled_pct:.0f} %; of the filled pixels "
    text += f"{done.wrong2_pct:.0f} % are off by more than 2 px; good pixels move by {done.shift_px:+.2f} px"
    return np.hstack([colored(before, 0, 128), colored(after, 0, 128)]), text


def draw_map_view(azimuth_deg: int, elevation_deg: int, show: str) -> tuple[Array, str]:
    """Notebook 08: the walk's map in space, as solids or as coloured points."""
    from stereolib.mapping import view_map

    found, made, points = _walk_map()
    shown = points if show == "points" else None
    picture = view_map(found, made, azimuth_deg=azimuth_deg, elevation_deg=elevation_deg, points=shown)
    (volume, std), (area, area_std) = found.volume_l, found.surface_m2
    text = f"{len(found.objects)} objects, {volume:.2f} ± {std:.2f} litres, {area:.3f} ± {area_std:.3f} m² of surface"
    return picture, text + f"; {len(found.walls)} walls, {len(points.points_mm)} points"


def draw_matching(off_mm: int, off_deg: float, chance: int) -> tuple[Array, str]:
    """Notebook 08: scans of the walk at poses that are off, and after matching."""
    from stereolib.plotting import panels, picture_of, plot_scans

    stations = _walk_map()[0].stations
    start = disturb_poses(stations, np.random.default_rng(chance), off_mm, np.radians(off_deg))
    match = refine_poses(start)
    figure, axes = panels(2, width_in=11, aspect=0.85)
    plot_scans(start, axes[0], f"poses off by up to {off_mm} mm and {off_deg:g} degrees")
    plot_scans(match.stations, axes[1], "after matching")
    errors = np.abs([a.pose - b.pose for a, b in zip(match.stations, stations, strict=True)])
    text = f"{match.pairs} pairs, {match.rms_before_mm:.0f} mm apart before and {match.rms_after_mm:.1f} mm after; "
    worst = f"{errors[:, :2].max():.1f} mm and {np.degrees(errors[:, 2].max()):.2f} degrees"
    return picture_of(figure), text + f"the worst pose is off by {worst}"


@lru_cache(maxsize=1)
def _walk_map() -> tuple[Map, list[Solid], Cloud]:
    """The map of the recorded walk at its known poses, its solids and its points."""
    from stereolib.mapping import Station, colored_cloud, join_clouds, map_solids, merge_stations
    from stereolib.virtual import measure_walk, walk

    measured = measure_walk()
    stations = [Station.of(each, walk.POSES[name]) for name, each in measured.items()]
    clouds = [
        colored_cloud(m.disparity_px, m.left, m.floor, pose=walk.POSES[n], max_mm=1600.0) for n, m in measured.items()
    ]
    found = merge_stations(stations, rng=np.random.default_rng(8))
    return found, map_solids(found), join_clouds(clouds)


@lru_cache(maxsize=4)
def _condition(name: str) -> tuple[Array, Array, Array, Array]:
    """Rectified pair of a condition of Fig. 4, true disparity, and the cube's pixels that both cameras see."""
    from stereolib.virtual import recordings

    left, right = recordings.rectified().rectify(*recordings.load_pair(f"conditions/{name}"))
    truth = recordings.load_truth(f"conditions/{name}")
    return left, right, truth.disparity_px, truth.visible & (truth.box == 1)


@lru_cache(maxsize=2)
def _surface(distance_mm: float, contrast: float, scale_mm: float) -> tuple[tuple[Array, Array], Array, Array]:
    """Light that reaches both cameras from a textured cube, true disparity, and the cube's visible pixels."""
    from stereolib import virtual
    from stereolib.virtual import recordings

    cube = virtual.cube_scene(distance_mm, texture=contrast, texture_scale_mm=scale_mm)
    lights = virtual.render_pair(cube, paper.paper_rig(), recordings.setup(), samples=1, light_samples=1)
    truth = virtual.truth(cube, recordings.rectified(), recordings.setup())
    return lights, truth.disparity_px, truth.visible & (truth.box == 1)
