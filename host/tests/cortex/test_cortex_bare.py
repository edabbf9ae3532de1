"""The library's own interface."""

import numpy as np
import pytest

NOP, WFI, BKPT, B_HERE = 0xBF00, 0xBF30, 0xBE00, 0xE7FE


def words(*halves: int) -> bytes:
    return np.array(halves, "<u2").tobytes()


@pytest.fixture
def cpu(cortex):
    with cortex.bare_cpu.BareCpu(1024, 512) as cpu:
        cpu.load(0, np.array([0x20000200, 0x101] + [0x181] * 46, "<u4").tobytes())
        cpu.load(0x180, words(0x4770))  # BX LR
        yield cpu


def test_a_program_is_loaded_and_run_until_a_cycle(cortex, cpu):
    cpu.load(0x100, words(0x3001, 0xE7FD))  # ADDS r0, #1; B
    cpu.reset()
    assert cpu.run(4000) == cortex.bare_cpu.Reason.TIME
    assert cpu.cycle == 4000
    assert cpu.state["r"][0, 0] == 1000


def test_steps_are_instructions_and_entries(cortex, cpu):
    cpu.load(0x100, words(NOP, BKPT))
    cpu.reset()
    cpu.step()
    cpu.set_line(3, True)  # not enabled
    assert cpu.step() == cortex.bare_cpu.Reason.BREAKPOINT
    assert cpu.state["r"][0, 15] == 0x102
    cpu.skip()
    assert cpu.state["r"][0, 15] == 0x104


def test_sleep_is_told(cortex, cpu):
    cpu.load(0x100, words(WFI, B_HERE))
    cpu.reset()
    assert cpu.run(100) == cortex.bare_cpu.Reason.SLEEPS
    assert cpu.instructions(200) == 0


def test_states_are_read_and_written(cortex, cpu):
    state = cpu.state
    state["r"] = np.arange(16) * 4
    state["xpsr"], state["psp"], state["primask"] = 0xB1000000, 0x20000100, 1
    cpu.state = state
    back = cpu.state
    assert (back["r"] == state["r"]).all()
    for name in ("xpsr", "psp", "primask", "control"):
        assert back[name] == state[name]
    state["control"] = 2
    cpu.state = state
    assert cpu.state["control"] == 2
    assert cpu.state["psp"] == cpu.state["r"][0, 13]


def test_cases_run_one_instruction_each(cortex):
    with cortex.bare_cpu.BareCpu(halt_on_fault=True) as cpu:
        cpu.load(0x100, words(0x3001, NOP, 0xDE00, NOP))
        states = np.zeros(2, cortex.bare_cpu.STATE)
        states["r"][:, 15] = 0x100, 0x104
        states["xpsr"] = 0x01000000
        cpu.run_cases(states)
    assert states["r"][0, 0] == 1
    assert states["reason"].tolist() == [cortex.bare_cpu.Reason.TIME, cortex.bare_cpu.Reason.FAULTED]
    assert states["fault"][1] == cortex.bare_cpu.Fault.UNDEFINED
    assert states["cycles"][0] == 1


def test_what_lies_nowhere_is_refused(cortex, cpu):
    with pytest.raises(ValueError, match="0x00000400"):
        cpu.load(0x400, b"x")
    with pytest.raises(ValueError, match="513 bytes"):
        cpu.memory(0x20000000, 513)
    with pytest.raises(cortex.bare_cpu.CortexLibraryError, match="multiples of 4, found 10 and 512"):
        cortex.bare_cpu.BareCpu(10, 512)


def test_two_processors_know_nothing_of_each_other(cortex):
    with cortex.bare_cpu.BareCpu(1024, 512) as one, cortex.bare_cpu.BareCpu(1024, 512) as other:
        for cpu, add in ((one, 0x3001), (other, 0x3002)):
            cpu.load(0, np.array([0x20000200, 0x101], "<u4").tobytes())
            cpu.load(0x100, words(add, 0xE7FD))
            cpu.reset()
        for until in range(4, 401, 4):
            one.run(until)
            other.run(until)
        assert (one.state["r"][0, 0], other.state["r"][0, 0]) == (100, 200)
