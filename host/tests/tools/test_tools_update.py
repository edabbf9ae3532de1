"""Updates of emulated boards, over the hub and over an adapter: written, read back, started and confirmed."""

import pytest

from taxel.errors import TaxelError
from taxel_protocol import bootloader
from taxel_protocol.bootloader import BootDevice
from taxel_tools.application import get_firmware_version, read_identity
from taxel_tools.errors import BoardError
from taxel_tools.files import Firmware
from taxel_tools.firmware_update import update_board
from taxel_tools.scheduler import run, run_all
from taxel_tools.session import BootSession

FIRST, KIND = 0x50, 9
BOARDS = (0x50, 0x51, 0x52, 0x53)
HANG = bytes(8) + b"HANG"


def ignore_progress(progress) -> None:
    pass


def read_versions(wire, addresses=BOARDS):
    identities = run_all(wire, {address: read_identity(address) for address in addresses})
    return {address: get_firmware_version(identity) for address, identity in identities.items()}


def update_all(wire, firmware, addresses=BOARDS, report=ignore_progress, **options):
    """Update boards concurrently; return their outcomes or errors by address. options: of `update_board`."""
    return run_all(
        wire, {address: update_board(address, firmware, wire.now_s, report, **options) for address in addresses}
    )


def test_boards_receive_the_image_of_their_free_slot_and_confirm_it(worlds, open_wire, make_firmware):
    world = worlds()
    wire = open_wire(world)
    results = update_all(wire, make_firmware())
    assert {r.slot for r in results.values()} == {1}
    # The image has 1,000 bytes, the default of `make_firmware`: 8 rows of 128 bytes.
    assert {(r.before, r.after, r.rows_written, r.rows_kept) for r in results.values()} == {
        ((0, 1, 0), (1, 2, 3), 8, 0)
    }
    assert read_versions(wire) == dict.fromkeys(BOARDS, (1, 2, 3))
    assert all(world.read_flash(address).runs == "application" for address in BOARDS)


def test_the_next_update_is_written_to_the_other_slot(worlds, open_wire, make_firmware):
    wire = open_wire(worlds(boards=1))
    assert update_all(wire, make_firmware(), [FIRST])[FIRST].slot == 1
    assert update_all(wire, make_firmware(version=(2, 0, 0)), [FIRST])[FIRST].slot == 0
    assert read_versions(wire, [FIRST]) == {FIRST: (2, 0, 0)}


def test_the_flash_contains_the_bytes_of_the_file(worlds, adapter, make_firmware):
    world = worlds(boards=1)
    firmware = make_firmware(size=12288)
    update_all(adapter(world), firmware, [FIRST])
    # Slot B, with the number 1, begins at row 142; 12,288 bytes are 96 rows of 128 bytes.
    assert world.read_flash(FIRST).data[142 * 128 : 238 * 128] == firmware.select_image_for(1).data


def test_a_board_that_runs_the_image_already_is_not_written_unless_forced(worlds, adapter, make_firmware):
    world = worlds(boards=1)
    wire = adapter(world)
    update_all(wire, make_firmware(), [FIRST])
    wear = world.read_flash(FIRST).wear.copy()
    second_result = update_all(wire, make_firmware(), [FIRST])[FIRST]
    assert (second_result.is_written, second_result.rows_written) == (False, 0)
    assert (world.read_flash(FIRST).wear == wear).all()
    assert update_all(wire, make_firmware(), [FIRST], force=True)[FIRST].slot == 0


def test_an_interrupted_update_continues_at_the_first_missing_row(worlds, adapter, make_firmware):
    world = worlds(boards=1)
    wire = adapter(world)
    firmware = make_firmware(size=4096)

    def stop(progress) -> None:
        if progress.stage == "writing" and progress.done == 20:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        update_all(wire, firmware, [FIRST], stop)
    wear = world.read_flash(FIRST).wear[142:162].copy()  # the 20 written rows of slot B, which begins at row 142
    result = update_all(wire, firmware, [FIRST])[FIRST]
    assert (result.rows_kept, result.rows_written) == (20, 12)  # 4,096 bytes are 32 rows
    assert (world.read_flash(FIRST).wear[142:162] == wear).all()


def test_rows_with_an_accidentally_correct_sum_are_rewritten_after_a_wrong_crc(worlds, adapter, make_image):
    """Two swapped bytes of a row do not change its 8-bit sum; the CRC-32 of the image detects them."""
    world = worlds(boards=1)
    wire = adapter(world)
    image = make_image(1)
    swapped = bytearray(image.data)
    swapped[200], swapped[201] = swapped[201], swapped[200]
    session = BootSession(FIRST, wire.now_s)

    def write_damaged_image():
        yield from session.enter()
        padded = bytes(swapped) + bytes(24)  # an image of 1,000 bytes in 8 rows of 128 bytes, from row 142 on
        for i in range(8):
            yield from session.write_row(142 + i, padded[128 * i : 128 * i + 128])
        yield from session.exit()

    run(wire, write_damaged_image())
    world.run(0.2)
    result = update_all(wire, Firmware((image,)), [FIRST])[FIRST]
    assert result.rows_written == 8
    assert read_versions(wire, [FIRST]) == {FIRST: (1, 2, 3)}


def test_every_stage_and_every_row_is_reported_as_progress(worlds, adapter, make_firmware):
    reported = []
    update_all(adapter(worlds(boards=1)), make_firmware(), [FIRST], reported.append)
    assert list(dict.fromkeys(progress.stage for progress in reported)) == [
        "entering",
        "writing",
        "starting",
        "confirming",
        "done",
    ]
    # The image of 1,000 bytes, the default of `make_firmware`, has 8 rows of 128 bytes.
    assert [progress.done for progress in reported if progress.stage == "writing"] == list(range(8))


@pytest.mark.parametrize(
    ("options", "expected_text"),
    [
        (
            {"kind": KIND + 1},
            f"board 0x50: the board is of kind {KIND}, but slot-a.bin and slot-b.bin is for kind {KIND + 1}",
        ),
        (
            {"device": BootDevice.HUB},
            "board 0x50: the device is a sensor board with 32 KiB of flash, but slot-a.bin and slot-b.bin is",
        ),
    ],
)
def test_a_file_for_another_device_is_refused_before_any_write(worlds, adapter, make_firmware, options, expected_text):
    world = worlds(boards=1)
    wire = adapter(world)
    before = world.read_flash(FIRST).data
    error = update_all(wire, make_firmware(**options), [FIRST])[FIRST]
    assert isinstance(error, BoardError)
    assert expected_text in str(error)
    assert world.read_flash(FIRST).data == before
    world.run(0.2)
    assert read_versions(wire, [FIRST]) == {FIRST: (0, 1, 0)}


def test_a_file_only_for_the_slot_in_use_is_refused(worlds, adapter, make_image):
    wire = adapter(worlds(boards=1))
    error = update_all(wire, Firmware((make_image(0),)), [FIRST])[FIRST]
    assert "the free slot is B, but slot-a.bin is linked only for slot A; add the file linked for B" in str(error)


def test_an_image_that_hangs_is_replaced_by_the_previous_image(worlds, open_wire, make_firmware):
    world = worlds(boards=1)
    wire = open_wire(world)
    error = update_all(wire, make_firmware(content=HANG + bytes(400)), [FIRST])[FIRST]
    assert "the new image 1.2.3 did not start, the board returned to 0.1.0" in str(error)
    assert update_all(wire, make_firmware(version=(1, 2, 4)), [FIRST])[FIRST].after == (1, 2, 4)


def test_a_missing_board_does_not_affect_the_other_updates(worlds, open_wire, make_firmware):
    wire = open_wire(worlds(boards=2))
    results = update_all(wire, make_firmware(), [0x50, 0x51, 0x52])
    assert isinstance(results[0x52], TaxelError)
    assert "board 0x52: does not acknowledge" in str(results[0x52])
    assert read_versions(wire, [0x50, 0x51]) == {0x50: (1, 2, 3), 0x51: (1, 2, 3)}


@pytest.mark.parametrize("fault", ["flip_at", "nack_at"])
@pytest.mark.parametrize("position", [1, 2, 5, 30, 62])
def test_a_damaged_packet_is_sent_again(worlds, adapter, make_firmware, fault, position):
    world = worlds(boards=1)
    wire = adapter(world)

    def disturb(progress) -> None:
        if progress.stage == "writing":
            world.inject(fault, FIRST, position, 3)  # at byte `position` of a transfer; 3: bit for flip_at

    result = update_all(wire, make_firmware(), [FIRST], disturb)[FIRST]
    assert not isinstance(result, TaxelError), result
    assert read_versions(wire, [FIRST]) == {FIRST: (1, 2, 3)}


@pytest.mark.parametrize("fault", ["up_flip", "up_drop", "down_flip", "down_drop"])
def test_updates_succeed_despite_damaged_and_lost_bytes_on_the_uart(worlds, hub, make_firmware, fault):
    world = worlds(boards=2)
    wire = hub(world)
    offsets = iter(range(1000))

    def disturb(progress) -> None:
        if progress.stage == "writing" and progress.done % 3 == 1:
            world.inject(fault, 0, 7 * next(offsets) % 60, 1)  # after 0 to 59 further bytes, each time another number

    results = update_all(wire, make_firmware(), [0x50, 0x51], disturb)
    assert {result.after for result in results.values()} == {(1, 2, 3)}


def test_the_handshake_is_repeated_after_a_hub_restart(worlds, hub, make_firmware):
    world = worlds(boards=2)
    wire = hub(world)
    restarts = iter([True])

    def disturb(progress) -> None:
        if progress.stage == "writing" and progress.done == 3 and next(restarts, False):
            world.inject("hub_restart")

    results = update_all(wire, make_firmware(), [0x50, 0x51], disturb)
    assert {result.after for result in results.values()} == {(1, 2, 3)}


def test_17_boards_of_12_kib_are_flashed_through_the_hub_within_15_s(worlds, hub, make_firmware):
    """I2C runs at 400 kHz and the UART at 1 Mbaud; the USB adapter delays replies by 16 ms.

    An image of 12 KiB has 96 rows of 128 bytes, and each board computes the sum of every row.
    """
    firmware = make_firmware(size=12288)
    world = worlds(hand="allegro", usb_latency_ms=16.0)
    wire = hub(world)
    start_s = world.now_s
    results = update_all(wire, firmware, wire.scan())
    concurrent_s = world.now_s - start_s
    assert [(r.rows_written, r.after) for r in results.values()] == [(96, (1, 2, 3))] * 17
    alone = worlds(hand="allegro", usb_latency_ms=16.0)
    single_s = update_all(hub(alone), firmware, [0x20])[0x20].seconds
    third_world = worlds(hand="allegro", usb_latency_ms=16.0)
    waiting = hub(third_world)
    waiting.hub.window = 1  # Each command waits for its reply, and no GET_TIME flushes the adapter.
    slow_s = update_all(waiting, firmware, [0x20])[0x20].seconds
    print(f"17 boards of 12 KiB through the hub: {concurrent_s:.1f} s concurrently")
    print(f"one after the other: {17 * single_s:.1f} s; with one command in flight: {17 * slow_s:.1f} s")
    assert concurrent_s < 15.0
    assert concurrent_s < 17 * single_s < 17 * slow_s


def test_the_first_rows_of_the_slots_of_a_board_are_32_and_142():
    assert bootloader.LAYOUTS[BootDevice.BOARD].first_rows == (32, 142)
