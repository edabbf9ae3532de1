"""What the tests of the test engine share: plans, phases that do what they are told, and whole records."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import pytest

from taxel_tools.testing.engine import PhaseLog, run_test
from taxel_tools.testing.plan import Options, Plan, parse_plan
from taxel_tools.testing.record import TestRecord

HEAD = 'taxel_test_plan = 1\nname = "boards"\nversion = "1"\n'
PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010806000000"
    "1f15c4890000000d49444154789c6360f8cfc000000301010018dd8db00000000049454e44ae426082"
)  # a PNG of one pixel


class ToldPhase:
    """A phase that does what it is given, and knows the limits that it is given."""

    def __init__(
        self,
        name: str,
        does: Callable[[Any, Options, PhaseLog], None] = lambda context, options, log: None,
        limits: tuple[str, ...] = (),
        unmet: str = "",
        automatic: bool = True,
    ) -> None:
        self.name = name
        self.title = name.capitalize()
        self.automatic = automatic
        self.limit_names = frozenset(limits)
        self._does = does
        self._unmet = unmet

    def unmet(self, context: Any) -> str:
        return self._unmet

    def run(self, context: Any, options: Options, log: PhaseLog) -> None:
        self._does(context, options, log)


@pytest.fixture
def plan_of() -> Callable[[str], Plan]:
    """A plan from what follows its head."""
    return lambda text: parse_plan((HEAD + text).encode(), "plan.toml")


@pytest.fixture
def phase() -> type[ToldPhase]:
    return ToldPhase


@pytest.fixture
def run() -> Callable[..., TestRecord]:
    """Run phases on a clock that takes a second for each look at it."""
    clock = itertools.count()

    def run_with(plan: Plan, phases: list[ToldPhase], kind: str = "any", **changes: Any) -> TestRecord:
        arguments: dict[str, Any] = {
            "serial_number": "AB-0001",
            "operator": "Zoë",
            "station": "bench 1",
            "device": {"kind": kind, "address": "0x21"},
            "software_version": "0.1.0",
            "now_s": lambda: float(next(clock)),
        }
        return run_test(plan, kind, phases, "the device", **(arguments | changes))

    return run_with


@pytest.fixture
def record_of(plan_of, phase, run) -> Callable[..., TestRecord]:
    """A record of one phase "noise" whose limits are white <= 8 and gain 5 to 20; `does` fills it."""

    def make(does: Callable[[PhaseLog], None] = lambda log: None, **changes: Any) -> TestRecord:
        plan = plan_of("[phases.noise.limits]\nwhite = { max = 8 }\ngain = { min = 5, max = 20 }\n")
        noise = phase("noise", lambda context, options, log: does(log), ("white", "gain"))
        return run(plan, [noise], **changes)

    return make


@pytest.fixture
def full_record(plan_of, phase, run) -> TestRecord:
    """Every outcome, odd values and odd text."""

    def identity(context, options, log):
        log.measure("firmware", "0.3.1", "")
        log.measure("supply", 3.312, "V")

    def noise(context, options, log):
        log.measure("white", 9.5, "counts", "TX 3")
        log.measure("white", 4.0, "counts", "TX 4")
        log.measure("white", math.nan, "counts", "TX 5")
        log.measure("white", None, "counts", "TX 6")
        log.finding("noisy TX line", "TX 3", "lift the solder joint J1.4", 4.2)
        log.finding("open TX line", "TX 5", "check the trace", math.inf)
        log.attach("noise.png", "image/png", PIXEL, "White noise")
        log.attach("raw.bin", "application/octet-stream", bytes(range(256)))
        log.note('a <script>alert("note")</script> & an "ü"')

    def bus(context, options, log):
        raise OSError(5, "Input/output error", "/dev/bus")

    tables = "[phases.identity]\n[phases.noise.limits]\nwhite = { max = 8 }\n[phases.bus]\n[phases.touch]\n"
    phases = [
        phase("identity", identity),
        phase("noise", noise, ("white",)),
        phase("bus", bus),
        phase("touch", unmet="nobody is at the bench", automatic=False),
    ]
    return run(plan_of(tables), phases)
