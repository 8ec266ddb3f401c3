"""Edges of a box in both pictures, looked for where the model has them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stereolib.base import Float32, Float64
from stereolib.measurement.box import Box, Edge, Own, Shared, Side, World, derivatives
from stereolib.measurement.edges import STEP_PX, ParallelLines, Peak, locate_edge
from stereolib.measurement.observations import EdgeSeen, edge_residuals
from stereolib.measurement.scene_solver import Priors

_CLEAR = 1.5  # least contrast of an edge that is looked for afar, against the lines around it
_STILL_CLEAR = 1.15  # and of one whose place is known
_NEARER_PX = 20.0  # by so much nearer edges are e times as likely, where a surface ends in a plain part
_LEAST_PX_PER_MM = 1e-3
_LEAST_REACH_PX, _MOST_REACH_PX = 4.0, 120.0
_LEAST_AHEAD_MM = 1.0  # of the camera
_GRAZING = 0.05  # share of a face's distance: a camera sees no face whose plane it stands nearer to
_MOVED_BY = {
    Edge.RIGHT_END: Own.RIGHT,
    Edge.LEFT_END: Own.LEFT,
    Edge.TOP_RIGHT: Own.HEIGHT,
    Edge.TOP_LEFT: Own.HEIGHT,
    Edge.BACK_RIGHT: Own.LEFT,
    Edge.BACK_LEFT: Own.RIGHT,
}


def edge_direction(edge: Edge, own: Float64, first: Side) -> Float64:
    """The change of a box's parameters that moves an edge by 1 mm, over the surface that it ends.

    Parameters
    ----------
    edge : Edge
    own : (8,) float64
    first : Side
        The face along which the corner moves.

    Returns
    -------
    (8,) float64
    """
    step = np.zeros(len(Own))
    if edge is Edge.CORNER:
        step[[Own.X, Own.Y]], step[first.extent] = Box(own).normal(first.other), -1.0
    else:
        step[_MOVED_BY[edge]] = 1.0
    return step


def predicted(edge: Edge, world: World, own: Float64) -> EdgeSeen:
    """Where the model has an edge.

    Parameters
    ----------
    edge : Edge
    world : World
        One, real.
    own : (8,) float64
        The box, in the order of `Own`.

    Returns
    -------
    EdgeSeen
        Its middle in the left picture, with a standard deviation of 1 px.
    """
    a, b = world.pixels(Box(own).edge(edge))
    along = (b - a) / np.linalg.norm(b - a)
    return EdgeSeen(edge, (a + b) / 2, np.array([-along[1], along[0]]), 1.0)


def predicted_stds_px(edges: Sequence[Edge], priors: Priors, x: Float64, covariance: Float64) -> dict[Edge, float]:
    """How well a solution knows where edges are, across them.

    Parameters
    ----------
    edges : sequence of Edge
    priors : Priors
    x : (18,) float64
        Shared parameters, then the box's own.
    covariance : (18, 18) float64

    Returns
    -------
    dict
        Standard deviations in px.
    """
    n = len(Shared)
    world = priors.world(x[:n])
    at = [predicted(edge, world, x[n:]) for edge in edges]
    _, J = derivatives(lambda y: edge_residuals(at, priors.world(y[..., :n]), Box(y[..., n:])), x)
    return dict(zip(edges, np.sqrt(np.einsum("ij,jk,ik->i", J, covariance, J)).tolist(), strict=True))


@dataclass(frozen=True, eq=False)
class Found:
    """An edge that was found.

    Attributes
    ----------
    seen : EdgeSeen
    peak : Peak
    move : (8,) float64
        By what the box's parameters change to meet it, about.
    """

    seen: EdgeSeen
    peak: Peak
    move: Float64

    def besides(self, rivals_px: float) -> Found:
        """The same, less well known for rivals that were seen in a wider search.

        Parameters
        ----------
        rivals_px : float
            As `Peak.rivals_px`.

        Returns
        -------
        Found
        """
        peak = replace(self.peak, rivals_px=max(rivals_px, self.peak.rivals_px))
        return replace(self, seen=replace(self.seen, std_px=float(np.hypot(self.seen.std_px, rivals_px))), peak=peak)


def find_edge(
    light: tuple[Float32, ...],
    world: World,
    own: Float64,
    edge: Edge,
    first: Side,
    prior_px: tuple[float, float, float],
) -> Found | None:
    """Look for an edge near where the model has it.

    Parameters
    ----------
    light : (left, right), (H, W, 3) or (H, W) float32
        Rectified pictures as light.
    world : World
    own : (8,) float64
        The box, in the order of `Own`.
    edge : Edge
    first : Side
        The face that is known best: the corner is looked for along it.
    prior_px : (std, inside, outside)
        How well its place is known; and by how much it may lie inside of the surface that it ends, or outside.

    Returns
    -------
    Found or None
        None where no edge stands out.

    Notes
    -----
    Each place x along the search counts as likely as ``exp(-b^2 / 2 std^2 - o / outside)`` before the pictures are
    looked at: b is how far it lies beyond the stretch from `inside` to `outside`, o how far outside of the surface,
    of which the first edge beyond a plain part is the end.
    """
    step, at = edge_direction(edge, own, first), predicted(edge, world, own)
    per_mm = float((predicted(edge, world, own + step).point_px - at.point_px) @ at.across)
    if not abs(per_mm) > _LEAST_PX_PER_MM:
        return None
    std, inside, outside = prior_px
    reach = max(3.0 * std, _LEAST_REACH_PX)
    outwards = 1 if (per_mm > 0) != (edge is Edge.CORNER) else -1
    low, high = (inside, outside) if outwards > 0 else (outside, inside)
    steps = np.arange(-round((reach + low) / STEP_PX), round((reach + min(high, _MOST_REACH_PX)) / STEP_PX) + 1)
    off: Float64 = STEP_PX * steps.astype(float)
    lines = _lines(world, edge, own + (off / per_mm)[:, None] * step, off)
    if lines is None:
        return None
    beyond = np.maximum(np.maximum(off - high, -low - off), 0.0)
    lean = np.maximum(outwards * off - inside, 0.0) / _NEARER_PX  # over a plain part to its first edge
    shown = light if _right_sees(world, Box(own), edge) else light[:1]
    peak = locate_edge(shown, lines, np.exp(-lean) / (1 + (beyond / std) ** 2))
    if peak is None or peak.contrast < (_CLEAR if outside else _STILL_CLEAR):
        return None
    seen = EdgeSeen(edge, at.point_px + peak.position_px * at.across, at.across, peak.std_px)
    return Found(seen, peak, peak.position_px / per_mm * step)


def _lines(world: World, edge: Edge, moved: Float64, off_px: Float64) -> ParallelLines | None:
    """An edge as boxes (lines, 8) in the order of `Own` have it; None where one has it behind the camera."""
    ends = Box(moved).edge(edge)
    ahead = (ends - [0.0, 0.0, float(world.camera_height)]) @ world.axes[:, 2]
    if not (ahead > _LEAST_AHEAD_MM).all():
        return None
    pixels = world.pixels(ends.reshape(-1, 3)).reshape(*ends.shape[:2], 2)
    return ParallelLines(pixels, world.scale / ahead + world.offset, off_px)


def _right_sees(world: World, box: Box, edge: Edge) -> bool:
    """The right camera sees the face that an outer edge ends; else it shows another edge there."""
    if edge not in (Edge.RIGHT_END, Edge.LEFT_END):
        return True
    side = Side.RIGHT if edge is Edge.RIGHT_END else Side.LEFT
    baseline = float(world.scale / world.focal)
    distance = float(box.distance(side))
    return bool(distance + box.normal(side)[1] * baseline > _GRAZING * distance)
