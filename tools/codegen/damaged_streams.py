"""Write protocol/vectors/damaged.json: damaged streams of the frames in frames.json, and what comes out.

python tools/codegen/damaged_streams.py            write it
python tools/codegen/damaged_streams.py --check    exit status 1 if the file on disk is stale

A stream ends with its last byte: the decoder's finish function is called, which delivers the remaining frames.
"""

import json
import random
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from generated_files import write_or_check

from taxel_protocol.framing import crc32, encode_body
from taxel_protocol.limits import PAYLOAD_MAX, PROTOCOL_VERSION
from taxel_protocol.names import FrameType

VECTORS = Path(__file__).resolve().parents[2] / "protocol" / "vectors"
SEED = 20

TO_HOST, TO_HUB, BOTH_WAYS = 1, 2, 3
"""Directions that a decoder accepts, as `directions` of the C decoder."""


@dataclass(frozen=True)
class Sent:
    """One frame of frames.json."""

    vector: Mapping[str, Any]

    @property
    def wire(self) -> bytes:
        """Bytes on the wire, delimiters included."""
        return bytes.fromhex(self.vector["wire"])

    @property
    def stuffed(self) -> bytes:
        """The encoded bytes of the frame without the delimiters at its start and end."""
        return self.wire[1:-1]

    @property
    def content(self) -> dict[str, Any]:
        """Output that a decoder has to produce for this frame."""
        return {key: self.vector[key] for key in ("type", "sequence", "payload")}


def build_raw_frame(frame_type: int, payload: bytes, length: int | None = None) -> bytes:
    """Build the wire bytes of a frame with a valid CRC, which the protocol may forbid.

    length: length of the payload that the header states; None for the actual length.
    """
    body = bytes([frame_type, 1, 0]) + (len(payload) if length is None else length).to_bytes(2, "little") + payload
    return encode_body(body + crc32(body).to_bytes(4, "little"))


def _flip_bits(data: bytes, position: int, mask: int = 0x01) -> bytes:
    """Invert the bits `mask` of one byte in a byte string."""
    return data[:position] + bytes([data[position] ^ mask]) + data[position + 1 :]


class Streams:
    """Collection of damaged streams as test vectors. Most streams consist of the three frames A, B and C."""

    def __init__(self, frames: Mapping[str, Sent]) -> None:
        """Create an empty collection of test streams with damage. frames: valid frames by name, of which three are
        damaged.
        """
        self.frames = frames
        self.rng = random.Random(SEED)
        self.vectors: list[dict[str, Any]] = []
        self.a, self.b, self.c = (frames[name] for name in ("taxels_63", "time_sync_arbitrary", "hub_status_arbitrary"))

    def add(
        self,
        name: str,
        sent: list[Sent],
        stream: bytes,
        expected: list[int],
        directions: int = TO_HOST,
        unknown: int = 0,
    ) -> None:
        """Add a test vector: a byte stream and the frames that a decoder must find in it.

        sent: frames that were sent. expected: indices into `sent` of the frames to be decoded, in order.
        directions: bit mask of the frame directions that the decoder accepts. unknown: whole frames that the decoder
        must skip and count, because this version or this direction does not define them.
        """
        vector = {"name": name, "directions": directions, "sent": [frame.content for frame in sent]}
        self.vectors.append(vector | {"stream": stream.hex(), "expected": expected, "unknown": unknown})

    def make_garbage(self, size: int) -> bytes:
        """Create random bytes without a zero, which do not contain the delimiter of frames."""
        return bytes(self.rng.randrange(1, 256) for _ in range(size))

    def add_delimiter_streams(self) -> None:
        """Add streams with lost delimiters, and with bytes between two frames."""
        a, b, c = self.a, self.b, self.c
        abc = [a, b, c]
        every = [0, 1, 2]
        self.add("intact", abc, a.wire + b.wire + c.wire, every)
        self.add("one_delimiter_between_frames", abc, a.wire[:-1] + b.wire[:-1] + c.wire, every)
        self.add("no_first_delimiter", abc, a.wire[1:] + b.wire + c.wire, every)
        self.add("no_last_delimiter", abc, a.wire + b.wire + c.wire[:-1], every)
        self.add("two_frames_glued", abc, a.wire[:-1] + b.stuffed + c.wire, every)
        self.add("three_frames_glued", abc, b"\0" + a.stuffed + b.stuffed + c.stuffed + b"\0", every)
        self.add("no_delimiter_at_all", abc, a.stuffed + b.stuffed + c.stuffed, every)
        self.add("many_delimiters", abc, bytes(9).join([a.wire, b.wire, c.wire]), every)
        self.add("garbage_before", abc, self.make_garbage(40) + a.wire + b.wire + c.wire, every)
        self.add("garbage_glued_before", abc, self.make_garbage(40) + a.stuffed + b.wire + c.wire, every)
        self.add("garbage_glued_between", abc, a.wire[:-1] + self.make_garbage(17) + b.stuffed + c.wire, every)
        self.add(
            "garbage_with_zeros",
            abc,
            self.rng.randbytes(600) + a.wire + b.wire + self.rng.randbytes(99) + c.wire,
            every,
        )
        self.add("long_garbage_glued_before", abc, self.make_garbage(5000) + a.stuffed + b.wire + c.wire, every)
        self.add("long_garbage_then_delimiter", abc, self.make_garbage(3000) + a.wire + b.wire + c.wire, every)
        for name in ("run_254_at_end", "run_253_at_end", "body_507_without_zero"):
            edge = self.frames[name]
            self.add(f"{name}_glued", [edge, b, edge], edge.stuffed + b.stuffed + edge.stuffed, every)
        shortest = self.frames["reply_zeros"]
        self.add("300_shortest_frames_glued", [shortest] * 300, shortest.stuffed * 300, list(range(300)))
        longest = self.frames["taxels_longest_arbitrary"]
        self.add("8_longest_frames_glued", [longest] * 8, longest.stuffed * 8, list(range(8)))

    def add_damaged_frames(self) -> None:
        """Add streams with a damaged frame, whose bytes are changed, lost or added.

        Only the neighbours of this frame must be decoded.
        """
        a, b, c = self.a, self.b, self.c
        abc = [a, b, c]
        middle = len(a.wire) // 2
        cases = {
            "bit_flipped": _flip_bits(a.wire, middle),
            "first_code_byte_flipped": _flip_bits(a.wire, 1),
            "crc_flipped": _flip_bits(a.wire, len(a.wire) - 2),
            "type_flipped": _flip_bits(a.wire, 2, 0x80),
            "byte_became_zero": a.wire[:middle] + b"\0" + a.wire[middle + 1 :],
            "byte_lost": a.wire[:middle] + a.wire[middle + 1 :],
            "byte_added": a.wire[:middle] + b"\x55" + a.wire[middle:],
            "zero_added": a.wire[:middle] + b"\0" + a.wire[middle:],
            "two_bytes_swapped": a.wire[:middle] + a.wire[middle + 1 : middle - 1 : -1] + a.wire[middle + 2 :],
            "truncated": a.wire[:middle],
            "head_lost": a.wire[middle:],
        }
        for name, damaged in cases.items():
            self.add(name, abc, c.wire + damaged + b.wire + c.wire, [2, 1, 2])
        self.add("truncated_and_glued", abc, a.wire[:middle] + b.stuffed + c.wire, [1, 2])
        self.add("last_byte_lost_and_glued", abc, a.wire[:-2] + b.stuffed + c.wire, [1, 2])
        self.add("first_byte_lost_and_glued", abc, a.wire[2:-1] + b.stuffed + c.wire, [1, 2])
        reaching = b"\0" + b"\xff" + a.stuffed[1:] + b.stuffed + c.stuffed + b"\0"
        self.add("code_byte_reaches_over_the_next_frame", abc, reaching, [1, 2])

    def add_quotations(self) -> None:
        """Add streams with a frame in the payload of another frame.

        The inner frame must never be decoded, even if the outer frame is damaged.
        """
        quoted = self.b
        for name in [name for name in self.frames if "_quotes_" in name]:
            host = self.frames[name]
            # Place of the quoted frame, the tail of the payload; CRC (4 bytes) and delimiter follow it.
            quotation = len(host.wire) - len(bytes.fromhex(host.vector["tail"])) - 5
            cases = {
                "crc_flipped": _flip_bits(host.wire, len(host.wire) - 2),
                "head_lost": host.wire[quotation:],
                "head_and_a_byte_lost": host.wire[quotation + 1 :],
                "code_flipped": _flip_bits(host.wire, 1),
            }
            self.add(name, [host, quoted], host.wire + quoted.wire, [0, 1])
            for case, damaged in cases.items():
                self.add(f"{name}_{case}", [host, quoted], damaged + quoted.wire, [1])

    def add_rejections(self) -> None:
        """Add streams with frames of a valid CRC that this protocol version does not define."""
        b, c = self.b, self.c
        time_sync = bytes.fromhex(b.content["payload"])
        small = bytes.fromhex(self.frames["taxels_shortest"].content["payload"])
        cases = {
            "type_0x00": build_raw_frame(0x00, time_sync),
            "type_0xFF": build_raw_frame(0xFF, time_sync),
            "type_unknown": build_raw_frame(0x0F, time_sync),
            "fixed_payload_too_long": build_raw_frame(FrameType.TIME_SYNC, time_sync + b"\1"),
            "fixed_payload_too_short": build_raw_frame(FrameType.TIME_SYNC, time_sync[:-1]),
            "length_claims_more": build_raw_frame(FrameType.LOG, bytes(20), 21),
            "length_claims_less": build_raw_frame(FrameType.LOG, bytes(20), 19),
            "log_too_long": build_raw_frame(FrameType.LOG, bytes(72)),
            "reply_too_short": build_raw_frame(FrameType.REPLY, b"\1\2"),
            "address_too_low": build_raw_frame(FrameType.TIME_SYNC, b"\x07" + time_sync[1:]),
            "address_too_high": build_raw_frame(FrameType.TAXELS, b"\x78" + small[1:]),
            "taxel_count_too_high": build_raw_frame(FrameType.TAXELS, small[:1] + b"\2" + small[2:]),
            "taxel_count_zero": build_raw_frame(FrameType.TAXELS, small[:1] + b"\0" + small[2:-2]),
        }
        for reserved in range(FrameType.COMPACT_TAXELS + 1, FrameType.HUB_STATUS):
            cases[f"reserved_type_0x{reserved:02X}"] = build_raw_frame(reserved, time_sync)
        for name, rejected in cases.items():
            # A frame with a wrong length is no whole frame, so it is not counted as an unknown frame.
            unknown = 0 if name.startswith("length_claims") else 1
            self.add(name, [b, c], b.wire + rejected + c.wire, [0, 1], BOTH_WAYS, unknown)

    def add_newer_senders(self) -> None:
        """Add streams of a sender of a newer version: longer payloads, types without a name, quoted frames in them."""
        b, c = self.b, self.c
        longer = build_raw_frame(FrameType.HUB_STATUS, bytes.fromhex(c.content["payload"]) + self.rng.randbytes(8))
        cases = {
            "longer_status_of_a_newer_hub": (longer, 1),
            "longest_unknown_frame": (build_raw_frame(0x0F, self.rng.randbytes(PAYLOAD_MAX)), 1),
            "empty_unknown_frame": (build_raw_frame(0x10, b""), 1),
            "unknown_frame_quotes_a_frame": (build_raw_frame(0x11, b.wire), 1),
            "three_unknown_frames_glued": (longer[:-1] + longer[1:-1] + longer[1:], 3),
        }
        for name, (newer, unknown) in cases.items():
            self.add(name, [b, c], b.wire + newer + c.wire, [0, 1], TO_HOST, unknown)
        damaged = _flip_bits(longer, len(longer) - 2)
        self.add("damaged_status_of_a_newer_hub", [b, c], b.wire + damaged + c.wire, [0, 1], TO_HOST)

    def add_directions(self) -> None:
        """Add streams with frames of both directions, of which a decoder must accept only the permitted ones."""
        b, handshake = self.b, self.frames["host_handshake_arbitrary"]
        stream = b.wire + handshake.wire + b.wire
        self.add("host_hears_itself", [b, handshake], stream, [0, 0], TO_HOST, 1)
        self.add("hub_hears_itself", [b, handshake], stream, [1], TO_HUB, 2)
        self.add("both_ways", [b, handshake], stream, [0, 1, 0], BOTH_WAYS)


def format_text() -> str:
    """Format the file of test vectors of damaged streams."""
    frames = json.loads((VECTORS / "frames.json").read_text())["frames"]
    streams = Streams({vector["name"]: Sent(vector) for vector in frames})
    streams.add_delimiter_streams()
    streams.add_damaged_frames()
    streams.add_quotations()
    streams.add_rejections()
    streams.add_directions()
    streams.add_newer_senders()
    about = "damaged streams and the frames that they yield"
    head = json.dumps({"about": about, "protocol_version": PROTOCOL_VERSION, "made_by": Path(__file__).name})
    lines = ",\n".join(json.dumps(vector) for vector in streams.vectors)
    return f'{head[:-1]}, "streams": [\n{lines}\n]}}\n'


def main() -> int:
    """Write the file of test vectors of damaged streams, or check that it is up to date."""
    return write_or_check({VECTORS / "damaged.json": format_text()})


if __name__ == "__main__":
    sys.exit(main())
