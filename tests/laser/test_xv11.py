"""The XV-11 protocol against its known vector, a plain loop over bytes, and damage of every kind."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.old_firmware import encode_turns

from stereolib import laser
from stereolib.base import datasets
from stereolib.laser import framing

VECTOR = bytes.fromhex("FAB1E349E400E105E2003406E0002506DF008406F66B")


@pytest.fixture(scope="module")
def recording():
    try:
        return datasets.real_recording("xv11/hand_in_box.txt").read_bytes()
    except datasets.NotAvailable as reason:
        pytest.skip(str(reason))


def plain_checksum(packet):
    c = 0
    for i in range(0, 20, 2):
        c = (c << 1) + (packet[i] | packet[i + 1] << 8)
    return ((c & 0x7FFF) + (c >> 15)) & 0x7FFF


def plain_decode(data):
    """The slow twin: one byte at a time, as drivers do it."""
    rows, i = [], 0
    while i + 22 <= len(data):
        p = data[i : i + 22]
        good = p[0] == 0xFA and 0xA0 <= p[1] <= 0xF9
        if not good or plain_checksum(p) != p[20] | p[21] << 8:
            i += 1
            continue
        readings = []
        for o in (4, 8, 12, 16):
            word, strength = p[o] | p[o + 1] << 8, p[o + 2] | p[o + 3] << 8
            bad = bool(word & 0x8000)
            readings.append((None if bad else word & 0x3FFF, strength, p[o] if bad else 0, bool(word & 0x4000)))
        rows.append((i, p[1] - 0xA0, (p[2] | p[3] << 8) / 64, readings))
        i += 22
    return rows


def as_rows(r):
    return [
        (
            int(r.offset[k]),
            int(r.index[k]),
            float(r.speed_rpm[k]),
            [
                (None if np.isnan(d) else int(d), int(s), int(e), bool(w))
                for d, s, e, w in zip(r.distance_mm[k], r.strength[k], r.error_code[k], r.warning[k], strict=True)
            ],
        )
        for k in range(len(r))
    ]


def counters(r):
    return r.good, r.bad_checksum, r.skipped_bytes, r.index_jumps, r.old_turns


def random_readings(rng, n, start=0):
    distance = rng.integers(0, 0x4000, (n, 4)).astype(float)
    distance[rng.random((n, 4)) < 0.1] = np.nan
    return laser.Readings.build(
        (start + np.arange(n)) % 90,
        distance,
        rng.integers(0, 0x10000, (n, 4)),
        speed_rpm=rng.integers(0, 0x10000, n) / 64,
        error_code=rng.integers(0, 256, (n, 4)),
        warning=rng.random((n, 4)) < 0.1,
    )


def random_packets(rng, n):
    data = laser.encode(random_readings(rng, n))
    return [data[at : at + 22] for at in range(0, len(data), 22)]


def damaged(rng, packets):
    """Packets with flips, drops, insertions and garbage; the stream, and where intact ones start."""
    stream, intact = bytearray(), []
    for packet in packets:
        kind = rng.integers(8)
        if kind == 0:
            spoilt = bytearray(packet)
            spoilt[rng.integers(22)] ^= 1 << rng.integers(8)
            stream += spoilt
        elif kind == 1:
            at = rng.integers(22)
            stream += packet[:at] + packet[at + rng.integers(1, 22 - at + 1) :]
        elif kind == 2:
            at = rng.integers(1, 22)
            stream += packet[:at] + rng.bytes(int(rng.integers(1, 30))) + packet[at:]
        else:
            if kind == 3:
                stream += rng.bytes(int(rng.integers(1, 60)))
            intact.append(len(stream))
            stream += packet
    return bytes(stream), intact


def test_known_vector():
    r = laser.decode(VECTOR)
    assert r.index.tolist() == [17]
    assert r.speed_rpm.tolist() == [0x49E3 / 64]
    assert r.distance_mm.tolist() == [[228, 226, 224, 223]]
    assert r.strength.tolist() == [[0x5E1, 0x634, 0x625, 0x684]]
    assert counters(r) == (1, 0, 0, 0, 0)
    assert framing.checksums(np.frombuffer(VECTOR, "<u2")[None]).tolist() == [0x6BF6]
    assert laser.encode(r) == VECTOR


def test_invalid_readings_keep_error_code_strength_and_warning():
    sent = laser.Readings.build(
        0,
        [[np.nan, 1234, np.nan, 0]],
        [[200, 500, 0, 1]],
        error_code=[[0x21, 0, 0x35, 0]],
        warning=[[False, True, True, False]],
    )
    assert not laser.Readings.build(0, [[500.0] * 4]).warning.any()  # unless it is said
    r = laser.decode(laser.encode(sent))
    np.testing.assert_array_equal(r.distance_mm, [[np.nan, 1234, np.nan, 0]])
    assert r.error_code.tolist() == [[0x21, 0, 0x35, 0]]
    assert r.strength.tolist() == [[200, 500, 0, 1]]
    assert r.warning.tolist() == [[False, True, True, False]]


def test_one_packet_is_a_row():
    r = laser.Readings.build([3, 4, 5], np.arange(12.0).reshape(3, 4), 9)
    for one in (r[1], r[-2], r[np.int64(1)]):
        assert (len(one), one.good, one.index.tolist()) == (1, 0, [4])
        assert laser.encode(one) == laser.encode(r[1:2])
    assert [one.index.tolist() for one in r] == [[3], [4], [5]]
    with pytest.raises(IndexError):
        r[3]


def test_real_recording(recording):
    r = laser.decode(recording)
    assert counters(r) == (11451, 1, 202, 512, 0)
    assert 22 * (r.good + r.bad_checksum) + r.skipped_bytes == len(recording)
    assert as_rows(r) == plain_decode(recording)
    start = r.offset[0]
    assert laser.encode(r) == recording[start : start + 22 * 11451]


@given(seed=st.integers(0, 2**32), n=st.integers(0, 40))
@settings(deadline=None)
def test_what_is_encoded_is_decoded(seed, n):
    sent = random_readings(np.random.default_rng(seed), n)
    data = laser.encode(sent)
    r = laser.decode(data, errors="raise")
    assert as_rows(r) == as_rows(sent)
    assert laser.encode(r) == data
    assert as_rows(r) == plain_decode(data)


@given(seed=st.integers(0, 2**32))
@settings(deadline=None, max_examples=40)
def test_any_chunking_gives_the_same(seed):
    rng = np.random.default_rng(seed)
    packets = random_packets(rng, rng.integers(1, 60))
    data, _ = damaged(rng, packets)
    if rng.random() < 0.5:  # an old turn, whole, cut or spoilt, somewhere in it
        old = encode_turns(random_readings(rng, 90))[: rng.integers(4, 1600)]
        at = rng.integers(len(data) + 1)
        data = data[:at] + old + data[at:]
    whole = laser.decode(data)
    assert 22 * (whole.good + whole.bad_checksum) + whole.skipped_bytes + (1446 * whole.old_turns) == len(data)

    decoder, parts, at = laser.Decoder(), [], 0
    longest = int(rng.choice([1, 5, 50, 3000]))
    while at < len(data):
        step = int(rng.integers(0, longest + 1))
        parts.append(decoder.feed(data[at : at + step]))
        at += step
    parts.append(decoder.close())
    joined = laser.join_readings(parts)
    np.testing.assert_equal(as_rows(joined), as_rows(whole))
    assert counters(joined) == counters(whole)
    assert tuple(decoder.totals.values()) == counters(whole)

    strict, error = laser.Decoder("raise"), None
    try:
        for k in range(0, len(data), longest):
            strict.feed(data[k : k + longest])
        strict.close()
    except laser.PacketError as caught:
        error = (caught.offset, caught.data, str(caught))
    try:
        laser.decode(data, "raise")
        assert error is None and counters(whole)[1:3] == (0, 0)
    except laser.PacketError as caught:
        assert error == (caught.offset, caught.data, str(caught))
        assert caught.data == data[caught.offset : caught.offset + 22]


@given(seed=st.integers(0, 2**32))
@settings(deadline=None, max_examples=40)
def test_every_intact_packet_survives_damage_around_it(seed):
    rng = np.random.default_rng(seed)
    packets = random_packets(rng, 200)
    data, intact = damaged(rng, packets)
    found = laser.decode(data).offset.tolist()
    assert set(intact) <= set(found)
    for offset in set(found) - set(intact):  # a spoilt packet with a good checksum: about 1e-5 each
        assert plain_checksum(data[offset : offset + 22]) == data[offset + 20] | data[offset + 21] << 8


def test_packets_are_not_invented():
    rng = np.random.default_rng(3)
    packets = random_packets(rng, 20000)
    data, intact = damaged(rng, packets)
    found = set(laser.decode(data).offset.tolist())
    assert set(intact) <= found
    assert len(found - set(intact)) <= 3  # 7,500 spoilt packets, 2**-15 each


def share_that_passes(flips):
    """Share of packets with these bits (n, 176) flipped that pass; of the virtual laser, decoded in one stream."""
    sent = np.frombuffer(datasets.data_path("virtual/lrf/room.bin").read_bytes(), np.uint8).reshape(-1, 22)
    came = np.resize(sent, (len(flips), 22)) ^ np.packbits(flips, axis=1)
    found = np.isin(np.arange(len(flips)) * 22, laser.decode(came.tobytes()).offset)
    wrong = flips.any(axis=1)
    return np.count_nonzero(found & wrong) / np.count_nonzero(wrong)


def test_damaged_packets_that_pass_are_as_few_as_the_text_says():
    rng = np.random.default_rng(4)
    assert share_that_passes(np.eye(176, dtype=bool)) == 0
    assert share_that_passes(rng.random((300_000, 176)) < 0.01) == pytest.approx(0.0084, rel=0.1)
    assert share_that_passes(rng.random((300_000, 176)) < 0.001) == pytest.approx(0.002, rel=0.35)
    two = np.zeros((100_000, 176), bool)
    first, step = rng.integers(176, size=100_000), rng.integers(1, 176, size=100_000)
    two[np.arange(100_000), first] = two[np.arange(100_000), (first + step) % 176] = True
    assert share_that_passes(two) == pytest.approx(0.024, rel=0.1)


def test_random_bytes_never_raise():
    data = np.random.default_rng(0).bytes(10_000_000)
    r = laser.decode(data)
    # heads come by chance every 256 * 256 / 90 bytes, and one in 2**15 has a good checksum: 0.4
    assert r.good <= 4 and r.old_turns == 0
    assert 22 * (r.good + r.bad_checksum) + r.skipped_bytes == len(data)


def test_a_chance_packet_does_not_hide_the_real_ones():
    """Twelve bytes of garbage that make a packet with the first ten of a real one."""
    rng = np.random.default_rng(1)
    real = laser.encode(random_readings(rng, 3))
    for _ in range(1_000_000):
        ghost = b"\xfa\xa5" + rng.bytes(10) + real[:10]
        if plain_checksum(ghost) == ghost[20] | ghost[21] << 8:
            break
    data = ghost[:12] + real
    assert plain_decode(data)[0][0] == 0  # the plain loop falls for it, and loses a real packet
    assert laser.decode(data).offset.tolist() == [0, 12, 34, 56]  # one by chance, and none lost


def rules(data, is_good):
    """The rules of the module's text, word by word: offsets, old turns, bad, skipped."""
    heads = [i for i in range(len(data) - 21) if data[i] == 0xFA and 0xA0 <= data[i + 1] <= 0xF9]
    good = {i for i in heads if is_good(data[i : i + 22])}
    pattern = b"\x5a\xa5\x00\xc0"
    starts = [i for i in range(len(data) - 5) if data[i : i + 4] == pattern and data[i + 5] == 0xD1]
    turns = [
        t
        for t in starts
        if t + 1446 <= len(data)
        and not any(t < other < t + 1446 for other in starts)
        and not any(t - 22 < p < t + 1446 for p in good)
    ]
    used = {i for p in good for i in range(p, p + 22)}
    used |= {i for t in turns for i in range(t, t + 1446)}
    bad = 0
    for h in heads:
        if h not in good and not used & set(range(h, h + 22)):
            bad += 1
            used |= set(range(h, h + 22))
    return sorted(good), turns, bad, len(data) - len(used)


@given(seed=st.integers(0, 2**32))
@settings(deadline=None, max_examples=100)
def test_the_rules_where_packets_crowd(seed):
    """With a checksum so weak that good packets overlap each other and turns all the time."""
    rng = np.random.default_rng(seed)
    share = int(rng.choice([2, 4, 16]))

    def weak(words):  # decides on a byte that the packet holds anyway
        return words[:, 10] ^ (words[:, 4] % share != 0)

    pieces = []
    for _ in range(rng.integers(1, 40)):
        kind = rng.integers(8)
        packet = b"\xfa" + bytes(rng.choice([0xFA, 0xA0, 0, 1], 21).astype(np.uint8).tolist())
        packet = packet[:1] + b"\xa3" + packet[2:]
        head = b"\x5a\xa5\x00\xc0\x90\xd1"
        if kind == 0 and rng.random() < 0.3:
            pieces.append(head + bytes(rng.integers(0, 1441)))
        elif kind == 1 and rng.random() < 0.3:
            pieces.append(head + bytes(1440))
        elif kind < 4:
            pieces.append(packet * int(rng.integers(1, 4)))
        else:
            pieces.append(packet[: rng.integers(1, 23)])
    data = b"".join(pieces)

    def is_good(packet):
        return (packet[8] | packet[9] << 8) % share == 0

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(framing, "checksums", weak)
        whole = laser.decode(data)
        decoder, parts, at = laser.Decoder(), [], 0
        longest = int(rng.choice([7, 60, 2000]))
        while at < len(data):
            step = int(rng.integers(1, longest + 1))
            parts.append(decoder.feed(data[at : at + step]))
            at += step
        joined = laser.join_readings([*parts, decoder.close()])
    packets, turns, bad, skipped = rules(data, is_good)
    offsets = sorted(packets + [t + 6 + 16 * k for t in turns for k in range(90)])
    for result in (whole, joined):
        assert result.offset.tolist() == offsets
        assert counters(result)[:3] == (len(packets), bad, skipped)
        assert result.old_turns == len(turns)


def test_live_packets_come_out_at_once():
    rng = np.random.default_rng(1)
    data, decoder = laser.encode(random_readings(rng, 20)), laser.Decoder()
    decoder.feed(data[: 22 * 4])
    for k in range(4, 20):
        assert len(decoder.feed(data[22 * k : 22 * k + 21])) == 0
        assert as_rows(decoder.feed(data[22 * k + 21 : 22 * k + 22])) == plain_decode(data[: 22 * k + 22])[-1:]


def test_raise_tells_where_and_what():
    rng = np.random.default_rng(2)
    data = bytearray(laser.encode(random_readings(rng, 5)))
    data[22 * 3 + 7] ^= 0x10
    with pytest.raises(laser.PacketError, match="checksum of a packet is wrong at byte 66") as caught:
        laser.decode(bytes(data), errors="raise")
    assert caught.value.offset == 66
    assert caught.value.data == data[66:88]
    assert isinstance(caught.value, ValueError)
    with pytest.raises(laser.PacketError, match="at byte 44"):
        laser.decode(bytes(data[:50]), errors="raise")
    with pytest.raises(ValueError, match="skip"):
        laser.Decoder("ignore")


def test_index_jumps_are_counted_across_chunks():
    rng = np.random.default_rng(2)
    sent = random_readings(rng, 200)
    gone = laser.join_readings([sent[:50], sent[53:120], sent[120:]])
    assert laser.decode(laser.encode(gone)).index_jumps == 1
    decoder = laser.Decoder()
    data = laser.encode(gone)
    jumps = [decoder.feed(data[k : k + 22]).index_jumps for k in range(0, len(data), 22)]
    assert sum(jumps) + decoder.close().index_jumps == 1
    assert jumps.index(1) == 50


def test_old_turns_both_ways():
    rng = np.random.default_rng(4)
    sent = random_readings(rng, 270)
    data = encode_turns(sent, speed_byte=0x91)
    assert len(data) == 3 * 1446 and data[:6] == bytes.fromhex("5AA500C091D1")
    r = laser.decode(data, errors="raise")
    assert counters(r) == (0, 0, 0, 0, 3)
    assert np.isnan(r.speed_rpm).all()
    np.testing.assert_array_equal(r.distance_mm, sent.distance_mm)
    np.testing.assert_array_equal(r.strength, sent.strength)
    assert encode_turns(r, speed_byte=0x91) == data

    broken = data[:700] + data[1446:]  # a turn cut short does not swallow the next one
    assert laser.decode(broken).offset.tolist() == (r.offset[90:] - 746).tolist()
    new = laser.encode(sent[:90])  # nor packets of the newer firmware
    assert counters(laser.decode(data[:700] + new))[0] == 90


def test_what_cannot_be_sent_is_refused():
    with pytest.raises(ValueError, match=r"distance_mm 20000 cannot be sent.*0 to 16383"):
        laser.Readings.build(0, [[20000, 1, 1, 1]])
    with pytest.raises(ValueError, match="index 90"):
        laser.Readings.build(90, [[1, 1, 1, 1]])
    with pytest.raises(ValueError, match="index nan cannot be sent: a packet holds whole numbers"):
        laser.Readings.build([np.nan], [[1, 1, 1, 1]])
    with pytest.raises(ValueError, match=r"index 1\.5"):
        laser.Readings.build(1.5, [[1, 1, 1, 1]])
    with pytest.raises(ValueError, match=r"strength 0\.5"):
        laser.Readings.build(0, [[1, 1, 1, 1]], 0.5)
    with pytest.raises(ValueError, match=r"distance_mm must be \(N, 4\).*\(4, 90\): transpose it"):
        laser.Readings.build(np.arange(90), np.ones((4, 90)))
    with pytest.raises(ValueError, match="got 3 for 2 rows"):
        laser.Readings.build([0, 1, 2], np.ones((2, 4)))
    with pytest.raises(ValueError, match="read-only"):
        laser.decode(VECTOR).distance_mm[0, 0] = 1


def test_readings_are_copies_and_leave_the_callers_arrays_alone():
    readings = laser.decode(VECTOR)
    own = {name: value.copy() for name, value in vars(readings).items() if isinstance(value, np.ndarray)}
    copy = laser.Readings(**own)
    own["distance_mm"][0, 0] = 1
    assert copy.distance_mm[0, 0] == 228


@pytest.mark.parametrize("data", [1000, "fa", [250, 177], None])
def test_what_is_no_bytes_is_not_decoded(data):
    with pytest.raises(ValueError, match="decoded from bytes, got"):
        laser.decode(data)
    with pytest.raises(ValueError, match="decoded from bytes, got"):
        laser.Decoder().feed(data)
    assert len(laser.decode(bytearray(VECTOR))) == len(laser.decode(memoryview(VECTOR))) == 1
