"""`taxel gap export`."""

import json
from pathlib import Path
from typing import Annotated

import typer

from taxel.cli.options import AsJson, Overwrite
from taxel.gap.export.export import ExportResult, export_report


def export(
    report: Annotated[Path, typer.Argument(help="report.json of taxel gap diagnose.", metavar="REPORT")],
    to: Annotated[str, typer.Option("--to", help="Simulator: mujoco, genesis, isaac or python.")],
    out: Annotated[Path, typer.Option(help="File to write; with --to mujoco also a Python module beside it.")],
    sim: Annotated[
        Path | None, typer.Option(help="Grasp dataset of the simulator. Default: that of the report.", metavar="SIM.h5")
    ] = None,
    step_s: Annotated[
        float | None,
        typer.Option(
            "--step-s",
            min=1e-6,
            help="Seconds between two steps (mujoco, default 0.002) or observations (isaac, default 0.02).",
        ),
    ] = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Write the diagnosed effects in the format of a simulator.

    Example: taxel gap export out/gap/report.json --to python --out skin_effects.py
    """
    _print_result(export_report(report, to, out, sim=sim, step_s=step_s, overwrite=overwrite), as_json)


def _print_result(result: ExportResult, as_json: bool) -> None:
    """Print the written files and their effects, and which effects are approximated or cannot be expressed, and why."""
    if as_json:
        print(
            json.dumps(
                {
                    "files": [str(path) for path in result.files],
                    "effects": list(result.effects),
                    "approximated": dict(result.approximated),
                    "not_expressed": dict(result.not_expressed),
                    "notes": list(result.notes),
                }
            )
        )
        return
    if result.files:
        names = ", ".join(name.replace("_", " ") for name in result.effects) or "no effect"
        print(f"{', '.join(str(path) for path in result.files)}: with {names}")
    for title, reasons in (("approximated", result.approximated), ("not expressed", result.not_expressed)):
        for name, reason in reasons.items():
            print(f"{title}: {name.replace('_', ' ')}: {reason}")
    for note in result.notes:
        print(f"note: {note}")
