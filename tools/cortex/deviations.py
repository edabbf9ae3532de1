"""Where Unicorn is known not to be a Cortex-M0: what is allowed to differ, and why."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from bare_cpu import Fault, Reason
from cases import FLAG_T, Block
from numpy.typing import NDArray
from unicorn_oracle import Verdict

from taxel.types import BoolArray, CountArray


class Outcome(NamedTuple):
    """A block's cases after the instruction. `ours`, `theirs`: STATE[n]; `verdict`: i64[n], Unicorn's."""

    block: Block
    ours: NDArray[np.void]
    theirs: NDArray[np.void]
    verdict: NDArray[np.int64]


class Deviation(NamedTuple):
    """Instructions that are undefined or unpredictable and that Unicorn executes all the same.

    of: whether it is one of these, by the first and second halfwords.
    """

    name: str
    reason: str
    of: Callable[[CountArray, CountArray], Any]

    def cases(self, outcome: Outcome) -> BoolArray:
        """bool[n]: those of a block. They are not compared any further."""
        ours = outcome.ours
        undefined = (ours["reason"] == Reason.FAULTED) & (ours["fault"] == Fault.UNDEFINED)
        taken = undefined & (outcome.verdict != Verdict.UNDEFINED)
        return np.asarray(self.of(outcome.block.first, outcome.block.second) & taken, dtype=np.bool_)


def _compare_of_low_or_pc(first: CountArray, _: CountArray) -> Any:
    d, m = first & 7 | first >> 4 & 8, first >> 3 & 15
    return (first >> 8 == 0x45) & (((d < 8) & (m < 8)) | (d == 15) | (m == 15))


def _add_pc_to_pc(first: CountArray, _: CountArray) -> Any:
    return first == 0x44FF


def _branch_with_low_bits_or_pc(first: CountArray, _: CountArray) -> Any:
    return (first >> 8 == 0x47) & ((first & 7 != 0) | (first >> 3 & 15 == 15))


def _if_then(first: CountArray, _: CountArray) -> Any:
    return (first >> 8 == 0xBF) & (first & 15 != 0)


def _compare_and_branch(first: CountArray, _: CountArray) -> Any:
    return first & 0xF500 == 0xB100


def _set_endianness(first: CountArray, _: CountArray) -> Any:
    return first & 0xFFF7 == 0xB650


def _change_state(first: CountArray, _: CountArray) -> Any:
    return (first & 0xFFE8 == 0xB660) & (first & 0xFFEF != 0xB662)


def _special_registers(first: CountArray, second: CountArray) -> Any:
    either = (first & 0xFFE0 == 0xF380) | (first & 0xFFE0 == 0xF3E0)
    return either & (second & 0xD000 == 0x8000)


KNOWN: tuple[Deviation, ...] = (
    Deviation("CMP of two low registers or of PC", "unpredictable", _compare_of_low_or_pc),
    Deviation("ADD PC, PC", "unpredictable", _add_pc_to_pc),
    Deviation("BX, BLX with low bits or PC", "unpredictable", _branch_with_low_bits_or_pc),
    Deviation("IT", "not in ARMv6-M", _if_then),
    Deviation("CBZ, CBNZ", "not in ARMv6-M", _compare_and_branch),
    Deviation("SETEND", "not in ARMv6-M", _set_endianness),
    Deviation("CPS with other bits", "unpredictable", _change_state),
    Deviation("MRS, MSR with SP, PC or an unknown register", "unpredictable", _special_registers),
)


def tidy(states: NDArray[np.void]) -> None:
    """STATE[n] of Unicorn's: bits that the architecture does not have, which Unicorn keeps, are cleared.

    They are the two lowest of the stack pointers, and in xPSR Q and GE, which come with ARMv7-M.
    """
    for name in ("msp", "psp"):
        states[name] &= np.uint32(0xFFFFFFFC)
    states["r"][:, 13] &= np.uint32(0xFFFFFFFC)
    states["xpsr"] &= np.uint32(0xF0000000 | FLAG_T)
