"""`taxel replay`."""

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from taxel.cli.summary import StreamSummary
from taxel.skin import open_skin


def replay(
    capture: Annotated[Path, typer.Argument(help="A capture file.")],
    hand: Annotated[str, typer.Option(help="Packaged hand or description file.")] = "allegro",
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Decode a capture from beginning to end and say what is in it, and what is missing.

    A capture that is cut short is read up to the cut; then the exit status is 1.

    Example: taxel replay capture.bin --json
    """
    with open_skin(f"file:{capture}", hand) as skin:
        summary = StreamSummary(skin)
        try:
            for frame in skin:
                summary.add(frame.address, frame.time_s)
        finally:
            if as_json:
                print(json.dumps(summary.as_dict(), indent=2))
            else:
                summary.print(Console())
