"""Options and results that the commands of `taxel import` for any sensor share."""

import json
from pathlib import Path
from typing import Annotated

import typer

from taxel.errors import TaxelError
from taxel.hand.errors import format_value
from taxel.recording.grasp_format import REAL, SIM
from taxel.recording.importers.run import ImportReport

Out = Annotated[Path, typer.Option(help="Dataset to write.")]
MapFile = Annotated[Path, typer.Option("--map", help="Mapping, a TOML file; taxel import inspect proposes one.")]
Files = Annotated[list[Path], typer.Argument(help="Files to import, in the order of the contacts.")]
SourceOption = Annotated[str, typer.Option("--source", help="real or sim: measured or simulated data.")]
Session = Annotated[int, typer.Option(min=0, help="Number of the day or of the mounting of the sensor.")]
ObjectName = Annotated[str | None, typer.Option("--object", help="Label of the object of all contacts.")]
Approach = Annotated[str | None, typer.Option(help="Label of the approach of all contacts.")]
Gap = Annotated[float | None, typer.Option("--gap-s", min=1e-9, help="Pause that starts a new contact, seconds.")]
TimeUnit = Annotated[
    str | None, typer.Option("--time-unit", help="Unit of the times: s, ms, us, ns. Default: inferred.")
]
Rate = Annotated[float | None, typer.Option("--rate-hz", min=1e-9, help="Frame rate of a file without times, hertz.")]
Environments = Annotated[bool, typer.Option("--environments", help="The second axis of the array is the environment.")]


def check_source(source: str) -> str:
    """Return the value of the option --source unchanged. Raises `TaxelError` for a value other than real and sim."""
    if source not in (REAL, SIM):
        raise TaxelError(f"--source: expected real or sim, found {format_value(source)}; correct the option")
    return source


def print_report(report: ImportReport, out: Path, as_json: bool) -> None:
    """Print the numbers of imported contacts, frames and taxels.

    out: dataset that was written. as_json: print one JSON object instead of text.
    """
    if as_json:
        print(json.dumps({"file": str(out), **vars(report)}))
        return
    kind = "taxels" if report.components == 1 else f"taxels of {report.components} components"
    print(f"{out}: {report.contacts} contacts, {report.frames} frames, {report.taxels} {kind}")
