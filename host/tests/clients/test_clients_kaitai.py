"""The Kaitai description decodes every golden vector and a capture, interpreted and (if installed) compiled."""

import functools
import json

import pytest

from host.tests.clients.conftest import captures, kaitai_frames, reference, skip_if_missing
from taxel_protocol import compact
from taxel_protocol.original import FORMATS

SECONDS, SEED = 1.0, 46


@pytest.fixture(scope="module", params=["interpret", "compile_description"])
def open_description(request):
    """Function from the name of a description to its parser."""
    make = functools.cache(getattr(kaitai_frames, request.param))
    return functools.partial(skip_if_missing, make)


@pytest.fixture
def parse(open_description):
    """Parser of streams, opened by its first use in a test."""
    return lambda *arguments: open_description("taxel_stream")(*arguments)


def reduced(lines):
    """Return the frame lines of the Python decoder without the content of compact snapshots.

    A separate test checks this content.
    """
    return kaitai_frames.shorten(lines)


def without_data(lines):
    return [line.partition(" data=")[0] for line in lines]


def test_every_frame_and_stream_is_decoded(parse):
    for stream in reference.list_streams():
        # Frames (both directions) and compact streams; a separate test decodes the damaged streams.
        if stream.directions == reference.TO_HOST | reference.TO_HUB or "compact" in stream.name:
            expected = reduced(reference.format_stream(stream, has_wire=False))
            assert without_data(kaitai_frames.format_frames(parse, stream.data, stream.directions)) == expected, (
                stream.name
            )


def test_the_intact_frames_of_every_damaged_stream_are_decoded(parse):
    for vector in json.loads((reference.VECTORS / "damaged.json").read_text())["streams"]:
        # Bit 7 of the type is set in frames to the hub. With one direction, only frames of this direction are expected.
        mask = {reference.TO_HOST: 0, reference.TO_HUB: 0x80}
        entries = parse(bytes.fromhex(vector["stream"]), None).frames.entries
        found = [(int(getattr(e.body.type, "value", e.body.type)), e.body.sequence) for e in entries if e.is_known]
        if vector["directions"] in mask:
            found = [frame for frame in found if frame[0] & 0x80 == mask[vector["directions"]]]
        sent = [(frame["type"], frame["sequence"]) for frame in vector["sent"]]
        assert found == [sent[i] for i in vector["expected"]], vector["name"]


def test_every_register_is_decoded(parse):
    for vector in reference.list_registers():
        node = parse(bytes.fromhex(vector["bytes"]), vector["struct"])
        found = {name: kaitai_frames.format_value(getattr(node, name)) for name in vector["fields"]}
        assert found == {name: str(value) for name, value in vector["fields"].items()}, vector["name"]


def test_compact_snapshots_are_divided_into_their_fields(parse):
    for board in json.loads((reference.VECTORS / "compact.json").read_text())["boards"]:
        entries = parse(reference.wrap_history(board).data, None).frames.entries
        key_frame = pending = None
        for entry, step in zip(entries, board["snapshots"], strict=True):
            found, data = entry.body.payload.compact, bytes.fromhex(step["bytes"])
            if step["acknowledged"]:  # from now on, delta frames are coded against the last key frame
                key_frame, pending = pending, None
            decoded = compact.decode(board["address"], len(step["counts"]), data, [key_frame] if key_frame else [])
            pending = decoded.key_frame or pending
            assert found.crc32 == int.from_bytes(data[-4:], "little")
            if found.width:  # a packed frame, which is decoded without a key frame; 0: a delta frame
                assert (found.packed.counts, found.timestamp_us) == (step["counts"], step["timestamp_us"])
                continue
            assert found.key_frame == key_frame.id
            assert int.from_bytes(found.timestamp_low, "little") == step["timestamp_us"] & 0xFFFFFF
            assert compact.decode_counts(key_frame.taxels, found.coded) == step["counts"]


@pytest.mark.parametrize("kind", ["plain", "compact"])
def test_frames_and_losses_of_a_damaged_capture_equal_those_of_the_reference(open_description, parse, tmp_path, kind):
    captures.record_capture(tmp_path / "intact.bin", SECONDS, kind)
    captures.write_capture(
        tmp_path / "damaged.bin", captures.damage(reference.read_stream(tmp_path / "intact.bin"), SEED)
    )
    stream = reference.read_stream(tmp_path / "damaged.bin")
    assert kaitai_frames.read_records(open_description("taxel_capture"), tmp_path / "damaged.bin") == stream
    expected = reference.format_stream(reference.Stream(kind, reference.TO_HOST, stream), has_wire=False)
    assert without_data(kaitai_frames.format_frames(parse, stream)) == reduced(expected)


def test_a_file_that_is_no_capture_is_refused(open_description):
    with pytest.raises(Exception, match=r"magic|not equal"):
        open_description("taxel_capture")(b"TAXELCAQ" + bytes(8), None)


def test_every_message_of_the_original_hub_is_decoded(open_description):
    parse = open_description("taxel_original")
    for vector in reference.load_vectors("original", "messages"):
        layout, counts, accelerations = FORMATS[vector["format"]], vector["counts"], vector["accelerations"]
        arguments = (
            len(counts),
            len(accelerations),
            not layout.record_size,  # whether the message is framed
            layout.has_timestamp,
            layout.is_big_endian,
        )
        found = parse(bytes.fromhex(vector["wire"]), None, arguments)
        assert found.counts == counts, vector["name"]
        assert [value & 0xFFFF for value in found.accelerations] == accelerations
        assert getattr(found, "timestamp_ms", 0) == (vector["timestamp_ms"] if layout.has_timestamp else 0)
        assert getattr(found, "address", vector["address"]) == vector["address"]
