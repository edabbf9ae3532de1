"""Soak test on the emulated skin: `python -m hil_tests.soak --hours 24 --seed 1` (`make soak HOURS=24`)."""

import argparse
import json
import secrets
import sys
import time
from pathlib import Path

from hil_tests.harness.soak import Soak, SoakReport
from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.output import write_whole

GROWTH_LIMIT = 1.02
"""Largest ratio of the peak memory at the end to that after the first tenth of a soak."""


def find_problems(report: SoakReport) -> list[str]:
    """List the problems of a soak, one line each; empty if the soak passed."""
    problems = []
    if report.wrong:
        problems.append(f"{report.wrong} frames contain counts that were never set")
    problems += [f"unexplained: {line}" for line in report.unexplained]
    if report.growth > GROWTH_LIMIT:
        problems.append(f"memory grew by {100 * (report.growth - 1):.1f} % after the first tenth")
    return problems


def main() -> int:
    """Run a long test with random faults, print its result and write the report.

    Returns the exit status: 1 if there is a problem or an error, otherwise 0.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0, help="virtual hours (24)")
    parser.add_argument("--seed", type=int, default=None, help="replays a soak exactly (default: a new seed)")
    parser.add_argument("--hand", default="original", help="hand description (original)")
    parser.add_argument("--without-hub", action="store_true", help="a Linux hub on an I2C adapter polls the boards")
    parser.add_argument("--out", type=Path, default=None, help="write the report as JSON")
    options = parser.parse_args()
    seed = secrets.randbelow(2**32) if options.seed is None else options.seed
    print(f"soak: {options.hours:g} virtual hours, hand {options.hand}, seed {seed}", flush=True)
    start_s = time.monotonic()
    try:
        report = Soak(load_hand(options.hand), seed, has_hub=not options.without_hub).run(
            3600.0 * options.hours, _show_progress
        )
    except TaxelError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    wall_s = time.monotonic() - start_s
    print(f"\n{report.seconds / 3600:g} h in {wall_s:.0f} s: {report.frames} frames, {report.lost} missing")
    print(f"memory: {report.memory_mb[-1]:.0f} MB, growth {100 * (report.growth - 1):.2f} % since the first tenth")
    print(f"{'fault':<16}{'injected':>10}{'frames':>10}")
    for kind, count in sorted(report.injected.items()):
        print(f"{kind:<16}{count:>10}{report.cost[kind]:>10}")
    problems = find_problems(report)
    print("\n".join(problems) if problems else "passed: all missing frames are explained, all counts are correct")
    if options.out is not None:
        summary = {"seed": seed, "hand": options.hand, "wall_seconds": wall_s, "problems": problems, **vars(report)}
        options.out.parent.mkdir(parents=True, exist_ok=True)
        write_whole(options.out, json.dumps(summary, indent=1))
    return 1 if problems else 0


def _show_progress(elapsed_s: float, total_s: float) -> None:
    print(f"\r{elapsed_s / 3600:6.2f} of {total_s / 3600:g} h", end="", flush=True)


if __name__ == "__main__":
    sys.exit(main())
