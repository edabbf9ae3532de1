"""The hub gets new firmware over its UART, keeps the old until the new has shown that it works, and polls on."""

from __future__ import annotations

import pytest

from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, world_text
from taxel.link import EmulatorLink
from taxel.link.virtual import VirtualMemoryLink, VirtualSerialLink, VirtualWorld
from taxel.stream import HubClient
from taxel_protocol.bootloader import LAYOUTS, BootDevice
from taxel_tools.errors import HUB, BoardError
from taxel_tools.files import Firmware
from taxel_tools.hub_target import HubTarget
from taxel_tools.scheduler import run, run_all
from taxel_tools.firmware_update import update_target

HANG = bytes(8) + b"HANG"
BOARDS = [0x50, 0x51, 0x52, 0x53]


@pytest.fixture
def make_hub_firmware(make_firmware):
    """Images of the hub for both slots."""
    return lambda **options: make_firmware(device=BootDevice.HUB, **options)


def attempt(link, firmware, report=lambda progress: None, **options):
    target = HubTarget(link)
    return run_all(target.wire, {0: update_target(target, firmware, report, **options)})[0]


def version_of(link):
    client = HubClient(link)
    client.handshake()
    client.stream.release()
    return tuple(client.last_handshake[f"firmware_{part}"] for part in ("major", "minor", "patch"))


def slot_bytes(world, slot, size):
    begin = LAYOUTS[BootDevice.HUB].slot_address(slot)
    return world.board_flash(HUB).data[begin : begin + size]


def test_the_hub_gets_the_image_of_its_free_slot_and_confirms_it(worlds, make_hub_firmware):
    world = worlds()
    link = VirtualMemoryLink(world)
    firmware = make_hub_firmware(version=(3, 1, 4), size=13312)
    result = attempt(link, firmware)
    assert (result.address, result.before, result.after) == (HUB, (0, 1, 0), (3, 1, 4))
    assert (result.slot, result.rows_written, result.rows_kept, result.is_written) == (1, 104, 0, True)
    assert slot_bytes(world, 1, 13312) == firmware.image_for(1).data
    world.inject("hub_unplug")
    world.inject("hub_plug")
    world.run(0.2)
    assert version_of(link) == (3, 1, 4), "it had confirmed itself"


def test_the_next_update_goes_to_the_other_slot(worlds, make_hub_firmware):
    link = VirtualMemoryLink(worlds())
    assert attempt(link, make_hub_firmware()).slot == 1
    assert attempt(link, make_hub_firmware(version=(2, 0, 0))).slot == 0
    assert version_of(link) == (2, 0, 0)


def test_a_hub_that_runs_the_image_already_is_left_alone_unless_forced(worlds, make_hub_firmware):
    world = worlds()
    link = VirtualMemoryLink(world)
    attempt(link, make_hub_firmware())
    wear = world.board_flash(HUB).wear.copy()
    again = attempt(link, make_hub_firmware())
    assert (again.is_written, again.rows_written) == (False, 0)
    assert (world.board_flash(HUB).wear == wear).all()
    assert attempt(link, make_hub_firmware(), force=True).slot == 0


def test_boards_are_polled_before_and_after(worlds, make_hub_firmware):
    world = worlds()
    link = VirtualMemoryLink(world)
    client = HubClient(link)
    client.handshake()
    client.start()
    client.wait(0.2)
    target = HubTarget(link)
    result = run(target.wire, update_target(target, make_hub_firmware(), lambda progress: None))
    assert result.after == (1, 2, 3)
    assert target.boards == BOARDS
    client = HubClient(link)
    client.handshake()
    client.start()
    client.wait(0.2)
    assert {frame.address for frame in client.stream.frames} == set(BOARDS)


def test_a_board_that_is_not_polled_any_more_is_told(worlds, make_hub_firmware):
    world = worlds()

    def unplug(progress) -> None:
        if progress.stage == "starting":
            world.inject("unplug", 0x52)

    error = attempt(VirtualMemoryLink(world), make_hub_firmware(), unplug)
    assert "hub: does not poll 0x52 any more; look at taxel scan" in str(error)


@pytest.mark.parametrize("stop_at", [0, 1, 20])
def test_an_update_that_was_cut_off_goes_on_where_it_stopped(worlds, make_hub_firmware, stop_at):
    link = VirtualMemoryLink(worlds())
    firmware = make_hub_firmware(size=4096)

    def stop(progress) -> None:
        if progress.stage == "writing" and progress.done == stop_at:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        attempt(link, firmware, stop)
    result = attempt(link, firmware)  # the hub is still in its bootloader
    assert (result.before, result.rows_kept, result.rows_written) == (None, stop_at, 32 - stop_at)
    assert version_of(link) == (1, 2, 3)


@pytest.mark.parametrize("listens", [0, 1])
@pytest.mark.parametrize("after_s", [0.004, 0.017])
@pytest.mark.parametrize("operation", [1, 3, 4, 5, 6])
def test_a_hub_that_loses_power_runs_the_old_image_or_the_new(worlds, make_hub_firmware, listens, operation, after_s):
    """Three rows, pending, a try, confirmed: the power is cut in each of them."""
    world = worlds(f"boot_listens {listens}", boards=1)
    link = VirtualMemoryLink(world)
    firmware = make_hub_firmware(size=384)
    world.plan_cut(HUB, operation, after_s, 0.03)
    first = attempt(link, firmware)
    world.run(0.5)
    assert len(world.cuts(HUB)) == 1
    assert version_of(link) in ((0, 1, 0), (1, 2, 3))
    again = attempt(link, firmware)
    assert not isinstance(again, TaxelError), (first, again)
    assert version_of(link) == (1, 2, 3)
    assert slot_bytes(world, 1, 384) == firmware.image_for(1).data


def test_an_image_that_hangs_gives_way_to_the_one_before(worlds, make_hub_firmware):
    link = VirtualMemoryLink(worlds())
    error = attempt(link, make_hub_firmware(content=HANG + bytes(400)))
    assert str(error) == (
        "hub: the new image 1.2.3 did not come up, the hub is back on 0.1.0; do not use this file"
    )  # fmt: skip
    assert attempt(link, make_hub_firmware(version=(1, 2, 4))).after == (1, 2, 4)


def test_a_file_for_boards_is_refused_before_a_byte_is_written(worlds, make_firmware):
    world = worlds()
    link = VirtualMemoryLink(world)
    before = world.board_flash(HUB).data
    error = attempt(link, make_firmware())
    assert isinstance(error, BoardError)
    assert "hub: is the hub, but slot-a.bin and slot-b.bin is for a sensor board" in str(error)
    assert world.board_flash(HUB).data == before
    world.run(0.2)
    assert version_of(link) == (0, 1, 0)


def test_a_file_for_the_slot_in_use_alone_is_refused(worlds, make_image):
    image = make_image(0, device=BootDevice.HUB)
    error = attempt(VirtualMemoryLink(worlds()), Firmware((image,)))
    assert "hub: its free slot is B, but slot-a.bin is linked for slot A only" in str(error)


@pytest.mark.parametrize("fault", ["up_flip", "up_drop", "up_double", "down_flip", "down_drop", "down_double"])
def test_damage_on_the_uart_costs_time_and_nothing_else(worlds, make_hub_firmware, fault):
    world = worlds()
    link = VirtualMemoryLink(world)
    firmware = make_hub_firmware(size=2048)

    def hurt(progress) -> None:
        world.inject(fault, 0, 23 * progress.done % 90, 1)

    result = attempt(link, firmware, hurt)
    assert not isinstance(result, TaxelError), result
    assert slot_bytes(world, 1, 2048) == firmware.image_for(1).data
    assert version_of(link) == (1, 2, 3)


def test_latency_each_way_and_a_hub_that_holds_back_change_nothing_but_time(worlds, make_hub_firmware):
    world = worlds("usb_latency_down_ms 16", "flow_control 1")
    assert attempt(VirtualMemoryLink(world), make_hub_firmware()).after == (1, 2, 3)


@pytest.mark.parametrize("place", [0, 5, 12])
def test_a_lost_answer_to_the_command_that_opens_the_bootloader_is_no_failure(worlds, make_hub_firmware, place):
    world = worlds()

    def lose(progress) -> None:
        if progress.stage == "entering":
            world.inject("up_drop", 0, place, 1)

    assert attempt(VirtualMemoryLink(world), make_hub_firmware(), lose).after == (1, 2, 3)


def test_nobody_at_the_port_is_one_line(worlds, make_hub_firmware):
    world = worlds()
    world.inject("hub_unplug")
    error = attempt(VirtualMemoryLink(world), make_hub_firmware())
    assert "virtual:: no answer from a hub after 4 attempts; is this the hub's port" in str(error)


def test_a_serial_port_carries_the_same_update(make_hub_firmware):
    text = world_text(load_hand("rig4"), WorldSettings())
    with VirtualWorld(text, "pty") as world:
        world.run(0.3)
        link = VirtualSerialLink(world)
        assert attempt(link, make_hub_firmware()).after == (1, 2, 3)
        link.close()


def test_a_link_in_real_time_is_shared_by_frames_and_packets(make_hub_firmware):
    link = EmulatorLink(world_text(load_hand("rig4"), WorldSettings(usb_latency_ms=1.0)))
    try:
        target = HubTarget(link)
        outcome = run(target.wire, update_target(target, make_hub_firmware(size=200), lambda progress: None))
    finally:
        link.close()
    assert (outcome.after, target.boards) == ((1, 2, 3), BOARDS)
