"""Recordings of the emulated default hand for the benchmarks."""

from pathlib import Path
from typing import Any

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import run_emulator
from taxel.stream.start_script import write_start_script


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
