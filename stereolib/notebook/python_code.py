"""A state of the bench as a few lines of Python, and as files to take away."""

from __future__ import annotations

import base64
import io
from dataclasses import fields, replace
from html import escape
from typing import Any

import cv2
import numpy as np

from stereolib import paper
from stereolib.base import UInt8
from stereolib.matching import SGBMParams
from stereolib.notebook import chain
from stereolib.notebook.knobs import DILATION, FILTERS, MATCHERS, OWN, WINDOWS, State, to_text
from stereolib.plotting import color_disparity
from stereolib.virtual import recordings


def of(state: State) -> str:
    """Write the lines that make the state's map and readings with the library.

    Parameters
    ----------
    state : State

    Returns
    -------
    str
        They define ``left, right, disparity_px`` and, where they can be told, ``recipe`` and ``attempt``.

    Examples
    --------
    >>> print(of(State(source="conditions/texture")).splitlines()[-1])
    print(f"{recipe.height_mm:.0f} mm", f"{attempt.height_mm:.1f} ± {1.96 * attempt.std_mm:.1f} mm")
    """
    has_rig = chain.rectified_rig(state) is not None
    lines = [*_pair_lines(state, has_rig), *_map_lines(state)]
    reading = f"{paper.printed_value('scale.cm_per_px')!r}, {state.constant_rows}, tolerance_px={state.tolerance_px!r}"
    lines.append(f"recipe = height_by_maximum(disparity_px, {reading})")
    shown = ['f"{recipe.height_mm:.0f} mm"']
    if has_rig:
        lines.append("seen = see_standing(Views.of(*pictures, rectified), Instrument(rectified))")
        lines.append("attempt = attempt_standing(seen)")
        shown.append('f"{attempt.height_mm:.1f} ± {1.96 * attempt.std_mm:.1f} mm"')
    lines.append(f"print({', '.join(shown)})")
    return "\n".join([*_imports("\n".join(lines)), "", *lines])


def _pair_lines(state: State, has_rig: bool) -> list[str]:
    first = State()
    taking = ("roll_deg", "row_px", "baseline_pct", "exposure_ev")
    is_usual = all(getattr(state, name) == getattr(first, name) for name in taking)
    if state.source in recordings.pairs() and is_usual:
        loaded = f"pictures = recordings.load_pair({state.source!r})"
        return ["rectified = recordings.rectified()", loaded, "left, right = rectified.rectify(*pictures)"]
    if state.source == OWN and is_usual:
        left, right, calibration, _ = state.own
        if not calibration:
            return [f"left, right = read_pair({left!r}, {right!r})"]
        loaded = f"pictures = read_pair({left!r}, {right!r})"
        rig = f"rectified = Instrument.load({calibration!r}).rectified"
        return [rig, loaded, "left, right = rectified.rectify(*pictures)"]
    own = f", own={state.own!r}" if state.source == OWN else ""
    made = f"replace(from_text({to_text(state)!r}){own})" if own else f"from_text({to_text(state)!r})"
    lines = [f"state = {made}", "rectified = chain.rectified_rig(state)", "left, right = chain.pair(state)"]
    return [*lines, "pictures = chain.taken(state).left, chain.taken(state).right"] if has_rig else lines


def _map_lines(state: State) -> list[str]:
    params = ", ".join(
        f"{f.name}={getattr(state.sgbm, f.name)!r}"
        for f in fields(SGBMParams)
        if getattr(state.sgbm, f.name) != f.default
    )
    if state.window != WINDOWS[0] and state.source != OWN:  # nobody knows where the laser was
        lines = [f"disparity_px = chain.disparity(from_text({to_text(state)!r}))"]
    elif state.matcher != MATCHERS[0]:
        count = -(-state.sgbm.num_disparities // 32) * 32
        lines = [f"disparity_px = stereo_pipeline({state.matcher!r}, {count})(left, right).disparity_px"]
    else:
        lines = [f"disparity_px = compute_disparity(left, right, SGBMParams({params}))"]
    if state.filter == "left_right":
        flipped = f"compute_disparity(right[:, ::-1].copy(), left[:, ::-1].copy(), SGBMParams({params}))[:, ::-1]"
        lines.append(
            f'disparity_px = smooth(disparity_px, "left_right", size_px={state.kernel_px}, right_px={flipped})'
        )
    elif state.filter == DILATION:
        lines.append(f"disparity_px = dilate(disparity_px, {state.kernel_px}, shape={state.kernel_shape!r})")
    elif state.filter != FILTERS[0]:
        lines.append(f"disparity_px = smooth(disparity_px, {state.filter!r}, size_px={state.kernel_px}, image=left)")
    return lines


_PLACES = {
    "replace": "dataclasses",
    "SGBMParams": "stereolib.matching",
    "compute_disparity": "stereolib.matching",
    "dilate": "stereolib.matching",
    "smooth": "stereolib.matching",
    "stereo_pipeline": "stereolib.matching",
    "Instrument": "stereolib.measurement",
    "Views": "stereolib.measurement",
    "attempt_standing": "stereolib.measurement",
    "see_standing": "stereolib.measurement",
    "chain": "stereolib.notebook",
    "from_text": "stereolib.notebook.knobs",
    "height_by_maximum": "stereolib.paper",
    "read_pair": "stereolib.rig",
    "recordings": "stereolib.virtual",
}


def _imports(code: str) -> list[str]:
    used: dict[str, list[str]] = {}
    for name, place in _PLACES.items():
        if f"{name}(" in code or f"{name}." in code:
            used.setdefault(place, []).append(name)
    return [f"from {place} import {', '.join(names)}" for place, names in used.items()]


def download_links(state: State) -> list[str]:
    """Make links that hold the state's files: left picture, disparity as a picture and as numbers, point cloud.

    Parameters
    ----------
    state : State

    Returns
    -------
    list of str
        HTML.
    """
    state = replace(state, half=False)
    left, map_px = chain.pair(state)[0], chain.filtered(state)
    numbers = io.BytesIO()
    np.save(numbers, map_px, allow_pickle=False)
    files = {
        "left.png": cv2.imencode(".png", left)[1].tobytes(),
        "disparity.png": cv2.imencode(".png", color_disparity(map_px, *state.colors_px))[1].tobytes(),
        "disparity.npy": numbers.getvalue(),
    }
    if (cloud := _point_cloud(state)) is not None:
        files["points.ply"] = cloud
    return [
        f'<a download="{escape(name)}" href="data:application/octet-stream;base64,{base64.b64encode(data).decode()}">'
        f"{escape(name)}</a>"
        for name, data in files.items()
    ]


def _point_cloud(state: State) -> bytes | None:
    """Matched pixels in the rectified left camera's frame, mm, as PLY; None without a calibration."""
    import trimesh

    rectified = chain.rectified_rig(state)
    if rectified is None:
        return None
    map_px, left = chain.filtered(state), chain.pair(state)[0]
    color: UInt8 = cv2.cvtColor(left, cv2.COLOR_GRAY2BGR) if left.ndim == 2 else left
    rows, columns = np.nonzero(map_px > 0)
    rays = np.column_stack([columns, rows, np.ones(len(rows))]) @ np.linalg.inv(rectified.P1[:, :3]).T
    points = rays * (rectified.f_px * rectified.baseline_mm / map_px[rows, columns])[:, None]
    cloud: Any = trimesh.PointCloud(points, colors=color[rows, columns][:, ::-1])  # type: ignore[no-untyped-call]
    return bytes(cloud.export(file_type="ply"))
