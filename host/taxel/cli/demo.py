"""`taxel demo`: the main job. A hand departs from its simulator in a way that nobody chose; the diagnosis names it."""

from __future__ import annotations

import json
import time
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from taxel.blind.grasp_world import GraspWorld, drawn_grasp_world, make_grasps, small_plans
from taxel.blind.lane import Lane
from taxel.blind.seal import check, commitment
from taxel.cli.gap_summary import print_summary
from taxel.cli.stages import stage_bars
from taxel.errors import TaxelError
from taxel.gap.page import unrolled_png, write_page

FILES = ("real.h5", "sim.h5", "report.json", "report.html", "hand.png")


def demo(
    out: Annotated[
        Path, typer.Option(help="Folder for datasets, report and pictures; an older demo is replaced.")
    ] = Path("out/demo"),
    seed: Annotated[int | None, typer.Option(help="Repeat a demo; default: the system's random numbers.")] = None,
    jobs: Annotated[int, typer.Option(help="Processes; 0: one a core.")] = 0,
) -> None:
    """Hide an effect in the emulated hand, grasp with it and in the simulator, diagnose the gap, then open the seal.

    Example: taxel demo --out out/demo
    """
    if (seed is not None and seed < 0) or jobs < 0:
        raise TaxelError("--seed and --jobs: expected 0 or more; correct the number")
    console, began = Console(), time.monotonic()
    real, sim, report, page, picture = (out / name for name in FILES)
    out.mkdir(parents=True, exist_ok=True)
    for path in (real, sim, report, page, picture):
        path.unlink(missing_ok=True)
    world = drawn_grasp_world(seed)
    sealed = commitment(world.to_json())
    console.print("[bold]1. A cause is hidden in the emulated hand[/bold]; its SHA-256 with a salt of 256 bit:")
    console.print(sealed, highlight=False)
    _grasp(console, world, real, sim, jobs or None)
    console.print("[bold]3. Another process, which sees the two datasets alone, diagnoses the gap[/bold]")
    _diagnose(console, out, real, sim, report)
    found = json.loads(report.read_text())
    if "error" in found:
        raise TaxelError(found["error"])
    write_page(found, page)
    unrolled_png(found, picture)
    print_summary(console, found)
    check(0, world.to_json(), sealed)
    _open(console, world, found["verdict"]["effects"])
    console.print(
        f"[bold]done in {time.monotonic() - began:.0f} s[/bold]; the page: {page}, the hand before and after: {picture}"
    )


def _grasp(console: Console, world: GraspWorld, real: Path, sim: Path, jobs: int | None) -> None:
    counts = [len(plan) for plan in small_plans(world.seed)]
    console.print(f"[bold]2. {counts[0]} grasps by that hand, {counts[1]} in the simulator[/bold]")
    with stage_bars(console) as show:
        shows = (partial(show, "emulated hand"), partial(show, "simulator"))
        make_grasps(world, real, sim, shows, jobs)


def _diagnose(console: Console, out: Path, real: Path, sim: Path, report: Path) -> None:
    columns = (SpinnerColumn(), TextColumn("{task.description:<12}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console) as progress:
        progress.add_task("diagnosing", total=None)
        lane = Lane(out)
        try:
            lane.diagnose(real, sim, report)
        finally:
            lane.close()


def _open(console: Console, world: GraspWorld, said: list[str]) -> None:
    (cause,) = world.hidden.causes
    console.print("\n[bold]4. The seal is opened[/bold], and fits what was published above:")
    console.print(f"hidden: {cause.name}, in the emulator's words: {'; '.join(cause.lines)}", highlight=False)
    if said[:1] == [cause.name]:
        console.print("the diagnosis named it" + ("." if len(said) == 1 else f", and besides: {', '.join(said[1:])}."))
    else:
        console.print(f"the diagnosis said: {', '.join(said) or 'no gap'}.", highlight=False)
