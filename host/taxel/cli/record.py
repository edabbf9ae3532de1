"""`taxel record`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from taxel.cli.joints import HELP, joint_angles
from taxel.cli.summary import StreamSummary
from taxel.recorder import open_recorded


def record(
    url: Annotated[str, typer.Argument(help="serial:///dev/ttyUSB0, emulator: ...")],
    out: Annotated[Path, typer.Option(help="The file to write: x.mcap, or any other name for a capture.")],
    seconds: Annotated[float, typer.Option(help="Seconds of frames; 0: until Ctrl-C.")] = 0.0,
    hand: Annotated[str | None, typer.Option(help="Packaged hand or description file; none: allegro.")] = None,
    joints: Annotated[str, typer.Option(help=HELP)] = "",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file if it exists.")] = False,
) -> None:
    """Write everything that the hub sends to a file, with arrival times.

    A capture has the bytes alone, each on disk at once. A name that ends in .mcap makes an MCAP file with the bytes and
    the skin's ROS 2 topics; a killed program costs less than a second of it.

    Example: taxel record "emulator:?speed=max" --seconds 2 --out skin.mcap
    """
    console = Console(stderr=True, markup=False)
    with open_recorded(url, out, hand, overwrite, joint_angles(joints)) as skin:
        summary = StreamSummary(skin)
        columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
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
            summary.print(Console(markup=False))
