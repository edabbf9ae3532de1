"""A capture gives back what was recorded; a damaged one gives everything before the damage and then says so."""

import json
import resource
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel.link import CaptureError, CaptureLink, CaptureWriter, Chunk
from taxel.link.capture import HEADER_MAX, RECORD_MAX

RECORDS = [(b"first", 1_000), (b"", 1_000), (bytes(range(40)), 2_000_000_000), (b"z", 2**63)]
START = struct.Struct("<8sHHI")


def write_capture(path, records, header=None):
    with CaptureWriter(path, header) as writer:
        for data, time_ns in records:
            writer.write(data, time_ns)


def read_capture(path):
    """(records, how it ended)."""
    link = CaptureLink(path)
    records = []
    try:
        while True:
            chunk = link.read()
            records.append((chunk.data, chunk.arrival_ns))
    except (EOFError, CaptureError) as end:
        return records, end
    finally:
        link.close()


json_values = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.floats(allow_nan=False) | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)


@given(
    records=st.lists(st.tuples(st.binary(max_size=300), st.integers(0, 2**64 - 1)), max_size=20),
    header=st.dictionaries(st.text(max_size=10), json_values, max_size=5),
)
def test_what_was_written_is_read_back(tmp_path_factory, records, header):
    path = tmp_path_factory.mktemp("capture") / "a.bin"
    write_capture(path, records, header)
    read, end = read_capture(path)
    assert read == records
    assert isinstance(end, EOFError)
    link = CaptureLink(path)
    assert link.header == header
    link.close()


def test_a_capture_cut_anywhere_gives_every_whole_record_and_then_an_error(tmp_path):
    whole = tmp_path / "whole.bin"
    write_capture(whole, RECORDS, {"note": "x"})
    data = whole.read_bytes()
    begin = START.size + len(json.dumps({"note": "x"}))
    borders = [begin]
    for record, _ in RECORDS:
        borders.append(borders[-1] + 12 + len(record))
    assert borders[-1] == len(data)
    cut = tmp_path / "cut.bin"
    for size in range(len(data) + 1):
        cut.write_bytes(data[:size])
        if size < begin:
            with pytest.raises(CaptureError) as caught:
                CaptureLink(cut)
            assert str(cut) in str(caught.value)
            continue
        records, end = read_capture(cut)
        complete = sum(border <= size for border in borders) - 1
        assert records == RECORDS[:complete]
        if size in borders:
            assert isinstance(end, EOFError)
        else:
            assert isinstance(end, CaptureError)
            assert str(cut) in str(end)
            assert f"byte {borders[complete]}" in str(end)


def test_an_end_stays_an_end(tmp_path):
    path = tmp_path / "a.bin"
    write_capture(path, RECORDS)
    link = CaptureLink(path)
    for _ in RECORDS:
        assert isinstance(link.read(), Chunk)
    for _ in range(3):
        with pytest.raises(EOFError):
            link.read()
    link.close()
    link.close()


@pytest.mark.parametrize("content", [b"", b"T", b"TAXELSTM" + bytes(16), b"\0" * 100, b'{"a": 1}' * 4])
def test_another_file_is_no_capture(tmp_path, content):
    path = tmp_path / "other"
    path.write_bytes(content)
    with pytest.raises(CaptureError, match="is not a taxel capture"):
        CaptureLink(path)


def test_a_capture_of_another_version_says_both_versions(tmp_path):
    path = tmp_path / "new.bin"
    path.write_bytes(START.pack(b"TAXELCAP", 2, 0, 2) + b"{}")
    with pytest.raises(CaptureError, match=r"version 2.*version 1"):
        CaptureLink(path)


@pytest.mark.parametrize(
    "header",
    [b"{", b"[1]", b"1", b"null", b"\xff\xfe\xfd", b"", b"[" * 100_000, b'{"a":' * 100_000],
    ids=["open", "list", "number", "null", "bytes", "empty", "deep list", "deep object"],
)
def test_a_damaged_header_is_told_from_a_damaged_record(tmp_path, header):
    path = tmp_path / "a.bin"
    path.write_bytes(START.pack(b"TAXELCAP", 1, 0, len(header)) + header)
    with pytest.raises(CaptureError, match="damaged header"):
        CaptureLink(path)


def test_an_impossible_header_length_does_not_fill_the_memory(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(START.pack(b"TAXELCAP", 1, 0, 2**32 - 1) + b"{}")
    with pytest.raises(CaptureError, match="damaged header"):
        CaptureLink(path)


@pytest.mark.parametrize("size", [RECORD_MAX + 1, 2**32 - 1])
def test_an_impossible_record_length_ends_the_capture_after_what_stands_before(tmp_path, size):
    path = tmp_path / "a.bin"
    write_capture(path, RECORDS)
    good = path.stat().st_size
    with path.open("ab") as file:
        file.write(struct.pack("<QI", 5, size) + b"rest")
    records, end = read_capture(path)
    assert records == RECORDS
    assert isinstance(end, CaptureError)
    assert f"byte {good}" in str(end)


@pytest.mark.parametrize("baud", [None, "fast", 0, -5, 1e300, [1], True])
def test_a_senseless_baud_rate_in_a_header_is_ignored(tmp_path, baud):
    path = tmp_path / "a.bin"
    CaptureWriter(path, {"baud": baud}).close()
    link = CaptureLink(path)
    assert link.baud == 1e6
    link.close()


def test_an_existing_capture_is_not_overwritten_unasked(tmp_path):
    path = tmp_path / "a.bin"
    write_capture(path, RECORDS)
    before = path.read_bytes()
    with pytest.raises(CaptureError, match="exists already"):
        CaptureWriter(path)
    assert path.read_bytes() == before
    CaptureWriter(path, overwrite=True).close()
    assert read_capture(path)[0] == []


def test_a_capture_that_cannot_be_created_is_one_line(tmp_path):
    with pytest.raises(CaptureError, match="cannot be written") as caught:
        CaptureWriter(tmp_path / "none" / "a.bin")
    assert "\n" not in str(caught.value)


def test_a_recording_takes_no_commands(tmp_path):
    path = tmp_path / "a.bin"
    write_capture(path, RECORDS)
    link = CaptureLink(path)
    with pytest.raises(CaptureError, match="recording"):
        link.write(b"hello")
    link.close()


def test_a_record_is_in_the_file_as_soon_as_it_is_written(tmp_path):
    path = tmp_path / "a.bin"
    writer = CaptureWriter(path)
    for i, (data, time_ns) in enumerate(RECORDS):
        writer.write(data, time_ns)
        assert read_capture(path)[0] == RECORDS[: i + 1]
    writer.close()


def test_what_a_writer_accepts_a_reader_accepts(tmp_path):
    path = tmp_path / "a.bin"
    long = bytes(RECORD_MAX + 1)
    with CaptureWriter(path) as writer:
        try:
            writer.write(long, 7)
        except (CaptureError, ValueError):
            return
    records, end = read_capture(path)
    assert isinstance(end, EOFError)
    assert b"".join(data for data, _ in records) == long


def test_a_header_that_no_reader_would_accept_is_refused(tmp_path):
    with pytest.raises((CaptureError, ValueError)):
        CaptureWriter(tmp_path / "a.bin", {"note": "x" * HEADER_MAX})
    assert not (tmp_path / "a.bin").exists()


def test_a_record_that_no_longer_fits_onto_the_disk_is_reported_at_once(tmp_path):
    path = tmp_path / "a.bin"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with CaptureWriter(path) as writer:
        writer.write(b"kept", 1)
        resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 50, hard))
        try:
            with pytest.raises(CaptureError, match="what came before is kept"):
                writer.write(bytes(100), 2)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert read_capture(path)[0] == [(b"kept", 1)]
