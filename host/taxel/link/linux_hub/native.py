"""ctypes binding of the compiled hub of a Linux computer (firmware/linux_hub)."""

import ctypes
from collections.abc import Iterable
from functools import cache
from typing import Final

from taxel.errors import TaxelError
from taxel.native_library import load_library
from taxel.version import VERSION

UNIQUE_ID: Final = b"TAXELI2C"
"""Unique id in HUB_HANDSHAKE of a hub that is a Linux computer; hub boards send the id of their processor."""

TRANSFER_FUNCTION = ctypes.CFUNCTYPE(
    ctypes.c_int,
    ctypes.c_void_p,
    ctypes.c_uint8,
    ctypes.POINTER(ctypes.c_uint8),
    ctypes.c_size_t,
    ctypes.POINTER(ctypes.c_uint8),
    ctypes.c_size_t,
    ctypes.c_uint32,
)
CLOCK_FUNCTION = ctypes.CFUNCTYPE(ctypes.c_uint64, ctypes.c_void_p)


class LinuxHubLibraryError(TaxelError):
    """The compiled hub of a Linux computer is missing from the package."""


class Bus(ctypes.Structure):
    """`struct linux_hub_bus`: functions for transfers and time."""

    _fields_ = (("context", ctypes.c_void_p), ("transfer", TRANSFER_FUNCTION), ("clock_us", CLOCK_FUNCTION))


class Settings(ctypes.Structure):
    """`struct linux_hub_settings`."""

    _fields_ = (
        ("scl_hz", ctypes.c_uint32),
        ("firmware_version", ctypes.c_uint8 * 3),
        ("unique_id", ctypes.c_uint8 * 8),
        ("clock_start_us", ctypes.c_uint64),
        ("probed", ctypes.c_uint8 * 16),
    )


def make_settings(scl_hz: float, addresses: Iterable[int], clock_start_us: int = 0) -> Settings:
    """Return the settings of a hub with the firmware version of this package, as a C structure.

    scl_hz: clock of the bus, Hz. addresses: I2C addresses at which boards are searched. clock_start_us: reading of the
    hub's clock at its start, microseconds. The field `probed` is a bit map with one bit for each 7-bit address.
    """
    settings = Settings(round(scl_hz), unique_id=(ctypes.c_uint8 * 8)(*UNIQUE_ID), clock_start_us=clock_start_us)
    numbers = [int(part) for part in VERSION.split("+")[0].split(".")[:3]]
    settings.firmware_version[:] = numbers
    for address in addresses:
        settings.probed[address >> 3] |= 1 << (address & 7)
    return settings


@cache
def load_linux_hub() -> ctypes.CDLL:
    """Load the compiled hub, declare the types of its functions, and return it.

    Raises `LinuxHubLibraryError` if it is missing.
    """
    library = load_library("taxel_linux_hub", "the compiled hub for Linux", LinuxHubLibraryError, use_errno=True)
    pointer, size, text = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p
    for name, result, *arguments in (
        ("linux_hub_create", pointer, ctypes.POINTER(Settings), ctypes.POINTER(Bus)),
        ("linux_hub_free", None, pointer),
        ("linux_hub_restart", None, pointer, ctypes.c_uint8),
        ("linux_hub_pass", ctypes.c_uint64, pointer),
        ("linux_hub_execute", None, pointer),
        ("linux_hub_send", size, pointer, text, size),
        ("linux_hub_receive", size, pointer, text, size),
        ("hub_thread_start", pointer, ctypes.c_int, ctypes.POINTER(Settings)),
        ("hub_thread_stop", None, pointer),
        ("hub_thread_fd", ctypes.c_int, pointer),
        ("hub_thread_send", size, pointer, text, size),
        ("hub_thread_receive", size, pointer, text, size),
        ("hub_thread_failure", ctypes.c_int, pointer),
    ):
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library
