"""Text of decoded frames by the Python decoder, as the programs of the clients in other languages print it.

A line states the type, the losses and every field of a frame. The last lines state the totals of the stream.
"""

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from taxel.link import CaptureLink
from taxel.stream import StreamDecoder
from taxel.stream.decoder import ADDRESSES
from taxel_protocol import FrameType, ReferenceDecoder, encode_frame
from taxel_protocol.frames import FRAMES, TaxelHeader
from taxel_protocol.layout import list_fields, pack
from taxel_protocol.original import FORMATS
from taxel_protocol.original_stream import OriginalDecoder

TO_HOST, TO_HUB = 1, 2
TAXEL_TYPES = (FrameType.TAXELS, FrameType.COMPACT_TAXELS)
VECTORS = Path(__file__).resolve().parents[2] / "protocol" / "vectors"


class Stream(NamedTuple):
    """A test stream. directions: bits of the accepted directions, 1: to the host, 2: to the hub."""

    name: str
    directions: int
    data: bytes


class DirectedDecoder(StreamDecoder):
    """The Python decoder, which accepts the given directions."""

    def __init__(self, directions: int) -> None:
        """Create a decoder; directions: bits, 1: frames to the host, 2: frames to the hub."""
        super().__init__()
        self._library.taxel_batch_init(self._state, directions)


def read_stream(path: Path) -> bytes:
    """Read all bytes of a capture file."""
    data = bytearray()
    with CaptureLink(path) as link:
        try:
            while True:
                data += link.read().data
        except EOFError:
            return bytes(data)


def _format_fields(frame_type: int, payload: bytes) -> tuple[str, bytes]:
    """Format the fields at the front of a payload as " name=value" each.

    Returns this text and the bytes behind the fields.
    """
    text, size = "", 0
    for field in list_fields(FRAMES[FrameType(frame_type)].payload):
        data = payload[field.offset : field.offset + field.size]
        text += f" {field.name}={data.hex() if field.is_bytes else int.from_bytes(data, 'little')}"
        size = field.offset + field.size
    return text, payload[size:]


def _iterate_rows(decoder: StreamDecoder, data: bytes) -> tuple[list[Any], list[Any]]:
    """Decode a stream to two lists.

    The first has (row of the batch, raw counts) for each taxel frame, the second (row of the batch, None) for each
    other frame.
    """
    taxels: list[Any] = []
    messages: list[Any] = []
    for batch in [*decoder.push(data), *decoder.finish()]:
        for row in batch.taxel_rows:
            taxels.append((row, batch.counts[row["offset"] : row["offset"] + row["size"]].tolist()))
        messages += [(row, None) for row in batch.message_rows]
    return taxels, messages


def format_stream(stream: Stream, has_wire: bool) -> list[str]:
    """Format the lines that a client prints for a stream. has_wire: each frame states its bytes on the wire."""
    plain = ReferenceDecoder()
    frames = plain.push(stream.data) + plain.finish()
    frames = [frame for frame in frames if stream.directions & (TO_HUB if frame[0] & 0x80 else TO_HOST)]
    decoder = DirectedDecoder(stream.directions)
    rows = tuple(map(iter, _iterate_rows(decoder, stream.data)))
    lines = []
    for kind, sequence, payload in frames:
        is_taxels = kind in TAXEL_TYPES
        row, counts = next(rows[0 if is_taxels else 1])
        fields, rest = _format_fields(kind, payload)
        line = f"frame type={FrameType(kind).name} sequence={sequence} lost={row['lost_before']} flags={row['flags']}"
        line += fields
        if is_taxels:
            line += f" missing={row['missing_before']} board_time_us={row['board_time_us']}"
            line += f" counts={','.join(map(str, counts))}"
        else:
            line += f" tail={rest.hex()}"
        lines.append(line + (f" wire={encode_frame(kind, sequence, payload).hex()}" if has_wire else ""))
    assert all(next(part, None) is None for part in rows)
    return lines + format_totals(decoder)


def format_totals(decoder: StreamDecoder) -> list[str]:
    """Format the last lines for a stream: totals, and counters of each board."""
    totals = decoder.totals
    lines = [
        f"end frames={totals[0]} lost={totals[1]} restarts={totals[2]} unknown={totals[3]} "
        f"discarded={decoder.discarded_bytes} "
        f"answers={decoder.take_acknowledgements().hex()}"
    ]
    # After the four totals: received, missing, damaged and undecoded snapshots for each board address.
    table = totals[4:].reshape(4, ADDRESSES)
    for address in np.flatnonzero(table[0] + table[2] + table[3]).tolist():
        received, missing, damaged, undecoded = table[:, address]
        lines.append(
            f"board address={address} received={received} missing={missing} damaged={damaged} undecoded={undecoded}"
        )
    return lines


def load_vectors(name: str, key: str) -> list[dict[str, Any]]:
    """Load the vectors of one file of protocol/vectors."""
    content: list[dict[str, Any]] = json.loads((VECTORS / f"{name}.json").read_text())[key]
    return content


def wrap_history(board: Mapping[str, Any]) -> Stream:
    """Wrap the snapshots of a board of compact.json into a stream of COMPACT_TAXELS frames."""
    data = b""
    for i, step in enumerate(board["snapshots"]):
        header = {
            "address": board["address"],
            "taxel_count": len(step["counts"]),
            "cycle": i,
            "hub_time_us": step["timestamp_us"],
        }
        payload = pack(TaxelHeader, header, bytes.fromhex(step["bytes"]))
        data += encode_frame(FrameType.COMPACT_TAXELS, i, payload)
    return Stream(f"compact {board['name']}", TO_HOST, data)


def list_streams() -> Iterator[Stream]:
    """Yield every golden vector that is a frame or a stream: frames.json, damaged.json and compact.json."""
    for vector in load_vectors("frames", "frames"):
        yield Stream(f"frame {vector['name']}", TO_HOST | TO_HUB, bytes.fromhex(vector["wire"]))
    for vector in load_vectors("damaged", "streams"):
        yield Stream(f"damaged {vector['name']}", vector["directions"], bytes.fromhex(vector["stream"]))
    yield from map(wrap_history, load_vectors("compact", "boards"))


def list_registers() -> list[dict[str, Any]]:
    """Load the golden vectors of registers.json."""
    return load_vectors("registers", "registers")


def format_register(vector: Mapping[str, Any]) -> str:
    """Format the line that a client prints for a register vector."""
    fields = "".join(f" {name}={value}" for name, value in vector["fields"].items())
    return f"register{fields} bytes={vector['bytes'][: 2 * _count_fixed_bytes(vector)]}"


def _count_fixed_bytes(vector: Mapping[str, Any]) -> int:
    """Return the number of bytes of a register's fixed fields.

    A snapshot has counts and a CRC behind its fixed fields.
    """
    return len(vector["bytes"]) // 2 - (2 * len(vector["counts"]) + 4 if "counts" in vector else 0)


def format_requests(
    streams: Iterable[Stream], registers: Iterable[Mapping[str, Any]] = (), originals: Iterable[Mapping[str, Any]] = ()
) -> str:
    """Format the standard input by which a client's program decodes these vectors, one line each."""
    lines = [f"stream {stream.directions} {stream.data.hex()}" for stream in streams]
    lines += [f"register {vector['struct']} {vector['bytes']}" for vector in registers]
    lines += [f"original {vector['format']} {vector['stream'] or '-'}" for vector in originals]
    return "\n".join(lines) + "\n"


def list_originals() -> list[dict[str, Any]]:
    """Load the golden vectors of original.json: messages and streams, each with `format` and its bytes as `stream`."""
    messages = [vector | {"stream": vector["wire"]} for vector in load_vectors("original", "messages")]
    return messages + load_vectors("original", "streams")


def format_original(vector: Mapping[str, Any]) -> list[str]:
    """Format the lines that a client prints for a stream of the original hub."""
    decoder = OriginalDecoder(FORMATS[vector["format"]])
    lines = []
    for m in decoder.push(bytes.fromhex(vector["stream"])) + decoder.finish():
        counts, accelerations = ",".join(map(str, m.counts)), ",".join(map(str, m.accelerations))
        lines.append(
            f"message address={m.address} time={m.timestamp_ms or 0} plausible={int(m.is_time_plausible)} "
            f"position={m.position} counts={counts} accelerations={accelerations}"
        )
    lines.append(
        f"end discarded={decoder.discarded_bytes} rejected={decoder.rejected_candidates} "
        f"ambiguous={decoder.ambiguous_candidates}"
    )
    return lines
