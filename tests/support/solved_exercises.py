"""Exercises solved from the numbers that a student is given, by another way than the exercise computes its answer."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise, product
from typing import Any

import cv2
import numpy as np

from stereolib import laser, matching, paper
from stereolib.calibration import triangulate
from stereolib.rig import Camera, StereoRig


def edge_length(g: Any) -> float:
    """Both ends triangulated by the library, with a rig of these numbers."""
    K = np.array([[g.f_px, 0, g.centre_px[0]], [0, g.f_px, g.centre_px[1]], [0, 0, 1]])
    camera = Camera(K, np.zeros(5), (640, 480))
    rig = StereoRig(camera, camera, np.eye(3), np.array([-g.B_mm, 0.0, 0.0]))
    ends = triangulate(rig, np.array([g.top_left, g.foot_left]), np.array([g.top_right, g.foot_right]))
    return float(np.linalg.norm(ends[0] - ends[1]))


def cheapest_ways(g: Any) -> list[float]:
    """All ways through the costs, tried one by one; less the cheapest way to the pixel before."""

    def price(way: tuple[int, ...]) -> float:
        steps = [abs(b - a) for a, b in pairwise(way)]
        return float(
            sum(g.costs[x, d] for x, d in enumerate(way))
            + sum(0 if s == 0 else min(g.P1, g.P2) if s == 1 else g.P2 for s in steps)
        )

    levels = range(g.costs.shape[1])
    before = list(product(levels, repeat=len(g.costs) - 1))
    return [min(price((*way, d)) for way in before) - min(map(price, before)) for d in levels]


def camera_height(g: Any) -> float:
    """The three places as points in space; their plane's distance from the camera."""
    a, b, c = (
        g.f_px * g.B_mm / d * np.linalg.inv(g.K) @ (*place, 1) for place, d in zip(g.places_px, g.d_px, strict=True)
    )
    n = np.cross(b - a, c - a)
    return abs(float(n @ a / np.linalg.norm(n)))


def jackknife(g: Any) -> float:
    n = len(g.moves_px)
    return math.sqrt((n - 1) * np.var(g.moves_px))


def bytes_to_mm(g: Any) -> float:
    return float(int.from_bytes(bytes([g.low, g.high]), "little"))


def fewest_turns(g: Any) -> float:
    return next(n for n in range(1, 10_000) if g.one_mm / math.sqrt(n) <= g.wanted_mm + 1e-12)


def corner(g: Any) -> Any:
    """Where the walls meet that the library fits to both halves of the readings."""
    half = len(g.points_mm) // 2
    walls = [laser.fit_line(part) for part in (g.points_mm[:half], g.points_mm[half:])]
    return np.linalg.solve([wall.normal for wall in walls], [wall.offset_mm for wall in walls])


def joined(g: Any) -> float:
    """The length with the smallest sum of squared deviations, found by trying."""
    tried = np.linspace(g.lengths_mm.min(), g.lengths_mm.max(), 20_001)
    squares = sum(((tried - length) / std) ** 2 for length, std in zip(g.lengths_mm, g.stds_mm, strict=True))
    return float(tried[np.argmin(squares)])


def dilated_at(g: Any) -> float:
    return float(matching.dilate(g.values, 3)[g.row, g.column])


def closed_at(g: Any) -> float:
    grown = matching.dilate(g.values, 3)
    return float(-matching.dilate(-grown, 3)[g.row, g.column])


def in_the_map(g: Any) -> Any:
    z = complex(*g.q_mm) * np.exp(1j * np.radians(g.psi_deg)) + complex(*g.t_mm)
    return z.real, z.imag


def foot_rows(g: Any) -> float:
    """The foot of the box through a camera whose axes are turned by the pitch."""
    c, s = np.cos(np.radians(g.pitch_deg)), np.sin(np.radians(g.pitch_deg))
    down, ahead = c * g.h_mm + s * g.D_mm, -s * g.h_mm + c * g.D_mm
    return float(g.H - (g.cy + g.f_px * down / ahead))


def project(g: Any) -> Any:
    return cv2.projectPoints(g.point_mm[None], np.zeros(3), np.zeros(3), g.K, None)[0].ravel()


#: From what is given to the answer, for every exercise of numbers that are given.
SOLVED: dict[str, Callable[[Any], Any]] = {
    "00.2": lambda g: float(matching.disparity_to_depth(np.array([[g.d_px]]), g.f_px, g.B_mm)[0, 0]),
    "00.3": edge_length,
    "00.4": lambda g: g.Z_m * 1000 / (g.f_px * g.worth_mm / (g.Z_m * 1000)),
    "01.1": jackknife,
    "01.2": project,
    "01.3": lambda g: len(["fx", "fy", "cx", "cy"]) * 2 + 2 * g.lens + (3 + 3) * (g.boards + 1),
    "01.4": lambda g: g.B_mm / (g.true_mm / g.believed_mm),
    "01.5": lambda g: np.cross(g.T, g.R, axisb=0, axisc=0),
    "02.1": lambda g: np.cross(g.line, (1, 0, -g.column))[1] / np.cross(g.line, (1, 0, -g.column))[2],
    "02.2": lambda g: np.degrees(g.off_px / np.sqrt(np.mean(np.linspace(-g.width_px / 2, g.width_px / 2, 9999) ** 2))),
    "02.3": lambda g: math.sqrt(g.off_mm / (g.off_px / (g.f_px * g.B_mm))) / 1000,
    "02.4": lambda g: g.B_mm / 2 * np.tan(np.radians(90 - g.toe_deg / 2)),
    "02.5": lambda g: g.Z_mm * g.calibrated_mm / g.true_mm,
    "03.2": lambda g: next(n for n in range(16, 9999, 16) if g.f_px * g.B_mm / g.Z_mm <= n - 1),
    "03.3": lambda g: sum((a < g.left[1, 1]) != (b < g.right[1, 1]) for a, b in zip(g.left.flat, g.right.flat)),  # noqa: B905
    "03.4": cheapest_ways,
    "03.5": lambda g: matching.score(g.found, g.truth).bad2_pct,
    "04.1": dilated_at,
    "04.2": closed_at,
    "04.3": lambda g: paper.cm_per_px_at(g.Z_mm, g.f_px) * 10 * (g.size_px - 1),
    "04.4": lambda g: g.f_px * g.B_mm * g.shift_px / (g.d_px * (g.d_px + g.shift_px)),
    "05.2": bytes_to_mm,
    "05.3": lambda g: [
        (g.r_mm * np.exp(1j * np.radians(g.angle_deg))).real,
        (g.r_mm * np.exp(1j * np.radians(g.angle_deg))).imag,
    ],
    "05.4": lambda g: g.sigma_mm * g.far_mm * g.far_mm / g.near_mm / g.near_mm,
    "05.5": fewest_turns,
    "06.2": lambda g: 100 * (g.s_cm / paper.cm_per_px_at(g.Z_mm, g.f_px) - 1),
    "06.3": camera_height,
    "06.4": lambda g: g.camera_mm - g.camera_mm * g.d_floor_px / g.d_px,
    "06.5": lambda g: 1.96 * float(np.linalg.norm(g.parts_mm)),
    "07.2": lambda g: paper.depth_of_scale_mm(g.s_cm, g.f_px),
    "07.3": lambda g: g.f_px * math.hypot(g.side_mm, g.side_mm) / g.Z_mm,
    "07.4": foot_rows,
    "08.1": corner,
    "08.2": in_the_map,
    "08.3": joined,
    "08.4": lambda g: math.prod(g.stds_mm) / math.hypot(*g.stds_mm),
}
