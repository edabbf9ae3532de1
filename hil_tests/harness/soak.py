"""Hours of virtual time with random faults: every frame that is missing must be explained by a fault that struck then.

What is missing is seen from the outside, in the frames alone: gaps in a board's poll cycles, in which it had something
new. What was injected, and when, is known here. The two meet in `Soak._explain`.
"""

import itertools
import random
import resource
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hil_tests.harness.soak_faults import KINDS
from taxel.hand import Hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link.virtual import VirtualWorld
from taxel.stream.decoder import HUB_RESTARTED, Batch, StreamDecoder
from taxel_protocol import PROTOCOL_VERSION, PROTOCOL_VERSION_MIN, Command, FrameType, encode_frame
from taxel_protocol.frames import CommandPayload, HostHandshake
from taxel_protocol.layout import pack

STEP_COUNTS: Final = 100
LARGEST_BASE: Final = 1000
FORGOTTEN_S: Final = 60.0
CHUNK_S: Final = 0.5
PRESS_S: Final = 600.0
STEPS_MAX: Final = 600
BEGIN_S: Final = 1.0
"""Before that boards are being found: cycles are short, and polls often meet a scan that is not new."""
RECOVERY_S: Final = 0.03
"""Bus recovery, identifying a board and writing its settings anew."""
CYCLES_BACK: Final = 2
WRAP_US: Final = 2**32


@dataclass
class Fault:
    """One fault: its kind, whom it may cost frames, when it was armed, and when it is over."""

    kind: str
    scope: str
    address: int
    begun_s: float
    over_s: float


@dataclass
class SoakReport:
    """What came of it. unexplained: gaps without a fault. wrong: frames with a count that was never shown."""

    seconds: float = 0.0
    frames: int = 0
    lost: int = 0
    wrong: int = 0
    injected: Counter[str] = field(default_factory=Counter)
    cost: Counter[str] = field(default_factory=Counter)
    unexplained: list[str] = field(default_factory=list)
    memory_mb: list[float] = field(default_factory=list)

    @property
    def growth(self) -> float:
        """Peak memory at the end over that after the first tenth."""
        early = self.memory_mb[len(self.memory_mb) // 10] if self.memory_mb else 1.0
        return self.memory_mb[-1] / early if self.memory_mb else 1.0


class Soak:
    """A skin, its host, and what goes wrong. `run` may be called again and goes on."""

    def __init__(self, hand: Hand, seed: int, mean_gap_s: float = 6.0) -> None:
        self._hand, self._random = hand, random.Random(f"soak {seed}")
        self._gap_s = mean_gap_s
        self.world = VirtualWorld(format_world(hand, WorldSettings(seed=seed, usb_latency_ms=1.0)), counts=True)
        self._decoder = StreamDecoder()
        self._base = np.random.default_rng(seed).integers(1, STEP_COUNTS, hand.n_taxels) + LARGEST_BASE
        places = np.arange(hand.n_taxels)
        self._places = {board.address: places[hand.get_slice(board.address)] for board in hand.boards}
        self._step = 0
        self._sequence = 0
        self._hub_booted_s = 0.0
        self._last: dict[int, tuple[int, int, float]] = {}
        self._faults: deque[Fault] = deque()
        self._next_fault_s = 2.0
        self._steps: list[tuple[float, str, int, float, float]] = []
        self._next_press_s = PRESS_S
        self._strikes_seen = 0
        self.report = SoakReport()
        self.world.press(self._base)

    def run(self, seconds: float, show: Callable[[float, float], None] = lambda done, of: None) -> SoakReport:
        """Go on for so many world seconds. show: told how far it has come."""
        begun_s = self.world.now_s
        end_s, sampled_s = begun_s + seconds, begun_s
        self._handshake()
        while (now_s := self.world.now_s) < end_s - 1e-9:
            self._run_until(min(end_s, now_s + CHUNK_S))
            if self.world.now_s - sampled_s >= seconds / 100:
                sampled_s = self.world.now_s
                self.report.memory_mb.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
                show(self.world.now_s - begun_s, seconds)
        self.report.seconds += seconds
        return self.report

    def _run_until(self, until_s: float) -> None:
        while True:
            due_s = min(until_s, self._next_fault_s, self._next_press_s, *(step[0] for step in self._steps))
            self.world.run(max(due_s - self.world.now_s, 0.0))
            now_s = self.world.now_s + 1e-9
            self._take()
            for step in [step for step in self._steps if step[0] <= now_s]:
                self._steps.remove(step)
                self.world.inject(*step[1:])
            if self._next_press_s <= now_s:
                self._next_press_s += PRESS_S
                self._step = min(self._step + 1, STEPS_MAX)
                self.world.press(self._base + STEP_COUNTS * self._step)
            if self._next_fault_s <= now_s:
                self._begin_fault()
            if until_s <= now_s:
                return

    def _begin_fault(self) -> None:
        kind, scope, steps_of, lasts_s = self._random.choice(KINDS)
        address = self._random.choice([board.address for board in self._hand.boards])
        begun_s, steps = self.world.now_s, steps_of(self._random)
        for after_s, fault, value, second in steps:
            target = 0 if scope in {"wire", "hub"} or fault in {"mute_host", "up_delay", "hub_stall"} else address
            self._steps.append((begun_s + after_s, fault, target, float(value), float(second)))
        self.blame(kind, scope, address, steps[-1][0] + lasts_s)
        self.report.injected[kind] += 1
        self._next_fault_s = begun_s + steps[-1][0] + self._random.expovariate(1.0 / self._gap_s)

    def blame(self, kind: str, scope: str, address: int, lasts_s: float) -> None:
        """From now on, for so long, this fault explains what is missing."""
        now_s = self.world.now_s
        self._faults.append(Fault(kind, scope, address, now_s, now_s + lasts_s))
        while self._faults and self._faults[0].over_s < now_s - FORGOTTEN_S:
            self._faults.popleft()

    def _send(self, frame_type: FrameType, payload: bytes) -> None:
        self.world.send(encode_frame(frame_type, self._sequence, payload))
        self._sequence = (self._sequence + 1) % 65536

    def _handshake(self) -> None:
        handshake = {"tag": 1, "version_min": PROTOCOL_VERSION_MIN, "version_max": PROTOCOL_VERSION}
        self._send(FrameType.HOST_HANDSHAKE, pack(HostHandshake, handshake))
        self._send(FrameType.COMMAND, pack(CommandPayload, {"tag": 2, "command": int(Command.START)}))

    def _take(self) -> None:
        while data := self.world.receive():
            for batch in self._decoder.push(data):
                self._take_batch(batch)

    def _take_batch(self, batch: Batch) -> None:
        """Frames before a restart of the hub and after it are of two counts."""
        restarts = batch.message_rows["stream_position"][(batch.message_rows["flags"] & HUB_RESTARTED) != 0]
        cuts = [0, *np.searchsorted(batch.taxel_rows["stream_position"], restarts).tolist(), len(batch.taxel_rows)]
        starts = [0, *np.cumsum(batch.taxel_rows["size"].astype(int)).tolist()]
        for part, (first, last) in enumerate(itertools.pairwise(cuts)):
            if part:
                self._note_restart()
            self._take_frames(batch.taxel_rows[first:last], batch.counts[starts[first] : starts[last]])

    def _note_restart(self) -> None:
        """The hub counts from 0 again; when it booted stands in the log of faults."""
        for strike in self.world.strikes(self._strikes_seen):
            self._strikes_seen += 1
            if strike.address == 0:
                self._hub_booted_s = strike.time_s  # of the strikes without a board, those of the hub come last here
        self._last = {address: (-1, -1, time_s) for address, (_, _, time_s) in self._last.items()}
        self._handshake()

    def _take_frames(self, rows: NDArray[np.void], counts: NDArray[np.uint16]) -> None:
        if not len(rows):
            return
        addresses = rows["address"].tolist()
        self._check_counts(counts, addresses)
        columns = (rows[name].tolist() for name in ("cycle", "board_sequence", "hub_time_us"))
        for address, cycle, sequence, hub_time_us in zip(addresses, *columns, strict=True):
            self._account(address, cycle, sequence, hub_time_us)
        self.report.frames += len(addresses)

    def _check_counts(self, counts: NDArray[np.uint16], addresses: list[int]) -> None:
        index = np.concatenate([self._places[a] for a in addresses])
        difference = counts.astype(int) - self._base[index]
        bad = (difference % STEP_COUNTS != 0) | (difference < 0) | (difference > STEP_COUNTS * self._step)
        if bad.any():
            ends = np.cumsum([len(self._places[a]) for a in addresses])
            self.report.wrong += len(np.unique(np.searchsorted(ends, np.flatnonzero(bad), side="right")))

    def _account(self, address: int, cycle: int, sequence: int, hub_time_us: int) -> None:
        time_s = self._world_time(hub_time_us)
        before = self._last.get(address)
        self._last[address] = (cycle, sequence, time_s)
        if before is None or time_s < BEGIN_S:
            return
        last_cycle, last_sequence, last_s = before
        if last_cycle < 0:  # the hub has started anew between: frames between are of no cycle
            self._explain(address, last_s, time_s, 1)
            return
        steps = min((cycle - last_cycle) % 65536, (sequence - last_sequence) % 65536)
        if steps > 1:
            self._explain(address, last_s, time_s, steps - 1)

    def _world_time(self, hub_time_us: int) -> float:
        elapsed_us = (self.world.now_s - self._hub_booted_s) * 1e6
        wraps = round((elapsed_us - hub_time_us) / WRAP_US)
        return self._hub_booted_s + (hub_time_us + wraps * WRAP_US) / 1e6

    def _explain(self, address: int, last_s: float, back_s: float, lost: int) -> None:
        """A fault explains a gap if it may cost this board frames, struck in it, and was over just before its end."""
        self.report.lost += lost
        patience_s = RECOVERY_S + (CYCLES_BACK + 1) * 0.06
        for fault in reversed(self._faults):
            concerns = fault.scope != "board" or fault.address == address
            meets = fault.begun_s <= back_s and last_s <= fault.over_s + patience_s
            if concerns and meets and back_s <= fault.over_s + patience_s:
                self.report.cost[fault.kind] += lost
                return
        self.report.unexplained.append(
            f"board 0x{address:02X}: {lost} frames between {last_s:.3f} and {back_s:.3f} s; last faults: "
            + ", ".join(f"{f.kind} 0x{f.address:02X} {f.begun_s:.3f}..{f.over_s:.3f}" for f in list(self._faults)[-3:])
        )
