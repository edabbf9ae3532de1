"""`taxel emulate`."""

import subprocess
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, world_text
from taxel.link.emulator import emulator_program


def emulate(
    hand: Annotated[str, typer.Option(help="Packaged hand or description file.")] = "allegro",
    stimulus: Annotated[Path | None, typer.Option(help="What acts on the skin: a stimulus file.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of everything that is random in this world.")] = 1,
    scl_hz: Annotated[float, typer.Option(help="I2C clock, hertz.")] = 400e3,
    noise: Annotated[float, typer.Option(help="White read-out noise, counts (standard deviation).")] = 4.0,
    seconds: Annotated[float | None, typer.Option(help="Stop after so many seconds.")] = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(help="A departure from the ideal sensor; may be given again (emulator README)."),
    ] = None,
) -> None:
    """Run the emulated skin in real time behind a pseudo-terminal that any serial program can open.

    Prints the device's name; Ctrl-C ends it.

    Example: taxel emulate --seconds 2 --effect "spread film length_m=0.002"
    """
    settings = WorldSettings(seed=seed, scl_hz=scl_hz, noise_counts=noise, effects=effect or ())
    text = world_text(load_hand(hand), settings)
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        world = Path(folder) / "world.txt"
        world.write_text(text)
        arguments = [str(emulator_program()), "--world", str(world), "--uart", "pty"]
        arguments += ["--stimulus", str(stimulus)] if stimulus else []
        arguments += ["--duration", repr(seconds)] if seconds is not None else []
        process = subprocess.Popen(arguments)
        try:
            status = process.wait()
        except KeyboardInterrupt:
            process.terminate()
            status = process.wait()
    raise typer.Exit(1 if status else 0)
