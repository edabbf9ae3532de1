"""Unicorn as the reference for single instructions, called through its C interface with ctypes for speed.

UC_MODE_MCLASS must not be set: with this mode Unicorn 2.1 emulates a Cortex-M33 regardless of the selected model.
"""

import ctypes
import importlib
from enum import IntEnum
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
from bare_cpu import RAM_BASE, STATE
from numpy.typing import NDArray

FLASH_SIZE, RAM_SIZE = 0x20000, 0x4000
SLOT = 8
"""Bytes of code memory per case: an instruction of up to 4 bytes and the instruction after it."""

INTERRUPT_SVC, INTERRUPT_DATA_ABORT, INTERRUPT_BREAKPOINT = 2, 4, 7
NO_INTERRUPT = -1


class Verdict(IntEnum):
    """Result of an instruction."""

    DONE = 0
    UNDEFINED = 1
    UNALIGNED = 2
    BUS = 3
    SVC = 4
    BREAKPOINT = 5


class UnicornMissingError(Exception):
    """Unicorn is not installed or not usable; the message is one line."""


class _Constants(NamedTuple):
    """Constants of Unicorn and of its Arm processors, and its C library."""

    unicorn: Any
    arm: Any
    library: ctypes.CDLL


def _load_unicorn() -> _Constants:
    """Load the constants and library of the package unicorn.

    Raises `UnicornMissingError` with the installation command.
    """
    try:
        package = importlib.import_module("unicorn")
        unicorn = importlib.import_module("unicorn.unicorn_const")
        arm = importlib.import_module("unicorn.arm_const")
    except ImportError:
        raise UnicornMissingError("unicorn is not installed: pip install unicorn==2.1.4") from None
    folder = Path(str(package.__file__)).parent / "lib"
    libraries = sorted(folder.glob("libunicorn.so*"))
    if not libraries:
        raise UnicornMissingError(f"no libunicorn.so in {folder.name} of the package unicorn")
    return _Constants(unicorn, arm, ctypes.CDLL(str(libraries[0])))


class UnicornOracle:
    """Cortex-M0 in Unicorn with the memory of `bare_cpu.BareCpu()`. Raises `UnicornMissingError`."""

    def __init__(self) -> None:
        """Create a Cortex-M0 in the emulator Unicorn with the same flash and RAM as `BareCpu`.

        Raises `UnicornMissingError` if Unicorn is not installed.
        """
        self._u, self._arm, self._library = _load_unicorn()
        self._handle = ctypes.c_void_p()
        self._call("open", self._u.UC_ARCH_ARM, self._u.UC_MODE_THUMB, ctypes.byref(self._handle), handle=False)
        self._set_control(self._u.UC_CTL_CPU_MODEL, self._arm.UC_CPU_ARM_CORTEX_M0)
        self._map(0, FLASH_SIZE, self._u.UC_PROT_READ | self._u.UC_PROT_EXEC)
        self._map(RAM_BASE, RAM_SIZE, self._u.UC_PROT_ALL)
        self._interrupt = NO_INTERRUPT
        self._hook_interrupts()
        self._prepare_batches()

    def _call(self, name: str, *arguments: Any, handle: bool = True) -> int:
        """Call the C function uc_`name` of Unicorn. Raises `UnicornMissingError` if the function returns an error.

        handle: whether the first argument is the handle of the emulator.
        """
        function = getattr(self._library, f"uc_{name}")
        result = int(function(self._handle, *arguments) if handle else function(*arguments))
        if result:
            raise UnicornMissingError(f"uc_{name} failed with error {result}")
        return result

    def _set_control(self, kind: int, *values: int) -> None:
        """Set a property of the emulator by uc_ctl(), as the macro UC_CTL_WRITE in unicorn.h does. kind: number of
        the property.
        """
        request = ctypes.c_uint32(kind | len(values) << 26 | 1 << 30)  # from bit 26: number of values; bit 30: write
        self._call("ctl", request, *(ctypes.c_int(value) for value in values))

    def _map(self, address: int, size: int, rights: int) -> None:
        self._call("mem_map", ctypes.c_uint64(address), ctypes.c_uint64(size), ctypes.c_uint32(rights))

    def _hook_interrupts(self) -> None:
        """Stop the emulation at each exception of the program and store the number of the exception."""

        def on_interrupt(_: int, number: int, __: int) -> None:
            """Store the exception number and stop the emulation; called by Unicorn."""
            self._interrupt = number
            self._library.uc_emu_stop(self._handle)

        kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_void_p)
        self._callback, hook = kind(on_interrupt), ctypes.c_size_t()
        begin, end = ctypes.c_uint64(1), ctypes.c_uint64(0)  # begin > end: all addresses
        self._call("hook_add", ctypes.byref(hook), self._u.UC_HOOK_INTR, self._callback, None, begin, end)

    def _prepare_batches(self) -> None:
        """Prepare the arguments of the calls that write and read all registers of `_state` at once.

        `_special_batch` is written before `_write_batch`, because CONTROL selects the stack pointer that SP denotes.
        """
        arm = self._arm
        registers = [arm.UC_ARM_REG_R0 + i for i in range(13)] + [arm.UC_ARM_REG_SP, arm.UC_ARM_REG_LR]
        self._state = np.zeros(1, STATE)
        words = self._state.view("<u4")
        word_indices = [*range(15), self._get_word_index("xpsr")]
        self._write_batch = self._make_batch([*registers, arm.UC_ARM_REG_XPSR], word_indices, words)
        before = [(arm.UC_ARM_REG_CONTROL, "control"), (arm.UC_ARM_REG_PSP, "psp"), (arm.UC_ARM_REG_PRIMASK, "primask")]
        self._special_batch = self._make_batch(
            [number for number, _ in before], [self._get_word_index(name) for _, name in before], words
        )
        everything = [*registers, arm.UC_ARM_REG_PC, arm.UC_ARM_REG_XPSR, arm.UC_ARM_REG_MSP, arm.UC_ARM_REG_PSP]
        everything += [arm.UC_ARM_REG_PRIMASK, arm.UC_ARM_REG_CONTROL]
        word_indices = [
            *range(16),
            *(self._get_word_index(name) for name in ("xpsr", "msp", "psp", "primask", "control")),
        ]
        self._read_batch = self._make_batch(everything, word_indices, words)

    @staticmethod
    def _get_word_index(name: str) -> int:
        """Return the index of a field of `STATE`, such as "xpsr", in the state's array of 32-bit words."""
        assert STATE.fields is not None
        return int(STATE.fields[name][1]) // 4

    @staticmethod
    def _make_batch(registers: list[int], word_indices: list[int], words: NDArray[np.uint32]) -> tuple[Any, Any, int]:
        """Create the arguments of a Unicorn function that transfers several registers in one call.

        registers: register numbers of Unicorn. word_indices: index of each register's value in `words`. Returns the
        array of register numbers, the array of pointers to the values, and their count.
        """
        numbers = (ctypes.c_int * len(registers))(*registers)
        pointers = (ctypes.c_void_p * len(registers))(
            *(words.ctypes.data + 4 * word_index for word_index in word_indices)
        )
        return numbers, pointers, len(registers)

    def write_memory(self, address: int, data: bytes) -> None:
        """Write flash or RAM and discard the translated code."""
        self._call("mem_write", ctypes.c_uint64(address), data, ctypes.c_uint64(len(data)))
        self._set_control(self._u.UC_CTL_TB_FLUSH)

    def read_memory(self, address: int, size: int) -> bytes:
        """Read flash or RAM."""
        buffer = ctypes.create_string_buffer(size)
        self._call("mem_read", ctypes.c_uint64(address), buffer, ctypes.c_uint64(size))
        return buffer.raw

    def run_case(self, state: NDArray[np.void], size: int) -> Verdict:
        """Execute one instruction of `size` bytes from STATE[1] `state` and replace `state` by the result.

        The instruction is at the address in r[15], the program counter. Bit 0 of the start address selects Thumb code.
        """
        self._state[:] = state
        begin = int(state["r"][0, 15])
        self._library.uc_reg_write_batch(self._handle, *self._special_batch)
        self._library.uc_reg_write_batch(self._handle, *self._write_batch)
        self._interrupt = NO_INTERRUPT
        limit = ctypes.c_uint64(begin + size)
        error = self._library.uc_emu_start(
            self._handle, ctypes.c_uint64(begin | 1), limit, ctypes.c_uint64(0), ctypes.c_size_t(1)
        )
        self._library.uc_reg_read_batch(self._handle, *self._read_batch)
        state[:] = self._state
        return self._classify(int(error), begin, state)

    def _classify(self, error: int, begin: int, state: NDArray[np.void]) -> Verdict:
        """Return the verdict on one instruction.

        error: Unicorn's error code. begin: address of the instruction. state: registers afterwards.
        """
        u, moved = self._u, int(state["r"][0, 15]) != begin
        if self._interrupt != NO_INTERRUPT:
            verdicts = {
                INTERRUPT_SVC: Verdict.SVC,
                INTERRUPT_DATA_ABORT: Verdict.UNALIGNED,
                INTERRUPT_BREAKPOINT: Verdict.BREAKPOINT,
            }
            return verdicts[self._interrupt]
        if error in (u.UC_ERR_READ_UNMAPPED, u.UC_ERR_WRITE_UNMAPPED, u.UC_ERR_WRITE_PROT):
            return Verdict.BUS
        if error == u.UC_ERR_INSN_INVALID and not moved:
            return Verdict.UNDEFINED
        return Verdict.DONE  # the fetch after a branch may have failed, which is not part of this instruction

    def close(self) -> None:
        """Free the emulator Unicorn."""
        if self._handle:
            self._library.uc_close(self._handle)
            self._handle = ctypes.c_void_p()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Free the emulated processor."""
        self.close()
