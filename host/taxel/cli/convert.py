"""`taxel convert`."""

import json
from typing import Annotated

import typer

from taxel.cli.joint_sources import choose_joints
from taxel.cli.options import AsJson, HandOption, JointAngles, JointFile, Overwrite
from taxel.cli.progress import spinner
from taxel.recording.formats import ConversionResult
from taxel.recording.formats import convert as convert_recording
from taxel.recording.formats.grasp_options import UNKNOWN_OBJECT, GraspOptions
from taxel.recording.grasp_format import BASELINE_FRAMES

RecordedObject = Annotated[str, typer.Option("--object", help="Name of the grasped object, for x.h5 and x.csv.")]
RecordedApproach = Annotated[str, typer.Option(help="Name of the approach, for x.h5 and x.csv.")]
RecordedBaseline = Annotated[
    int, typer.Option(min=0, help="Number of poll cycles at the start without contact, for x.h5.")
]


def convert(
    source: Annotated[
        str, typer.Argument(help="A recording: capture, .pcapng, .mcap, .h5, .parquet or a folder of CSV.")
    ],
    target: Annotated[
        str,
        typer.Argument(
            help="File to write: x.bin (capture), x.pcapng (for Wireshark), x.mcap, x.h5 (grasp dataset), x.parquet, "
            "x.csv (a folder)."
        ),
    ],
    hand: HandOption = None,
    joints: JointAngles = None,
    joint_file: JointFile = None,
    grasp: Annotated[str | None, typer.Option(help="Id of the grasp, for a dataset with several grasps.")] = None,
    object_name: RecordedObject = UNKNOWN_OBJECT,
    approach: RecordedApproach = "recording",
    baseline_frames: RecordedBaseline = BASELINE_FRAMES,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Convert a recording to another file format.

    Prints what the other format cannot contain. A truncated recording is converted to its last complete frame; then the
    exit status is 1.

    Example: taxel convert skin.bin skin.csv
    """
    options = GraspOptions(object_name, approach, baseline_frames=baseline_frames)
    with spinner(f"converting {source}") as show:
        result = convert_recording(
            source,
            target,
            hand=hand,
            overwrite=overwrite,
            joint_position=choose_joints(source, hand, joints, joint_file, grasp),
            grasp=grasp,
            options=options,
            progress=lambda seconds: show(f"converting {source}: {seconds:.0f} s"),
        )
    print_conversion(result, target, as_json)


def print_conversion(result: ConversionResult, target: str, as_json: bool) -> None:
    """Print the numbers of frames of a converted recording, and which information the target format cannot contain.

    target: file that was written. as_json: print one JSON object instead of text.
    """
    if as_json:
        print(json.dumps({"file": target, **vars(result)}))
        return
    print(
        f"{target}: {result.frames} frames of {result.seconds:.2f} s; {result.missing} missing, "
        f"{result.lost_on_wire} lost on the wire"
    )
    for note in result.notes:
        print(note)
