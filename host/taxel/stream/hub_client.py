"""Talking to the hub: handshake, commands and their replies, over a stream that goes on meanwhile."""

from collections import deque
from typing import Any

from taxel.errors import TaxelError
from taxel.link import Link, clock_of
from taxel.stream.frame_stream import FrameStream
from taxel.stream.frames import HubMessage
from taxel_protocol import (
    PROTOCOL_VERSION,
    PROTOCOL_VERSION_MIN,
    Command,
    FrameType,
    ReplyStatus,
    encode_frame,
)
from taxel_protocol.frames import (
    CommandPayload,
    GetBoardInfoArguments,
    HostHandshake,
    SetRateArguments,
    SetScanSettingsArguments,
    StartArguments,
    TransferArguments,
)
from taxel_protocol.layout import pack
from taxel_protocol.names import StartFlag

REPLY_TIMEOUT_S = 1.0
ATTEMPTS = 4
REBOOT_TIMEOUT_S = 5.0
KEPT_MESSAGES = 1024
COMPACT_VERSION = 2
"""First version of the protocol with compact snapshots."""
RATE_MIN_HZ, RATE_MAX_HZ = 1e-3, 1e6  # a period of 1 us to 1000 s

_UNREQUESTED_HANDSHAKE = 0  # tag of the HUB_HANDSHAKE that a restarted hub sends without a request


class HubError(TaxelError):
    """The hub did not answer, or answered that it cannot."""


class VersionError(HubError):
    """Hub and host have no protocol version in common."""


class HubClient:
    """Commands to a hub, and everything that it tells.

    `boards` maps addresses to the fields of the last BOARD_INFO frame, `board_status` to those of BOARD_STATUS;
    `status` is the last HUB_STATUS, `last_handshake` the last HUB_HANDSHAKE; `faults` and `logs` are the last 1024 each.
    `has_handshake`: host and hub have agreed on a version, and the hub has not started anew since. `version`: that one.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self._now_s = clock_of(link)
        self.stream = FrameStream(link, self._take, on_answers=None if link.is_recorded else self._answer)
        self.version = 0
        self.last_handshake: dict[str, Any] | None = None
        self.has_handshake = False
        self.status: dict[str, Any] | None = None
        self.boards: dict[int, dict[str, Any]] = {}
        self.board_status: dict[int, dict[str, Any]] = {}
        self.faults: deque[dict[str, Any]] = deque(maxlen=KEPT_MESSAGES)
        self.logs: deque[str] = deque(maxlen=KEPT_MESSAGES)
        self._replies: dict[int, HubMessage] = {}
        self._sequence = 0
        self._tag = 0

    def _take(self, message: HubMessage) -> None:
        fields = message.fields
        if message.type is FrameType.HUB_HANDSHAKE:
            self.last_handshake = fields
            self.has_handshake = fields["version_chosen"] != 0
            self._replies[-fields["tag"]] = message
        elif message.type is FrameType.REPLY:
            self._replies[fields["tag"]] = message
        elif message.type is FrameType.BOARD_INFO:
            self.boards[fields["identity_address"]] = fields
        elif message.type is FrameType.HUB_STATUS:
            self.status = fields
        elif message.type is FrameType.BOARD_STATUS:
            self.board_status[fields["address"]] = fields
        elif message.type is FrameType.BOARD_FAULT:
            self.faults.append(fields)
        elif message.type is FrameType.LOG:
            self.logs.append(message.tail.decode("ascii", errors="replace"))

    def _answer(self, payload: bytes) -> None:
        self._send(FrameType.ACKNOWLEDGE, payload)

    def _send(self, frame_type: FrameType, payload: bytes) -> None:
        self._link.write(encode_frame(frame_type, self._sequence, payload))
        self._sequence = (self._sequence + 1) % 65536

    def _next_tag(self) -> int:
        self._tag = self._tag % 255 + 1
        return self._tag

    def _ask(self, frame_type: FrameType, payload: bytes, key: int) -> HubMessage:
        self._replies.pop(key, None)
        for _ in range(ATTEMPTS):
            self._send(frame_type, payload)
            deadline = self._now_s() + REPLY_TIMEOUT_S
            while self._now_s() < deadline:
                try:
                    self.stream.poll(0.02)
                except EOFError:
                    raise HubError(f"{self._link.name}: ended before the hub had answered") from None
                if key in self._replies:
                    return self._replies.pop(key)
        raise HubError(
            f"{self._link.name}: no answer from a hub after {ATTEMPTS} attempts; is this the hub's port, and its "
            f"baud rate {self._link.baud:.0f}?"
        )

    def wait(self, seconds: float) -> None:
        """Let time go by on the link's clock, taking in what arrives."""
        deadline = self._now_s() + seconds
        while (left := deadline - self._now_s()) > 0.0:
            self.stream.poll(min(max(left, 1e-6), 0.02))

    def handshake(self) -> int:
        """Agree on a protocol version; returns it. Raises `VersionError` if there is none in common."""
        tag = self._next_tag()
        versions = {"version_min": PROTOCOL_VERSION_MIN, "version_max": PROTOCOL_VERSION}
        fields = self._ask(FrameType.HOST_HANDSHAKE, pack(HostHandshake, {"tag": tag} | versions), -tag).fields
        if fields["version_chosen"] == 0:
            raise VersionError(
                f"{self._link.name}: the hub speaks protocol {fields['version_min']} to {fields['version_max']}, this "
                f"program {PROTOCOL_VERSION_MIN} to {PROTOCOL_VERSION}; update the older of the two"
            )
        self.version = int(fields["version_chosen"])
        return self.version

    def command(self, command: Command | int, arguments: bytes = b"") -> bytes:
        """Send a command and wait for its reply; returns the reply's data. Raises `HubError` with the hub's reason.

        A number stands for a command that this program does not know.
        """
        tag = self._next_tag()
        payload = pack(CommandPayload, {"tag": tag, "command": int(command)}, arguments)
        reply = self._ask(FrameType.COMMAND, payload, tag)
        status = reply.fields["status"]
        if status != ReplyStatus.OK:
            asked = command.name if isinstance(command, Command) else f"command {command}"
            name = ReplyStatus(status).name if status in ReplyStatus._value2member_map_ else str(status)
            raise HubError(f"{self._link.name}: the hub refused {asked}: {name.lower().replace('_', ' ')}")
        return reply.tail

    def start(self, compact: bool = False) -> None:
        """Begin to stream; `compact`: compact snapshots from the boards that have them.

        Raises `HubError` if the hub has no compact snapshots.
        """
        if compact and self.version < COMPACT_VERSION:
            raise HubError(
                f"{self._link.name}: compact frames need a hub with protocol {COMPACT_VERSION}, this one agreed on "
                f"{self.version}; update its firmware or open it with frames=plain"
            )
        self.stream.begin_anew()
        self.command(Command.START, pack(StartArguments, {"flags": int(StartFlag.COMPACT)}) if compact else b"")

    def stop(self) -> None:
        """End the stream after the frame under way."""
        self.command(Command.STOP)

    def send_stop(self) -> None:
        """Ask for the end of the stream without waiting for the answer."""
        self._send(FrameType.COMMAND, pack(CommandPayload, {"tag": self._next_tag(), "command": int(Command.STOP)}))

    def set_rate(self, rate_hz: float | None) -> None:
        """At most `rate_hz` poll cycles a second; None: as many as the bus allows."""
        if rate_hz is not None and not RATE_MIN_HZ <= rate_hz <= RATE_MAX_HZ:
            raise HubError(f"expected a rate from {RATE_MIN_HZ:g} to {RATE_MAX_HZ:g} Hz, found {rate_hz:g}")
        period = 0 if rate_hz is None else round(1e6 / rate_hz)
        self.command(Command.SET_RATE, pack(SetRateArguments, {"period_us": period}))

    def scan_bus(self) -> list[int]:
        """Every I2C address that acknowledges."""
        return list(self.command(Command.SCAN_BUS))

    def read_boards(self) -> None:
        """Read the identity of every board anew, into `boards`."""
        self.boards.clear()
        self.command(Command.GET_BOARD_INFO, pack(GetBoardInfoArguments, {"address": 0}))

    def read_status(self) -> None:
        """Fetch the hub's and every board's counters, into `status` and `board_status`."""
        self.command(Command.GET_STATUS)

    def transfer(self, address: int, write: bytes = b"", read_length: int = 0) -> bytes:
        """One I2C transfer by the hub: write, then read after a repeated start. Raises `HubError` on NACK or bus
        error.
        """
        fields = {"address": address, "read_length": read_length}
        return self.command(Command.I2C_TRANSFER, pack(TransferArguments, fields, write))

    def set_scan_settings(self, settings: dict[str, int], address: int = 0) -> None:
        """Scan settings (fields of taxel_protocol.registers.ScanSettings) of one board, or of all with address 0."""
        fields = {"address": address} | {f"settings_{name}": value for name, value in settings.items()}
        self.command(Command.SET_SCAN_SETTINGS, pack(SetScanSettingsArguments, fields))

    def reboot(self) -> None:
        """Restart the hub and wait until it is back; the handshake must then be repeated. Raises `HubError` if it stays away."""
        self._replies.pop(_UNREQUESTED_HANDSHAKE, None)
        self.command(Command.REBOOT)
        deadline = self._now_s() + REBOOT_TIMEOUT_S
        while _UNREQUESTED_HANDSHAKE not in self._replies:
            if self._now_s() > deadline:
                raise HubError(f"{self._link.name}: the hub has not come back from a reboot; check its power")
            self.stream.poll(0.02)
