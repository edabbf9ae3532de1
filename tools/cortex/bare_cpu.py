"""A bare Cortex-M0 from Python: the emulator's processor (firmware/emulator/cortex_m0) without any peripherals."""

from __future__ import annotations

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
"""The BKPT through which a program asks its host."""

STATE = np.dtype(
    [
        ("r", "<u4", 16),
        *((name, "<u4") for name in ("xpsr", "msp", "psp", "primask", "control", "reason", "cycles")),
        *((name, "<u4") for name in ("fault", "fault_address", "lowest_msp")),
    ]
)
"""struct taxel_cortex_m0_state."""


class Reason(IntEnum):
    """Why the processor has stopped: enum cortex_m0_reason."""

    TIME = 0
    SLEEPS = 1
    STOPPED = 2
    WAITS = 3
    BREAKPOINT = 4
    FAULTED = 5
    RESET_WANTED = 6
    LOCKUP = 7


class Fault(IntEnum):
    """enum cortex_m0_fault_kind."""

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
    """Cycles of an exception's handler: struct cortex_m0_cost."""

    count: int
    own: int
    own_min: int
    own_max: int
    inclusive: int
    inclusive_min: int
    inclusive_max: int
    latency: int
    latency_max: int


class CortexLibraryError(TaxelError):
    """The compiled processor is missing, or refuses its memory."""


@cache
def cortex_library() -> ctypes.CDLL:
    """The loaded library. Raises `CortexLibraryError` if it was not built."""
    library = load_library("taxel_cortex_m0", "the compiled Cortex-M0", CortexLibraryError)
    handle, word, long = ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint64
    signatures = {
        "open": (handle, [word, word, ctypes.c_uint8, ctypes.c_uint8, ctypes.c_int]),
        "close": (None, [handle]),
        "load": (ctypes.c_int, [handle, word, ctypes.c_char_p, word]),
        "memory": (ctypes.c_int, [handle, word, ctypes.c_char_p, word]),
        "reset": (None, [handle, word]),
        "run": (ctypes.c_int, [handle, long]),
        "step": (ctypes.c_int, [handle]),
        "instructions": (long, [handle, long]),
        "set_line": (None, [handle, ctypes.c_uint, ctypes.c_int]),
        "skip": (None, [handle]),
        "cycle": (long, [handle]),
        "registers": (None, [handle, handle]),
        "set_registers": (None, [handle, handle]),
        "cases": (None, [handle, handle, word]),
        "account": (None, [handle, ctypes.c_int]),
        "cost": (None, [handle, ctypes.c_uint, handle]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, f"taxel_cortex_m0_{name}")
        function.restype, function.argtypes = result, arguments
    return library


class BareCpu:
    """A processor with flash at 0 and RAM at 0x20000000 (bytes, multiples of 4). Use it as a context manager.

    It halts at breakpoints, and, if `halt_on_fault`, at instructions that fault. Raises `CortexLibraryError`.
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
        self._library = cortex_library()
        halts = 1 | (2 if halt_on_fault else 0)
        self._handle = self._library.taxel_cortex_m0_open(flash_size, ram_size, flash_wait, multiply, halts)
        if not self._handle:
            raise CortexLibraryError(f"sizes of memory: expected multiples of 4, found {flash_size} and {ram_size}")

    def load(self, address: int, data: bytes) -> None:
        """Into flash or RAM. Raises `ValueError` if it does not lie in one of them."""
        if self._library.taxel_cortex_m0_load(self._handle, address, data, len(data)):
            raise ValueError(f"expected {len(data)} bytes of flash or RAM at 0x{address:08X}, found neither")

    def memory(self, address: int, size: int) -> bytes:
        """Of flash or RAM. Raises `ValueError` if it does not lie in one of them."""
        buffer = ctypes.create_string_buffer(size)
        if self._library.taxel_cortex_m0_memory(self._handle, address, buffer, size):
            raise ValueError(f"expected {size} bytes of flash or RAM at 0x{address:08X}, found neither")
        return buffer.raw

    def reset(self, vectors: int = 0) -> None:
        """Begin at the vector table there."""
        self._library.taxel_cortex_m0_reset(self._handle, vectors)

    def run(self, until: int) -> Reason:
        """Run until that cycle, or until something stops it."""
        return Reason(self._library.taxel_cortex_m0_run(self._handle, until))

    def step(self) -> Reason:
        """One instruction, or the entry of an exception."""
        return Reason(self._library.taxel_cortex_m0_step(self._handle))

    def instructions(self, until: int) -> int:
        """Run in steps until that cycle or until something stops it: how many."""
        return int(self._library.taxel_cortex_m0_instructions(self._handle, until))

    def set_line(self, irq: int, high: bool) -> None:
        """The level of an interrupt input."""
        self._library.taxel_cortex_m0_set_line(self._handle, irq, high)

    @property
    def cycle(self) -> int:
        """Cycles since it was made."""
        return int(self._library.taxel_cortex_m0_cycle(self._handle))

    @property
    def state(self) -> NDArray[np.void]:
        """STATE[1]: its registers. Setting it leaves every exception."""
        state = np.zeros(1, STATE)
        self._library.taxel_cortex_m0_registers(self._handle, state.ctypes.data)
        return state

    @state.setter
    def state(self, state: NDArray[np.void]) -> None:
        self._library.taxel_cortex_m0_set_registers(self._handle, np.ascontiguousarray(state).ctypes.data)

    def skip(self) -> None:
        """Over the breakpoint at which it stands."""
        self._library.taxel_cortex_m0_skip(self._handle)

    def describe_fault(self) -> str:
        """The latest fault, in a few words."""
        state = self.state[0]
        return f"{Fault(int(state['fault'])).name} fault, r15 0x{state['r'][15]:08X}"

    def run_cases(self, states: NDArray[np.void]) -> None:
        """STATE[n]: from each, one instruction; they become the states after it."""
        self._library.taxel_cortex_m0_cases(self._handle, states.ctypes.data, len(states))

    def account(self, on: bool) -> None:
        """Begin to account for handlers, or end."""
        self._library.taxel_cortex_m0_account(self._handle, on)

    def cost(self, exception: int) -> Cost:
        """What that exception's handler has cost."""
        values = (ctypes.c_uint64 * len(fields(Cost)))()
        self._library.taxel_cortex_m0_cost(self._handle, exception, ctypes.addressof(values))
        return Cost(*values)

    def close(self) -> None:
        """Give its memory back."""
        if self._handle:
            self._library.taxel_cortex_m0_close(self._handle)
            self._handle = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()
