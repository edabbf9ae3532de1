"""Hours of virtual time with random faults: `python -m hil_tests.soak --hours 24 --seed 1` (`make soak HOURS=24`)."""

import argparse
import json
import secrets
import sys
import time
from pathlib import Path

from hil_tests.harness.soak import Soak, SoakReport
from taxel.errors import TaxelError
from taxel.hand import load_hand

GROWTH_LIMIT = 1.02


def verdict(report: SoakReport) -> list[str]:
    """What is wrong with a soak, a line each."""
    found = []
    if report.wrong:
        found.append(f"{report.wrong} frames hold counts that were never shown")
    found += [f"unexplained: {line}" for line in report.unexplained]
    if report.growth > GROWTH_LIMIT:
        found.append(f"memory grew by {100 * (report.growth - 1):.1f} % after the first tenth")
    return found


def main() -> int:
    """Run, print, write the report. Exit status 1 if something is not explained."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0, help="virtual hours (24)")
    parser.add_argument("--seed", type=int, default=None, help="replays a run exactly (default: a new one)")
    parser.add_argument("--hand", default="allegro", help="hand description (allegro)")
    parser.add_argument("--out", type=Path, default=None, help="write the report as JSON")
    options = parser.parse_args()
    seed = secrets.randbelow(2**32) if options.seed is None else options.seed
    print(f"soak: {options.hours:g} virtual hours, hand {options.hand}, seed {seed}", flush=True)
    begun_s = time.monotonic()
    try:
        soak = Soak(load_hand(options.hand), seed)
        report = soak.run(3600.0 * options.hours, _show)
    except TaxelError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    wall_s = time.monotonic() - begun_s
    print(f"\n{report.seconds / 3600:g} h in {wall_s:.0f} s: {report.frames} frames, {report.lost} missing")
    print(f"memory: {report.memory_mb[-1]:.0f} MB, grown by {100 * (report.growth - 1):.2f} % since the first tenth")
    print(f"{'fault':<16}{'injected':>10}{'frames':>10}")
    for kind, count in sorted(report.injected.items()):
        print(f"{kind:<16}{count:>10}{report.cost[kind]:>10}")
    problems = verdict(report)
    print("\n".join(problems) if problems else "every missing frame is explained; no count was wrong; memory is flat")
    if options.out is not None:
        summary = {"seed": seed, "hand": options.hand, "wall_seconds": wall_s, "problems": problems, **vars(report)}
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(json.dumps(summary, indent=1))
    return 1 if problems else 0


def _show(done_s: float, of_s: float) -> None:
    print(f"\r{done_s / 3600:6.2f} of {of_s / 3600:g} h", end="", flush=True)


if __name__ == "__main__":
    sys.exit(main())
