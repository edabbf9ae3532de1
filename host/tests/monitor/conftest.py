"""A substitute for a skin whose frames and counters a test sets, and an emulated hand on a pseudo-terminal."""

import subprocess
import tempfile
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from taxel.hand import Hand, load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link.emulator import find_emulator_program
from taxel.monitor import SkinMonitor
from taxel.stream import BoardCount, TaxelFrame

UNTOUCHED_COUNTS = 4000


@dataclass
class FakeSkin:
    """The part of a skin that a monitor uses, with frames and counters that a test sets."""

    hand: Hand
    is_real_time: bool = True
    is_recorded: bool = False
    counts: dict[int, BoardCount] = field(default_factory=dict)
    bytes_discarded: int = 0
    bytes_waiting: int = 0
    rate_hz: float | None = None
    reconnection: Any = None

    def __post_init__(self) -> None:
        self.link = SimpleNamespace(name="fake", is_real_time=self.is_real_time, is_recorded=self.is_recorded)
        boards: dict[int, dict[str, Any]] = {b.address: {} for b in self.hand.boards}
        self.hub = SimpleNamespace(status=None, boards=boards, board_status={}, seconds_since_message=float("inf"))
        self.hub.faults = deque()
        self.losses = SimpleNamespace(lost_on_wire=0, restarts=0, unknown_frames=0, boards=self.counts)
        self.raw = np.full(self.hand.n_taxels, UNTOUCHED_COUNTS, dtype=np.uint16)
        self.now_s = time.monotonic()
        self.monitor = SkinMonitor(self, samples=3)  # type: ignore[arg-type]
        self._cycle = 0

    def make_frames(self, boards: Any = None) -> list[TaxelFrame]:
        """Make one frame with the present counts `raw` for each of these boards (None: all), in the next cycle."""
        self._cycle += 1
        return [
            TaxelFrame(b.address, self._cycle, self._cycle, self.now_s, 0, 0, self.raw[self.hand.get_slice(b.address)])
            for b in (self.hand.boards if boards is None else boards)
        ]

    def pass_time(self, seconds: float, boards: Any = None, period_s: float = 0.05) -> None:
        """Pass frames of these boards (None: all) to the monitor for some seconds."""
        for _ in range(round(seconds / period_s)):
            self.now_s += period_s
            self.monitor.take(self.make_frames(boards), self.now_s)

    def read(self) -> Any:
        """Return the reading of the monitor at the present time of the fake skin."""
        return self.monitor.read(self.now_s)


@pytest.fixture
def fake_skin() -> Any:
    """A function that creates a `FakeSkin` of the hand `allegro` or another one."""

    def make(hand: str = "allegro", **options: Any) -> FakeSkin:
        return FakeSkin(load_hand(hand), **options)

    return make


@pytest.fixture
def emulated_port() -> Iterator[str]:
    """A pseudo-terminal of an emulated hand, as `taxel emulate` creates it."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        world = Path(folder) / "world.txt"
        world.write_text(format_world(load_hand("original"), WorldSettings()))
        process = subprocess.Popen(
            [find_emulator_program(), "--world", world, "--uart", "pty"], stdout=subprocess.PIPE, text=True
        )
        assert process.stdout is not None
        yield process.stdout.readline().split()[-1]
        process.terminate()
        process.wait(timeout=10)
        process.stdout.close()
