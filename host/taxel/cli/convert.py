"""`taxel convert`."""

import json
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from taxel.cli.joints import HELP, joint_angles
from taxel.recording.forms import Converted
from taxel.recording.forms import convert as convert_recording
from taxel.recording.forms.hdf5_form import UNKNOWN, GraspOptions
from taxel.recording.grasp_format import BASELINE_FRAMES

TO_HELP = "What to write: x.bin (capture), x.mcap, x.h5 (grasp dataset), x.parquet, or x.csv (a folder)."


def convert(
    source: Annotated[str, typer.Argument(help="A recording: capture, .mcap, .h5, .parquet or a folder of CSV.")],
    target: Annotated[str, typer.Argument(help=TO_HELP)],
    hand: Annotated[str | None, typer.Option(help="Packaged hand or file; none: the recording's own.")] = None,
    joints: Annotated[str, typer.Option(help=HELP)] = "",
    grasp: Annotated[str | None, typer.Option(help="Which grasp of a dataset with several.")] = None,
    grasped: Annotated[str, typer.Option("--object", help="For x.h5, x.csv: one of the thesis's objects.")] = UNKNOWN,
    approach: Annotated[str, typer.Option(help="For x.h5, x.csv: the approach.")] = "recording",
    baseline_frames: Annotated[
        int, typer.Option(min=0, help="For x.h5: so many first cycles are baseline; nothing touched the skin.")
    ] = BASELINE_FRAMES,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the target if it exists.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Write a recording in another form, and say what that form cannot carry.

    A recording that is cut short is converted up to the cut; then the exit status is 1.

    Example: taxel convert skin.mcap skin.csv
    """
    options = GraspOptions(grasped, approach, baseline_frames=baseline_frames)
    columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True, markup=False), transient=True) as progress:
        task = progress.add_task(f"converting {source}")
        done = convert_recording(
            source,
            target,
            hand=hand,
            overwrite=overwrite,
            joint_position=joint_angles(joints),
            grasp=grasp,
            options=options,
            progress=lambda seconds: progress.update(task, description=f"converting {source}: {seconds:.0f} s"),
        )
    say(done, target, as_json)


def say(done: Converted, target: str, as_json: bool) -> None:
    """Print what was converted."""
    if as_json:
        print(json.dumps({"file": target, **vars(done)}))
        return
    print(
        f"{target}: {done.frames} frames of {done.seconds:.2f} s; {done.missing} missing, "
        f"{done.lost_on_wire} lost on the wire"
    )
    for note in done.notes:
        print(note)
