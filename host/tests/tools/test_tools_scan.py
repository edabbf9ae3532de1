"""`taxel scan`: devices listed by a bus scan."""

from taxel_tools.scan import scan_bus
from taxel_tools.scheduler import run
from taxel_tools.session import BootSession


def test_running_boards_are_listed_with_version_kind_id_and_health(worlds, open_wire):
    devices = scan_bus(open_wire(worlds("firmware 0x51 3 4 5")))
    assert [(device.address, device.runs, device.version) for device in devices] == [
        (0x50, "application", "0.1.0"),
        (0x51, "application", "3.4.5"),
        (0x52, "application", "0.1.0"),
        (0x53, "application", "0.1.0"),
    ]
    assert len({device.unique_id for device in devices}) == 4
    assert all(device.notes == () and device.counters["scans"] > 0 and device.taxels for device in devices)


def test_all_17_boards_of_the_hand_are_listed(worlds, open_wire):
    assert len(scan_bus(open_wire(worlds(hand="allegro")))) == 17


def test_a_blank_board_is_listed_as_a_bootloader(worlds, open_wire):
    devices = {device.address: device for device in scan_bus(open_wire(worlds("blank 0x50")))}
    assert devices[0x77].runs == "bootloader"
    assert devices[0x77].notes == ("no startable image; flash the board", "no configuration; provision the board")
    assert len(devices[0x77].unique_id) == 16


def test_blank_boards_at_one_address_are_reported_as_shared(worlds, open_wire):
    devices = {device.address: device for device in scan_bus(open_wire(worlds("blank 0x50", "blank 0x51")))}
    assert (devices[0x77].runs, devices[0x77].unique_id) == ("shared", "")


def test_running_boards_at_one_address_are_reported_as_shared(worlds, open_wire):
    world = worlds()
    wire = open_wire(world)
    change_address(wire, 0x51, 0x50)
    devices = {device.address: device for device in scan_bus(wire)}
    assert devices[0x50].runs == "shared"
    assert 0x51 not in devices


def test_a_board_in_its_bootloader_is_listed_with_the_reason(worlds, open_wire):
    world = worlds()
    wire = open_wire(world)
    run(wire, BootSession(0x50, wire.now_s).enter())
    devices = {device.address: device for device in scan_bus(wire)}
    assert (devices[0x50].runs, devices[0x50].notes) == ("bootloader", ("entered on request of the application",))
    assert devices[0x50].kind == 9


def test_a_brown_out_is_reported(worlds, open_wire):
    world = worlds()
    world.inject("restart", 0x52)
    world.run(0.3)
    devices = {device.address: device for device in scan_bus(open_wire(world))}
    assert devices[0x52].notes == ("last start after a brown-out",)


def change_address(wire, old: int, new: int) -> None:
    """Assign a new address to a board, although another board uses it already."""
    session = BootSession(old, wire.now_s)

    def procedure():
        yield from session.enter()
        info = yield from session.read_info()
        configuration = yield from session.read_configuration()
        yield from session.write_configuration(info.unique_id, configuration | {"address": new})
        yield from session.exit()

    run(wire, procedure())
    wire.collect(0.1)


def test_the_last_fault_of_a_board_is_a_note(worlds, open_wire):
    world = worlds()
    world.inject("hard_fault", 0x50, 0x1A2C, 0x1B47)
    world.inject("miss_conversion", 0x51)
    world.run(2.0)
    notes = {device.address: device.notes for device in scan_bus(open_wire(world))}
    assert notes[0x50] == ("last start after a watchdog", "HardFault at PC 0x00001A2C, LR 0x00001B47")
    assert notes[0x51] == ("last start after a watchdog", "stopped scanning and was reset by its watchdog")
    assert notes[0x52] == ()
