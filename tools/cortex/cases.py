"""Random test cases: an instruction with random registers and memory."""

from typing import NamedTuple

import numpy as np
from bare_cpu import RAM_BASE, STATE
from numpy.typing import NDArray
from unicorn_oracle import FLASH_SIZE, RAM_SIZE, SLOT

BLOCK = 2048
"""Number of cases that share one memory."""

CODE = 0x8000
"""Address of the block's instructions, SLOT bytes each; the rest of flash is random."""

FIRST_32_BIT = 0xE800
"""Smallest first halfword of a 32-bit instruction."""

NOP = 0xBF00
FLAG_T = 0x01000000
EDGES = np.array([0, 1, 2, 31, 32, 33, 255, 256, 0x7FFFFFFF, 0x80000000, 0x80000001, 0xFFFFFFFE, 0xFFFFFFFF], np.uint32)


class Block(NamedTuple):
    """A block of test cases.

    first, second: u16[n], halfwords of each instruction. size: i64[n], bytes. states: STATE[n], registers before the
    instruction. ram, flash: memory shared by all cases.
    """

    first: NDArray[np.uint16]
    second: NDArray[np.uint16]
    size: NDArray[np.int64]
    states: NDArray[np.void]
    ram: bytes
    flash: bytes


def _sample_second_halfwords(rng: np.random.Generator, first: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Return random second halfwords u16[n] for the first halfwords u16[n].

    A sixth of them has the bits that make BL out of a matching first halfword.
    """
    n = len(first)
    second = rng.integers(0, 0x10000, n, dtype=np.uint16)
    kind = rng.integers(0, 6, n)
    second[kind == 0] |= 0xD000  # BL if the first halfword matches
    return second


def _sample_special_instructions(rng: np.random.Generator, n: int) -> NDArray[np.uint16]:
    """Return n random instructions u16[n, 2]: BL, MSR, MRS and barriers (encodings of the ARMv6-M manual).

    These instructions are rare in a sequence of all first halfwords. Some of the special registers that MSR and MRS
    access do not exist.
    """
    kind = rng.integers(0, 4, n)  # 0: BL, 1: MSR, 2: MRS, 3: barrier
    number = rng.choice(np.array([0, 1, 2, 3, 5, 6, 7, 8, 9, 16, 20, 4, 10], np.uint16), n)
    register = rng.integers(0, 16, n, dtype=np.uint16)
    first = rng.integers(0xF000, 0xF800, n, dtype=np.uint16)
    second = rng.integers(0, 0x10000, n, dtype=np.uint16) | np.uint16(0xD000)
    msr, mrs, barrier = (kind == i for i in (1, 2, 3))
    first[msr], second[msr] = 0xF380 | register[msr], 0x8800 | number[msr]
    first[mrs], second[mrs] = 0xF3EF, 0x8000 | register[mrs] << 8 | number[mrs]
    first[barrier], second[barrier] = 0xF3BF, 0x8F00 | rng.integers(0x30, 0x80, int(barrier.sum()), dtype=np.uint16)
    return np.stack([first, second], 1)


def _sample_instructions(rng: np.random.Generator, index: int) -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """Return the first and second halfwords, u16[BLOCK] each, of the test instructions of block `index`.

    Consecutive blocks contain all first halfwords in a fixed order; a tenth of the instructions are special ones.
    """
    step = 0x9E35  # odd: a permutation of the halfwords
    first = ((np.arange(BLOCK, dtype=np.int64) + index * BLOCK) * step % 0x10000).astype(np.uint16)
    second = _sample_second_halfwords(rng, first)
    special = rng.permutation(BLOCK)[: BLOCK // 10]
    first[special], second[special] = _sample_special_instructions(rng, len(special)).T
    return first, second


def _sample_registers(rng: np.random.Generator) -> NDArray[np.uint32]:
    """Return random values u32[BLOCK, 16] for the registers r0 to r15 of each test case.

    They are addresses in RAM and flash (aligned, unaligned, at the ends), small numbers, edge cases, and arbitrary
    values.
    """
    shape = (BLOCK, 16)
    kind = rng.integers(0, 10, shape)
    values = rng.integers(0, 1 << 32, shape, dtype=np.uint32)
    ram = RAM_BASE + rng.integers(0, RAM_SIZE // 4, shape, dtype=np.uint32) * np.uint32(4)
    values = np.where(kind < 4, ram, values)
    values = np.where(kind == 4, ram + rng.integers(0, 4, shape, dtype=np.uint32), values)
    ends = np.array([RAM_BASE, RAM_BASE + RAM_SIZE, FLASH_SIZE], np.uint32)[rng.integers(0, 3, shape)]
    ends = ends + (rng.integers(-5, 6, shape) * 4).astype(np.uint32)
    values = np.where(kind == 5, ends, values)
    values = np.where(kind == 6, rng.integers(0, FLASH_SIZE, shape, dtype=np.uint32), values)
    values = np.where(kind == 7, rng.integers(0, 256, shape, dtype=np.uint32), values)
    return np.where(kind == 8, rng.choice(EDGES, shape), values).astype(np.uint32)


def generate_block(seed: int, index: int) -> Block:
    """Generate the test cases of block `index` of the sequence that belongs to `seed`.

    Case i has its instruction in slot i of the code in flash. The stack pointer r13 is a multiple of 4, as in the
    processor; all other registers, flags, RAM and flash are random.
    """
    rng = np.random.default_rng([seed, index])
    first, second = _sample_instructions(rng, index)
    states = np.zeros(BLOCK, STATE)
    registers = _sample_registers(rng)
    registers[:, 13] &= ~np.uint32(3)
    registers[:, 15] = CODE + SLOT * np.arange(BLOCK)
    states["r"] = registers
    states["xpsr"] = rng.integers(0, 16, BLOCK, dtype=np.uint32) << np.uint32(28) | np.uint32(FLAG_T)
    states["msp"] = registers[:, 13]
    states["psp"] = rng.integers(0, 1 << 30, BLOCK, dtype=np.uint32) * np.uint32(4)
    states["primask"] = rng.integers(0, 2, BLOCK, dtype=np.uint32)
    flash = bytearray(rng.bytes(FLASH_SIZE))
    code = np.frombuffer(flash, np.uint16, BLOCK * SLOT // 2, CODE).reshape(BLOCK, -1)
    code[:, 0], code[:, 1] = first, second
    code[(first >> 8 == 0xBF) & (first & 15 != 0), 1:] = NOP  # Unicorn executes IT and the following instruction as one
    return Block(first, second, np.where(first < FIRST_32_BIT, 2, 4), states, rng.bytes(RAM_SIZE), bytes(flash))
