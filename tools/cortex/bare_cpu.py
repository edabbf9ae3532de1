"""Python interface of the emulated Cortex-M0 (firmware/emulator/cortex_m0) without peripherals."""

import ctypes
from dataclasses import dataclass, fields
from enum import IntEnum
from functools import cache
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from taxel.errors import TaxelError
from taxel.native_library import load_library

RAM_BASE = 0x20000000
SEMIHOSTING = 0xBEAB
"""BKPT instruction that requests a semihosting operation."""

STATE = np.dtype(
    [
        ("r", "<u4", 16),
        *((name, "<u4") for name in ("xpsr", "msp", "psp", "primask", "control", "reason", "cycles")),
        *((name, "<u4") for name in ("fault", "fault_address", "lowest_msp")),
    ]
)
"""Layout of struct taxel_cortex_m0_state."""


class Reason(IntEnum):
    """Reason why a run ended (enum cortex_m0_reason)."""

    DEADLINE = 0
    ASLEEP = 1
    STOPPED = 2
    BUS_RETRY = 3
    BREAKPOINT = 4
    FAULTED = 5
    RESET_REQUESTED = 6
    LOCKUP = 7


class Fault(IntEnum):
    """Kind of a fault (enum cortex_m0_fault_kind)."""

    NONE = 0
    UNDEFINED = 1
    UNALIGNED = 2
    BUS = 3
    FETCH = 4
    STATE = 5
    BREAKPOINT = 6
    SVC = 7
    RETURN = 8
    STACKING = 9
    VECTOR = 10


@dataclass(frozen=True)
class Cost:
    """Cycles of an exception's handler (struct cortex_m0_cost)."""

    count: int
    exclusive: int
    exclusive_min: int
    exclusive_max: int
    inclusive: int
    inclusive_min: int
    inclusive_max: int
    latency: int
    latency_max: int


class CortexLibraryError(TaxelError):
    """The compiled library is missing, or the memory sizes are invalid."""


@cache
def load_cortex_library() -> ctypes.CDLL:
    """Load the library once. Raises `CortexLibraryError` if it was not built."""
    library = load_library("taxel_cortex_m0", "the compiled Cortex-M0", CortexLibraryError)
    handle, word, long = ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint64
    signatures = {
        "open": (handle, [word, word, ctypes.c_uint8, ctypes.c_uint8, ctypes.c_int]),
        "close": (None, [handle]),
        "write_memory": (ctypes.c_int, [handle, word, ctypes.c_char_p, word]),
        "read_memory": (ctypes.c_int, [handle, word, ctypes.c_char_p, word]),
        "reset": (None, [handle, word]),
        "run": (ctypes.c_int, [handle, long]),
        "step": (ctypes.c_int, [handle]),
        "count_instructions": (long, [handle, long]),
        "set_line": (None, [handle, ctypes.c_uint, ctypes.c_int]),
        "skip_breakpoint": (None, [handle]),
        "get_cycle": (long, [handle]),
        "get_state": (None, [handle, handle]),
        "set_state": (None, [handle, handle]),
        "run_cases": (None, [handle, handle, word]),
        "set_accounting": (None, [handle, ctypes.c_int]),
        "get_cost": (None, [handle, ctypes.c_uint, handle]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, f"taxel_cortex_m0_{name}")
        function.restype, function.argtypes = result, arguments
    return library


class BareCpu:
    """Processor with flash at 0 and RAM at 0x20000000 (sizes in bytes, multiples of 4). Use it as a context manager.

    A run halts at breakpoints and, with `halt_on_fault`, at faulting instructions. Raises `CortexLibraryError`.
    """

    def __init__(
        self,
        flash_size: int = 0x20000,
        ram_size: int = 0x4000,
        *,
        flash_wait: int = 0,
        multiply: int = 1,
        halt_on_fault: bool = False,
    ) -> None:
        """Create an emulated Cortex-M0 without peripherals.

        flash_size, ram_size: bytes. flash_wait: wait states of a flash access. multiply: cycles of a
        multiplication. halt_on_fault: stop at a hard fault instead of executing its handler. Raises
        `CortexLibraryError` if a size is not a multiple of 4.
        """
        self._library = load_cortex_library()
        halt_flags = 1 | (2 if halt_on_fault else 0)  # bit 0: halt at a breakpoint; bit 1: halt at a hard fault
        self._handle = self._library.taxel_cortex_m0_open(flash_size, ram_size, flash_wait, multiply, halt_flags)
        if not self._handle:
            raise CortexLibraryError(f"memory sizes: expected multiples of 4, found {flash_size} and {ram_size}")

    def write_memory(self, address: int, data: bytes) -> None:
        """Write to flash or RAM. Raises `ValueError` if the range does not lie in one memory."""
        if self._library.taxel_cortex_m0_write_memory(self._handle, address, data, len(data)):
            raise ValueError(
                f"expected {len(data)} bytes of flash or RAM at 0x{address:08X}, found a range outside both"
            )

    def read_memory(self, address: int, size: int) -> bytes:
        """Read flash or RAM. Raises `ValueError` if the range does not lie in one memory."""
        buffer = ctypes.create_string_buffer(size)
        if self._library.taxel_cortex_m0_read_memory(self._handle, address, buffer, size):
            raise ValueError(f"expected {size} bytes of flash or RAM at 0x{address:08X}, found a range outside both")
        return buffer.raw

    def reset(self, vectors: int = 0) -> None:
        """Reset and start from the vector table at address `vectors`."""
        self._library.taxel_cortex_m0_reset(self._handle, vectors)

    def run(self, until: int) -> Reason:
        """Run until the cycle `until`, or until an event ends the run."""
        return Reason(self._library.taxel_cortex_m0_run(self._handle, until))

    def step(self) -> Reason:
        """Execute one instruction or one exception entry."""
        return Reason(self._library.taxel_cortex_m0_step(self._handle))

    def count_instructions(self, until: int) -> int:
        """Run in steps until the cycle `until` or another event; return the number of steps."""
        return int(self._library.taxel_cortex_m0_count_instructions(self._handle, until))

    def set_line(self, irq: int, high: bool) -> None:
        """Set the level of an interrupt input."""
        self._library.taxel_cortex_m0_set_line(self._handle, irq, high)

    @property
    def cycle(self) -> int:
        """Cycles since the processor was created."""
        return int(self._library.taxel_cortex_m0_get_cycle(self._handle))

    @property
    def state(self) -> NDArray[np.void]:
        """Registers, STATE[1]. After an assignment, no exception is active or pending."""
        state = np.zeros(1, STATE)
        self._library.taxel_cortex_m0_get_state(self._handle, state.ctypes.data)
        return state

    @state.setter
    def state(self, state: NDArray[np.void]) -> None:
        self._library.taxel_cortex_m0_set_state(self._handle, np.ascontiguousarray(state).ctypes.data)

    def skip_breakpoint(self) -> None:
        """Advance over the breakpoint at r15."""
        self._library.taxel_cortex_m0_skip_breakpoint(self._handle)

    def describe_fault(self) -> str:
        """Return one phrase with the kind of the latest fault and the program counter."""
        state = self.state[0]
        return f"{Fault(int(state['fault'])).name} fault, r15 0x{state['r'][15]:08X}"

    def run_cases(self, states: NDArray[np.void]) -> None:
        """Execute one instruction from each state of STATE[n] and replace the state by the result."""
        self._library.taxel_cortex_m0_run_cases(self._handle, states.ctypes.data, len(states))

    def set_accounting(self, enabled: bool) -> None:
        """Switch the cycle accounting of exception handlers on or off."""
        self._library.taxel_cortex_m0_set_accounting(self._handle, enabled)

    def read_handler_cost(self, exception: int) -> Cost:
        """Return the cycle counts of the handler of an exception. exception: number of the exception."""
        values = (ctypes.c_uint64 * len(fields(Cost)))()
        self._library.taxel_cortex_m0_get_cost(self._handle, exception, ctypes.addressof(values))
        return Cost(*values)

    def close(self) -> None:
        """Free the processor."""
        if self._handle:
            self._library.taxel_cortex_m0_close(self._handle)
            self._handle = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Free the emulated processor."""
        self.close()
