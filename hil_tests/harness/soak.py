"""Soak test: hours of virtual time with random faults. Each missing frame must be explained by an injected fault.

Missing frames are detected only from the received frames: gaps in the poll cycles of a board during which the board had
a new scan. `Soak._attribute_gap` compares each gap with the times of the injected faults.
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

from hil_tests.harness.frame_checks import STEP_COUNTS, sample_base_counts
from hil_tests.harness.soak_faults import KINDS, KINDS_WITHOUT_HUB
from taxel.hand import Hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link.virtual import VirtualMasterWorld, VirtualWorld
from taxel.stream.decoder import HUB_RESTARTED, Batch, StreamDecoder
from taxel_protocol import PROTOCOL_VERSION, PROTOCOL_VERSION_MIN, Command, FrameType, encode_frame
from taxel_protocol.frames import CommandPayload, HostHandshake
from taxel_protocol.layout import pack

FAULT_MEMORY_S: Final = 60.0
"""Time after its end for which a fault is kept to explain gaps, seconds."""
CHUNK_S: Final = 0.5
COUNT_STEP_PERIOD_S: Final = 600.0
"""Time between two steps of the raw counts, seconds."""
STEPS_MAX: Final = 600
"""Largest number of steps, so that the raw counts stay within 16 bits."""
DISCOVERY_S: Final = 1.0
"""Gaps in this time after the start are ignored: cycles are short while the hub discovers the boards, so many polls
meet a scan that is not new.
"""
RECOVERY_S: Final = 0.03
"""Time to recover the bus, identify a board and write its settings, seconds."""
CYCLES_BACK: Final = 2
"""Cycles after the end of a fault in which the first frame of the board must arrive."""
CYCLE_S: Final = 0.06
"""Assumed duration of a poll cycle, seconds."""
WRAP_US: Final = 2**32
"""Time after which the hub's clock in a frame wraps, microseconds."""
HUB_FAULTS: Final = frozenset({"mute_host", "up_delay", "hub_stall"})
"""Faults of hub and UART, not of a board, among the kinds of faults with the scope "bus" (`soak_faults.FaultKind`)."""


@dataclass
class Fault:
    """An injected fault: its kind, its scope (frames that it may cost, `soak_faults.FaultKind`), the I2C address of its
    board, and its start and end on the world's clock.
    """

    kind: str
    scope: str
    address: int
    start_s: float
    end_s: float


@dataclass
class SoakReport:
    """Result of a soak.

    seconds: virtual time of the soak. frames: received frames. lost: missing frames. wrong: frames with a count that
    was never set. injected, cost: number of faults, and of missing frames, for each kind. unexplained: one line for
    each gap without a fault. memory_mb: peak memory after each hundredth of the soak, in MiB.
    """

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
        """Ratio of the peak memory at the end to the peak memory after the first tenth; 1 without samples."""
        early = self.memory_mb[len(self.memory_mb) // 10] if self.memory_mb else 1.0
        return self.memory_mb[-1] / early if self.memory_mb else 1.0


class Soak:
    """An emulated skin with random faults, and its host. A second call of `run` continues the soak."""

    def __init__(self, hand: Hand, seed: int, mean_gap_s: float = 6.0, has_hub: bool = True) -> None:
        """Create an emulated skin for a long test with random faults.

        seed: seed of the faults and of the counts. mean_gap_s: mean virtual time between two faults, in seconds.
        has_hub: False: a Linux hub polls the boards through an I2C adapter.
        """
        self._hand, self._random = hand, random.Random(f"soak {seed}")
        self._mean_gap_s = mean_gap_s
        text = format_world(hand, WorldSettings(seed=seed, usb_latency_ms=1.0))
        self._kinds = KINDS if has_hub else KINDS_WITHOUT_HUB
        self.world = VirtualWorld(text, counts=True) if has_hub else VirtualMasterWorld(text, counts=True)
        self._decoder = StreamDecoder()
        self._base = sample_base_counts(hand.n_taxels, seed)
        indices = np.arange(hand.n_taxels)
        self._taxel_indices = {board.address: indices[hand.get_slice(board.address)] for board in hand.boards}
        self._step = 0
        self._sequence = 0
        self._hub_boot_s = 0.0
        self._last: dict[int, tuple[int, int, float]] = {}
        self._faults: deque[Fault] = deque()
        self._next_fault_s = 2.0
        self._scheduled: list[tuple[float, str, int, float, float]] = []
        self._next_count_step_s = COUNT_STEP_PERIOD_S
        self._n_events_read = 0
        self.report = SoakReport()
        self.world.set_stimulus(self._base)

    def run(
        self, seconds: float, show_progress: Callable[[float, float], None] = lambda elapsed_s, total_s: None
    ) -> SoakReport:
        """Run the emulated skin and its random faults for another `seconds` of virtual time. Returns the report.

        show_progress: called with the elapsed and the total time of this call in seconds.
        """
        start_s = self.world.now_s
        end_s, sampled_s = start_s + seconds, start_s
        self._send_handshake()
        while (now_s := self.world.now_s) < end_s - 1e-9:
            self._run_until(min(end_s, now_s + CHUNK_S))
            if self.world.now_s - sampled_s >= seconds / 100:
                sampled_s = self.world.now_s
                self.report.memory_mb.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
                show_progress(self.world.now_s - start_s, seconds)
        self.report.seconds += seconds
        return self.report

    def _run_until(self, until_s: float) -> None:
        """Run the emulated skin to a virtual time in seconds: receive frames, inject planned faults, and change raw
        counts when due.
        """
        while True:
            next_s = min(until_s, self._next_fault_s, self._next_count_step_s, *(step[0] for step in self._scheduled))
            self.world.run(max(next_s - self.world.now_s, 0.0))
            now_s = self.world.now_s + 1e-9
            self._receive()
            for step in [step for step in self._scheduled if step[0] <= now_s]:
                self._scheduled.remove(step)
                self.world.inject(*step[1:])
            if self._next_count_step_s <= now_s:
                self._next_count_step_s += COUNT_STEP_PERIOD_S
                self._step = min(self._step + 1, STEPS_MAX)
                self.world.set_stimulus(self._base + STEP_COUNTS * self._step)
            if self._next_fault_s <= now_s:
                self._start_fault()
            if until_s <= now_s:
                return

    def _start_fault(self) -> None:
        """Sample a random fault, plan its steps, and sample the time of the fault after it."""
        kind = self._random.choice(self._kinds)
        address = self._random.choice([board.address for board in self._hand.boards])
        start_s, steps = self.world.now_s, kind.sample_steps(self._random)
        for delay_s, fault, value, second_value in steps:
            is_of_hub = kind.scope in {"wire", "hub"} or fault in HUB_FAULTS
            target = 0 if is_of_hub else address
            self._scheduled.append((start_s + delay_s, fault, target, float(value), float(second_value)))
        last_step_s = steps[-1][0]
        self.record_fault(kind.name, kind.scope, address, last_step_s + kind.duration_s)
        self.report.injected[kind.name] += 1
        self._next_fault_s = start_s + last_step_s + self._random.expovariate(1.0 / self._mean_gap_s)

    def record_fault(self, kind: str, scope: str, address: int, duration_s: float) -> None:
        """Record a fault that begins now and lasts `duration_s` seconds. Frames that are missing in this time
        are attributed to the fault.

        kind: name of the fault in the report. scope: frames that the fault may cost, such as "board", "bus" or "wire".
        address: board with the fault.
        """
        now_s = self.world.now_s
        self._faults.append(Fault(kind, scope, address, now_s, now_s + duration_s))
        while self._faults and self._faults[0].end_s < now_s - FAULT_MEMORY_S:
            self._faults.popleft()

    def _send(self, frame_type: FrameType, payload: bytes) -> None:
        """Send a frame from the host to the emulated hub."""
        self.world.send(encode_frame(frame_type, self._sequence, payload))
        self._sequence = (self._sequence + 1) % 65536

    def _send_handshake(self) -> None:
        """Send a handshake to the hub, and the command that starts the stream of frames."""
        handshake = {"tag": 1, "version_min": PROTOCOL_VERSION_MIN, "version_max": PROTOCOL_VERSION}
        self._send(FrameType.HOST_HANDSHAKE, pack(HostHandshake, handshake))
        self._send(FrameType.COMMAND, pack(CommandPayload, {"tag": 2, "command": int(Command.START)}))

    def _receive(self) -> None:
        """Decode all bytes that the emulated hub has sent, and check the frames and messages in them."""
        while data := self.world.receive():
            for batch in self._decoder.push(data):
                self._process_batch(batch)

    def _process_batch(self, batch: Batch) -> None:
        """Process the decoded frames before and after each restart of the hub separately, because the numbers of poll
        cycles and the hub's clock begin again at 0.
        """
        restarts = batch.message_rows["stream_position"][(batch.message_rows["flags"] & HUB_RESTARTED) != 0]
        cuts = [0, *np.searchsorted(batch.taxel_rows["stream_position"], restarts).tolist(), len(batch.taxel_rows)]
        starts = [0, *np.cumsum(batch.taxel_rows["size"].astype(int)).tolist()]
        for part, (first, last) in enumerate(itertools.pairwise(cuts)):
            if part:
                self._process_restart()
            self._process_frames(batch.taxel_rows[first:last], batch.counts[starts[first] : starts[last]])

    def _process_restart(self) -> None:
        """Process a restart of the hub: read the time at which it booted from the log of faults, and repeat the
        handshake. The last numbers of each board become -1: unknown, because the hub counts from 0 again.
        """
        for event in self.world.read_faults(self._n_events_read):
            self._n_events_read += 1
            if event.address == 0:
                self._hub_boot_s = event.time_s  # a restart is the last event without a board
        self._last = {address: (-1, -1, time_s) for address, (_, _, time_s) in self._last.items()}
        self._send_handshake()

    def _process_frames(self, rows: NDArray[np.void], counts: NDArray[np.uint16]) -> None:
        """Check the counts of received taxel frames and the gaps between them. rows: one per frame; counts: raw
        counts of all frames, one frame after the other.
        """
        if not len(rows):
            return
        addresses = rows["address"].tolist()
        self._check_counts(counts, addresses)
        columns = (rows[name].tolist() for name in ("cycle", "board_sequence", "hub_time_us"))
        for address, cycle, sequence, hub_time_us in zip(addresses, *columns, strict=True):
            self._check_gap(address, cycle, sequence, hub_time_us)
        self.report.frames += len(addresses)

    def _check_counts(self, counts: NDArray[np.uint16], addresses: list[int]) -> None:
        """Add to the report the number of frames with a raw count that was never set on the emulated taxel.

        counts: of all frames, one frame after the other. addresses: I2C address of the board of each frame.
        """
        index = np.concatenate([self._taxel_indices[address] for address in addresses])
        difference = counts.astype(int) - self._base[index]
        is_wrong = (difference % STEP_COUNTS != 0) | (difference < 0) | (difference > STEP_COUNTS * self._step)
        if is_wrong.any():
            ends = np.cumsum([len(self._taxel_indices[address]) for address in addresses])
            self.report.wrong += len(np.unique(np.searchsorted(ends, np.flatnonzero(is_wrong), side="right")))

    def _check_gap(self, address: int, cycle: int, sequence: int, hub_time_us: int) -> None:
        """Compare a frame with the previous frame of its board and explain the missing frames between them.

        cycle: poll cycle of the hub; sequence: number of the board's scan, both modulo 65536. A frame is missing only
        if both numbers are skipped, because a poll without a new scan gives no frame.
        """
        time_s = self._convert_hub_time(hub_time_us)
        before = self._last.get(address)
        self._last[address] = (cycle, sequence, time_s)
        if before is None or time_s < DISCOVERY_S:
            return
        last_cycle, last_sequence, last_s = before
        if last_cycle < 0:  # the hub has restarted: the number of missing frames is unknown, at least one
            self._attribute_gap(address, last_s, time_s, 1)
            return
        steps = min((cycle - last_cycle) % 65536, (sequence - last_sequence) % 65536)
        if steps > 1:
            self._attribute_gap(address, last_s, time_s, steps - 1)

    def _convert_hub_time(self, hub_time_us: int) -> float:
        """Convert a time of the hub's clock (microseconds since its boot, modulo 2^32) to virtual time in seconds."""
        elapsed_us = (self.world.now_s - self._hub_boot_s) * 1e6
        wraps = round((elapsed_us - hub_time_us) / WRAP_US)
        return self._hub_boot_s + (hub_time_us + wraps * WRAP_US) / 1e6

    def _attribute_gap(self, address: int, last_s: float, back_s: float, lost: int) -> None:
        """Attribute missing frames of a board to a fault, or report them as unexplained.

        address: I2C address of the board. last_s, back_s: times of the frames before and after the gap. lost:
        number of missing frames. The fault must be able to cost frames of this board and be active within the gap
        or just before its end.
        """
        self.report.lost += lost
        tolerance_s = RECOVERY_S + (CYCLES_BACK + 1) * CYCLE_S
        for fault in reversed(self._faults):
            concerns_board = fault.scope != "board" or fault.address == address
            latest_s = fault.end_s + tolerance_s
            if concerns_board and fault.start_s <= back_s and last_s <= latest_s and back_s <= latest_s:
                self.report.cost[fault.kind] += lost
                return
        self.report.unexplained.append(
            f"board 0x{address:02X}: {lost} frames between {last_s:.3f} and {back_s:.3f} s; last faults: "
            + ", ".join(f"{f.kind} 0x{f.address:02X} {f.start_s:.3f}..{f.end_s:.3f}" for f in list(self._faults)[-3:])
        )
