"""Compact snapshots from emulated boards to taxel frames: the counts are those of plain ones, whatever is lost."""

import random
from collections import deque

import numpy as np
import pytest

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, world_text
from taxel.link import Chunk
from taxel.link.virtual import VirtualWorld
from taxel.stream import FrameStream
from taxel_protocol import FrameType, encode_frame
from taxel_protocol.limits import ACKNOWLEDGE_FORGET, REGISTER_COMPACT, REGISTER_SNAPSHOT
from taxel_protocol.registers import compact_size

HAND = load_hand("flat8")
ADDRESSES = [board.address for board in HAND.boards]
TAXELS = {board.address: board.kind.taxel_count for board in HAND.boards}
READ_SIZE = 256


class PreparedLink:
    """What a hub sends, taken out by the stream when it asks."""

    name, baud, is_recorded, is_real_time, holds_back = "prepared", 1e6, True, False, False

    def __init__(self) -> None:
        self.waiting: deque[bytes] = deque()

    def read(self, timeout_s: float) -> Chunk | None:
        return Chunk(self.waiting.popleft(), 0) if self.waiting else None

    def write(self, data: bytes) -> None:
        raise AssertionError("a prepared link takes nothing")

    def close(self) -> None:
        pass


class Polled:
    """A world whose boards are polled at register A0 by the bench's own adapter, and a stream of what they say."""

    def __init__(self, world: VirtualWorld) -> None:
        self.world = world
        self.link = PreparedLink()
        self.stream = FrameStream(self.link, lambda message: None, on_acknowledgements=self._take_answers)
        self.answers: dict[int, bytes] = {}
        self.sizes: dict[int, int] = {}
        self.sequence = self.cycle = 0

    def _take_answers(self, payload: bytes) -> None:
        for i in range(0, len(payload), 3):
            address, forget = payload[i] & 0x7F, payload[i] & ACKNOWLEDGE_FORGET
            self.answers[address] = b"\0" if forget else payload[i + 1 : i + 3]

    def read(self, address: int, write: bytes = b"") -> bytes:
        result, data = self.world.transfer(address, write, READ_SIZE)
        return b"" if result else data[1 : 1 + compact_size(data[0])]

    def answer(self, address: int) -> None:
        if address in self.answers:
            self.world.transfer(address, bytes([REGISTER_COMPACT]) + self.answers.pop(address), 0)

    def poll(self, address: int, lose: bool = False) -> list[tuple[int, list[int]]]:
        """(sequence, counts) of the frame that came out, if one did."""
        self.answer(address)
        data = self.read(address)
        self.sizes[address] = len(data)
        if data:
            header = bytes([address, TAXELS[address]]) + (self.cycle % 65536).to_bytes(2, "little") + bytes(4)
            wire = encode_frame(FrameType.COMPACT_TAXELS, self.sequence % 65536, header + data)
            self.sequence += 1
            if not lose:
                self.link.waiting.append(wire)
                self.stream.poll(0.0)
        came = [(frame.sequence, frame.raw_counts.tolist()) for frame in self.stream.frames]
        self.stream.frames.clear()
        return came

    def begin(self) -> None:
        for address in ADDRESSES:
            self.read(address, bytes([REGISTER_COMPACT]))
        self.world.run(0.05)

    def stopped_snapshot(self, address: int) -> tuple[int, list[int]]:
        """Sequence and counts of the plain snapshot that the board stopped after."""
        size = 10 + 2 * TAXELS[address]
        _, data = self.world.transfer(address, bytes([REGISTER_SNAPSHOT]), size)
        self.world.transfer(address, bytes([REGISTER_COMPACT]), 1)
        return int.from_bytes(data[:2], "little"), np.frombuffer(data[6:-4], "<u2").tolist()


@pytest.fixture
def polled():
    with VirtualWorld(world_text(HAND, WorldSettings(seed=3, noise_counts=1.5)), "none") as world:
        world.run(0.4)
        hub = Polled(world)
        hub.begin()
        yield hub


def stop(hub: Polled, address: int) -> tuple[int, list[int]]:
    """Stop the board's scan; the last whole one has been coded meanwhile. Back at A0 afterwards."""
    hub.world.transfer(address, bytes([0x70, 0x02, 0xFD]), 0)
    hub.world.run(0.02)
    _, data = hub.world.transfer(address, bytes([REGISTER_COMPACT]), READ_SIZE)
    frame = data[1 : 1 + compact_size(data[0])]
    header = bytes([address, TAXELS[address], 0, 0]) + bytes(4)
    hub.link.waiting.append(encode_frame(FrameType.COMPACT_TAXELS, hub.sequence % 65536, header + frame))
    hub.sequence += 1
    hub.stream.poll(0.0)
    came = hub.stream.frames.pop()
    hub.stream.frames.clear()
    return came.sequence, came.raw_counts.tolist()


def test_quiet_boards_come_to_a_third_of_their_plain_bytes(polled):
    for _ in range(60):
        for address in ADDRESSES:
            polled.poll(address)
        polled.world.run(0.016)
    for address in ADDRESSES:
        assert polled.sizes[address] < 12 + 0.45 * TAXELS[address], hex(address)
        assert stop(polled, address) == polled.stopped_snapshot(address)
    assert polled.stream.losses.undecoded_frames == {}


def test_counts_are_right_and_recover_whatever_is_lost(polled):
    """Frames, answers and the host's whole memory are lost at random; a frame that comes out is right."""
    rng = random.Random(20)
    address = ADDRESSES[0]
    came = 0
    for _ in range(250):
        came += len(polled.poll(address, lose=rng.random() < 0.2))
        if rng.random() < 0.3:
            polled.answers.clear()
        if rng.random() < 0.02:  # another host takes over
            polled.stream = FrameStream(polled.link, lambda message: None, on_acknowledgements=polled._take_answers)
        if rng.random() < 0.05:
            forces = np.zeros(HAND.n_taxels)
            forces[rng.randrange(TAXELS[address])] = rng.choice([0.0, 1.0, 8.0])
            polled.world.press(forces)
        polled.world.run(0.012)
    assert came > 100
    for _ in range(12):
        polled.poll(address)
        polled.world.run(0.012)
    assert stop(polled, address) == polled.stopped_snapshot(address)


def test_a_board_that_restarts_begins_anew(polled):
    address = ADDRESSES[0]
    for _ in range(20):
        polled.poll(address)
        polled.world.run(0.016)
    before = polled.sizes[address]
    polled.world.transfer(address, bytes([0x70, 0x04, 0xFB]), 0)
    polled.world.run(0.4)
    polled.read(address, bytes([REGISTER_COMPACT]))
    polled.world.run(0.05)
    came = []
    for _ in range(40):
        came += polled.poll(address)
        polled.world.run(0.016)
    assert len(came) > 30
    assert polled.sizes[address] < before + 6
    assert stop(polled, address) == polled.stopped_snapshot(address)


def test_a_damaged_read_is_repeated_by_writing_the_pointer(polled):
    address = ADDRESSES[0]
    polled.world.transfer(address, bytes([0x70, 0x02, 0xFD]), 0)
    polled.world.run(0.02)
    first = polled.read(address, bytes([REGISTER_COMPACT]))
    assert first
    assert polled.read(address, bytes([REGISTER_COMPACT])) == first
    assert polled.read(address) == b""


def test_nothing_is_coded_for_those_who_do_not_ask(polled):
    address = ADDRESSES[0]
    assert polled.read(address)
    polled.world.run(11.0)
    assert polled.read(address) == b""
    polled.world.run(0.05)
    assert polled.read(address)
