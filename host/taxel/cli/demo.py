"""`taxel demo`: a sealed cause in the emulated hand, its diagnosis, and the comparison of both."""

import json
import time
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from taxel.blind.grasp_world import GraspWorld, make_grasps, make_small_plans, sample_grasp_world
from taxel.blind.sandboxed_run import SandboxedRunner
from taxel.blind.seal import commitment, verify_commitment
from taxel.cli.gap_summary import print_summary
from taxel.cli.options import Jobs
from taxel.cli.progress import stage_bars
from taxel.errors import TaxelError
from taxel.gap.page import unrolled_png, write_page

FILES = ("real.h5", "sim.h5", "report.json", "report.html", "hand.png")


def demo(
    out: Annotated[
        Path, typer.Option(help="Folder for datasets, report and pictures. Files of an earlier demo are replaced.")
    ] = Path("out/demo"),
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of the cause. Default: random.")] = None,
    jobs: Jobs = None,
) -> None:
    """Diagnose a sealed cause on the emulated hand, and compare the diagnosis with the cause.

    A cause is chosen at random, sealed and added to the emulated hand. The hand and the simulator execute the same
    grasps. A separate process diagnoses the gap from the two datasets. Then the seal is opened.

    Example: taxel demo --out out/demo
    """
    console, start_s = Console(), time.monotonic()
    real, sim, report_file, page, picture = (out / name for name in FILES)
    out.mkdir(parents=True, exist_ok=True)
    for path in (real, sim, report_file, page, picture):
        path.unlink(missing_ok=True)
    world = sample_grasp_world(seed)
    seal = commitment(world.to_json())
    console.print(
        "[bold]1. A sealed cause is added to the emulated hand[/bold]; SHA-256 of the cause with a salt of 256 bits:"
    )
    console.print(seal, highlight=False)
    _make_grasps(console, world, real, sim, jobs)
    console.print("[bold]3. A separate process diagnoses the gap from the two datasets alone[/bold]")
    _diagnose(console, out, real, sim, report_file)
    report = json.loads(report_file.read_text())
    if "error" in report:
        raise TaxelError(report["error"])
    write_page(report, page)
    unrolled_png(report, picture)
    print_summary(console, report, str(page), str(report_file))
    verify_commitment(0, world.to_json(), seal)
    _open_seal(console, world, report["verdict"]["effects"])
    console.print(f"[bold]done in {time.monotonic() - start_s:.0f} s[/bold]; picture of the hand: {picture}")


def _make_grasps(console: Console, world: GraspWorld, real: Path, sim: Path, jobs: int | None) -> None:
    """Run the grasps of the demonstration on the emulated hand and in the simulator, with progress bars.

    real, sim: datasets to write.
    """
    counts = [len(plan) for plan in make_small_plans(world.seed)]
    console.print(f"[bold]2. {counts[0]} grasps of the emulated hand, {counts[1]} of the simulator[/bold]")
    with stage_bars(console) as show:
        shows = (partial(show, "emulated hand"), partial(show, "simulator"))
        make_grasps(world, real, sim, shows, jobs)


def _diagnose(console: Console, out: Path, real: Path, sim: Path, report_file: Path) -> None:
    """Diagnose the gap between two datasets in a sandboxed process, and write the report.

    out: folder that the process cannot read.
    """
    columns = (SpinnerColumn(), TextColumn("{task.description:<12}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console) as progress:
        progress.add_task("diagnosing", total=None)
        runner = SandboxedRunner(out)
        try:
            runner.diagnose(real, sim, report_file)
        finally:
            runner.close()


def _open_seal(console: Console, world: GraspWorld, effects: list[str]) -> None:
    """Print the hidden cause and whether the diagnosis named it. effects: of the verdict, most important first."""
    (cause,) = world.hidden.causes
    console.print("\n[bold]4. The seal is opened[/bold]; the cause has the SHA-256 printed above:")
    console.print(f"cause: {cause.name}, in the emulator: {'; '.join(cause.lines)}", highlight=False)
    if effects[:1] == [cause.name]:
        further = f", and also: {', '.join(effects[1:])}" if len(effects) > 1 else ""
        console.print(f"The diagnosis named the cause{further}.")
    else:
        console.print(f"The diagnosis named: {', '.join(effects) or 'no gap'}.", highlight=False)
