"""Capture files: records are read back as written, and damage is reported after the records that precede the damage."""

import json
import os
import resource
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel.link import CaptureError, CaptureLink, CaptureWriter, Chunk
from taxel.link.capture import HEADER_MAX, RECORD_MAX

RECORDS = [  # (bytes, time in ns)
    (b"first", 1_000),
    (b"", 1_000),
    (bytes(range(40)), 2_000_000_000),
    (b"z", 2**63),
]
FILE_START = struct.Struct("<8sHHI")  # magic, version, flags, header length
RECORD_START_BYTES = 12


def write_capture(path, records, header=None):
    """Write records (bytes, time in ns) to a new capture."""
    with CaptureWriter(path, header) as writer:
        for data, time_ns in records:
            writer.write(data, time_ns)


def read_capture(path):
    """Read a capture to its end; return its records (bytes, time in ns), and the exception that ended the reading."""
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
def test_records_and_header_are_read_back_as_written(tmp_path_factory, records, header):
    path = tmp_path_factory.mktemp("capture") / "a.bin"
    write_capture(path, records, header)
    records_read, end = read_capture(path)
    assert records_read == records
    assert isinstance(end, EOFError)
    link = CaptureLink(path)
    assert link.header == header
    link.close()


def test_a_capture_truncated_at_any_byte_gives_its_complete_records_and_then_an_error(tmp_path):
    complete = tmp_path / "complete.bin"
    write_capture(complete, RECORDS, {"note": "x"})
    data = complete.read_bytes()
    first_record_byte = FILE_START.size + len(json.dumps({"note": "x"}))
    record_ends = [first_record_byte]
    for record, _ in RECORDS:
        record_ends.append(record_ends[-1] + RECORD_START_BYTES + len(record))
    assert record_ends[-1] == len(data)
    truncated = tmp_path / "truncated.bin"
    for size in range(len(data) + 1):
        truncated.write_bytes(data[:size])
        if size < first_record_byte:
            with pytest.raises(CaptureError) as caught:
                CaptureLink(truncated)
            assert str(truncated) in str(caught.value)
            continue
        records, end = read_capture(truncated)
        complete_records = sum(record_end <= size for record_end in record_ends) - 1
        assert records == RECORDS[:complete_records]
        if size in record_ends:
            assert isinstance(end, EOFError)
        else:
            assert isinstance(end, CaptureError)
            assert str(truncated) in str(end)
            assert f"byte {record_ends[complete_records]}" in str(end)


def test_every_read_after_the_last_record_raises_end_of_file(tmp_path):
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
def test_a_file_of_another_format_is_refused(tmp_path, content):
    path = tmp_path / "other"
    path.write_bytes(content)
    with pytest.raises(CaptureError, match="is not a taxel capture"):
        CaptureLink(path)


def test_the_error_for_another_format_version_names_both_versions(tmp_path):
    path = tmp_path / "new.bin"
    path.write_bytes(FILE_START.pack(b"TAXELCAP", 2, 0, 2) + b"{}")
    with pytest.raises(CaptureError, match=r"version 2.*version 1"):
        CaptureLink(path)


@pytest.mark.parametrize(
    "header",
    [b"{", b"[1]", b"1", b"null", b"\xff\xfe\xfd", b"", b"[" * 100_000, b'{"a":' * 100_000],
    ids=["open", "list", "number", "null", "bytes", "empty", "deep list", "deep object"],
)
def test_a_damaged_header_is_reported_as_such(tmp_path, header):
    path = tmp_path / "a.bin"
    path.write_bytes(FILE_START.pack(b"TAXELCAP", 1, 0, len(header)) + header)
    with pytest.raises(CaptureError, match="damaged header"):
        CaptureLink(path)


def test_a_header_length_beyond_the_file_is_reported_as_a_damaged_header(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(FILE_START.pack(b"TAXELCAP", 1, 0, 2**32 - 1) + b"{}")
    with pytest.raises(CaptureError, match="damaged header"):
        CaptureLink(path)


@pytest.mark.parametrize("size", [RECORD_MAX + 1, 2**32 - 1])
def test_an_impossible_record_length_ends_the_capture_after_the_preceding_records(tmp_path, size):
    path = tmp_path / "a.bin"
    write_capture(path, RECORDS)
    first_bad_byte = path.stat().st_size
    with path.open("ab") as file:
        file.write(struct.pack("<QI", 5, size) + b"rest")
    records, end = read_capture(path)
    assert records == RECORDS
    assert isinstance(end, CaptureError)
    assert f"byte {first_bad_byte}" in str(end)


@pytest.mark.parametrize("baud", [0, -5, 1e299])
def test_an_implausible_baud_rate_in_a_header_is_replaced_by_the_default(tmp_path, baud):
    path = tmp_path / "a.bin"
    CaptureWriter(path, {"baud": baud}).close()
    link = CaptureLink(path)
    assert link.baud == 1e6
    link.close()


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ('{"baud": "fast"}', "baud: expected a number, found 'fast'"),
        ('{"baud": null}', "baud: expected a number, found None"),
        ('{"baud": true}', "baud: expected a number, found True"),
        ('{"baud": 1e300}', r"baud: expected a number, found 1e\+300"),
        ('{"baud": 1e999}', "file: expected numbers of at most 1.8e308, found 1e999"),
        ('{"baud": Infinity}', "file: expected JSON, found Infinity, which JSON does not have"),
        ('{"epoch_offset_ns": 1e30}', r"epoch_offset_ns: expected an integer of 64 bits, found 1e\+30"),
        ('{"epoch_offset_ns": "0"}', "epoch_offset_ns: expected an integer of 64 bits, found '0'"),
        ('{"clock": ["hub"]}', "clock: expected 'host' or 'hub', found a list"),
        ('{"hand": 3}', "hand: expected a string, found 3"),
        ('{"joint_position": {"a": 1}}', "joint_position: expected a list of at most 1000 numbers, found a dict"),
        ('{"joint_position": [0, NaN]}', "file: expected JSON, found NaN, which JSON does not have"),
        ('{"hand": "a", "hand": "b"}', "file: expected each key of an object once, found 'hand' twice"),
        ("[" * 100_000, "file: expected JSON of at most 100 levels, found more"),
        ("[1]", "header: expected a JSON object, found a list"),
    ],
)
def test_a_wrong_header_gives_one_error_line(tmp_path, header, message):
    path = tmp_path / "a.bin"
    path.write_bytes(struct.pack("<8sHHI", b"TAXELCAP", 1, 0, len(header)) + header.encode())
    with pytest.raises(CaptureError, match=rf"a\.bin: has a damaged header \({message}"):
        CaptureLink(path)


def test_an_existing_capture_is_overwritten_only_on_request(tmp_path):
    path = tmp_path / "a.bin"
    write_capture(path, RECORDS)
    before = path.read_bytes()
    with pytest.raises(CaptureError, match="exists already"):
        CaptureWriter(path)
    assert path.read_bytes() == before
    CaptureWriter(path, overwrite=True).close()
    assert path.read_bytes() == before, "a capture without records replaced one with records"
    with CaptureWriter(path, overwrite=True) as writer:
        writer.write(b"new", 1)
    assert read_capture(path)[0] == [(b"new", 1)]
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.bin"]


def test_a_capture_in_a_missing_folder_creates_the_folder(tmp_path):
    CaptureWriter(tmp_path / "new" / "folder" / "a.bin").close()
    assert read_capture(tmp_path / "new" / "folder" / "a.bin")[0] == []


def test_a_capture_in_a_file_instead_of_a_folder_gives_one_error_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(CaptureError, match="cannot be written") as caught:
        CaptureWriter(tmp_path / "file" / "a.bin")
    assert "\n" not in str(caught.value)


def test_a_second_program_cannot_write_the_same_capture(tmp_path):
    path = tmp_path / "a.bin"
    with CaptureWriter(path) as writer:
        writer.write(b"kept", 1)
        with pytest.raises(CaptureError, match=f"process {os.getpid()} is writing"):
            CaptureWriter(path, overwrite=True)
        writer.write(b"also kept", 2)
    assert read_capture(path)[0] == [(b"kept", 1), (b"also kept", 2)]


def test_writing_to_a_recording_is_refused(tmp_path):
    path = tmp_path / "a.bin"
    write_capture(path, RECORDS)
    link = CaptureLink(path)
    with pytest.raises(CaptureError, match="recording"):
        link.write(b"command")
    link.close()


def test_a_record_is_in_the_file_as_soon_as_it_is_written(tmp_path):
    path = tmp_path / "a.bin"
    writer = CaptureWriter(path)
    for i, (data, time_ns) in enumerate(RECORDS):
        writer.write(data, time_ns)
        assert read_capture(path)[0] == RECORDS[: i + 1]
    writer.close()


def test_bytes_beyond_the_maximum_length_of_a_record_are_divided_into_two_records(tmp_path):
    path = tmp_path / "a.bin"
    write_capture(path, [(bytes(RECORD_MAX + 1), 7)])
    records, end = read_capture(path)
    assert isinstance(end, EOFError)
    assert [(len(data), time_ns) for data, time_ns in records] == [(RECORD_MAX, 7), (1, 7)]


def test_a_header_beyond_the_maximum_length_is_refused_before_a_file_is_created(tmp_path):
    with pytest.raises(CaptureError):
        CaptureWriter(tmp_path / "a.bin", {"note": "x" * HEADER_MAX})
    assert not (tmp_path / "a.bin").exists()


def test_a_record_beyond_the_free_disk_space_is_reported_and_earlier_records_are_kept(tmp_path):
    # A limit of the file size takes the place of the full disk.
    path = tmp_path / "a.bin"
    free_bytes = 50  # less than the second record
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with CaptureWriter(path) as writer:
        writer.write(b"kept", 1)
        resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + free_bytes, hard))
        try:
            with pytest.raises(CaptureError, match="the records before are complete"):
                writer.write(bytes(100), 2)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert read_capture(path)[0] == [(b"kept", 1)]
