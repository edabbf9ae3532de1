"""Measure the generation rate of grasps with 1 and 2 workers, and project it: python tools/generate/scaling.py

The times of a short run are subtracted from those of a long run, which removes the start of the processes. Processor
times are printed beside wall-clock times, because other programs on the computer affect the wall-clock times only. The
time of the writing process for each grasp cannot be divided among workers and bounds the projection.
"""

from __future__ import annotations

import argparse
import os
import resource
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from taxel.generate.recipe import FIDELITIES, Recipe
from taxel.generate.recipe_file import add_report
from taxel.generate.run import generate
from taxel.generate.workers import Processes

PROJECTED_WORKERS = (4, 8, 16, 64, 256)
PROJECTED_GRASPS = 100_000
SHORT_SHARDS = 2
"""Shards of the short run for each worker."""


class RunTime(NamedTuple):
    """Times of a run in seconds: wall clock, processor time of this process, processor time of the worker processes."""

    wall: float
    own: float
    workers: float

    def subtract(self, other: RunTime) -> RunTime:
        """Return the differences between the times of this run and of another run."""
        return RunTime(*(a - b for a, b in zip(self, other, strict=True)))


def measure_run(recipe: Recipe, workers: int) -> RunTime:
    """Generate grasps with `workers` processes and return the times."""

    def read_times() -> RunTime:
        """Return the wall-clock time, and the processor times of this process and of its child processes, until now."""
        children = resource.getrusage(resource.RUSAGE_CHILDREN)
        return RunTime(time.perf_counter(), time.process_time(), children.ru_utime + children.ru_stime)

    with tempfile.TemporaryDirectory() as folder:
        before = read_times()
        generate(recipe, Path(folder) / "out", Processes(workers))
        return read_times().subtract(before)


def measure_per_grasp(recipe: Recipe, shards: int, workers: int) -> RunTime:
    """Measure the times per generated grasp, without the start of the processes.

    The difference of a long and a short run removes the time of the start. shards: number of files of the long run.
    """
    short, long = (
        replace(recipe, grasps=recipe.grasps_per_shard * count) for count in (SHORT_SHARDS * workers, shards)
    )
    difference = measure_run(long, workers).subtract(measure_run(short, workers))
    return RunTime(*(seconds / (long.grasps - short.grasps) for seconds in difference))


def print_table(recipe: Recipe, shards: int) -> None:
    """Measure and print the grasps per second for 1 and 2 workers, and the projection to more workers."""
    one, two = (measure_per_grasp(recipe, shards, workers) for workers in (1, 2))
    load = os.getloadavg()[0]
    print(f"{recipe.fidelity}, {len(recipe.effects)} effects, load of the machine {load:.1f} on {os.cpu_count()} cores")
    print(f"{'workers':>9} {'wall /s':>9} {'cpu ms':>9} {'grasps/s if idle':>17} {'100,000 in hours':>17}")
    # A single worker also writes the files; with two workers this process writes while they work.
    rates = {1: 1.0 / (one.own + one.workers), 2: min(2.0 / two.workers, 1.0 / max(two.own, 1e-9))}
    for workers, times, cpu in ((1, one, one.own + one.workers), (2, two, two.workers)):
        print(_format_row(str(workers), f"{1.0 / times.wall:.2f}", f"{1e3 * cpu:.0f}", rates[workers]))
    for workers in PROJECTED_WORKERS:
        print(_format_row(f"{workers} *", "", "", min(workers / two.workers, 1.0 / max(two.own, 1e-9))))
    print(f"* projected; the writing process takes {1e3 * two.own:.2f} ms for each grasp")


def _format_row(workers: str, wall: str, cpu: str, rate: float) -> str:
    """Return a table row: workers, grasps per second, processor time, then the figures for an idle machine.

    rate: grasps per second on an idle machine; the last column is the number of hours for 100,000 grasps.
    """
    return f"{workers:>9} {wall:>9} {cpu:>9} {rate:>17.1f} {PROJECTED_GRASPS / rate / 3600.0:>17.2f}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure the generation rate with the settings of the command line."""
    parser = argparse.ArgumentParser(description="Grasps per second with 1 and 2 workers, and a projection.")
    parser.add_argument("--fidelity", choices=tuple(FIDELITIES), default="quick")
    parser.add_argument("--effects", type=Path, help="report.json of taxel gap diagnose")
    parser.add_argument("--shard", type=int, default=10, help="grasps of a shard")
    parser.add_argument("--shards", type=int, default=12, help="shards of the long run; more than 4")
    options = parser.parse_args(arguments)
    recipe = Recipe(fidelity=options.fidelity, grasps_per_shard=options.shard)
    if options.effects is not None:
        recipe = add_report(recipe, options.effects)
    print_table(recipe, max(options.shards, 2 * SHORT_SHARDS + 1))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
