"""Tests of the interface of libtaxel_cortex_m0."""

import numpy as np
import pytest

NOP, WFI, BKPT, B_HERE = 0xBF00, 0xBF30, 0xBE00, 0xE7FE
PROGRAM_COUNTER = 15
"""Index of the program counter in the field `r` of a state."""


def encode_halfwords(*halfwords: int) -> bytes:
    """Encode the machine code of 16-bit instructions."""
    return np.array(halfwords, "<u2").tobytes()


@pytest.fixture
def cpu(cortex):
    """A processor with 1 KiB of flash, 512 bytes of RAM, and a vector table that starts programs at 0x100."""
    with cortex.bare_cpu.BareCpu(1024, 512) as cpu:
        cpu.write_memory(0, np.array([0x20000200, 0x101] + [0x181] * 46, "<u4").tobytes())
        cpu.write_memory(0x180, encode_halfwords(0x4770))  # BX LR
        yield cpu


def test_a_program_is_loaded_and_run_until_a_cycle(cortex, cpu):
    cpu.write_memory(0x100, encode_halfwords(0x3001, 0xE7FD))  # a loop of 4 cycles: ADDS r0, #1; B
    cpu.reset()
    assert cpu.run(4000) == cortex.bare_cpu.Reason.DEADLINE
    assert cpu.cycle == 4000
    assert cpu.state["r"][0, 0] == 1000


def test_a_step_executes_one_instruction(cortex, cpu):
    cpu.write_memory(0x100, encode_halfwords(NOP, BKPT))
    cpu.reset()
    cpu.step()
    cpu.set_line(3, True)  # an interrupt that is not enabled has no effect
    assert cpu.step() == cortex.bare_cpu.Reason.BREAKPOINT
    assert cpu.state["r"][0, PROGRAM_COUNTER] == 0x102
    cpu.skip_breakpoint()
    assert cpu.state["r"][0, PROGRAM_COUNTER] == 0x104


def test_a_processor_that_sleeps_reports_it_and_executes_no_instruction(cortex, cpu):
    cpu.write_memory(0x100, encode_halfwords(WFI, B_HERE))
    cpu.reset()
    assert cpu.run(100) == cortex.bare_cpu.Reason.ASLEEP
    assert cpu.count_instructions(200) == 0


def test_states_are_read_and_written(cortex, cpu):
    state = cpu.state
    state["r"] = np.arange(16) * 4
    state["xpsr"], state["psp"], state["primask"] = 0xB1000000, 0x20000100, 1
    cpu.state = state
    read_back = cpu.state
    assert (read_back["r"] == state["r"]).all()
    for name in ("xpsr", "psp", "primask", "control"):
        assert read_back[name] == state[name]
    state["control"] = 2  # selects the process stack: r13 and psp are then the same register
    cpu.state = state
    assert cpu.state["control"] == 2
    assert cpu.state["psp"] == cpu.state["r"][0, 13]


def test_each_case_runs_one_instruction_and_reports_its_end_fault_and_cycles(cortex):
    with cortex.bare_cpu.BareCpu(halt_on_fault=True) as cpu:
        cpu.write_memory(0x100, encode_halfwords(0x3001, NOP, 0xDE00, NOP))  # ADDS r0, #1; NOP; undefined; NOP
        states = np.zeros(2, cortex.bare_cpu.STATE)
        states["r"][:, PROGRAM_COUNTER] = 0x100, 0x104
        states["xpsr"] = 0x01000000  # Thumb bit, without which every instruction is a fault
        cpu.run_cases(states)
    assert states["r"][0, 0] == 1
    assert states["reason"].tolist() == [cortex.bare_cpu.Reason.DEADLINE, cortex.bare_cpu.Reason.FAULTED]
    assert states["fault"][1] == cortex.bare_cpu.Fault.UNDEFINED
    assert states["cycles"][0] == 1


def test_invalid_addresses_and_sizes_are_rejected(cortex, cpu):
    """The processor `cpu` has 1 KiB of flash, so 0x400 is the first invalid address, and 512 bytes of RAM."""
    with pytest.raises(ValueError, match="0x00000400"):
        cpu.write_memory(0x400, b"x")
    with pytest.raises(ValueError, match="513 bytes"):
        cpu.read_memory(0x20000000, 513)
    with pytest.raises(cortex.bare_cpu.CortexLibraryError, match="multiples of 4, found 10 and 512"):
        cortex.bare_cpu.BareCpu(10, 512)


def test_two_processors_share_no_state(cortex):
    with cortex.bare_cpu.BareCpu(1024, 512) as first, cortex.bare_cpu.BareCpu(1024, 512) as second:
        for cpu, add in ((first, 0x3001), (second, 0x3002)):
            cpu.write_memory(0, np.array([0x20000200, 0x101], "<u4").tobytes())  # initial stack pointer, reset vector
            cpu.write_memory(0x100, encode_halfwords(add, 0xE7FD))  # a loop of 4 cycles: ADDS r0, #1 or #2; B
            cpu.reset()
        for until in range(4, 401, 4):
            first.run(until)
            second.run(until)
        assert (first.state["r"][0, 0], second.state["r"][0, 0]) == (100, 200)
