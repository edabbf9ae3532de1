"""`taxel thesis`."""

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from taxel.cli.options import AsJson, Jobs, Seed, parse_seeds
from taxel.cli.progress import stage_bars
from taxel.errors import TaxelError
from taxel.thesis.gap_summary import GapSummary
from taxel.thesis.page import describe_findings, describe_seeds
from taxel.thesis.run import make_campaign, reproduce, reproduce_seeds, use_existing_campaign
from taxel.thesis.skill import GROUPS, STATISTICS
from taxel.thesis.summary import Summary


def thesis(
    out: Annotated[Path, typer.Option(help="Folder for campaigns, tables, figures and thesis.html.")],
    seed: Seed = 1,
    seeds: Annotated[
        str | None,
        typer.Option(help="Several seeds, such as 101-110: median and worst. Seeds of the settings' search: refused."),
    ] = None,
    real: Annotated[Path | None, typer.Option(help="Existing dataset of a hand, instead of a new campaign.")] = None,
    sim: Annotated[Path | None, typer.Option(help="Existing dataset of a simulator; required with --real.")] = None,
    gap: Annotated[bool, typer.Option(help="Also diagnose the gap between the two datasets; not with --seeds.")] = True,
    jobs: Jobs = None,
    as_json: AsJson = False,
) -> None:
    """Reproduce the tables and figures of the thesis, and compare them with the printed ones.

    Runs the 144 grasps on the emulated hand and in the simulator, computes the skill of the tables, and tests the
    findings of the thesis. An interrupted campaign in the folder is continued. With --seeds each seed has a folder with
    its results, and a seed with results is not run again.

    Example: taxel thesis --out out/thesis
    """
    if (real is None) != (sim is None):
        raise TaxelError("--real and --sim: expected both or none, found one; give both")
    if seeds is not None and real is not None:
        raise TaxelError("--seeds: expected new campaigns, found --real and --sim; give either seeds or datasets")
    numbers = None if seeds is None else parse_seeds(seeds, "--seeds")
    out.mkdir(parents=True, exist_ok=True)
    console = Console(stderr=as_json)
    gap_summary = None
    with stage_bars(console) as show:
        if numbers is not None:
            summary = reproduce_seeds(out, numbers, jobs, show)
        elif real is not None and sim is not None:
            summary, gap_summary = reproduce(use_existing_campaign(real, sim), out, show, with_gap=gap)
        else:
            summary, gap_summary = reproduce(make_campaign(out, seed, jobs, show), out, show, with_gap=gap)
    if as_json:
        print(json.dumps(summary.to_json(), allow_nan=False))
        return
    _print_summary(console, summary, gap_summary)
    console.print(f"{describe_findings(summary)}; page: {out / 'thesis.html'}", highlight=False, markup=False)


def _print_summary(console: Console, summary: Summary, gap: GapSummary | None) -> None:
    """Print the findings of the thesis with their reproduction, the skill of the tables, and the identified shapes.

    gap: also print the headline of the gap diagnosis; None: no diagnosis.
    """

    def show(text: str) -> None:
        """Print a line without formatting."""
        console.print(text, highlight=False, markup=False, soft_wrap=True)

    show(describe_seeds(summary))
    names = [result.printed_name for result in summary.shown_results]
    show(f"findings: {', '.join(names)} (printed number in brackets)")
    for item in summary.summarise_findings():
        finding = item.finding
        unit = "" if finding.statement.unit == "1" else f" {finding.statement.unit}"
        figures = ", ".join(
            f"{value:.3g}{unit}" + (f" ({finding.printed[name]:.3g})" if name in finding.printed else "")
            for name, value in item.numbers.items()
        )
        verdict = "reproduced" if item.is_reproduced else "not reproduced" if finding.is_counted else "not counted"
        share = f" ({item.reproduced} of {item.seeds} seeds)" if item.seeds > 1 else ""
        reason = f"; {item.reason}" if item.reason else ""
        show(f"{finding.number:2}. {finding.statement.text}\n    {figures}: {verdict}{share}{reason}")
    show(f"skill: {', '.join(STATISTICS.values())}; 0: as near to the printed values as the best single constant")
    for group in GROUPS:
        spreads = [summary.get_skill(group, column) for column in STATISTICS]
        texts = [
            "-"
            if spread is None
            else f"{spread.median:.2f}" + (f" ({spread.worst:.2f})" if len(summary.seeds) > 1 else "")
            for spread in spreads
        ]
        show(f"    {group}: {', '.join(texts)}")
    for (group, models), spread in summary.summarise_shapes().items():
        worst = f" (worst {spread.worst:.0f} %)" if len(summary.seeds) > 1 else ""
        show(f"identified {group} among {models} models: {spread.median:.0f} %{worst}")
    if gap is not None:
        show(f"gap diagnosis: {gap.headline}")
