from .assemble import Map, merge, size_table
from .files import COLORS, Cloud, Solid, cloud, joined, solids, write_cloud, write_grid, write_mesh
from .occupancy import FREE, OCCUPIED, OccupancyGrid, occupancy_grid
from .scan_matching import ScanMatch, disturbed, refine_poses
from .sightings import MapObject
from .stations import Station
from .view import view_map
from .walls import MapWall

__all__ = [
    "COLORS",
    "FREE",
    "OCCUPIED",
    "Cloud",
    "Map",
    "MapObject",
    "MapWall",
    "OccupancyGrid",
    "ScanMatch",
    "Solid",
    "Station",
    "cloud",
    "disturbed",
    "joined",
    "merge",
    "occupancy_grid",
    "refine_poses",
    "size_table",
    "solids",
    "view_map",
    "write_cloud",
    "write_grid",
    "write_mesh",
]
