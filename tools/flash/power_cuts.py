"""Power cuts in every write of updates: of boards, of the hub, of configurations; nothing may ever be bricked.

python tools/flash/power_cuts.py --cuts 10000 --seed 1 --jobs 2    ten thousand cuts: some minutes
python tools/flash/power_cuts.py --cuts 300                        a short form
python tools/flash/power_cuts.py --cuts 10000 --seed 1 --world 7   one world of them again, as it was
python tools/flash/power_cuts.py --cuts 10000 --seed 1 --page      writes docs/flash-power-cuts.md too

The updates are those of `taxel flash` and `taxel provision`, in emulated worlds with the real bootloaders. The power is
cut at each flash operation: before it, in words that are erased and programmed, after it; then again in what follows.
After each cut the old or the new image must run, whole; the command, given again, must succeed; the hub must go on
polling the other board. Exit status 1 if any of that fails.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

sys.path.insert(0, str(Path(__file__).parent))

from cut_configurations import run_configurations
from cut_plan import WorldPlan, plan_worlds
from cut_runs import WorldResult, run_updates
from cut_table import document_of, page_of, tally_of, text_of

PAGE: Final = Path(__file__).resolve().parents[2] / "docs" / "flash-power-cuts.md"


def run_world(plan: WorldPlan) -> WorldResult:
    """Every sequence of a world."""
    return run_configurations(plan) if plan.way.startswith("configuration") else run_updates(plan)


def run_worlds(plans: Sequence[WorldPlan], jobs: int) -> Iterator[WorldResult]:
    """Results in any order; they do not hang on it."""
    if jobs == 1:
        yield from map(run_world, plans)
        return
    with multiprocessing.Pool(jobs) as pool:
        yield from pool.imap_unordered(run_world, plans)


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the cuts and print what came of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cuts", type=int, default=10_000, help="at least so many (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="draws images, second cuts and torn words")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes (default: one a processor)")
    parser.add_argument("--world", type=int, help="only the world with this number")
    parser.add_argument("--json", type=Path, help="write everything there as JSON")
    parser.add_argument("--page", nargs="?", type=Path, const=PAGE, help="write the page (default: docs/)")
    options = parser.parse_args(arguments)
    plans = plan_worlds(options.cuts, options.seed)
    if options.world is not None:
        plans = [plan for plan in plans if plan.number == options.world]
    results: list[WorldResult] = []
    for result in run_worlds(plans, max(options.jobs, 1)):
        results.append(result)
        if sys.stderr.isatty():
            print(f"\r{len(results)} of {len(plans)} worlds", end="", file=sys.stderr, flush=True)
    tally = tally_of(sorted(results, key=lambda one: one.number))
    print(text_of(tally, options.seed))
    if options.json is not None:
        options.json.write_text(json.dumps(document_of(tally, options.seed), indent=2) + "\n")
    if options.page is not None:
        command = f"python tools/flash/power_cuts.py --cuts {options.cuts} --seed {options.seed} --page"
        options.page.write_text(page_of(tally, options.seed, command))
    return 1 if tally.failures or not tally.cuts else 0


if __name__ == "__main__":
    sys.exit(main())
