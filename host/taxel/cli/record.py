"""`taxel record`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from taxel.cli.joint_sources import open_live_joints
from taxel.cli.options import HandCan, HandOption, JointAngles, JointTopic, Overwrite, Seconds, Url, parse_joint_angles
from taxel.cli.progress import spinner
from taxel.cli.stream_summary import StreamSummary
from taxel.skin.recorder import open_recorded


def record(
    url: Url,
    out: Annotated[
        Path, typer.Option(help="File to write: x.mcap (bytes and ROS 2 topics), x.pcapng, else a capture (bytes).")
    ],
    seconds: Seconds = None,
    hand: HandOption = None,
    joints: JointAngles = None,
    joint_topic: JointTopic = None,
    hand_can: HandCan = None,
    overwrite: Overwrite = False,
) -> None:
    """Record a skin to a file.

    The file contains all bytes of the hub with their arrival times. A capture is written to disk at once. An MCAP file
    (needs the extra ros) also contains the skin's ROS 2 topics; a killed program loses less than a second of it. With
    --joint-topic or --hand-can, the measured joint angles of every poll cycle are recorded: in the topic /joint_states
    of an MCAP file, or beside a capture in FILE.joints.csv.

    Example: taxel record "emulator:?speed=max" --seconds 2 --out skin.bin
    """
    with (
        open_live_joints(hand, parse_joint_angles(joints), joint_topic, hand_can) as source,
        open_recorded(url, out, hand, overwrite, source) as skin,
    ):
        summary = StreamSummary(skin)
        try:
            with spinner(f"recording {url}") as show:
                for frame in skin:
                    summary.add(frame.address, frame.time_s)
                    show(f"recording {url}: {summary.frames.total()} frames, {summary.seconds:.1f} s")
                    if seconds is not None and summary.seconds >= seconds:
                        break
        except KeyboardInterrupt:
            pass  # Ctrl-C is the usual end of a recording
        finally:
            summary.print(Console(markup=False))
