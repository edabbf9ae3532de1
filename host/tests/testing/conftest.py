"""Fixtures for the tests of the test framework: plans, phases and complete records."""

import itertools
import math
from collections.abc import Callable
from typing import Any

import pytest

from taxel_tools.testing.engine import DeviceUnderTest, PhaseLog, RunConditions, run_test
from taxel_tools.testing.plan import Options, Plan, parse_plan
from taxel_tools.testing.record import TestRecord

PLAN_HEAD = 'taxel_test_plan = 1\nname = "boards"\nversion = "1"\n'
PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010806000000"
    "1f15c4890000000d49444154789c6360f8cfc000000301010018dd8db00000000049454e44ae426082"
)  # PNG image with one pixel.


class FakePhase:
    """A phase that calls a function, with given limits."""

    def __init__(
        self,
        name: str,
        measure: Callable[[Any, Options, PhaseLog], None] = lambda context, options, log: None,
        limits: tuple[str, ...] = (),
        requirement: str = "",
        is_automatic: bool = True,
    ) -> None:
        self.name = name
        self.title = name.capitalize()
        self.is_automatic = is_automatic
        self.limit_names = frozenset(limits)
        self._measure = measure
        self._requirement = requirement

    def find_unmet_requirement(self, context: Any) -> str:
        return self._requirement

    def run(self, context: Any, options: Options, log: PhaseLog) -> None:
        self._measure(context, options, log)


@pytest.fixture
def make_plan() -> Callable[[str], Plan]:
    """Factory of plans from the text after the head."""
    return lambda text: parse_plan((PLAN_HEAD + text).encode(), "plan.toml")


@pytest.fixture
def phase() -> type[FakePhase]:
    return FakePhase


@pytest.fixture
def run() -> Callable[..., TestRecord]:
    """Runs phases with a clock that advances by 1 s at each reading."""
    clock = itertools.count()

    def run_with(
        plan: Plan,
        phases: list[FakePhase],
        kind: str = "any",
        serial_number: str = "AB-0001",
        operator: str = "Zoë",
        now_s: Callable[[], float] = lambda: float(next(clock)),
        **options: Any,
    ) -> TestRecord:
        """Run the phases of a plan on a device and return the record. options: of `run_test`."""
        device = DeviceUnderTest(kind, serial_number, {"kind": kind, "address": "0x21"})
        conditions = RunConditions(operator, "bench 1", "0.1.0", now_s)
        return run_test(plan, phases, "the device", device, conditions, **options)

    return run_with


@pytest.fixture
def make_record(make_plan, phase, run) -> Callable[..., TestRecord]:
    """Factory of records of one phase "noise" with the limits white <= 8 and gain 5 to 20; `measure` fills its log."""

    def make(measure: Callable[[PhaseLog], None] = lambda log: None, **options: Any) -> TestRecord:
        """Create the record of the phase "noise", whose log `measure` fills. options: of `run`."""
        plan = make_plan("[phases.noise.limits]\nwhite = { max = 8 }\ngain = { min = 5, max = 20 }\n")
        noise_phase = phase("noise", lambda context, options, log: measure(log), ("white", "gain"))
        return run(plan, [noise_phase], **options)

    return make


@pytest.fixture
def full_record(make_plan, phase, run) -> TestRecord:
    """A record with every outcome, with unusual values and texts."""

    def measure_identity(context, options, log):
        log.measure("firmware", "0.3.1", "")
        log.measure("supply", 3.312, "V")

    def measure_noise(context, options, log):
        """Log a violated limit, values that are missing or not finite, findings, attachments and a hostile note."""
        log.measure("white", 9.5, "counts", "TX 3")
        log.measure("white", 4.0, "counts", "TX 4")
        log.measure("white", math.nan, "counts", "TX 5")
        log.measure("white", None, "counts", "TX 6")
        log.add_finding("noisy TX line", "TX 3", "lift the solder joint J1.4", 4.2)
        log.add_finding("open TX line", "TX 5", "check the trace", math.inf)
        log.attach("noise.png", "image/png", PIXEL, "White noise")
        log.attach("raw.bin", "application/octet-stream", bytes(range(256)))
        log.add_note('a <script>alert("note")</script> & an "ü"')

    def fail_on_bus(context, options, log):
        raise OSError(5, "Input/output error", "/dev/bus")

    tables = "[phases.identity]\n[phases.noise.limits]\nwhite = { max = 8 }\n[phases.bus]\n[phases.touch]\n"
    phases = [
        phase("identity", measure_identity),
        phase("noise", measure_noise, ("white",)),
        phase("bus", fail_on_bus),
        phase("touch", requirement="no operator at the bench", is_automatic=False),
    ]
    return run(make_plan(tables), phases)
