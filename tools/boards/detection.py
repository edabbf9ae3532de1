"""Detection campaign of `taxel bench`: number of faults that are caught and named.

    python tools/boards/detection.py

Tests single faults of severity 1.5 to 10, healthy boards, and, below 1.5, the share of faults that are caught. Prints a
table; with --page, writes docs/bench-faults.md and its picture.
"""

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

from board_faults import BOARDS, FAMILIES, HAND, Case, SlowLink, build_world, sample_case

from taxel.link.virtual import VirtualWorld
from taxel.output import write_whole
from taxel_tools.bench.board_under_test import open_board
from taxel_tools.bench.probe.emulated import EmulatedProbe
from taxel_tools.bench.running import RecordLabels, load_default_plan, run_board_test, select_phases
from taxel_tools.testing.record import Outcome
from taxel_tools.wires import HubWire

REPOSITORY: Final = Path(__file__).resolve().parent.parent.parent
PHASES: Final = ("identify", "electrical", "rest", "noise", "drift", "frames", "presses", "faults")
"""Without the two slow phases, which detect none of these faults."""
BOOT_S: Final = 0.5
CURVE_SEVERITIES: Final = (0.25, 0.5, 0.75, 1.0, 1.25)
SEVERITY_MIN: Final = 1.5
SEVERITY_MAX: Final = 10.0


@dataclass(frozen=True)
class Result:
    """Result of the test of one emulated board.

    `caught`: the board was refused. `named`: the fault was reported under a possible name at its place. `first`: equal
    to `named`, kept for the format of the JSON file. `others`: other findings. `automatic_s`, `seconds`: duration of
    the automatic phases and of the test.
    """

    case: Case
    caught: bool
    named: bool
    first: bool
    others: tuple[str, ...]
    automatic_s: float
    seconds: float


def run_case(case: Case) -> Result:
    """Run the board test on one emulated board. Raises RuntimeError if the test ends with an error.

    A fault is named if one of the possible names is reported at its place. The result contains this value in two
    fields, `named` and `first`, because the format of the JSON file has both fields.
    """
    plan = select_phases(load_default_plan(), PHASES)
    address = BOARDS[case.kind]
    kind = HAND.get_board(address).kind
    with VirtualWorld(build_world(case.kind, case.seed, list(case.effects))) as world:
        world.run(BOOT_S)
        board = open_board(HubWire(SlowLink(world)), address, HAND)
        board.draws_pictures = False
        board.probe = EmulatedProbe(world, kind, 0, HAND.pitch_m)
        record = run_board_test(plan, board, RecordLabels("T", "", ""), lambda phase, fraction: None)
    if record.outcome is Outcome.ERROR:
        problems = "; ".join(phase.problem for phase in record.phases if phase.problem)
        raise RuntimeError(f"{case}: {problems}")
    findings = [(finding.fault, finding.place) for finding in record.findings()]
    is_named = [fault in case.names and place == case.place for fault, place in findings]
    other_findings = tuple(
        f"{fault} at {place}" for (fault, place), named in zip(findings, is_named, strict=True) if not named
    )
    automatic_s = sum(phase.seconds for phase in record.phases if phase.automatic)
    is_caught = record.outcome is not Outcome.PASS
    return Result(case, is_caught, any(is_named), any(is_named), other_findings, automatic_s, record.seconds)


def sample_cases(faults: int, healthy: int, curve: int, seed: int) -> list[Case]:
    """Sample the boards of the campaign.

    healthy: number of healthy boards. faults: number of faulty boards, with faults of all families in turn; the
    severities are uniformly distributed on a logarithmic scale. curve: number of additional faulty boards for each
    graded family and each severity of `CURVE_SEVERITIES`.
    """
    plan = load_default_plan()
    rng = random.Random(f"severities {seed}")
    cases = [sample_case(None, number, seed, 0.0, plan) for number in range(healthy)]
    for number in range(faults):
        family = FAMILIES[number % len(FAMILIES)]
        severity = SEVERITY_MIN * (SEVERITY_MAX / SEVERITY_MIN) ** rng.random()
        cases.append(sample_case(family, number, seed, severity, plan))
    for family in FAMILIES:
        if family.is_graded:
            cases += [
                sample_case(family, number, seed, step, plan) for step in CURVE_SEVERITIES for number in range(curve)
            ]
    return cases


def run_cases(cases: Sequence[Case], jobs: int) -> Iterable[Result]:
    """Test all emulated boards in `jobs` processes, and yield the results in the order of the cases."""
    if jobs == 1:
        yield from map(run_case, cases)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(run_case, cases, chunksize=4)


def main() -> int:
    """Run the campaign that counts how many board faults the board test detects, and print the table.

    Returns the exit status: 0 if every fault of severity 1.5 or more is named at its place and no healthy board is
    refused; otherwise 1.
    """
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--faults", type=int, default=320, help="single faults of severity 1.5 to 10")
    parser.add_argument("--healthy", type=int, default=1000, help="healthy boards")
    parser.add_argument("--curve", type=int, default=6, help="boards of each family and severity below 1.5")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, help="write every result to this JSON file")
    parser.add_argument("--page", action="store_true", help="write docs/bench-faults.md and its picture")
    arguments = parser.parse_args()
    start_s = time.monotonic()
    cases = sample_cases(arguments.faults, arguments.healthy, arguments.curve, arguments.seed)
    results = []
    for number, result in enumerate(run_cases(cases, arguments.jobs), start=1):
        results.append(result)
        if number % 50 == 0 and sys.stderr.isatty():
            print(f"{number} of {len(cases)} boards", file=sys.stderr)
    from detection_page import format_summary, write_page  # Imports matplotlib, which is slow.

    print(format_summary(results, arguments.seed, time.monotonic() - start_s))
    if arguments.out:
        write_whole(arguments.out, json.dumps([asdict(result) for result in results], default=sorted, indent=1) + "\n")
    if arguments.page:
        write_page(REPOSITORY / "docs", results, arguments.seed)
    all_named = all(result.named for result in results if result.case.severity >= SEVERITY_MIN)
    no_alarm = not any(result.caught for result in results if result.case.family == "healthy")
    return 0 if all_named and no_alarm else 1


if __name__ == "__main__":
    sys.exit(main())
