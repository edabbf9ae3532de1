"""A talk with one board's bootloader: packets out, responses in, one retry of what was damaged on the way."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

from construct import Struct

from taxel_protocol.bootloader import (
    BOOT_PACKET_OVERHEAD,
    BOOT_ROW_SIZE,
    BootCommand,
    BootStatus,
    Configuration,
    EnterReply,
    FlashSizeReply,
    Info,
    RowAddress,
    SearchArguments,
    SearchReply,
    StockMetadata,
    build_packet,
    parse_packet,
    row_sum,
)
from taxel_protocol.layout import pack, packer_of, unpack
from taxel_protocol.limits import REGISTER_COMMAND
from taxel_protocol.names import BoardCommand
from taxel_tools.errors import BoardError, LostError, NackError, StatusError, TransferError
from taxel_tools.steps import Burst, Clock, Pause, Steps, Transfer

PATIENCE_S: Final = 0.3
"""How long a board may not be ready: a row and a record take 20 ms each, a restart some 50 ms."""
RESTART_S: Final = 2.0
"""From the first request until the bootloader must answer; a restart takes some 50 ms."""
AGAIN_S: Final = 0.002
AGAIN_MAX_S: Final = 0.016
"""Between two looks at a board that is not ready, longer and longer: a silent board must not keep the bus busy."""
ROW_WRITE_S: Final = 0.02
ATTEMPTS: Final = 3
ROW_ATTEMPTS: Final = 8
PIECE: Final = 57
"""Data bytes of a SEND_DATA packet; PROGRAM_ROW takes 54."""

_WORDS: Final = {
    BootStatus.KEY: "the bootloader wants a key",
    BootStatus.VERIFY: "its flash did not take what was written; the flash is worn out, exchange the board",
    BootStatus.LENGTH: "a packet arrived with a wrong length; check the wiring",
    BootStatus.DATA: "the bootloader found the data impossible",
    BootStatus.COMMAND: "the bootloader does not know the command; it is older than this program",
    BootStatus.DEVICE: "another board answers than was meant",
    BootStatus.VERSION: "the bootloader speaks another version; update this program",
    BootStatus.CHECKSUM: "packets arrive damaged; check the wiring",
    BootStatus.ARRAY: "the bootloader has no such flash array",
    BootStatus.ROW: "the flash has no such row",
    BootStatus.ROW_PROTECTED: "a protected row (bootloader, configuration or metadata) was to be written",
    BootStatus.APPLICATION: "the slot holds no image that can start",
    BootStatus.ACTIVE: "a row of the slot in use was to be written",
}


@dataclass(frozen=True)
class BootInfo:
    """What a bootloader says of its board; the fields of `taxel_protocol.bootloader.Info`."""

    device: int
    stay: int
    target: int
    confirmed: int
    pending: int
    tries: bytes
    address: int
    kind: int
    unique_id: bytes


class BootSession:
    """Packets to the bootloader at `address`. Every method is a generator of transfers (`steps.py`).

    Raises `BoardError` for a board that does not answer, `StatusError` for a refused packet.
    """

    def __init__(self, address: int, now_s: Clock) -> None:
        self.address = address
        self.now_s = now_s
        self.row_write_s = ROW_WRITE_S

    def enter(self) -> Steps[dict[str, Any]]:
        """Ask a running application for its bootloader, and begin a session; returns the fields of `EnterReply`."""
        command = BoardCommand.ENTER_BOOTLOADER
        deadline = self.now_s() + RESTART_S
        while True:
            try:
                yield Transfer(self.address, bytes([REGISTER_COMMAND, command, command ^ 0xFF]))
            except TransferError as error:
                if self.now_s() > deadline:
                    raise BoardError(self.address, f"{error.problem}; check its power and its address") from None
            yield Pause(0.01)
            try:
                return (yield from self.enter_here(attempts=1))  # if the command was lost, an application answers
            except (TransferError, BoardError) as error:
                if isinstance(error, StatusError) or self.now_s() > deadline:
                    raise

    def enter_here(self, attempts: int = ATTEMPTS) -> Steps[dict[str, Any]]:
        """Begin a session with a board that is in its bootloader; returns the fields of `EnterReply`."""
        reply = yield from self.ask(BootCommand.ENTER, reply=EnterReply, attempts=attempts)
        return unpack(EnterReply, reply)[0]

    def info(self) -> Steps[BootInfo]:
        """What the bootloader says of its board."""
        fields = unpack(Info, (yield from self.ask(BootCommand.GET_INFO, reply=Info)))[0]
        return BootInfo(**{name: value for name, value in fields.items() if name != "version"})

    def free_rows(self) -> Steps[tuple[int, int]]:
        """First and last row that may be written."""
        fields = unpack(FlashSizeReply, (yield from self.ask(BootCommand.GET_FLASH_SIZE, b"\0", FlashSizeReply)))[0]
        return fields["first_row"], fields["last_row"]

    def metadata(self, slot: int) -> Steps[dict[str, Any] | None]:
        """Fields of `StockMetadata` of a slot's image; None if there is none that can start."""
        try:
            data = yield from self.ask(BootCommand.GET_METADATA, bytes([slot]), StockMetadata)
        except StatusError as error:
            if error.status == BootStatus.APPLICATION:
                return None
            raise
        return unpack(StockMetadata, data)[0]

    def row_sum(self, row: int) -> Steps[int]:
        """8-bit sum of a row."""
        data = yield from self.ask(BootCommand.VERIFY_ROW, pack(RowAddress, {"array": 0, "row": row}), 1)
        return data[0]

    def write_row(self, row: int, data: bytes) -> Steps[None]:
        """Write 128 bytes and have them summed up again; a row that went wrong on the wire is sent anew."""
        assert len(data) == BOOT_ROW_SIZE
        for attempt in range(ROW_ATTEMPTS):
            try:
                if attempt:
                    yield from self.post(BootCommand.SYNC)
                yield from self._send_row(row, data)
                if (yield from self._row_written(row)) == row_sum(data):
                    return
            except (StatusError, LostError) as error:
                if isinstance(error, StatusError) and error.status not in (BootStatus.LENGTH, BootStatus.CHECKSUM):
                    raise
        raise BoardError(self.address, f"row {row} does not read back as sent after {ROW_ATTEMPTS} attempts; check it")

    def _send_row(self, row: int, data: bytes) -> Steps[None]:
        """The responses to the first two packets are not read: a missing piece is seen by the third."""
        place = pack(RowAddress, {"array": 0, "row": row})
        yield from self._write_all(
            (
                build_packet(BootCommand.SEND_DATA, data[:PIECE]),
                build_packet(BootCommand.SEND_DATA, data[PIECE : 2 * PIECE]),
                build_packet(BootCommand.PROGRAM_ROW, place + data[2 * PIECE :]),
            )
        )
        yield Pause(self.row_write_s)

    def _write_all(self, packets: Sequence[bytes]) -> Steps[None]:
        """Pieces that belong together. A board that is busy with one takes no other: from there on, one at a time."""
        burst = Burst(tuple(Transfer(self.address, packet) for packet in packets))
        yield burst
        failed = {place: one for place, one in enumerate(burst.outcomes) if isinstance(one, TransferError)}
        if not failed:
            return
        first = min(failed)
        if isinstance(failed[first], LostError):
            raise failed[first]
        if len(failed) < len(burst.outcomes) - first:  # a later one was taken: there is a gap
            yield from self.post(BootCommand.SYNC)
            first = 0
        for packet in packets[first:]:
            yield from self._write(packet)

    def _row_written(self, row: int) -> Steps[int]:
        """The end of a PROGRAM_ROW, and the 8-bit sum of what is in flash then."""
        question = build_packet(BootCommand.VERIFY_ROW, pack(RowAddress, {"array": 0, "row": row}))
        burst = Burst((self._reading(0), Transfer(self.address, question), self._reading(1)))
        yield burst
        written, asked, summed = [*burst.outcomes, None, None][:3]
        if self._data_if_ready(written, 0) is None:
            yield from self.response(0)
            return (yield from self.row_sum(row))
        if not isinstance(asked, bytes):
            return (yield from self.row_sum(row))
        data = self._data_if_ready(summed, 1)
        return (data if data is not None else (yield from self.response(1)))[0]

    def _data_if_ready(self, outcome: bytes | TransferError | None, size: int) -> bytes | None:
        """Data of a response; None if it is not there yet, or damaged. Raises `StatusError` for a refusal."""
        if isinstance(outcome, bytes):
            with suppress(ValueError):
                return self._data_of(outcome, size)
        return None

    def verify_application(self) -> Steps[bool]:
        """Whether the image in the free slot is whole; if rows were written it is the next to start."""
        return (yield from self.ask(BootCommand.VERIFY_APPLICATION, reply=1)) == b"\x01"

    def set_active(self, slot: int) -> Steps[None]:
        """Let the image of a slot be the next to start."""
        yield from self.ask(BootCommand.SET_ACTIVE, bytes([slot]))

    def exit(self) -> Steps[None]:
        """Restart; there is no response. If nobody knows whether the packet arrived, the bootloader is asked."""
        for _ in range(ATTEMPTS):
            try:
                yield from self.post(BootCommand.EXIT)
                return
            except LostError:
                try:
                    yield from self.info()
                except BoardError:
                    return
        raise LostError(self.address, "does not restart; check the wiring")

    def configuration(self) -> Steps[dict[str, Any] | None]:
        """Fields of `Configuration`; None if the board has none."""
        try:
            return unpack(Configuration, (yield from self.ask(BootCommand.READ_CONFIGURATION, reply=Configuration)))[0]
        except StatusError as error:
            if error.status == BootStatus.DATA:
                return None
            raise

    def write_configuration(self, unique_id: bytes, fields: dict[str, Any]) -> Steps[None]:
        """Give the board with that id a new configuration; it holds from the next restart on."""
        yield from self.ask(BootCommand.WRITE_CONFIGURATION, unique_id + pack(Configuration, fields))

    def search(self, bits: int, prefix: bytes) -> Steps[bytes | None]:
        """Send a SEARCH; the data of the reply, of several boards perhaps, or None if nobody acknowledges.

        Boards that are silent acknowledge the packet, but not the read.
        """
        packet = build_packet(BootCommand.SEARCH, pack(SearchArguments, {"bits": bits, "unique_id": prefix}))
        try:
            yield from self._write(packet)
        except NackError:
            return None
        yield Pause(0.01)
        size = BOOT_PACKET_OVERHEAD + packer_of(SearchReply).size
        deadline = self.now_s() + PATIENCE_S
        again = _again()
        while True:
            try:
                data = yield Transfer(self.address, read_size=size)
            except NackError:
                return None
            except LostError:
                data = b"\xff"
            if data[0] != 0xFF:
                return data[4 : size - 3]
            if self.now_s() > deadline:
                raise BoardError(self.address, "the boards there do not answer a search; restart them")
            yield Pause(next(again))

    def post(self, command: BootCommand, data: bytes = b"") -> Steps[None]:
        """Send a packet and leave its response unread."""
        yield from self._write(build_packet(command, data))

    def ask(
        self, command: BootCommand, data: bytes = b"", reply: Struct | int = 0, attempts: int = ATTEMPTS
    ) -> Steps[bytes]:
        """Send a packet; returns the response's data, of the expected size.

        What was lost or damaged is sent again: nothing that is asked does harm when it is asked twice.
        """
        size = reply if isinstance(reply, int) else packer_of(reply).size
        for attempt in range(1, attempts + 1):
            try:
                yield from self._write(build_packet(command, data))
                return (yield from self.response(size))
            except (StatusError, LostError) as error:
                may_pass = isinstance(error, LostError) or error.status == BootStatus.CHECKSUM
                if attempt == attempts or not may_pass:
                    raise
        raise AssertionError

    def _write(self, packet: bytes) -> Steps[None]:
        """A NACK means that the board is busy."""
        deadline = self.now_s() + PATIENCE_S
        again = _again()
        while True:
            try:
                yield Transfer(self.address, packet)
                return
            except NackError:
                if self.now_s() > deadline:
                    raise
            yield Pause(next(again))

    def response(self, size: int) -> Steps[bytes]:
        """Read until there is a response: NACK and FF mean "not yet". Raises `StatusError` if it is not OK."""
        deadline = self.now_s() + PATIENCE_S
        again = _again()
        wrong = "its bootloader does not answer; check its power"
        while True:
            try:
                packet = yield self._reading(size)
                if packet[0] != 0xFF:
                    return self._data_of(packet, size)
            except ValueError as error:
                wrong = f"its bootloader's answers are damaged ({error}); check the wiring"
            except TransferError as error:
                wrong = f"{error.problem}; check its power"
            if self.now_s() > deadline:
                raise LostError(self.address, wrong)
            yield Pause(next(again))

    def _reading(self, size: int) -> Transfer:
        return Transfer(self.address, read_size=BOOT_PACKET_OVERHEAD + size)

    def _data_of(self, packet: bytes, size: int) -> bytes:
        """Raises `StatusError` for a refusal, ValueError for what is no response with that much data."""
        status, data = parse_packet(packet)
        if status != BootStatus.OK:
            raise StatusError(self.address, _words(status), status)
        if len(data) != size:
            raise ValueError(f"{len(data)} bytes of data in place of {size}")
        return data


def _again() -> Iterator[float]:
    pause = AGAIN_S
    while True:
        yield pause
        pause = min(2.0 * pause, AGAIN_MAX_S)


def _words(status: int) -> str:
    known = status in BootStatus._value2member_map_
    return (
        _WORDS.get(BootStatus(status), f"bootloader status {status:02X}") if known else f"unknown status {status:02X}"
    )
