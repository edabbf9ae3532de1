"""An emulated chip alone with an image in its flash (firmware/emulator/psoc4/single_part.h), in virtual time."""

import ctypes
from dataclasses import asdict, dataclass, fields
from functools import cache
from pathlib import Path
from typing import Final

from taxel.errors import TaxelError
from taxel.input_files.regular_file import read_regular_file
from taxel.native_library import load_library
from taxel_tools.files.intel_hex import FLASH_SIZE, read_intel_hex_rows

SLICE_S: Final = 0.001
BUFFER: Final = 4096
IMAGE_SIZE_MAX: Final = 1 << 20
ROW_SIZE: Final = 128


class EmulatedPartError(TaxelError):
    """The emulated part cannot be created."""


@dataclass(frozen=True)
class PartSettings:
    """Properties of the emulated part and its board, with faults; the defaults are those that the firmware assumes.

    clock_rate: actual divided by nominal frequency. capacitance_pf: known capacitor. capacitors: integration capacitors
    of the board, 0, 1 (P4.2) or 2 (P3.6 and P3.7). idac_gain: actual divided by nominal current. 1 for a fault of the
    board: scl_stuck, sda_stuck, no_pull_ups; rx_open: the chip receives no byte. irq_..., clock_...: deviating numbers,
    0 for none. 1 for a fault of the part: keeps_no_ram, writes_no_flash, has_no_ilo.
    """

    clock_rate: float = 1.0
    capacitance_pf: float = 2.2
    capacitors: float = 1
    idac_gain: float = 1.0
    scl_stuck: float = 0
    sda_stuck: float = 0
    rx_open: float = 0
    no_pull_ups: float = 0
    irq_scb0: float = 0
    irq_scb1: float = 0
    irq_csd: float = 0
    clock_scb1: float = 0
    clock_csd_sense: float = 0
    clock_csd_sample: float = 0
    keeps_no_ram: float = 0
    writes_no_flash: float = 0
    has_no_ilo: float = 0


class _Settings(ctypes.Structure):
    """C structure `struct single_part_settings`."""

    _fields_ = [(field.name, ctypes.c_double) for field in fields(PartSettings)]


@cache
def _load_library() -> ctypes.CDLL:
    """Load the emulator library and set the signatures of single_part.h."""
    library = load_library("taxel_bench", "the compiled emulator library", EmulatedPartError)
    pointer, size, text, number = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p, ctypes.c_double
    for name, result, *arguments in (
        ("new", pointer, text, size, ctypes.POINTER(_Settings)),
        ("free", None, pointer),
        ("run", None, pointer, number),
        ("put", size, pointer, text, size),
        ("take", size, pointer, text, size),
        ("measure_clock_pin", number, pointer),
    ):
        function = getattr(library, f"single_part_{name}")
        function.restype, function.argtypes = result, arguments
    return library


def read_flash(path: Path) -> bytes:
    """Read the flash content of an Intel HEX file. Raises `FirmwareFileError` and `FileError`."""
    flash = bytearray(FLASH_SIZE)
    text = read_regular_file(path, IMAGE_SIZE_MAX).decode("ascii", errors="replace")
    for row, (content, _) in read_intel_hex_rows(text, str(path)).items():
        flash[row * ROW_SIZE : (row + 1) * ROW_SIZE] = content
    return bytes(flash)


class EmulatedPart:
    """An emulated chip as a byte port; its time advances only in `read`. Raises `EmulatedPartError`."""

    name = "emulated part"

    def __init__(self, flash: bytes, settings: PartSettings) -> None:
        """Power on a chip. flash: content of the flash. settings: properties and faults of the chip and its board."""
        self._library = _load_library()
        self._handle = self._library.single_part_new(flash, len(flash), ctypes.byref(_Settings(**asdict(settings))))
        if not self._handle:
            raise EmulatedPartError("emulated part: not enough memory")
        self._time_s = 0.0

    def now_s(self) -> float:
        """Return the virtual time in seconds since power-on."""
        return self._time_s

    def write(self, data: bytes) -> None:
        """Send bytes to the UART of the chip."""
        self._library.single_part_put(self._handle, data, len(data))

    def read(self, timeout_s: float) -> bytes:
        """Let virtual time pass until bytes arrive from the UART, at most `timeout_s`; b"" if none arrive."""
        buffer = ctypes.create_string_buffer(BUFFER)
        end = self._time_s + timeout_s
        while self._time_s < end:
            self._library.single_part_run(self._handle, SLICE_S)
            self._time_s += SLICE_S
            count = self._library.single_part_take(self._handle, buffer, BUFFER)
            if count:
                return buffer.raw[:count]
        return b""

    def measure_clock_pin(self, seconds: float = 0.5) -> float:
        """Measure the frequency of the clock pin P1.7 over a time, in Hz; 0 if the pin does not change."""
        self._library.single_part_measure_clock_pin(self._handle)  # resets the counter of edges
        self.read(seconds)
        return float(self._library.single_part_measure_clock_pin(self._handle))

    def close(self) -> None:
        """Release the memory of the chip."""
        if self._handle:
            self._library.single_part_free(self._handle)
            self._handle = None
