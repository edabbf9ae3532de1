"""Known deviations of Unicorn from a Cortex-M0: differences that a comparison ignores, with the reasons."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from bare_cpu import Fault, Reason
from cases import FLAG_T, Block
from numpy.typing import NDArray
from unicorn_oracle import Verdict

from taxel.types import BoolArray, CountArray


class Outcome(NamedTuple):
    """The cases of a block after their instruction.

    emulated, reference: STATE[n] in the emulator and in Unicorn. verdict: i64[n], Unicorn's `Verdict`.
    """

    block: Block
    emulated: NDArray[np.void]
    reference: NDArray[np.void]
    verdict: NDArray[np.int64]


class Deviation(NamedTuple):
    """Instructions that are undefined or unpredictable on a Cortex-M0 but executed by Unicorn.

    matches: predicate on the first and second halfwords.
    """

    name: str
    reason: str
    matches: Callable[[CountArray, CountArray], Any]

    def cases(self, outcome: Outcome) -> BoolArray:
        """Return the test cases that this deviation explains, as bool[n]; these cases are not compared further.

        In these cases the emulator reports an undefined instruction, whereas Unicorn executes the instruction.
        """
        emulated = outcome.emulated
        undefined = (emulated["reason"] == Reason.FAULTED) & (emulated["fault"] == Fault.UNDEFINED)
        explained_cases = undefined & (outcome.verdict != Verdict.UNDEFINED)
        return np.asarray(self.matches(outcome.block.first, outcome.block.second) & explained_cases, dtype=np.bool_)


def _is_compare_of_low_or_pc(first: CountArray, _: CountArray) -> Any:
    """Return which instructions are CMP for high registers, but with two low registers or with PC (unpredictable)."""
    d, m = first & 7 | first >> 4 & 8, first >> 3 & 15
    return (first >> 8 == 0x45) & (((d < 8) & (m < 8)) | (d == 15) | (m == 15))


def _is_add_pc_to_pc(first: CountArray, _: CountArray) -> Any:
    """Return which instructions are ADD PC, PC. first: first halfwords u16[n]; the result is bool[n]."""
    return first == 0x44FF


def _is_branch_with_low_bits_or_pc(first: CountArray, _: CountArray) -> Any:
    """Return which instructions are BX or BLX with nonzero low bits, or to the program counter."""
    return (first >> 8 == 0x47) & ((first & 7 != 0) | (first >> 3 & 15 == 15))


def _is_if_then(first: CountArray, _: CountArray) -> Any:
    """Return which instructions are IT (if-then), which a Cortex-M0 does not have."""
    return (first >> 8 == 0xBF) & (first & 15 != 0)


def _is_compare_and_branch(first: CountArray, _: CountArray) -> Any:
    """Return which instructions are CBZ or CBNZ, which a Cortex-M0 does not have."""
    return first & 0xF500 == 0xB100


def _is_set_endianness(first: CountArray, _: CountArray) -> Any:
    """Return which instructions are SETEND, which a Cortex-M0 does not have."""
    return first & 0xFFF7 == 0xB650


def _is_change_state(first: CountArray, _: CountArray) -> Any:
    """Return which instructions are CPS in an encoding that a Cortex-M0 does not have."""
    return (first & 0xFFE8 == 0xB660) & (first & 0xFFEF != 0xB662)


def _is_special_register_access(first: CountArray, second: CountArray) -> Any:
    """Return which instructions are MSR or MRS, which access the special registers."""
    either = (first & 0xFFE0 == 0xF380) | (first & 0xFFE0 == 0xF3E0)
    return either & (second & 0xD000 == 0x8000)


KNOWN: tuple[Deviation, ...] = (
    Deviation("CMP of two low registers or of PC", "unpredictable", _is_compare_of_low_or_pc),
    Deviation("ADD PC, PC", "unpredictable", _is_add_pc_to_pc),
    Deviation("BX, BLX with low bits or PC", "unpredictable", _is_branch_with_low_bits_or_pc),
    Deviation("IT", "not in ARMv6-M", _is_if_then),
    Deviation("CBZ, CBNZ", "not in ARMv6-M", _is_compare_and_branch),
    Deviation("SETEND", "not in ARMv6-M", _is_set_endianness),
    Deviation("CPS with other bits", "unpredictable", _is_change_state),
    Deviation("MRS, MSR with SP, PC or an unknown register", "unpredictable", _is_special_register_access),
)


def clear_unimplemented_bits(states: NDArray[np.void]) -> None:
    """Clear bits in Unicorn's STATE[n] that the architecture does not implement but Unicorn keeps.

    These bits are the two lowest bits of the stack pointers, and Q and GE in xPSR, which belong to ARMv7-M. Of xPSR,
    the condition flags (bits 28 to 31) and the Thumb bit remain.
    """
    for name in ("msp", "psp"):
        states[name] &= np.uint32(0xFFFFFFFC)
    states["r"][:, 13] &= np.uint32(0xFFFFFFFC)
    states["xpsr"] &= np.uint32(0xF0000000 | FLAG_T)
