"""Blank boards get who they are, duplicates another address; who is not meant keeps everything."""

from __future__ import annotations

import pytest

from taxel_tools.errors import BoardError, PlanError
from taxel_tools.interleave import run, run_all
from taxel_tools.plan import Entry, read_plan
from taxel_tools.program import update
from taxel_tools.provision import apply, changes_of, find, gather, open_bootloaders, release
from taxel_tools.scan import scan
from taxel_tools.session import BootSession

BLANK = 0x77


def boards_of(wire):
    return {one.address: one for one in scan(wire)}


def give_address(wire, old: int, new: int) -> None:
    session = BootSession(old, wire.now_s)

    def steps():
        yield from session.enter()
        info = yield from session.info()
        configuration = yield from session.configuration()
        yield from session.write_configuration(info.unique_id, configuration | {"address": new})
        yield from session.exit()

    run(wire, steps())
    wire.collect(0.1)


def test_one_blank_board_gets_everything_and_keeps_it_through_an_update(worlds, open_wire, make_firmware):
    world = worlds("blank 0x50", boards=2)
    wire = open_wire(world)
    candidates = find(wire)
    changes = changes_of(candidates, [Entry(None, 0x30, 9, "FT-0007", (16, 17))], wire.scan())
    apply(wire, changes)
    firmware = make_firmware()
    results = run_all(wire, {0x30: update(0x30, firmware, wire.now_s, lambda progress: None)})
    assert results[0x30].after == (1, 2, 3)
    one = boards_of(wire)[0x30]
    assert (one.runs, one.kind, one.unique_id) == ("application", 9, candidates[0].unique_id.hex())
    session = BootSession(0x30, wire.now_s)
    run(wire, session.enter())
    configuration = run(wire, session.configuration())
    assert configuration["serial_number"] == b"FT-0007".ljust(16, b"\0")
    assert configuration["idac_codes"] == bytes([16, 17]).ljust(16, b"\0")


def test_an_image_whose_tries_went_by_while_the_board_was_blank_is_tried_again(worlds, open_wire, make_firmware):
    world = worlds("blank 0x50", boards=2)
    wire = open_wire(world)
    image = make_firmware().images[0]
    session = BootSession(BLANK, wire.now_s)

    def steps():
        yield from session.enter_here()
        first, _ = yield from session.free_rows()
        for place, row in enumerate(image.rows()):
            yield from session.write_row(first + place, row)
        assert (yield from session.verify_application())
        yield from session.exit()

    run(wire, steps())
    for _ in range(4):
        world.inject("unplug", 0x50)
        wire.collect(0.05)
        world.inject("plug", 0x50)
        wire.collect(0.3)
    candidates = find(wire)
    assert run(wire, session.info()).tries[0] == 0
    apply(wire, changes_of(candidates, [Entry(None, 0x30, 9)], wire.scan()))
    wire.collect(1.0)
    assert boards_of(wire)[0x30].runs == "application"


@pytest.mark.parametrize("count", [2, 4])
def test_blank_boards_are_told_apart(worlds, open_wire, count):
    world = worlds(*(f"blank 0x{0x50 + place:02X}" for place in range(count)))
    wire = open_wire(world)
    candidates = find(wire)
    assert len(candidates) == count
    entries = [Entry(c.unique_id, 0x20 + place, 1 + place, f"S{place}") for place, c in enumerate(candidates)]
    apply(wire, changes_of(candidates, entries, wire.scan()))
    found = boards_of(wire)
    assert BLANK not in found
    assert {(0x20 + place, c.unique_id.hex()) for place, c in enumerate(candidates)} <= {
        (one.address, one.unique_id) for one in found.values()
    }


def test_17_blank_boards_at_one_address_are_told_apart(worlds, adapter):
    world = worlds(*(f"blank 0x{address:02X}" for address in range(0x20, 0x31)), hand="allegro")
    wire = adapter(world)
    candidates = find(wire)
    assert len(candidates) == 17
    entries = [Entry(c.unique_id, 0x20 + place, 1) for place, c in enumerate(candidates)]
    apply(wire, changes_of(candidates, entries, wire.scan()))
    assert {one.address: one.unique_id for one in scan(wire)} == {
        0x20 + place: c.unique_id.hex() for place, c in enumerate(candidates)
    }


def test_boards_that_are_not_meant_stay_blank_and_listen_again(worlds, open_wire):
    wire = open_wire(worlds("blank 0x50", "blank 0x51", "blank 0x52"))
    candidates = find(wire)
    apply(wire, changes_of(candidates, [Entry(candidates[1].unique_id, 0x30, 1)], wire.scan()))
    assert [c.unique_id for c in find(wire)] == [candidates[0].unique_id, candidates[2].unique_id]


def test_a_plan_that_was_cut_off_is_carried_out_by_running_it_again(worlds, open_wire):
    wire = open_wire(worlds("blank 0x50", "blank 0x51", "blank 0x52"))
    entries = [Entry(c.unique_id, 0x20 + place, 1) for place, c in enumerate(gather(wire, [BLANK], []))]
    apply(wire, changes_of(gather(wire, [BLANK], entries), entries, wire.scan())[:2])  # the third was not reached
    in_use = wire.scan()
    candidates = gather(wire, [BLANK], entries)
    assert sorted(c.address for c in candidates) == [0x20, 0x21, BLANK]
    apply(wire, changes_of(candidates, entries, in_use))
    assert [c.address for c in gather(wire, [BLANK], entries)] == [0x20, 0x21, 0x22], "all have moved already"


def test_who_answers_at_a_new_address_but_is_not_meant_is_let_go_again(worlds, open_wire):
    wire = open_wire(worlds())
    with pytest.raises(BoardError, match="board 0x77: nobody answers there"):
        gather(wire, [BLANK], [Entry(bytes(8), 0x51)])
    wire.collect(0.2)
    assert boards_of(wire)[0x51].runs == "application"


def test_duplicates_get_addresses_of_their_own(worlds, open_wire):
    wire = open_wire(worlds())
    give_address(wire, 0x51, 0x50)
    open_bootloaders(wire, 0x50)
    candidates = find(wire, 0x50)
    assert [c.configuration["kind"] for c in candidates] in ([9, 10], [10, 9])
    moved = next(c for c in candidates if c.configuration["kind"] == 10)
    changes = changes_of(candidates, [Entry(moved.unique_id, 0x55)], wire.scan())
    apply(wire, changes)
    release(wire, [c for c in candidates if c is not moved])
    wire.collect(0.1)
    found = boards_of(wire)
    assert {(one.address, one.runs, one.kind) for one in found.values()} == {
        (0x50, "application", 9),
        (0x55, "application", 10),
        (0x52, "application", 11),
        (0x53, "application", 12),
    }


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        (Entry(None, 0x51, 1), "board 0x51: is in use already"),
        (Entry(bytes(8), 0x30, 1), "board 0x77: no board with id 0000000000000000 answers there; found "),
        (Entry(None, None, 1), "is blank; give it an address"),
    ],
)
def test_what_cannot_be_given_is_refused_before_anything_is_written(worlds, adapter, entry, words):
    world = worlds("blank 0x50")
    wire = adapter(world)
    before = world.board_flash(0x50).data
    with pytest.raises(BoardError) as error:
        changes_of(find(wire), [entry], wire.scan())
    assert words in str(error.value)
    assert world.board_flash(0x50).data == before


def test_several_boards_need_a_name(worlds, adapter):
    wire = adapter(worlds("blank 0x50", "blank 0x51"))
    with pytest.raises(BoardError, match=r"2 boards answer .*; name one by --id"):
        changes_of(find(wire), [Entry(None, 0x30, 1)], wire.scan())


def test_two_boards_cannot_get_one_address(worlds, adapter):
    wire = adapter(worlds("blank 0x50", "blank 0x51"))
    candidates = find(wire)
    with pytest.raises(BoardError, match="0x30: is in use already"):
        changes_of(candidates, [Entry(c.unique_id, 0x30, 1) for c in candidates], wire.scan())


def test_nobody_there_is_one_line(worlds, adapter):
    wire = adapter(worlds())
    assert find(wire) == []
    with pytest.raises(BoardError, match="board 0x77: nobody answers there"):
        changes_of([], [Entry(None, 0x30, 1)], wire.scan())


PLAN = """taxel_provisioning = 1
[[board]]
unique_id = "0011223344556677"
address = 0x21
kind = 1
serial_number = "FT-0007"
idac_codes = [16, 17]
"""


def test_a_plan_is_read(tmp_path):
    (tmp_path / "p.toml").write_text(PLAN)
    assert read_plan(tmp_path / "p.toml") == [Entry(bytes.fromhex("0011223344556677"), 0x21, 1, "FT-0007", (16, 17))]


@pytest.mark.parametrize(
    ("old", "new", "words"),
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
        ("kind = 1", "kind =", "file: expected TOML"),
        ("[[board]]", '[[board]]\nunique_id = "0011223344556677"\n[[board]]', "board[1].unique_id: expected each once"),
    ],
)
def test_a_plan_that_cannot_be_used_is_refused_with_one_line(tmp_path, old, new, words):
    (tmp_path / "p.toml").write_text(PLAN.replace(old, new))
    with pytest.raises(PlanError) as error:
        read_plan(tmp_path / "p.toml")
    assert words in str(error.value)
    assert "\n" not in str(error.value)
