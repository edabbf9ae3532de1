"""PCAPNG recordings: bytes, times and header are read back as written; a damaged file gives one error line."""

import contextlib
import json
import os
import struct

import numpy as np
import pytest

from taxel.link import CaptureError
from taxel.link.capture import HEADER_MAX
from taxel.link.pcapng import COMMENT_MAX, PIECE_MAX, PcapngWriter, make_block, make_option
from taxel.link.pcapng_link import PcapngLink, is_pcapng

HEADER = {"hand": "original", "clock": "host", "epoch_offset_ns": 1_700_000_000_000_000_000, "baud": 115200.0}


def make_section(*options, major_version=1):
    """Make the section header block at the start of a file: byte-order magic, version, length -1 (unknown), options."""
    content = struct.pack("<IHHq", 0x1A2B3C4D, major_version, 0, -1)
    return make_block(0x0A0D0D0A, content + b"".join(options))


SECTION = make_section()


def make_interface(link_type=147, options=b""):
    """Make an interface description block. link_type: 147 is USER0, that of the recordings."""
    return make_block(1, struct.pack("<HHI", link_type, 0, 0) + options)


def make_packet(data, time=0, interface=0):
    """Make an enhanced packet block. time: in the units of the interface, microseconds by default."""
    head = struct.pack("<IIIII", interface, time >> 32, time & 0xFFFFFFFF, len(data), len(data))
    return make_block(6, head + data + bytes(-len(data) % 4))


def read_all(path):
    """Read a PCAPNG file to its end; return the (closed) link and its chunks."""
    with PcapngLink(path) as link:
        chunks = []
        try:
            while True:
                chunks.append(link.read())
        except EOFError:
            return link, chunks


@pytest.mark.parametrize("header", [HEADER, {}, {"hand_description": "x" * 200_000}])
def test_bytes_and_header_are_read_back_and_each_chunk_has_the_arrival_time_of_its_last_byte(tmp_path, header):
    piece_bytes = 62  # bytes of each call of `write`, whose time is the position of its first byte
    rng = np.random.default_rng(7)
    frames = rng.integers(0, 8, 20_000, dtype=np.uint8).tobytes()  # a delimiter about every 8 bytes
    data = frames + b"\x05" * 100_000 + b"\0tail"  # then more bytes without a delimiter than a packet holds
    with PcapngWriter(tmp_path / "x.pcapng", header) as writer:
        for start in range(0, len(data), piece_bytes):
            writer.write(data[start : start + piece_bytes], start)
    link, chunks = read_all(tmp_path / "x.pcapng")
    assert link.header == header
    assert b"".join(chunk.data for chunk in chunks) == data
    assert max(len(chunk.data) for chunk in chunks) <= PIECE_MAX
    # A chunk ends with exactly one delimiter and has the time of the `write` call that contains this last byte.
    end = 0
    for chunk in chunks[:100]:
        end += len(chunk.data)
        assert chunk.data.endswith(b"\0")
        assert chunk.data.rstrip(b"\0") + b"\0" == chunk.data
        assert chunk.arrival_ns == (end - 1) // piece_bytes * piece_bytes


def test_packets_have_unix_times_in_the_file_and_recording_times_when_read(tmp_path):
    with PcapngWriter(tmp_path / "x.pcapng", HEADER) as writer:
        writer.write(b"\0abc\0", 5)
    content = (tmp_path / "x.pcapng").read_bytes()
    time = HEADER["epoch_offset_ns"] + 5
    assert struct.pack("<II", time >> 32, time & 0xFFFFFFFF) in content
    assert read_all(tmp_path / "x.pcapng")[1][0].arrival_ns == 5


def test_a_file_with_times_in_milliseconds_and_with_other_blocks_is_read(tmp_path):
    milliseconds = make_interface(options=make_option(9, b"\x03"))  # times in units of 10**-3 s
    statistics = make_block(5, bytes(12))
    packets = make_packet(b"ab\0", 7) + make_packet(b"", 8)
    (tmp_path / "x.pcapng").write_bytes(SECTION + milliseconds + statistics + packets)
    link, chunks = read_all(tmp_path / "x.pcapng")
    assert (link.header, link.has_arrivals) == ({}, True)
    assert [(chunk.data, chunk.arrival_ns) for chunk in chunks] == [(b"ab\0", 7_000_000)]


def test_a_big_endian_file_is_read(tmp_path):
    def make_big_endian_block(kind, content):
        size = struct.pack(">I", len(content) + 12)
        return struct.pack(">I", kind) + size + content + size

    section = make_big_endian_block(0x0A0D0D0A, struct.pack(">IHHq", 0x1A2B3C4D, 1, 0, -1))
    interface = make_big_endian_block(1, struct.pack(">HHI", 147, 0, 0))  # link type 147: USER0
    packet = make_big_endian_block(6, struct.pack(">IIIII", 0, 0, 3, 2, 2) + b"a\0\0\0")  # 3 us, 2 bytes
    (tmp_path / "x.pcapng").write_bytes(section + interface + packet)
    assert read_all(tmp_path / "x.pcapng")[1] == [(b"a\0", 3000)]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is not a PCAPNG file"),
        (b"TAXELCAP", "is not a PCAPNG file"),
        (SECTION[:20], "is cut short in a block at byte 0"),
        (SECTION + make_interface()[:-2], "is cut short in a block at byte 28"),
        (SECTION + make_interface(1) + make_packet(b"a\0"), r"link type 1; expected 147 \(USER0\)"),
        (SECTION + make_packet(b"a\0"), "is damaged at byte 28"),
        (SECTION + make_interface() + make_packet(b"a\0", 2**62), "is damaged at byte 48"),
        (SECTION + struct.pack("<II", 6, 0xFFFFFFFC), "is damaged at byte 28"),
        (SECTION + struct.pack("<II", 6, 4), "is damaged at byte 28"),
        (make_section(major_version=2), "of version 2; this program reads version 1"),
    ],
)
def test_a_damaged_file_gives_one_error_line(tmp_path, content, message):
    (tmp_path / "x.pcapng").write_bytes(content)
    with pytest.raises(CaptureError, match=message) as failure:
        read_all(tmp_path / "x.pcapng")
    assert str(tmp_path / "x.pcapng") in str(failure.value)
    assert "\n" not in str(failure.value)


@pytest.mark.parametrize("seed", range(40))
def test_a_file_with_random_damage_is_read_or_raises_a_capture_error(tmp_path, seed):
    with PcapngWriter(tmp_path / "x.pcapng", HEADER) as writer:
        writer.write(b"\0abc\0\0def\0" * 20, 5)
    rng = np.random.default_rng(seed)
    content = bytearray((tmp_path / "x.pcapng").read_bytes())
    for position in rng.integers(4, len(content), 3):  # the first 4 bytes identify a PCAPNG file
        content[position] = rng.integers(0, 256)
    (tmp_path / "x.pcapng").write_bytes(content[: rng.integers(4, len(content) + 1)])
    with contextlib.suppress(CaptureError):
        read_all(tmp_path / "x.pcapng")


def test_an_existing_file_is_not_overwritten(tmp_path):
    (tmp_path / "x.pcapng").write_bytes(b"precious")
    with pytest.raises(CaptureError, match="exists already"):
        PcapngWriter(tmp_path / "x.pcapng", HEADER)
    assert (tmp_path / "x.pcapng").read_bytes() == b"precious"


def test_an_overwritten_file_is_kept_until_the_new_one_has_a_packet(tmp_path):
    path = tmp_path / "x.pcapng"
    path.write_bytes(b"old")
    PcapngWriter(path, HEADER, overwrite=True).close()
    assert path.read_bytes() == b"old"
    with PcapngWriter(path, HEADER, overwrite=True) as writer:
        assert path.read_bytes() == b"old"
        writer.write(b"\0abc\0", 5)
        assert [chunk.data for chunk in read_all(path)[1]] == [b"\0abc\0"]
    assert [file.name for file in tmp_path.iterdir()] == ["x.pcapng"]


@pytest.mark.parametrize("length", [COMMENT_MAX - 1, COMMENT_MAX, COMMENT_MAX + 1])
def test_a_comment_that_wireshark_adds_does_not_belong_to_the_header(tmp_path, length):
    header = {"note": "x" * (length - len(json.dumps({"note": ""})))}
    assert len(json.dumps(header)) == length
    with PcapngWriter(tmp_path / "x.pcapng", header) as writer:
        writer.write(b"a\0", 1)
    # Wireshark appends its comment to the comments of the header, and replaces the name of the program (option 4).
    data = (tmp_path / "x.pcapng").read_bytes()
    size = struct.unpack_from("<I", data, 4)[0]
    # The content of the first block, without its type and length (8 bytes) and its repeated length (4 bytes).
    section = data[8 : size - 4].replace(make_option(4, b"taxel") + make_option(0, b""), b"")
    section += make_option(1, b"a comment of the user") + make_option(4, b"Wireshark") + make_option(0, b"")
    (tmp_path / "y.pcapng").write_bytes(make_block(0x0A0D0D0A, section) + data[size:])
    assert read_all(tmp_path / "y.pcapng")[0].header == header


def test_the_comment_of_another_program_is_not_read_as_a_header(tmp_path):
    (tmp_path / "x.pcapng").write_bytes(make_section(make_option(1, b"of yesterday")) + make_interface())
    assert read_all(tmp_path / "x.pcapng")[0].header == {}


@pytest.mark.parametrize(
    ("options", "problem"),  # options: 1 is a comment, 4 is the name of the program
    [
        ((make_option(1, b"{"),), "valid JSON"),
        ((make_option(1, b'{"baud": "fast"}'),), "baud"),
        ((make_option(1, b"[" * 1000), make_option(4, b"taxel")), "levels"),
        ((make_option(4, b"taxel"),), "valid JSON"),
    ],
)
def test_a_damaged_header_is_reported_as_such(tmp_path, options, problem):
    (tmp_path / "x.pcapng").write_bytes(make_section(*options))
    with pytest.raises(CaptureError, match=f"has a damaged header.*{problem}"):
        PcapngLink(tmp_path / "x.pcapng")


def test_a_header_that_no_reader_accepts_is_not_written(tmp_path):
    with pytest.raises(CaptureError, match="its header has more than"):
        PcapngWriter(tmp_path / "x.pcapng", {"note": "x" * HEADER_MAX})
    assert list(tmp_path.iterdir()) == []


def test_a_pipe_is_refused_without_waiting(tmp_path):
    os.mkfifo(tmp_path / "x.pcapng")
    assert not is_pcapng(tmp_path / "x.pcapng")
    with pytest.raises(CaptureError, match="is a pipe"):
        PcapngLink(tmp_path / "x.pcapng")


def test_a_pcapng_file_is_recognised_by_its_first_bytes(tmp_path):
    (tmp_path / "x").write_bytes(SECTION)
    (tmp_path / "y").write_bytes(b"TAXELCAP")
    assert is_pcapng(tmp_path / "x")
    assert not is_pcapng(tmp_path / "y")
    assert not is_pcapng(tmp_path / "missing")
