"""What a host sends to start a stream, as a script for an emulator that runs without one."""

import os

from taxel.link import CaptureWriter
from taxel_protocol import PROTOCOL_VERSION, PROTOCOL_VERSION_MIN, Command, FrameType, encode_frame
from taxel_protocol.frames import CommandPayload, HostHello
from taxel_protocol.layout import pack

HELLO_S = 0.2
START_S = 0.25
"""Virtual seconds at which the greeting and START are sent: every board has booted and the hub has found it."""


def write_start_script(path: str | os.PathLike[str]) -> None:
    """Write a greeting and START as a capture of host bytes, for `taxel.link.run_emulator`; replaces the file."""
    greeting = pack(HostHello, {"tag": 1, "version_min": PROTOCOL_VERSION_MIN, "version_max": PROTOCOL_VERSION})
    start = pack(CommandPayload, {"tag": 2, "command": int(Command.START)})
    with CaptureWriter(path, overwrite=True) as script:
        script.write(encode_frame(FrameType.HOST_HELLO, 0, greeting), round(HELLO_S * 1e9))
        script.write(encode_frame(FrameType.COMMAND, 1, start), round(START_S * 1e9))
