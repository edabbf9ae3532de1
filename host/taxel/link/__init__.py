"""Transport of bytes by URL: serial ports, the emulator and captures."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from taxel.link.base import Chunk, Link, SteppedLink, get_clock
from taxel.link.capture import CaptureLink, CaptureWriter
from taxel.link.errors import CaptureError, LinkError, PortBusyError, PortMissingError, PortVanishedError
from taxel.link.i2c_port import open_i2c
from taxel.link.reopening import Gap, Reconnection, ReopeningLink
from taxel.link.serial_port import SerialLink
from taxel.link.stimulus import write_scene, write_stimulus
from taxel.link.url import open_link

if TYPE_CHECKING:
    from taxel.link.emulator import EmulatorLink, run_emulator

__all__ = [
    "CaptureError",
    "CaptureLink",
    "CaptureWriter",
    "Chunk",
    "EmulatorLink",
    "Gap",
    "Link",
    "LinkError",
    "PortBusyError",
    "PortMissingError",
    "PortVanishedError",
    "Reconnection",
    "ReopeningLink",
    "SerialLink",
    "SteppedLink",
    "get_clock",
    "open_i2c",
    "open_link",
    "run_emulator",
    "write_scene",
    "write_stimulus",
]


def __getattr__(name: str) -> Any:
    """Import the emulator's link at its first use, because `taxel.link` must also work without that module.

    The blind check (a test of the fault diagnosis on worlds with hidden causes) runs in a sandbox that does not contain
    the emulator.
    """
    if name not in ("EmulatorLink", "run_emulator"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("taxel.link.emulator"), name)
