"""Power cuts during an update of a board and during its repetition: the old or the new image always runs."""

import random

import pytest

from taxel.errors import TaxelError
from taxel.link.virtual import FaultError, VirtualSMBus
from taxel_tools.application import get_firmware_version, wait_for_application
from taxel_tools.firmware_update import update_board
from taxel_tools.scheduler import run, run_all
from taxel_tools.wires import SmbusWire

BOARD = 0x50
OLD, NEW = (0, 1, 0), (1, 2, 3)
WRITE_S, OFF_S = 0.02, 0.03
FRACTIONS = (-0.02, 0.02, 0.5, 0.98)
"""Cut times as fractions of a row write: before the write, near its ends, in its middle."""
STEP_S = 0.0005


def try_update(wire, firmware):
    """Update the board, and return the outcome or the `TaxelError`."""
    return run_all(wire, {BOARD: update_board(BOARD, firmware, wire.now_s, lambda progress: None)})[BOARD]


def read_version(wire):
    """Read the version of the running application, which must start within 6 s."""
    identity = run(wire, wait_for_application(BOARD, wire.now_s, 6.0))
    assert identity is not None, "bricked"
    return get_firmware_version(identity)


def connect_with_observer(world, observe):
    """Connect an adapter that calls `observe` every half millisecond while it waits."""

    def wait(seconds: float) -> None:
        """Advance the virtual time in steps, with a call of `observe` after each."""
        end = world.now_s + seconds
        while (remaining_s := end - world.now_s) > 1e-9:
            world.run(min(remaining_s, STEP_S))
            observe()

    return SmbusWire(VirtualSMBus(world), "virtual", lambda: world.now_s, wait)


def measure_write_times(world, firmware) -> list[float]:
    """Measure the start time of each flash operation of an update, with a resolution of 0.5 ms."""
    times, last_count = [], [int(world.read_flash(BOARD).wear.sum())]

    def observe() -> None:
        """Add the start time of each flash operation since the last call, according to the wear of the flash."""
        count = int(world.read_flash(BOARD).wear.sum())
        times.extend([world.now_s - STEP_S] * (count - last_count[0]))
        last_count[0] = count

    assert not isinstance(try_update(connect_with_observer(world, observe), firmware), TaxelError)
    return times


@pytest.mark.parametrize("boot_listens", [0, 1])
def test_power_cuts_leave_the_old_or_the_new_image_and_the_update_can_be_repeated(
    worlds, adapter, make_firmware, boot_listens
):
    """Each world has two power cuts: one at a given place of a write, and one at a random time of the repeated update.

    Three of the four `FRACTIONS` lie within a write. The first cuts, half of all cuts, thus tear a row in about 3/8 of
    all cuts; the test requires a third.
    """
    seed = 40
    print(f"seed {seed}")
    generator = random.Random(seed)
    firmware = make_firmware(size=384)
    times = measure_write_times(worlds(f"boot_listens {boot_listens}", boards=1), firmware)
    assert len(times) == 3 + 1 + 1 + 1, "three rows, and the records: pending, one boot attempt, confirmed"
    cut_count = torn_rows = failed_updates = 0
    for first_cut_s in [time + WRITE_S * fraction for time in times for fraction in FRACTIONS]:
        for span_s in (0.15, 0.4, 0.8):
            second_cut_s = first_cut_s + OFF_S + generator.uniform(span_s / 3.0, span_s)
            lines = [
                f"fault {time!r} {name} {BOARD}"
                for cut_s in (first_cut_s, second_cut_s)
                for time, name in ((cut_s, "unplug"), (cut_s + OFF_S, "plug"))
            ]
            world = worlds(*lines, f"boot_listens {boot_listens}", boards=1)
            wire = adapter(world)
            for cut_s in (first_cut_s, second_cut_s):
                failed_updates += isinstance(try_update(wire, firmware), TaxelError)
                world.run(max(cut_s + OFF_S - world.now_s, 1e-6))
                assert read_version(wire) in (OLD, NEW), (first_cut_s, second_cut_s)
            outcome = try_update(wire, firmware)
            assert not isinstance(outcome, TaxelError), (first_cut_s, second_cut_s, outcome)
            assert read_version(wire) == NEW
            torn_rows += world.read_flash(BOARD).torn
            cut_count += 2
            world.close()
    print(
        f"{cut_count} cuts: {torn_rows} rows torn, {failed_updates} updates failed and were repeated, no board bricked"
    )
    assert torn_rows > cut_count // 3


def test_a_planned_cut_interrupts_the_named_write(worlds, adapter, make_firmware):
    world = worlds(boards=1)
    firmware = make_firmware(size=384)
    world.plan_power_cut(BOARD, 2, 0.0, OFF_S)  # The second row, before it is written.
    try_update(adapter(world), firmware)
    world.run(0.1)
    (cut,) = world.read_power_cuts(BOARD)
    image = firmware.select_image_for(1)
    assert (cut.row, cut.after_s, cut.new_data) == (143, 0.0, image.rows()[1])  # slot B begins at row 142
    flash = world.read_flash(BOARD)
    assert flash.data[142 * 128 : 143 * 128] == image.rows()[0]
    assert not any(flash.data[143 * 128 : 144 * 128])
    assert (flash.torn, flash.runs) == (0, "application")


def test_planned_cuts_are_made_in_order(worlds, adapter, make_firmware):
    world = worlds(boards=1)
    world.plan_power_cut(BOARD, 1, 0.004, OFF_S)
    world.plan_power_cut(BOARD, 3, 0.0201, OFF_S)
    for _ in range(3):
        outcome = try_update(adapter(world), make_firmware(size=384))
        world.run(0.1)
    assert not isinstance(outcome, TaxelError)
    assert [(cut.row, cut.after_s) for cut in world.read_power_cuts(BOARD)] == [(142, 0.004), (144, 0.0201)]
    assert world.read_flash(BOARD).torn == 1  # a write takes 20 ms: the second cut is after the end of the write


def test_invalid_planned_cuts_are_refused(worlds):
    world = worlds(boards=1)
    with pytest.raises(FaultError, match="a power cut of address 0x60 strikes a board that this world does not have"):
        world.plan_power_cut(0x60, 1, 0.0, OFF_S)
    for _ in range(8):
        world.plan_power_cut(BOARD, 1, 0.0, OFF_S)
    with pytest.raises(FaultError, match="limit of 8 planned power cuts"):
        world.plan_power_cut(BOARD, 1, 0.0, OFF_S)
