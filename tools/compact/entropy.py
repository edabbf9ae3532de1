"""Size of compact frames compared with the entropy of their counts, and the resulting rate on the I2C bus.

python tools/compact/entropy.py                     noise of 1.5, 4, 10 and 28 counts, without and with contacts
python tools/compact/entropy.py --seconds 4         a shorter measurement

Emulated boards with the firmware's own coder are polled 60 times per second. Key frames are acknowledged two cycles
later. Columns: "entropy" is, for noise, the entropy of a rounded normal deviate with known mean and standard deviation;
with contacts, the cost of the best of 48 predictors of the coder's class, selected in hindsight, which are updated by
every frame without delay, rounding and padding to bytes. "coded" counts all bytes between header and CRC.
"""

import argparse
from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np
from ideal import WARM_UP, compute_noise_entropy, compute_recording_entropy

from taxel.demonstration import DEMO_CONTACTS
from taxel.hand import Hand, load_hand
from taxel.hand.indentation import compute_indentation_forces
from taxel.hand.world import WorldSettings, format_world
from taxel.link import Chunk
from taxel.link.virtual import VirtualWorld
from taxel.stream import FrameStream
from taxel_protocol import FrameType, encode_frame
from taxel_protocol.limits import (
    ACKNOWLEDGE_FORGET,
    COMPACT_OVERHEAD_DELTA,
    COMPACT_OVERHEAD_PACKED,
    COMPACT_WIDTH_MASK,
    REGISTER_COMPACT,
)
from taxel_protocol.registers import decode_length

SIGMAS = (1.5, 4.0, 10.0, 28.0)
RATE_HZ = 60.0
SEED = 20
READ_SIZE = 260
BUS_HZ = 4e6
"""Clock of the emulated bus: polls with reads of fixed size fit into a cycle. The coded bytes do not depend on it."""

POLL_BYTES = 2
"""Bytes of a poll in addition to the snapshot: address, length."""

ACKNOWLEDGE_BYTES = 4
"""Bytes of an acknowledgement: address, register, id of the key frame."""

CYCLE_BYTES = 7 + 2 + 4
"""Further bytes per cycle: clock reading of one board, its pointer write, probes of four addresses."""

FURTHER_TRANSACTIONS = 6
"""Transactions per cycle besides the polls: clock reading of one board, its pointer write, probes of four addresses."""

CLOCKS_PER_BYTE = 9
CONDITION_CLOCKS = 2
"""Clocks of a start and a stop condition."""

UNCOMPRESSED_BYTES = 11
"""Bytes of a poll of an uncompressed snapshot in addition to its counts."""


class _QueueLink:
    """Link whose received bytes come from a queue that the caller fills."""

    name, baud, is_recorded, is_real_time, has_flow_control = "emulated boards", 1e6, True, False, False

    def __init__(self) -> None:
        self.waiting: deque[bytes] = deque()

    def read(self, timeout_s: float) -> Chunk | None:
        """Read the next bytes that the caller has queued; None if there are none."""
        return Chunk(self.waiting.popleft(), 0) if self.waiting else None

    def write(self, data: bytes) -> None:
        """Discard bytes that the host sends, as there is no hub."""

    def close(self) -> None:
        """Do nothing, as there is no port to close."""


@dataclass
class Tally:
    """Bytes on the I2C bus in `cycles` poll cycles.

    snapshots: polls, with and without a new snapshot. coded, packed: bytes between header and CRC of delta frames and
    of packed frames. overhead: bytes of their headers and CRCs. acknowledgements: number of acknowledgements. counts:
    decoded raw counts of each complete cycle.
    """

    cycles: int = 0
    snapshots: int = 0
    coded: int = 0
    packed: int = 0
    overhead: int = 0
    acknowledgements: int = 0
    counts: list[np.ndarray] = field(default_factory=list)

    def count_clocks(self, boards: int) -> float:
        """Return the mean number of I2C clocks per poll cycle of a skin with `boards` boards."""
        poll_bytes = (
            self.coded
            + self.packed
            + self.overhead
            + POLL_BYTES * self.snapshots
            + ACKNOWLEDGE_BYTES * self.acknowledgements
        )
        transactions = boards + FURTHER_TRANSACTIONS + self.acknowledgements / self.cycles
        return CLOCKS_PER_BYTE * (poll_bytes / self.cycles + CYCLE_BYTES) + CONDITION_CLOCKS * transactions


class Skin:
    """Host of emulated boards, which it polls for compact snapshots at register A0."""

    def __init__(self, world: VirtualWorld, hand: Hand) -> None:
        """Connect to the boards of `hand` in `world`. Key frames are acknowledged two cycles after they arrive."""
        self.world, self.hand = world, hand
        self.sizes = {board.address: board.kind.taxel_count for board in hand.boards}
        self.link = _QueueLink()
        self.stream = FrameStream(self.link, lambda message: None, on_acknowledgements=self._queue_acknowledgements)
        self._pending: deque[dict[int, bytes]] = deque([{}, {}])
        self._sequence = 0

    def _queue_acknowledgements(self, payload: bytes) -> None:
        """Queue the acknowledgements of the frame stream, to be written to the boards two cycles later.

        payload: three bytes per board: I2C address with the bit "forget", and the two-byte id of the key frame.
        """
        for i in range(0, len(payload), 3):
            forget = payload[i] & ACKNOWLEDGE_FORGET  # the byte 0 to the board: the host has no key frame
            self._pending[-1][payload[i] & 0x7F] = b"\0" if forget else payload[i + 1 : i + 3]

    def poll_cycle(self, number: int, tally: Tally | None) -> None:
        """Write the due acknowledgements, poll every board once and decode the frames.

        number: index of the cycle; cycle 0 also selects the register. tally: receives the bytes and counts; None while
        the coder warms up.
        """
        acknowledgements = self._pending.popleft()
        self._pending.append({})
        for address, size in self.sizes.items():
            if address in acknowledgements:
                self.world.transfer(address, bytes([REGISTER_COMPACT]) + acknowledgements[address], 0)
            write = bytes([REGISTER_COMPACT]) if number == 0 else b""
            result, data = self.world.transfer(address, write, READ_SIZE)
            frame = data[1 : 1 + decode_length(data[0])] if not result else b""
            if frame:
                # Taxel header: address, number of taxels, poll cycle, and 0 for the hub time.
                head = bytes([address, size]) + (number % 65536).to_bytes(2, "little") + bytes(4)
                wire = encode_frame(FrameType.COMPACT_TAXELS, self._sequence % 65536, head + frame)
                self.link.waiting.append(wire)
                self._sequence += 1
            if tally is not None:
                self._count(tally, frame, address in acknowledgements)
        while self.link.waiting:
            self.stream.poll(0.0)
        if tally is not None:
            tally.cycles += 1
            if len(self.stream.frames) == len(self.sizes):
                tally.counts.append(np.concatenate([frame.raw_counts for frame in self.stream.frames]))
        self.stream.frames.clear()

    @staticmethod
    def _count(tally: Tally, frame: bytes, has_acknowledgement: bool) -> None:
        """Add one poll and its frame to the tally.

        frame: compact snapshot, whose byte 2 is the format byte; empty if there was no new snapshot.
        has_acknowledgement: whether an acknowledgement was written to the board before the poll.
        """
        tally.acknowledgements += has_acknowledgement
        tally.snapshots += 1
        if not frame:
            return
        is_packed = bool(frame[2] & COMPACT_WIDTH_MASK)
        overhead = COMPACT_OVERHEAD_PACKED if is_packed else COMPACT_OVERHEAD_DELTA
        tally.overhead += overhead
        if is_packed:
            tally.packed += len(frame) - overhead
        else:
            tally.coded += len(frame) - overhead


def measure(hand: Hand, noise: float, seconds: float, has_contacts: bool) -> Tally:
    """Poll an emulated skin for `seconds` after `WARM_UP` cycles and return the bytes that its compact frames take.

    noise: standard deviation in counts. has_contacts: whether the skin is touched seven times, once per second.
    """
    # Without the capacitance of branches, whose lines would rise too slowly for `BUS_HZ`.
    hand = replace(hand, wiring=None)
    settings = WorldSettings(seed=SEED, noise_counts=noise, scl_hz=BUS_HZ)
    first_s = DEMO_CONTACTS[0].start_s
    contacts = [replace(contact, start_s=contact.start_s - first_s) for contact in DEMO_CONTACTS]
    times, forces = compute_indentation_forces(hand, contacts)
    tally = Tally()
    with VirtualWorld(format_world(hand, settings), "none") as world:
        world.run(0.5)
        skin = Skin(world, hand)
        start_s = world.now_s
        cycles = WARM_UP + round(seconds * RATE_HZ)
        for number in range(cycles):
            now = number / RATE_HZ - (WARM_UP + 6) / RATE_HZ  # the contacts begin 6 cycles (0.1 s) after the warm-up
            if has_contacts:
                world.set_stimulus(np.array([np.interp(now, times, forces[:, i]) for i in range(hand.n_taxels)]))
            skin.poll_cycle(number, tally if number >= WARM_UP else None)
            world.run(max(start_s + (number + 1) / RATE_HZ - world.now_s, 0.0))
        if skin.stream.losses.undecoded_frames:
            raise SystemExit(f"undecoded frames: {skin.stream.losses.undecoded_frames}")
        if not tally.counts:
            raise SystemExit("no poll cycle with a frame of every board; check the clock rate of the emulated bus")
    return tally


def format_row(name: str, hand: Hand, tally: Tally, entropy: float) -> str:
    """Return one line of the table that compares coded bits per count with `entropy`, and gives the resulting rates."""
    sent = tally.coded + tally.packed
    bits = 8.0 * sent / (tally.cycles * hand.n_taxels)
    boards = len(hand.boards)
    clocks = tally.count_clocks(boards)
    rates = " ".join(f"{scl / clocks:8.1f}" for scl in (4e5, 1e6))
    total = (
        sent + tally.overhead + POLL_BYTES * tally.snapshots + ACKNOWLEDGE_BYTES * tally.acknowledgements
    ) / tally.cycles
    return (
        f"{name:14} {entropy:8.3f} {bits:8.3f} {bits / entropy:7.3f} {total:11.1f} {rates} "
        f"{tally.acknowledgements / tally.cycles:8.2f} {100 * tally.packed / sent:7.1f}"
    )


def main() -> None:
    """Print the size of compact frames compared with the entropy of their counts, for several noise levels."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=8.0, help="virtual seconds of each row (8)")
    seconds = parser.parse_args().seconds
    hand = load_hand("original")
    uncompressed = sum(UNCOMPRESSED_BYTES + 2 * board.kind.taxel_count for board in hand.boards)
    print(f"seed {SEED}, {len(hand.boards)} boards, {hand.n_taxels} taxels, {seconds:g} s at {RATE_HZ:g} Hz")
    print(f"uncompressed: {uncompressed} bytes per cycle")
    print("noise, counts   entropy    coded   ratio  bytes/cycle  400 kHz    1 MHz  acks/cyc packed %")
    for sigma in SIGMAS:
        tally = measure(hand, sigma, seconds, has_contacts=False)
        print(format_row(f"{sigma:g}", hand, tally, compute_noise_entropy(sigma)), flush=True)
    for sigma in SIGMAS[:2]:
        tally = measure(hand, sigma, seconds, has_contacts=True)
        entropy = compute_recording_entropy(np.array(tally.counts, dtype=np.int64))
        print(format_row(f"{sigma:g}, touched", hand, tally, entropy), flush=True)


if __name__ == "__main__":
    main()
