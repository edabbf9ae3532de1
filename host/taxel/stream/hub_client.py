"""Client of the hub: handshake, commands and replies, while the frame stream continues."""

from collections import deque
from typing import Any

from taxel.errors import TaxelError
from taxel.link import Link, get_clock
from taxel.stream.fault_record import (
    FAULT_REVISION,
    FAULT_VERSION,
    REGISTER_SIZE,
    FaultRecord,
    parse_fault_record,
    parse_fault_register,
)
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
from taxel_protocol.limits import REGISTER_FAULT
from taxel_protocol.names import FrontEnd, StartFlag

REPLY_TIMEOUT_S = 1.0
"""Longest wait for a reply before the request is repeated, seconds."""
ATTEMPTS = 4
REBOOT_TIMEOUT_S = 5.0
"""Longest wait for the message of a restarted hub, seconds."""
MESSAGE_HISTORY = 1024
"""Number of fault messages and of log lines that are kept."""
COMPACT_VERSION = 2
"""First protocol version with compact frames."""
RATE_MIN_HZ, RATE_MAX_HZ = 1e-3, 1e6  # a period of 1 us to 1000 s

_UNREQUESTED_HANDSHAKE = 0  # tag of the HUB_HANDSHAKE that a restarted hub sends without a request


class HubError(TaxelError):
    """The hub did not reply, or rejected a command."""


class VersionError(HubError):
    """Hub and host have no protocol version in common."""


class HubClient:
    """Commands to a hub, and the latest messages of the hub.

    `boards` maps addresses to the fields of the last BOARD_INFO frame, `board_status` to the fields of the last
    BOARD_STATUS frame. `status`: last HUB_STATUS; `last_handshake`: last HUB_HANDSHAKE; `faults`, `logs`: the last
    1024 of each. `version`: agreed protocol version; `has_handshake`: whether it still holds (a hub restart ends it).
    """

    def __init__(self, link: Link) -> None:
        """Create a client of the hub at the other end of `link` and start reading; no command is sent yet."""
        self._link = link
        self._now_s = get_clock(link)
        acknowledge = None if link.is_recorded else self._acknowledge
        self.stream = FrameStream(link, self._take_message, on_acknowledgements=acknowledge)
        self.version = 0
        self.last_handshake: dict[str, Any] | None = None
        self.has_handshake = False
        self.status: dict[str, Any] | None = None
        self.boards: dict[int, dict[str, Any]] = {}
        self.board_status: dict[int, dict[str, Any]] = {}
        self.faults: deque[dict[str, Any]] = deque(maxlen=MESSAGE_HISTORY)
        self.logs: deque[str] = deque(maxlen=MESSAGE_HISTORY)
        self._last_message_s = float("-inf")
        self._replies: dict[int, HubMessage] = {}
        self._sequence = 0
        self._tag = 0
        self.attempts = ATTEMPTS
        """Number of times that a request is sent before it fails."""

    def _take_message(self, message: HubMessage) -> None:
        """Store a hub message: as the reply to a request, or as the latest message of its type."""
        fields = message.fields
        self._last_message_s = self._now_s()
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
            self.logs.append(message.trailing_bytes.decode("ascii", errors="replace"))

    @property
    def seconds_since_message(self) -> float:
        """Time since the latest message of the hub, not counting taxel frames, seconds; infinity before the first.

        A hub sends its status every second, also while no board responds.
        """
        return self._now_s() - self._last_message_s

    def _acknowledge(self, payload: bytes) -> None:
        """Send acknowledgements of key frames to the hub; payload: payload of the ACKNOWLEDGE frame."""
        self._send(FrameType.ACKNOWLEDGE, payload)

    def _send(self, frame_type: FrameType, payload: bytes) -> None:
        """Send one frame to the hub, with the next sequence number."""
        self._link.write(encode_frame(frame_type, self._sequence, payload))
        self._sequence = (self._sequence + 1) % 65536

    def _next_tag(self) -> int:
        """Return a new tag from 1 to 255, by which the reply to a request is recognised."""
        self._tag = self._tag % 255 + 1
        return self._tag

    def _request(self, frame_type: FrameType, payload: bytes, key: int) -> HubMessage:
        """Send a frame, repeat it until its reply arrives, and return the reply.

        key: index of the reply in `_replies`, the tag of a command or the negative tag of a handshake. Raises
        `HubError` after `attempts` attempts.
        """
        self._replies.pop(key, None)
        for _ in range(self.attempts):
            self._send(frame_type, payload)
            deadline = self._now_s() + REPLY_TIMEOUT_S
            while self._now_s() < deadline:
                try:
                    self.stream.poll(0.02)
                except EOFError:
                    raise HubError(
                        f"{self._link.name}: the link ended before the hub replied; check the connection"
                    ) from None
                if key in self._replies:
                    return self._replies.pop(key)
        raise HubError(
            f"{self._link.name}: no reply from a hub after {self.attempts} attempts; check that this is the hub's port "
            f"and that its baud rate is {self._link.baud:.0f}"
        )

    def wait(self, seconds: float) -> None:
        """Process the stream of the hub for `seconds` on the link's clock."""
        deadline = self._now_s() + seconds
        while (remaining_s := deadline - self._now_s()) > 0.0:
            self.stream.poll(min(max(remaining_s, 1e-6), 0.02))

    def handshake(self) -> int:
        """Agree on a protocol version and return it. Raises `VersionError` if hub and host have none in common."""
        tag = self._next_tag()
        versions = {"version_min": PROTOCOL_VERSION_MIN, "version_max": PROTOCOL_VERSION}
        payload = pack(HostHandshake, {"tag": tag} | versions)
        # Replies to handshakes are stored under the negative tag, separate from the replies to commands.
        fields = self._request(FrameType.HOST_HANDSHAKE, payload, key=-tag).fields
        if fields["version_chosen"] == 0:
            raise VersionError(
                f"{self._link.name}: the hub uses protocol {fields['version_min']} to {fields['version_max']}, "
                f"this program {PROTOCOL_VERSION_MIN} to {PROTOCOL_VERSION}; update the older of the two"
            )
        self.version = int(fields["version_chosen"])
        return self.version

    def command(self, command: Command | int, arguments: bytes = b"") -> bytes:
        """Send a command, wait for the reply and return the reply's data.

        An integer is a command code without a name in this program. Raises `HubError` with the hub's status if the hub
        rejects the command.
        """
        tag = self._next_tag()
        payload = pack(CommandPayload, {"tag": tag, "command": int(command)}, arguments)
        reply = self._request(FrameType.COMMAND, payload, tag)
        status = reply.fields["status"]
        if status != ReplyStatus.OK:
            label = command.name if isinstance(command, Command) else f"command {command}"
            name = ReplyStatus(status).name if status in ReplyStatus._value2member_map_ else str(status)
            raise HubError(f"{self._link.name}: the hub rejected {label}: {name.lower().replace('_', ' ')}")
        return reply.trailing_bytes

    def start(self, compact: bool = False, is_first: bool = True) -> None:
        """Start streaming; `compact`: request compact frames from the boards that support them.

        is_first: True: poll cycles between an earlier stream and this one do not count as missing; False, after an
        interruption: they count. Raises `HubError` if the hub does not support compact frames.
        """
        if compact and self.version < COMPACT_VERSION:
            raise HubError(
                f"{self._link.name}: compact frames need protocol version {COMPACT_VERSION}, the agreed version is "
                f"{self.version}; update its firmware or open the link with frames=plain"
            )
        if is_first:
            self.stream.prepare_stream_start()
        self.command(Command.START, pack(StartArguments, {"flags": int(StartFlag.COMPACT)}) if compact else b"")

    def stop(self) -> None:
        """Stop the stream of the hub after the current frame, and wait for the reply."""
        self.command(Command.STOP)

    def send_stop(self) -> None:
        """Send the command STOP to the hub without waiting for the reply."""
        self._send(FrameType.COMMAND, pack(CommandPayload, {"tag": self._next_tag(), "command": int(Command.STOP)}))

    def set_rate(self, rate_hz: float | None) -> None:
        """Limit the poll rate of the hub to `rate_hz` poll cycles per second; None: as fast as the bus allows."""
        if rate_hz is not None and not RATE_MIN_HZ <= rate_hz <= RATE_MAX_HZ:
            raise HubError(f"rate: expected {RATE_MIN_HZ:g} to {RATE_MAX_HZ:g} Hz, found {rate_hz:g} Hz")
        period = 0 if rate_hz is None else round(1e6 / rate_hz)
        self.command(Command.SET_RATE, pack(SetRateArguments, {"period_us": period}))

    def scan_bus(self) -> list[int]:
        """Let the hub scan its I2C bus, and return every address that acknowledges."""
        return list(self.command(Command.SCAN_BUS))

    def read_boards(self) -> None:
        """Request the identity of every board from the hub, and store it in `boards`."""
        self.boards.clear()
        self.command(Command.GET_BOARD_INFO, pack(GetBoardInfoArguments, {"address": 0}))

    def read_status(self) -> None:
        """Read the counters of the hub and of every board into `status` and `board_status`."""
        self.command(Command.GET_STATUS)

    def transfer(self, address: int, write: bytes = b"", read_length: int = 0) -> bytes:
        """Perform one I2C transfer on the hub: write, then read after a repeated start; return the read bytes.

        Raises `HubError` on NACK or bus error.
        """
        fields = {"address": address, "read_length": read_length}
        return self.command(Command.I2C_TRANSFER, pack(TransferArguments, fields, write))

    def read_fault(self) -> FaultRecord | None:
        """Read the last fault of the hub since power-on; None without one, or from a hub without a fault record."""
        return parse_fault_record(self.command(Command.GET_FAULT)) if self.version >= FAULT_VERSION else None

    def read_board_fault(self, address: int) -> FaultRecord | None:
        """Read the last fault of a board since power-on; None without one, or from a board without a fault record.

        Raises `HubError` on NACK or bus error.
        """
        if self.boards.get(address, {}).get("identity_map_revision", 0) < FAULT_REVISION:
            return None
        return parse_fault_register(address, self.transfer(address, bytes([REGISTER_FAULT]), REGISTER_SIZE))

    def set_scan_settings(self, settings: dict[str, int], address: int = 0, front_end: int = FrontEnd.CAPSENSE) -> None:
        """Set scan settings (fields of `taxel_protocol.registers.ScanSettings`) of one board; address 0: all boards.

        front_end: converter for which the settings are. Boards with another converter reject them: `HubError`.
        """
        fields = {"address": address} | {f"settings_{name}": value for name, value in settings.items()}
        arguments = pack(SetScanSettingsArguments, fields | {"front_end": front_end})
        # Hubs of earlier versions accept the arguments only without the last byte.
        self.command(Command.SET_SCAN_SETTINGS, arguments if front_end else arguments[:-1])

    def reboot(self) -> None:
        """Restart the hub and wait for its restart message; the handshake must then be repeated.

        The restart message is a HUB_HANDSHAKE that the hub sends without a request. Raises `HubError` if the message
        does not arrive within `REBOOT_TIMEOUT_S`.
        """
        self._replies.pop(_UNREQUESTED_HANDSHAKE, None)
        self.command(Command.REBOOT)
        deadline = self._now_s() + REBOOT_TIMEOUT_S
        while _UNREQUESTED_HANDSHAKE not in self._replies:
            if self._now_s() > deadline:
                raise HubError(
                    f"{self._link.name}: no message from the hub within {REBOOT_TIMEOUT_S:g} s of a reboot; "
                    "check its power"
                )
            self.stream.poll(0.02)
