"""`taxel record`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from taxel.cli.summary import StreamSummary
from taxel.recorder import open_recorded


def record(
    url: Annotated[str, typer.Argument(help="serial:///dev/ttyUSB0, emulator: ...")],
    out: Annotated[Path, typer.Option(help="The capture to write.")],
    seconds: Annotated[float, typer.Option(help="Seconds of frames; 0: until Ctrl-C.")] = 0.0,
    hand: Annotated[str, typer.Option(help="Packaged hand or description file.")] = "allegro",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file if it exists.")] = False,
) -> None:
    """Write everything that the hub sends to a capture, with arrival times.

    What has arrived is on disk at once: a vanished port or a killed program costs nothing that was there.

    Example: taxel record "emulator:?speed=max" --seconds 2 --out capture.bin
    """
    console = Console(stderr=True)
    with open_recorded(url, out, hand, overwrite) as skin:
        summary = StreamSummary(skin)
        columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
        try:
            with Progress(*columns, console=console, transient=True) as progress:
                task = progress.add_task(f"recording {url}")
                for frame in skin:
                    summary.add(frame.address, frame.time_s)
                    progress.update(
                        task,
                        description=f"recording {url}: {summary.frames.total()} frames, {summary.seconds:.1f} s",
                    )
                    if seconds and summary.seconds >= seconds:
                        break
        except KeyboardInterrupt:
            pass
        finally:
            summary.print(Console())
