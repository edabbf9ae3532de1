"""A host that waits for nothing: it sends what it is told to, and keeps what arrives."""

from taxel.link import Link
from taxel.stream import TaxelFrame
from taxel.stream.frame_stream import FrameStream
from taxel.stream.frames import HubMessage
from taxel_protocol import PROTOCOL_VERSION, PROTOCOL_VERSION_MIN, FrameType, encode_frame
from taxel_protocol.frames import CommandPayload, HostHandshake
from taxel_protocol.layout import pack


class FreeHost:
    """Frames and messages of a stepped link; `board_status`, `status`: the hub's last words on its counters."""

    def __init__(self, link: Link) -> None:
        self.stream = FrameStream(link, self._take)
        self.messages: list[HubMessage] = []
        self.board_status: dict[int, dict[str, int]] = {}
        self.status: dict[str, int] | None = None
        self._link = link
        self._sequence = 0

    def _take(self, message: HubMessage) -> None:
        self.messages.append(message)
        if message.type is FrameType.BOARD_STATUS:
            self.board_status[message.fields["address"]] = message.fields
        elif message.type is FrameType.HUB_STATUS:
            self.status = message.fields
        elif message.type is FrameType.HUB_HANDSHAKE and message.fields["tag"] == 0:
            self.board_status, self.status = {}, None

    def take(self) -> list[TaxelFrame]:
        """What has arrived since the last call."""
        while self.stream.poll(0.0):
            pass
        frames = list(self.stream.frames)
        self.stream.frames.clear()
        return frames

    def send(self, frame_type: FrameType, payload: bytes) -> None:
        """A frame to the hub."""
        self._link.write(encode_frame(frame_type, self._sequence, payload))
        self._sequence = (self._sequence + 1) % 65536

    def handshake(self, tag: int = 1) -> None:
        """HOST_HANDSHAKE."""
        fields = {"tag": tag, "version_min": PROTOCOL_VERSION_MIN, "version_max": PROTOCOL_VERSION}
        self.send(FrameType.HOST_HANDSHAKE, pack(HostHandshake, fields))

    def command(self, command: int, arguments: bytes = b"", tag: int = 1) -> None:
        """COMMAND, without waiting for the reply."""
        self.send(FrameType.COMMAND, pack(CommandPayload, {"tag": tag, "command": command}, arguments))
