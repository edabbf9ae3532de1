"""Replies to the frames of a host on behalf of an original hub, which itself takes no commands."""

from collections.abc import Callable, Iterable
from typing import Any

from taxel.hand import Hand
from taxel.hand.board_info import make_board_info
from taxel.link import LinkError
from taxel_protocol import PROTOCOL_VERSION, PROTOCOL_VERSION_MIN, Command, FrameType
from taxel_protocol.frames import FRAMES, BoardInfo, BoardStatus, GetTimeReply, HubHandshake, HubStatus, Reply
from taxel_protocol.layout import list_fields, pack, unpack
from taxel_protocol.names import BoardState, StartFlag

SILENT_CYCLES = 10
"""Poll cycles without a message after which a board is reported as absent. The hub gives up a board after 10 failed
tries; a larger number reports a missing board later, a smaller one reports boards whose messages are damaged."""

PATIENCE = 2
"""Number of repetitions of a handshake, one per second, during which the link waits for the read sequence."""

_REFUSED = {
    Command.I2C_TRANSFER: "transfers of a host on its I2C bus",
    Command.SET_SCAN_SETTINGS: "scan settings",
    Command.REBOOT: "a restart by the host",
    Command.ENTER_BOOTLOADER: "the project's bootloader",
}


class Statistics:
    """Counters of an original hub, as far as its stream shows them.

    messages: number of received messages by address. first_cycle, last_cycle: poll cycle of the first and of the last
    message, by address. cycle: number of the present poll cycle. time_us: hub time of the last message. cycle_us:
    duration of a poll cycle. frames: number of frames that a lossless link would have delivered. size: bytes of the
    delivered frames. commands: number of commands of the host.
    """

    def __init__(self) -> None:
        """Create counters without messages."""
        self.messages: dict[int, int] = {}
        self.last_cycle: dict[int, int] = {}
        self.first_cycle: dict[int, int] = {}
        self.cycle = 0
        self.time_us = 0
        self.cycle_us = 0
        self.frames = 0
        self.size = 0
        self.commands = 0

    def add(self, address: int, cycle: int, time_us: int) -> None:
        """Count a message of the board at `address` in poll cycle `cycle`. time_us: hub time of the message."""
        self.messages[address] = self.messages.get(address, 0) + 1
        self.first_cycle.setdefault(address, cycle)
        self.last_cycle[address] = cycle
        self.cycle, self.time_us = cycle, time_us

    def is_present(self, address: int) -> bool:
        """Return whether a board has sent a message within the last `SILENT_CYCLES` poll cycles."""
        return address in self.last_cycle and self.cycle - self.last_cycle[address] < SILENT_CYCLES


class HubReplies:
    """Sends the frames with which a hub of the project would reply, made from the hand description.

    is_streaming: true between the commands START and STOP.
    """

    def __init__(self, name: str, hand: Hand, statistics: Statistics, send: Callable[[FrameType, bytes], None]) -> None:
        """Create the replies of the hub on link `name`.

        statistics: counters that the link updates. send: appends a frame to the link's output; its arguments are type
        and payload.
        """
        self.is_streaming = False
        self._name = name
        self._hand = hand
        self._statistics = statistics
        self._send = send
        self._waiting_tag: int | None = None
        self._attempts = 0

    def answer(self, kind: FrameType, payload: bytes, boards: Iterable[int]) -> None:
        """Reply to a frame of the host; the reply to a handshake waits for `answer_handshake`.

        boards: addresses of the boards that send regularly. Raises LinkError for a command that needs the project's own
        firmware.
        """
        if kind is FrameType.HOST_HANDSHAKE:
            self._attempts = self._attempts + 1 if self._waiting_tag == payload[0] else 1
            self._waiting_tag = payload[0]
        elif kind is FrameType.COMMAND:
            fields, arguments = unpack(FRAMES[kind].payload, payload)
            self._answer_command(fields["tag"], fields["command"], arguments, tuple(boards))

    def answer_handshake(self, has_messages: bool, is_known: bool) -> None:
        """Reply to a waiting handshake, if there is one and the stream shows that an original hub is connected.

        has_messages: a message has arrived. is_known: the boards and their order are known. After `PATIENCE`
        repetitions of the handshake, the reply is sent although boards and order are not known, because a test firmware
        takes 4.5 s per cycle.
        """
        if self._waiting_tag is not None and has_messages and (is_known or self._attempts > PATIENCE):
            self.send_handshake(self._waiting_tag, PROTOCOL_VERSION)
            self._waiting_tag = None

    def send_handshake(self, tag: int, version: int) -> None:
        """Send a HUB_HANDSHAKE. tag: tag of the host's handshake; 0: a restart. version: agreed version."""
        fields = _zero_fields(HubHandshake) | {"tag": tag, "unique_id": bytes(8), "version_chosen": version}
        fields |= {"version_min": PROTOCOL_VERSION_MIN, "version_max": PROTOCOL_VERSION}
        self._send(FrameType.HUB_HANDSHAKE, pack(HubHandshake, fields | {"uptime_us": self._statistics.time_us}))

    def _answer_command(self, tag: int, code: int, arguments: bytes, boards: tuple[int, ...]) -> None:
        """Execute a command of the host and send the reply. Raises LinkError if an original hub cannot execute it."""
        self._check_command(code, arguments)
        self._statistics.commands += 1
        data = b""
        if code in (Command.START, Command.STOP):
            self.is_streaming = code == Command.START
        elif code == Command.GET_BOARD_INFO:
            for address in boards:
                self._send(FrameType.BOARD_INFO, pack(BoardInfo, make_board_info(self._hand.get_board(address))))
        elif code == Command.SCAN_BUS:
            data = bytes(boards)
        elif code == Command.GET_STATUS:
            self.send_status()
        elif code == Command.GET_TIME:
            data = pack(GetTimeReply, {"hub_time_us": self._statistics.time_us})
        self._send(FrameType.REPLY, pack(Reply, {"tag": tag, "command": code, "status": 0}, data))

    def _check_command(self, code: int, arguments: bytes) -> None:
        """Raise LinkError for a command that an original hub cannot execute."""
        if code == Command.SET_RATE and any(arguments):
            problem = "a rate: it always polls as fast as it can"
        elif code == Command.START and arguments and arguments[0] & StartFlag.COMPACT:
            problem = "compact frames; open the link without frames=compact"
        elif code in _REFUSED:
            problem = f"{_REFUSED[Command(code)]}; this command needs the project's own firmware on hub and boards"
        elif code in Command._value2member_map_:
            return
        else:
            problem = f"command {code}"
        raise LinkError(self._name, f"the original hub does not support {problem}")

    def send_status(self) -> None:
        """Send HUB_STATUS, and BOARD_STATUS for every board that has sent a message.

        Of a board's counters only two are known: `polls`, the poll cycles since its first message, and `forwarded`, the
        number of its messages. The stream does not show why a message is missing.
        """
        counts = self._statistics
        present = [address for address in sorted(counts.messages) if counts.is_present(address)]
        fields = {"uptime_us": counts.time_us, "cycles": counts.cycle, "cycle_time_us": counts.cycle_us}
        fields |= {"frames_sent": counts.frames % (1 << 32), "bytes_sent": counts.size % (1 << 32)}
        fields |= {"commands": counts.commands, "boards_streaming": len(present), "streaming": int(self.is_streaming)}
        self._send(FrameType.HUB_STATUS, pack(HubStatus, _zero_fields(HubStatus) | fields))
        for address, messages in sorted(counts.messages.items()):
            polls = counts.cycle - counts.first_cycle[address] + 1
            fields = {"address": address, "polls": max(polls, messages), "forwarded": messages}
            fields["state"] = int(BoardState.STREAMING if address in present else BoardState.ABSENT)
            self._send(FrameType.BOARD_STATUS, pack(BoardStatus, _zero_fields(BoardStatus) | fields))


def _zero_fields(payload: Any) -> dict[str, Any]:
    """Return all fields of a payload with the value 0."""
    return {field.name: 0 for field in list_fields(payload)}
