"""`taxel thesis`."""

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from taxel.cli.options import AsJson, Jobs, Seed
from taxel.cli.progress import stage_bars
from taxel.errors import TaxelError
from taxel.thesis.findings import Finding
from taxel.thesis.run import make_campaign, reproduce, use_existing_campaign


def thesis(
    out: Annotated[Path, typer.Option(help="Folder for campaigns, tables, figures and thesis.html.")],
    seed: Seed = 1,
    real: Annotated[Path | None, typer.Option(help="Existing dataset of a hand, instead of a new campaign.")] = None,
    sim: Annotated[Path | None, typer.Option(help="Existing dataset of a simulator; required with --real.")] = None,
    gap: Annotated[bool, typer.Option(help="Also diagnose the gap between the two datasets.")] = True,
    jobs: Jobs = None,
    as_json: AsJson = False,
) -> None:
    """Reproduce the tables and figures of the thesis, and compare them with the printed ones.

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
            campaign = use_existing_campaign(real, sim)
        else:
            campaign = make_campaign(out, seed, jobs, show)
        findings, agreement, gap_summary = reproduce(campaign, out, show, with_gap=gap)
    if as_json:
        print(json.dumps([finding.to_json() for finding in findings], allow_nan=False))
        return
    _print_findings(console, findings)
    console.print(agreement.summary, highlight=False, markup=False, soft_wrap=True)
    if gap_summary is not None:
        console.print(f"gap diagnosis: {gap_summary.headline}", highlight=False, markup=False)
    reproduced = sum(finding.is_reproduced for finding in findings)
    console.print(f"{reproduced} of {len(findings)} findings reproduced; page: {out / 'thesis.html'}")


def _print_findings(console: Console, findings: list[Finding]) -> None:
    """Print each finding of the thesis with its reproduced numbers and the printed numbers."""
    console.print(f"[bold]findings[/bold]: {', '.join(findings[0].numbers)} (printed number in brackets)")
    for finding in findings:
        unit = "" if finding.unit == "1" else f" {finding.unit}"
        figures = ", ".join(
            f"{finding.numbers[name]:.3g}{unit} ({finding.printed[k]:g}){'' if finding.holds[name] else ', not met'}"
            for k, name in enumerate(finding.numbers)
        )
        mark = "[green]reproduced[/green]" if finding.is_reproduced else "[red]not reproduced[/red]"
        console.print(
            f"{finding.number:2}. {finding.statement}\n    {figures}: {mark}", highlight=False, soft_wrap=True
        )
