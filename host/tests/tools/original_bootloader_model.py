"""Model of the bootloader of the original boards: one application, 8-bit sums, 0.5 s after a reset.

The model implements the interface of `smbus2.SMBus` in virtual time. It is written from the published facts about the
component (Bootloader_v1_60), not from its source. A response must be read before the next packet is accepted.
"""

import errno
import random
from typing import Any

from taxel_protocol.bootloader import BOOT_ROW_SIZE, BootCommand, BootStatus, EnterReply, FlashSizeReply
from taxel_protocol.bootloader_packets import build_packet, compute_row_sum, parse_packet

LISTEN_S = 0.5
BYTE_S = 9 / 100e3
ROW_S = 0.02
ROWS = 128
METADATA_OFFSET = 64
PACKET_MAX = 64
VERSION = bytes([60, 1, 0])


class OriginalBootloader:
    """Bootloader of an original board at `address` behind an I2C adapter.

    first_row: number of rows of the bootloader. on_s: times at which the board is switched on. damage: probability that
    a byte of a transfer is damaged. cut_after: number of written rows after which the power fails.
    """

    def __init__(
        self,
        address: int,
        silicon_id: int,
        first_row: int,
        *,
        on_s: tuple[float, ...] = (0.0,),
        damage: float = 0.0,
        seed: int = 0,
        cut_after: int | None = None,
    ) -> None:
        self.address, self.silicon_id, self.first_row = address, silicon_id, first_row
        self.on_s, self.damage, self.cut_after = on_s, damage, cut_after
        self.random = random.Random(seed)
        self.time_s = 0.0
        self.flash = bytearray(ROWS * BOOT_ROW_SIZE)
        self.is_in_session = self.has_started = self.has_written = False
        self.written_rows: list[int] = []
        self.unread_responses = 0
        self._buffer = b""
        self._response = b""
        self._ready_s = 0.0

    def now_s(self) -> float:
        """Return the virtual time in s."""
        return self.time_s

    def wait(self, seconds: float) -> None:
        """Advance the virtual time."""
        self.time_s += seconds

    def close(self) -> None:
        """Do nothing, as there is nothing to close."""

    def is_valid(self) -> bool:
        """Return whether the metadata describe an application with the correct sum."""
        metadata = self.flash[-METADATA_OFFSET:]
        length = int.from_bytes(metadata[9:13], "little")
        begin = (int.from_bytes(metadata[5:7], "little") + 1) * BOOT_ROW_SIZE
        return length > 0 and (sum(self.flash[begin : begin + length]) + metadata[0]) & 0xFF == 0

    def i2c_rdwr(self, *messages: Any) -> None:
        """Run the messages of one I2C transfer."""
        for message in messages:
            self.time_s += (1 + message.len) * BYTE_S
            if message.addr != self.address or not self._is_listening():
                raise OSError(errno.ENXIO, "no acknowledge")
            if message.flags & 1:
                self._read(message)
            else:
                self._write(self._damaged(bytes(message)))

    def _is_listening(self) -> bool:
        """Return whether the bootloader runs: for 0.5 s after power-on, during a session, or without an application."""
        if self.has_started or not any(on_s <= self.time_s for on_s in self.on_s):
            return False
        since = self.time_s - max(on_s for on_s in self.on_s if on_s <= self.time_s)
        return self.is_in_session or not self.is_valid() or since < LISTEN_S

    def _damaged(self, data: bytes) -> bytes:
        """Return the bytes of a transfer with random bit errors; `damage` is the probability for each byte."""
        return bytes(
            byte ^ 1 << self.random.randrange(8) if self.random.random() < self.damage else byte for byte in data
        )

    def _read(self, message: Any) -> None:
        """Answer a read with the response once it is ready, otherwise with FF bytes. A response is read once."""
        data = self._response if self.time_s >= self._ready_s else b""
        if data:
            self._response = b""
        for index, byte in enumerate(self._damaged(data[: message.len].ljust(message.len, b"\xff"))):
            message.buf[index] = byte

    def _write(self, packet: bytes) -> None:
        """Process a packet; while a response has not been read, the packet is ignored and counted."""
        if self._response:
            self.unread_responses += 1
            return  # the component waits until its response is read
        self._ready_s = self.time_s + 0.001
        try:
            command, data = parse_packet(packet[:PACKET_MAX])
        except ValueError:
            self._response = build_packet(BootStatus.CHECKSUM)
            return
        if command in (BootCommand.SYNC, BootCommand.EXIT):
            self._buffer = b""
            self.has_started = command == BootCommand.EXIT and self.is_valid()
            return
        status, reply = self._execute(command, data)
        self._response = build_packet(status, reply)

    def _execute(self, command: int, data: bytes) -> tuple[int, bytes]:
        """Execute a command with a response; return status and data of the response."""
        if command == BootCommand.ENTER:
            self.is_in_session, self._buffer = True, b""
            fields = {"silicon_id": self.silicon_id, "revision": 0x11, "bootloader_version": VERSION}
            return BootStatus.OK, EnterReply.build(fields)
        if not self.is_in_session:
            return BootStatus.COMMAND, b""
        if command == BootCommand.GET_FLASH_SIZE:
            return BootStatus.OK, FlashSizeReply.build({"first_row": self.first_row, "last_row": ROWS - 1})
        if command == BootCommand.GET_APPLICATION_STATUS:
            return BootStatus.OK, bytes([0 if self.is_valid() else 1, 1])
        if command == BootCommand.SEND_DATA:
            self._buffer += data
            return BootStatus.OK, b""
        if command == BootCommand.PROGRAM_ROW:
            return self._program(int.from_bytes(data[1:3], "little"), self._buffer + data[3:]), b""
        if command == BootCommand.VERIFY_ROW:
            row = int.from_bytes(data[1:3], "little")
            return BootStatus.OK, bytes([compute_row_sum(self.flash[row * BOOT_ROW_SIZE : (row + 1) * BOOT_ROW_SIZE])])
        if command == BootCommand.VERIFY_APPLICATION:
            return BootStatus.OK, bytes([self.is_valid()])
        return BootStatus.COMMAND, b""

    def _program(self, row: int, data: bytes) -> int:
        """Write a row and return the status. The first write erases the metadata of the application.

        After `cut_after` rows, the power fails instead, and returns after one second.
        """
        self._buffer = b""
        if len(data) != BOOT_ROW_SIZE:
            return BootStatus.LENGTH
        if not self.first_row <= row < ROWS:
            return BootStatus.ROW
        if not self.has_written:  # one application: its metadata are erased first
            self.flash[-BOOT_ROW_SIZE:] = bytes(BOOT_ROW_SIZE)
            self.has_written = True
        if len(self.written_rows) == self.cut_after:
            self.on_s, self.is_in_session, self.cut_after, self.has_written = (self.time_s + 1.0,), False, None, False
            return BootStatus.OK
        self.flash[row * BOOT_ROW_SIZE : (row + 1) * BOOT_ROW_SIZE] = data
        self.written_rows.append(row)
        self._ready_s = self.time_s + ROW_S
        return BootStatus.OK
