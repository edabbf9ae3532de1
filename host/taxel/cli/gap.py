"""`taxel gap`: where the gap between simulator and hand lies, which effect causes it, how far it shrinks."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from taxel.cli.gap_apply import apply
from taxel.cli.gap_blind import blind
from taxel.cli.gap_next import next_press
from taxel.cli.gap_summary import print_summary
from taxel.cli.stages import stage_bars
from taxel.errors import TaxelError
from taxel.gap.diagnosis import diagnose as run
from taxel.gap.page import write_page
from taxel.gap.priors import read_priors

gap_app = typer.Typer(
    help="Where simulator and hand disagree, which effect causes it, and how far the gap shrinks.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)
gap_app.command()(apply)
gap_app.command()(blind)
gap_app.command(name="next")(next_press)


@gap_app.command()
def diagnose(
    real: Annotated[Path, typer.Argument(help="Grasp dataset of the hand.", metavar="REAL.h5")],
    sim: Annotated[Path, typer.Argument(help="Grasp dataset of the simulator.", metavar="SIM.h5")],
    out: Annotated[Path, typer.Option(help="Folder for report.json and report.html.")],
    without: Annotated[list[str] | None, typer.Option(help="An effect that is not tried; may be repeated.")] = None,
    priors: Annotated[Path | None, typer.Option(help="TOML file of what is known of the effects' parameters.")] = None,
    seed: Annotated[int, typer.Option(help="Of the draws behind the p-values.")] = 0,
    nested: Annotated[
        bool,
        typer.Option("--nested", help="Search again without each session, and judge there what that finds: slower."),
    ] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a report that is there.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    """Diagnose the gap between two grasp datasets.

    Example: taxel gap diagnose out/campaign/real.h5 out/campaign/sim.h5 --out out/gap
    """
    if seed < 0:
        raise TaxelError(f"--seed: expected 0 or more, found {seed}")
    report, page = out / "report.json", out / "report.html"
    for path in (report, page):
        if path.exists() and not overwrite:
            raise TaxelError(f"{path}: exists already; choose another --out or --overwrite it")
    _check_folder(out)
    console = Console(stderr=as_json, markup=False)
    with stage_bars(console) as show:
        diagnosis = run(real, sim, without or (), seed, show, read_priors(priors) if priors else {}, nested)
    out.mkdir(parents=True, exist_ok=True)
    text = json.dumps(diagnosis.report, allow_nan=False)
    with tempfile.TemporaryDirectory(prefix=".report.", dir=out) as folder:
        # Both are whole before either takes the place of an old one.
        written = Path(folder) / report.name, Path(folder) / page.name
        written[0].write_text(text)
        write_page(json.loads(text), written[1])
        for made, path in zip(written, (report, page), strict=True):
            made.replace(path)
    if as_json:
        print(text)
    else:
        print_summary(console, diagnosis.report)
        console.print(f"report: {page}", highlight=False)


def _check_folder(out: Path) -> None:
    """Before anything is worked out for it. Raises TaxelError of one line."""
    there = next(path for path in (out, *out.absolute().parents) if path.exists())
    if not there.is_dir() or not os.access(there, os.W_OK):
        why = "may not be written to" if there.is_dir() else "is no folder"
        raise TaxelError(f"--out {out}: {there} {why}; choose another one")
    for path in (out / "report.json", out / "report.html"):
        if path.is_dir():
            raise TaxelError(f"{path}: is a folder; choose another --out")
