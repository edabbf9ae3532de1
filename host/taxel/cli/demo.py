"""`taxel demo`: a sealed cause in the emulated hand, its diagnosis, and the comparison of both."""

import json
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from taxel.blind.cause_sizes import CauseSizes
from taxel.blind.demo_outcome import DemoOutcome, format_score, judge
from taxel.blind.grasp_world import (
    GraspWorld,
    GraspWorldSampler,
    emulate_grasps,
    make_small_plans,
    measure_sizes,
    simulate_grasps,
)
from taxel.blind.large_causes import sample_large_world
from taxel.blind.loaded_locations import SimulatedLoads
from taxel.blind.sandboxed_run import SandboxedRunner
from taxel.blind.seal import commitment, verify_commitment
from taxel.campaign.performed_grasp import GraspMemory
from taxel.cli.gap_summary import print_summary
from taxel.cli.options import Jobs
from taxel.cli.progress import stage_bars
from taxel.errors import TaxelError
from taxel.gap.calibration.calibration import SMALLEST_CAUSE
from taxel.gap.page import unrolled_png, write_page
from taxel.output import write_whole

PICTURE, SCORE = "hand.png", "score.json"
FILES = ("real.h5", "sim.h5", "report.json", "report.html", PICTURE)
WITHOUT_CAUSE = "without_cause.h5"
"""First session of the emulated hand without a cause. It is removed at the end."""

MOST_LINES = 3
"""Largest number of printed effect lines (lines of the emulator's world file) of a cause."""

_RESULT = {True: "RIGHT", False: "WRONG"}


def demo(
    out: Annotated[
        Path, typer.Option(help="Folder for datasets, report and pictures. Files of an earlier demo are replaced.")
    ] = Path("out/demo"),
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of the cause. Default: random.")] = None,
    repeat: Annotated[
        int, typer.Option(min=1, max=10_000, help="Number of demonstrations, each with another cause, with a score.")
    ] = 1,
    jobs: Jobs = None,
) -> None:
    """Diagnose a sealed cause on the emulated hand, and compare the diagnosis with the cause.

    The simulator and the emulated hand execute the same grasps. A cause, two, or none is chosen at random, sealed and
    added to the emulated hand. If possible, a cause alone produces a gap of two floors or more: trial grasps show this
    before the cause is sealed. A separate process diagnoses the gap from the two datasets. Then the seal is opened, and
    the diagnosis is right or wrong. A cause that alone produces less than half the floor does not count. With --repeat,
    one line per demonstration is printed, and out/score.json is written.

    Example: taxel demo --out out/demo
    """
    console, start_s = Console(), time.monotonic()
    out.mkdir(parents=True, exist_ok=True)
    if repeat > 1:
        _repeat_demonstrations(console, out, seed, repeat, jobs)
        return
    outcome, world = _run_demonstration(console, out, seed, jobs)
    _open_seal(console, world, outcome)
    seconds = f"[bold]done in {time.monotonic() - start_s:.0f} s[/bold]"
    console.print(f"{seconds}; picture of the hand: {out / PICTURE}", soft_wrap=True)


def _run_demonstration(
    console: Console, out: Path, seed: int | None, jobs: int | None
) -> tuple[DemoOutcome, GraspWorld]:
    """Run one demonstration and print it, except the hidden causes; return (outcome, world with the hidden causes).

    The datasets, the report, the page and the picture are written to the folder `out`. Raises TaxelError with a
    one-line message if the diagnosis fails.
    """
    real, sim, report_file, page, picture = (out / name for name in FILES)
    without = out / WITHOUT_CAUSE
    for path in (real, sim, report_file, page, picture, without):
        path.unlink(missing_ok=True)
    sampler, memory, cause_sizes = GraspWorldSampler(seed), GraspMemory(), CauseSizes(sim)
    counts = [len(plan) for plan in make_small_plans(sampler.campaign_seed)]
    console.print(f"[bold]1. {counts[1]} grasps in the simulator, without a cause[/bold]")
    with stage_bars(console) as show:
        simulate_grasps(sampler.campaign_seed, sim, partial(show, "simulator"), jobs)
    console.print("[bold]2. A cause is sampled and sealed[/bold]")
    with stage_bars(console) as show:
        loads, progress = SimulatedLoads.read(sim), partial(show, "trial grasps")
        world = sample_large_world(sampler, loads, cause_sizes, without, progress, jobs, memory)
    seal = commitment(world.to_json())
    console.print("SHA-256 of the cause with a salt of 256 bits:")
    console.print(seal, highlight=False)
    console.print(f"[bold]3. {counts[0]} grasps of the emulated hand with this cause[/bold]")
    with stage_bars(console) as show:
        emulate_grasps(world, real, partial(show, "emulated hand"), jobs, memory)
    console.print("[bold]4. A separate process diagnoses the gap from the two datasets alone[/bold]")
    _diagnose(console, out, real, sim, report_file)
    report = json.loads(report_file.read_text())
    if "error" in report:
        raise TaxelError(report["error"])
    write_page(report, page)
    unrolled_png(report, picture)
    print_summary(console, report, str(page), str(report_file))
    verify_commitment(0, world.to_json(), seal)  # 0: number of the world in the error message
    console.print("\n[bold]5. The seal is opened[/bold]; the causes have the SHA-256 printed above:")
    with stage_bars(console, hidden=len(world.hidden.causes) < 2) as show:  # a single cause needs no further grasps
        sizes = measure_sizes(world, real, without, cause_sizes, partial(show, "size of the cause"), jobs, memory)
    without.unlink(missing_ok=True)
    return judge(world, sizes, report["verdict"]), world


def _repeat_demonstrations(console: Console, out: Path, seed: int | None, repeat: int, jobs: int | None) -> None:
    """Run `repeat` demonstrations with successive seeds; print one line for each, with the score so far.

    score.json in the folder `out` contains the outcomes of all demonstrations; the other files are those of the last
    one.
    """
    silent = Console(quiet=True)
    outcomes: list[DemoOutcome] = []
    for number in range(repeat):
        start_s = time.monotonic()
        outcome, _ = _run_demonstration(silent, out, None if seed is None else seed + number, jobs)
        outcomes.append(outcome)
        write_whole(out / SCORE, json.dumps([finished.to_json() for finished in outcomes], indent=1))
        right = sum(finished.is_right for finished in outcomes)
        console.print(
            f"{number + 1:4d}  {_RESULT[outcome.is_right]}  hidden: {_describe_hidden(outcome)}; "
            f"named: {_join_names(outcome.named)}; {right} of {number + 1} right; {time.monotonic() - start_s:.0f} s",
            soft_wrap=True,
            highlight=False,
        )
    console.print(format_score(outcomes), soft_wrap=True, highlight=False)


def _diagnose(console: Console, out: Path, real: Path, sim: Path, report_file: Path) -> None:
    """Diagnose the gap between two datasets in a sandboxed process, and write its report to `report_file`.

    out: folder that the sandboxed process cannot read, because it could contain hidden causes.
    """
    columns = (SpinnerColumn(), TextColumn("{task.description:<12}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console) as progress:
        progress.add_task("diagnosing", total=None)
        runner = SandboxedRunner(out)
        try:
            runner.diagnose(real, sim, report_file)
        finally:
            runner.close()


def _open_seal(console: Console, world: GraspWorld, outcome: DemoOutcome) -> None:
    """Print the hidden causes with their sizes, the causes named by the diagnosis, and whether the diagnosis is right.

    The size of a cause is the gap that the cause alone produces, in multiples of the floor.
    """
    for cause, size in zip(world.hidden.causes, outcome.sizes, strict=True):
        console.print(
            f"hidden: {cause.name}, alone {size:.1f} floors; in the emulator: {_shorten(cause.lines)}",
            highlight=False,
            soft_wrap=True,
        )
        if size < SMALLEST_CAUSE:
            console.print(f"{cause.name} does not count as a cause: {SMALLEST_CAUSE:g} floors are needed.")
    if not world.hidden.causes:
        console.print("hidden: nothing", highlight=False)
    colour = "green" if outcome.is_right else "red"
    console.print(
        f"[bold {colour}]{_RESULT[outcome.is_right]}[/]: the diagnosis named {_join_names(outcome.named)}.",
        highlight=False,
    )


def _shorten(lines: Sequence[str]) -> str:
    """Join the first `MOST_LINES` effect lines of a cause, and append the number of further lines.

    The number can be large: a dead board has a line for each taxel.
    """
    more = len(lines) - MOST_LINES
    return "; ".join(lines[:MOST_LINES]) + (f"; and {more} more lines" if more > 0 else "")


def _describe_hidden(outcome: DemoOutcome) -> str:
    """Describe the causes that a correct diagnosis names, and in brackets all hidden effects with their sizes.

    A hidden effect that alone produces too small a gap is not expected to be named.
    """
    variants = [f"{variant}, {size:.1f} floors" for variant, size in zip(outcome.hidden, outcome.sizes, strict=True)]
    return f"{_join_names(outcome.expected)} ({'; '.join(variants) or 'no effect'})"


def _join_names(names: Sequence[str]) -> str:
    return ", ".join(names) or "no cause"
