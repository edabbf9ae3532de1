"""Test of a board, from a URL and a plan to a record: opens the bus and the board, and runs the phases."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from importlib import metadata, resources
from typing import Final

from taxel.errors import TaxelError
from taxel_tools.application import get_firmware_version
from taxel_tools.bench import registry
from taxel_tools.bench.board_under_test import BoardUnderTest
from taxel_tools.bench.probe import Probe, ProbeRequest
from taxel_tools.errors import PlanError
from taxel_tools.firmware_update import format_version
from taxel_tools.open_wire import EmulatedBench, open_emulated, open_wire
from taxel_tools.scan import scan_bus
from taxel_tools.testing.engine import DeviceUnderTest, Phase, Report, RunConditions, check_plan, run_test
from taxel_tools.testing.operator import Operator
from taxel_tools.testing.plan import Plan, parse_plan
from taxel_tools.testing.record import TestRecord
from taxel_tools.wires import BoardWire

DEFAULT_PLAN: Final = "default.toml"
DEFAULT_PITCH_M: Final = 0.005
"""Pitch of taxels for a board without a hand description (thesis, conclusion: four taxels per square centimetre)."""
REST_RECORD_PHASES: Final = ("electrical", "rest", "noise", "drift")
"""Phases that share one record of the untouched board; the record has the longest duration that they request."""
MERGING_PHASE: Final = "faults"
"""The phase that reports the faults detected by the other phases; without it, a board with a short would pass."""


@dataclass(frozen=True)
class RecordLabels:
    """Labels of a test record: serial number of the board, operator, and name of the station."""

    serial_number: str
    operator: str
    station: str


def load_default_plan() -> Plan:
    """Load the test plan for boards that is part of the package."""
    data = (resources.files("taxel_tools.bench") / "plans" / DEFAULT_PLAN).read_bytes()
    return parse_plan(data, DEFAULT_PLAN)


def select_phases(plan: Plan, phases: Sequence[str]) -> Plan:
    """Reduce a test plan to the named phases and the merging phase, in the order of the plan, and enable all of
    them.

    Raises `TaxelError` for a phase that the plan does not have.
    """
    unknown = [name for name in phases if name not in plan.phases]
    if unknown:
        raise TaxelError(f"--phase: expected a phase of {plan.source} ({', '.join(plan.phases)}), found '{unknown[0]}'")
    selected = {*phases, MERGING_PHASE}
    tables = {name: replace(table, enabled=True) for name, table in plan.phases.items() if name in selected}
    # None: the table of a kind does not state whether the phase is enabled, so that the phase runs for every kind.
    kinds = {
        kind: {name: replace(table, enabled=None) for name, table in kind_tables.items() if name in selected}
        for kind, kind_tables in plan.kinds.items()
    }
    return replace(plan, phases=tables, kinds=kinds)


def load_plan_phases(plan: Plan, kinds: Iterable[str] = ()) -> tuple[Phase, ...]:
    """Load the phases of a plan and check the plan against them, and against `kinds` of boards if any are given.

    Raises `PlanError` for an invalid plan (also if the merging phase is not the last enabled phase), `PluginError` for
    a phase of another package that cannot be used.
    """
    phases = registry.load_phases(plan.phases)
    check_plan(plan, phases, registry.list_phase_names())
    if known_kinds := set(kinds):
        plan.check_kinds(known_kinds)
    for kind in ("", *plan.kinds):
        enabled = [phase.name for phase in plan.enabled_phases(kind)]
        if MERGING_PHASE not in enabled[-1:]:
            found = f"'{enabled[-1]}'" if enabled else "none"
            remedy = f"add [phases.{MERGING_PHASE}] at the end"
            raise PlanError(plan.source, "phases", f"'{MERGING_PHASE}' as the last phase", found, remedy)
    return phases


@contextmanager
def open_bench(url: str) -> Iterator[tuple[BoardWire, EmulatedBench | None]]:
    """Open the bus of a test bench and, for an emulated bus, its emulated bench. Raises `TaxelError`."""
    if url.startswith("emulator:"):
        with open_emulated(url) as (wire, bench):
            yield wire, bench
    else:
        with open_wire(url) as wire:
            yield wire, None


def find_single_board(wire: BoardWire) -> int:
    """Return the I2C address of the only running board on the bus. Raises `TaxelError` for none or several."""
    addresses = [device.address for device in scan_bus(wire) if device.runs == "application"]
    if len(addresses) == 1:
        return addresses[0]
    if not addresses:
        raise TaxelError(f"{wire.name}: expected a board with an application, found none; run taxel scan")
    address_list = ", ".join(f"0x{address:02X}" for address in addresses)
    raise TaxelError(
        f"{wire.name}: expected one board, found {len(addresses)} ({address_list}); select one with --board"
    )


def open_probe(url: str | None, board: BoardUnderTest, emulated: EmulatedBench | None, operator: Operator) -> Probe:
    """Open the probe of `--probe`. Raises `TaxelError`.

    url: value of the option; None selects `emulated` for an emulated board, otherwise `none`.
    """
    pitch_m = board.hand.pitch_m if board.hand else DEFAULT_PITCH_M
    default = "emulated" if emulated else "none"
    request = ProbeRequest(default if url is None else url, board.kind, pitch_m, operator, board.address, emulated)
    return registry.open_probe(request)


def run_board_test(plan: Plan, board: BoardUnderTest, labels: RecordLabels, report: Report) -> TestRecord:
    """Run the plan on a board and return the record of the test.

    Raises `TaxelError` for an invalid plan; then no phase has run. Starts the frames of the board, and stops them at
    the end.
    """
    phases = load_plan_phases(plan)
    kind = board.kind.name
    durations = [
        phase.options.get("seconds", 0.0) for phase in plan.enabled_phases(kind) if phase.name in REST_RECORD_PHASES
    ]
    # The phases share one record of the untouched board, so it has the longest of their durations.
    board.rest_record_s = max([board.rest_record_s, *map(float, durations)])
    properties = {
        "address": f"0x{board.address:02X}",
        "kind": kind,
        "unique id": board.identity["unique_id"].hex(),
        "firmware": format_version(get_firmware_version(board.identity)),
        "wire": board.wire.name,
        "probe": board.probe.name,
    }
    device = DeviceUnderTest(kind, labels.serial_number, properties)
    conditions = RunConditions(labels.operator, labels.station, metadata.version("taxel"), board.wire.now_s)
    board.readout.start()
    try:
        return run_test(plan, phases, board, device, conditions, report)
    finally:
        with suppress(TaxelError, EOFError):  # After the loss of the hub, the phases have already ended.
            board.readout.stop()
