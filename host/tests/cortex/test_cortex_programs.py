"""Compiled programs to their end: here, in Unicorn and in QEMU they say the same."""

import pytest


@pytest.mark.parametrize("name", ["library", "firmware"])
def test_compiled_programs_come_to_the_same_results(cortex, image_of, in_unicorn, name):
    image = image_of(name)
    ours = cortex.images.run_here(image)
    assert ours.text.count("\n") >= 7
    assert ours.text == in_unicorn(image).text


@pytest.mark.parametrize("name", ["library", "firmware", "faults", "priorities", "stacks", "bootloader"])
def test_programs_say_what_they_say_in_qemu(cortex, image_of, in_qemu, name):
    image = image_of(name)
    ours = cortex.images.run_here(image)
    assert ours.text == in_qemu(image).text


def test_the_ports_clock_keeps_its_time_in_qemu(cortex, image_of, in_qemu):
    """Its figures are counts of what went wrong, and of ticks, so that instructions may last longer here than there."""
    image = image_of("ticks")
    found = in_qemu(image, counted=True)
    assert found.text == cortex.images.run_here(image).text
    said = {line.rsplit(" ", 1)[0].strip(): int(line.rsplit(" ", 1)[1], 16) for line in found.text.splitlines()}
    wrong = ("delays too short or long", "waits that did not end with a tick", "late", "time lost in a long wrap")
    assert [said[name] for name in wrong] == [0, 0, 0, 0]
    assert (said["ticks while masked"], said["pending"], said["kept"]) == (0, 1, 1)
    assert found.text.count("backwards 00000000\n  jumps 00000000") == 2


def test_the_bootloader_chooses_as_it_says(cortex, image_of):
    """An image on trial is started three times, then the confirmed one."""
    text = cortex.images.run_here(image_of("bootloader")).text
    trials = [part.split("later ")[1][:8] for part in text.split("on trial\n")[1:]]
    assert [int(slot, 16) for slot in trials] == [1, 1, 1, 0]


def test_the_firmware_finds_its_frames_and_scans_its_board(cortex, image_of):
    text = cortex.images.run_here(image_of("firmware")).text
    said = {line.rsplit(" ", 1)[0]: int(line.rsplit(" ", 1)[1], 16) for line in text.splitlines()}
    assert said["found"] == 30  # of 40, ten of which were damaged
    assert said["scans"] == 20
    assert said["accepted"] == 0


def test_a_program_takes_the_same_cycles_every_time_and_more_with_wait_states(cortex, image_of):
    image = image_of("firmware")
    first = cortex.images.run_here(image).cycles
    assert cortex.images.run_here(image).cycles == first
    with cortex.bare_cpu.BareCpu(flash_wait=1) as cpu:
        waiting = cortex.images.run_here(image, cpu)
    assert waiting.text == cortex.images.run_here(image).text
    assert 0.8 < first / waiting.cycles < 0.95  # the data sheet of the PSoC 4200 says 85 % on average
    with cortex.bare_cpu.BareCpu(multiply=32) as cpu:
        assert cortex.images.run_here(image, cpu).cycles > first


def test_handlers_are_accounted_for(cortex, image_of):
    image = image_of("priorities")
    with cortex.bare_cpu.BareCpu() as cpu:
        cpu.account(True)
        cortex.images.run_here(image, cpu)
        assert [cpu.cost(number).count for number in (11, 14, 15)] == [7, 21, 15]
        for number in (11, 14, 15, 16, 17, 18, 19):
            cost = cpu.cost(number)
            assert cost.own_min <= cost.own / cost.count <= cost.own_max
            assert cost.inclusive >= cost.own
        stack = 0x20004000 - int(cpu.state["lowest_msp"][0])
        assert 100 < stack < 1000


def test_a_program_that_does_not_end_well_says_so_in_one_line(cortex, image_of):
    image = image_of("faults")._replace(binary=bytes(8))
    with pytest.raises(cortex.images.ImageError, match=r"^faults has not come to its end: LOCKUP, \w+ fault, r15 0x"):
        cortex.images.run_here(image)
