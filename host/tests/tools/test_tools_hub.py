"""Firmware updates of the hub over its UART: confirmation, return to the previous image, continued polling."""

import pytest

from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import EmulatorLink
from taxel.link.virtual import VirtualMemoryLink, VirtualSerialLink, VirtualWorld
from taxel.stream import HubClient
from taxel_protocol.bootloader import LAYOUTS, BootDevice
from taxel_tools.errors import HUB, BoardError
from taxel_tools.files import Firmware
from taxel_tools.firmware_update import update_target
from taxel_tools.hub_target import HubTarget
from taxel_tools.scheduler import run, run_all

HANG = bytes(8) + b"HANG"
BOARDS = [0x50, 0x51, 0x52, 0x53]


@pytest.fixture
def make_hub_firmware(make_firmware):
    """Factory of hub images for both slots."""
    return lambda **options: make_firmware(device=BootDevice.HUB, **options)


def try_update(link, firmware, report=lambda progress: None, **options):
    """Update the hub and return the outcome or the error. options: of `update_target`."""
    target = HubTarget(link)
    return run_all(target.wire, {0: update_target(target, firmware, report, **options)})[0]


def read_version(link):
    """Read the firmware version of the running hub by a handshake."""
    client = HubClient(link)
    client.handshake()
    client.stream.release()
    return tuple(client.last_handshake[f"firmware_{part}"] for part in ("major", "minor", "patch"))


def read_slot(world, slot, size):
    """Read the first `size` bytes of a slot in the flash of the hub."""
    first_byte = LAYOUTS[BootDevice.HUB].slot_address(slot)
    return world.read_flash(HUB).data[first_byte : first_byte + size]


def test_the_hub_receives_the_image_of_its_free_slot_and_confirms_it(worlds, make_hub_firmware):
    world = worlds()
    link = VirtualMemoryLink(world)
    firmware = make_hub_firmware(version=(3, 1, 4), size=13312)
    result = try_update(link, firmware)
    assert (result.address, result.before, result.after) == (HUB, (0, 1, 0), (3, 1, 4))
    # 13,312 bytes are 104 rows of 128 bytes.
    assert (result.slot, result.rows_written, result.rows_kept, result.is_written) == (1, 104, 0, True)
    assert read_slot(world, 1, 13312) == firmware.select_image_for(1).data
    world.inject("hub_unplug")
    world.inject("hub_plug")
    world.run(0.2)
    assert read_version(link) == (3, 1, 4), "the image is confirmed"


def test_the_next_update_is_written_to_the_other_slot(worlds, make_hub_firmware):
    link = VirtualMemoryLink(worlds())
    assert try_update(link, make_hub_firmware()).slot == 1
    assert try_update(link, make_hub_firmware(version=(2, 0, 0))).slot == 0
    assert read_version(link) == (2, 0, 0)


def test_a_hub_that_runs_the_image_already_is_not_written_unless_forced(worlds, make_hub_firmware):
    world = worlds()
    link = VirtualMemoryLink(world)
    try_update(link, make_hub_firmware())
    wear = world.read_flash(HUB).wear.copy()
    second_result = try_update(link, make_hub_firmware())
    assert (second_result.is_written, second_result.rows_written) == (False, 0)
    assert (world.read_flash(HUB).wear == wear).all()
    assert try_update(link, make_hub_firmware(), force=True).slot == 0


def test_boards_are_polled_before_and_after_the_update(worlds, make_hub_firmware):
    world = worlds()
    link = VirtualMemoryLink(world)
    client = HubClient(link)
    client.handshake()
    client.start()
    client.wait(0.2)
    target = HubTarget(link)
    result = run(target.wire, update_target(target, make_hub_firmware(), lambda progress: None))
    assert result.after == (1, 2, 3)
    assert target.polled_addresses == BOARDS
    client = HubClient(link)
    client.handshake()
    client.start()
    client.wait(0.2)
    assert {frame.address for frame in client.stream.frames} == set(BOARDS)


def test_a_board_that_is_not_polled_any_more_is_reported(worlds, make_hub_firmware):
    world = worlds()

    def unplug(progress) -> None:
        if progress.stage == "starting":
            world.inject("unplug", 0x52)

    error = try_update(VirtualMemoryLink(world), make_hub_firmware(), unplug)
    assert "hub: does not poll 0x52 any more; check the power of these boards" in str(error)


@pytest.mark.parametrize("stop_at", [0, 1, 20])
def test_an_interrupted_update_continues_at_the_first_missing_row(worlds, make_hub_firmware, stop_at):
    link = VirtualMemoryLink(worlds())
    firmware = make_hub_firmware(size=4096)

    def stop(progress) -> None:
        if progress.stage == "writing" and progress.done == stop_at:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        try_update(link, firmware, stop)
    result = try_update(link, firmware)  # The hub is still in its bootloader.
    # 4,096 bytes are 32 rows of 128 bytes.
    assert (result.before, result.rows_kept, result.rows_written) == (None, stop_at, 32 - stop_at)
    assert read_version(link) == (1, 2, 3)


@pytest.mark.parametrize("listens", [0, 1])
@pytest.mark.parametrize("after_s", [0.004, 0.017])
@pytest.mark.parametrize("operation", [1, 3, 4, 5, 6])
def test_a_hub_that_loses_power_runs_the_old_or_the_new_image(worlds, make_hub_firmware, listens, operation, after_s):
    """The update makes six writes: three rows, and the records that the image is pending, tried and confirmed.

    The power is cut 4 ms or 17 ms after the start of the write with the number `operation`; a write takes 20 ms.
    """
    world = worlds(f"boot_listens {listens}", boards=1)
    link = VirtualMemoryLink(world)
    firmware = make_hub_firmware(size=384)
    world.plan_power_cut(HUB, operation, after_s, 0.03)
    first_result = try_update(link, firmware)
    world.run(0.5)
    assert len(world.read_power_cuts(HUB)) == 1
    assert read_version(link) in ((0, 1, 0), (1, 2, 3))
    second_result = try_update(link, firmware)
    assert not isinstance(second_result, TaxelError), (first_result, second_result)
    assert read_version(link) == (1, 2, 3)
    assert read_slot(world, 1, 384) == firmware.select_image_for(1).data


def test_an_image_that_hangs_is_replaced_by_the_previous_image(worlds, make_hub_firmware):
    link = VirtualMemoryLink(worlds())
    error = try_update(link, make_hub_firmware(content=HANG + bytes(400)))
    assert str(error) == ("hub: the new image 1.2.3 did not start, the hub returned to 0.1.0; do not use this file")
    assert try_update(link, make_hub_firmware(version=(1, 2, 4))).after == (1, 2, 4)


def test_a_file_for_boards_is_refused_before_any_write(worlds, make_firmware):
    world = worlds()
    link = VirtualMemoryLink(world)
    before = world.read_flash(HUB).data
    error = try_update(link, make_firmware())
    assert isinstance(error, BoardError)
    assert (
        "hub: the device is the hub with 32 KiB of flash, but slot-a.bin and slot-b.bin is for a sensor board"
        in str(error)
    )
    assert world.read_flash(HUB).data == before
    world.run(0.2)
    assert read_version(link) == (0, 1, 0)


def test_a_file_only_for_the_slot_in_use_is_refused(worlds, make_image):
    image = make_image(0, device=BootDevice.HUB)
    error = try_update(VirtualMemoryLink(worlds()), Firmware((image,)))
    assert "hub: the free slot is B, but slot-a.bin is linked only for slot A" in str(error)


@pytest.mark.parametrize("fault", ["up_flip", "up_drop", "up_double", "down_flip", "down_drop", "down_double"])
def test_an_update_succeeds_despite_damaged_lost_and_doubled_bytes_on_the_uart(worlds, make_hub_firmware, fault):
    world = worlds()
    link = VirtualMemoryLink(world)
    firmware = make_hub_firmware(size=2048)

    def disturb(progress) -> None:
        world.inject(fault, 0, 23 * progress.done % 90, 1)  # after 0 to 89 further bytes: another position in each row

    result = try_update(link, firmware, disturb)
    assert not isinstance(result, TaxelError), result
    assert read_slot(world, 1, 2048) == firmware.select_image_for(1).data
    assert read_version(link) == (1, 2, 3)


def test_an_update_succeeds_with_latency_and_flow_control(worlds, make_hub_firmware):
    world = worlds("usb_latency_down_ms 16", "flow_control 1")
    assert try_update(VirtualMemoryLink(world), make_hub_firmware()).after == (1, 2, 3)


@pytest.mark.parametrize("position", [0, 5, 12])
def test_a_lost_reply_to_the_bootloader_command_is_tolerated(worlds, make_hub_firmware, position):
    world = worlds()

    def lose_reply(progress) -> None:
        if progress.stage == "entering":
            world.inject("up_drop", 0, position, 1)

    assert try_update(VirtualMemoryLink(world), make_hub_firmware(), lose_reply).after == (1, 2, 3)


def test_a_missing_hub_gives_one_error_line(worlds, make_hub_firmware):
    world = worlds()
    world.inject("hub_unplug")
    error = try_update(VirtualMemoryLink(world), make_hub_firmware())
    assert "virtual:: no reply from a hub after 4 attempts; check that this is the hub's port" in str(error)


def test_an_update_works_over_a_serial_port(make_hub_firmware):
    text = format_world(load_hand("rig4"), WorldSettings())
    with VirtualWorld(text, "pty") as world:
        world.run(0.3)
        link = VirtualSerialLink(world)
        assert try_update(link, make_hub_firmware()).after == (1, 2, 3)
        link.close()


def test_a_hub_update_in_real_time_ends_with_frames_of_the_boards_polled_before(make_hub_firmware):
    """On one link, the application of the hub sends frames, and its bootloader exchanges packets during the update.

    Before the update, the hub polls the four boards of the hand (`polled_addresses`). After the update, the new image
    1.2.3 must send a frame of each of these boards; otherwise the update ends with an error.
    """
    link = EmulatorLink(format_world(load_hand("rig4"), WorldSettings(usb_latency_ms=1.0)))
    try:
        target = HubTarget(link)
        outcome = run(target.wire, update_target(target, make_hub_firmware(size=200), lambda progress: None))
    finally:
        link.close()
    assert (outcome.after, target.polled_addresses) == ((1, 2, 3), BOARDS)
