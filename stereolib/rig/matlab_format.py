"""MATLAB's ``stereoParameters``: row vectors, pixels counted from one, sizes as (rows, columns)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from stereolib.rig.camera import Camera
from stereolib.rig.formats import at_least, naming, need, numbers
from stereolib.rig.stereo_rig import StereoRig


def to_struct(rig: StereoRig) -> dict[str, Any]:
    """The fields of MATLAB's ``toStruct(stereoParameters)``, for `scipy.io.savemat`.

    Raises
    ------
    ValueError
        If the lens is more than k1 k2 p1 p2 k3.

    Notes
    -----
    MATLAB multiplies rows, ``x_right = x_left R + T``, so R and K stand transposed; its first pixel's centre is
    (1, 1), so principal points are larger by one; sizes are (rows, columns).
    """
    fields: dict[str, Any] = {}
    for number, camera in enumerate((rig.left, rig.right), 1):
        if camera.dist[5:].any():
            raise ValueError(f"MATLAB's lens holds k1 k2 k3 p1 p2, this one has {camera.dist.size} coefficients")
        k1, k2, p1, p2, k3 = at_least(camera.dist, 5)[:5]
        K = camera.K.copy()
        K[:2, 2] += 1
        fields[f"CameraParameters{number}"] = {
            "IntrinsicMatrix": K.T,
            "RadialDistortion": np.array([k1, k2, k3]),
            "TangentialDistortion": np.array([p1, p2]),
            "ImageSize": np.array(camera.size[::-1], float),
            "WorldUnits": "mm",
        }
    return fields | {"RotationOfCamera2": rig.R.T.copy(), "TranslationOfCamera2": rig.T[None].copy()}


def from_struct(fields: Mapping[str, Any]) -> StereoRig:
    """A rig from the fields of MATLAB's ``toStruct(stereoParameters)``; undoes `to_struct`.

    Parameters
    ----------
    fields : mapping
        For example ``scipy.io.loadmat("rig.mat", simplify_cells=True)["rig"]``.

    Raises
    ------
    ValueError
        A field is missing, or the world's unit is not one we know.
    """
    cameras, units = [], {"mm": 1.0, "millimeters": 1.0, "cm": 10.0, "centimeters": 10.0, "m": 1e3, "meters": 1e3}
    with naming("the MATLAB structure"):
        for number in (1, 2):
            entry = need(fields, f"CameraParameters{number}")
            K = numbers(need(entry, "IntrinsicMatrix")).T.copy()
            K[:2, 2] -= 1
            k1, k2, k3 = at_least(numbers(need(entry, "RadialDistortion")).ravel(), 3)
            p1, p2 = numbers(need(entry, "TangentialDistortion")).ravel()
            height, width = numbers(need(entry, "ImageSize")).ravel()
            cameras.append(Camera(K, [k1, k2, p1, p2, k3], (width, height)))  # type: ignore[arg-type]
        unit = str(entry.get("WorldUnits", "mm"))
        if unit not in units:
            raise ValueError(f"WorldUnits is {unit!r}, expected one of {', '.join(units)}")
        R, T = numbers(need(fields, "RotationOfCamera2")), numbers(need(fields, "TranslationOfCamera2"))
        return StereoRig(cameras[0], cameras[1], R.T, T.ravel() * units[unit])
