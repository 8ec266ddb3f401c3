"""Calibrations in the files of other tools: OpenCV, ROS and Kalibr, each in its own convention and unit.

Our own file is `StereoRig.save`'s JSON; MATLAB's structures are in `matlab_format`. Every reader gives millimetres,
radians and ``x_right = R x_left + T``, whatever the file holds, and refuses lenses that are not OpenCV's.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import cv2
import numpy as np
import yaml

from stereolib.base import Float64, check_nesting, finite_array, parse_yaml, read_text, read_yaml, write_atomic
from stereolib.rig.camera import Camera
from stereolib.rig.stereo_rig import StereoRig
from stereolib.rig.transforms import rigid

AnyPath = str | PathLike[str]
_MM_PER_M = 1000.0
_MOST = 1e9  # of any number in such files: a larger one is damage, and products overflow
#: What OpenCV files call the left and right camera's matrix and lens, before the number of the camera.
_OPENCV_NAMES = (("M", "D"), ("K", "D"), ("cameraMatrix", "distCoeffs"))
_OPENCV_RECTIFIED = ("R1", "R2", "P1", "P2", "Q")
#: ROS' name of a lens -> how many of OpenCV's coefficients it holds.
_ROS_MODELS = {"plumb_bob": 5, "rational_polynomial": 8}
_ROS_MATRICES = ("camera_matrix", "distortion_coefficients", "rectification_matrix", "projection_matrix")


def save_opencv(path: AnyPath, rig: StereoRig, *, alpha: float = 0.0) -> Path:
    """Write what OpenCV's ``stereo_calib`` sample writes, in one YAML file, with the size of the images.

    Parameters
    ----------
    path : path
        Ends in ``.yml``, ``.yaml`` or ``.xml``: `cv2.FileStorage` chooses by it when the file is read.
    rig : StereoRig
    alpha : float
        Of the rectification that is kept beside the rig (`StereoRig.rectify`).

    Returns
    -------
    Path
        Where it was written.

    Notes
    -----
    ``M1 D1 M2 D2 R T`` and ``R1 R2 P1 P2 Q``; T and Q in millimetres; 17 significant digits, which hold a double
    exactly. A lens without coefficients is written as five zeros.
    """
    rectified = rig.rectify(alpha)
    kind = cv2.FILE_STORAGE_FORMAT_XML if Path(path).suffix.lower() == ".xml" else cv2.FILE_STORAGE_FORMAT_YAML
    storage = cv2.FileStorage("rig", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY | kind)
    entries: dict[str, Any] = {"image_width": rig.left.size[0], "image_height": rig.left.size[1]}
    for number, camera in enumerate((rig.left, rig.right), 1):
        entries |= {f"M{number}": camera.K, f"D{number}": at_least(camera.dist, 5)[None]}
    entries |= {"R": rig.R, "T": rig.T[:, None]} | {name: getattr(rectified, name) for name in _OPENCV_RECTIFIED}
    for name, value in entries.items():
        storage.write(name, value)
    return write_atomic(path, storage.releaseAndGetString())


def load_opencv(*paths: AnyPath, size: tuple[int, int] | None = None, unit_mm: float = 1.0) -> StereoRig:
    """Read a rig from OpenCV's YAML, XML or JSON: one file, or intrinsics and extrinsics in two.

    Parameters
    ----------
    *paths : path
        Hold ``M1 D1 M2 D2 R T`` (or ``K1`` ..., ``cameraMatrix1 distCoeffs1`` ...).
    size : (width, height), px, optional
        Of the images, if the files do not say (OpenCV's own samples leave it out).
    unit_mm : float
        Length of one unit of the file's T, mm: 1000 if the board was measured in metres.

    Returns
    -------
    StereoRig

    Raises
    ------
    ValueError
        The files lack something or hold something else; they are named.
    """
    texts, entries = [read_text(path) for path in paths], dict[str, Any]()
    with naming(*paths):
        for text in texts:
            entries |= _file_storage(text)
        choices = ((f"{K}1", f"{dist}1", f"{K}2", f"{dist}2") for K, dist in _OPENCV_NAMES)
        names = next((names for names in choices if entries.keys() >= set(names)), None)
        if names is None:
            raise ValueError(f"no M1, D1, M2, D2 in it, only {', '.join(entries) or 'nothing'}")
        if size is None and not entries.keys() >= {"image_width", "image_height"}:
            raise ValueError("it does not say how large the images are: pass size=(width, height)")
        size = size or (entries["image_width"], entries["image_height"])
        K1, d1, K2, d2, R, T = (need(entries, name) for name in (*names, "R", "T"))
        return StereoRig(Camera(K1, d1, size), Camera(K2, d2, size), R, numbers(T).ravel() * unit_mm)


def save_ros(left: AnyPath, right: AnyPath, rig: StereoRig, *, alpha: float = 0.0) -> tuple[Path, Path]:
    """Write the pair of ``camera_info`` files of ROS' camera drivers (``camera_calibration_parsers``).

    Parameters
    ----------
    left, right : path
        Of the two YAML files; their stems become the cameras' names.
    rig : StereoRig
    alpha : float
        Of the rectification, which these files are made of (`StereoRig.rectify`).

    Returns
    -------
    left, right : Path
        Where they were written.

    Raises
    ------
    ValueError
        If the lens has more than 8 coefficients: ROS has no name for it.

    Notes
    -----
    ROS counts in metres: ``P2[0, 3] = -f B`` with B in m. The lens ``plumb_bob`` holds k1 k2 p1 p2 k3,
    ``rational_polynomial`` k4 k5 k6 as well.
    """
    rectified = rig.rectify(alpha)
    R2 = _aligned(rectified.R2, rig.T)
    texts = []
    for path, camera, R, P in ((left, rig.left, R2 @ rig.R, rectified.P1), (right, rig.right, R2, rectified.P2)):
        if camera.dist.size > 8:
            why = f"ROS' camera_info has no lens model of {camera.dist.size} coefficients"
            raise ValueError(f"{why}: calibrate with brown3 (5) or rational8 (8) for it")
        model = "rational_polynomial" if camera.dist.size == 8 else "plumb_bob"
        info: dict[str, Any] = {"image_width": camera.size[0], "image_height": camera.size[1]}
        info |= {"camera_name": Path(path).stem, "distortion_model": model}
        dist, in_metres = at_least(camera.dist, 5)[None], np.column_stack([P[:, :3], P[:, 3] / _MM_PER_M])
        for name, matrix in zip(_ROS_MATRICES, (camera.K, dist, R, in_metres), strict=True):
            info[name] = {"rows": matrix.shape[0], "cols": matrix.shape[1], "data": matrix.ravel().tolist()}
        texts.append(_dump(info))
    return write_atomic(left, texts[0]), write_atomic(right, texts[1])


def load_ros(left: AnyPath, right: AnyPath) -> StereoRig:
    """Read a rig from a pair of ``camera_info`` files.

    Parameters
    ----------
    left, right : path

    Returns
    -------
    StereoRig

    Raises
    ------
    ValueError
        A file lacks something, its lens is not OpenCV's, both files are the same, or the pair is not of one rig; the
        file is named.

    Notes
    -----
    The files hold no R and T but both rectifications: ``R = R2' R1`` and ``T = R2' inv(P2[:, :3]) P2[:, 3]``.
    """
    cameras, turns, shifts = [], [], []
    if read_text(left) == read_text(right):
        why = "both say the same, so that there is no baseline between the cameras"
        raise ValueError(f"{left} and {right}: {why}; give the left camera's file and the right one's")
    for path in (left, right):
        info = read_yaml(path)
        with naming(path):
            K, dist, R, P = (_ros_matrix(info, name) for name in _ROS_MATRICES)
            model = info.get("distortion_model", "plumb_bob")
            if model not in _ROS_MODELS:
                raise ValueError(f"its lens {model!r} is none of {', '.join(_ROS_MODELS)}")
            if dist.size > _ROS_MODELS[model]:
                raise ValueError(f"{model} has {_ROS_MODELS[model]} coefficients, it lists {dist.size}")
            cameras.append(Camera(K, dist, (need(info, "image_width"), need(info, "image_height"))))
            turns.append(R)
            shift_m = np.linalg.solve(P[:, :3], P[:, 3])
            shifts.append(finite_array(shift_m, (3,), "the shift in its projection matrix, m,", most=_MOST) * _MM_PER_M)
    with naming(left, right):
        if not np.linalg.norm(shifts[1]) > 0:
            raise ValueError("the right camera's projection matrix holds no baseline: is it one of a stereo pair?")
        return StereoRig(cameras[0], cameras[1], turns[1].T @ turns[0], turns[1].T @ (shifts[1] - shifts[0]))


def save_kalibr(path: AnyPath, rig: StereoRig) -> Path:
    """Write a Kalibr ``camchain.yaml``, the left camera being ``cam0``.

    Parameters
    ----------
    path : path
    rig : StereoRig

    Returns
    -------
    Path
        Where it was written.

    Raises
    ------
    ValueError
        If the lens is more than k1 k2 p1 p2: Kalibr's ``radtan`` holds no more.

    Notes
    -----
    ``T_cn_cnm1`` of ``cam1`` takes points of ``cam0`` into ``cam1``, as our R and T do, in metres.
    """
    chain: dict[str, Any] = {}
    for number, (side, camera) in enumerate((("left", rig.left), ("right", rig.right))):
        if camera.dist[4:].any() or camera.K[0, 1]:
            why = "Kalibr's radtan lens holds k1 k2 p1 p2 and no skew"
            remedy = f"the {side} camera has k3 = {at_least(camera.dist, 5)[4]:g} and {camera.dist.size} coefficients"
            raise ValueError(f"{why}, {remedy}: calibrate with brown2 for it")
        (fx, _, cx), (_, fy, cy), _ = camera.K.tolist()
        entry: dict[str, Any] = {"cam_overlaps": [1 - number], "camera_model": "pinhole"}
        entry |= {"distortion_coeffs": at_least(camera.dist, 4)[:4].tolist(), "distortion_model": "radtan"}
        entry |= {"intrinsics": [fx, fy, cx, cy], "resolution": list(camera.size), "rostopic": f"/{side}/image_raw"}
        chain[f"cam{number}"] = entry
    chain["cam1"]["T_cn_cnm1"] = rigid(rig.R, rig.T / _MM_PER_M).tolist()
    return write_atomic(path, _dump(chain))


def load_kalibr(path: AnyPath) -> StereoRig:
    """Read a rig from the first two cameras of a Kalibr ``camchain.yaml``.

    Parameters
    ----------
    path : path

    Returns
    -------
    StereoRig

    Raises
    ------
    ValueError
        The file lacks something, or a lens is not OpenCV's; the file is named.
    """
    chain, cameras = read_yaml(path), []
    with naming(path):
        for name in ("cam0", "cam1"):
            entry = need(chain, name)
            models = (need(entry, "camera_model"), need(entry, "distortion_model"))
            if models not in (("pinhole", "radtan"), ("pinhole", "none")):
                lens = " with ".join(map(str, models))
                raise ValueError(f"{name} is {lens}; only pinhole with radtan is OpenCV's lens")
            fx, fy, cx, cy = numbers(need(entry, "intrinsics"))
            K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
            cameras.append(Camera(K, numbers(entry.get("distortion_coeffs", ())), need(entry, "resolution")))
        T = numbers(need(chain["cam1"], "T_cn_cnm1")).reshape(4, 4)
        return StereoRig(cameras[0], cameras[1], T[:3, :3], T[:3, 3] * _MM_PER_M)


def load_rig(*paths: AnyPath, size: tuple[int, int] | None = None, unit_mm: float = 1.0) -> StereoRig:
    """Read a rig from any of the files above, told apart by what they hold.

    Parameters
    ----------
    *paths : path
        One file (JSON of `StereoRig.save`, OpenCV, Kalibr), or two (ROS left and right, OpenCV intrinsics and
        extrinsics).
    size : (width, height), px, optional
        Of the images, as for `load_opencv`; all other files say it.
    unit_mm : float
        Length of one unit of T, mm, as for `load_opencv`; all other files have their own unit.

    Returns
    -------
    StereoRig

    Raises
    ------
    ValueError
        If a file is of no kind that we read, or is damaged; if there are two and the first is the whole rig; or if the
        size or the unit is given for files that are not OpenCV's.

    Examples
    --------
    >>> load_rig("README.md")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    ValueError: README.md...
    """
    if not 1 <= len(paths) <= 2:
        raise ValueError(f"a rig is kept in one file or two, got {len(paths)}")
    text = read_text(paths[0])
    is_ours = "stereolib.rig/" in text
    if "opencv" in text and not is_ours:
        return load_opencv(*paths, size=size, unit_mm=unit_mm)
    is_whole = is_ours or "cam0:" in text
    if not is_whole and not ("camera_matrix" in text and len(paths) == 2):
        kinds = "the JSON of stereolib, OpenCV's YAML, a Kalibr camchain, or two camera_info files of ROS"
        raise ValueError(f"{paths[0]} is no calibration that we read: expected {kinds}, left and right")
    if size is not None or unit_mm != 1.0:
        why = f"{paths[0]} says itself how large the images are and has its own unit"
        raise ValueError(f"{why}: leave out size and unit_mm, which are for OpenCV's files")
    if not is_whole:
        return load_ros(*paths)
    if len(paths) == 2:
        raise ValueError(f"{paths[0]} holds the whole rig: leave out {paths[1]}")
    return StereoRig.load(paths[0]) if is_ours else load_kalibr(paths[0])


@contextmanager
def naming(*paths: object) -> Iterator[None]:
    """Make errors of whatever a file may hold into a ValueError that names it.

    Parameters
    ----------
    *paths : path or str
        What the message names.
    """
    try:
        yield
    except (ValueError, TypeError, LookupError, AttributeError, OverflowError) as error:
        raise ValueError(f"{' and '.join(map(str, paths))}: {error}") from error


def need(entries: Any, name: str) -> Any:
    """Take an entry that must be there.

    Parameters
    ----------
    entries : mapping
        As it was read: it may be anything.
    name : str

    Returns
    -------
    object

    Raises
    ------
    ValueError
        If there is none of that name.
    """
    if not isinstance(entries, Mapping) or name not in entries:
        raise ValueError(f"it has no {name}")
    return entries[name]


def numbers(values: Any) -> Float64:
    """Make numbers as they were read into floats; also ``1e-05``, which YAML 1.1 takes for a text.

    Parameters
    ----------
    values : array_like

    Returns
    -------
    float64, shaped like `values`, read-only

    Raises
    ------
    ValueError
        If one is none, not finite, or so large that products would overflow.

    Examples
    --------
    >>> numbers(["1e-05", 2])
    array([1.e-05, 2.e+00])
    """
    return finite_array(values, None, "numbers of the file", most=_MOST)


def at_least(dist: Float64, count: int) -> Float64:
    """Fill up a lens's coefficients with zeros.

    Parameters
    ----------
    dist : (n,) array
    count : int
        How many there must be.

    Returns
    -------
    (max(n, count),) float64

    Examples
    --------
    >>> at_least(np.array([0.1, -0.2]), 4)
    array([ 0.1, -0.2,  0. ,  0. ])
    """
    return np.pad(dist, (0, max(0, count - dist.size)))


def _aligned(R2: Float64, T: Float64) -> Float64:
    """The right camera's rectification with its x axis exactly along the baseline, z as near as can be.

    The angles of `cv2.stereoRectify` hold 5 to 8 digits for nearly parallel cameras, so that R and T made from them
    would be off by up to 1e-5 rad and 1e-6 mm.
    """
    x = -T / np.linalg.norm(T)
    y = np.cross(R2[2], x)
    y /= np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)])


def _dump(entries: Mapping[str, Any]) -> str:
    return yaml.safe_dump(entries, sort_keys=False, default_flow_style=None, width=120)


def _ros_matrix(info: Any, name: str) -> Float64:
    entry = need(info, name)
    matrix = numbers(need(entry, "data")).reshape(int(need(entry, "rows")), int(need(entry, "cols")))
    return matrix.ravel() if name == "distortion_coefficients" else matrix


def _file_storage(text: str) -> dict[str, Any]:
    """Matrices and numbers at the top of OpenCV's own format: YAML, XML or JSON.

    `cv2.FileStorage` writes past the end of its memory where a matrix is damaged, so that it never sees such a file.
    """
    check_nesting(text)
    begin = text.lstrip()[:1]
    try:
        if begin == "<":
            values = _xml_storage(text)
        elif begin == "{":
            values = json.loads(text)
        else:  # its first line is no directive of YAML's, and its tags say what the names say
            values = parse_yaml(re.sub(r"\A%YAML[^\n]*\n|!!opencv-(?:nd-)?matrix", "", text))
        if not isinstance(values, Mapping):
            raise ValueError("it holds no named entries")
    except (ValueError, ElementTree.ParseError) as error:
        raise ValueError(f"not a file of OpenCV's FileStorage, or damaged ({error})") from error
    entries: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, Mapping) and value.keys() >= {"rows", "cols", "data"}:
            rows, columns = (int(numbers(value[side])) for side in ("rows", "cols"))
            entries[str(name)] = numbers(value["data"]).reshape(rows, columns)
        elif isinstance(value, int | float | str):
            with suppress(ValueError):  # texts are there, too
                entries[str(name)] = float(value)
    return entries


def _xml_storage(text: str) -> dict[str, Any]:
    """Entries of OpenCV's XML, as its YAML has them; without entities, which may unfold without end."""
    if "<!" in re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL):
        raise ValueError("it declares entities")
    entries: dict[str, Any] = {}
    for node in ElementTree.fromstring(text):
        parts = {part.tag: (part.text or "").split() for part in node}
        sides = {name: parts[name][0] for name in ("rows", "cols") if parts.get(name)}
        entries[node.tag] = parts | sides if parts else (node.text or "").strip()
    return entries
