"""Compiled programs give the same output in the emulator, in Unicorn and in QEMU."""

import pytest


@pytest.mark.parametrize("name", ["library", "firmware"])
def test_compiled_programs_give_the_same_output_in_unicorn(cortex, image_of, in_unicorn, name):
    image = image_of(name)
    emulated = cortex.images.run_emulator(image)
    assert emulated.text.count("\n") >= 7
    assert emulated.text == in_unicorn(image).text


@pytest.mark.parametrize("name", ["library", "firmware", "faults", "priorities", "stacks", "bootloader"])
def test_compiled_programs_give_the_same_output_in_qemu(cortex, image_of, in_qemu, name):
    image = image_of(name)
    emulated = cortex.images.run_emulator(image)
    assert emulated.text == in_qemu(image).text


def test_the_clock_of_the_port_gives_the_same_output_in_qemu(cortex, image_of, in_qemu):
    """The program prints counts of errors and of ticks, so instruction timing may differ between emulator and QEMU."""
    image = image_of("ticks")
    in_emulation = in_qemu(image, counted=True)
    assert in_emulation.text == cortex.images.run_emulator(image).text
    values = {
        line.rsplit(" ", 1)[0].strip(): int(line.rsplit(" ", 1)[1], 16) for line in in_emulation.text.splitlines()
    }
    error_counts = (
        "delays too short or long",
        "waits that did not end with a tick",
        "late",
        "time lost in a long wrap",
    )
    assert [values[name] for name in error_counts] == [0, 0, 0, 0]
    assert (values["ticks while masked"], values["pending"], values["served after unmasking"]) == (0, 1, 1)
    assert in_emulation.text.count("backwards 00000000\n  jumps 00000000") == 2


def test_the_bootloader_tries_an_image_three_times(cortex, image_of):
    """An image on trial is started three times; the next start selects the confirmed image."""
    text = cortex.images.run_emulator(image_of("bootloader")).text
    trials = [part.split("after listening ")[1][:8] for part in text.split("on trial\n")[1:]]
    assert [int(slot, 16) for slot in trials] == [1, 1, 1, 0]


def test_the_firmware_decodes_frames_and_scans_the_board(cortex, image_of):
    text = cortex.images.run_emulator(image_of("firmware")).text
    values = {line.rsplit(" ", 1)[0]: int(line.rsplit(" ", 1)[1], 16) for line in text.splitlines()}
    assert values["found"] == 30  # 40 frames, ten of them damaged
    assert values["scans"] == 20
    assert values["accepted"] == 0


def test_cycle_counts_are_reproducible_and_rise_with_wait_states(cortex, image_of):
    image = image_of("firmware")
    first = cortex.images.run_emulator(image).cycles
    assert cortex.images.run_emulator(image).cycles == first
    with cortex.bare_cpu.BareCpu(flash_wait=1) as cpu:
        waiting = cortex.images.run_emulator(image, cpu)
    assert waiting.text == cortex.images.run_emulator(image).text
    assert 0.8 < first / waiting.cycles < 0.95  # the data sheet of the PSoC 4200 states 85 % on average
    with cortex.bare_cpu.BareCpu(multiply=32) as cpu:
        assert cortex.images.run_emulator(image, cpu).cycles > first


def test_the_cycles_of_handlers_are_counted(cortex, image_of):
    image = image_of("priorities")
    with cortex.bare_cpu.BareCpu() as cpu:
        cpu.set_accounting(True)
        cortex.images.run_emulator(image, cpu)
        assert [cpu.handler_cost(number).count for number in (11, 14, 15)] == [7, 21, 15]
        for number in (11, 14, 15, 16, 17, 18, 19):
            cost = cpu.handler_cost(number)
            assert cost.exclusive_min <= cost.exclusive / cost.count <= cost.exclusive_max
            assert cost.inclusive >= cost.exclusive
        stack = 0x20004000 - int(cpu.state["lowest_msp"][0])
        assert 100 < stack < 1000


def test_a_program_that_locks_up_is_reported_in_one_line(cortex, image_of):
    image = image_of("faults")._replace(binary=bytes(8))
    with pytest.raises(cortex.images.ImageError, match=r"^faults did not end: LOCKUP, \w+ fault, r15 0x"):
        cortex.images.run_emulator(image)
