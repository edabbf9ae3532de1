"""`taxel thesis`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from taxel.cli.options import AsJson, Jobs, Seed
from taxel.cli.progress import stage_bars
from taxel.errors import TaxelError
from taxel.thesis.findings import Finding
from taxel.thesis.run import given, make_campaign, reproduce


def thesis(
    out: Annotated[Path, typer.Option(help="Folder for campaigns, tables, figures and thesis.html.")],
    seed: Seed = 1,
    real: Annotated[Path | None, typer.Option(help="Existing dataset of a hand, instead of a new campaign.")] = None,
    sim: Annotated[Path | None, typer.Option(help="Existing dataset of a simulator; required with --real.")] = None,
    gap: Annotated[bool, typer.Option(help="Also diagnose the gap between the two datasets.")] = True,
    jobs: Jobs = None,
    as_json: AsJson = False,
) -> None:
    """Reproduce the tables and figures of the thesis beside the printed ones.

    Runs the 144 grasps on the emulated hand and in the simulator, and checks the twelve findings of the thesis. An
    interrupted campaign in the folder is continued.

    Example: taxel thesis --out out/thesis
    """
    if (real is None) != (sim is None):
        raise TaxelError("--real and --sim: expected both or none, found one; give both")
    out.mkdir(parents=True, exist_ok=True)
    console = Console(stderr=as_json)
    with stage_bars(console) as show:
        if real is not None and sim is not None:
            campaign = given(real, sim)
        else:
            campaign = make_campaign(out, seed, jobs, show)
        found, near, beside = reproduce(campaign, out, show, with_gap=gap)
    if as_json:
        print(json.dumps([one.to_json() for one in found], allow_nan=False))
        return
    _print_findings(console, found)
    console.print(near.one_line, highlight=False, markup=False, soft_wrap=True)
    if beside is not None:
        console.print(f"gap diagnosis: {beside.one_line}", highlight=False, markup=False)
    console.print(
        f"{sum(one.reproduced for one in found)} of {len(found)} findings reproduced; page: {out / 'thesis.html'}"
    )


def _print_findings(console: Console, found: list[Finding]) -> None:
    console.print(f"[bold]findings[/bold]: {', '.join(found[0].numbers)} (the thesis's number in brackets)")
    for one in found:
        unit = "" if one.unit == "1" else f" {one.unit}"
        figures = ", ".join(
            f"{one.numbers[name]:.3g}{unit} ({one.thesis[k]:g}){'' if one.holds[name] else ' no'}"
            for k, name in enumerate(one.numbers)
        )
        mark = "[green]reproduced[/green]" if one.reproduced else "[red]not reproduced[/red]"
        console.print(f"{one.number:2}. {one.says}\n    {figures}: {mark}", highlight=False, soft_wrap=True)
