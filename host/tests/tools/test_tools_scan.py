"""What a scan says of a bus."""

from __future__ import annotations

from taxel_tools.interleave import run
from taxel_tools.scan import scan
from taxel_tools.session import BootSession


def test_running_boards_are_listed_with_version_kind_id_and_health(worlds, open_wire):
    found = scan(open_wire(worlds("firmware 0x51 3 4 5")))
    assert [(one.address, one.runs, one.version) for one in found] == [
        (0x50, "application", "0.1.0"),
        (0x51, "application", "3.4.5"),
        (0x52, "application", "0.1.0"),
        (0x53, "application", "0.1.0"),
    ]
    assert len({one.unique_id for one in found}) == 4
    assert all(one.notes == () and one.counters["scans"] > 0 and one.taxels for one in found)


def test_all_17_boards_of_the_hand_are_found(worlds, open_wire):
    assert len(scan(open_wire(worlds(hand="allegro")))) == 17


def test_a_blank_board_is_found_in_its_bootloader(worlds, open_wire):
    found = {one.address: one for one in scan(open_wire(worlds("blank 0x50")))}
    assert found[0x77].runs == "bootloader"
    assert found[0x77].notes == ("no image that can start: flash it", "no configuration: provision it")
    assert len(found[0x77].unique_id) == 16


def test_blank_boards_that_share_an_address_are_told_to_be_several(worlds, open_wire):
    found = {one.address: one for one in scan(open_wire(worlds("blank 0x50", "blank 0x51")))}
    assert (found[0x77].runs, found[0x77].unique_id) == ("shared", "")


def test_running_boards_that_share_an_address_are_told_to_be_several(worlds, open_wire):
    world = worlds()
    wire = open_wire(world)
    give_address(wire, 0x51, 0x50)
    found = {one.address: one for one in scan(wire)}
    assert found[0x50].runs == "shared"
    assert 0x51 not in found


def test_a_board_held_in_its_bootloader_says_why(worlds, open_wire):
    world = worlds()
    wire = open_wire(world)
    run(wire, BootSession(0x50, wire.now_s).enter())
    found = {one.address: one for one in scan(wire)}
    assert (found[0x50].runs, found[0x50].notes) == ("bootloader", ("asked for by the application",))
    assert found[0x50].kind == 9


def test_a_board_that_browned_out_says_so(worlds, open_wire):
    world = worlds()
    world.inject("restart", 0x52)
    world.run(0.3)
    found = {one.address: one for one in scan(open_wire(world))}
    assert found[0x52].notes == ("last start after a brown-out",)


def give_address(wire, old: int, new: int) -> None:
    """Configure a board onto an address that another one has, as a careless host would."""
    session = BootSession(old, wire.now_s)

    def steps():
        yield from session.enter()
        info = yield from session.info()
        configuration = yield from session.configuration()
        yield from session.write_configuration(info.unique_id, configuration | {"address": new})
        yield from session.exit()

    run(wire, steps())
    wire.collect(0.1)
