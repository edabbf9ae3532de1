"""Compact frames against the entropy of what they say, and the rate that the I2C bus then allows.

python tools/compact/entropy.py                     noise of 1.5, 4, 10 and 28 counts, and a recording with touches
python tools/compact/entropy.py --seconds 4         shorter

The boards are emulated ones with the firmware's own coder, polled 60 times a second; candidates are acknowledged in the
next cycle but one. "entropy" is, for noise, that of a rounded normal deviate of known mean and standard deviation; for
the recording, what the best of 48 predictors of the coder's class would take, chosen in hindsight, learning from every
frame at once, without rounding and without whole bytes. "coded" are all bytes between header and CRC.
"""

import argparse
from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np
from ideal import WARM_UP, noise_entropy, recording_entropy

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
from taxel_protocol.registers import compact_size

SIGMAS = (1.5, 4.0, 10.0, 28.0)
RATE_HZ = 60.0
SEED = 20
READ_SIZE = 260
BUS_HZ = 4e6
"""Fast enough that polling with reads of fixed size fits a cycle; what is coded does not depend on it."""

POLL_BYTES = 2
"""Beside the snapshot: address, length."""

ANSWER_BYTES = 4
"""Address, register, name."""

CYCLE_BYTES = 7 + 2 + 4
"""Once a cycle: a board's clock, the pointer that this moved, probes of four addresses."""

CLOCKS_PER_BYTE = 9
CONDITION_CLOCKS = 2
"""A start and a stop condition."""

PLAIN_BYTES = 11
"""A poll of a plain snapshot beside its counts."""


class _Fed:
    """A link that gives what it was fed."""

    name, baud, is_recorded, is_real_time, holds_back = "emulated boards", 1e6, True, False, False

    def __init__(self) -> None:
        self.waiting: deque[bytes] = deque()

    def read(self, timeout_s: float) -> Chunk | None:
        """The next piece."""
        return Chunk(self.waiting.popleft(), 0) if self.waiting else None

    def write(self, data: bytes) -> None:
        """Nothing is asked of it."""

    def close(self) -> None:
        """Nothing to close."""


@dataclass
class Tally:
    """Bytes on the bus by kind, over `cycles` cycles; `counts` holds the decoded counts of each."""

    cycles: int = 0
    snapshots: int = 0
    coded: int = 0
    packed: int = 0
    heads: int = 0
    answers: int = 0
    counts: list[np.ndarray] = field(default_factory=list)

    def clocks(self, boards: int) -> float:
        """Bus clocks of a cycle."""
        polls = self.coded + self.packed + self.heads + POLL_BYTES * self.snapshots + ANSWER_BYTES * self.answers
        conditions = CONDITION_CLOCKS * (boards + 6 + self.answers / self.cycles)
        return CLOCKS_PER_BYTE * (polls / self.cycles + CYCLE_BYTES) + conditions


class Skin:
    """Emulated boards, polled at register A0."""

    def __init__(self, world: VirtualWorld, hand: Hand) -> None:
        self.world, self.hand = world, hand
        self.sizes = {board.address: board.kind.taxel_count for board in hand.boards}
        self.link = _Fed()
        self.stream = FrameStream(self.link, lambda message: None, on_acknowledgements=self._take)
        self._answers: deque[dict[int, bytes]] = deque([{}, {}])
        self._sequence = 0

    def _take(self, payload: bytes) -> None:
        for i in range(0, len(payload), 3):
            forget = payload[i] & ACKNOWLEDGE_FORGET
            self._answers[-1][payload[i] & 0x7F] = b"\0" if forget else payload[i + 1 : i + 3]

    def cycle(self, number: int, tally: Tally | None) -> None:
        """Poll every board once; what it costs goes into `tally`."""
        answers = self._answers.popleft()
        self._answers.append({})
        for address, size in self.sizes.items():
            if address in answers:
                self.world.transfer(address, bytes([REGISTER_COMPACT]) + answers[address], 0)
            write = bytes([REGISTER_COMPACT]) if number == 0 else b""
            result, data = self.world.transfer(address, write, READ_SIZE)
            frame = data[1 : 1 + compact_size(data[0])] if not result else b""
            if frame:
                head = bytes([address, size]) + (number % 65536).to_bytes(2, "little") + bytes(4)
                wire = encode_frame(FrameType.COMPACT_TAXELS, self._sequence % 65536, head + frame)
                self.link.waiting.append(wire)
                self._sequence += 1
            if tally is not None:
                self._count(tally, frame, address in answers)
        while self.link.waiting:
            self.stream.poll(0.0)
        if tally is not None:
            tally.cycles += 1
            if len(self.stream.frames) == len(self.sizes):
                tally.counts.append(np.concatenate([frame.raw_counts for frame in self.stream.frames]))
        self.stream.frames.clear()

    @staticmethod
    def _count(tally: Tally, frame: bytes, answered: bool) -> None:
        tally.answers += answered
        tally.snapshots += 1
        if not frame:
            return
        packed = bool(frame[2] & COMPACT_WIDTH_MASK)
        overhead = COMPACT_OVERHEAD_PACKED if packed else COMPACT_OVERHEAD_DELTA
        tally.heads += overhead
        if packed:
            tally.packed += len(frame) - overhead
        else:
            tally.coded += len(frame) - overhead


def measure(hand: Hand, noise: float, seconds: float, touched: bool) -> Tally:
    """Poll a skin of that noise for so long, after WARM_UP cycles; `touched`: seven presses, one a second."""
    settings = WorldSettings(seed=SEED, noise_counts=noise, scl_hz=BUS_HZ)
    presses = [replace(p, start_s=p.start_s - DEMO_CONTACTS[0].start_s) for p in DEMO_CONTACTS]
    times, forces = compute_indentation_forces(hand, presses)
    tally = Tally()
    with VirtualWorld(format_world(hand, settings), "none") as world:
        world.run(0.5)
        skin = Skin(world, hand)
        begin = world.now_s
        cycles = WARM_UP + round(seconds * RATE_HZ)
        for number in range(cycles):
            now = number / RATE_HZ - (WARM_UP + 6) / RATE_HZ
            if touched:
                world.press(np.array([np.interp(now, times, forces[:, i]) for i in range(hand.n_taxels)]))
            skin.cycle(number, tally if number >= WARM_UP else None)
            world.run(max(begin + (number + 1) / RATE_HZ - world.now_s, 0.0))
        if skin.stream.losses.undecoded_frames:
            raise SystemExit(f"undecoded frames: {skin.stream.losses.undecoded_frames}")
    return tally


def report(name: str, hand: Hand, tally: Tally, entropy: float) -> str:
    """One line of the table."""
    sent = tally.coded + tally.packed
    bits = 8.0 * sent / (tally.cycles * hand.n_taxels)
    boards = len(hand.boards)
    clocks = tally.clocks(boards)
    rates = " ".join(f"{scl / clocks:8.1f}" for scl in (4e5, 1e6))
    total = (sent + tally.heads + POLL_BYTES * tally.snapshots + ANSWER_BYTES * tally.answers) / tally.cycles
    return (
        f"{name:14} {entropy:8.3f} {bits:8.3f} {bits / entropy:7.3f} {total:11.1f} {rates} "
        f"{tally.answers / tally.cycles:8.2f} {100 * tally.packed / sent:7.1f}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=8.0, help="virtual seconds of each row (8)")
    seconds = parser.parse_args().seconds
    hand = load_hand("allegro")
    plain = sum(PLAIN_BYTES + 2 * board.kind.taxel_count for board in hand.boards)
    print(f"seed {SEED}, {len(hand.boards)} boards, {hand.n_taxels} taxels, {seconds:g} s at {RATE_HZ:g} Hz")
    print(f"plain: {plain} bytes a cycle")
    print("noise, counts   entropy    coded   ratio  bytes/cycle  400 kHz    1 MHz  answers packed %")
    for sigma in SIGMAS:
        tally = measure(hand, sigma, seconds, touched=False)
        print(report(f"{sigma:g}", hand, tally, noise_entropy(sigma)), flush=True)
    for sigma in SIGMAS[:2]:
        tally = measure(hand, sigma, seconds, touched=True)
        entropy = recording_entropy(np.array(tally.counts, dtype=np.int64))
        print(report(f"{sigma:g}, touched", hand, tally, entropy), flush=True)


if __name__ == "__main__":
    main()
