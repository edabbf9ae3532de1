"""The power fails while a board is updated, and again while that is mended: the old image or the new one, always."""

from __future__ import annotations

import random

import pytest

from taxel.errors import TaxelError
from taxel.link.virtual import FaultError, VirtualSMBus
from taxel_tools.application import version_of, wait_for_application
from taxel_tools.interleave import run, run_all
from taxel_tools.program import update
from taxel_tools.wires import SmbusWire

BOARD = 0x50
OLD, NEW = (0, 1, 0), (1, 2, 3)
WRITE_S, OFF_S = 0.02, 0.03
FRACTIONS = (-0.02, 0.02, 0.5, 0.98)
"""Of a row's write: before it, near its ends, in its middle."""
STEP_S = 0.0005


def attempt(wire, firmware):
    return run_all(wire, {BOARD: update(BOARD, firmware, wire.now_s, lambda progress: None)})[BOARD]


def version(wire):
    identity = run(wire, wait_for_application(BOARD, wire.now_s, 6.0))
    assert identity is not None, "bricked"
    return version_of(identity)


def wire_noting(world, note):
    """An adapter that looks at the world, every half millisecond, while it waits."""

    def wait(seconds: float) -> None:
        end = world.now_s + seconds
        while (left := end - world.now_s) > 1e-9:
            world.run(min(left, STEP_S))
            note()

    return SmbusWire(VirtualSMBus(world), "virtual", lambda: world.now_s, wait)


def write_times(world, firmware) -> list[float]:
    """When each flash operation of an update begins, to half a millisecond."""
    times, seen = [], [int(world.board_flash(BOARD).wear.sum())]

    def note() -> None:
        count = int(world.board_flash(BOARD).wear.sum())
        times.extend([world.now_s - STEP_S] * (count - seen[0]))
        seen[0] = count

    assert not isinstance(attempt(wire_noting(world, note), firmware), TaxelError)
    return times


@pytest.mark.parametrize("listens", [0, 1])
def test_a_cut_leaves_the_old_or_the_new_image_and_the_update_can_be_begun_again(
    worlds, adapter, make_firmware, listens
):
    seed = 40
    print(f"seed {seed}")
    generator = random.Random(seed)
    firmware = make_firmware(size=384)
    times = write_times(worlds(f"boot_listens {listens}", boards=1), firmware)
    assert len(times) == 3 + 1 + 1 + 1, "three rows, pending, a try, confirmed"
    cuts = torn = failed = 0
    for first in [time + WRITE_S * fraction for time in times for fraction in FRACTIONS]:
        for span in (0.15, 0.4, 0.8):
            second = first + OFF_S + generator.uniform(span / 3.0, span)
            lines = [
                f"fault {time!r} {name} {BOARD}"
                for cut in (first, second)
                for time, name in ((cut, "unplug"), (cut + OFF_S, "plug"))
            ]
            world = worlds(*lines, f"boot_listens {listens}", boards=1)
            wire = adapter(world)
            for cut in (first, second):
                failed += isinstance(attempt(wire, firmware), TaxelError)
                world.run(max(cut + OFF_S - world.now_s, 1e-6))
                assert version(wire) in (OLD, NEW), (first, second)
            last = attempt(wire, firmware)
            assert not isinstance(last, TaxelError), (first, second, last)
            assert version(wire) == NEW
            torn += world.board_flash(BOARD).torn
            cuts += 2
            world.close()
    print(f"{cuts} cuts: {torn} rows torn, {failed} updates failed and were done again, no board bricked")
    assert torn > cuts // 3


def test_a_planned_cut_strikes_the_write_that_was_named(worlds, adapter, make_firmware):
    world = worlds(boards=1)
    firmware = make_firmware(size=384)
    world.plan_cut(BOARD, 2, 0.0, OFF_S)  # the second row, before it is written
    attempt(adapter(world), firmware)
    world.run(0.1)
    (cut,) = world.cuts(BOARD)
    image = firmware.image_for(1)
    assert (cut.row, cut.after_s, cut.wanted) == (129, 0.0, image.rows()[1])
    flash = world.board_flash(BOARD)
    assert flash.data[128 * 128 : 129 * 128] == image.rows()[0]
    assert not any(flash.data[129 * 128 : 130 * 128])
    assert (flash.torn, flash.runs) == (0, "application")


def test_planned_cuts_follow_one_another(worlds, adapter, make_firmware):
    world = worlds(boards=1)
    world.plan_cut(BOARD, 1, 0.004, OFF_S)
    world.plan_cut(BOARD, 3, 0.0201, OFF_S)
    for _ in range(3):
        last = attempt(adapter(world), make_firmware(size=384))
        world.run(0.1)
    assert not isinstance(last, TaxelError)
    assert [(cut.row, cut.after_s) for cut in world.cuts(BOARD)] == [(128, 0.004), (130, 0.0201)]
    assert world.board_flash(BOARD).torn == 1


def test_cuts_that_cannot_be_planned_are_refused(worlds):
    world = worlds(boards=1)
    with pytest.raises(FaultError, match="a power cut of address 0x60 strikes a board that this world does not have"):
        world.plan_cut(0x60, 1, 0.0, OFF_S)
    for _ in range(8):
        world.plan_cut(BOARD, 1, 0.0, OFF_S)
    with pytest.raises(FaultError, match="is one too many"):
        world.plan_cut(BOARD, 1, 0.0, OFF_S)
