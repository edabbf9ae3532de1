"""A recording of the emulated default hand for the benchmarks."""

from pathlib import Path
from typing import Any

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, world_text
from taxel.link import CaptureWriter, run_emulator
from taxel_protocol import PROTOCOL_VERSION, PROTOCOL_VERSION_MIN, Command, FrameType, encode_frame


def write_start_script(path: Path) -> None:
    """What a host sends: hello at 0.2 s, start at 0.25 s."""
    with CaptureWriter(path, overwrite=True) as script:
        script.write(
            encode_frame(FrameType.HOST_HELLO, 0, bytes([1, PROTOCOL_VERSION_MIN, PROTOCOL_VERSION])),
            200_000_000,
        )
        script.write(encode_frame(FrameType.COMMAND, 1, bytes([2, Command.START])), 250_000_000)


def record(folder: Path, seconds: float, stimulus: Path | None = None) -> tuple[Path, dict[str, Any]]:
    """(capture, statistics) of 17 boards at 400 kHz for so many virtual seconds."""
    script, capture = folder / "start.bin", folder / "capture.bin"
    write_start_script(script)
    statistics = run_emulator(world_text(load_hand("allegro"), WorldSettings()), capture, seconds, script, stimulus)
    return capture, statistics
