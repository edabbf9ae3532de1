"""Captures that the conversions of the fault campaign read."""

from pathlib import Path

from taxel.skin.recorder import open_recorded


def write_sources(folder: Path) -> Path:
    """Record an emulated skin to source.bin, and for a shorter time to short.bin. Returns the path of source.bin."""
    for name, seconds in (("short.bin", 0.6), ("source.bin", 1.2)):
        with open_recorded(f"emulator:?speed=max&duration_s={seconds}", folder / name, "flat8") as skin:
            for _ in skin:
                pass
    return folder / "source.bin"
