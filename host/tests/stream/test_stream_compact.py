"""Compact frames of emulated boards decode to the counts of uncompressed frames, for any losses."""

import random
from collections import deque

import numpy as np
import pytest

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import Chunk
from taxel.link.virtual import VirtualWorld
from taxel.stream import FrameStream
from taxel_protocol import FrameType, encode_frame
from taxel_protocol.limits import ACKNOWLEDGE_FORGET, REGISTER_COMPACT, REGISTER_SNAPSHOT
from taxel_protocol.registers import decode_length

HAND = load_hand("flat8")
ADDRESSES = [board.address for board in HAND.boards]
TAXELS = {board.address: board.kind.taxel_count for board in HAND.boards}
READ_SIZE = 256
STOP_SCAN, RESTART = bytes([0x70, 0x02, 0xFD]), bytes([0x70, 0x04, 0xFB])
"""Writes to the command register: register, command, complement of the command."""


class PreparedLink:
    """Link that returns queued hub bytes, one element of the queue at each read; None if the queue is empty."""

    name, baud, is_recorded, is_real_time, has_flow_control = "prepared", 1e6, True, False, False

    def __init__(self) -> None:
        self.queue: deque[bytes] = deque()

    def read(self, timeout_s: float) -> Chunk | None:
        return Chunk(self.queue.popleft(), 0) if self.queue else None

    def write(self, data: bytes) -> None:
        raise AssertionError("no test writes to a prepared link")

    def close(self) -> None:
        pass


class PolledSkin:
    """Emulated boards that are polled for compact frames (register A0), and the host's stream of these frames.

    acknowledgements: address -> payload that the host wants to send to the board. sizes: address -> bytes of the last
    compact frame.
    """

    def __init__(self, world: VirtualWorld) -> None:
        self.world = world
        self.link = PreparedLink()
        self.stream = FrameStream(self.link, lambda message: None, on_acknowledgements=self._store_acknowledgements)
        self.acknowledgements: dict[int, bytes] = {}
        self.sizes: dict[int, int] = {}
        self.sequence = self.cycle = 0

    def _store_acknowledgements(self, payload: bytes) -> None:
        """Store the acknowledgements of a host frame: three bytes for each board (address and flag, sequence)."""
        for i in range(0, len(payload), 3):
            address, forget = payload[i] & 0x7F, payload[i] & ACKNOWLEDGE_FORGET
            self.acknowledgements[address] = b"\0" if forget else payload[i + 1 : i + 3]

    def read(self, address: int, write: bytes = b"") -> bytes:
        """Write bytes to a board and read its compact frame; b"" if it does not answer or has no new scan."""
        result, data = self.world.transfer(address, write, READ_SIZE)
        return b"" if result else data[1 : 1 + decode_length(data[0])]

    def acknowledge(self, address: int) -> None:
        """Send a stored acknowledgement to its board."""
        if address in self.acknowledgements:
            self.world.transfer(address, bytes([REGISTER_COMPACT]) + self.acknowledgements.pop(address), 0)

    def poll(self, address: int, is_lost: bool = False) -> list[tuple[int, list[int]]]:
        """Acknowledge and read one board; return [(sequence, counts)] of the decoded frame, or [].

        is_lost: the frame does not reach the host.
        """
        self.acknowledge(address)
        data = self.read(address)
        self.sizes[address] = len(data)
        if data:
            header = bytes([address, TAXELS[address]]) + (self.cycle % 65536).to_bytes(2, "little") + bytes(4)
            wire = encode_frame(FrameType.COMPACT_TAXELS, self.sequence % 65536, header + data)
            self.sequence += 1
            if not is_lost:
                self.link.queue.append(wire)
                self.stream.poll(0.0)
        received = [(frame.sequence, frame.raw_counts.tolist()) for frame in self.stream.frames]
        self.stream.frames.clear()
        return received

    def start_compact(self) -> None:
        """Set the register pointer of every board to the compact frames, and wait for the first scans."""
        for address in ADDRESSES:
            self.read(address, bytes([REGISTER_COMPACT]))
        self.world.run(0.05)

    def read_stopped_snapshot(self, address: int) -> tuple[int, list[int]]:
        """Read sequence and counts of the uncompressed snapshot after the last scan."""
        size = 10 + 2 * TAXELS[address]
        _, data = self.world.transfer(address, bytes([REGISTER_SNAPSHOT]), size)
        self.world.transfer(address, bytes([REGISTER_COMPACT]), 1)
        return int.from_bytes(data[:2], "little"), np.frombuffer(data[6:-4], "<u2").tolist()


@pytest.fixture
def skin():
    """Emulated boards of HAND that have started to encode compact frames."""
    with VirtualWorld(format_world(HAND, WorldSettings(seed=3, noise_counts=1.5)), "none") as world:
        world.run(0.4)
        hub = PolledSkin(world)
        hub.start_compact()
        yield hub


def stop_scan(hub: PolledSkin, address: int) -> tuple[int, list[int]]:
    """Stop the scan of a board; return sequence and counts of its last compact frame."""
    hub.world.transfer(address, STOP_SCAN, 0)
    hub.world.run(0.02)
    _, data = hub.world.transfer(address, bytes([REGISTER_COMPACT]), READ_SIZE)
    payload = data[1 : 1 + decode_length(data[0])]
    header = bytes([address, TAXELS[address], 0, 0]) + bytes(4)
    hub.link.queue.append(encode_frame(FrameType.COMPACT_TAXELS, hub.sequence % 65536, header + payload))
    hub.sequence += 1
    hub.stream.poll(0.0)
    frame = hub.stream.frames.pop()
    hub.stream.frames.clear()
    return frame.sequence, frame.raw_counts.tolist()


def test_frames_of_quiet_boards_shrink_to_a_third_of_the_uncompressed_size(skin):
    for _ in range(60):
        for address in ADDRESSES:
            skin.poll(address)
        skin.world.run(0.016)
    for address in ADDRESSES:
        # Bytes. For 64 taxels the bound is 40.8, less than a third of the 138 bytes of an uncompressed snapshot, which
        # has 10 + 2 * TAXELS bytes.
        assert skin.sizes[address] < 12 + 0.45 * TAXELS[address], hex(address)
        assert stop_scan(skin, address) == skin.read_stopped_snapshot(address)
    assert skin.stream.losses.undecoded_frames == {}


def test_decoded_counts_are_correct_after_any_losses(skin):
    # Frames, acknowledgements and the state of the host are lost randomly; every decoded frame is correct.
    rng = random.Random(20)
    address = ADDRESSES[0]
    received = 0
    for _ in range(250):
        received += len(skin.poll(address, is_lost=rng.random() < 0.2))
        if rng.random() < 0.3:
            skin.acknowledgements.clear()
        if rng.random() < 0.02:  # another host takes over
            skin.stream = FrameStream(skin.link, lambda message: None, on_acknowledgements=skin._store_acknowledgements)
        if rng.random() < 0.05:
            forces = np.zeros(HAND.n_taxels)
            forces[rng.randrange(TAXELS[address])] = rng.choice([0.0, 1.0, 8.0])
            skin.world.set_stimulus(forces)
        skin.world.run(0.012)
    assert received > 100
    for _ in range(12):
        skin.poll(address)
        skin.world.run(0.012)
    assert stop_scan(skin, address) == skin.read_stopped_snapshot(address)


def test_a_restarted_board_starts_with_a_new_key_frame(skin):
    address = ADDRESSES[0]
    for _ in range(20):
        skin.poll(address)
        skin.world.run(0.016)
    size_before_restart = skin.sizes[address]
    skin.world.transfer(address, RESTART, 0)
    skin.world.run(0.4)
    skin.read(address, bytes([REGISTER_COMPACT]))
    skin.world.run(0.05)
    received = []
    for _ in range(40):
        received += skin.poll(address)
        skin.world.run(0.016)
    assert len(received) > 30
    assert skin.sizes[address] < size_before_restart + 6  # bytes: delta frames again, not full key frames
    assert stop_scan(skin, address) == skin.read_stopped_snapshot(address)


def test_writing_the_pointer_again_repeats_the_last_frame_after_a_damaged_read(skin):
    address = ADDRESSES[0]
    skin.world.transfer(address, STOP_SCAN, 0)
    skin.world.run(0.02)
    first_read = skin.read(address, bytes([REGISTER_COMPACT]))
    assert first_read
    assert skin.read(address, bytes([REGISTER_COMPACT])) == first_read
    assert skin.read(address) == b""  # without the pointer a read gives only a new scan, and the scan is stopped


def test_boards_stop_encoding_compact_frames_that_no_host_reads(skin):
    address = ADDRESSES[0]
    assert skin.read(address)
    skin.world.run(11.0)  # s; longer than the time without a read after which a board stops encoding
    assert skin.read(address) == b""  # this read starts the encoding again
    skin.world.run(0.05)
    assert skin.read(address)
