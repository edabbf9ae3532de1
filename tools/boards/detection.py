"""How many faults `taxel bench` catches and names: `python tools/boards/detection.py`.

Single faults of severity 1.5 to 10, healthy boards, and below 1.5 the curve of how often a fault is caught. Prints a
table; with --page it writes docs/bench-faults.md and its picture.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from board_faults import BOARDS, FAMILIES, HAND, Case, SlowLink, draw_case, render_text

from taxel.link.virtual import VirtualWorld
from taxel_tools.bench.probe.emulated import EmulatedProbe
from taxel_tools.bench.running import Who, default_plan, only, test_board
from taxel_tools.bench.station import open_station
from taxel_tools.testing.record import Outcome
from taxel_tools.wires import HubWire

REPOSITORY: Final = Path(__file__).resolve().parent.parent.parent
PHASES: Final = ("identify", "electrical", "rest", "noise", "drift", "frames", "presses", "faults")
"""Without the two slow curves, which look for none of these faults."""
BOOT_S: Final = 0.5
CURVE: Final = (0.25, 0.5, 0.75, 1.0, 1.25)


@dataclass(frozen=True)
class Result:
    """What became of a case. `named`: the fault is found at its place; `others`: findings that are not it."""

    case: Case
    caught: bool
    named: bool
    first: bool
    others: tuple[str, ...]
    automatic_s: float
    seconds: float


def test(case: Case) -> Result:
    """Put a board on the bench."""
    plan = only(default_plan(), PHASES)
    address = BOARDS[case.kind]
    kind = HAND.get_board(address).kind
    with VirtualWorld(render_text(case.kind, case.seed, list(case.effects))) as world:
        world.run(BOOT_S)
        station = open_station(HubWire(SlowLink(world)), address, HAND)
        station.draws = False
        station.probe = EmulatedProbe(world, kind, 0, HAND.pitch_m)
        record = test_board(plan, station, Who("T", "", ""), lambda phase, fraction: None)
    if record.outcome is Outcome.ERROR:
        problems = "; ".join(phase.problem for phase in record.phases if phase.problem)
        raise RuntimeError(f"{case}: {problems}")
    findings = [(one.fault, one.place) for one in record.findings()]
    hits = [fault in case.names and place == case.place for fault, place in findings]
    others = tuple(f"{fault} at {place}" for (fault, place), hit in zip(findings, hits, strict=True) if not hit)
    first = next((hit for (fault, _), hit in zip(findings, hits, strict=True) if hit), False)
    automatic = sum(phase.seconds for phase in record.phases if phase.automatic)
    return Result(case, record.outcome is not Outcome.PASS, any(hits), first, others, automatic, record.seconds)


def cases(faults: int, healthy: int, curve: int, seed: int) -> list[Case]:
    """What is tested: faults in turn through the families, severities drawn evenly on a logarithmic scale from 1.5 to
    10.
    """
    plan = default_plan()
    rng = random.Random(f"severities {seed}")
    drawn = [draw_case(None, number, seed, 0.0, plan) for number in range(healthy)]
    for number in range(faults):
        family = FAMILIES[number % len(FAMILIES)]
        drawn.append(draw_case(family, number, seed, 1.5 * (10.0 / 1.5) ** rng.random(), plan))
    for family in FAMILIES:
        if family.graded:
            drawn += [draw_case(family, number, seed, step, plan) for step in CURVE for number in range(curve)]
    return drawn


def run(wanted: Sequence[Case], jobs: int) -> Iterable[Result]:
    """Test them all, in order."""
    if jobs == 1:
        yield from map(test, wanted)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(test, wanted, chunksize=4)


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--faults", type=int, default=320, help="single faults of severity 1.5 to 10")
    parser.add_argument("--healthy", type=int, default=1000, help="healthy boards")
    parser.add_argument("--curve", type=int, default=6, help="boards of each family and severity below 1.5")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, help="write every result to this JSON file")
    parser.add_argument("--page", action="store_true", help="write docs/bench-faults.md and its picture")
    arguments = parser.parse_args()
    began = time.monotonic()
    wanted = cases(arguments.faults, arguments.healthy, arguments.curve, arguments.seed)
    results = []
    for number, result in enumerate(run(wanted, arguments.jobs), start=1):
        results.append(result)
        if number % 50 == 0 and sys.stderr.isatty():
            print(f"{number} of {len(wanted)} boards", file=sys.stderr)
    from detection_page import summary, write_page  # matplotlib only here

    print(summary(results, arguments.seed, time.monotonic() - began))
    if arguments.out:
        arguments.out.write_text(json.dumps([asdict(result) for result in results], default=sorted, indent=1) + "\n")
    if arguments.page:
        write_page(REPOSITORY / "docs", results, arguments.seed)
    serious = [one for one in results if one.case.severity >= 1.5]
    is_well = all(one.named for one in serious) and not any(
        one.caught for one in results if one.case.family == "healthy"
    )
    return 0 if is_well else 1


if __name__ == "__main__":
    sys.exit(main())
