"""From a URL and a plan to a test record: the wire, the board, the probe, the test."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from importlib import metadata, resources
from typing import Final

from taxel.errors import TaxelError
from taxel_tools.application import firmware_version
from taxel_tools.bench.phases import PHASES
from taxel_tools.bench.probe import ManualProbe, NoProbe, Probe
from taxel_tools.bench.probe.emulated import EmulatedProbe
from taxel_tools.bench.probe.gcode import open_gcode
from taxel_tools.bench.station import Station
from taxel_tools.errors import PlanError
from taxel_tools.firmware_update import format_version
from taxel_tools.open_wire import EmulatedBench, open_emulated, open_wire
from taxel_tools.scan import scan_bus
from taxel_tools.testing.engine import Report, check_plan, run_test
from taxel_tools.testing.operator import Operator
from taxel_tools.testing.plan import Plan, parse_plan
from taxel_tools.testing.record import TestRecord
from taxel_tools.wires import BoardWire

DEFAULT_PLAN: Final = "default.toml"
DEFAULT_PITCH_M: Final = 0.005
"""Between taxels, where no hand description says it (thesis, conclusion: four taxels a square centimetre)."""
SHARED_RECORD: Final = ("electrical", "rest", "noise", "drift")
"""Phases that look at one record of the untouched board; it is as long as the longest of them asks for."""
NAMING: Final = "faults"
"""The phase that names what the others have seen: without it, a short would pass."""


@dataclass(frozen=True)
class Who:
    """Whose test it is."""

    serial_number: str
    operator: str
    station: str


def default_plan() -> Plan:
    """The plan that comes with the package."""
    data = (resources.files("taxel_tools.bench") / "plans" / DEFAULT_PLAN).read_bytes()
    return parse_plan(data, DEFAULT_PLAN)


def only(plan: Plan, phases: Sequence[str]) -> Plan:
    """The plan with nothing but these phases and the one that names faults, in its own order, whether enabled or not.

    Raises `TaxelError`.
    """
    unknown = [name for name in phases if name not in plan.phases]
    if unknown:
        raise TaxelError(f"--phase: {plan.source} has no phase '{unknown[0]}'; it has {', '.join(plan.phases)}")
    wanted = {*phases, NAMING}
    kept = {name: replace(table, enabled=True) for name, table in plan.phases.items() if name in wanted}
    kinds = {
        kind: {name: replace(table, enabled=None) for name, table in tables.items() if name in wanted}
        for kind, tables in plan.kinds.items()
    }
    return replace(plan, phases=kept, kinds=kinds)


def check_fit(plan: Plan, kinds: Iterable[str] = ()) -> None:
    """Hold a plan against the phases, and against the kinds of boards that there are if any are given.

    Raises `PlanError`.
    """
    check_plan(plan, PHASES)
    if known := set(kinds):
        plan.check_kinds(known)
    for kind in ("", *plan.kinds):
        running = [one.name for one in plan.for_kind(kind)]
        if NAMING not in running[-1:]:
            found = f"'{running[-1]}'" if running else "none"
            raise PlanError(
                plan.source, "phases", f"'{NAMING}' as the last phase", found, f"add [phases.{NAMING}] at the end"
            )


@contextmanager
def open_bench(url: str) -> Iterator[tuple[BoardWire, EmulatedBench | None]]:
    """A wire, and the emulated bench behind it if it is one. Raises `TaxelError`."""
    if url.startswith("emulator:"):
        with open_emulated(url) as (wire, bench):
            yield wire, bench
    else:
        with open_wire(url) as wire:
            yield wire, None


def only_board(wire: BoardWire) -> int:
    """The address of the one application on the bus. Raises `TaxelError` if there is none, or more than one."""
    found = [one for one in scan_bus(wire) if one.runs == "application"]
    if len(found) == 1:
        return found[0].address
    if not found:
        raise TaxelError(f"{wire.name}: no board with an application answers; taxel scan shows what is there")
    addresses = ", ".join(f"0x{one.address:02X}" for one in found)
    raise TaxelError(f"{wire.name}: {len(found)} boards answer ({addresses}); name one with --board")


def open_probe(text: str | None, station: Station, emulated: EmulatedBench | None, person: Operator) -> Probe:
    """The probe that `text` names; without it the emulated one on an emulated board, else none. Raises `TaxelError`."""
    pitch_m = station.hand.pitch_m if station.hand else DEFAULT_PITCH_M
    name = text if text is not None else ("emulated" if emulated else "none")
    if name == "none":
        return NoProbe()
    if name == "operator":
        return ManualProbe(station.kind, person)
    if name == "emulated":
        if emulated is None:
            raise TaxelError("--probe: 'emulated' presses emulated boards only; this one is on a wire")
        first = emulated.hand.get_slice(station.address).start
        return EmulatedProbe(emulated.world, station.kind, first, pitch_m)
    if name.startswith("gcode:"):
        return open_gcode(name, station.kind, pitch_m, person)
    raise TaxelError(f"--probe: expected none, operator, emulated or gcode:///dev/..., found '{name}'")


def test_board(plan: Plan, station: Station, who: Who, report: Report) -> TestRecord:
    """Run the plan on a board. Raises `TaxelError` if the plan does not fit; then nothing has run."""
    check_fit(plan)
    wanted = [one.options.get("seconds", 0.0) for one in plan.for_kind(station.kind.name) if one.name in SHARED_RECORD]
    station.untouched_s = max([station.untouched_s, *map(float, wanted)])
    identity = station.identity
    station.readout.begin()
    try:
        return run_test(
            plan,
            station.kind.name,
            PHASES,
            station,
            serial_number=who.serial_number,
            operator=who.operator,
            station=who.station,
            device={
                "address": f"0x{station.address:02X}",
                "kind": station.kind.name,
                "unique id": identity["unique_id"].hex(),
                "firmware": format_version(firmware_version(identity)),
                "wire": station.wire.name,
                "probe": station.probe.name,
            },
            software_version=metadata.version("taxel"),
            now_s=station.wire.now_s,
            report=report,
        )
    finally:
        with suppress(TaxelError, EOFError):  # a hub that is gone has ended the phases already
            station.readout.end()
