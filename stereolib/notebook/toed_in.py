"""Two cameras turned towards each other, and what they see of the cube (notebook 02)."""

from __future__ import annotations

import numpy as np

from stereolib import paper
from stereolib.base import Float64, UInt8
from stereolib.rig import StereoRig, rigid


def toe_in(straight: StereoRig, angle_deg: float) -> tuple[StereoRig, Float64]:
    """Turn both cameras of a rig towards each other, each by half the angle; they stay where they are.

    Parameters
    ----------
    straight : StereoRig
    angle_deg : float
        By which the angle between both cameras grows, degrees.

    Returns
    -------
    toed : StereoRig
    T_toed_left : (4, 4) float64, mm
        From the left camera's frame before the turn to that after it.
    """
    half_rad = np.radians(angle_deg / 2)
    left, right = (_turn_about_y(angle) for angle in (-half_rad, half_rad))
    toed = StereoRig(straight.left, straight.right, right @ straight.R @ left.T, right @ straight.T)
    return toed, np.asarray(rigid(left, np.zeros(3)))


def shoot_cube(rig: StereoRig, T_left_world: Float64, *, seed: int = 2) -> tuple[UInt8, UInt8]:
    """Take a pair of the paper's cube with the virtual rig.

    Parameters
    ----------
    rig : StereoRig
    T_left_world : (4, 4) float64, mm
        Where the left camera stands.
    seed : int
        Of the cameras' noise.

    Returns
    -------
    left, right : (H, W, 3) uint8
    """
    from stereolib.virtual import Webcam, cube_scene, render_pair

    webcam, rng = Webcam(), np.random.default_rng(seed)
    left, right = (webcam.shoot(light, rng) for light in render_pair(cube_scene(), rig, T_left_world, samples=1))
    return left, right


def cube_foot_mm() -> Float64:
    """Tell where the left, the near and the right corner of the cube stand on the floor.

    Returns
    -------
    (3, 3) float64, mm
        Forward, left and up from the floor below the left camera.

    Examples
    --------
    >>> cube_foot_mm().round(1).tolist()
    [[912.1, 212.1, 0.0], [700.0, 0.0, 0.0], [912.1, -212.1, 0.0]]
    """
    half = 10 * paper.printed_value("setup.cube")[0] / np.sqrt(2)
    near = 1000 * paper.printed_value("setup.distance")
    return np.array([[near + half, half, 0.0], [near, 0.0, 0.0], [near + half, -half, 0.0]])


def _turn_about_y(angle_rad: float) -> Float64:
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
