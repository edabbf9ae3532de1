"""An emulated world in this process (firmware/emulator/bench.h), whose virtual time the caller advances."""

import ctypes
import json
import os
import shutil
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel.errors import TaxelError
from taxel.link.errors import LinkError
from taxel.link.virtual.processor import CostStruct, HandlerCost, Processor, ProcessorStruct
from taxel.native_library import emulator_message, load_library, redirected_stderr

PS_PER_S: Final = 10**12
RECEIVE_SIZE: Final = 1 << 16
FLASH_ROW: Final = 128
RUNS: Final[tuple[Literal["application", "bootloader", "hanging image"], ...]] = (
    "application",
    "bootloader",
    "hanging image",
)
TRANSFER_TIMEOUT_S: Final = 1.0
"""Timeout of a transfer of the bench's I2C adapter, seconds of virtual time: that of Linux."""

PLANNED_CUTS_MAX: Final = 8
"""Largest number of planned power cuts of one processor: FLASH_CUTS_MAX of the emulator."""

_REFUSALS: Final = {
    -1: "is not a fault of the emulator (firmware/emulator/README.md lists the faults)",
    -2: "strikes a board that this world does not have",
    -3: "exceeds the limit of 64 pending faults",
    -4: "strikes a board without a branch of the wiring, or selects a line that the fault does not have",
}
"""Messages for the return codes of `taxel_bench_inject_fault` and `taxel_bench_plan_power_cut`."""


class FaultError(LinkError):
    """Error: a fault cannot be injected into the virtual world, or an address has no board or executed image."""


class _LibraryMissingError(TaxelError):
    """Error: the compiled emulator library is missing."""


class FaultEvent(NamedTuple):
    """A fault that has occurred in the virtual world.

    time_s: virtual time, seconds. kind: number of the fault type in the emulator. address: I2C address of the board; 0:
    no board.
    """

    time_s: float
    kind: int
    address: int


class BoardFlash(NamedTuple):
    """The flash memory of a board or of the hub.

    data: content of the flash, 32 KiB. wear: u32[256], number of writes of each row. torn: number of writes that a
    power cut interrupted. runs: the program that runs.
    """

    data: bytes
    wear: NDArray[np.uint32]
    torn: int
    runs: Literal["application", "bootloader", "hanging image"]


class PowerCut(NamedTuple):
    """A planned power cut that has occurred during a write to flash.

    row: row of the flash. after_s: time between the start of the write and the cut, seconds. new_data: the 128 bytes of
    the write.
    """

    row: int
    after_s: float
    new_data: bytes


class _FaultEventStruct(ctypes.Structure):
    """C structure of a fault event in the emulator library."""

    _fields_ = (("time", ctypes.c_uint64), ("kind", ctypes.c_uint32), ("address", ctypes.c_uint32))


@cache
def _load_library() -> ctypes.CDLL:
    """Load the compiled emulator library, declare the functions of firmware/emulator/bench.h, and return it.

    Raises `_LibraryMissingError`, a TaxelError, if the library is missing.
    """
    library = load_library("taxel_bench", "the compiled emulator library", _LibraryMissingError)
    pointer, size, byte, text = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_uint8, ctypes.c_char_p
    time, number, integer = ctypes.c_uint64, ctypes.c_double, ctypes.c_int
    for name, result, *arguments in (
        ("open", pointer, text, text, integer),
        ("close", None, pointer),
        ("pty_name", text, pointer),
        ("taxel_count", size, pointer),
        ("now", time, pointer),
        ("run", integer, pointer, time),
        ("send", size, pointer, text, size),
        ("receive", size, pointer, text, size),
        ("bytes_delivered", time, pointer),
        ("has_flow_control", integer, pointer),
        ("set_stimulus", integer, pointer, pointer),
        ("inject_fault", integer, pointer, text, byte, number, number),
        ("transfer_i2c", integer, pointer, byte, text, size, text, size, time),
        ("recover_bus", None, pointer),
        ("read_fault_log", size, pointer, time, ctypes.POINTER(_FaultEventStruct), size, ctypes.POINTER(time)),
        ("flash_size", ctypes.c_uint32, pointer, byte),
        ("flash_bytes", pointer, pointer, byte),
        ("flash_wear", pointer, pointer, byte),
        ("torn_writes", time, pointer, byte),
        ("running_program", integer, pointer, byte),
        ("read_processor", integer, pointer, byte, ctypes.POINTER(ProcessorStruct)),
        ("read_handler_cost", integer, pointer, byte, ctypes.c_uint, ctypes.POINTER(CostStruct)),
        ("plan_power_cut", integer, pointer, byte, time, time, time),
        ("power_cut_count", time, pointer, byte),
        ("read_power_cut", integer, pointer, byte, time, ctypes.POINTER(ctypes.c_uint16), ctypes.POINTER(time), text),
        ("write_statistics", integer, pointer, text),
    ):
        function = getattr(library, f"taxel_bench_{name}")
        function.restype, function.argtypes = result, arguments
    return library


class VirtualWorld:
    """A hub with its boards, bus, UART and skin in virtual time, which only `run` and `transfer` advance.

    The UART of the hub is connected to memory (`send` and `receive`), to a pseudo-terminal (`pty_name`), or not at all.
    A context manager.
    """

    def __init__(
        self,
        world: str,
        uart: Literal["memory", "pty", "none"] = "memory",
        *,
        counts: bool = False,
        files: Mapping[str, Path] | None = None,
    ) -> None:
        """Create a virtual hub with its boards, bus, UART and skin, at virtual time 0.

        world: content of a world file. uart: connection of the hub's UART: "memory", "pty" (pseudo-terminal) or "none".
        counts: whether the values of `set_stimulus` are raw counts instead of newtons. files: paths of firmware images,
        by their names in the lines `image` and `hub_image` of the world file. Raises LinkError with the emulator's
        message if the emulator rejects the world.
        """
        self._library = _load_library()
        self._handle: int | None = self._open(world, uart, counts, files or {})
        self.taxels = int(self._library.taxel_bench_taxel_count(self._handle))
        self.pty_name = str(self._library.taxel_bench_pty_name(self._handle).decode())
        self._buffer = ctypes.create_string_buffer(RECEIVE_SIZE)

    def _open(self, world: str, uart: str, counts: bool, files: Mapping[str, Path]) -> int:
        """Create a virtual world in the C library and return its handle; arguments as for the constructor.

        Raises `LinkError` with the emulator's message if the emulator rejects the world.
        """
        with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
            path, complaint = Path(folder) / "world.txt", Path(folder) / "stderr.txt"
            path.write_text(world)
            for name, source in files.items():
                shutil.copyfile(source, Path(folder) / name)
            with redirected_stderr(complaint):
                handle = self._library.taxel_bench_open(os.fsencode(path), uart.encode(), int(counts))
            if not handle:
                message = emulator_message(complaint.read_text(errors="replace"), str(path), world)
                raise LinkError("virtual rig", message)
            return int(handle)

    @property
    def _open_handle(self) -> int:
        """Handle of the virtual world in the C library. Raises `LinkError` after `close`."""
        if self._handle is None:
            raise LinkError("virtual rig", "is closed")
        return self._handle

    @property
    def now_s(self) -> float:
        """Present virtual time, seconds since the start of the world."""
        return int(self._library.taxel_bench_now(self._open_handle)) / PS_PER_S

    def run(self, seconds: float) -> None:
        """Advance the virtual world by `seconds` of virtual time. Raises `LinkError` if the emulation has failed."""
        until = int(self._library.taxel_bench_now(self._open_handle)) + round(seconds * PS_PER_S)
        if self._library.taxel_bench_run(self._open_handle, until):
            raise LinkError("virtual rig", "has ended (see the emulator's message on standard error)")

    def send(self, data: bytes) -> int:
        """Send bytes from the host to the virtual hub; return the number of accepted bytes."""
        return int(self._library.taxel_bench_send(self._open_handle, data, len(data)))

    def receive(self) -> bytes:
        """Return the bytes of the virtual hub that have arrived at the host, at most 64 KiB."""
        size = self._library.taxel_bench_receive(self._open_handle, self._buffer, RECEIVE_SIZE)
        return ctypes.string_at(self._buffer, size)  # `raw` would copy the whole buffer

    @property
    def delivered_bytes(self) -> int:
        """Number of bytes that have arrived at the host since the start of the world."""
        return int(self._library.taxel_bench_bytes_delivered(self._open_handle))

    @property
    def has_flow_control(self) -> bool:
        """True if the hub stops the host before its receive buffer is full (`flow_control 1` in the world file)."""
        return bool(self._library.taxel_bench_has_flow_control(self._open_handle))

    def set_stimulus(self, values: ArrayLike) -> None:
        """Apply `values` [n], newtons (or raw counts), to the taxels from now on, in the order of the world's boards.

        Raises ValueError for another shape and for values that are negative or not finite.
        """
        table = np.ascontiguousarray(values, dtype=np.float32)
        if table.shape != (self.taxels,):
            raise ValueError(f"expected {self.taxels} values, found an array of shape {table.shape}")
        if self._library.taxel_bench_set_stimulus(self._open_handle, table.ctypes.data):
            raise ValueError("expected finite values of at least 0")

    def inject(self, name: str, address: int = 0, value: float = 0.0, second: float = 0.0) -> None:
        """Inject the fault `name` of firmware/emulator/README.md at the present virtual time.

        address: I2C address of the board; 0: no board. value, second: first and second parameter of the fault. Raises
        `FaultError` for an unknown fault, a missing board, and too many pending faults.
        """
        refusal = self._library.taxel_bench_inject_fault(self._open_handle, name.encode(), address, value, second)
        if refusal:
            raise FaultError("virtual rig", f"fault '{name}' (address 0x{address:02X}) {_REFUSALS[refusal]}")

    def transfer(
        self, address: int, write: bytes, read_size: int, timeout_s: float = TRANSFER_TIMEOUT_S
    ) -> tuple[int, bytes]:
        """Perform one transfer on the emulated I2C bus: write the bytes `write`, then read `read_size` bytes.

        The master is an emulated I2C adapter, not the hub. Returns the result (enum taxel_i2c_result, 0: success) and
        the read bytes. timeout_s: time limit, seconds of virtual time.
        """
        buffer = ctypes.create_string_buffer(max(read_size, 1))
        timeout = round(timeout_s * PS_PER_S)
        result = self._library.taxel_bench_transfer_i2c(
            self._open_handle, address, write, len(write), buffer, read_size, timeout
        )
        return int(result), buffer.raw[:read_size]

    def recover_bus(self) -> None:
        """Free a bus whose SDA line a board holds low, as the driver of an adapter does.

        The adapter sends up to nine clock pulses and then a stop condition.
        """
        self._library.taxel_bench_recover_bus(self._open_handle)

    def read_faults(self, first: int = 0) -> list[FaultEvent]:
        """Return the faults that have occurred in the virtual world, beginning with number `first`.

        Raises `LinkError` if the emulator no longer stores these faults; the emulator stores the last 4,096.
        """
        table, lost = (_FaultEventStruct * 4096)(), ctypes.c_uint64()
        count = self._library.taxel_bench_read_fault_log(
            self._open_handle, first, table, len(table), ctypes.byref(lost)
        )
        if lost.value:
            raise LinkError("virtual rig", f"has discarded {lost.value} of its faults; read the faults more often")
        return [FaultEvent(event.time / PS_PER_S, event.kind, event.address) for event in table[:count]]

    def read_flash(self, address: int) -> BoardFlash:
        """Return the present flash memory of the board at `address` of the world file, or of the hub (address 0).

        Raises `FaultError` for an address without a board.
        """
        handle = self._open_handle
        runs = int(self._library.taxel_bench_running_program(handle, address))
        if runs < 0:
            raise FaultError("virtual rig", f"has no board 0x{address:02X}; use an address of the world file")
        size = int(self._library.taxel_bench_flash_size(handle, address))
        data = ctypes.string_at(self._library.taxel_bench_flash_bytes(handle, address), size)
        wear = np.frombuffer(
            ctypes.string_at(self._library.taxel_bench_flash_wear(handle, address), 4 * size // FLASH_ROW), "<u4"
        )
        return BoardFlash(data, wear, int(self._library.taxel_bench_torn_writes(handle, address)), RUNS[runs])

    def read_processor(self, address: int) -> Processor:
        """Return the state of the emulated processor of a board, or of the hub (address 0), that executes an image.

        Raises `FaultError` for a board or hub that does not execute a firmware image.
        """
        return self._read_processor_struct(address).read()

    def _read_processor_struct(self, address: int) -> ProcessorStruct:
        """Return the C structure of a processor. Raises `FaultError` if no image is executed there."""
        struct = ProcessorStruct()
        if self._library.taxel_bench_read_processor(self._open_handle, address, ctypes.byref(struct)):
            raise FaultError("virtual rig", f"no image is executed at address 0x{address:02X}")
        return struct

    def read_handler_costs(self, address: int) -> dict[str, HandlerCost]:
        """Return the clock cycles that each exception handler of a processor has used since its first power-up.

        The keys of the result are names of exceptions and interrupts. address: I2C address of a board, or 0 for the
        hub. Raises `FaultError` if no firmware image is executed there.
        """
        costs = {}
        for name, number in self._read_processor_struct(address).list_exceptions().items():
            struct = CostStruct()
            if self._library.taxel_bench_read_handler_cost(self._open_handle, address, number, ctypes.byref(struct)):
                raise FaultError("virtual rig", f"no image is executed at address 0x{address:02X}")
            costs[name] = struct.read()
        return costs

    def plan_power_cut(self, address: int, operation: int, after_s: float, off_s: float) -> None:
        """Plan a power cut of a board or of the hub (address 0) during a write to its flash.

        operation: number of the write, counted from 1 for the next write after the last planned cut. after_s: time
        after the start of the write, seconds; a write takes 0.02 s. off_s: duration of the cut, seconds. Raises
        `FaultError` for an address without a board and for too many planned cuts.
        """
        after, off = round(after_s * PS_PER_S), round(off_s * PS_PER_S)
        refusal = self._library.taxel_bench_plan_power_cut(self._open_handle, address, operation, after, off)
        if refusal:
            problem = (
                f"exceeds the limit of {PLANNED_CUTS_MAX} planned power cuts" if refusal == -3 else _REFUSALS[refusal]
            )
            raise FaultError("virtual rig", f"a power cut of address 0x{address:02X} {problem}")

    def count_power_cuts(self, address: int) -> int:
        """Return the number of planned power cuts of a board or of the hub (address 0) that have occurred."""
        return int(self._library.taxel_bench_power_cut_count(self._open_handle, address))

    def read_power_cuts(self, address: int, first: int = 0) -> list[PowerCut]:
        """Return the planned power cuts of a board or of the hub (address 0) that have occurred.

        first: number of the first returned cut, from 0. Raises `LinkError` if the emulator no longer stores these cuts;
        the emulator stores the last eight.
        """
        handle = self._open_handle
        row, after, new_data = ctypes.c_uint16(), ctypes.c_uint64(), ctypes.create_string_buffer(FLASH_ROW)
        power_cuts: list[PowerCut] = []
        for number in range(first, self.count_power_cuts(address)):
            if self._library.taxel_bench_read_power_cut(
                handle, address, number, ctypes.byref(row), ctypes.byref(after), new_data
            ):
                raise LinkError("virtual rig", f"has discarded power cut {number}; read the power cuts more often")
            power_cuts.append(PowerCut(row.value, after.value / PS_PER_S, new_data.raw))
        return power_cuts

    def statistics(self) -> dict[str, Any]:
        """Return the present counters of the emulator as a dictionary."""
        with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
            path = Path(folder) / "statistics.json"
            self._library.taxel_bench_write_statistics(self._open_handle, os.fsencode(path))
            counters: dict[str, Any] = json.loads(path.read_text())
            return counters

    def close(self) -> None:
        """Release the virtual world; a second call has no effect."""
        if self._handle is not None:
            self._library.taxel_bench_close(self._handle)
            self._handle = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Release the virtual world at the end of the `with` block."""
        self.close()
