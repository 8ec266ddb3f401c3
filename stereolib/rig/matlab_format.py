"""MATLAB's ``stereoParameters``: row vectors, pixels counted from one, sizes as (rows, columns)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from stereolib.rig.camera import Camera
from stereolib.rig.formats import at_least, naming, need, numbers
from stereolib.rig.stereo_rig import StereoRig

_UNITS_MM = {"mm": 1.0, "millimeters": 1.0, "cm": 10.0, "centimeters": 10.0, "m": 1e3, "meters": 1e3}


def to_matlab_struct(rig: StereoRig) -> dict[str, Any]:
    """Write a rig as the fields of MATLAB's ``toStruct(stereoParameters)``, for `scipy.io.savemat`.

    Parameters
    ----------
    rig : StereoRig

    Returns
    -------
    dict
        ``CameraParameters1``, ``CameraParameters2``, ``RotationOfCamera2``, ``TranslationOfCamera2``.

    Raises
    ------
    ValueError
        If the lens is more than k1 k2 p1 p2 k3.

    Notes
    -----
    MATLAB multiplies rows, ``x_right = x_left R + T``, so R and K stand transposed; its first pixel's centre is
    (1, 1), so principal points are larger by one; sizes are (rows, columns).

    Examples
    --------
    >>> camera = Camera(np.diag([700.0, 700.0, 1.0]), np.zeros(0), (640, 480))
    >>> rig = StereoRig(camera, camera, np.eye(3), np.array([-90.0, 0.0, 0.0]))
    >>> to_matlab_struct(rig)["TranslationOfCamera2"]
    array([[-90.,   0.,   0.]])
    """
    fields: dict[str, Any] = {}
    for number, camera in enumerate((rig.left, rig.right), 1):
        if camera.dist[5:].any():
            raise ValueError(f"MATLAB's lens holds k1 k2 k3 p1 p2, this one has {camera.dist.size} coefficients")
        k1, k2, p1, p2, k3 = at_least(camera.dist, 5)[:5]
        K = camera.K.copy()
        K[:2, 2] += 1
        lens = {"RadialDistortion": np.array([k1, k2, k3]), "TangentialDistortion": np.array([p1, p2])}
        image = {"ImageSize": np.array(camera.size[::-1], float), "WorldUnits": "mm"}
        fields[f"CameraParameters{number}"] = {"IntrinsicMatrix": K.T, **lens, **image}
    return fields | {"RotationOfCamera2": rig.R.T.copy(), "TranslationOfCamera2": rig.T[None].copy()}


def from_matlab_struct(fields: Mapping[str, Any]) -> StereoRig:
    """Read a rig from the fields of MATLAB's ``toStruct(stereoParameters)``; undoes `to_matlab_struct`.

    Parameters
    ----------
    fields : mapping
        For example ``scipy.io.loadmat("rig.mat", simplify_cells=True)["rig"]``.

    Returns
    -------
    StereoRig

    Raises
    ------
    ValueError
        A field is missing, or the world's unit is not one we know.

    Examples
    --------
    >>> camera = Camera(np.diag([700.0, 700.0, 1.0]), np.zeros(5), (640, 480))
    >>> rig = StereoRig(camera, camera, np.eye(3), np.array([-90.0, 0.0, 0.0]))
    >>> from_matlab_struct(to_matlab_struct(rig)).baseline_mm
    90.0
    """
    cameras = []
    with naming("the MATLAB structure"):
        for number in (1, 2):
            entry = need(fields, f"CameraParameters{number}")
            K = numbers(need(entry, "IntrinsicMatrix")).T.copy()
            K[:2, 2] -= 1
            k1, k2, k3 = at_least(numbers(need(entry, "RadialDistortion")).ravel(), 3)
            p1, p2 = numbers(need(entry, "TangentialDistortion")).ravel()
            height, width = numbers(need(entry, "ImageSize")).ravel().astype(int)
            cameras.append(Camera(K, np.array([k1, k2, p1, p2, k3]), (width, height)))
        unit = str(entry.get("WorldUnits", "mm"))
        if unit not in _UNITS_MM:
            raise ValueError(f"WorldUnits is {unit!r}, expected one of {', '.join(_UNITS_MM)}")
        R, T = numbers(need(fields, "RotationOfCamera2")), numbers(need(fields, "TranslationOfCamera2"))
        return StereoRig(cameras[0], cameras[1], R.T, T.ravel() * _UNITS_MM[unit])
