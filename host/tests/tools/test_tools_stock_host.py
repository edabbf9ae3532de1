"""A stock Cypress host tool, rebuilt from published facts, programs a taxel board.

The tool does not use slots, commands of this project, or its row checks. It enters the bootloader, reads the row range,
sends each row in pieces, verifies each row sum, verifies the application, and exits.
"""

import struct

import pytest
from smbus2 import i2c_msg

from taxel.link.virtual import VirtualSMBus
from taxel_protocol.bootloader import BootChecksum
from taxel_protocol.bootloader_packets import build_packet, parse_packet
from taxel_tools.application import get_firmware_version, read_identity
from taxel_tools.files.cyacd import write_cyacd
from taxel_tools.scheduler import run

BOARD = 0x50
ENTER, FLASH_SIZE, SEND, PROGRAM, VERIFY_ROW, VERIFY, EXIT = 0x38, 0x32, 0x37, 0x39, 0x3A, 0x31, 0x3B
ENTER_BOOTLOADER = [0x70, 5, 0xFA, *b"BOOT"]
"""Write to the command register of the application: register, command, complement of the command."""
TRANSFER_MAX, PROGRAM_OVERHEAD, SEND_OVERHEAD = 64, 10, 7


class StockHost:
    """Sends one packet for each write, and reads 64 bytes until the first byte differs from FF."""

    def __init__(self, world, checksum: BootChecksum) -> None:
        self.world, self.bus, self.checksum = world, VirtualSMBus(world), checksum
        self.sent: list[int] = []

    def send(self, command: int, data: bytes = b"") -> bytes:
        """Send a packet and return the data of its response, whose status must be 0; b"" for EXIT."""
        self.sent.append(command)
        self.bus.i2c_rdwr(i2c_msg.write(BOARD, build_packet(command, data, self.checksum)))
        if command == EXIT:
            return b""
        for _ in range(100):
            self.world.run(0.001)
            reply = i2c_msg.read(BOARD, TRANSFER_MAX)
            try:
                self.bus.i2c_rdwr(reply)
            except OSError:
                continue
            if bytes(reply)[0] != 0xFF:
                status, reply_data = parse_packet(bytes(reply), self.checksum)
                assert status == 0, f"{command:02X} was refused with {status:02X}"
                return reply_data
        raise AssertionError(f"no answer to {command:02X}")

    def program(self, cyacd: str) -> None:
        """Program a .cyacd file as the stock tool does. Raises ValueError for a row outside the permitted range."""
        header, *lines = cyacd.split()
        reply = self.send(ENTER)
        assert reply[:4] == bytes.fromhex(header[:8])[::-1]
        assert reply[4] == bytes.fromhex(header)[4]
        first_row, last_row = struct.unpack("<HH", self.send(FLASH_SIZE, b"\0"))
        for line in lines:
            record = bytes.fromhex(line[1:])
            array, row, size = record[0], int.from_bytes(record[1:3], "big"), int.from_bytes(record[3:5], "big")
            if not first_row <= row <= last_row:
                raise ValueError(f"row {row} is not between {first_row} and {last_row}")
            data = record[5:-1]
            while len(data) + PROGRAM_OVERHEAD > TRANSFER_MAX:
                self.send(SEND, data[: TRANSFER_MAX - SEND_OVERHEAD])
                data = data[TRANSFER_MAX - SEND_OVERHEAD :]
            row_address = bytes([array]) + row.to_bytes(2, "little")
            self.send(PROGRAM, row_address + data)
            expected = record[-1] + array + row + (row >> 8) + size + (size >> 8) & 0xFF
            assert self.send(VERIFY_ROW, row_address) == bytes([expected])
        assert self.send(VERIFY) == b"\x01"
        self.send(EXIT)


@pytest.mark.parametrize("checksum", [BootChecksum.SUM, BootChecksum.CRC])
def test_a_stock_host_tool_programs_the_taxel_bootloader(worlds, adapter, make_image, checksum):
    world = worlds(boards=1)
    host = StockHost(world, checksum)
    host.bus.i2c_rdwr(i2c_msg.write(BOARD, ENTER_BOOTLOADER))
    world.run(0.05)
    host.program(write_cyacd(make_image(1, size=1024), 142, checksum))
    # 1,024 bytes are 8 rows of 128 bytes.
    assert host.sent == [ENTER, FLASH_SIZE, *[SEND, SEND, PROGRAM, VERIFY_ROW] * 8, VERIFY, EXIT]
    world.run(0.2)
    assert get_firmware_version(run(adapter(world), read_identity(BOARD))) == (1, 2, 3)


def test_a_stock_host_tool_refuses_a_file_for_the_slot_in_use(worlds, make_image):
    world = worlds(boards=1)
    host = StockHost(world, BootChecksum.SUM)
    host.bus.i2c_rdwr(i2c_msg.write(BOARD, ENTER_BOOTLOADER))
    world.run(0.05)
    with pytest.raises(ValueError, match="row 32 is not between 142 and 251"):
        host.program(write_cyacd(make_image(0), 32))
    assert host.sent == [ENTER, FLASH_SIZE]
