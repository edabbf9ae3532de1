"""Configuration of blank boards and of boards with duplicate addresses; other boards stay unchanged."""

import pytest

from taxel_tools.errors import BoardError, PlanError
from taxel_tools.firmware_update import update_board
from taxel_tools.provision import (
    collect_boards,
    enter_bootloaders,
    find_boards,
    plan_changes,
    release_boards,
    write_changes,
)
from taxel_tools.provisioning_plan import Entry, read_plan
from taxel_tools.scan import scan_bus
from taxel_tools.scheduler import run, run_all
from taxel_tools.session import BootSession

BLANK = 0x77


def list_devices_by_address(wire):
    return {device.address: device for device in scan_bus(wire)}


def change_address(wire, old: int, new: int) -> None:
    """Assign a new address to the board at an address, which another board may use already."""
    session = BootSession(old, wire.now_s)

    def procedure():
        yield from session.enter()
        info = yield from session.read_info()
        configuration = yield from session.read_configuration()
        yield from session.write_configuration(info.unique_id, configuration | {"address": new})
        yield from session.exit()

    run(wire, procedure())
    wire.collect(0.1)


def test_the_configuration_of_a_blank_board_survives_an_update(worlds, open_wire, make_firmware):
    world = worlds("blank 0x50", boards=2)
    wire = open_wire(world)
    candidates = find_boards(wire)
    changes = plan_changes(candidates, [Entry(None, 0x30, 9, "FT-0007", (16, 17))], wire.scan())
    write_changes(wire, changes)
    firmware = make_firmware()
    results = run_all(wire, {0x30: update_board(0x30, firmware, wire.now_s, lambda progress: None)})
    assert results[0x30].after == (1, 2, 3)
    board = list_devices_by_address(wire)[0x30]
    assert (board.runs, board.kind, board.unique_id) == ("application", 9, candidates[0].unique_id.hex())
    session = BootSession(0x30, wire.now_s)
    run(wire, session.enter())
    configuration = run(wire, session.read_configuration())
    assert configuration["serial_number"] == b"FT-0007".ljust(16, b"\0")
    assert configuration["idac_codes"] == bytes([16, 17]).ljust(16, b"\0")


def test_provisioning_restores_the_boot_attempts_used_by_a_blank_board(worlds, open_wire, make_firmware):
    world = worlds("blank 0x50", boards=2)
    wire = open_wire(world)
    image = make_firmware().images[0]
    session = BootSession(BLANK, wire.now_s)

    def procedure():
        yield from session.start_session()
        first_row, _ = yield from session.read_free_rows()
        for i, row in enumerate(image.rows()):
            yield from session.write_row(first_row + i, row)
        assert (yield from session.verify_application())
        yield from session.exit()

    run(wire, procedure())
    for _ in range(4):  # each of the first three starts of the unconfirmed image uses one boot attempt
        world.inject("unplug", 0x50)
        wire.collect(0.05)
        world.inject("plug", 0x50)
        wire.collect(0.3)
    candidates = find_boards(wire)
    assert run(wire, session.read_info()).tries[0] == 0
    write_changes(wire, plan_changes(candidates, [Entry(None, 0x30, 9)], wire.scan()))
    wire.collect(1.0)
    assert list_devices_by_address(wire)[0x30].runs == "application"


@pytest.mark.parametrize("count", [2, 4])
def test_blank_boards_at_one_address_are_distinguished(worlds, open_wire, count):
    world = worlds(*(f"blank 0x{0x50 + i:02X}" for i in range(count)))
    wire = open_wire(world)
    candidates = find_boards(wire)
    assert len(candidates) == count
    entries = [Entry(c.unique_id, 0x20 + i, 1 + i, f"S{i}") for i, c in enumerate(candidates)]
    write_changes(wire, plan_changes(candidates, entries, wire.scan()))
    devices = list_devices_by_address(wire)
    assert BLANK not in devices
    assert {(0x20 + i, c.unique_id.hex()) for i, c in enumerate(candidates)} <= {
        (device.address, device.unique_id) for device in devices.values()
    }


def test_17_blank_boards_at_one_address_are_distinguished(worlds, adapter):
    world = worlds(*(f"blank 0x{address:02X}" for address in range(0x20, 0x31)), hand="allegro")
    wire = adapter(world)
    candidates = find_boards(wire)
    assert len(candidates) == 17
    entries = [Entry(c.unique_id, 0x20 + i, 1) for i, c in enumerate(candidates)]
    write_changes(wire, plan_changes(candidates, entries, wire.scan()))
    assert {device.address: device.unique_id for device in scan_bus(wire)} == {
        0x20 + i: c.unique_id.hex() for i, c in enumerate(candidates)
    }


def test_boards_without_an_entry_stay_blank_and_listen_again(worlds, open_wire):
    wire = open_wire(worlds("blank 0x50", "blank 0x51", "blank 0x52"))
    candidates = find_boards(wire)
    write_changes(wire, plan_changes(candidates, [Entry(candidates[1].unique_id, 0x30, 1)], wire.scan()))
    assert [c.unique_id for c in find_boards(wire)] == [candidates[0].unique_id, candidates[2].unique_id]


def test_an_interrupted_plan_is_completed_by_running_it_again(worlds, open_wire):
    wire = open_wire(worlds("blank 0x50", "blank 0x51", "blank 0x52"))
    entries = [Entry(c.unique_id, 0x20 + i, 1) for i, c in enumerate(collect_boards(wire, [BLANK], []))]
    write_changes(
        wire, plan_changes(collect_boards(wire, [BLANK], entries), entries, wire.scan())[:2]
    )  # The third board was not reached.
    in_use = wire.scan()
    candidates = collect_boards(wire, [BLANK], entries)
    assert sorted(c.address for c in candidates) == [0x20, 0x21, BLANK]
    write_changes(wire, plan_changes(candidates, entries, in_use))
    assert [c.address for c in collect_boards(wire, [BLANK], entries)] == [0x20, 0x21, 0x22], (
        "every board has its new address"
    )


def test_a_different_board_at_the_new_address_is_restarted_unchanged(worlds, open_wire):
    wire = open_wire(worlds())
    with pytest.raises(BoardError, match="board 0x77: no board answers at this address"):
        collect_boards(wire, [BLANK], [Entry(bytes(8), 0x51)])
    wire.collect(0.2)
    assert list_devices_by_address(wire)[0x51].runs == "application"


def test_boards_with_a_duplicate_address_get_different_addresses(worlds, open_wire):
    wire = open_wire(worlds())
    change_address(wire, 0x51, 0x50)
    enter_bootloaders(wire, 0x50)
    candidates = find_boards(wire, 0x50)
    assert [c.configuration["kind"] for c in candidates] in ([9, 10], [10, 9])
    board_to_move = next(c for c in candidates if c.configuration["kind"] == 10)
    changes = plan_changes(candidates, [Entry(board_to_move.unique_id, 0x55)], wire.scan())
    write_changes(wire, changes)
    release_boards(wire, [c for c in candidates if c is not board_to_move])
    wire.collect(0.1)
    devices = list_devices_by_address(wire)
    assert {(device.address, device.runs, device.kind) for device in devices.values()} == {
        (0x50, "application", 9),
        (0x55, "application", 10),
        (0x52, "application", 11),
        (0x53, "application", 12),
    }


@pytest.mark.parametrize(
    ("entry", "expected_text"),
    [
        (Entry(None, 0x51, 1), "board 0x51: the address is in use already"),
        (Entry(bytes(8), 0x30, 1), "board 0x77: expected the board with id 0000000000000000, found "),
        (Entry(None, None, 1), "is blank; assign an address"),
    ],
)
def test_invalid_entries_are_refused_before_any_write(worlds, adapter, entry, expected_text):
    world = worlds("blank 0x50")
    wire = adapter(world)
    flash_content = world.read_flash(0x50).data
    with pytest.raises(BoardError) as error:
        plan_changes(find_boards(wire), [entry], wire.scan())
    assert expected_text in str(error.value)
    assert world.read_flash(0x50).data == flash_content


def test_several_boards_require_a_unique_id(worlds, adapter):
    wire = adapter(worlds("blank 0x50", "blank 0x51"))
    with pytest.raises(BoardError, match=r"2 boards answer .*; select one with --id"):
        plan_changes(find_boards(wire), [Entry(None, 0x30, 1)], wire.scan())


def test_two_boards_cannot_get_the_same_address(worlds, adapter):
    wire = adapter(worlds("blank 0x50", "blank 0x51"))
    candidates = find_boards(wire)
    with pytest.raises(BoardError, match="0x30: the address is in use already"):
        plan_changes(candidates, [Entry(c.unique_id, 0x30, 1) for c in candidates], wire.scan())


def test_a_bus_without_boards_gives_one_error_line(worlds, adapter):
    wire = adapter(worlds())
    assert find_boards(wire) == []
    with pytest.raises(BoardError, match="board 0x77: no board answers at this address"):
        plan_changes([], [Entry(None, 0x30, 1)], wire.scan())


PLAN = """taxel_provisioning = 1
[[board]]
unique_id = "0011223344556677"
address = 0x21
kind = 1
serial_number = "FT-0007"
idac_codes = [16, 17]
"""


def test_a_valid_plan_is_read(tmp_path):
    (tmp_path / "p.toml").write_text(PLAN)
    assert read_plan(tmp_path / "p.toml") == [Entry(bytes.fromhex("0011223344556677"), 0x21, 1, "FT-0007", (16, 17))]


@pytest.mark.parametrize(
    ("old", "new", "expected_text"),
    [
        ("taxel_provisioning = 1", "", "taxel_provisioning: expected 1, found None"),
        ("[[board]]", "[[bored]]", "board: expected one table or more, found none"),
        ('"0011223344556677"', '"0011"', "board[0].unique_id: expected 16 hexadecimal digits, found '0011'"),
        ("0x21", "0x77", "board[0].address: expected 0x08 to 0x76, found 119"),
        ("kind = 1", "kind = 300", "board[0].kind: expected 0 to 255, found 300"),
        ("FT-0007", "F" * 17, "board[0].serial_number: expected at most 16 characters"),
        ("FT-0007", "Größe", "board[0].serial_number: expected printable ASCII"),
        ("[16, 17]", "[256]", "board[0].idac_codes: expected at most 16 numbers from 0 to 255"),
        ("[16, 17]", '"16"', "board[0].idac_codes: expected at most 16 numbers"),
        ("kind = 1", "colour = 1", "board[0].colour: expected one of "),
        ("kind = 1", "kind =", "line 5, column 7: expected valid TOML"),
        (
            "[[board]]",
            '[[board]]\nunique_id = "0011223344556677"\n[[board]]',
            "board[1].unique_id: expected a value used once",
        ),
    ],
)
def test_an_invalid_plan_is_refused_with_one_error_line(tmp_path, old, new, expected_text):
    (tmp_path / "p.toml").write_text(PLAN.replace(old, new))
    with pytest.raises(PlanError) as error:
        read_plan(tmp_path / "p.toml")
    assert expected_text in str(error.value)
    assert "\n" not in str(error.value)
