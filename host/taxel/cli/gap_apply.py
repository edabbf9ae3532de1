"""`taxel gap apply`: the simulation with the effects that a diagnosis found."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from taxel.cli.stages import stage_bars
from taxel.errors import TaxelError
from taxel.gap.adding.apply import Applied, apply_report, resimulate


def apply(
    report: Annotated[Path, typer.Argument(help="report.json of taxel gap diagnose.", metavar="REPORT")],
    sim: Annotated[Path, typer.Argument(help="Grasp dataset of the simulator.", metavar="SIM.h5")],
    out: Annotated[Path, typer.Option(help="The dataset to write.")],
    resim: Annotated[
        str,
        typer.Option(help="Run your own simulator instead; {effects}, {sim}, {out} become paths.", metavar="COMMAND"),
    ] = "",
    seed: Annotated[int, typer.Option(help="Of noise, drifts and lost frames.")] = 0,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file if it exists.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was done as JSON.")] = False,
) -> None:
    """Write the simulator's dataset with the diagnosed effects added.

    Example: taxel gap apply out/gap/report.json out/campaign/sim.h5 --out out/sim2.h5
    """
    if seed < 0:
        raise TaxelError(f"--seed: expected 0 or more, found {seed}")
    if resim:
        done = resimulate(report, sim, out, resim, overwrite=overwrite)
    else:
        with stage_bars(hidden=as_json) as show:
            done = apply_report(report, sim, out, seed=seed, overwrite=overwrite, show=show)
    _say(done, as_json)


def _say(done: Applied, as_json: bool) -> None:
    if as_json:
        print(json.dumps({"file": str(done.path), "effects": done.effects, "notes": done.notes}))
        return
    if done.effects:
        print(f"{done.path}: with {', '.join(name.replace('_', ' ') for name in done.effects)}")
    for note in done.notes:
        print(f"note: {note}")
