"""Test plan: phases with their options and limits, and the differences for a kind of board.

    taxel_test_plan = 1
    name = "sensor boards, production"
    version = "1"
    serial_pattern = "[A-Z]{2}-[0-9]{4}"     # optional: regular expression for the whole serial number
    stop_at_failure = false                  # optional: true skips the phases after the first one that does not pass

    [phases.noise]                           # the phases run in the order of these tables
    enabled = true                           # default
    seconds = 4.0                            # any other key is an option of the phase
    [phases.noise.limits]
    white = { max = 8.0 }                    # min, max or both, in the unit of the measurement; bounds are included

    [kinds.fingertip.noise.limits]           # differences for a kind: options, enabled, single bounds
    white = { max = 10.0 }                   # max = inf removes a bound, and so does min = -inf

A phase that is not in the plan does not run. A phase for a single kind is listed in `phases` with enabled = false.
"""

import hashlib
import math
import re
import warnings
from collections.abc import Collection
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

from taxel.hand.checks import suggest_name
from taxel.hand.errors import format_path, format_value
from taxel.input_files import read_regular_file
from taxel_tools.testing.errors import SerialNumberError
from taxel_tools.testing.options import Options
from taxel_tools.testing.plan_tables import FILE_BYTES_MAX, Location, PhaseTable, parse_toml, read_phases
from taxel_tools.testing.record import Limit

__all__ = ["Options", "PhasePlan", "Plan", "parse_plan", "read_plan"]

VERSION = 1
SERIAL_LENGTH_MAX = 64  # More characters than a label has.
TEXT_LENGTH_MAX = 200  # Characters of a name or a version.

_REQUIRED = ("taxel_test_plan", "name", "version", "phases")
_OPTIONAL = ("serial_pattern", "stop_at_failure", "kinds")


@dataclass(frozen=True, slots=True)
class PhasePlan:
    """Options and limits of one phase.

    `locations`: position in the plan file of each option by name, and of each limit by "limits.<name>".
    """

    name: str
    options: dict[str, Any]
    limits: dict[str, Limit]
    locations: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Plan:
    """A checked plan. `source`: its file, for errors and reports; `sha256`: digest of the file."""

    source: str
    name: str
    version: str
    sha256: str
    serial_pattern: str | None
    stop_at_failure: bool
    phases: dict[str, PhaseTable]
    kinds: dict[str, dict[str, PhaseTable]]

    def enabled_phases(self, kind_name: str) -> list[PhasePlan]:
        """Return the phases of the test plan that run for a kind of board, in order.

        A kind without entries of its own has the general plan.
        """
        return [phase for is_enabled, phase in self.all_phases(kind_name) if is_enabled]

    def all_phases(self, kind_name: str) -> list[tuple[bool, PhasePlan]]:
        """Return all phases of the test plan for a kind of board, each as (is enabled, phase)."""
        kind_tables = self.kinds.get(kind_name, {})
        return [self._merge(table, kind_tables.get(table.name)) for table in self.phases.values()]

    def build_options(self, phase: PhasePlan) -> Options:
        """Build the options of a phase from the test plan; errors in them name this plan."""
        return Options(phase.options, self.source, phase.locations)

    def check_serial_number(self, serial_number: str) -> None:
        """Check a serial number that an operator has entered.

        Raises `SerialNumberError` for a number that is not printable, too long, or does not match the plan's
        `serial_pattern`.
        """
        if not serial_number.isprintable() or len(serial_number) > SERIAL_LENGTH_MAX:
            raise SerialNumberError(format_value(serial_number), f"at most {SERIAL_LENGTH_MAX} printable characters")
        if self.serial_pattern is not None and not re.fullmatch(self.serial_pattern, serial_number):
            raise SerialNumberError(format_value(serial_number), f"a number that matches {self.serial_pattern}")

    def check_kinds(self, known_kinds: Collection[str]) -> None:
        """Check that the kinds of boards in the test plan exist. Raises `PlanError` otherwise."""
        for kind in self.kinds:
            if kind not in known_kinds:
                Location(self.source, f"kinds.{kind}").fail(
                    "a kind of board", "an unknown one", suggest_name(kind, known_kinds)
                )

    def _merge(self, table: PhaseTable, kind_table: PhaseTable | None) -> tuple[bool, PhasePlan]:
        """Merge the general table of a phase and its table for one kind of board.

        Returns whether the phase is enabled, and its options and limits.
        """
        layers = [table] if kind_table is None else [table, kind_table]
        is_enabled = True
        options: dict[str, Any] = {}
        locations: dict[str, str] = {}
        bounds: dict[str, dict[str, float]] = {}
        for layer in layers:
            is_enabled = is_enabled if layer.enabled is None else layer.enabled
            options |= layer.options
            locations |= {key: f"{layer.location.path}.{key}" for key in layer.options}
            for name, layer_bounds in layer.bounds.items():
                bounds[name] = bounds.get(name, {}) | layer_bounds
                locations[f"limits.{name}"] = f"{layer.location.path}.limits.{name}"
        limits = {
            name: _build_limit(Location(self.source, locations[f"limits.{name}"]), limit_bounds)
            for name, limit_bounds in bounds.items()
        }
        effective_limits = {name: limit for name, limit in limits.items() if limit != Limit(None, None)}
        return is_enabled, PhasePlan(table.name, options, effective_limits, locations)


def read_plan(path: str | PathLike[str]) -> Plan:
    """Read a test plan file. Raises `PlanError` as one line, also for an unreadable file."""
    location = Location(format_path(path))
    try:
        data = read_regular_file(path, FILE_BYTES_MAX)
    except OSError as error:
        location.fail("a readable test plan", error.strerror or type(error).__name__, "check the file name")
    return parse_plan(data, location.file)


def parse_plan(data: bytes, source: str) -> Plan:
    """Parse the bytes of an untrusted test plan. Raises `PlanError` as one line that names `source` and the key."""
    top = Location(source)
    document = parse_toml(data, top)
    version = document.get("taxel_test_plan")
    if type(version) is not int or version != VERSION:  # In Python, True == 1 and 1.0 == 1.
        top.key("taxel_test_plan").fail(str(VERSION), format_value(version), "is this a test plan of this release?")
    top.check_keys(document, _REQUIRED, _OPTIONAL)
    kinds = top.key("kinds").table(document.get("kinds", {}))
    plan = Plan(
        source=source,
        name=top.key("name").line(document["name"], TEXT_LENGTH_MAX),
        version=top.key("version").line(document["version"], TEXT_LENGTH_MAX),
        sha256=hashlib.sha256(data).hexdigest(),
        serial_pattern=_check_pattern(top.key("serial_pattern"), document.get("serial_pattern")),
        stop_at_failure=top.key("stop_at_failure").flag(document.get("stop_at_failure", False)),
        phases=read_phases(top.key("phases"), document["phases"]),
        kinds={name: read_phases(top.key("kinds").name(name), table) for name, table in kinds.items()},
    )
    _check_kinds(plan, top)
    return plan


def _check_kinds(plan: Plan, top: Location) -> None:
    """Check that the tables for single board kinds refer to phases of the plan, and that their limits are
    consistent.
    """
    if not plan.phases:
        top.key("phases").fail("one phase or more", "none", "add a table such as [phases.noise]")
    for kind, tables in plan.kinds.items():
        for name, table in tables.items():
            if name not in plan.phases:
                remedy = f"add [phases.{name}], with enabled = false if only this kind has the phase"
                table.location.fail("a phase that is also listed in phases", "one that is not", remedy)
        plan.all_phases(kind)  # Finds bounds that contradict each other only after merging.
    plan.all_phases("")


def _build_limit(location: Location, bounds: dict[str, float]) -> Limit:
    """Build the limit from the bounds "min" and "max" of a plan; a missing bound is infinite.

    Fails at `location` if min is above max.
    """
    low, high = bounds.get("min", -math.inf), bounds.get("max", math.inf)
    if low > high:
        location.fail("min at most max", f"min {low:g}, max {high:g}", "correct one of the bounds")
    return Limit(None if math.isinf(low) else low, None if math.isinf(high) else high)


def _check_pattern(location: Location, value: object) -> str | None:
    """Check the regular expression for serial numbers in a test plan. Returns it, or None if the plan has none."""
    if value is None:
        return None
    text = location.line(value, TEXT_LENGTH_MAX)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # Refuses a pattern whose meaning changes in a later Python version.
            re.compile(text)
    except (re.error, OverflowError, RecursionError, Warning) as error:
        location.fail("a regular expression", f"{format_value(text)} ({error})", "correct the expression")
    return text
