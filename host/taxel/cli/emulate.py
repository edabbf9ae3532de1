"""`taxel emulate`."""

import subprocess
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from taxel.cli.options import Seconds, Seed
from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link.emulator import find_emulator_program


def emulate(
    hand: Annotated[str, typer.Option(help="Packaged hand or description file.")] = "allegro",
    stimulus: Annotated[Path | None, typer.Option(help="Stimulus file: forces on the skin over time.")] = None,
    seed: Seed = 1,
    scl_hz: Annotated[float, typer.Option(help="I2C clock, Hz.")] = 400e3,
    noise_counts: Annotated[float, typer.Option(help="Standard deviation of the read-out noise, counts.")] = 4.0,
    seconds: Seconds = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(help="Effect line of the world file, such as 'spread film length_m=0.002'; repeatable."),
    ] = None,
) -> None:
    """Run the emulated skin behind a virtual serial port.

    The command prints the name of the port, which any serial program can open, and runs in real time until Ctrl-C.

    Example: taxel emulate --seconds 2 --effect "spread film length_m=0.002"
    """
    settings = WorldSettings(seed=seed, scl_hz=scl_hz, noise_counts=noise_counts, effects=effect or ())
    text = format_world(load_hand(hand), settings)
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        world = Path(folder) / "world.txt"
        world.write_text(text)
        arguments = [str(find_emulator_program()), "--world", str(world), "--uart", "pty"]
        arguments += ["--stimulus", str(stimulus)] if stimulus else []
        arguments += ["--duration", repr(seconds)] if seconds is not None else []
        process = subprocess.Popen(arguments)
        try:
            status = process.wait()
        except KeyboardInterrupt:
            process.terminate()
            status = process.wait()
    raise typer.Exit(1 if status else 0)
