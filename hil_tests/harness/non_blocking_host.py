"""A host that sends frames to the hub without waiting for replies, and collects the received frames and messages."""

from taxel.link import Link
from taxel.stream import TaxelFrame
from taxel.stream.frame_stream import FrameStream
from taxel.stream.frames import HubMessage
from taxel_protocol import PROTOCOL_VERSION, PROTOCOL_VERSION_MIN, FrameType, encode_frame
from taxel_protocol.frames import CommandPayload, HostHandshake
from taxel_protocol.layout import pack


class NonBlockingHost:
    """The host's end of a link to an emulated hub.

    `messages`: received messages of the hub. `board_status` by address, `status`: the counters that the hub sent last
    since its last start.
    """

    def __init__(self, link: Link) -> None:
        """Create a host that reads frames and messages of a hub from `link` without waiting for answers.

        `messages`: all messages received. `board_status`: latest status fields of each board, by I2C address.
        `status`: latest status fields of the hub.
        """
        self.stream = FrameStream(link, self._receive_message)
        self.messages: list[HubMessage] = []
        self.board_status: dict[int, dict[str, int]] = {}
        self.status: dict[str, int] | None = None
        self._link = link
        self._sequence = 0

    def _receive_message(self, message: HubMessage) -> None:
        """Store a message of the hub. A handshake with tag 0 announces a restart of the hub: the stored status is
        deleted.
        """
        self.messages.append(message)
        if message.type is FrameType.BOARD_STATUS:
            self.board_status[message.fields["address"]] = message.fields
        elif message.type is FrameType.HUB_STATUS:
            self.status = message.fields
        elif message.type is FrameType.HUB_HANDSHAKE and message.fields["tag"] == 0:
            self.board_status, self.status = {}, None

    def read_frames(self) -> list[TaxelFrame]:
        """Receive all bytes that have arrived, and return the taxel frames received since the last call."""
        while self.stream.poll(0.0):
            pass
        frames = list(self.stream.frames)
        self.stream.frames.clear()
        return frames

    def send(self, frame_type: FrameType, payload: bytes) -> None:
        """Send a frame to the hub."""
        self._link.write(encode_frame(frame_type, self._sequence, payload))
        self._sequence = (self._sequence + 1) % 65536

    def send_handshake(self, tag: int = 1) -> None:
        """Send the message HOST_HANDSHAKE to the hub. tag: number that the hub repeats in its answer."""
        fields = {"tag": tag, "version_min": PROTOCOL_VERSION_MIN, "version_max": PROTOCOL_VERSION}
        self.send(FrameType.HOST_HANDSHAKE, pack(HostHandshake, fields))

    def send_command(self, command: int, arguments: bytes = b"", tag: int = 1) -> None:
        """Send the message COMMAND to the hub. tag: number that the hub repeats in its reply."""
        self.send(FrameType.COMMAND, pack(CommandPayload, {"tag": tag, "command": command}, arguments))
