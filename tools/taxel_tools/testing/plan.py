"""A test plan: which phases run, with which options and limits, and what differs for a kind of board.

    taxel_test_plan = 1
    name = "sensor boards, production"
    version = "1"
    serial_pattern = "[A-Z]{2}-[0-9]{4}"     # optional: a regular expression that the whole serial number matches
    stop_at_failure = false                  # optional: true skips what comes after the first phase that does not pass

    [phases.noise]                           # the order of these tables is the order of the phases
    enabled = true                           # default
    seconds = 4.0                            # any other key is an option of the phase
    [phases.noise.limits]
    white = { max = 8.0 }                    # min, max or both, in the measurement's unit; a bound itself is allowed

    [kinds.fingertip.noise.limits]           # what differs for a kind: options, enabled, single bounds
    white = { max = 10.0 }                   # max = inf takes a bound away, min = -inf likewise

A phase that is not in the plan does not run. A phase for one kind alone stands in `phases` with enabled = false.
"""

from __future__ import annotations

import hashlib
import math
import re
import warnings
from collections.abc import Collection
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from taxel.hand.checks import suggest_name
from taxel.hand.errors import format_path, format_value
from taxel_tools.testing.errors import SerialNumberError
from taxel_tools.testing.options import Options
from taxel_tools.testing.plan_tables import LARGEST_BYTES, PhaseTable, Place, parse_toml, read_phases
from taxel_tools.testing.record import Limit

__all__ = ["Options", "PhasePlan", "Plan", "parse_plan", "read_plan"]

VERSION = 1
MAX_SERIAL = 64  # characters: more than any label holds
MAX_LINE = 200  # characters of a name or a version

_REQUIRED = ("taxel_test_plan", "name", "version", "phases")
_OPTIONAL = ("serial_pattern", "stop_at_failure", "kinds")


@dataclass(frozen=True, slots=True)
class PhasePlan:
    """What one phase is to do. places: where in the plan each option, and each limit as "limits.<name>", stands."""

    name: str
    options: dict[str, Any]
    limits: dict[str, Limit]
    places: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Plan:
    """A checked plan. source: its file, for errors and reports; sha256: of its bytes."""

    source: str
    name: str
    version: str
    sha256: str
    serial_pattern: str | None
    stop_at_failure: bool
    phases: dict[str, PhaseTable]
    kinds: dict[str, dict[str, PhaseTable]]

    def for_kind(self, kind_name: str) -> list[PhasePlan]:
        """The phases that run for a kind of board, in their order; a kind that the plan does not name is as any."""
        return [one for enabled, one in self.every_phase(kind_name) if enabled]

    def every_phase(self, kind_name: str) -> list[tuple[bool, PhasePlan]]:
        """All phases for a kind, and whether each runs."""
        differing = self.kinds.get(kind_name, {})
        return [self._merged(table, differing.get(table.name)) for table in self.phases.values()]

    def options(self, phase: PhasePlan) -> Options:
        """A reader of a phase's options whose errors name this plan."""
        return Options(phase.options, self.source, phase.places)

    def check_serial(self, serial_number: str) -> None:
        """Raises `SerialNumberError` for one that is not printable, too long, or not as `serial_pattern` says."""
        if not serial_number.isprintable() or len(serial_number) > MAX_SERIAL:
            raise SerialNumberError(format_value(serial_number), f"at most {MAX_SERIAL} printable characters")
        if self.serial_pattern is not None and not re.fullmatch(self.serial_pattern, serial_number):
            raise SerialNumberError(format_value(serial_number), f"one that matches {self.serial_pattern}")

    def check_kinds(self, known: Collection[str]) -> None:
        """Raises `PlanError` if the plan speaks of a kind of board that there is not."""
        for kind in self.kinds:
            if kind not in known:
                Place(self.source, f"kinds.{kind}").fail("a kind of board", "an unknown one", suggest_name(kind, known))

    def _merged(self, table: PhaseTable, differing: PhaseTable | None) -> tuple[bool, PhasePlan]:
        layers = [table] if differing is None else [table, differing]
        enabled = True
        options: dict[str, Any] = {}
        places: dict[str, str] = {}
        bounds: dict[str, dict[str, float]] = {}
        for layer in layers:
            enabled = enabled if layer.enabled is None else layer.enabled
            options |= layer.options
            places |= {key: f"{layer.place.path}.{key}" for key in layer.options}
            for name, found in layer.bounds.items():
                bounds[name] = bounds.get(name, {}) | found
                places[f"limits.{name}"] = f"{layer.place.path}.limits.{name}"
        limits = {name: _limit(Place(self.source, places[f"limits.{name}"]), found) for name, found in bounds.items()}
        kept = {name: limit for name, limit in limits.items() if limit != Limit(None, None)}
        return enabled, PhasePlan(table.name, options, kept, places)


def read_plan(path: str | PathLike[str]) -> Plan:
    """A plan from a file. Raises `PlanError` of one line, also for a file that cannot be read."""
    place = Place(format_path(path))
    try:
        with Path(path).open("rb") as stream:
            data = stream.read(LARGEST_BYTES + 1)
    except OSError as error:
        place.fail("a test plan that can be read", error.strerror or type(error).__name__, "check its name")
    return parse_plan(data, place.file)


def parse_plan(data: bytes, source: str) -> Plan:
    """A plan from its bytes, which nobody trusts. Raises `PlanError` of one line that names `source` and the key."""
    top = Place(source)
    document = parse_toml(data, top)
    found = document.get("taxel_test_plan")
    if type(found) is not int or found != VERSION:  # true == 1 and 1.0 == 1 in Python
        top.key("taxel_test_plan").fail(str(VERSION), format_value(found), "is this a test plan of this release?")
    top.check_keys(document, _REQUIRED, _OPTIONAL)
    kinds = top.key("kinds").table(document.get("kinds", {}))
    plan = Plan(
        source=source,
        name=top.key("name").line(document["name"], MAX_LINE),
        version=top.key("version").line(document["version"], MAX_LINE),
        sha256=hashlib.sha256(data).hexdigest(),
        serial_pattern=_pattern(top.key("serial_pattern"), document.get("serial_pattern")),
        stop_at_failure=top.key("stop_at_failure").flag(document.get("stop_at_failure", False)),
        phases=read_phases(top.key("phases"), document["phases"]),
        kinds={name: read_phases(top.key("kinds").name(name), table) for name, table in kinds.items()},
    )
    _check_kinds(plan, top)
    return plan


def _check_kinds(plan: Plan, top: Place) -> None:
    if not plan.phases:
        top.key("phases").fail("one phase or more", "none", "add a table such as [phases.noise]")
    for kind, tables in plan.kinds.items():
        for name, table in tables.items():
            if name not in plan.phases:
                remedy = f"add [phases.{name}] with enabled = false if it is for this kind alone"
                table.place.fail("a phase that stands in phases too", "one that does not", remedy)
        plan.every_phase(kind)  # bounds that contradict each other only once they are merged
    plan.every_phase("")


def _limit(place: Place, bounds: dict[str, float]) -> Limit:
    low, high = bounds.get("min", -math.inf), bounds.get("max", math.inf)
    if low > high:
        place.fail("min at most max", f"min {low:g}, max {high:g}", "correct one of them")
    return Limit(None if math.isinf(low) else low, None if math.isinf(high) else high)


def _pattern(place: Place, value: object) -> str | None:
    if value is None:
        return None
    text = place.line(value, MAX_LINE)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a pattern that a later Python reads otherwise
            re.compile(text)
    except (re.error, OverflowError, RecursionError, Warning) as error:
        place.fail("a regular expression", f"{format_value(text)} ({error})", "correct it")
    return text
