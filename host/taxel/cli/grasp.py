"""`taxel grasp`: the grasp campaign."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from taxel.campaign.emulated import run_emulated
from taxel.campaign.physical import PhysicalSettings, run_physical
from taxel.campaign.point_counts import count_contact_points
from taxel.campaign.settings import EmulatedSettings, parse_effects
from taxel.campaign.setup import Setup
from taxel.campaign.simulated import SimSettings, run_simulated
from taxel.cli.station import physical_station
from taxel.errors import TaxelError
from taxel.grasp.calibration import load_calibration
from taxel.grasp.plan import PlannedGrasp, thesis_plan
from taxel.sim.sensing import LEVELS, Level, Sensing

SOURCES = ("emulated", "sim", "physical", "both")


def grasp(
    source: Annotated[str, typer.Option(help=f"{', '.join(SOURCES)} (real.h5 and sim.h5 into a folder).")],
    out: Annotated[Path, typer.Option(help="The dataset to write; for both, a folder.")],
    seed: Annotated[int, typer.Option(help="Decides order, scatter and noise.")] = 1,
    sessions: Annotated[int, typer.Option(help="Mountings of the skin among which the grasps are dealt out.")] = 6,
    grasps: Annotated[int, typer.Option(help="Only the first so many of the 144; 0: all.")] = 0,
    objects: Annotated[str, typer.Option(help="Only these objects, apart by commas.")] = "",
    effects: Annotated[
        str, typer.Option(help="Emulated: thesis, none, or lines such as 'spread film length_m=0.002'.")
    ] = "thesis",
    sensing: Annotated[str, typer.Option(help=f"Simulated: {', '.join(LEVELS)}.")] = "layer",
    calibration: Annotated[Path | None, typer.Option(help="Measured poses of the objects (TOML).")] = None,
    skin: Annotated[str, typer.Option(help="Physical: URL of the skin.")] = "serial:///dev/ttyUSB0",
    can: Annotated[str, typer.Option(help="Physical: CAN channel of the hand.")] = "can:socketcan:can0",
    arm: Annotated[str, typer.Option(help="Physical: rtde:HOST, or simulated.")] = "rtde:192.168.0.100",
    jobs: Annotated[int, typer.Option(help="Processes; 0: one a core.")] = 0,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with a campaign that was cut.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file if it exists.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was made as JSON.")] = False,
) -> None:
    """Make a campaign of the thesis's 144 grasps and write it as a grasp dataset.

    Examples: taxel grasp --source both --out out/campaign; taxel grasp --source sim --grasps 10 --out sim.h5
    """
    plan = _plan(seed, sessions, grasps, objects)
    setup = Setup(calibration=load_calibration(calibration) if calibration is not None else None)
    emulated = EmulatedSettings(seed=seed, effects=parse_effects(effects))
    sim = SimSettings(seed=seed, sensing=Sensing(_level(sensing)))
    if jobs < 0:
        raise TaxelError(f"--jobs: expected 0 (one a core) or more, found {jobs}")
    console = Console(stderr=as_json, markup=False)
    paths = _paths(source, out, overwrite or resume)
    if "emulated" in paths:
        path = paths["emulated"]
        with _bar(console, f"emulated hand to {path}") as show:
            run_emulated(path, plan, emulated, setup, jobs or None, overwrite, resume, show)
    if "sim" in paths:
        path = paths["sim"]
        with _bar(console, f"simulator to {path}") as show:
            run_simulated(path, plan, sim, setup, jobs or None, overwrite, resume, show)
    if "physical" in paths:
        path = paths["physical"]
        with physical_station(arm, can, skin, setup.hand) as station, _bar(console, f"hand to {path}") as show:
            run_physical(path, plan, station, PhysicalSettings(confirm_placement=_ask), setup, overwrite, resume, show)
    _report(console, list(paths.values()), as_json)


def _paths(source: str, out: Path, may_exist: bool) -> dict[str, Path]:
    """The datasets to make, by what makes them; refused before any is begun."""
    if source not in SOURCES:
        raise TaxelError(f"--source: expected {', '.join(SOURCES)}, found '{source}'")
    if source != "both":
        paths = {source: out}
    else:
        paths = {"emulated": out / "real.h5", "sim": out / "sim.h5"}
    for path in paths.values():
        if path.exists() and not may_exist:
            raise TaxelError(f"{path}: exists already; choose another --out, --resume it or --overwrite it")
    if source == "both":
        out.mkdir(parents=True, exist_ok=True)
    return paths


def _plan(seed: int, sessions: int, grasps: int, objects: str) -> tuple[PlannedGrasp, ...]:
    if seed < 0:
        raise TaxelError(f"--seed: expected 0 or more, found {seed}")
    try:
        plan = thesis_plan(seed, sessions)
    except ValueError as error:
        raise TaxelError(f"--{error}") from None
    wanted = [name.strip() for name in objects.split(",") if name.strip()]
    known = sorted({planned.object for planned in plan})
    for name in wanted:
        if name not in known:
            raise TaxelError(f"--objects: expected some of {', '.join(known)}, found '{name}'")
    plan = tuple(planned for planned in plan if not wanted or planned.object in wanted)
    if grasps < 0:
        raise TaxelError(f"--grasps: expected 0 (all) or more, found {grasps}")
    return plan[:grasps] if grasps else plan


def _level(name: str) -> Level:
    for level in LEVELS:
        if level == name:
            return level
    raise TaxelError(f"--sensing: expected {', '.join(LEVELS)}, found '{name}'")


def _ask(planned: PlannedGrasp) -> None:
    typer.prompt(
        f"session {planned.session}: put the {planned.object} in its place, then press Enter",
        default="",
        show_default=False,
    )


class _bar:  # noqa: N801 - a context manager used like a function
    """A progress bar over grasps that also says how many a second."""

    def __init__(self, console: Console, title: str) -> None:
        self._progress = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("grasps"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=console,
        )
        self._title = title

    def __enter__(self) -> Any:
        self._progress.start()
        self._task = self._progress.add_task(self._title, total=None)
        self._began = time.monotonic()
        return lambda done, of: self._progress.update(self._task, completed=done, total=of)

    def __exit__(self, *_: object) -> None:
        self._progress.stop()


def _report(console: Console, paths: list[Path], as_json: bool) -> None:
    counted = {str(path): count_contact_points(path) for path in paths}
    if as_json:
        print(
            json.dumps({path: {name: vars(count) for name, count in found.items()} for path, found in counted.items()})
        )
        return
    table = Table(title="contact points (front of the hand without the middle and pinkie fingertips, as in Table 5.2)")
    for heading in ("file", "object", "grasps", "points", "a grasp"):
        table.add_column(heading, justify="left" if heading in {"file", "object"} else "right")
    for path, found in counted.items():
        for name, count in found.items():
            table.add_row(
                path, name, str(count.grasps), str(count.points), f"{count.points / max(count.grasps, 1):.1f}"
            )
    console.print(table)
