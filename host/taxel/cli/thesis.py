"""`taxel thesis`: the thesis's tables, figures and findings, ours beside its own."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from taxel.cli.stages import stage_bars
from taxel.errors import TaxelError
from taxel.thesis.findings import Finding
from taxel.thesis.run import given, make_campaign, reproduce


def thesis(
    out: Annotated[Path, typer.Option(help="Folder for campaigns, tables, figures and thesis.html.")],
    seed: Annotated[int, typer.Option(help="Of the campaigns.")] = 1,
    real: Annotated[Path | None, typer.Option(help="A grasp dataset to use instead; with --sim.")] = None,
    sim: Annotated[Path | None, typer.Option(help="The simulator's dataset; with --real.")] = None,
    gap: Annotated[bool, typer.Option(help="Diagnose the gap of the same data too.")] = True,
    jobs: Annotated[int, typer.Option(help="Processes; 0: one a core.")] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
) -> None:
    """Repeat the thesis's experiments: 144 grasps of both sides, every table and figure, the twelve findings.

    A campaign that is in the folder is gone on with. Example: taxel thesis --out out/thesis
    """
    if seed < 0 or jobs < 0:
        raise TaxelError("--seed and --jobs: expected 0 or more; correct the number")
    if (real is None) != (sim is None):
        raise TaxelError("--real and --sim: expected both or none; give the other one too")
    out.mkdir(parents=True, exist_ok=True)
    console = Console(stderr=as_json)
    with stage_bars(console) as show:
        if real is not None and sim is not None:
            campaign = given(real, sim)
        else:
            campaign = make_campaign(out, seed, jobs or None, show)
        found, near, beside = reproduce(campaign, out, show, with_gap=gap)
    if as_json:
        print(json.dumps([one.to_json() for one in found], allow_nan=False))
        return
    _say(console, found)
    console.print(near.one_line, highlight=False, markup=False, soft_wrap=True)
    if beside is not None:
        console.print(f"gap diagnosis: {beside.one_line}", highlight=False, markup=False)
    console.print(
        f"{sum(one.reproduced for one in found)} of {len(found)} findings reproduced; page: {out / 'thesis.html'}"
    )


def _say(console: Console, found: list[Finding]) -> None:
    console.print(f"[bold]findings[/bold]: {', '.join(found[0].numbers)} (the thesis's number in brackets)")
    for one in found:
        unit = "" if one.unit == "1" else f" {one.unit}"
        figures = ", ".join(
            f"{one.numbers[name]:.3g}{unit} ({one.thesis[k]:g}){'' if one.holds[name] else ' no'}"
            for k, name in enumerate(one.numbers)
        )
        mark = "[green]reproduced[/green]" if one.reproduced else "[red]not reproduced[/red]"
        console.print(f"{one.number:2}. {one.says}\n    {figures}: {mark}", highlight=False, soft_wrap=True)
