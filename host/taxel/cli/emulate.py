"""`taxel emulate`."""

import re
import subprocess
import sys
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
from taxel.native_library import emulator_message


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
    In a pipe, standard output contains only this name.

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
        with subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            status = _forward_output(process, hand, str(world), text)
    raise typer.Exit(1 if status else 0)


def _forward_output(process: subprocess.Popen[str], hand: str, path: str, world: str) -> int:
    """Print the port and the messages of the emulator until it ends, and return its exit status.

    Ctrl-C ends the emulator. path: path of the temporary world file. world: content of that file. Raises `TaxelError`
    if the emulator rejects the world file.
    """
    assert process.stdout is not None
    assert process.stderr is not None
    try:
        if port := process.stdout.readline().strip():
            print_port(hand, port)
        messages = [_print_message(line, path) for line in process.stderr]
        status = process.wait()
    except KeyboardInterrupt:
        process.terminate()
        return process.wait()
    if status and messages and path in messages[-1]:
        raise TaxelError(describe_world_error(messages[-1], path, world))
    return status


def _print_message(line: str, path: str) -> str:
    """Print a message of the emulator, except those about its temporary world file, and return it."""
    if path not in line:
        print(line.rstrip("\n"), file=sys.stderr, flush=True)
    return line


def print_port(hand: str, port: str) -> None:
    """Print the name of the port, with instructions for its use if standard output is a terminal.

    In a pipe the name is printed alone, so that a script can read it.
    """
    if not sys.stdout.isatty():
        print(port, flush=True)
        return
    print(f"emulated skin '{hand}' on the virtual serial port {port}", flush=True)
    print(f"in another terminal: taxel monitor serial://{port}", flush=True)
    print("Ctrl-C ends the emulation", flush=True)


def describe_world_error(message: str, path: str, world: str) -> str:
    """Reformulate an error message of the emulator about the world file, so that it names the option --effect.

    message: last message of the emulator. path: path of the temporary world file. world: content of that file. A
    message about another line than that of an effect is returned without the path of the temporary file.
    """
    text = emulator_message(message, path, world)
    quoted = re.search(r"^world file, line \d+: (.*) \(found 'effect (.*)'\)$", text)
    return f"--effect '{quoted[2]}': {quoted[1]}; see firmware/emulator/README.md" if quoted else text
