"""Runs the tests of the bring-up image one after another, and keeps what they measured."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from taxel_tools.bringup.lines import Line, is_text
from taxel_tools.bringup.ports import BytePort, LineReader

START: Final = "taxel-bringup"
START_TIMEOUT_S: Final = 5.0
"""The image prints a line every two seconds while it waits for a command."""
LINE_TIMEOUT_S: Final = 3.0
WATCHDOG_TIMEOUT_S: Final = 10.0
ECHO: Final = bytes([0x00, 0xFF, 0x55, 0xAA, *range(1, 12), 0x7F])
"""Bytes with long and short pulses, 16 in all."""


@dataclass
class Measurements:
    """What the tests measured; None: not measured.

    received: whether bytes arrived. is_readable: whether they are text. start: line after a reset. tick_s: mean
    interval of the clock lines, seconds. echo: bytes that the board sent back. lines: result lines by name. counts:
    count by (capacitors, code). restart: start line after the memory test. watchdog_s: time from the start of the
    watchdog to the next start line. watchdog_start: that line. clock_pin_hz: frequency of the clock pin, measured on
    an emulated part only. missing: commands without an answer.
    """

    received: bool = False
    is_readable: bool = False
    tick_s: float | None = None
    echo: bytes | None = None
    lines: dict[str, Line] = field(default_factory=dict)
    repeats: dict[int, Line] = field(default_factory=dict)
    counts: dict[tuple[int, int], int] = field(default_factory=dict)
    restart: Line | None = None
    watchdog_s: float | None = None
    watchdog_start: Line | None = None
    clock_pin_hz: float | None = None
    missing: list[str] = field(default_factory=list)


def measure(port: BytePort, progress: Callable[[str], None] = lambda test: None) -> Measurements:
    """Run all tests on the board at an open port. progress: called with the name of each test before it starts.

    Raises `LinkError` if the port fails.
    """
    reader = LineReader(port)
    results = Measurements()
    progress("text of the image")
    line = reader.read_line(START_TIMEOUT_S)
    results.received = bool(reader.received)
    results.is_readable = line is not None and is_text(reader.received)
    if not results.is_readable:
        return results
    progress("clock")
    _measure_ticks(reader, results)
    progress("received bytes")
    _measure_echo(reader, results)
    for command, name, lines in (("i", "interrupt numbers", ("interrupts", "converter")), ("b", "I2C bus", ("bus",))):
        progress(name)
        _run(reader, results, command, lines)
    progress("flash row")
    _run(reader, results, "f", ("flash",))
    progress("known capacitor")
    _measure_counts(reader, results)
    progress("memory over a reset")
    reader.send("m")
    restart = reader.read_until(START, LINE_TIMEOUT_S)
    results.restart = restart[-1] if restart and restart[-1].name == START else None
    progress("watchdog")
    _measure_watchdog(reader, results)
    return results


def _run(reader: LineReader, results: Measurements, command: str, names: tuple[str, ...]) -> list[Line]:
    """Run one command and store its lines by name; a command without all its lines is noted as missing."""
    reader.send(command)
    lines = reader.read_until("done", LINE_TIMEOUT_S)
    found = {line.name: line for line in lines if line.name in names}
    results.lines |= found
    results.missing += [name for name in names if name not in found]
    return lines


def _measure_ticks(reader: LineReader, results: Measurements) -> None:
    """Measure the mean interval of the lines that the image prints at equal intervals."""
    times = [line.time_s for line in _run(reader, results, "t", ("tick",)) if line.name == "tick"]
    if len(times) > 2:
        results.tick_s = (times[-1] - times[0]) / (len(times) - 1)


def _measure_echo(reader: LineReader, results: Measurements) -> None:
    """Send bytes and keep what comes back."""
    reader.send("e")
    reader.send_bytes(ECHO)
    for line in reader.read_until("done", LINE_TIMEOUT_S):
        if line.name == "echo":
            results.echo = bytes.fromhex(line.fields.get("bytes", ""))


def _measure_counts(reader: LineReader, results: Measurements) -> None:
    """Count the known capacitor with both variants of the circuit."""
    for line in _run(reader, results, "c", ("count", "repeats")):
        if line.name == "count":
            results.counts[line.get("capacitors"), line.get("code")] = line.get("count")
        elif line.name == "repeats":
            results.repeats[line.get("capacitors")] = line


def _measure_watchdog(reader: LineReader, results: Measurements) -> None:
    """Let the watchdog reset the board and measure the time."""
    reader.send("w")
    waiting = reader.read_until("watchdog", LINE_TIMEOUT_S)
    if not waiting or waiting[-1].name != "watchdog":
        results.missing.append("watchdog")
        return
    line = reader.read_line(WATCHDOG_TIMEOUT_S)
    if line is not None and line.name == START:
        results.watchdog_s, results.watchdog_start = line.time_s - waiting[-1].time_s, line
