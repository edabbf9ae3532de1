"""Script of the host bytes that start a stream, for an emulator that runs without a host."""

import os

from taxel.link import CaptureWriter
from taxel_protocol import PROTOCOL_VERSION, PROTOCOL_VERSION_MIN, Command, FrameType, encode_frame
from taxel_protocol.frames import CommandPayload, HostHandshake
from taxel_protocol.layout import pack

HANDSHAKE_S = 0.2
START_S = 0.25
"""Virtual seconds at which the handshake and START are sent; by then the hub has found every board."""


def write_start_script(path: str | os.PathLike[str]) -> None:
    """Write the bytes with which a host starts a hub, handshake and START, to a capture file; replace the file.

    The capture is the host input of `taxel.link.run_emulator`.
    """
    handshake = pack(HostHandshake, {"tag": 1, "version_min": PROTOCOL_VERSION_MIN, "version_max": PROTOCOL_VERSION})
    start = pack(CommandPayload, {"tag": 2, "command": int(Command.START)})
    with CaptureWriter(path, overwrite=True) as script:
        script.write(encode_frame(FrameType.HOST_HANDSHAKE, 0, handshake), round(HANDSHAKE_S * 1e9))
        script.write(encode_frame(FrameType.COMMAND, 1, start), round(START_S * 1e9))
