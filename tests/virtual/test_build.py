"""What builds the recordings makes the committed ones again."""

from __future__ import annotations

import hashlib
import zlib

import cv2
import numpy as np
import pytest

from stereolib import laser, paper
from stereolib.base import ROOT
from stereolib.rig import Camera, read_image, rigid
from stereolib.virtual import Webcam, build, recordings, render, walk

FOLDER = ROOT / "data" / "virtual"
TOLERANCE = 1.0  # mean absolute difference, grey levels: another processor rounds otherwise, and JPEG with it


def test_manifest_is_written_as_sha256sum_does(tmp_path):
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "x.jpg").write_bytes(b"1")
    (tmp_path / "a.bin").write_bytes(b"2")
    (tmp_path / "mine.jpg").write_bytes(b"not listed")
    build.write_sums(tmp_path, ["b/x.jpg", "a.bin", "missing.bin"])
    assert (tmp_path / "SHA256SUMS").read_text() == (
        f"{hashlib.sha256(b'2').hexdigest()}  a.bin\n{hashlib.sha256(b'1').hexdigest()}  b/x.jpg\n"
    )


@pytest.mark.slow
def test_build_writes_pairs_streams_and_sums(tmp_path, monkeypatch):
    """With a renderer that takes no time: the files, the seeds, and what `only` leaves alone."""
    light = np.full((48, 64, 3), 0.4, np.float32)
    monkeypatch.setattr(build, "render_pair", lambda *_, **__: (light, light))
    monkeypatch.setattr(build, "laser_recordings", lambda: [("lrf/room", b"turn")])
    build.build_recordings(tmp_path, progress=False)
    made = {p.relative_to(tmp_path).as_posix(): p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
    assert len(made) == 2 * (len(recordings.pairs()) + 30) + 2
    assert len(set(made.values())) == len(made)  # each with noise of its own
    sums = made["SHA256SUMS"].decode().splitlines()
    assert f"{hashlib.sha256(b'turn').hexdigest()}  lrf/room.bin" in sums and len(sums) == len(made) - 1
    again = tmp_path / "again"
    again.mkdir()
    for name in ("rig.toml", "holiday.jpg"):
        (again / name).write_bytes(b"there before")
    build.build_recordings(again, only="boards/0", progress=False)
    listed = {line.split()[1] for line in (again / "SHA256SUMS").read_text().splitlines()}
    assert "rig.toml" in listed and "holiday.jpg" not in listed
    files = [p for p in again.rglob("*.jpg") if p.name != "holiday.jpg"]
    assert len(files) == 18
    assert all(p.read_bytes() == made[p.relative_to(again).as_posix()] for p in files)


@pytest.mark.slow
def test_picture_made_again():
    """Poor light: the noisiest of all, so that the seed, the noise and the exposure are held too."""
    name = "conditions/poor_light"
    where, scene = recordings.pairs()[name]
    light = render(scene, paper.paper_rig().left, recordings.setup(where), samples=3)
    rng = np.random.default_rng([zlib.crc32(name.encode()), False])
    ours = Webcam().shoot(light, rng).astype(float)
    committed = recordings.load_pair(name)[0]
    assert np.abs(ours - committed).mean() < TOLERANCE
    other = Webcam().shoot(light, np.random.default_rng(0)).astype(float)
    assert np.abs(other - committed).mean() > 5 * TOLERANCE  # the noise is that of the seed


@pytest.mark.parametrize(
    ("name", "side", "corner"),
    [("conditions/glare", "right", (280, 250)), ("boards/03", "left", None), ("room/2", "left", (330, 200))],
)
def test_part_of_a_picture_made_again(name, side, corner):
    """A part of the same pixels; exposure and vignetting are a smooth factor, fitted, the noise is not made again."""
    rig, board = paper.paper_rig(), name.startswith("boards/")
    lens = getattr(rig, side)
    if board:
        pose = recordings.board_poses()[int(name[-2:]) - 1]
        where, scene = "bench", recordings.board_scene(pose)
        corner = (lens.project(pose[None, :3, 3])[0] - [60, 45]).astype(int)
    else:
        where, scene = recordings.pairs()[name]
    T = recordings.setup(where) if side == "left" else rigid(rig.R, rig.T) @ recordings.setup(where)
    K = lens.K - [[0, 0, corner[0]], [0, 0, corner[1]], [0, 0, 0]]
    light = render(scene, Camera(K, lens.dist, (120, 90)), T, samples=3)
    light = cv2.GaussianBlur(light, (0, 0), Webcam().psf_sigma_px)[5:-5, 5:-5]
    part = read_image(FOLDER / f"{name}_{side}.jpg")[corner[1] + 5 : corner[1] + 85, corner[0] + 5 : corner[0] + 115]
    received = (part / 255.0) ** 2.2
    clear = part.max(axis=2) < 250
    y, x = np.indices(clear.shape) / 100
    terms = np.stack([light.mean(axis=2) * t for t in (np.ones_like(x), x, y)], axis=-1)
    factor = np.linalg.lstsq(terms[clear], received.mean(axis=2)[clear], rcond=None)[0]
    gain = factor[0] + factor[1] * x + factor[2] * y
    ours = 255 * np.clip(light * gain[..., None], 0, 1) ** (1 / 2.2)
    assert np.abs(ours - part)[clear].mean() < 3  # the noise that was not made again
    assert np.abs(ours.mean(axis=2) - part.mean(axis=2))[clear].mean() < 2
    assert part[clear].std() > 10
    slipped = np.abs(ours[:, 1:] - part[:, :-1])[clear[:, :-1]].mean()
    assert slipped > 1.2 * np.abs(ours - part)[clear].mean()


def test_laser_streams_made_again():
    """But for beam 0, which meets the cube exactly on its edge, and strengths that OpenCV 4 rounds otherwise."""
    count = 0
    for name, ours in build.laser_recordings():
        committed = recordings.load_laser(name)
        assert len(ours) == len(committed)
        assert np.mean(np.frombuffer(ours, np.uint8) == np.frombuffer(committed, np.uint8)) > 0.95, name
        first, second = (laser.decode(data) for data in (ours, committed))
        equal = (first.distance_mm == second.distance_mm) | (np.isnan(first.distance_mm) & np.isnan(second.distance_mm))
        assert equal.mean() > 0.995, name
        assert np.abs(first.strength.astype(int) - second.strength).max() <= 1, name
        count += 1
    assert count == 64 + len(walk.POSES)
