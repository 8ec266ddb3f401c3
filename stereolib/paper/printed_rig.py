"""The paper's rig: the one place where its conventions are turned into ours, and back."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from stereolib.base import Float64
from stereolib.paper.printed_values import assumed, printed_value
from stereolib.rig import Camera, StereoRig, skew


@cache
def paper_rig() -> StereoRig:
    """The paper's cameras (Table I, section II.B) in our conventions.

    Returns
    -------
    StereoRig
        Image size 640 x 480, which the paper does not print.

    Notes
    -----
    Three conversions, made here and nowhere else:

    - Table I lists ``k1 k2 k3`` and ``p1 p2``; OpenCV's order is ``k1 k2 p1 p2 k3``.
    - The printed R is the transpose of ours, for the printed ``E = R' skew(T)``. Four digits make no rotation: the
      nearest one is taken, ``U V'`` of the singular value decomposition.
    - The printed T stands in the left camera's frame (``E T = 0``): ``x_right = R (x_left + T)``, and OpenCV's T is
      ``R T``. Left as printed, it would miss the printed E by 0.34 mm.

    Examples
    --------
    >>> round(paper_rig().baseline_mm, 2), paper_rig().left.size
    (93.11, (640, 480))
    """
    size, cameras = tuple(assumed()["image_size_px"]), []
    for side in ("left", "right"):
        k1, k2, k3, p1, p2 = printed_value(f"table1.{side}.dist")
        cameras.append(Camera(printed_camera_matrix(side), np.array([k1, k2, p1, p2, k3]), size))
    u, _, vt = np.linalg.svd(np.array(printed_value("stereo.R")).T)
    R = u @ vt
    return StereoRig(cameras[0], cameras[1], R, R @ np.array(printed_value("stereo.T")))


def printed_form(rig: StereoRig) -> dict[str, Any]:
    """A rig in the paper's order and conventions, ready for `compare_with_paper`; undoes `paper_rig`.

    Parameters
    ----------
    rig : StereoRig

    Returns
    -------
    dict
        ``table1.*`` and ``stereo.*`` by id.

    Examples
    --------
    >>> float(printed_form(paper_rig())["table1.left.fx"])
    729.9077
    """
    values: dict[str, Any] = {}
    for side, camera in (("left", rig.left), ("right", rig.right)):
        k1, k2, p1, p2, k3 = np.pad(camera.dist, (0, 5))[:5]
        (fx, _, cx), (_, fy, cy), _ = camera.K
        table = {"fx": fx, "fy": fy, "cx": cx, "cy": cy, "dist": [k1, k2, k3, p1, p2]}
        values |= {f"table1.{side}.{name}": entry for name, entry in table.items()}
    pair = {"R": rig.R.T, "T": rig.R.T @ rig.T, "E": rig.E, "F": rig.F}
    return values | {f"stereo.{name}": entry for name, entry in pair.items()}


#: E of the printed R and T by how these are read: a product from left to right.
_ESSENTIALS = {"paper": ("R'", "skew(T)"), "opencv": ("skew(T)", "R"), "rows": ("skew(T)", "R'")}


def essential_factors(convention: str) -> list[tuple[str, Float64]]:
    """Factors of the essential matrix, from left to right, of the printed R and T as they stand.

    Parameters
    ----------
    convention : "paper" | "opencv" | "rows"
        As `printed_essential`.

    Returns
    -------
    list of (name, (3, 3) float64)
        Named ``"R"``, ``"R'"`` or ``"skew(T)"``; the last one in mm.

    Raises
    ------
    ValueError
        If `convention` is another word.
    """
    if convention not in _ESSENTIALS:
        raise ValueError(f"convention must be one of {', '.join(_ESSENTIALS)}, got {convention!r}")
    R, T = np.array(printed_value("stereo.R")), np.array(printed_value("stereo.T"))
    factors = {"R": R, "R'": R.T, "skew(T)": skew(T)}
    return [(name, factors[name]) for name in _ESSENTIALS[convention]]


def printed_essential(convention: str = "paper") -> Float64:
    """Essential matrix from the printed R and T as they stand.

    Parameters
    ----------
    convention : "paper" | "opencv" | "rows"
        - ``"paper"``: ``R' skew(T)``, which gives the printed E: R's columns are camera 2's axes seen from camera 1,
          and camera 2 stands at -T: ``x_2 = R' (x_1 + T)``.
        - ``"opencv"``: ``skew(T) R`` of ``x_2 = R x_1 + T``, the form of the paper's own equation (II.A).
        - ``"rows"``: ``skew(T) R'`` of ``x_2' = x_1' R + T'``, row vectors as MATLAB has them.

    Returns
    -------
    (3, 3) float64, mm

    Raises
    ------
    ValueError
        If `convention` is another word.
    """
    (_, first), (_, second) = essential_factors(convention)
    E: Float64 = first @ second
    return E


def printed_camera_matrix(side: str) -> Float64:
    """Camera matrix K as Table I prints it.

    Parameters
    ----------
    side : "left" | "right"

    Returns
    -------
    (3, 3) float64, px

    Examples
    --------
    >>> printed_camera_matrix("left")[0].tolist()
    [729.9077, 0.0, 322.5457]
    """
    fx, fy, cx, cy = (printed_value(f"table1.{side}.{name}") for name in ("fx", "fy", "cx", "cy"))
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def printed_fundamental(order: str = "right-left") -> Float64:
    """Fundamental matrix from the printed E and Table I, not normalised.

    Parameters
    ----------
    order : "right-left" | "left-right"
        ``inv(K_R)' E inv(K_L)``, which gives the printed F, or the cameras exchanged.

    Returns
    -------
    (3, 3) float64

    Raises
    ------
    ValueError
        If `order` is another word.

    Examples
    --------
    >>> round(float(printed_fundamental("left-right")[2, 2]), 3)
    -0.185
    """
    if order not in ("right-left", "left-right"):
        raise ValueError(f'order must be "right-left" or "left-right", got {order!r}')
    first, second = (np.linalg.inv(printed_camera_matrix(side)) for side in order.split("-"))
    F: Float64 = first.T @ np.array(printed_value("stereo.E")) @ second
    return F
