"""Recordings of the emulated default hand for the benchmarks."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import run_emulator
from taxel.stream.start_script import write_start_script


def make_settings(scl_hz: float, baud: float, **others: Any) -> WorldSettings:
    """Make world settings whose wiring permits the clock rate of the I2C bus.

    Above 400 kHz the pull-up resistors at the hub have half of their resistance; with those of the hand, the lines rise
    too slowly (docs/star-wiring.md). scl_hz: clock of the I2C bus. baud: rate of the UART.
    """
    wiring = load_hand("original").wiring
    if wiring is not None and scl_hz > 400e3:
        wiring = replace(wiring, hub_pullup_ohm=wiring.hub_pullup_ohm / 2)
    return WorldSettings(scl_hz=scl_hz, baud=baud, wiring=wiring, **others)


def record(
    folder: Path,
    seconds: float,
    stimulus: Path | None = None,
    settings: WorldSettings | None = None,
    world: str | None = None,
    threads: int = 1,
) -> tuple[Path, dict[str, Any]]:
    """Record 17 emulated boards for `seconds` of virtual time; return the capture file and the run's statistics.

    stimulus: file with forces. settings: of the world (default: 400 kHz). world: text of a world file, instead of
    `settings`.
    """
    script, capture = folder / "start.bin", folder / "capture.bin"
    write_start_script(script)
    text = world or format_world(load_hand("original"), settings or WorldSettings())
    return capture, run_emulator(text, capture, seconds, script, stimulus, threads)
