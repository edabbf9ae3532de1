"""Updates of emulated boards: written, read back, started and confirmed, over the hub and over an adapter."""

from __future__ import annotations

import pytest

from taxel.errors import TaxelError
from taxel_protocol import bootloader
from taxel_protocol.bootloader import BootDevice
from taxel_tools.application import read_identity, version_of
from taxel_tools.errors import BoardError
from taxel_tools.files import Firmware
from taxel_tools.scheduler import run, run_all
from taxel_tools.firmware_update import update
from taxel_tools.session import BootSession

FIRST, KIND = 0x50, 9
BOARDS = (0x50, 0x51, 0x52, 0x53)
HANG = bytes(8) + b"HANG"


def quiet(progress) -> None:
    pass


def versions(wire, addresses=BOARDS):
    found = run_all(wire, {address: read_identity(address) for address in addresses})
    return {address: version_of(identity) for address, identity in found.items()}


def update_all(wire, firmware, addresses=BOARDS, report=quiet, **options):
    return run_all(wire, {a: update(a, firmware, wire.now_s, report, **options) for a in addresses})


def test_boards_get_the_image_of_their_free_slot_and_confirm_it(worlds, open_wire, make_firmware):
    world = worlds()
    wire = open_wire(world)
    results = update_all(wire, make_firmware())
    assert {r.slot for r in results.values()} == {1}
    assert {(r.before, r.after, r.rows_written, r.rows_kept) for r in results.values()} == {
        ((0, 1, 0), (1, 2, 3), 8, 0)
    }
    assert versions(wire) == dict.fromkeys(BOARDS, (1, 2, 3))
    assert all(world.board_flash(address).runs == "application" for address in BOARDS)


def test_the_next_update_goes_to_the_other_slot(worlds, open_wire, make_firmware):
    wire = open_wire(worlds(boards=1))
    assert update_all(wire, make_firmware(), [FIRST])[FIRST].slot == 1
    assert update_all(wire, make_firmware(version=(2, 0, 0)), [FIRST])[FIRST].slot == 0
    assert versions(wire, [FIRST]) == {FIRST: (2, 0, 0)}


def test_what_is_in_flash_is_the_file(worlds, adapter, make_firmware):
    world = worlds(boards=1)
    firmware = make_firmware(size=12288)
    update_all(adapter(world), firmware, [FIRST])
    assert world.board_flash(FIRST).data[128 * 128 : 224 * 128] == firmware.image_for(1).data


def test_a_board_that_runs_the_image_already_is_left_alone_unless_forced(worlds, adapter, make_firmware):
    world = worlds(boards=1)
    wire = adapter(world)
    update_all(wire, make_firmware(), [FIRST])
    wear = world.board_flash(FIRST).wear.copy()
    again = update_all(wire, make_firmware(), [FIRST])[FIRST]
    assert (again.is_written, again.rows_written) == (False, 0)
    assert (world.board_flash(FIRST).wear == wear).all()
    assert update_all(wire, make_firmware(), [FIRST], force=True)[FIRST].slot == 0


def test_an_update_that_was_cut_off_goes_on_where_it_stopped(worlds, adapter, make_firmware):
    world = worlds(boards=1)
    wire = adapter(world)
    firmware = make_firmware(size=4096)
    rows = []

    def stop(progress) -> None:
        rows.append(progress.done)
        if progress.stage == "writing" and progress.done == 20:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        update_all(wire, firmware, [FIRST], stop)
    wear = world.board_flash(FIRST).wear[128:148].copy()
    result = update_all(wire, firmware, [FIRST])[FIRST]
    assert (result.rows_kept, result.rows_written) == (20, 12)
    assert (world.board_flash(FIRST).wear[128:148] == wear).all()


def test_rows_whose_sum_is_right_by_chance_are_written_when_the_whole_does_not_verify(worlds, adapter, make_image):
    """8-bit sums: two bytes of a row swapped look the same; the CRC-32 of the whole tells."""
    world = worlds(boards=1)
    wire = adapter(world)
    good = make_image(1)
    swapped = bytearray(good.data)
    swapped[200], swapped[201] = swapped[201], swapped[200]
    session = BootSession(FIRST, wire.now_s)

    def leave_damaged():
        yield from session.enter()
        padded = bytes(swapped) + bytes(24)
        for place in range(8):
            yield from session.write_row(128 + place, padded[128 * place : 128 * place + 128])
        yield from session.exit()

    run(wire, leave_damaged())
    world.run(0.2)
    result = update_all(wire, Firmware((good,)), [FIRST])[FIRST]
    assert result.rows_written == 8
    assert versions(wire, [FIRST]) == {FIRST: (1, 2, 3)}


def test_progress_tells_every_stage_and_every_row(worlds, adapter, make_firmware):
    told = []
    update_all(adapter(worlds(boards=1)), make_firmware(), [FIRST], told.append)
    assert list(dict.fromkeys(progress.stage for progress in told)) == [
        "entering",
        "writing",
        "starting",
        "confirming",
        "done",
    ]
    assert [progress.done for progress in told if progress.stage == "writing"] == list(range(8))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"kind": KIND + 1}, f"board 0x50: is of kind {KIND}, but slot-a.bin and slot-b.bin is for kind {KIND + 1}"),
        ({"device": BootDevice.HUB}, "board 0x50: is a sensor board, but slot-a.bin and slot-b.bin is for the hub"),
    ],
)
def test_the_wrong_file_is_refused_before_a_byte_is_written(worlds, adapter, make_firmware, options, words):
    world = worlds(boards=1)
    wire = adapter(world)
    before = world.board_flash(FIRST).data
    error = update_all(wire, make_firmware(**options), [FIRST])[FIRST]
    assert isinstance(error, BoardError)
    assert words in str(error)
    assert world.board_flash(FIRST).data == before
    world.run(0.2)
    assert versions(wire, [FIRST]) == {FIRST: (0, 1, 0)}


def test_a_file_for_the_slot_in_use_alone_is_refused(worlds, adapter, make_image):
    wire = adapter(worlds(boards=1))
    error = update_all(wire, Firmware((make_image(0),)), [FIRST])[FIRST]
    assert "its free slot is B, but slot-a.bin is linked for slot A only; give the file linked for B too" in str(error)


def test_an_image_that_hangs_gives_way_to_the_one_before(worlds, open_wire, make_firmware):
    world = worlds(boards=1)
    wire = open_wire(world)
    error = update_all(wire, make_firmware(content=HANG + bytes(400)), [FIRST])[FIRST]
    assert "the new image 1.2.3 did not come up, the board is back on 0.1.0" in str(error)
    assert update_all(wire, make_firmware(version=(1, 2, 4)), [FIRST])[FIRST].after == (1, 2, 4)


def test_a_board_that_is_not_there_fails_alone(worlds, open_wire, make_firmware):
    wire = open_wire(worlds(boards=2))
    results = update_all(wire, make_firmware(), [0x50, 0x51, 0x52])
    assert isinstance(results[0x52], TaxelError)
    assert "board 0x52: does not acknowledge" in str(results[0x52])
    assert versions(wire, [0x50, 0x51]) == {0x50: (1, 2, 3), 0x51: (1, 2, 3)}


@pytest.mark.parametrize("fault", ["flip_at", "nack_at"])
@pytest.mark.parametrize("position", [1, 2, 5, 30, 62])
def test_a_damaged_packet_is_sent_again(worlds, adapter, make_firmware, fault, position):
    world = worlds(boards=1)
    wire = adapter(world)

    def hurt(progress) -> None:
        if progress.stage == "writing":
            world.inject(fault, FIRST, position, 3)

    result = update_all(wire, make_firmware(), [FIRST], hurt)[FIRST]
    assert not isinstance(result, TaxelError), result
    assert versions(wire, [FIRST]) == {FIRST: (1, 2, 3)}


@pytest.mark.parametrize("fault", ["up_flip", "up_drop", "down_flip", "down_drop"])
def test_bytes_lost_on_the_uart_cost_time_and_nothing_else(worlds, hub, make_firmware, fault):
    world = worlds(boards=2)
    wire = hub(world)
    hurts = iter(range(1000))

    def hurt(progress) -> None:
        if progress.stage == "writing" and progress.done % 3 == 1:
            world.inject(fault, 0, 7 * next(hurts) % 60, 1)

    results = update_all(wire, make_firmware(), [0x50, 0x51], hurt)
    assert {result.after for result in results.values()} == {(1, 2, 3)}


def test_the_handshake_is_repeated_after_a_hub_restart(worlds, hub, make_firmware):
    world = worlds(boards=2)
    wire = hub(world)
    restarts = iter([True])

    def hurt(progress) -> None:
        if progress.stage == "writing" and progress.done == 3 and next(restarts, False):
            world.inject("hub_restart")

    results = update_all(wire, make_firmware(), [0x50, 0x51], hurt)
    assert {result.after for result in results.values()} == {(1, 2, 3)}


def test_17_boards_of_12_kib_are_flashed_through_the_hub_within_15_s(worlds, hub, make_firmware):
    """400 kHz, 1 Mbaud, an adapter that holds replies back for 16 ms; each row is summed up by its board again."""
    firmware = make_firmware(size=12288)
    world = worlds(hand="allegro", usb_latency_ms=16.0)
    wire = hub(world)
    began = world.now_s
    results = update_all(wire, firmware, wire.scan())
    interleaved = world.now_s - began
    assert [(r.rows_written, r.after) for r in results.values()] == [(96, (1, 2, 3))] * 17
    alone = worlds(hand="allegro", usb_latency_ms=16.0)
    one = update_all(hub(alone), firmware, [0x20])[0x20].seconds
    plain = worlds(hand="allegro", usb_latency_ms=16.0)
    waiting = hub(plain)
    waiting.hub.window = 1  # each command waits for its reply, and nothing pushes that out of the adapter
    slow = update_all(waiting, firmware, [0x20])[0x20].seconds
    print(
        f"17 boards of 12 KiB through the hub: {interleaved:.1f} s interleaved, {17 * one:.1f} s one after the other, "
    )
    print(f"{17 * slow:.1f} s one after the other and with one command under way at a time")
    assert interleaved < 15.0
    assert interleaved < 17 * one < 17 * slow


def test_the_rows_of_a_slot_are_known_to_the_protocol():
    assert bootloader.LAYOUTS[BootDevice.BOARD].first_rows == (32, 128)
