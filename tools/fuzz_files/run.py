"""Read mutated files with every reader: no traceback, hang or excessive memory, and no wrong data without an error.

python tools/fuzz_files/run.py                                10^6 files, spread over all readers; prints the seed
python tools/fuzz_files/run.py --count 10000 --jobs 1         a short run
python tools/fuzz_files/run.py --readers hand,ply             only these readers
python tools/fuzz_files/run.py --seed 1 --reader ply --number 77     repeats one input, and stores its files if it fails

Every finding is stored in the folder --out (out/fuzz-files): the mutated files, the description, and the command that
repeats it. Exit status 1 if there is a finding. docs/development/fuzzing-of-files.md explains the rules.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools")]
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before the first import of numpy

from fuzz_files.findings import FindingStore  # noqa: E402
from fuzz_files.judgement import FINDING, OUTCOMES  # noqa: E402
from fuzz_files.registry import list_targets  # noqa: E402
from fuzz_files.supervisor import Tally, run_tasks  # noqa: E402
from fuzz_files.target import Target  # noqa: E402
from fuzz_files.worker import Task  # noqa: E402

BLOCK = 250
"""Inputs of one task: a compromise between few messages and an even distribution at the end of a run."""


def parse_options() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1_000_000, help="number of mutated files (default: 1000000)")
    parser.add_argument("--seed", type=int, help="random seed (default: from the time)")
    parser.add_argument("--readers", default="", help="names of readers, separated by commas (default: all)")
    parser.add_argument("--reader", default="", help="reader of the input --number")
    parser.add_argument("--number", type=int, help="repeat this input of --reader")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes (default: one per core)")
    parser.add_argument(
        "--limit", type=float, default=10.0, help="longest processor time of one input, s (default: 10)"
    )
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "fuzz-files", help="folder of the findings")
    return parser.parse_args()


def make_tasks(targets: dict[str, Target], seed: int, count: int) -> list[Task]:
    """Divide the inputs among the readers by their weights, and into blocks; every reader gets at least 20 inputs."""
    total = sum(target.weight for target in targets.values())
    shares = {name: max(20, round(count * target.weight / total)) for name, target in targets.items()}
    return [
        Task(name, seed, first, min(BLOCK, share - first))
        for name, share in shares.items()
        for first in range(0, share, BLOCK)
    ]


def print_tally(tally: Tally, seconds: float) -> None:
    """Print a table of the outcomes by reader."""
    print(f"{'reader':20}" + "".join(f"{outcome.replace('accepted, ', ''):>22}" for outcome in OUTCOMES))
    for name, counts in [*tally.counts.items(), ("all", tally.total())]:
        print(f"{name:20}" + "".join(f"{counts[outcome]:>22}" for outcome in OUTCOMES))
    print(f"{tally.total().total()} files in {seconds:.0f} s")


def main() -> int:
    """Run the campaign, or repeat one input; the exit status is 1 after a finding, and 2 for an unknown reader."""
    options = parse_options()
    targets = list_targets()
    wanted = [name for name in (options.reader or options.readers).split(",") if name]
    unknown = [name for name in wanted if name not in targets]
    if unknown:
        print(f"unknown reader {unknown[0]}; one of {', '.join(targets)}", file=sys.stderr)
        return 2
    seed = options.seed if options.seed is not None else time.time_ns() % 10**9
    print(f"seed {seed}", flush=True)
    selected = {name: target for name, target in targets.items() if not wanted or name in wanted}
    number = options.number
    tasks = make_tasks(selected, seed, options.count) if number is None else [Task(options.reader, seed, number, 1)]
    store = FindingStore(options.out, targets)
    start_s = time.monotonic()
    shown = sys.stderr.isatty()
    tally = run_tasks(tasks, options.jobs, options.limit, store.add, _show_progress if shown else lambda tally: None)
    print_tally(tally, time.monotonic() - start_s)
    options.out.mkdir(parents=True, exist_ok=True)
    summary = {name: dict(counts) for name, counts in tally.counts.items()}
    (options.out / "summary.json").write_text(json.dumps({"seed": seed, "readers": summary}, indent=1) + "\n")
    store.print_summary()
    return 1 if tally.total()[FINDING] or store.count else 0


def _show_progress(tally: Tally) -> None:
    """Print the number of files and findings so far, on the same line of a terminal."""
    print(f"\r{tally.total().total()} files, {tally.total()[FINDING]} findings", end="", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
