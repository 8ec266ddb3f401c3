from .asked_length import AskedLength, beside_ruler
from .assemble import Map, NothingToMap, merge_stations, size_table
from .files import write_cloud, write_grid, write_mesh
from .occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, occupancy_grid
from .placing import Placing, place_stations
from .recorded import RecordedMap, laser_alone, map_recordings, measure_station
from .rig_folder import (
    RIG_FILE,
    RIG_FOLDERS,
    RigFolder,
    load_rig_folder,
    lying_there,
    tried,
    write_demo_file,
    write_rig_file,
)
from .scan_matching import ScanMatch, disturb_poses, refine_poses
from .shapes import Cloud, Solid, colored_cloud, join_clouds, map_solids
from .sightings import MapObject
from .station_folder import (
    CALIBRATION,
    NoStation,
    RecordedStation,
    StationFolder,
    list_stations,
    name_scans,
    no_scans,
    pair_stations,
    read_scan,
)
from .stations import Station, station_names
from .view import view_map
from .walls import MapWall

__all__ = [
    "CALIBRATION",
    "FREE",
    "OCCUPIED",
    "RIG_FILE",
    "RIG_FOLDERS",
    "UNKNOWN",
    "AskedLength",
    "Cloud",
    "Map",
    "MapObject",
    "MapWall",
    "NoStation",
    "NothingToMap",
    "OccupancyGrid",
    "Placing",
    "RecordedMap",
    "RecordedStation",
    "RigFolder",
    "ScanMatch",
    "Solid",
    "Station",
    "StationFolder",
    "beside_ruler",
    "colored_cloud",
    "disturb_poses",
    "join_clouds",
    "laser_alone",
    "list_stations",
    "load_rig_folder",
    "lying_there",
    "map_recordings",
    "map_solids",
    "measure_station",
    "merge_stations",
    "name_scans",
    "no_scans",
    "occupancy_grid",
    "pair_stations",
    "place_stations",
    "read_scan",
    "refine_poses",
    "size_table",
    "station_names",
    "tried",
    "view_map",
    "write_cloud",
    "write_demo_file",
    "write_grid",
    "write_mesh",
    "write_rig_file",
]
