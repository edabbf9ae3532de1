"""`taxel record`."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Final

import typer
from rich.console import Console

from taxel.cli.gap_notices import GapNotices
from taxel.cli.joint_sources import open_live_joints
from taxel.cli.options import (
    HandCan,
    HandOption,
    JointAngles,
    JointTopic,
    Overwrite,
    ProximityFile,
    Seconds,
    Url,
    parse_joint_angles,
)
from taxel.cli.progress import spinner, time_bar
from taxel.cli.stream_summary import StreamSummary
from taxel.skin.recorder import open_recorded
from taxel.skin.recording_skin import RecordingSkin

LATEST_S: Final = 2.0
"""Time after the requested duration at which a recording without frames ends, seconds: more than the start of all
boards (1 s) and the delay of a frame.
"""


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
    proximity: ProximityFile = None,
    wait: Annotated[
        bool, typer.Option("--wait", help="If the port vanishes, wait for it and continue in the same file.")
    ] = False,
    overwrite: Overwrite = False,
) -> None:
    """Record a skin to a file.

    The file contains all bytes of the hub with their arrival times. A capture is written to disk at once. An MCAP file
    (needs the extra ros) also contains the skin's ROS 2 topics; a killed program loses less than a second of it. With
    --joint-topic or --hand-can, the measured joint angles of every poll cycle are recorded: in the topic /joint_states
    of an MCAP file, or beside a capture in FILE.joints.csv. With --proximity, an MCAP file contains the targets before
    contact in the topics /taxel/BOARD/proximity.

    With --wait, a port that vanishes (unplugged, hub without power) does not end the recording: the command waits,
    opens the port again under the same name, and continues in the same file. Frames that the hub sent meanwhile count
    as lost on the wire.

    Example: taxel record "emulator:?speed=max" --seconds 2 --out skin.bin
    """
    with (
        open_live_joints(hand, parse_joint_angles(joints), joint_topic, hand_can) as source,
        open_recorded(url, out, hand, overwrite, source, wait, proximity) as skin,
    ):
        summary = StreamSummary(skin, has_map=sys.stdout.isatty())
        try:
            _record_frames(skin, summary, url, seconds)
        except KeyboardInterrupt:
            pass  # Ctrl-C is the usual end of a recording
        finally:
            skin.end_recording()
            summary.print(Console(markup=False))


def _record_frames(skin: RecordingSkin, summary: StreamSummary, url: str, seconds: float | None) -> None:
    """Record the frames of a skin for `seconds` from its first frame; None: until the end of the stream.

    summary: counts the frames. url: URL of the skin for the progress display.
    """
    # A skin that sends no frames ends the recording at this time; the loop below ends it after `seconds` of frames.
    skin.end_s = None if seconds is None else time.monotonic() + seconds + LATEST_S
    notices = GapNotices(skin.link.name, skin.reconnection)
    with _open_progress(f"recording {url}", seconds) as show:

        def show_progress() -> None:
            """Show the number of frames, and whether the port is missing."""
            show(summary.seconds, f"recording {url}: {summary.frames.total()} frames{notices.update()}")

        skin.on_wait = show_progress
        for frame in skin:
            summary.add(frame)
            if seconds is not None and summary.seconds >= seconds:
                return


@contextmanager
def _open_progress(title: str, seconds: float | None) -> Iterator[Callable[[float, str], None]]:
    """Show a bar for a recording of known length, else a spinner. Yields the callback.

    The arguments of the callback are the elapsed seconds of the stream and the text beside the bar or spinner.
    """
    if seconds is not None:
        with time_bar(title, seconds) as show:
            yield show
    else:
        with spinner(title) as set_title:
            yield lambda elapsed_s, text: set_title(f"{text}, {elapsed_s:.1f} s")
