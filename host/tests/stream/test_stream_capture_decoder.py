"""Batches of a whole capture: the same frames as record by record, however the file is cut, and flat memory."""

from __future__ import annotations

import random
import resource
import struct

import numpy as np
import pytest

from taxel.link import CaptureError, CaptureLink, CaptureWriter
from taxel.stream import CaptureDecoder, LossAccount, StreamDecoder, capture_decoder, decode_capture

SEEDS = range(10)


def stream_of(hub, frames=40):
    rng = random.Random(1)
    data = bytearray(b"\0")
    for cycle in range(frames):
        data += hub.taxels(0x20 + cycle % 3, cycle, [rng.randrange(65536) for _ in range(rng.randrange(1, 240))])
        if rng.random() < 0.2:
            data += hub.log(b"text") + bytes([rng.randrange(256)])
    return bytes(data)


def written(path, data, rng, largest):
    with CaptureWriter(path, {"baud": 500000}) as writer:
        at = time_ns = 0
        while at < len(data):
            size = min(62, rng.randrange(largest + 1)) if rng.random() < 0.5 else rng.randrange(largest + 1)
            writer.write(data[at : at + size], time_ns)
            at += size
            time_ns += rng.randrange(1000)
    return path


def by_record(path):
    """(batches, records, how it ended) of the way that goes record by record."""
    link, decoder, batches, records = CaptureLink(path), StreamDecoder(), [], []
    position, end = 0, None
    try:
        while True:
            chunk = link.read()
            position += len(chunk.data)
            records.append((position, chunk.arrival_ns))
            batches += decoder.push(chunk.data)
    except EOFError:
        pass
    except CaptureError as error:
        end = str(error)
    link.close()
    return batches + decoder.finish(), records, end


def by_block(path):
    batches, records, end = [], [], None
    try:
        for batch, arrivals in CaptureDecoder(path):
            batches.append(batch)
            for record in arrivals.tolist():
                if record not in records[-1:]:
                    records.append(record)
    except CaptureError as error:
        end = str(error)
    return batches, records, end


def content(batches):
    rows = [row for batch in batches for row in batch.taxel_rows[["stream_position", "address", "cycle"]].tolist()]
    counts = np.concatenate([batch.counts for batch in batches]) if batches else np.zeros(0)
    return rows, counts.tolist(), b"".join(batch.payloads for batch in batches)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_capture_gives_the_same_frames_as_its_records_one_by_one(tmp_path, hub, monkeypatch, seed):
    rng = random.Random(seed)
    monkeypatch.setattr(capture_decoder, "BLOCK", rng.choice([12, 100, 1000, 1 << 18]))
    path = written(tmp_path / "a.bin", stream_of(hub), rng, rng.choice([20, 62, 70, 4096, 1 << 16]))
    batches, _, end = by_block(path)
    wanted, _, _ = by_record(path)
    assert content(batches) == content(wanted), f"seed {seed}"
    assert end is None


@pytest.mark.parametrize("seed", SEEDS)
def test_a_damaged_or_cut_capture_gives_what_stands_before_and_then_the_same_error(tmp_path, hub, monkeypatch, seed):
    rng = random.Random(seed)
    monkeypatch.setattr(capture_decoder, "BLOCK", rng.choice([12, 100, 1000, 1 << 18]))
    path = written(tmp_path / "a.bin", stream_of(hub, 20), rng, rng.choice([62, 4096]))
    data = bytearray(path.read_bytes())
    if rng.random() < 0.5:
        del data[rng.randrange(40, len(data)) :]
    else:
        i = rng.randrange(40, len(data) - 4)
        data[i : i + 4] = rng.choice([b"\xff\xff\xff\xff", b"\x00\x00\x00\x01", b"\x01\x00\x00\x01"])
    path.write_bytes(data)
    (batches, _, end), (wanted, _, problem) = by_block(path), by_record(path)
    assert content(batches) == content(wanted), f"seed {seed}"
    assert end == problem


def test_records_and_their_times_come_with_the_batches(tmp_path, hub):
    path = written(tmp_path / "a.bin", stream_of(hub), random.Random(3), 62)
    whole = [(end, time_ns) for end, time_ns in by_record(path)[1]]
    assert by_block(path)[1] == whole


def test_losses_are_counted_and_the_header_is_known(tmp_path, hub):
    data = hub.taxels(0x20, 0) + hub.taxels(0x20, 1)[:-3] + hub.taxels(0x20, 2)
    decoder = CaptureDecoder(written(tmp_path / "a.bin", data, random.Random(4), 62))
    assert sum(len(batch.taxel_rows) for batch, _ in decoder) == 2
    assert LossAccount(decoder.decoder).lost_on_wire == 1
    assert (decoder.baud, decoder.header) == (500000.0, {"baud": 500000})


def test_a_length_that_a_file_only_claims_reserves_no_memory(tmp_path):
    path = tmp_path / "a.bin"
    with CaptureWriter(path) as writer:
        writer.write(b"x", 0)
    path.write_bytes(path.read_bytes() + struct.pack("<QI", 0, 1 << 24) + b"few")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(CaptureError, match="cut short in a record at byte 31"):
        list(decode_capture(path))
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 4096  # KiB


def test_no_capture_is_refused_at_once(tmp_path):
    (tmp_path / "a.bin").write_bytes(b"not a capture at all")
    with pytest.raises(CaptureError, match="not a taxel capture"):
        decode_capture(tmp_path / "a.bin")
