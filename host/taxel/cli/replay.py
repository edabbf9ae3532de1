"""`taxel replay`."""

import json
import time
from typing import Annotated

import typer
from rich.console import Console

from taxel.cli.convert import say
from taxel.cli.joints import HELP, joint_angles
from taxel.cli.ros import publish_skin
from taxel.cli.summary import StreamSummary
from taxel.errors import TaxelError
from taxel.hand.errors import shown
from taxel.recording.forms import convert, open_recording
from taxel.recording.forms.conversion import form_of
from taxel.recording.forms.virtual_port import VirtualPort
from taxel.ros.pace import Pace
from taxel.skin import Skin


def replay(
    recording: Annotated[str, typer.Argument(help="A capture, .mcap, .h5, .parquet or a folder of CSV.")],
    to: Annotated[
        str, typer.Option(help="pty: a serial port that any program can open; ros: a ROS node; or a file to write.")
    ] = "",
    speed: Annotated[str, typer.Option(help="Times real time, such as 1 or 4, or max. None: 1 for pty and ros.")] = "",
    hand: Annotated[str | None, typer.Option(help="Packaged hand or file; none: the recording's own.")] = None,
    grasp: Annotated[str | None, typer.Option(help="Which grasp of a dataset with several.")] = None,
    joints: Annotated[str, typer.Option(help=HELP)] = "",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a file that exists.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Play a recording: into a virtual serial port, ROS or another file, or just to say what is in it.

    A recording that is cut short is played up to the cut; then the exit status is 1.

    Example: taxel replay skin.mcap --speed max --json
    """
    times = _speed(speed, 1.0 if to in ("pty", "ros") else None)
    if to == "pty":
        _to_port(recording, hand, grasp, times)
    elif to == "ros":
        link, description = open_recording(recording, hand, grasp)
        with Skin(link, description) as skin:
            publish_skin(skin, None, joint_angles(joints), None, 0.0, Pace(times))
    elif to:
        form_of(to)
        angles = joint_angles(joints)
        done = convert(recording, to, hand=hand, overwrite=overwrite, joint_position=angles, grasp=grasp)
        say(done, to, as_json)
    else:
        _summarise(recording, hand, grasp, times, as_json)


def _summarise(recording: str, hand: str | None, grasp: str | None, speed: float | None, as_json: bool) -> None:
    link, description = open_recording(recording, hand, grasp)
    pace = Pace(speed)
    with Skin(link, description) as skin:
        summary = StreamSummary(skin)
        try:
            for frame in skin:
                pace.wait(frame.time_s)
                summary.add(frame.address, frame.time_s)
        finally:
            if as_json:
                print(json.dumps(summary.as_dict(), indent=2))
            else:
                summary.print(Console(markup=False))


def _to_port(recording: str, hand: str | None, grasp: str | None, speed: float | None) -> None:
    link, description = open_recording(recording, hand, grasp)
    link.close()
    with VirtualPort(lambda: open_recording(recording, hand, grasp)[0], description, speed) as port:
        print(port.device, flush=True)
        begun = time.monotonic()
        ended = port.play()
        told = "played to its end" if ended else "the program closed the port before the end"
        print(f"{recording}: {told}, {time.monotonic() - begun:.1f} s")


def _speed(text: str, default: float | None) -> float | None:
    if not text:
        return default
    if text == "max":
        return None
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 1e-3 <= value <= 1e6:
        raise TaxelError(f"--speed: expected max or a number from 0.001 to 1000000, found {shown(text)}")
    return value
