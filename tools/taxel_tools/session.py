"""Session with one bootloader: sends packets, reads responses, repeats damaged packets."""

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
)
from taxel_protocol.bootloader_packets import build_packet, compute_row_sum, parse_packet
from taxel_protocol.layout import get_packer, pack, unpack
from taxel_tools.application import request_bootloader
from taxel_tools.errors import BoardError, LostError, NackError, StatusError, TransferError
from taxel_tools.procedure import Burst, Clock, Pause, Procedure, Transfer

RESPONSE_TIMEOUT_S: Final = 0.3
"""Longest time in which a board may be busy: a row or a record takes 20 ms to write, a restart about 50 ms."""
RESTART_TIMEOUT_S: Final = 2.0
"""Time from the first request until the bootloader must answer; a restart takes about 50 ms."""
RETRY_PAUSE_S: Final = 0.002
RETRY_PAUSE_MAX_S: Final = 0.016
"""Longest pause between two reads of a busy board.

The pause doubles from RETRY_PAUSE_S, so that a board that does not respond does not occupy the bus.
"""
ROW_WRITE_S: Final = 0.02
ATTEMPTS: Final = 3
ROW_ATTEMPTS: Final = 8
CHUNK_SIZE: Final = 57
"""Data bytes of a SEND_DATA packet; a PROGRAM_ROW packet carries at most 54."""

_STATUS_TEXTS: Final = {
    BootStatus.KEY: "the bootloader requires a key",
    BootStatus.VERIFY: "the flash did not store the written data and is probably worn out; replace the board",
    BootStatus.LENGTH: "a packet arrived with a wrong length; check the wiring",
    BootStatus.DATA: "the bootloader rejected the data as invalid",
    BootStatus.COMMAND: "the bootloader does not support the command; update the bootloader",
    BootStatus.DEVICE: "a different board answers; check the unique id",
    BootStatus.VERSION: "the bootloader uses another protocol version; update this program",
    BootStatus.CHECKSUM: "packets arrive damaged; check the wiring",
    BootStatus.ARRAY: "the bootloader has no such flash array",
    BootStatus.ROW: "the flash has no such row",
    BootStatus.ROW_PROTECTED: "a write to a protected row (bootloader, configuration or metadata) was refused",
    BootStatus.APPLICATION: "the slot contains no startable image",
    BootStatus.ACTIVE: "a write to a row of the slot in use was refused",
}


@dataclass(frozen=True)
class BootInfo:
    """Information of a bootloader: fields of `taxel_protocol.bootloader.Info` without `version`."""

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
    """Packets to the bootloader at `address`. Every method is a generator of transfers (`procedure.py`).

    Raises `BoardError` for a board that does not answer, `StatusError` for a refused packet.
    """

    def __init__(self, address: int, now_s: Clock) -> None:
        """Create a session with the bootloader of one device. address: I2C address of the board, or `HUB`.

        `row_write_s`: time in s that the bootloader needs to write a flash row.
        """
        self.address = address
        self.now_s = now_s
        self.row_write_s = ROW_WRITE_S

    def enter(self) -> Procedure[dict[str, Any]]:
        """Restart a running application into its bootloader and start a session. Returns the fields of `EnterReply`."""
        deadline = self.now_s() + RESTART_TIMEOUT_S
        while True:
            try:
                yield from request_bootloader(self.address)
            except TransferError as error:
                if self.now_s() > deadline:
                    raise BoardError(self.address, f"{error.problem}; check power and address") from None
            yield Pause(0.01)
            try:
                # If the command was lost, the application still answers and the session does not start.
                return (yield from self.start_session(attempts=1))
            except (TransferError, BoardError) as error:
                if isinstance(error, StatusError) or self.now_s() > deadline:
                    raise

    def start_session(self, attempts: int = ATTEMPTS) -> Procedure[dict[str, Any]]:
        """Start a session with a device in its bootloader. Returns the fields of `EnterReply`."""
        reply = yield from self.request(BootCommand.ENTER, reply=EnterReply, attempts=attempts)
        return unpack(EnterReply, reply)[0]

    def read_info(self) -> Procedure[BootInfo]:
        """Read the bootloader's information about its board."""
        fields = unpack(Info, (yield from self.request(BootCommand.GET_INFO, reply=Info)))[0]
        return BootInfo(**{name: value for name, value in fields.items() if name != "version"})

    def read_free_rows(self) -> Procedure[tuple[int, int]]:
        """Read the first and the last flash row that the bootloader permits to be written."""
        fields = unpack(FlashSizeReply, (yield from self.request(BootCommand.GET_FLASH_SIZE, b"\0", FlashSizeReply)))[0]
        return fields["first_row"], fields["last_row"]

    def read_metadata(self, slot: int) -> Procedure[dict[str, Any] | None]:
        """Read the metadata (`StockMetadata`) of the image in a slot; None if the slot contains no startable image."""
        try:
            data = yield from self.request(BootCommand.GET_METADATA, bytes([slot]), StockMetadata)
        except StatusError as error:
            if error.status == BootStatus.APPLICATION:
                return None
            raise
        return unpack(StockMetadata, data)[0]

    def read_row_sum(self, row: int) -> Procedure[int]:
        """Read from the bootloader the 8-bit sum of the bytes of a flash row."""
        data = yield from self.request(BootCommand.VERIFY_ROW, pack(RowAddress, {"array": 0, "row": row}), 1)
        return data[0]

    def write_row(self, row: int, data: bytes) -> Procedure[None]:
        """Write a flash row of 128 bytes and compare its sum; a row that was damaged on the bus is sent again."""
        assert len(data) == BOOT_ROW_SIZE
        for attempt in range(ROW_ATTEMPTS):
            try:
                if attempt:
                    yield from self.send_without_response(BootCommand.SYNC)
                yield from self._send_row(row, data)
                if (yield from self._finish_row(row)) == compute_row_sum(data):
                    return
            except (StatusError, LostError) as error:
                if isinstance(error, StatusError) and error.status not in (BootStatus.LENGTH, BootStatus.CHECKSUM):
                    raise
        problem = f"row {row} does not read back as sent after {ROW_ATTEMPTS} attempts; check the wiring"
        raise BoardError(self.address, problem)

    def _send_row(self, row: int, data: bytes) -> Procedure[None]:
        """Send the packets of a flash row to the bootloader.

        The first two responses are not read: PROGRAM_ROW detects a missing chunk by the length.
        """
        row_address = pack(RowAddress, {"array": 0, "row": row})
        yield from self._write_all(
            (
                build_packet(BootCommand.SEND_DATA, data[:CHUNK_SIZE]),
                build_packet(BootCommand.SEND_DATA, data[CHUNK_SIZE : 2 * CHUNK_SIZE]),
                build_packet(BootCommand.PROGRAM_ROW, row_address + data[2 * CHUNK_SIZE :]),
            )
        )
        yield Pause(self.row_write_s)

    def _write_all(self, packets: Sequence[bytes]) -> Procedure[None]:
        """Send several packets to the bootloader in a burst.

        If a busy board has not acknowledged a packet, the remaining packets are sent one at a time; all packets are
        sent again if a later one was accepted.
        """
        burst = Burst(tuple(Transfer(self.address, packet) for packet in packets))
        yield burst
        failed = {i: outcome for i, outcome in enumerate(burst.outcomes) if isinstance(outcome, TransferError)}
        if not failed:
            return
        first = min(failed)
        if isinstance(failed[first], LostError):
            raise failed[first]
        if len(failed) < len(burst.outcomes) - first:  # A later packet was accepted, so data is missing in between.
            yield from self.send_without_response(BootCommand.SYNC)
            first = 0
        for packet in packets[first:]:
            yield from self._write(packet)

    def _finish_row(self, row: int) -> Procedure[int]:
        """Wait until the bootloader has written a flash row. Returns the 8-bit sum of the row in flash.

        One burst reads the response to the write, requests the sum of the row and reads the sum. If the board
        was busy or a transfer was damaged, the missing results are then requested singly.
        """
        verify_packet = build_packet(BootCommand.VERIFY_ROW, pack(RowAddress, {"array": 0, "row": row}))
        burst = Burst((self._make_response_read(0), Transfer(self.address, verify_packet), self._make_response_read(1)))
        yield burst
        # On a bus without a queue, a burst ends at its first failure: the missing outcomes become None.
        write_response, verify_outcome, sum_response = [*burst.outcomes, None, None][:3]
        if self._parse_if_ready(write_response, 0) is None:
            yield from self.read_response(0)
            return (yield from self.read_row_sum(row))
        if not isinstance(verify_outcome, bytes):
            return (yield from self.read_row_sum(row))
        data = self._parse_if_ready(sum_response, 1)
        return (data if data is not None else (yield from self.read_response(1)))[0]

    def _parse_if_ready(self, outcome: bytes | TransferError | None, size: int) -> bytes | None:
        """Return the data of a bootloader's response; None if the response is missing or damaged.

        outcome: result of the read transfer. size: expected data bytes. Raises `StatusError` if the bootloader refused
        the packet.
        """
        if isinstance(outcome, bytes):
            with suppress(ValueError):
                return self._parse_response(outcome, size)
        return None

    def verify_application(self) -> Procedure[bool]:
        """Let the bootloader check the image in the free slot; return whether it is complete.

        If rows were written and the image is complete, the bootloader starts it next.
        """
        return (yield from self.request(BootCommand.VERIFY_APPLICATION, reply=1)) == b"\x01"

    def set_active(self, slot: int) -> Procedure[None]:
        """Select the flash slot whose image the bootloader starts next."""
        yield from self.request(BootCommand.SET_ACTIVE, bytes([slot]))

    def exit(self) -> Procedure[None]:
        """Leave the bootloader and restart the device.

        The command has no response. If the packet may be lost, GET_INFO shows whether the bootloader still answers, and
        the command is repeated.
        """
        for _ in range(ATTEMPTS):
            try:
                yield from self.send_without_response(BootCommand.EXIT)
                return
            except LostError:
                try:
                    yield from self.read_info()
                except BoardError:
                    return
        raise LostError(self.address, "does not restart; check the wiring")

    def read_configuration(self) -> Procedure[dict[str, Any] | None]:
        """Read the configuration of the board from its bootloader (fields of `Configuration`); None if it has none."""
        try:
            return unpack(
                Configuration, (yield from self.request(BootCommand.READ_CONFIGURATION, reply=Configuration))
            )[0]
        except StatusError as error:
            if error.status == BootStatus.DATA:
                return None
            raise

    def write_configuration(self, unique_id: bytes, fields: dict[str, Any]) -> Procedure[None]:
        """Write a new configuration to the board with this id; valid from the next restart."""
        yield from self.request(BootCommand.WRITE_CONFIGURATION, unique_id + pack(Configuration, fields))

    def search(self, bits: int, prefix: bytes) -> Procedure[bytes | None]:
        """Send the packet SEARCH to all bootloaders at the address: boards whose unique id has the same first
        `bits` bits as `prefix` answer.

        Returns the reply (those of several boards may overlap), or None without a match: a board that does not
        match acknowledges the packet but not the read.
        """
        packet = build_packet(BootCommand.SEARCH, pack(SearchArguments, {"bits": bits, "unique_id": prefix}))
        try:
            yield from self._write(packet)
        except NackError:
            return None
        yield Pause(0.01)
        size = BOOT_PACKET_OVERHEAD + get_packer(SearchReply).size
        deadline = self.now_s() + RESPONSE_TIMEOUT_S
        pauses = _retry_pauses()
        while True:
            try:
                data = yield Transfer(self.address, read_size=size)
            except NackError:
                return None
            except LostError:
                data = b"\xff"
            if data[0] != 0xFF:
                return data[4 : size - 3]  # without header (start, status, length) and end (checksum, end byte)
            if self.now_s() > deadline:
                raise BoardError(self.address, "the boards do not answer the search; restart them")
            yield Pause(next(pauses))

    def send_without_response(self, command: BootCommand, data: bytes = b"") -> Procedure[None]:
        """Send a packet to the bootloader without reading its response."""
        yield from self._write(build_packet(command, data))

    def request(
        self, command: BootCommand, data: bytes = b"", reply: Struct | int = 0, attempts: int = ATTEMPTS
    ) -> Procedure[bytes]:
        """Send a packet to the bootloader. Returns the data of the response, which must have the size of `reply`.

        A lost or damaged packet is sent again, because every request may be repeated without harm.
        """
        size = reply if isinstance(reply, int) else get_packer(reply).size
        for attempt in range(1, attempts + 1):
            try:
                yield from self._write(build_packet(command, data))
                return (yield from self.read_response(size))
            except (StatusError, LostError) as error:
                can_retry = isinstance(error, LostError) or error.status == BootStatus.CHECKSUM
                if attempt == attempts or not can_retry:
                    raise
        raise AssertionError

    def _write(self, packet: bytes) -> Procedure[None]:
        """Write a packet to the bootloader; repeat it while the board does not acknowledge, because it is busy."""
        deadline = self.now_s() + RESPONSE_TIMEOUT_S
        pauses = _retry_pauses()
        while True:
            try:
                yield Transfer(self.address, packet)
                return
            except NackError:
                if self.now_s() > deadline:
                    raise
            yield Pause(next(pauses))

    def read_response(self, size: int) -> Procedure[bytes]:
        """Read the response of the bootloader; return its `size` data bytes.

        The read is repeated while the bootloader is busy (NACK or FF) or the response is damaged, at most
        `RESPONSE_TIMEOUT_S`. Raises `LostError` after this time, `StatusError` unless the status is OK.
        """
        deadline = self.now_s() + RESPONSE_TIMEOUT_S
        pauses = _retry_pauses()
        problem = "the bootloader does not answer; check the power"
        while True:
            try:
                packet = yield self._make_response_read(size)
                if packet[0] != 0xFF:
                    return self._parse_response(packet, size)
            except ValueError as error:
                problem = f"the replies of the bootloader are damaged ({error}); check the wiring"
            except TransferError as error:
                problem = f"{error.problem}; check the power"
            if self.now_s() > deadline:
                raise LostError(self.address, problem)
            yield Pause(next(pauses))

    def _make_response_read(self, size: int) -> Transfer:
        """Create the I2C transfer that reads a response with `size` data bytes from the bootloader."""
        return Transfer(self.address, read_size=BOOT_PACKET_OVERHEAD + size)

    def _parse_response(self, packet: bytes, size: int) -> bytes:
        """Parse a response packet of the bootloader; return its `size` data bytes.

        Raises `StatusError` if the bootloader refused the packet, ValueError for an invalid response.
        """
        status, data = parse_packet(packet)
        if status != BootStatus.OK:
            raise StatusError(self.address, _describe_status(status), status)
        if len(data) != size:
            raise ValueError(f"expected {size} bytes of data, found {len(data)}")
        return data


def _retry_pauses() -> Iterator[float]:
    """Yield the pauses in s between repetitions of a packet: doubled each time up to `RETRY_PAUSE_MAX_S`, endlessly."""
    pause = RETRY_PAUSE_S
    while True:
        yield pause
        pause = min(2.0 * pause, RETRY_PAUSE_MAX_S)


def _describe_status(status: int) -> str:
    """Return the text of an error message for a status code of the bootloader."""
    is_known = status in BootStatus._value2member_map_
    if not is_known:
        return f"unknown bootloader status {status:02X}; update this program"
    return _STATUS_TEXTS.get(BootStatus(status), f"bootloader status {status:02X}")
