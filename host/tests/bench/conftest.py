"""Fixtures for the tests of the board test: emulated boards on a bench, and a short plan."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from importlib import resources
from urllib.parse import quote

import pytest

from taxel.hand import load_hand
from taxel.link.virtual import VirtualWorld, uart
from taxel_tools.bench import running
from taxel_tools.bench.board_under_test import BoardUnderTest, open_board
from taxel_tools.bench.probe.emulated import EmulatedProbe
from taxel_tools.open_wire import EmulatedBench
from taxel_tools.testing.operator import NoOperator
from taxel_tools.testing.plan import Plan, parse_plan
from taxel_tools.testing.record import PhaseRecord, TestRecord

ADDRESS = 0x2C
"""Kind medial_front with 27 taxels, the smallest board."""
SHORT_DURATIONS = {"seconds = 13.0": "seconds = 3.0", "steps = 12": "steps = 4", "taxels = 10": "taxels = 2"}


@pytest.fixture(autouse=True)
def poll_emulated_links_slowly(monkeypatch):
    """Emulated links are read every 30 ms, which saves two thirds of the computing time."""
    monkeypatch.setattr(uart, "STEP_S", 0.03)


def make_bench_url(*lines: str, address: int = ADDRESS, wire: str = "hub", seed: int = 1) -> str:
    """Create the URL of an emulated bench with one board, and additional lines of its world file."""
    return f"emulator:?hand=allegro&board=0x{address:02X}&wire={wire}&seed={seed}" + "".join(
        f"&word={quote(line)}" for line in lines
    )


def make_short_plan(*phases: str, **replacements: str) -> Plan:
    """Create the default plan with shorter durations.

    phases: only these and the merging phase; none for all phases. replacements: further texts of the plan and their
    replacements.
    """
    text = (resources.files("taxel_tools.bench") / "plans" / "default.toml").read_text()
    for old, new in (SHORT_DURATIONS | replacements).items():
        assert old in text
        text = text.replace(old, new)
    plan = parse_plan(text.encode(), "short.toml")
    return running.select_phases(plan, phases) if phases else plan


@dataclass
class Bench:
    """An emulated board on a bench."""

    emulated: EmulatedBench
    board: BoardUnderTest

    @property
    def world(self) -> VirtualWorld:
        return self.emulated.world

    @property
    def emulated_probe(self) -> EmulatedProbe:
        """A probe on the emulated board, independent of the probe of the test."""
        return EmulatedProbe(self.world, self.board.kind, 0, 0.005)

    def run(self, plan: Plan, report: Callable[[str, float], None] = lambda phase, fraction: None) -> TestRecord:
        """Run a test plan on the board, and return its record."""
        return running.run_board_test(plan, self.board, running.RecordLabels("T-1", "tester", "bench"), report)


@pytest.fixture
def benches() -> Iterator[Callable[..., Bench]]:
    """Factory of benches; the emulated probe is used unless `probe` names another one."""
    with ExitStack() as stack:

        def make(*lines: str, probe: str | None = None, **options) -> Bench:
            """Create a bench with an emulated board.

            lines: additional lines of its world file. probe: URL of the probe. options: of `make_bench_url`.
            """
            wire, emulated = stack.enter_context(running.open_bench(make_bench_url(*lines, **options)))
            board = open_board(wire, options.get("address", ADDRESS), load_hand("allegro"))
            board.draws_pictures = False
            board.probe = running.open_probe(probe, board, emulated, NoOperator())
            return Bench(emulated, board)

        yield make


def list_faults(record: TestRecord) -> list[tuple[str, str]]:
    """List the faults and places, in order of decreasing severity."""
    return [(finding.fault, finding.place) for finding in record.findings()]


def find_phase(record: TestRecord, name: str) -> PhaseRecord:
    """Find the record of a phase."""
    return next(phase for phase in record.phases if phase.name == name)


def find_value(record: TestRecord, phase: str, measurement: str, location: str = "") -> float | str | None:
    """Find the value of a measurement of a phase.

    location: place of the measurement; "" for the first measurement with this name.
    """
    return next(
        measurement_record.value
        for measurement_record in find_phase(record, phase).measurements
        if (measurement_record.name, measurement_record.place) == (measurement, location or measurement_record.place)
    )
