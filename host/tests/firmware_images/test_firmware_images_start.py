"""What happens between a reset and the first instruction of an image, executed in Unicorn."""

from __future__ import annotations

import pytest

from taxel_protocol.bootloader import LAYOUTS, BootDevice

pytest.importorskip("unicorn", reason="unicorn is not installed: pip install unicorn==2.1.4")

from host.tests.firmware_images.psoc_part import POWER_ON, SOFTWARE, Part, metadata_of

DEVICES = {"board": BootDevice.BOARD, "hub": BootDevice.HUB}
MS = 24_000
"""Cycles of the bootloader."""

HANDOVER = 0x80
"""Offset in RAM of the words that survive a reset: stay, cause."""

IMO_TRIM2, CLK_SELECT = 0x400BFF2C, 0x400B0100
CPUSS_CONFIG, SCB0_CTRL, SCB1_CTRL = 0x40000000, 0x40060000, 0x40070000
NONE = 0xFF


def start_of(device: str, slot: int) -> int:
    return LAYOUTS[DEVICES[device]].slot_address(slot)


def run_into(part: Part, device: str, slot: int) -> None:
    begin = start_of(device, slot)
    part.run_until(lambda: part.pc >= 0x1000, 5000)
    assert begin <= part.pc < begin + LAYOUTS[DEVICES[device]].slot_size


def run_to_main_loop(part: Part) -> None:
    part.run_until(lambda: part.enabled != 0 and not part.is_masked and part.words[IMO_TRIM2] == 53, 200)
    part.run(50)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("slot", [0, 1])
def test_a_confirmed_image_starts_without_a_write(flash_of, device, slot):
    part = Part(SOFTWARE, flash_of(device, "ab", bytes([slot, NONE, 3, 3])))
    run_into(part, device, slot)
    assert part.calls == []


@pytest.mark.parametrize("device", DEVICES)
def test_after_power_on_the_bootloader_listens_for_a_tenth_of_a_second(flash_of, device):
    part = Part(POWER_ON, flash_of(device, "a", bytes([0, NONE, 3, 3])))
    run_into(part, device, 0)
    assert 99 * MS <= part.cycles <= 150 * MS  # and the image's checksum


def test_a_bootloader_without_an_image_stays(flash_of):
    part = Part(POWER_ON, flash_of("board", ""))
    part.run(200 * MS // 1000)
    assert part.pc < 0x1000
    assert part.calls == []
    assert part.enabled == 1 << 10


def test_an_image_on_trial_has_one_try_less_before_its_first_instruction(flash_of):
    part = Part(SOFTWARE, flash_of("board", "ab", bytes([0, 1, 3, 2])))
    run_into(part, "board", 1)
    assert metadata_of(part) == bytes([0, 1, 3, 1])
    assert [opcode for opcode, _ in part.calls] == [4, 5]


def test_an_image_without_tries_gives_way_to_the_confirmed_one(flash_of):
    part = Part(SOFTWARE, flash_of("board", "ab", bytes([0, 1, 3, 0])))
    run_into(part, "board", 0)


@pytest.mark.parametrize("device", DEVICES)
def test_a_damaged_image_gives_way_to_the_other_slot(flash_of, device):
    flash = bytearray(flash_of(device, "ab", bytes([0, NONE, 3, 3])))
    flash[start_of(device, 0) + 2000] ^= 1
    part = Part(SOFTWARE, bytes(flash))
    run_into(part, device, 1)


def test_a_request_to_stay_holds_for_one_reset(flash_of):
    flash = flash_of("board", "a", bytes([0, NONE, 3, 3]))
    ram = bytearray(0x1000)
    ram[HANDOVER : HANDOVER + 4] = b"STAY"
    part = Part(SOFTWARE, flash, bytes(ram))
    part.run(200 * MS // 1000)
    assert part.pc < 0x1000
    assert part.ram(HANDOVER, 4) == bytes(4)
    run_into(Part(SOFTWARE, flash, part.ram()), "board", 0)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("slot", [0, 1])
def test_an_image_serves_its_vectors_from_ram(flash_of, device, slot):
    part = Part(SOFTWARE, flash_of(device, "ab", bytes([slot, NONE, 3, 3])))
    run_into(part, device, slot)
    run_to_main_loop(part)
    begin = start_of(device, slot)
    assert part.words[CPUSS_CONFIG] & 1
    assert part.ram(0, 128) == part.flash(begin + 32, 128)
    assert part.vectors[0] == 0x20001000
    handlers = {vector for vector in part.vectors[1:] if vector}
    assert all(begin < vector < begin + LAYOUTS[DEVICES[device]].slot_size and vector & 1 for vector in handlers)


@pytest.mark.parametrize("device", DEVICES)
def test_an_image_runs_at_48_mhz_with_the_flash_at_half_of_it(flash_of, device):
    part = Part(SOFTWARE, flash_of(device, "a", bytes([0, NONE, 3, 3])))
    run_into(part, device, 0)
    run_to_main_loop(part)
    assert part.words[IMO_TRIM2] == 53
    assert part.words[CLK_SELECT] >> 18 & 1


@pytest.mark.parametrize("cause", [POWER_ON, 1 << 0, 1 << 1, SOFTWARE])
def test_the_bootloader_clears_the_cause_of_the_reset_and_hands_it_on(flash_of, cause):
    part = Part(cause, flash_of("board", "a", bytes([0, NONE, 3, 3])))
    part.run(5)
    assert int.from_bytes(part.ram(HANDOVER + 4, 4), "little") == cause
    assert part.words[0x400B0300] == 0


def test_the_wire_is_off_while_the_image_starts(flash_of):
    for device, control in (("board", SCB0_CTRL), ("hub", SCB1_CTRL)):
        part = Part(SOFTWARE, flash_of(device, "a", bytes([0, NONE, 3, 3])))
        part.run_until(lambda part=part, control=control: part.words[control] != 0)
        writes: list[int] = []
        part.on_write[control] = writes.append
        run_into(part, device, 0)
        assert writes[0] == 0


def test_the_start_does_not_depend_on_what_ram_held(flash_of):
    flash = flash_of("board", "a", bytes([0, NONE, 3, 3]))
    part = Part(SOFTWARE, flash, bytes([0xA5]) * 0x1000)
    run_into(part, "board", 0)
    run_to_main_loop(part)
    assert part.enabled == 1 << 10 | 1 << 15


def test_a_factory_file_starts_its_image(built):
    for device in DEVICES:
        flash = bytearray(0x8000)
        for line in (built / "images" / f"{device}-factory.hex").read_text().splitlines():
            data = bytes.fromhex(line[1:])
            if data[3] == 0:
                address = int.from_bytes(data[1:3], "big")
                flash[address : address + data[0]] = data[4:-1]
        part = Part(SOFTWARE, bytes(flash))
        run_into(part, device, 0)
        assert metadata_of(part) == bytes([NONE, 0, 2, 3])
