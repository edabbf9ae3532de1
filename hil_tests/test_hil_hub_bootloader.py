"""The hub takes new firmware over its UART, and keeps the old until the new one has shown that it works."""

import struct

import pytest

from hil_tests.harness.rig import Rig
from hil_tests.harness.virtual.images import images
from hil_tests.harness.watching import watch
from taxel.link import Link
from taxel.skin import Skin
from taxel.stream import HubError
from taxel_protocol import Command, bootloader
from taxel_protocol.bootloader import BootCommand, BootDevice, BootStatus
from taxel_protocol.limits import BOOTLOADER_KEY
from taxel_tools.files.firmware import HEADER_SIZE

pytestmark = pytest.mark.needs("faults")  # a hub on a bench is not reprogrammed by a test
NEW_VERSION = (3, 1, 4)
ROW = 128
CHUNK = 54  # bytes of a PROGRAM_ROW or SEND_DATA that fit a packet of 64


class HubBootloader:
    """Packets on the UART."""

    def __init__(self, link: Link) -> None:
        self._link = link

    def ask(self, command: BootCommand, data: bytes = b"") -> bytes:
        self._link.write(bootloader.build_packet(command, data))
        received = b""
        for _ in range(200):
            chunk = self._link.read(0.005)
            received += chunk.data if chunk is not None else b""
            start = received.find(b"\x01")
            if start >= 0 and len(received) >= start + 4:
                size = 7 + struct.unpack_from("<H", received, start + 2)[0]
                if len(received) >= start + size:
                    status, reply = bootloader.parse_packet(received[start : start + size])
                    assert status == BootStatus.OK, f"{command.name}: {BootStatus(status).name}"
                    return reply
        raise AssertionError(f"{command.name}: no answer")

    def program(self, image: bytes, first_row: int) -> None:
        image += bytes(-len(image) % ROW)
        for place in range(0, len(image), ROW):
            row = image[place : place + ROW]
            where = struct.pack("<BH", 0, first_row + place // ROW)
            self.ask(BootCommand.SEND_DATA, row[:CHUNK])
            self.ask(BootCommand.SEND_DATA, row[CHUNK : 2 * CHUNK])
            self.ask(BootCommand.PROGRAM_ROW, where + row[2 * CHUNK :])
            assert self.ask(BootCommand.VERIFY_ROW, where)[0] == bootloader.row_sum(row)


def enter(rig: Rig, skin: Skin) -> HubBootloader:
    skin.hub.command(Command.ENTER_BOOTLOADER, struct.pack("<I", BOOTLOADER_KEY))
    rig.clock.wait(0.1)
    while skin.link.read(0.0) is not None:
        pass  # what the application had still to say
    return HubBootloader(skin.link)


def new_program(rig: Rig) -> bytes:
    """What follows the header of an image that works: code for slot B, where a hub executes it."""
    if 0 in rig.description.executed:
        return (images() / "hub-b.bin").read_bytes()[HEADER_SIZE:]
    return bytes(8) + b"new hub" * 40


def update(rig: Rig, skin: Skin, content: bytes) -> HubBootloader:
    boot = enter(rig, skin)
    boot.ask(BootCommand.ENTER)
    first_row, _ = struct.unpack("<HH", boot.ask(BootCommand.GET_FLASH_SIZE, b"\x00"))
    image = bootloader.image(BootDevice.HUB, 1, 0, NEW_VERSION, content)
    boot.program(image, first_row)
    assert boot.ask(BootCommand.VERIFY_APPLICATION) == b"\x01"
    return boot


def restart(rig: Rig, skin: Skin) -> None:
    skin.link.write(bootloader.build_packet(BootCommand.EXIT))
    rig.clock.wait(0.1)


def version_of(rig: Rig) -> tuple[int, ...]:
    with Skin(rig.uart.link(), rig.hand) as skin:
        frames = watch(rig, skin, 0.5)
        assert {frame.address for frame in frames} == {board.address for board in rig.hand.boards}
        assert skin.hub.last_handshake is not None
        return tuple(skin.hub.last_handshake[f"firmware_{part}"] for part in ("major", "minor", "patch"))


def test_the_hub_runs_what_it_was_given_and_its_boards_stream(rig: Rig, skin: Skin) -> None:
    update(rig, skin, new_program(rig))
    restart(rig, skin)
    assert version_of(rig) == NEW_VERSION
    rig.power.switch(False)
    rig.clock.wait(0.1)
    rig.power.switch(True)
    assert version_of(rig) == NEW_VERSION  # it had confirmed itself


@pytest.mark.faulty_image
def test_a_hub_image_that_hangs_gives_way_to_the_old_one(rig: Rig, skin: Skin) -> None:
    old = version_of(rig)
    with Skin(rig.uart.link(), rig.hand) as fresh:
        update(rig, fresh, bytes(8) + b"HANG" + bytes(100))
        restart(rig, fresh)
        rig.clock.wait(5.0)  # three trials, each ended by the watchdog
    assert version_of(rig) == old


@pytest.mark.parametrize("cut_ms", [3, 11, 19, 27])
def test_a_hub_that_loses_power_while_it_is_written_boots_the_old_image(rig: Rig, skin: Skin, cut_ms: int) -> None:
    old = version_of(rig)
    with Skin(rig.uart.link(), rig.hand) as fresh:
        boot = enter(rig, fresh)
        boot.ask(BootCommand.ENTER)
        first_row, _ = struct.unpack("<HH", boot.ask(BootCommand.GET_FLASH_SIZE, b"\x00"))
        boot.ask(BootCommand.SEND_DATA, bytes(CHUNK))
        boot.ask(BootCommand.SEND_DATA, bytes(CHUNK))
        data = struct.pack("<BH", 0, first_row) + bytes(ROW - 2 * CHUNK)
        fresh.link.write(bootloader.build_packet(BootCommand.PROGRAM_ROW, data))
        rig.clock.wait(1e-3 * cut_ms)
        rig.power.switch(False)
        rig.clock.wait(0.1)
        rig.power.switch(True)
        rig.clock.wait(0.2)
    assert version_of(rig) == old


def test_a_hub_is_not_led_into_its_bootloader_by_chance(rig: Rig, skin: Skin) -> None:
    with pytest.raises(HubError, match="bad arguments"):
        skin.hub.command(Command.ENTER_BOOTLOADER, b"\x00" * 4)
    assert watch(rig, skin, 0.3)
