"""The block decoder gives the same frames as decoding by record, for any record sizes, with constant memory."""

import random
import resource
import struct

import numpy as np
import pytest

from taxel.link import CaptureError, CaptureLink, CaptureWriter
from taxel.stream import CaptureDecoder, LossAccount, StreamDecoder, capture_decoder, decode_capture

SEEDS = range(10)


def make_stream(hub, frames=40):
    """Make the bytes of taxel frames of three boards, with log frames and stray bytes between them."""
    rng = random.Random(1)
    data = bytearray(b"\0")
    for cycle in range(frames):
        data += hub.encode_taxels(0x20 + cycle % 3, cycle, [rng.randrange(65536) for _ in range(rng.randrange(1, 240))])
        if rng.random() < 0.2:
            data += hub.encode_log(b"text") + bytes([rng.randrange(256)])
    return bytes(data)


def write_capture(path, data, rng, largest):
    """Write `data` as records of random sizes up to `largest` bytes; return the path."""
    with CaptureWriter(path, {"baud": 500000}) as writer:
        position = time_ns = 0
        while position < len(data):
            size = min(62, rng.randrange(largest + 1)) if rng.random() < 0.5 else rng.randrange(largest + 1)
            writer.write(data[position : position + size], time_ns)
            position += size
            time_ns += rng.randrange(1000)
    return path


def decode_by_record(path):
    """Decode record by record; return (batches, records, error message or None)."""
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


def decode_by_block(path):
    """Decode with the block decoder; return (batches, records, error message or None)."""
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


def list_contents(batches):
    """Return the contents of all batches: (stream position, address and cycle of each frame; counts; payloads)."""
    rows = [row for batch in batches for row in batch.taxel_rows[["stream_position", "address", "cycle"]].tolist()]
    counts = np.concatenate([batch.counts for batch in batches]) if batches else np.zeros(0)
    return rows, counts.tolist(), b"".join(batch.payloads for batch in batches)


@pytest.mark.parametrize("seed", SEEDS)
def test_decoding_by_block_equals_decoding_by_record(tmp_path, hub, monkeypatch, seed):
    """The size of a block (bytes read at once) and the largest size of a record are random, also below one frame."""
    rng = random.Random(seed)
    monkeypatch.setattr(capture_decoder, "BLOCK", rng.choice([12, 100, 1000, 1 << 18]))
    path = write_capture(tmp_path / "a.bin", make_stream(hub), rng, rng.choice([20, 62, 70, 4096, 1 << 16]))
    batches, _, end = decode_by_block(path)
    expected, _, _ = decode_by_record(path)
    assert list_contents(batches) == list_contents(expected), f"seed {seed}"
    assert end is None


@pytest.mark.parametrize("seed", SEEDS)
def test_a_damaged_or_truncated_capture_gives_the_frames_before_the_error_and_the_same_error(
    tmp_path, hub, monkeypatch, seed
):
    rng = random.Random(seed)
    monkeypatch.setattr(capture_decoder, "BLOCK", rng.choice([12, 100, 1000, 1 << 18]))
    path = write_capture(tmp_path / "a.bin", make_stream(hub, 20), rng, rng.choice([62, 4096]))
    data = bytearray(path.read_bytes())
    if rng.random() < 0.5:
        del data[rng.randrange(40, len(data)) :]
    else:
        i = rng.randrange(40, len(data) - 4)  # the new bytes may be the length of a record, and are then too large
        data[i : i + 4] = rng.choice([b"\xff\xff\xff\xff", b"\x00\x00\x00\x01", b"\x01\x00\x00\x01"])
    path.write_bytes(data)
    (batches, _, end), (expected, _, problem) = decode_by_block(path), decode_by_record(path)
    assert list_contents(batches) == list_contents(expected), f"seed {seed}"
    assert end == problem


def test_batches_carry_the_records_and_their_arrival_times(tmp_path, hub):
    path = write_capture(tmp_path / "a.bin", make_stream(hub), random.Random(3), 62)
    expected = [(end, time_ns) for end, time_ns in decode_by_record(path)[1]]
    assert decode_by_block(path)[1] == expected


def test_the_block_decoder_counts_losses_and_reads_the_header(tmp_path, hub):
    # The second of three frames is incomplete and therefore lost.
    data = hub.encode_taxels(0x20, 0) + hub.encode_taxels(0x20, 1)[:-3] + hub.encode_taxels(0x20, 2)
    decoder = CaptureDecoder(write_capture(tmp_path / "a.bin", data, random.Random(4), 62))
    assert sum(len(batch.taxel_rows) for batch, _ in decoder) == 2
    assert LossAccount(decoder.decoder).lost_on_wire == 1
    assert (decoder.baud, decoder.header) == (500000.0, {"baud": 500000})


def test_a_record_length_beyond_the_end_of_the_file_allocates_no_memory(tmp_path):
    path = tmp_path / "a.bin"
    with CaptureWriter(path) as writer:
        writer.write(b"x", 0)
    # Append the head of a record that claims 16 MiB (time, length), and 3 bytes of its data.
    path.write_bytes(path.read_bytes() + struct.pack("<QI", 0, 1 << 24) + b"few")
    memory_before_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # The file has a header of 18 bytes, and a complete record of 13 bytes (12 bytes of time and length, 1 data byte).
    with pytest.raises(CaptureError, match="cut short in a record at byte 31"):
        list(decode_capture(path))
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory_before_kib < 4096  # KiB


def test_a_file_that_is_no_capture_is_rejected_before_the_first_batch(tmp_path):
    (tmp_path / "a.bin").write_bytes(b"not a capture at all")
    with pytest.raises(CaptureError, match="not a taxel capture"):
        decode_capture(tmp_path / "a.bin")
