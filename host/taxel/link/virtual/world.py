"""An emulated world inside this process (firmware/emulator/bench.h), moved on by its caller."""

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
from taxel.link.virtual.processor import EXCEPTIONS, CostStruct, HandlerCost, Processor, ProcessorStruct
from taxel.native_library import emulator_message, load_library, redirected_stderr

PS_PER_S: Final = 10**12
RECEIVE_SIZE: Final = 1 << 16
FLASH_SIZE: Final = 32768
FLASH_ROWS: Final = 256
FLASH_ROW: Final = 128
RUNS: Final[tuple[Literal["application", "bootloader", "hanging image"], ...]] = (
    "application",
    "bootloader",
    "hanging image",
)
PATIENCE_S: Final = 1.0
"""How long a transfer of the bench's own adapter may take: Linux gives up after a second too."""

_REFUSALS: Final = {
    -1: "is no fault that the emulator knows (firmware/emulator/README.md lists them)",
    -2: "strikes a board that this world does not have",
    -3: "is one too many: 64 wait for their byte already",
}


class FaultError(LinkError):
    """A fault that cannot be injected."""


class _LibraryMissingError(TaxelError):
    """The compiled library is not there."""


class Strike(NamedTuple):
    """Something that went wrong: the time in world seconds, the fault's number in the emulator, the board (0: none)."""

    time_s: float
    kind: int
    address: int


class BoardFlash(NamedTuple):
    """A board's flash: its 32 KiB, writes of each of its 256 rows, writes that a power cut has torn, what runs."""

    data: bytes
    wear: NDArray[np.uint32]
    torn: int
    runs: Literal["application", "bootloader", "hanging image"]


class PowerCut(NamedTuple):
    """What a planned power cut has struck: a row, how long after its write had begun, and its 128 bytes to be."""

    row: int
    after_s: float
    wanted: bytes


class _Strike(ctypes.Structure):
    _fields_ = (("time", ctypes.c_uint64), ("kind", ctypes.c_uint32), ("address", ctypes.c_uint32))


@cache
def _library() -> ctypes.CDLL:
    library = load_library("taxel_bench", "the compiled emulator library", _LibraryMissingError)
    pointer, size, byte, text = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_uint8, ctypes.c_char_p
    time, number, whole = ctypes.c_uint64, ctypes.c_double, ctypes.c_int
    for name, result, *arguments in (
        ("open", pointer, text, text, whole),
        ("close", None, pointer),
        ("pty_name", text, pointer),
        ("taxel_count", size, pointer),
        ("now", time, pointer),
        ("run", whole, pointer, time),
        ("send", size, pointer, text, size),
        ("receive", size, pointer, text, size),
        ("bytes_delivered", time, pointer),
        ("has_flow_control", whole, pointer),
        ("set_stimulus", whole, pointer, pointer),
        ("inject_fault", whole, pointer, text, byte, number, number),
        ("transfer_i2c", whole, pointer, byte, text, size, text, size, time),
        ("read_fault_log", size, pointer, time, ctypes.POINTER(_Strike), size, ctypes.POINTER(time)),
        ("flash_bytes", pointer, pointer, byte),
        ("flash_wear", pointer, pointer, byte),
        ("torn_writes", time, pointer, byte),
        ("running_program", whole, pointer, byte),
        ("read_processor", whole, pointer, byte, ctypes.POINTER(ProcessorStruct)),
        ("read_handler_cost", whole, pointer, byte, ctypes.c_uint, ctypes.POINTER(CostStruct)),
        ("plan_power_cut", whole, pointer, byte, time, time, time),
        ("power_cut_count", time, pointer, byte),
        ("read_power_cut", whole, pointer, byte, time, ctypes.POINTER(ctypes.c_uint16), ctypes.POINTER(time), text),
        ("write_statistics", whole, pointer, text),
    ):
        function = getattr(library, f"taxel_bench_{name}")
        function.restype, function.argtypes = result, arguments
    return library


class VirtualWorld:
    """A hub, its boards, their bus, UART and skin, in virtual time that only `run` and `transfer` move on.

    world: the text of a world file. uart: where the hub's UART ends: `memory` (`send` and `receive`), `pty` (whoever
    opens `pty_name`) or `none`. counts: `press` gives raw counts instead of newtons. files: images, by the name that
    the world file's lines `image` and `hub_image` have for them. Use it as a context manager. Raises `LinkError` with
    the emulator's own line if it refuses the world.
    """

    def __init__(
        self,
        world: str,
        uart: Literal["memory", "pty", "none"] = "memory",
        *,
        counts: bool = False,
        files: Mapping[str, Path] | None = None,
    ) -> None:
        self._library = _library()
        self._handle: int | None = self._open(world, uart, counts, files or {})
        self.taxels = int(self._library.taxel_bench_taxel_count(self._handle))
        self.pty_name = str(self._library.taxel_bench_pty_name(self._handle).decode())
        self._buffer = ctypes.create_string_buffer(RECEIVE_SIZE)

    def _open(self, world: str, uart: str, counts: bool, files: Mapping[str, Path]) -> int:
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
        if self._handle is None:
            raise LinkError("virtual rig", "is closed")
        return self._handle

    @property
    def now_s(self) -> float:
        """Seconds since the world began."""
        return int(self._library.taxel_bench_now(self._open_handle)) / PS_PER_S

    def run(self, seconds: float) -> None:
        """Let the world go on for so long."""
        until = int(self._library.taxel_bench_now(self._open_handle)) + round(seconds * PS_PER_S)
        if self._library.taxel_bench_run(self._open_handle, until):
            raise LinkError("virtual rig", "has come to an end (see the emulator's line on standard error)")

    def send(self, data: bytes) -> int:
        """Bytes from the host on their way to the hub; how many were taken."""
        return int(self._library.taxel_bench_send(self._open_handle, data, len(data)))

    def receive(self) -> bytes:
        """What has arrived at the host, up to 64 KiB."""
        size = self._library.taxel_bench_receive(self._open_handle, self._buffer, RECEIVE_SIZE)
        return ctypes.string_at(self._buffer, size)  # `raw` would copy all of it

    @property
    def delivered(self) -> int:
        """Bytes that have arrived at the host so far."""
        return int(self._library.taxel_bench_bytes_delivered(self._open_handle))

    @property
    def holds_back(self) -> bool:
        """Whether the hub makes the host wait before its receive ring is full (`flow_control 1` in the world file)."""
        return bool(self._library.taxel_bench_has_flow_control(self._open_handle))

    def press(self, values: ArrayLike) -> None:
        """[n] newtons (or raw counts) on the taxels from now on, in the order of the world's boards."""
        table = np.ascontiguousarray(values, dtype=np.float32)
        if table.shape != (self.taxels,):
            raise ValueError(f"expected {self.taxels} values, found an array of shape {table.shape}")
        if self._library.taxel_bench_set_stimulus(self._open_handle, table.ctypes.data):
            raise ValueError("expected finite values of at least 0")

    def inject(self, name: str, address: int = 0, value: float = 0.0, second: float = 0.0) -> None:
        """Let `name` go wrong now: a fault of firmware/emulator/README.md. Raises `FaultError`."""
        refusal = self._library.taxel_bench_inject_fault(self._open_handle, name.encode(), address, value, second)
        if refusal:
            raise FaultError("virtual rig", f"fault '{name}' (address 0x{address:02X}) {_REFUSALS[refusal]}")

    def transfer(self, address: int, write: bytes, read_size: int, patience_s: float = PATIENCE_S) -> tuple[int, bytes]:
        """A transfer by the bench's own adapter: the result (enum taxel_i2c_result, 0 is good) and what was read."""
        buffer = ctypes.create_string_buffer(max(read_size, 1))
        patience = round(patience_s * PS_PER_S)
        result = self._library.taxel_bench_transfer_i2c(
            self._open_handle, address, write, len(write), buffer, read_size, patience
        )
        return int(result), buffer.raw[:read_size]

    def strikes(self, first: int = 0) -> list[Strike]:
        """What has gone wrong, from the `first` one on. Raises `LinkError` if some of it has been forgotten (4,096)."""
        table, lost = (_Strike * 4096)(), ctypes.c_uint64()
        count = self._library.taxel_bench_read_fault_log(
            self._open_handle, first, table, len(table), ctypes.byref(lost)
        )
        if lost.value:
            raise LinkError("virtual rig", f"has forgotten {lost.value} of its faults; ask more often")
        return [Strike(one.time / PS_PER_S, one.kind, one.address) for one in table[:count]]

    def board_flash(self, address: int) -> BoardFlash:
        """The flash of a board, or of the hub (address 0), as it is now; `address` is that of the world file.

        Raises `FaultError` for no board.
        """
        handle = self._open_handle
        runs = int(self._library.taxel_bench_running_program(handle, address))
        if runs < 0:
            raise FaultError("virtual rig", f"board 0x{address:02X} is none of this world's")
        data = ctypes.string_at(self._library.taxel_bench_flash_bytes(handle, address), FLASH_SIZE)
        wear = np.frombuffer(
            ctypes.string_at(self._library.taxel_bench_flash_wear(handle, address), 4 * FLASH_ROWS), "<u4"
        )
        return BoardFlash(data, wear, int(self._library.taxel_bench_torn_writes(handle, address)), RUNS[runs])

    def processor(self, address: int) -> Processor:
        """Of an executed board, or of an executed hub (address 0). Raises `FaultError` where no image is executed."""
        struct = ProcessorStruct()
        if self._library.taxel_bench_read_processor(self._open_handle, address, ctypes.byref(struct)):
            raise FaultError("virtual rig", f"no image is executed at address 0x{address:02X}")
        return struct.read()

    def handler_costs(self, address: int) -> dict[str, HandlerCost]:
        """Cycles of its exceptions' handlers since its first power-up. Raises `FaultError` as above."""
        costs = {}
        for name, number in EXCEPTIONS.items():
            struct = CostStruct()
            if self._library.taxel_bench_read_handler_cost(self._open_handle, address, number, ctypes.byref(struct)):
                raise FaultError("virtual rig", f"no image is executed at address 0x{address:02X}")
            costs[name] = struct.read()
        return costs

    def plan_cut(self, address: int, operation: int, after_s: float, off_s: float) -> None:
        """Cut the power of a board or the hub (0) `after_s` into a write to its flash, for `off_s`.

        operation: the next write is 1; if cuts wait already, the next after the last of them. after_s: 0 is before it,
        0.02 its end. Raises `FaultError`.
        """
        after, off = round(after_s * PS_PER_S), round(off_s * PS_PER_S)
        refusal = self._library.taxel_bench_plan_power_cut(self._open_handle, address, operation, after, off)
        if refusal:
            raise FaultError("virtual rig", f"a power cut of address 0x{address:02X} {_REFUSALS[refusal]}")

    def cut_count(self, address: int) -> int:
        """How many planned power cuts of a board or the hub have been made."""
        return int(self._library.taxel_bench_power_cut_count(self._open_handle, address))

    def cuts(self, address: int, first: int = 0) -> list[PowerCut]:
        """Planned power cuts that were made, from the `first` on; the latest eight are remembered."""
        handle = self._open_handle
        row, after, wanted = ctypes.c_uint16(), ctypes.c_uint64(), ctypes.create_string_buffer(FLASH_ROW)
        made: list[PowerCut] = []
        for number in range(first, self.cut_count(address)):
            if self._library.taxel_bench_read_power_cut(
                handle, address, number, ctypes.byref(row), ctypes.byref(after), wanted
            ):
                raise LinkError("virtual rig", f"has forgotten power cut {number}; ask more often")
            made.append(PowerCut(row.value, after.value / PS_PER_S, wanted.raw))
        return made

    def statistics(self) -> dict[str, Any]:
        """What the emulator has counted so far."""
        with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
            path = Path(folder) / "statistics.json"
            self._library.taxel_bench_write_statistics(self._open_handle, os.fsencode(path))
            counted: dict[str, Any] = json.loads(path.read_text())
            return counted

    def close(self) -> None:
        """End the world. May be called twice."""
        if self._handle is not None:
            self._library.taxel_bench_close(self._handle)
            self._handle = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
