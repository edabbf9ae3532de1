"""`taxel gap`: diagnosis of the gap between simulator and hand."""

import json
import os
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from taxel.cli.gap_apply import apply
from taxel.cli.gap_benchmark import benchmark
from taxel.cli.gap_blind import blind
from taxel.cli.gap_export import export
from taxel.cli.gap_map import print_gap_map
from taxel.cli.gap_next import rank_contacts
from taxel.cli.gap_summary import print_summary
from taxel.cli.open_page import offer_page
from taxel.cli.options import AsJson, Overwrite
from taxel.cli.progress import stage_bars
from taxel.errors import TaxelError
from taxel.gap.apply.resimulation import BUILTIN, DEFAULT_BUDGET, Resimulator
from taxel.gap.diagnosis import diagnose as run
from taxel.gap.effects.effect_files import add_effect_file
from taxel.gap.fitting.priors import read_priors
from taxel.gap.page import page_text
from taxel.output import open_whole
from taxel.recording.general.dataset import read_hand_name, read_source, read_version
from taxel.recording.grasp_format import REAL, SIM, VERSION

gap_app = typer.Typer(
    help="Diagnose the gap between simulator and hand: location, cause, and reduction.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)
gap_app.command()(apply)
gap_app.command()(blind)
gap_app.command()(benchmark)
gap_app.command()(export)
gap_app.command(name="next")(rank_contacts)


@gap_app.command()
def diagnose(
    real: Annotated[Path, typer.Argument(help="Grasp dataset of the hand.", metavar="REAL.h5")],
    sim: Annotated[Path, typer.Argument(help="Grasp dataset of the simulator.", metavar="SIM.h5")],
    out: Annotated[Path, typer.Option(help="Folder for report.json and report.html.")],
    without: Annotated[list[str] | None, typer.Option(help="Effect to exclude; repeatable.")] = None,
    effects: Annotated[
        Path | None, typer.Option(help="Python file with further effects (VARIANTS), see how-to-add-an-effect.md.")
    ] = None,
    priors: Annotated[Path | None, typer.Option(help="TOML file with priors on effect parameters.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the bootstrap and of the p-values.")] = 0,
    nested: Annotated[
        bool,
        typer.Option(
            "--nested", help="Repeat the search without each session and score it there (nested validation); slower."
        ),
    ] = False,
    resim: Annotated[
        str | None,
        typer.Option(
            help="Simulate the most probable sets of effects, and decide by the measured gap: a command of your own "
            "simulator with {effects}, {sim} and {out}, or builtin for the project's models.",
            metavar="COMMAND",
        ),
    ] = None,
    resim_budget: Annotated[int, typer.Option(min=1, help="Largest number of simulations with --resim.")] = (
        DEFAULT_BUDGET
    ),
    real_real: Annotated[
        bool,
        typer.Option(
            "--real-real",
            help="Compare two real datasets, such as two days or two sensors; the second takes the place of SIM.h5.",
        ),
    ] = False,
    open_page: Annotated[
        bool | None,
        typer.Option("--open/--no-open", help="Open the page in a browser. Default: ask, if a browser is available."),
    ] = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Diagnose the gap between two grasp datasets.

    Example: taxel gap diagnose out/campaign/real.h5 out/campaign/sim.h5 --out out/gap
    """
    report, page = out / "report.json", out / "report.html"
    for path in (report, page):
        if path.exists() and not overwrite:
            raise TaxelError(f"{path}: exists already; choose another --out, or give --overwrite")
    _check_folder(out)
    if effects is not None:
        add_effect_file(effects)
    _check_source(sim, real_real)
    if resim == BUILTIN and read_version(sim) != VERSION:
        raise TaxelError(
            f"{sim}: --resim builtin needs a simulated dataset of version 1; give a command of your own simulator"
        )
    console = Console(stderr=as_json, markup=False)
    simulator = Resimulator(resim, out / "resim", resim_budget, seed) if resim is not None else None
    with stage_bars(console) as show:
        known = read_priors(priors) if priors else {}
        diagnosis = run(real, sim, without or (), seed, show, known, nested, simulator)
    out.mkdir(parents=True, exist_ok=True)
    text = json.dumps(diagnosis.report, allow_nan=False)
    page_content = page_text(json.loads(text))  # an existing report is replaced only after both are complete
    with open_whole(page) as new_page, open_whole(report) as new_report:
        new_page.write(page_content.encode())
        new_report.write(text.encode())
    if as_json:
        print(text)
    else:
        if console.is_terminal:
            print_gap_map(console, json.loads(text), read_hand_name(real))
        print_summary(console, json.loads(text), str(page), str(report))
        offer_page(page, open_page)


def _check_source(sim: Path, real_real: bool) -> None:
    """Raise a one-line `TaxelError` if the second dataset is real without `real_real`, or simulated with it.

    sim: second dataset. real_real: whether the option --real-real is given.
    """
    source = read_source(sim)
    if source == REAL and not real_real:
        raise TaxelError(f"{sim}: is a real dataset; give a simulated one, or --real-real to compare two real datasets")
    if source == SIM and real_real:
        raise TaxelError(f"{sim}: is a simulated dataset; give two real datasets, or omit --real-real")


def _check_folder(out: Path) -> None:
    """Raise a one-line `TaxelError` if the report of a diagnosis cannot be written to the folder `out`.

    The check precedes the diagnosis, so that a wrong folder is reported at once.
    """
    nearest = next(path for path in (out, *out.absolute().parents) if path.exists())
    if not nearest.is_dir() or not os.access(nearest, os.W_OK):
        reason = "is not writable" if nearest.is_dir() else "is not a folder"
        raise TaxelError(f"--out {out}: {nearest} {reason}; choose another folder")
    for path in (out / "report.json", out / "report.html"):
        if path.is_dir():
            raise TaxelError(f"{path}: is a folder, expected a file; choose another --out")
