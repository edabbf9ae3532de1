"""What the tests of the board bench share: emulated boards on a bench, and a plan that takes seconds."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from importlib import resources
from urllib.parse import quote

import pytest

from taxel.hand import load_hand
from taxel.link.virtual import VirtualWorld, uart
from taxel_tools.bench import running
from taxel_tools.bench.probe.emulated import EmulatedProbe
from taxel_tools.bench.station import Station, open_station
from taxel_tools.open_wire import EmulatedBench
from taxel_tools.testing.operator import NoOperator
from taxel_tools.testing.plan import Plan, parse_plan
from taxel_tools.testing.record import PhaseRecord, TestRecord

ADDRESS = 0x2C
"""Medial front: 27 taxels, the smallest board."""
SHORTER = {"seconds = 13.0": "seconds = 3.0", "steps = 12": "steps = 4", "taxels = 10": "taxels = 2"}


@pytest.fixture(autouse=True)
def looks_seldom(monkeypatch):
    """Emulated links are looked at every 30 ms: a third of the work."""
    monkeypatch.setattr(uart, "STEP_S", 0.03)


def url_of(*words: str, address: int = ADDRESS, wire: str = "hub", seed: int = 1) -> str:
    """An emulated bench with one board, and lines of its world file."""
    return f"emulator:?board=0x{address:02X}&wire={wire}&seed={seed}" + "".join(f"&word={quote(one)}" for one in words)


def short_plan(*phases: str, **replaced: str) -> Plan:
    """The standard plan with less of everything; with phases named, only those and what names faults."""
    text = (resources.files("taxel_tools.bench") / "plans" / "default.toml").read_text()
    for old, new in (SHORTER | replaced).items():
        assert old in text
        text = text.replace(old, new)
    plan = parse_plan(text.encode(), "short.toml")
    return running.only(plan, phases) if phases else plan


@dataclass
class Bench:
    """An emulated board on the bench."""

    emulated: EmulatedBench
    station: Station

    @property
    def world(self) -> VirtualWorld:
        return self.emulated.world

    @property
    def finger(self) -> EmulatedProbe:
        """What presses the board, whoever asks for it."""
        return EmulatedProbe(self.world, self.station.kind, 0, 0.005)

    def run(self, plan: Plan, report: Callable[[str, float], None] = lambda phase, fraction: None) -> TestRecord:
        return running.test_board(plan, self.station, running.Who("T-1", "tester", "bench"), report)


@pytest.fixture
def benches() -> Iterator[Callable[..., Bench]]:
    """Opens benches; the board is pressed by the emulated probe unless `probe` says otherwise."""
    with ExitStack() as stack:

        def make(*words: str, probe: str | None = None, **options) -> Bench:
            wire, emulated = stack.enter_context(running.open_bench(url_of(*words, **options)))
            station = open_station(wire, options.get("address", ADDRESS), load_hand("allegro"))
            station.draws = False
            station.probe = running.open_probe(probe, station, emulated, NoOperator())
            return Bench(emulated, station)

        yield make


def faults_of(record: TestRecord) -> list[tuple[str, str]]:
    """Faults and places, the gravest first."""
    return [(one.fault, one.place) for one in record.findings()]


def phase_of(record: TestRecord, name: str) -> PhaseRecord:
    """One phase."""
    return next(phase for phase in record.phases if phase.name == name)


def value_of(record: TestRecord, phase: str, measurement: str, place: str = "") -> float | str | None:
    """One measurement."""
    return next(
        one.value
        for one in phase_of(record, phase).measurements
        if (one.name, one.place) == (measurement, place or one.place)
    )
