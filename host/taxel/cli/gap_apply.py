"""`taxel gap apply`."""

import json
from pathlib import Path
from typing import Annotated

import typer

from taxel.cli.options import AsJson, Overwrite
from taxel.cli.progress import stage_bars
from taxel.gap.apply.apply import AppliedReport, apply_report, resimulate
from taxel.gap.effects.effect_files import add_effect_file


def apply(
    report: Annotated[Path, typer.Argument(help="report.json of taxel gap diagnose.", metavar="REPORT")],
    sim: Annotated[Path, typer.Argument(help="Grasp dataset of the simulator.", metavar="SIM.h5")],
    out: Annotated[Path, typer.Option(help="Dataset to write.")],
    resim: Annotated[
        str | None,
        typer.Option(
            help="Command of your own simulator, which computes the effects instead; {effects}, {sim} and {out} are "
            "replaced by paths.",
            metavar="COMMAND",
        ),
    ] = None,
    effects: Annotated[
        Path | None, typer.Option(help="Python file with the further effects that the report names.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of noise, drift and lost frames.")] = 0,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Add the diagnosed effects to the simulator's dataset.

    Example: taxel gap apply out/gap/report.json out/campaign/sim.h5 --out out/sim2.h5
    """
    if effects is not None:
        add_effect_file(effects)
    if resim is not None:
        result = resimulate(report, sim, out, resim, overwrite=overwrite)
    else:
        with stage_bars(hidden=as_json) as show:
            result = apply_report(report, sim, out, seed=seed, overwrite=overwrite, show=show)
    _print_result(result, as_json)


def _print_result(result: AppliedReport, as_json: bool) -> None:
    """Print the path of the written dataset, the names of the effects that it contains, and the notes.

    as_json: print one JSON object instead of text.
    """
    if as_json:
        print(json.dumps({"file": str(result.path), "effects": result.effects, "notes": result.notes}))
        return
    if result.effects:
        print(f"{result.path}: with {', '.join(name.replace('_', ' ') for name in result.effects)}")
    for note in result.notes:
        print(f"note: {note}")
