"""`taxel emulate`."""

import subprocess
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from taxel.cli.options import Seconds, Seed
from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world, make_original_settings
from taxel.link.emulator import find_emulator_program


def emulate(
    hand: Annotated[str, typer.Option(help="Packaged hand or description file.")] = "original",
    stimulus: Annotated[Path | None, typer.Option(help="Stimulus file: forces on the skin over time.")] = None,
    seed: Seed = 1,
    scl_hz: Annotated[
        float | None, typer.Option(help="I2C clock, Hz; default: 400000, with the original protocol 100000.")
    ] = None,
    noise_counts: Annotated[float, typer.Option(help="Standard deviation of the read-out noise, counts.")] = 4.0,
    seconds: Seconds = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(help="Effect line of the world file, such as 'spread film length_m=0.002'; repeatable."),
    ] = None,
    protocol: Annotated[
        str, typer.Option(help="taxel, or original: the hub and boards of the thesis's author.")
    ] = "taxel",
) -> None:
    """Run the emulated skin behind a virtual serial port.

    The command prints the name of the port, which any serial program can open, and runs in real time until Ctrl-C.

    With `--protocol original` the port sends the byte stream of the original hub, without any command of a host.

    Example: taxel emulate --seconds 2 --effect "spread film length_m=0.002"
    """
    if protocol not in {"taxel", "original"}:
        raise TaxelError(f"--protocol: expected taxel or original, found '{protocol}'")
    create = make_original_settings if protocol == "original" else WorldSettings
    settings = create(seed=seed, noise_counts=noise_counts, effects=effect or ())
    settings = settings if scl_hz is None else replace(settings, scl_hz=scl_hz)
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
