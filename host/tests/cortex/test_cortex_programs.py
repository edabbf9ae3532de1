"""Compiled programs give the same output in the emulator, in Unicorn and in QEMU."""

import pytest

SVCALL, PENDSV, SYSTICK = 11, 14, 15
FIRST_INTERRUPTS = (16, 17, 18, 19)
RAM_END = 0x20004000


@pytest.mark.parametrize("name", ["library", "firmware"])
def test_compiled_programs_give_the_same_output_in_unicorn(cortex, build_image, run_in_unicorn, name):
    image = build_image(name)
    emulated = cortex.images.run_emulator(image)
    assert emulated.text.count("\n") >= 7  # the program has printed its results
    assert emulated.text == run_in_unicorn(image).text


@pytest.mark.parametrize("name", ["library", "firmware", "faults", "priorities", "stacks", "bootloader"])
def test_compiled_programs_give_the_same_output_in_qemu(cortex, build_image, run_in_qemu, name):
    image = build_image(name)
    emulated = cortex.images.run_emulator(image)
    assert emulated.text == run_in_qemu(image).text


def test_the_clock_of_the_port_gives_the_same_output_in_qemu(cortex, build_image, run_in_qemu):
    """The program prints counts of errors and of ticks, so instruction timing may differ between emulator and QEMU."""
    image = build_image("ticks")
    qemu_output = run_in_qemu(image, counted=True)
    assert qemu_output.text == cortex.images.run_emulator(image).text
    values = {line.rsplit(" ", 1)[0].strip(): int(line.rsplit(" ", 1)[1], 16) for line in qemu_output.text.splitlines()}
    error_counts = (
        "delays too short or long",
        "waits that did not end with a tick",
        "late",
        "time lost in a long wrap",
    )
    assert [values[name] for name in error_counts] == [0, 0, 0, 0]
    assert (values["ticks while masked"], values["pending"], values["served after unmasking"]) == (0, 1, 1)
    # With interrupts enabled and masked, no reading of the clock is before or far after the previous reading.
    assert qemu_output.text.count("backwards 00000000\n  jumps 00000000") == 2


def test_the_bootloader_starts_an_image_on_trial_three_times_and_then_the_confirmed_image(cortex, build_image):
    text = cortex.images.run_emulator(build_image("bootloader")).text
    started_slots = [start.split("after listening ")[1][:8] for start in text.split("on trial\n")[1:]]
    trial_slot, confirmed_slot = 1, 0
    assert [int(slot, 16) for slot in started_slots] == [trial_slot, trial_slot, trial_slot, confirmed_slot]


def test_the_firmware_decodes_the_undamaged_frames_and_completes_all_scans(cortex, build_image):
    text = cortex.images.run_emulator(build_image("firmware")).text
    values = {line.rsplit(" ", 1)[0]: int(line.rsplit(" ", 1)[1], 16) for line in text.splitlines()}
    assert values["found"] == 30  # 40 frames, ten of them damaged
    assert values["scans"] == 20
    assert values["accepted"] == 0  # result of taxel_sensor_init(); 0: success


def test_cycle_counts_are_reproducible(cortex, build_image):
    image = build_image("firmware")
    assert cortex.images.run_emulator(image).cycles == cortex.images.run_emulator(image).cycles


def test_wait_states_of_the_flash_increase_the_cycles_without_changing_the_output(cortex, build_image):
    image = build_image("firmware")
    without_wait_states = cortex.images.run_emulator(image)
    with cortex.bare_cpu.BareCpu(flash_wait=1) as cpu:
        with_wait_states = cortex.images.run_emulator(image, cpu)
    assert with_wait_states.text == without_wait_states.text
    # The data sheet of the PSoC 4200 states 85 % on average.
    assert 0.8 < without_wait_states.cycles / with_wait_states.cycles < 0.95


def test_a_slow_multiplier_increases_the_cycles(cortex, build_image):
    image = build_image("firmware")
    with cortex.bare_cpu.BareCpu(multiply=32) as cpu:
        assert cortex.images.run_emulator(image, cpu).cycles > cortex.images.run_emulator(image).cycles


def test_calls_cycles_and_stack_of_exception_handlers_are_counted(cortex, build_image):
    image = build_image("priorities")
    with cortex.bare_cpu.BareCpu() as cpu:
        cpu.set_accounting(True)
        cortex.images.run_emulator(image, cpu)
        # For each of seven priority assignments, the program raises SVCall once, PendSV three times and SysTick twice.
        # It raises SysTick once more at its end.
        assert [cpu.read_handler_cost(number).count for number in (SVCALL, PENDSV, SYSTICK)] == [7, 21, 15]
        for number in (SVCALL, PENDSV, SYSTICK, *FIRST_INTERRUPTS):
            cost = cpu.read_handler_cost(number)
            assert cost.exclusive_min <= cost.exclusive / cost.count <= cost.exclusive_max
            assert cost.inclusive >= cost.exclusive
        stack_bytes = RAM_END - int(cpu.state["lowest_msp"][0])
        assert 100 < stack_bytes < 1000


def test_a_program_that_locks_up_is_reported_in_one_line(cortex, build_image):
    image = build_image("faults")._replace(binary=bytes(8))
    with pytest.raises(cortex.images.ImageError, match=r"^faults did not end: LOCKUP, \w+ fault, r15 0x"):
        cortex.images.run_emulator(image)
