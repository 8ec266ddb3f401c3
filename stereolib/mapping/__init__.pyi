from .assemble import Map, merge_stations, size_table
from .files import write_cloud, write_grid, write_mesh
from .occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, occupancy_grid
from .scan_matching import ScanMatch, disturb_poses, refine_poses
from .shapes import COLORS, Cloud, Solid, colored_cloud, join_clouds, map_solids
from .sightings import MapObject
from .stations import Station
from .view import view_map
from .walls import MapWall

__all__ = [
    "COLORS",
    "FREE",
    "OCCUPIED",
    "UNKNOWN",
    "Cloud",
    "Map",
    "MapObject",
    "MapWall",
    "OccupancyGrid",
    "ScanMatch",
    "Solid",
    "Station",
    "colored_cloud",
    "disturb_poses",
    "join_clouds",
    "map_solids",
    "merge_stations",
    "occupancy_grid",
    "refine_poses",
    "size_table",
    "view_map",
    "write_cloud",
    "write_grid",
    "write_mesh",
]
