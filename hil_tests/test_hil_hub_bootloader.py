"""Firmware update of the hub over its UART; the old image remains until the new image has confirmed itself."""

import struct

import pytest

from hil_tests.harness.frame_checks import read_frames
from hil_tests.harness.parts import PARTS
from hil_tests.harness.rig import Rig
from hil_tests.harness.virtual.images import build_images
from taxel.link import Link
from taxel.skin import Skin
from taxel.stream import HubError
from taxel_protocol import Command
from taxel_protocol.bootloader import BootCommand, BootStatus
from taxel_protocol.bootloader_images import build_image
from taxel_protocol.bootloader_packets import build_packet, compute_row_sum, parse_packet
from taxel_protocol.limits import BOOTLOADER_KEY
from taxel_tools.files.firmware import HEADER_SIZE

pytestmark = pytest.mark.needs("hub_board", "faults")  # tests do not reprogram the hub of a physical rig
NEW_VERSION = (3, 1, 4)
ROW = 128
CHUNK = 54  # bytes of a PROGRAM_ROW or SEND_DATA that fit a packet of 64


class HubBootloader:
    """The bootloader of the hub, accessed by packets on its UART."""

    def __init__(self, link: Link) -> None:
        self._link = link

    def request(self, command: BootCommand, data: bytes = b"") -> bytes:
        """Send a packet and return the data of its reply; fails without a reply in 1 s or with an error status."""
        self._link.write(build_packet(command, data))
        received = b""
        for _ in range(200):
            chunk = self._link.read(0.005)
            received += chunk.data if chunk is not None else b""
            start = received.find(b"\x01")
            if start >= 0 and len(received) >= start + 4:
                size = 7 + struct.unpack_from("<H", received, start + 2)[0]
                if len(received) >= start + size:
                    status, reply = parse_packet(received[start : start + size])
                    assert status == BootStatus.OK, f"{command.name}: {BootStatus(status).name}"
                    return reply
        raise AssertionError(f"{command.name}: no reply")

    def program(self, image: bytes, first_row: int) -> None:
        """Write an image to the flash of the hub, row by row from `first_row`, and check the sum of each written
        row.
        """
        image += bytes(-len(image) % ROW)
        for offset in range(0, len(image), ROW):
            row = image[offset : offset + ROW]
            row_number = struct.pack("<BH", 0, first_row + offset // ROW)
            self.request(BootCommand.SEND_DATA, row[:CHUNK])
            self.request(BootCommand.SEND_DATA, row[CHUNK : 2 * CHUNK])
            self.request(BootCommand.PROGRAM_ROW, row_number + row[2 * CHUNK :])
            assert self.request(BootCommand.VERIFY_ROW, row_number)[0] == compute_row_sum(row)


def enter_bootloader(rig: Rig, skin: Skin) -> HubBootloader:
    """Restart the hub into its bootloader, and discard the last frames of its application."""
    skin.hub.command(Command.ENTER_BOOTLOADER, struct.pack("<I", BOOTLOADER_KEY))
    rig.clock.wait(0.1)
    while skin.link.read(0.0) is not None:
        pass  # discard the last frames of the application
    return HubBootloader(skin.link)


def make_program(rig: Rig) -> bytes:
    """Return the content of a working image after its header: the code of slot B if the hub executes ARM images,
    otherwise arbitrary bytes.
    """
    if 0 in rig.description.executed:
        return (build_images(rig.description.part) / "hub-b.bin").read_bytes()[HEADER_SIZE:]
    return bytes(8) + b"new hub" * 40


def program_image(rig: Rig, skin: Skin, content: bytes) -> HubBootloader:
    """Write a new image with the given content to the free slot of the hub. Returns the bootloader, which still
    runs.
    """
    boot = enter_bootloader(rig, skin)
    boot.request(BootCommand.ENTER)
    first_row, _ = struct.unpack("<HH", boot.request(BootCommand.GET_FLASH_SIZE, b"\x00"))
    image = build_image(PARTS[rig.description.part].hub, 1, 0, NEW_VERSION, content)
    boot.program(image, first_row)
    assert boot.request(BootCommand.VERIFY_APPLICATION) == b"\x01"
    return boot


def restart(rig: Rig, skin: Skin) -> None:
    """Leave the bootloader of the hub, so that its application starts."""
    skin.link.write(build_packet(BootCommand.EXIT))
    rig.clock.wait(0.1)


def read_version(rig: Rig) -> tuple[int, ...]:
    """Check that frames of all boards arrive, and return the firmware version of the hub: major, minor, patch."""
    with Skin(rig.uart.open_link(), rig.hand) as skin:
        frames = read_frames(rig, skin, 0.5)
        assert {frame.address for frame in frames} == {board.address for board in rig.hand.boards}
        assert skin.hub.last_handshake is not None
        return tuple(skin.hub.last_handshake[f"firmware_{part}"] for part in ("major", "minor", "patch"))


def test_hub_runs_the_programmed_image_and_its_boards_stream(rig: Rig) -> None:
    with Skin(rig.uart.open_link(), rig.hand) as skin:
        program_image(rig, skin, make_program(rig))
        restart(rig, skin)
    assert read_version(rig) == NEW_VERSION
    rig.power.switch(False)
    rig.clock.wait(0.1)
    rig.power.switch(True)
    assert read_version(rig) == NEW_VERSION  # the image has confirmed itself


@pytest.mark.faulty_image
def test_hub_returns_to_the_old_image_if_the_new_image_hangs(rig: Rig) -> None:
    old_version = read_version(rig)
    with Skin(rig.uart.open_link(), rig.hand) as skin_before:
        # after the 8 bytes of vectors, the emulator treats code that begins with HANG as code that does not respond
        program_image(rig, skin_before, bytes(8) + b"HANG" + bytes(100))
        restart(rig, skin_before)
        rig.clock.wait(5.0)  # the watchdog ends each of three trials
    assert read_version(rig) == old_version


@pytest.mark.parametrize("cut_ms", [3, 11, 19, 27])
def test_hub_boots_the_old_image_after_a_power_cut_during_programming(rig: Rig, cut_ms: int) -> None:
    """The power is cut `cut_ms` after the request to write the first row of an image; a write takes 20 ms."""
    old_version = read_version(rig)
    with Skin(rig.uart.open_link(), rig.hand) as skin_before:
        boot = enter_bootloader(rig, skin_before)
        boot.request(BootCommand.ENTER)
        first_row, _ = struct.unpack("<HH", boot.request(BootCommand.GET_FLASH_SIZE, b"\x00"))
        boot.request(BootCommand.SEND_DATA, bytes(CHUNK))
        boot.request(BootCommand.SEND_DATA, bytes(CHUNK))
        data = struct.pack("<BH", 0, first_row) + bytes(ROW - 2 * CHUNK)
        skin_before.link.write(build_packet(BootCommand.PROGRAM_ROW, data))
        rig.clock.wait(1e-3 * cut_ms)
        rig.power.switch(False)
        rig.clock.wait(0.1)
        rig.power.switch(True)
        rig.clock.wait(0.2)
    assert read_version(rig) == old_version


def test_hub_rejects_a_wrong_bootloader_key_and_continues_to_stream(rig: Rig, skin: Skin) -> None:
    with pytest.raises(HubError, match="bad arguments"):
        skin.hub.command(Command.ENTER_BOOTLOADER, b"\x00" * 4)
    assert read_frames(rig, skin, 0.3)
