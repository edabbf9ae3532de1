"""Limits of Unicorn that exclude it as the emulation engine; each test shows one limit.

If a test fails with a newer Unicorn, reconsider the choice documented in firmware/DESIGN.md.
"""

import importlib

import numpy as np
import pytest

PORT = 0x40000000
NVIC_ISER = 0xE000E100
EXC_RETURN = 0xFFFFFFF9
STR_R0_R1, LDR_R0_R1, ADDS_R0_1, NOP, WFI, BX_LR, MOVW = (
    0x6008,
    0x6808,
    0x3001,
    0xBF00,
    0xBF30,
    0x4770,
    (0xF240, 0x0000),
)


def encode_halfwords(*halfwords: int) -> bytes:
    return np.array(halfwords, "<u2").tobytes()


@pytest.fixture
def u():
    """The package `unicorn`."""
    return pytest.importorskip("unicorn", reason="unicorn is not installed: pip install unicorn==2.1.4")


@pytest.fixture
def arm(u):
    return importlib.import_module("unicorn.arm_const")


def create_engine(u, arm, mode, *halfwords):
    """Create an engine with instructions at 0x100."""
    engine = u.Uc(u.UC_ARCH_ARM, mode, arm.UC_CPU_ARM_CORTEX_M0)
    engine.mem_map(0, 0x10000)
    engine.mem_map(0x20000000, 0x4000)
    engine.mem_write(0x100, encode_halfwords(*halfwords, NOP, NOP))
    return engine


def test_microcontroller_mode_always_emulates_a_cortex_m33(u, arm):
    engine = create_engine(u, arm, u.UC_MODE_THUMB | u.UC_MODE_MCLASS, *MOVW)
    engine.emu_start(0x101, 0x104)  # a fault on a Cortex-M0
    assert engine.ctl_get_cpu_model() == arm.UC_CPU_ARM_CORTEX_M33
    engine = create_engine(u, arm, u.UC_MODE_THUMB | u.UC_MODE_MCLASS, LDR_R0_R1)
    engine.reg_write(arm.UC_ARM_REG_R1, 0x20000001)
    engine.emu_start(0x101, 0x102)  # unaligned: a fault on a Cortex-M0


def test_the_system_control_space_is_missing(cortex, u, arm):
    """A read of a register of the interrupt controller fails in Unicorn, and succeeds in the emulator."""
    engine = create_engine(u, arm, u.UC_MODE_THUMB, LDR_R0_R1)
    engine.reg_write(arm.UC_ARM_REG_R1, NVIC_ISER)
    with pytest.raises(u.UcError):
        engine.emu_start(0x101, 0x102)
    with cortex.bare_cpu.BareCpu(halt_on_fault=True) as cpu:
        cpu.write_memory(0x100, encode_halfwords(LDR_R0_R1))
        states = np.zeros(1, cortex.bare_cpu.STATE)
        states["r"][0, 1], states["r"][0, 15], states["xpsr"] = NVIC_ISER, 0x100, 0x01000000
        cpu.run_cases(states)
        assert states["reason"] == cortex.bare_cpu.Reason.DEADLINE


def test_an_exception_return_is_not_supported(u, arm):
    engine = create_engine(u, arm, u.UC_MODE_THUMB, BX_LR)
    engine.reg_write(arm.UC_ARM_REG_LR, EXC_RETURN)
    with pytest.raises(u.UcError):
        engine.emu_start(0x101, 0x102)


@pytest.mark.parametrize("callback_kind", ["mmio", "hook"])
def test_a_stop_in_a_write_callback_makes_the_next_run_repeat_the_store(u, arm, callback_kind):
    engine, writes = create_engine(u, arm, u.UC_MODE_THUMB, STR_R0_R1, ADDS_R0_1), []

    def record_write(engine, *arguments):
        writes.append(arguments)
        engine.emu_stop()

    if callback_kind == "mmio":
        engine.mmio_map(PORT, 0x1000, lambda *_: 0, None, record_write, None)
    else:
        engine.mem_map(PORT, 0x1000)
        engine.hook_add(u.UC_HOOK_MEM_WRITE, record_write, None, PORT, PORT + 0xFFF)
    engine.reg_write(arm.UC_ARM_REG_R1, PORT)
    for count in (1, 2):
        engine.emu_start(engine.reg_read(arm.UC_ARM_REG_PC) | 1 if count > 1 else 0x101, 0x104)
        assert len(writes) == count
        assert engine.reg_read(arm.UC_ARM_REG_PC) == 0x100


def test_a_read_callback_sees_the_start_of_the_block_as_program_counter(u, arm):
    engine, program_counters = create_engine(u, arm, u.UC_MODE_THUMB, NOP, NOP, LDR_R0_R1, NOP, LDR_R0_R1), []

    def record_program_counter(engine, *_):
        program_counters.append(engine.reg_read(arm.UC_ARM_REG_PC))
        return 0

    engine.mmio_map(PORT, 0x1000, record_program_counter, None, lambda *_: None, None)
    engine.reg_write(arm.UC_ARM_REG_R1, PORT)
    engine.emu_start(0x101, 0x10A)
    assert program_counters == [0x100, 0x100]  # the beginning of the block, not 0x104 and 0x108


def test_the_stack_pointer_keeps_its_two_lowest_bits_unlike_a_cortex_m0(cortex, oracle):
    states = np.zeros(1, cortex.bare_cpu.STATE)
    states["r"][0, 1], states["r"][0, 13], states["r"][0, 15], states["xpsr"] = 3, 0x20001000, 0x100, 0x01000000
    oracle.write_memory(0x100, encode_halfwords(0x448D))  # ADD SP, r1
    reference = states.copy()
    oracle.run_case(reference, 2)  # one instruction of 2 bytes
    assert reference["r"][0, 13] == 0x20001003
    with cortex.bare_cpu.BareCpu(halt_on_fault=True) as cpu:
        cpu.write_memory(0x100, encode_halfwords(0x448D))
        cpu.run_cases(states)
    assert states["r"][0, 13] == 0x20001000
