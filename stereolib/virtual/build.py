"""Render and write the virtual rig's recordings: pictures of pairs and boards, the laser's streams, their sums."""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from stereolib.base import Float64, read_bytes, write_atomic
from stereolib.paper import paper_rig
from stereolib.virtual import recordings, walk
from stereolib.virtual.lidar import VirtualLidar
from stereolib.virtual.rendering import render_pair
from stereolib.virtual.scene import Scene, cube_scene
from stereolib.virtual.webcam import Webcam

_SAMPLES = 3  # rays per pixel and axis
_RIG_FILE = "rig.toml"  # which `stereolib.mapping` writes beside them


def build_recordings(output: Path, *, only: str = "", progress: bool = True) -> None:
    """Make the recordings again: some minutes. Each file is replaced when it is done; the sums are written last.

    Parameters
    ----------
    output : Path
    only : str
        Make only the pairs whose names begin so, for example ``"conditions/"``.
    progress : bool
        Show a bar.
    """
    from joblib import Parallel, cpu_count, delayed
    from tqdm.auto import tqdm

    jobs = [(name, scene, where) for name, (where, scene) in recordings.pairs().items()]
    boards = enumerate(recordings.board_poses())
    jobs += [(f"boards/{i + 1:02d}", recordings.board_scene(pose), "bench") for i, pose in boards]
    made = [f"{name}_{side}.jpg" for name, _, _ in jobs for side in ("left", "right")]
    jobs = [job for job in jobs if job[0].startswith(only)]
    running = Parallel(n_jobs=cpu_count(), prefer="threads", return_as="generator_unordered")(
        delayed(_shoot)(output, name, scene, recordings.setup(where)) for name, scene, where in jobs
    )
    list(tqdm(running, "rendering pairs", len(jobs), unit="pair", disable=not progress))
    for name, data in laser_recordings():
        write_atomic(output / f"{name}.bin", data)
        made.append(f"{name}.bin")
    write_sums(output, [*made, _RIG_FILE])


def _shoot(output: Path, name: str, scene: Scene, T_left_world: Float64) -> None:
    """Render and write one pair; its noise is drawn from its name."""
    lights, webcam = render_pair(scene, paper_rig(), T_left_world, samples=_SAMPLES), Webcam()
    for side, light in zip(("left", "right"), lights, strict=True):
        rng = np.random.default_rng([zlib.crc32(name.encode()), side == "right"])
        write_atomic(output / f"{name}_{side}.jpg", webcam.encode(webcam.expose(light, rng)))


def laser_recordings() -> Iterator[tuple[str, bytes]]:
    """Make the laser's streams: five turns in the room (Fig. 6), the range series (Fig. 5), and those of the walk.

    Yields
    ------
    name : str
    data : bytes
    """
    sensor = VirtualLidar()
    yield "lrf/room", sensor.scan(cube_scene(), recordings.LASER_POSE, np.random.default_rng(6), turns=5)
    for k, (target, albedo) in enumerate(recordings.TARGETS.items()):
        series = sensor.range_series(recordings.RANGES_MM, albedo, np.random.default_rng([5, k]))
        for distance, data in zip(recordings.RANGES_MM, series, strict=True):
            yield f"lrf/range/{target}_{distance:04d}", data
    for name in walk.POSES:
        yield f"{name}_scan", walk.scan_bytes(name)


def write_sums(folder: Path, names: Iterable[str]) -> None:
    """Write SHA256SUMS of recordings in a folder, in `sha256sum`'s format.

    Parameters
    ----------
    folder : Path
    names : iterable of str
        Of the recordings, within the folder; those that are not there are left out.
    """
    files = sorted(p for p in (folder / name for name in names) if p.is_file())
    lines = [f"{hashlib.sha256(read_bytes(p)).hexdigest()}  {p.relative_to(folder).as_posix()}\n" for p in files]
    write_atomic(folder / "SHA256SUMS", "".join(lines))
