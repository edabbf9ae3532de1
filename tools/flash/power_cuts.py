"""Campaign of power cuts in every flash write of updates of boards, of the hub, and of configurations.

    python tools/flash/power_cuts.py --cuts 10000 --seed 1 --jobs 2    ten thousand cuts, in some minutes
    python tools/flash/power_cuts.py --cuts 300                        a short campaign
    python tools/flash/power_cuts.py --cuts 10000 --seed 1 --world 7   repeats one world of the campaign
    python tools/flash/power_cuts.py --cuts 10000 --seed 1 --page      also writes docs/flash-power-cuts.md

The updates are those of `taxel flash` and `taxel provision`, in emulated worlds with the real bootloaders. The power is
cut at each flash operation: before the write, while words are erased and programmed, and after the write; then again in
the writes that follow. After each cut the complete old or new image must run, the repeated command must succeed, and
the hub must continue to poll the other board. The exit status is 1 if any of these requirements is violated.
"""

import argparse
import json
import multiprocessing
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from taxel.output import write_whole

sys.path.insert(0, str(Path(__file__).parent))

from cut_configurations import run_configurations
from cut_plan import WorldPlan, plan_worlds
from cut_runs import WorldResult, run_updates
from cut_table import build_document, build_tally, render_page, render_text

PAGE: Final = Path(__file__).resolve().parents[2] / "docs" / "flash-power-cuts.md"


def run_world(plan: WorldPlan) -> WorldResult:
    """Run the planned power cuts of one emulated world."""
    return run_configurations(plan) if plan.route.startswith("configuration") else run_updates(plan)


def run_worlds(plans: Sequence[WorldPlan], jobs: int) -> Iterator[WorldResult]:
    """Run the planned power cuts of all emulated worlds in `jobs` processes.

    Yields the results; their order is arbitrary with several processes.
    """
    if jobs == 1:
        yield from map(run_world, plans)
        return
    with multiprocessing.Pool(jobs) as pool:
        yield from pool.imap_unordered(run_world, plans)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the campaign and print its results; the exit status is 1 after a failure, or if there was no cut."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cuts", type=int, default=10_000, help="least number of cuts (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="seed of images, second cuts and torn words")
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, help="processes (default: one for each processor)"
    )
    parser.add_argument("--world", type=int, help="only the world with this number")
    parser.add_argument("--json", type=Path, help="write all results to this file as JSON")
    parser.add_argument(
        "--page", nargs="?", type=Path, const=PAGE, help="write the page (default: docs/flash-power-cuts.md)"
    )
    options = parser.parse_args(arguments)
    plans = plan_worlds(options.cuts, options.seed)
    if options.world is not None:
        plans = [plan for plan in plans if plan.number == options.world]
    results: list[WorldResult] = []
    for result in run_worlds(plans, max(options.jobs, 1)):
        results.append(result)
        if sys.stderr.isatty():
            print(f"\r{len(results)} of {len(plans)} worlds", end="", file=sys.stderr, flush=True)
    tally = build_tally(sorted(results, key=lambda result: result.number))
    print(render_text(tally, options.seed))
    if options.json is not None:
        write_whole(options.json, json.dumps(build_document(tally, options.seed), indent=2) + "\n")
    if options.page is not None:
        command = f"python tools/flash/power_cuts.py --cuts {options.cuts} --seed {options.seed} --page"
        write_whole(options.page, render_page(tally, options.seed, command))
    return 1 if tally.failures or not tally.cuts else 0


if __name__ == "__main__":
    sys.exit(main())
