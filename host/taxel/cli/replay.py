"""`taxel replay`."""

import json
import sys
import time
from typing import Annotated

import typer
from rich.console import Console

from taxel.cli.convert import print_conversion
from taxel.cli.joint_sources import choose_joints
from taxel.cli.options import AsJson, HandOption, JointAngles, Overwrite, parse_joint_angles
from taxel.cli.ros import publish_skin
from taxel.cli.stream_summary import StreamSummary
from taxel.errors import TaxelError
from taxel.hand.errors import format_value
from taxel.recording.formats import convert, open_recording
from taxel.recording.formats.conversion import format_of
from taxel.recording.formats.virtual_port import VirtualPort
from taxel.ros.pace import Pace
from taxel.skin import Skin

SLOWEST, FASTEST = 1e-3, 1e6
"""Limits of --speed, times real time."""


def replay(
    recording: Annotated[str, typer.Argument(help="A capture, .mcap, .h5, .parquet or a folder of CSV.")],
    to: Annotated[
        str | None, typer.Option(help="pty: a virtual serial port; ros: a ROS node; else a file. Default: a summary.")
    ] = None,
    speed: Annotated[
        str | None, typer.Option(help="Times real time, or max. Default: 1 for pty and ros, else max.")
    ] = None,
    hand: HandOption = None,
    grasp: Annotated[str | None, typer.Option(help="Id of the grasp, for a dataset with several grasps.")] = None,
    joints: JointAngles = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Summarise a recording, or play it into a serial port, ROS or a file.

    A truncated recording is played to its last complete frame; then the exit status is 1.

    Example: taxel replay skin.bin --speed max --json
    """
    speed_factor = _parse_speed(speed, 1.0 if to in ("pty", "ros") else None)
    if to == "pty":
        _play_into_port(recording, hand, grasp, speed_factor)
    elif to == "ros":
        link, description = open_recording(recording, hand, grasp)
        with Skin(link, description) as skin:
            angles = choose_joints(recording, description, joints, None, grasp)
            publish_skin(skin, None, angles, None, None, Pace(speed_factor))
    elif to is not None:
        format_of(to)  # refuses an unknown format before anything is read
        angles = parse_joint_angles(joints)
        result = convert(recording, to, hand=hand, overwrite=overwrite, joint_position=angles, grasp=grasp)
        print_conversion(result, to, as_json)
    else:
        _print_summary(recording, hand, grasp, speed_factor, as_json)


def _print_summary(recording: str, hand: str | None, grasp: str | None, speed: float | None, as_json: bool) -> None:
    """Play a recording and print its numbers of frames, losses and bytes.

    grasp: id of a grasp in a dataset. speed: times real time; None: as fast as possible.
    """
    link, description = open_recording(recording, hand, grasp)
    pace = Pace(speed)
    with Skin(link, description) as skin:
        summary = StreamSummary(skin, has_map=not as_json and sys.stdout.isatty())
        try:
            for frame in skin:
                pace.wait(frame.time_s)
                summary.add(frame)
        finally:
            if as_json:
                print(json.dumps(summary.as_dict(), indent=2))
            else:
                summary.print(Console(markup=False))


def _play_into_port(recording: str, hand: str | None, grasp: str | None, speed: float | None) -> None:
    """Play a recording into a virtual serial port; the name of the port is printed first.

    grasp: id of a grasp in a dataset. speed: times real time; None: as fast as possible.
    """
    link, description = open_recording(recording, hand, grasp)
    link.close()  # only the description of the hand is needed here; the port opens the recording itself
    with VirtualPort(lambda: open_recording(recording, hand, grasp)[0], description, speed) as port:
        print(port.device, flush=True)
        start_s = time.monotonic()
        is_complete = port.play()
        outcome = "played to its end" if is_complete else "the program closed the port before the end"
        print(f"{recording}: {outcome}, {time.monotonic() - start_s:.1f} s")


def _parse_speed(text: str | None, default: float | None) -> float | None:
    """Parse the option `--speed`, a multiple of real time; None for "max", as fast as possible.

    text: value of the option; None: not given, then the result is `default`.

    Raises `TaxelError` for a text that is neither `max` nor a permitted number.
    """
    if text is None:
        return default
    if text == "max":
        return None
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not SLOWEST <= value <= FASTEST:
        raise TaxelError(f"--speed: expected max or a number from 0.001 to 1000000, found {format_value(text)}")
    return value
