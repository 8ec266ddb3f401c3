"""Files of the map, read back by other readers than ours; the grid against a slow twin; the view in space."""

from __future__ import annotations

import re

import cv2
import numpy as np
import pytest
import trimesh
import yaml
from support import walks

from stereolib import laser
from stereolib.mapping import (
    FREE,
    OCCUPIED,
    Cloud,
    Solid,
    Station,
    colored_cloud,
    join_clouds,
    map_solids,
    merge_stations,
    occupancy_grid,
    shapes,
    view_map,
    write_cloud,
    write_grid,
    write_mesh,
)
from stereolib.mapping.occupancy import UNKNOWN
from stereolib.mapping.view import Eye
from stereolib.measurement import OBJECT_RGB, floor_from_pose
from stereolib.plotting import figure_to_image, panels, plot_occupancy, plot_scans, plot_sizes, plot_top_view
from stereolib.virtual import recordings, walk


@pytest.fixture(scope="module")
def found():
    return merge_stations(walks.walked(np.random.default_rng(1)), rng=np.random.default_rng(0))


def shoelace(outline):
    x, y = outline.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


# --- meshes


def test_glb_holds_the_objects_by_name_with_y_up(found, tmp_path):
    path = write_mesh(tmp_path / "map.glb", map_solids(found))
    scene = trimesh.load(path)
    assert set(scene.graph.nodes_geometry) == {*found.names, "wall 1", "wall 2", "wall 3", "wall 4"}
    for name, thing in zip(found.names, found.measured, strict=True):
        mesh = scene.geometry[name]
        assert mesh.volume == pytest.approx(thing.volume_l[0] / 1000, rel=1e-4)  # litres, cubic metres
        low, high = mesh.bounds
        assert (low[1], high[1]) == pytest.approx((0, thing.size_mm[2] / 1000), abs=1e-6)
        # glTF: x stays, its -z is our y
        middle = (low + high) / 2
        assert (middle[0], -middle[2]) == pytest.approx(tuple(thing.position_mm / 1000), abs=1e-4)
    colors = [scene.geometry[name].visual.material.baseColorFactor for name in found.names]
    assert len({tuple(color) for color in colors}) == 5


def test_ply_is_one_mesh_in_metres_with_z_up(found, tmp_path):
    made = map_solids(found, wall_height_mm=700.0)
    path = write_mesh(tmp_path / "map.ply", made)
    mesh = trimesh.load(path)
    expected = sum(shoelace(solid.outline_mm) * solid.height_mm for solid in made) / 1e9
    assert mesh.volume == pytest.approx(expected, rel=1e-4)
    assert mesh.bounds[:, 2] == pytest.approx([0, 0.7], abs=1e-6)
    (x0, x1), (y0, y1) = walk.ROOM_MM
    assert mesh.bounds[:, :2] * 1000 == pytest.approx(np.array([[x0, y0], [x1, y1]]), abs=30)
    colors = mesh.visual.vertex_colors[:, :3].tolist()
    assert {tuple(c) for c in colors} == {*OBJECT_RGB[:5], shapes.WALL_RGB}
    for solid in made[:5]:  # each object in its colour, where it stands
        mine = mesh.vertices[[tuple(c) == solid.color_rgb for c in colors]] * 1000
        low, high = solid.outline_mm.min(axis=0), solid.outline_mm.max(axis=0)
        expected = [[*low, 0], [*high, solid.height_mm]]
        np.testing.assert_allclose([mine.min(axis=0), mine.max(axis=0)], expected, atol=0.01)


def test_what_is_not_known_is_drawn_thin(tmp_path):
    rng = np.random.default_rng(2)
    station = Station(np.zeros(3), (walks.face(np.array([240.0, 300, 180]), np.array([900.0, 0]), 0.0, rng),))
    (sheet,) = map_solids(merge_stations([station], rng=rng))
    assert not sheet.known and shoelace(sheet.outline_mm) == pytest.approx(4 * 300, rel=0.05)
    assert sheet.height_mm == pytest.approx(180, abs=8)


def test_the_same_map_makes_the_same_bytes_and_nothing_is_overwritten(found, tmp_path):
    for name in ("a.glb", "a.ply"):
        first = write_mesh(tmp_path / name, map_solids(found)).read_bytes()
        with pytest.raises(ValueError, match=rf"{re.escape(name)} exists: choose another name, or pass overwrite=True"):
            write_mesh(tmp_path / name, map_solids(found))
        assert write_mesh(tmp_path / name, map_solids(found), overwrite=True).read_bytes() == first
    with pytest.raises(ValueError, match=r"must end in \.ply or \.glb, got '\.stl'"):
        write_mesh(tmp_path / "a.stl", map_solids(found))
    with pytest.raises(ValueError, match="the map is empty, there is nothing to write"):
        write_mesh(tmp_path / "b.ply", [])
    assert {p.name for p in tmp_path.iterdir()} == {"a.glb", "a.ply"}


# --- cloud


def test_points_lie_where_the_scene_is_and_have_its_colours(tmp_path):
    """The cloud of the true disparity, in the map: on floor, walls and boxes to a millimetre; the boxes' colours."""
    name = "room/4"
    truth = recordings.load_truth(name)
    left, _ = recordings.rectified().rectify(*recordings.load_pair(name))
    floor = floor_from_pose(recordings.rectified(), recordings.setup())
    made = colored_cloud(truth.disparity_px, left, floor, pose=walk.POSES[name], step=4, max_mm=4000.0)
    (_, x1), (y0, _) = walk.ROOM_MM
    assert made.points_mm[:, 2].min() == pytest.approx(0, abs=1.0)
    assert made.points_mm[:, 0].max() < x1 + 1 and made.points_mm[:, 1].min() > y0 - 1
    box = walk.objects()[4]
    local = (made.points_mm - box.T_world_box[:3, 3]) @ box.T_world_box[:3, :3]
    on_box = np.all(np.abs(local) < np.array(box.size_mm) / 2 + 1.0, axis=1)
    seen = (truth.box[::4, ::4] == 5) & np.isfinite(truth.disparity_px[::4, ::4])
    assert on_box.sum() >= seen.sum() > 300
    surface = np.abs(np.abs(local[on_box]) - np.array(box.size_mm) / 2).min(axis=1)
    assert np.percentile(surface, 99) < 1.0
    red, green, blue = made.colors_rgb[on_box].mean(axis=0)
    assert red > green > blue + 20  # a yellowish box
    path = write_cloud(tmp_path / "cloud.ply", made)
    again = trimesh.load(path)
    np.testing.assert_allclose(again.vertices, made.points_mm / 1000, atol=1e-6)
    np.testing.assert_array_equal(again.visual.vertex_colors[:, :3], made.colors_rgb)


def test_clouds_refuse_what_does_not_fit(tmp_path):
    floor = floor_from_pose(recordings.rectified(), recordings.setup())
    disparity = np.full((480, 640), np.nan, np.float32)
    with pytest.raises(ValueError, match=r"the image has shape \(10, 10\)"):
        colored_cloud(disparity, np.zeros((10, 10), np.uint8), floor)
    with pytest.raises(ValueError, match="no floor was seen"):
        colored_cloud(disparity, np.zeros((480, 640), np.uint8), None)
    empty = colored_cloud(disparity, np.zeros((480, 640), np.uint8), floor)
    with pytest.raises(ValueError, match="the cloud has no point"):
        write_cloud(tmp_path / "c.ply", empty)
    with pytest.raises(ValueError, match="as many colours as points"):
        Cloud(np.zeros((2, 3)), np.zeros((3, 3)))


# --- occupancy


def slow_grid(stations, grid):
    """The twin: walk along every beam in steps of a 100th of a cell."""
    passed, ended = np.zeros(grid.cells.shape, int), np.zeros(grid.cells.shape, int)
    for station in stations:
        starts = np.broadcast_to(station.to_map(station.laser_mm), station.scan_mm.shape)
        points = station.to_map(station.scan_mm)
        for start, point in (np.stack([starts, points], axis=1) - grid.origin_mm) / grid.resolution_mm:
            count = int(100 * np.linalg.norm(point - start)) + 2
            cells = np.floor(start + np.linspace(0, 1, count)[:, None] * (point - start)).astype(int)
            last = tuple(np.floor(point).astype(int)[::-1])
            ended[last] += 1
            for column, row in {tuple(cell) for cell in cells}:
                passed[row, column] += (row, column) != last
    cells = np.where(passed > 0, FREE, UNKNOWN)
    return np.where((ended > 0) & (ended >= 0.1 * (ended + passed)), OCCUPIED, cells)


def test_grid_is_that_of_the_slow_twin():
    """Of a station whose beams are taken to start at one place, and of one whose beams start each at its own."""
    scan, rng = recordings.scan("room/3"), np.random.default_rng(0)
    starts_mm = laser.rays(scan).origins_mm[np.isfinite(scan.ranges_mm)]
    stations = [walks.station(1, rng), walks.station(3, rng, laser_mm=10 * starts_mm)]  # ten times an XV-11's
    grid = occupancy_grid(stations, resolution_mm=80.0)
    twin = slow_grid(stations, grid)
    assert (grid.cells != twin).mean() < 0.002  # cells that a beam only grazes


def test_grid_of_the_room(found):
    """What the truth says: free where stations stand, taken along the walls, unknown inside boxes and outside."""
    grid = occupancy_grid(found.stations)
    assert (grid.at(np.array([station.pose[:2] for station in found.stations])) == FREE).all()
    assert (grid.at(np.array([walks.truth(k)[1] for k in range(5)])) == UNKNOWN).all()
    assert (grid.at(np.array([[-1050.0, 0], [1e5, 0], [650, 1530]])) == UNKNOWN).all()
    (x0, x1), (y0, y1) = walk.ROOM_MM
    row, column = np.nonzero(grid.cells == OCCUPIED)
    taken = grid.origin_mm + (np.column_stack([column, row]) + 0.5) * grid.resolution_mm
    to_wall = np.abs(np.stack([taken[:, 0] - x0, taken[:, 0] - x1, taken[:, 1] - y0, taken[:, 1] - y1])).min(axis=0)
    edges = np.concatenate([np.linspace(a, b, 200) for k in range(5) for a, b in _sides(*walks.truth(k))])
    to_box = np.linalg.norm(taken[:, None] - edges, axis=2).min(axis=1)
    assert np.mean(np.minimum(to_wall, to_box) < 30) > 0.99


def _sides(size, centre, yaw):
    corners = walks.corners(size, centre, yaw)
    return zip(corners, np.roll(corners, -1, axis=0), strict=True)


def test_map_server_reads_the_grid_back(tmp_path):
    """Read as ROS's map_server documents: trinary, first row at the top, origin at the lower left corner."""
    wall = Station(np.array([300.0, 200.0, 0.0]), (), np.array([[1012.0, 40 * k - 390.0] for k in range(20)]))
    grid = occupancy_grid([wall], resolution_mm=25.0)
    text, picture = write_grid(tmp_path / "map.yaml", grid)
    about = yaml.safe_load(text.read_text())
    assert set(about) == {"image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh"}
    image = cv2.imread(str(tmp_path / about["image"]), cv2.IMREAD_UNCHANGED)
    assert picture.name == about["image"] and picture.read_bytes().startswith(b"P5\n")
    p = (255 - image.astype(float)) / 255
    state = np.where(p > about["occupied_thresh"], 100, np.where(p < about["free_thresh"], 0, -1))[::-1]
    assert about["resolution"] == 0.025 and about["negate"] == 0 and about["origin"][2] == 0

    def at(x_mm, y_mm):
        column, row = ((np.array([x_mm, y_mm]) / 1000 - about["origin"][:2]) / about["resolution"]).astype(int)
        return state[row, column]

    assert at(1312, -190) == at(1312, 570) == 100
    assert at(800, 200) == 0 and at(1312, 640) == -1 and at(700, -250) == -1
    np.testing.assert_array_equal(state, np.select([grid.cells == FREE, grid.cells == OCCUPIED], [0, 100], -1))
    with pytest.raises(ValueError, match="exists"):
        write_grid(tmp_path / "map.yaml", grid)
    text.unlink()
    with pytest.raises(ValueError, match=r"map\.pgm exists"):
        write_grid(tmp_path / "map.yaml", grid)
    with pytest.raises(ValueError, match=r"must end in \.yaml"):
        write_grid(tmp_path / "map.pgm", grid)
    for name in ("a: #b.yaml", "Küche.yaml", "12.yaml"):
        text, picture = write_grid(tmp_path / name, grid)
        assert yaml.safe_load(text.read_text(encoding="utf-8"))["image"] == picture.name


def test_grids_that_make_no_sense_are_refused():
    one = Station(np.zeros(3), (), np.array([[1000.0, 0]]))
    with pytest.raises(ValueError, match="without a single reading"):
        occupancy_grid([Station(np.zeros(3), ())])
    with pytest.raises(ValueError, match="take larger ones"):
        occupancy_grid([one], resolution_mm=0.05)
    with pytest.raises(ValueError, match="positive side"):
        occupancy_grid([one], resolution_mm=0)


def test_no_cloud_is_none_to_join():
    with pytest.raises(ValueError, match="no cloud was given"):
        join_clouds([])


# --- pictures


def test_eye_sees_as_a_pinhole():
    eye = Eye(np.array([500.0, 0, 0]), 0.0, 0.001, 2000.0, (900, 600))
    pixels, depth = eye.project(np.array([[500.0, 0, 0], [500, 100, 0], [500, 0, 100], [1500, 0, 0]]))
    assert depth == pytest.approx([2000, 2000, 2000, 3000], abs=0.1)
    assert pixels[0] == pytest.approx([450, 300], abs=0.1)
    assert pixels[1] == pytest.approx([450 - eye.f_px * 0.05, 300], abs=0.1)  # left of the axis is left
    assert pixels[2] == pytest.approx([450, 300 - eye.f_px * 0.05], abs=0.1)
    points = np.random.default_rng(0).uniform(-900, 900, (50, 3))
    eye.fill(points, (900, 600))
    pixels = eye.project(points)[0]
    assert pixels.min() == pytest.approx(16, abs=1e-6) and (pixels <= [884 + 1e-6, 584 + 1e-6]).all()


def test_view_hides_what_lies_behind(found):
    """Seen from behind station 1, box C's colour covers its middle; from the other side B's does not cover C."""
    made = map_solids(found)
    for azimuth, elevation in ((0.0, 30.0), (90.0, 60.0), (215.0, 25.0)):
        picture = view_map(found, made, azimuth_deg=azimuth, elevation_deg=elevation)
        assert picture.shape == (600, 900, 3) and picture.dtype == np.uint8
        for solid in made[:5]:  # each object shows some of its own hue
            b, g, r = (picture.astype(int)[..., k] for k in range(3))
            wanted = np.array(solid.color_rgb, float)
            ratio = np.stack([r, g, b], -1) / np.maximum(np.stack([r, g, b], -1).sum(-1, keepdims=True), 1)
            assert (np.abs(ratio - wanted / wanted.sum()).max(-1) < 0.08).sum() > 60, solid.name
    near, far = (
        Solid("near", walks.corners((300, 300), np.array([0.0, 0]), 0.0), 300.0, (255, 0, 0)),
        (Solid("far", walks.corners((100, 100), np.array([600.0, 0]), 0.0), 100.0, (0, 0, 255))),
    )
    for order in ([near, far], [far, near]):
        picture = view_map(found, order, azimuth_deg=0.0, elevation_deg=5.0).astype(int)
        assert not ((picture[..., 0] > 120) & (picture[..., 2] < 60)).any()  # no blue: the far one is hidden
    with pytest.raises(ValueError, match="elevation up to 90 degrees; got 0"):
        view_map(found, made, elevation_deg=0.0)


def test_cloud_in_the_view_keeps_the_nearer_point(found):
    places = np.array([station.pose[:2] for station in found.stations])
    y = (places.min(axis=0) + places.max(axis=0))[1] / 2  # of the line of sight
    points = Cloud(np.array([[0.0, y, 120], [400, y, 120]]), np.array([[255, 0, 0], [0, 255, 0]]))
    picture = view_map(found, [], points=points, azimuth_deg=0.0, elevation_deg=0.01)
    assert (picture == [0, 0, 255]).all(axis=2).any() and not (picture == [0, 255, 0]).all(axis=2).any()


def test_top_view_draws_what_the_map_holds(found):
    figure, axes = panels(4, width_in=12)
    ax = plot_top_view(found, axes[0], "map", true_mm=[walks.corners(*walks.truth(0))])
    drawn = [np.asarray(patch.get_path().vertices) for patch in ax.patches if type(patch).__name__ == "Polygon"]
    for thing, outline in zip(found.measured, drawn, strict=False):
        np.testing.assert_allclose(outline[:4], thing.outline_mm)
    texts = {text.get_text() for text in ax.texts}
    assert texts >= {"A", "B", "C", "D", "E", "1", "5"}
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    assert len(legend) == 9 and legend[6] == "the true outlines"
    assert re.fullmatch(r"A  (19|20)\d x 1[56]\d x \d+ mm", legend[1])
    larger = re.fullmatch(r"ellipse: standard\ndeviation of a place,\n(\d+) times enlarged", legend[8])
    assert legend[0] == "the laser's readings" and larger
    ellipses = [patch for patch in ax.patches if type(patch).__name__ == "Ellipse"]
    for thing, ellipse in zip(found.measured, ellipses, strict=True):
        long_mm = 2 * np.sqrt(np.linalg.eigvalsh(thing.position_covariance)[-1])
        assert ellipse.width == pytest.approx(float(larger[1]) * long_mm) and ellipse.width <= 250
    assert len(ax.lines) >= len(found.walls)
    grid = occupancy_grid(found.stations, resolution_mm=50.0)
    shown = plot_occupancy(grid, axes[1]).images[0]
    assert [key.get_text() for key in axes[1].get_legend().texts] == ["taken", "free", "unknown"]
    np.testing.assert_array_equal(shown.get_array(), grid.cells)
    assert shown.get_extent()[0] == grid.origin_mm[0] and shown.origin == "lower"
    assert len(plot_scans(found.stations, axes[2]).collections) == 5
    errors, empty = np.array([1.0, -2]), np.array([False, True])
    sizes = plot_sizes(["a", "b"], {"x": (errors, np.array([1.0, 1]), empty)}, axes[3])
    assert [t.get_text() for t in sizes.get_yticklabels()] == ["a", "b"]
    assert [list(line.get_xdata()) for line in sizes.lines if line.get_color() == "white"] == [[-2.0]]
    assert figure_to_image(figure).shape[2] == 3
