"""How fast grasps are generated on 1 and 2 workers, and how far that goes: python tools/generate/scaling.py

Two runs of different length are subtracted from each other, so that starting the processes does not count. Times of the
processor are told beside those of the wall clock: other programs on the machine lengthen the latter alone. What the
writing process spends for each grasp cannot be shared among workers; it bounds the projection.
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
from taxel.generate.recipe_file import with_report
from taxel.generate.run import generate
from taxel.generate.workers import Processes

PROJECTED = (4, 8, 16, 64, 256)
WANTED = 100_000
SHORT = 2
"""Shards of the shorter run for each worker."""


class Spent(NamedTuple):
    """Seconds: wall clock, this process's processor time, that of the processes that it started."""

    wall: float
    own: float
    workers: float

    def less(self, other: Spent) -> Spent:
        """What this took more than the other."""
        return Spent(*(a - b for a, b in zip(self, other, strict=True)))


def spent(recipe: Recipe, workers: int) -> Spent:
    """What a run takes."""

    def now() -> Spent:
        children = resource.getrusage(resource.RUSAGE_CHILDREN)
        return Spent(time.perf_counter(), time.process_time(), children.ru_utime + children.ru_stime)

    with tempfile.TemporaryDirectory() as folder:
        before = now()
        generate(recipe, Path(folder) / "out", Processes(workers))
        return now().less(before)


def per_grasp(recipe: Recipe, shards: int, workers: int) -> Spent:
    """Seconds a grasp, start-up left out."""
    short, long = (replace(recipe, grasps=recipe.shard * count) for count in (SHORT * workers, shards))
    more = spent(long, workers).less(spent(short, workers))
    return Spent(*(seconds / (long.grasps - short.grasps) for seconds in more))


def table(recipe: Recipe, shards: int) -> None:
    """Measure and print."""
    one, two = (per_grasp(recipe, shards, workers) for workers in (1, 2))
    load = os.getloadavg()[0]
    print(f"{recipe.fidelity}, {len(recipe.effects)} effects, load of the machine {load:.1f} on {os.cpu_count()} cores")
    print(f"{'workers':>9} {'wall /s':>9} {'cpu ms':>9} {'grasps/s if idle':>17} {'100,000 in hours':>17}")
    # Alone, the one worker also writes; with two, this process writes while they work.
    rates = {1: 1.0 / (one.own + one.workers), 2: min(2.0 / two.workers, 1.0 / max(two.own, 1e-9))}
    for workers, found, cpu in ((1, one, one.own + one.workers), (2, two, two.workers)):
        print(_row(str(workers), f"{1.0 / found.wall:.2f}", f"{1e3 * cpu:.0f}", rates[workers]))
    for workers in PROJECTED:
        print(_row(f"{workers} *", "", "", min(workers / two.workers, 1.0 / max(two.own, 1e-9))))
    print(f"* projected; the writing process takes {1e3 * two.own:.2f} ms a grasp")


def _row(workers: str, wall: str, cpu: str, rate: float) -> str:
    return f"{workers:>9} {wall:>9} {cpu:>9} {rate:>17.1f} {WANTED / rate / 3600.0:>17.2f}"


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description="Grasps a second on 1 and 2 workers, and projected beyond.")
    parser.add_argument("--fidelity", choices=tuple(FIDELITIES), default="quick")
    parser.add_argument("--effects", type=Path, help="report.json of taxel gap diagnose")
    parser.add_argument("--shard", type=int, default=10, help="grasps of a shard")
    parser.add_argument("--shards", type=int, default=12, help="of the longer run; more than 4")
    asked = parser.parse_args(arguments)
    recipe = Recipe(fidelity=asked.fidelity, shard=asked.shard)
    if asked.effects is not None:
        recipe = with_report(recipe, asked.effects)
    table(recipe, max(asked.shards, 2 * SHORT + 1))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
