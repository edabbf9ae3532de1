"""Test hub that encodes frames, and a link that returns prepared chunks."""

from collections.abc import Callable, Iterable

import numpy as np
import pytest

from taxel.link import Chunk
from taxel_protocol import FrameType, crc32, encode_frame
from taxel_protocol.frames import FRAMES, TaxelHeader
from taxel_protocol.layout import pack
from taxel_protocol.registers import SnapshotHeader


class Hub:
    """Encoder of hub frames with consecutive sequence numbers."""

    def __init__(self, sequence: int = 0) -> None:
        self.sequence = sequence

    def encode_hub_frame(self, kind: FrameType, payload: bytes) -> bytes:
        """Encode a frame with the next sequence number."""
        data = encode_frame(kind, self.sequence, payload)
        self.sequence = (self.sequence + 1) % 65536
        return data

    def encode_message(self, kind: FrameType, trailing: bytes = b"", **fields: object) -> bytes:
        return self.encode_hub_frame(kind, pack(FRAMES[kind].payload, fields, trailing))

    def encode_taxels(
        self,
        address: int,
        cycle: int,
        counts: Iterable[int] = (1, 2, 3),
        board_sequence: int | None = None,
        board_us: int = 0,
        hub_us: int = 0,
        damage: int = 0,
    ) -> bytes:
        """Encode a TAXELS frame with the counts of one board.

        board_sequence: number of the scan; None: 3 x `cycle`. board_us, hub_us: times on the board's and the hub's
        clock. damage: combined with the CRC of the snapshot by exclusive or; 0: the CRC is correct.
        """
        values = np.asarray(list(counts), dtype="<u2")
        snapshot = pack(
            SnapshotHeader,
            {
                "sequence": (3 * cycle if board_sequence is None else board_sequence) % 65536,
                "timestamp_us": board_us % 2**32,
            },
            values.tobytes(),
        )
        crc = crc32(bytes([address]) + snapshot) ^ damage
        header = {"address": address, "taxel_count": len(values)}
        header |= {"cycle": cycle % 65536, "hub_time_us": hub_us % 2**32}
        return self.encode_hub_frame(FrameType.TAXELS, pack(TaxelHeader, header, snapshot + crc.to_bytes(4, "little")))

    def encode_handshake(self, tag: int = 0, uptime_us: int = 0) -> bytes:
        """Encode a handshake of the hub. tag: that of the host's request; 0: the hub has started."""
        fields = dict.fromkeys(("reset_cause", "firmware_major", "firmware_minor", "firmware_patch"), 0)
        fields |= {"tag": tag, "version_min": 1, "version_max": 1, "version_chosen": 1, "unique_id": bytes(8)}
        return self.encode_message(FrameType.HUB_HANDSHAKE, **fields, uptime_us=uptime_us)

    def encode_log(self, text: bytes = b"x") -> bytes:
        return self.encode_message(FrameType.LOG, text, level=1, code=0, hub_time_us=0)

    def encode_sync(self, address: int, board_us: int, hub_us: int) -> bytes:
        """Encode a reading of a board's clock: the times on both clocks at the same instant."""
        return self.encode_message(
            FrameType.TIME_SYNC, address=address, board_time_us=board_us % 2**32, hub_time_us=hub_us
        )


class PreparedLink:
    """Link that returns prepared chunks and then raises `end` (None: `EOFError`).

    reads_single_chunks: None follows every chunk, as on a port that is read immediately; otherwise, all chunks can be
    read at once, as in a recording. has_pacing: whether the link declares itself as a recording.
    """

    name = "prepared"
    is_recorded = True

    def __init__(
        self,
        chunks: Iterable[Chunk],
        end: Exception | None = None,
        reads_single_chunks: bool = False,
        has_pacing: bool = True,
    ) -> None:
        self._chunks = iter(chunks)
        self._end = end or EOFError()
        self._reads_single_chunks = reads_single_chunks
        self._pause = False
        self.is_real_time = False
        self.is_recorded = has_pacing
        self.baud = 1e6
        self.is_closed = False

    def read(self, timeout_s: float) -> Chunk | None:
        if self._reads_single_chunks:
            self._pause = not self._pause
            if not self._pause:
                return None
        chunk = next(self._chunks, None)
        if chunk is None:
            raise self._end
        return chunk

    def write(self, data: bytes) -> None:
        raise AssertionError("no test writes to prepared chunks")

    def close(self) -> None:
        self.is_closed = True


@pytest.fixture
def hub() -> Hub:
    return Hub()


@pytest.fixture(scope="session")
def make_hub() -> type[Hub]:
    """Class `Hub`: call it with the first sequence number."""
    return Hub


@pytest.fixture(scope="session")
def make_prepared_link() -> type[PreparedLink]:
    """Class `PreparedLink`: call it with the chunks."""
    return PreparedLink


@pytest.fixture(scope="session")
def divide() -> Callable[..., list[Chunk]]:
    """Function that divides bytes into chunks of the given sizes, which repeat."""

    def divide_bytes(data: bytes, sizes: Iterable[int] = (1000,), arrival_ns: int = 0) -> list[Chunk]:
        chunks = []
        sizes = list(sizes)
        position = 0
        while position < len(data):
            size = sizes[len(chunks) % len(sizes)]
            chunks.append(Chunk(data[position : position + size], arrival_ns))
            position += size
        return chunks

    return divide_bytes
