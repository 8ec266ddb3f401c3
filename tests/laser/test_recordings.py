"""Recordings on disk: the real one, a pipe, and files that are none."""

import json
import os
import threading

import numpy as np
import pytest
from support.old_firmware import encode_turns

from stereolib import laser
from stereolib.base import datasets


@pytest.fixture(scope="module")
def recording():
    try:
        return datasets.real_recording("xv11/hand_in_box.txt")
    except datasets.NotAvailable as reason:
        pytest.skip(str(reason))


def packets(n, start=0, distance_mm=None, **kwargs):
    """`n` packets in a row; by default beam b of the stream measures 1000 + b mm."""
    if distance_mm is None:
        distance_mm = 1000.0 + np.arange(4 * start, 4 * (start + n))
    index = (start + np.arange(n)) % 90
    return laser.Readings.build(index, np.reshape(distance_mm, (n, 4)), 100, **kwargs)


def test_real_recording(recording):
    about = laser.recording_info(recording)
    assert (about["packets"], about["turns"], about["bad_checksums"]) == (11451, 120, 1)
    assert 295 < about["rpm_median"] < 298 and 49 < about["rpm_min"] < 51
    assert about["invalid_share"] == pytest.approx(0.0611, abs=5e-5)
    assert json.loads(json.dumps(about)) == about


def test_files_that_are_no_recordings(tmp_path):
    path = tmp_path / "scan.bin"
    path.write_bytes(b"")
    with pytest.raises(ValueError, match=r"is empty.*power"):
        laser.read_recording(path)
    path.write_bytes(np.random.default_rng(0).bytes(5000))
    with pytest.raises(ValueError, match=r"is no XV-11 recording.*115200"):
        laser.read_recording(path)
    path.write_bytes(np.random.default_rng(0).bytes(5000) + laser.encode(packets(1)))
    with pytest.raises(ValueError, match=r"5022 bytes.* is no XV-11"):
        laser.read_recording(path)  # one packet by chance does not make a recording
    path.write_bytes(laser.encode(packets(90)) + encode_turns(packets(90)))
    with pytest.raises(ValueError, match=r"mixes two firmwares: 90 packets .* 1 turns"):
        laser.read_recording(path)
    path.write_bytes(laser.encode(packets(45)))
    assert laser.recording_info(path)["turns"] == 0 and laser.recording_info(path)["partial_turns"] == 1
    spoilt = bytearray(laser.encode(packets(90)))
    spoilt[10 : 22 * 50 : 22] = bytes(byte ^ 1 for byte in spoilt[10 : 22 * 50 : 22])
    path.write_bytes(spoilt)
    with pytest.raises(ValueError, match=r"scan.bin: 50 of 90 packets are damaged: see to cable"):
        laser.read_recording(path)
    about = laser.recording_info(path)
    assert about["bad_checksums"] == 50 and about["damage"].startswith("50 of 90 packets are damaged: see to cable")
    assert about["lost_share"] == 0 and about["packets"] == 40  # at its end none is missing between two others
    path.write_bytes(laser.encode(packets(30)) + laser.encode(packets(50, 40)))
    about = laser.recording_info(path)
    assert about["lost_share"] == pytest.approx(10 / 90) and not about["damage"]
    path.write_bytes(encode_turns(packets(180)))
    about = laser.recording_info(path)
    assert about["turns"] == 2 and about["rpm_median"] is None
    assert about["firmware"] == "1446-byte turns"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_is_read_like_a_file(tmp_path):
    data, pipe = laser.encode(packets(180)), tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_bytes, args=(data,))
    writer.start()
    scans = laser.take_scans(pipe, 2)
    writer.join()
    assert [scan.complete for scan in scans] == [True, True]
    np.testing.assert_array_equal(scans[1].ranges_mm, 1360 + np.arange(360))
