"""Start-up between a reset and the first instructions of an image, executed in Unicorn."""

import pytest

from taxel_protocol.bootloader import LAYOUTS, BootDevice

pytest.importorskip("unicorn", reason="unicorn is not installed: pip install unicorn==2.1.4")

from host.tests.firmware_images.conftest import NONE, make_metadata
from host.tests.firmware_images.psoc_part import POWER_ON, SLICE, SOFTWARE, Part, read_metadata

DEVICES = {"board": BootDevice.BOARD, "hub": BootDevice.HUB}
MS = 24_000
"""Bootloader cycles per millisecond."""

HANDOVER = 0x80
"""Offset in RAM of the words that survive a reset: stay, cause."""

IMO_TRIM2, CLK_SELECT, RESET_CAUSE = 0x400BFF2C, 0x400B0100, 0x400B0300
TRIM_48_MHZ = 53
CPUSS_CONFIG, SCB0_CTRL, SCB1_CTRL = 0x40000000, 0x40060000, 0x40070000
BOOTLOADER_END = 0x1000
LOAD_LATCH, WRITE_ROW = 4, 5
"""System calls of the flash controller."""
BUS_INTERRUPT, SENSOR_INTERRUPT = 1 << 10, 1 << 15
SLICES_200_MS = 200 * MS // SLICE


def get_slot_address(device: str, slot: int) -> int:
    return LAYOUTS[DEVICES[device]].slot_address(slot)


def run_to_image(part: Part, device: str, slot: int) -> None:
    """Run until the processor leaves the bootloader, and check that it executes the image of the slot."""
    first_byte = get_slot_address(device, slot)
    part.run_until(lambda: part.pc >= BOOTLOADER_END, 5000)
    assert first_byte <= part.pc < first_byte + LAYOUTS[DEVICES[device]].slot_size


def run_to_main_loop(part: Part) -> None:
    """Run an image until interrupts are enabled and the clock is 48 MHz, and 50 slices further."""
    part.run_until(lambda: part.enabled != 0 and not part.is_masked and part.words[IMO_TRIM2] == TRIM_48_MHZ, 200)
    part.run(50)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("slot", [0, 1])
def test_a_confirmed_image_starts_without_a_write(flash_with, device, slot):
    part = Part(SOFTWARE, flash_with(device, "ab", make_metadata(confirmed=slot, pending=NONE, tries=(3, 3))))
    run_to_image(part, device, slot)
    assert part.calls == []


@pytest.mark.parametrize("device", DEVICES)
def test_after_power_on_the_bootloader_listens_for_100_ms(flash_with, device):
    part = Part(POWER_ON, flash_with(device, "a", make_metadata(confirmed=0, pending=NONE, tries=(3, 3))))
    run_to_image(part, device, 0)
    assert 99 * MS <= part.cycles <= 150 * MS  # includes the checksum of the image


def test_a_bootloader_without_an_image_keeps_running(flash_with):
    part = Part(POWER_ON, flash_with("board", ""))
    part.run(SLICES_200_MS)
    assert part.pc < BOOTLOADER_END
    assert part.calls == []  # no write to the flash
    assert part.enabled == BUS_INTERRUPT


def test_a_trial_start_is_recorded_before_the_first_instruction_of_the_image(flash_with):
    """`tries`: remaining trial starts of the slots A and B. The bootloader starts the pending slot B (number 1)."""
    part = Part(SOFTWARE, flash_with("board", "ab", make_metadata(confirmed=0, pending=1, tries=(3, 2))))
    run_to_image(part, "board", 1)
    assert read_metadata(part) == make_metadata(confirmed=0, pending=1, tries=(3, 1))
    assert [opcode for opcode, _ in part.calls] == [LOAD_LATCH, WRITE_ROW]


def test_without_remaining_tries_the_confirmed_image_starts(flash_with):
    part = Part(SOFTWARE, flash_with("board", "ab", make_metadata(confirmed=0, pending=1, tries=(3, 0))))
    run_to_image(part, "board", 0)


@pytest.mark.parametrize("device", DEVICES)
def test_a_damaged_image_is_replaced_by_the_other_slot(flash_with, device):
    flash = bytearray(flash_with(device, "ab", make_metadata(confirmed=0, pending=NONE, tries=(3, 3))))
    flash[get_slot_address(device, 0) + 2000] ^= 1  # a bit in the code of the confirmed image
    part = Part(SOFTWARE, bytes(flash))
    run_to_image(part, device, 1)


def test_a_request_to_stay_is_valid_for_one_reset(flash_with):
    """The request is the word "STAY" in RAM, which keeps its content over a reset. The bootloader clears
    the request.
    """
    flash = flash_with("board", "a", make_metadata(confirmed=0, pending=NONE, tries=(3, 3)))
    ram = bytearray(0x1000)
    ram[HANDOVER : HANDOVER + 4] = b"STAY"
    part = Part(SOFTWARE, flash, bytes(ram))
    part.run(SLICES_200_MS)
    assert part.pc < BOOTLOADER_END
    assert part.ram(HANDOVER, 4) == bytes(4)
    run_to_image(Part(SOFTWARE, flash, part.ram()), "board", 0)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("slot", [0, 1])
def test_an_image_reads_its_vectors_from_ram(flash_with, device, slot):
    part = Part(SOFTWARE, flash_with(device, "ab", make_metadata(confirmed=slot, pending=NONE, tries=(3, 3))))
    run_to_image(part, device, slot)
    run_to_main_loop(part)
    first_byte = get_slot_address(device, slot)
    assert part.words[CPUSS_CONFIG] & 1  # the processor reads the vectors from RAM
    stack_pointer = part.flash(first_byte + 32, 4)  # after the header of the image
    assert int.from_bytes(stack_pointer, "little") == 0x20001000
    # All vectors are addresses in the code of the slot; bit 0 is set for Thumb code.
    assert all(
        first_byte < vector < first_byte + LAYOUTS[DEVICES[device]].slot_size and vector & 1 for vector in part.vectors
    )


@pytest.mark.parametrize("device", DEVICES)
def test_an_image_runs_at_48_mhz_with_the_flash_at_24_mhz(flash_with, device):
    part = Part(SOFTWARE, flash_with(device, "a", make_metadata(confirmed=0, pending=NONE, tries=(3, 3))))
    run_to_image(part, device, 0)
    run_to_main_loop(part)
    assert part.words[IMO_TRIM2] == TRIM_48_MHZ
    assert part.words[CLK_SELECT] >> 18 & 1  # the flash clock is divided by two


@pytest.mark.parametrize("cause", [POWER_ON, 1 << 0, 1 << 1, SOFTWARE])  # bits of the register RES_CAUSE
def test_the_bootloader_clears_the_reset_cause_and_passes_it_to_the_image(flash_with, cause):
    part = Part(cause, flash_with("board", "a", make_metadata(confirmed=0, pending=NONE, tries=(3, 3))))
    part.run(5)
    assert int.from_bytes(part.ram(HANDOVER + 4, 4), "little") == cause
    assert part.words[RESET_CAUSE] == 0


def test_the_serial_block_is_disabled_before_the_image_starts(flash_with):
    for device, control in (("board", SCB0_CTRL), ("hub", SCB1_CTRL)):
        part = Part(SOFTWARE, flash_with(device, "a", make_metadata(confirmed=0, pending=NONE, tries=(3, 3))))
        part.run_until(lambda part=part, control=control: part.words[control] != 0)
        writes: list[int] = []
        part.on_write[control] = writes.append
        run_to_image(part, device, 0)
        assert writes[0] == 0


def test_the_start_is_independent_of_the_ram_contents(flash_with):
    flash = flash_with("board", "a", make_metadata(confirmed=0, pending=NONE, tries=(3, 3)))
    part = Part(SOFTWARE, flash, bytes([0xA5]) * 0x1000)  # any pattern in the 4 KiB of RAM
    run_to_image(part, "board", 0)
    run_to_main_loop(part)
    assert part.enabled == BUS_INTERRUPT | SENSOR_INTERRUPT


def test_a_factory_file_starts_its_image_on_trial(build_folder):
    for device in DEVICES:
        flash = bytearray(0x8000)
        for line in (build_folder / "images" / f"{device}-factory.hex").read_text().splitlines():
            data = bytes.fromhex(line[1:])
            if data[3] == 0:  # a data record of Intel HEX
                address = int.from_bytes(data[1:3], "big")
                flash[address : address + data[0]] = data[4:-1]
        part = Part(SOFTWARE, bytes(flash))
        run_to_image(part, device, 0)
        assert read_metadata(part) == make_metadata(confirmed=NONE, pending=0, tries=(2, 3))
