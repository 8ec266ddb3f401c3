from . import camera_emulator, emulator, laser_boards, recordings, walk, walk_folder
from .build import build_recordings
from .lidar import VirtualLidar
from .measured_walk import measure_walk, walk_laser
from .quick import render_quickly
from .ray_casting import Hits, cast_rays
from .rendering import Truth, render, render_pair, render_truth
from .scene import (
    CUBE_SURFACE,
    FLOOR_SURFACE,
    Box,
    Light,
    Material,
    Scene,
    board_box,
    box_on_floor,
    clutter_scene,
    cube_scene,
    room,
)
from .staged import SCENES, Staged, draw_rig, stage, staged_laser, staged_rig
from .texture import Tile
from .webcam import Webcam

__all__ = [
    "CUBE_SURFACE",
    "FLOOR_SURFACE",
    "SCENES",
    "Box",
    "Hits",
    "Light",
    "Material",
    "Scene",
    "Staged",
    "Tile",
    "Truth",
    "VirtualLidar",
    "Webcam",
    "board_box",
    "box_on_floor",
    "build_recordings",
    "camera_emulator",
    "cast_rays",
    "clutter_scene",
    "cube_scene",
    "draw_rig",
    "emulator",
    "laser_boards",
    "measure_walk",
    "recordings",
    "render",
    "render_pair",
    "render_quickly",
    "render_truth",
    "room",
    "stage",
    "staged_laser",
    "staged_rig",
    "walk",
    "walk_folder",
    "walk_laser",
]
