"""Runs the tests of the bring-up image one after another, and keeps what they measured."""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from taxel_tools.bringup.lines import Line, is_text
from taxel_tools.bringup.ports import FAULT, BytePort, LineReader

START: Final = "taxel-bringup"
START_TIMEOUT_S: Final = 5.0
"""The image prints a line every two seconds while it waits for a command."""
LINE_TIMEOUT_S: Final = 3.0
TICKS: Final = 21
"""Lines of the clock test: 4 s in all, so that a delay of 16 ms of the adapter changes the result by 0.4 %."""
WATCHDOG_TIMEOUT_S: Final = 10.0
ECHO: Final = bytes([0x00, 0xFF, 0x55, 0xAA, *range(1, 12), 0x7F])
"""Bytes with long and short pulses, 16 in all."""


@dataclass
class Measurements:
    """What the tests measured; None: not measured.

    received: whether bytes arrived. is_readable: whether they are text. tick_s: mean interval of the clock lines,
    seconds. echo: bytes that the board sent back; empty if the board received none. lines: result lines by name.
    repeats: result lines of repeated conversions by number of capacitors. counts: count by (capacitors, code).
    restart: start line after the memory test. watchdog_s: time from the last feed of the watchdog to the next start
    line. watchdog_start: that line. missing: names of result lines that did not arrive. fault: line of an exception,
    after which no further test runs. ended_by: the test in which it occurred.
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
    missing: list[str] = field(default_factory=list)
    fault: Line | None = None
    ended_by: "Test | None" = None


def measure(port: BytePort, progress: Callable[[str], None] = lambda test: None) -> Measurements:
    """Run all tests on the board at an open port. progress: called with the name of each test before it starts.

    The tests end early if the image prints no text, receives nothing, or takes an exception. Raises `LinkError` if the
    port fails.
    """
    reader = LineReader(port)
    results = Measurements()
    progress("text of the image")
    line = reader.read_line(START_TIMEOUT_S)
    results.received = bool(reader.received)
    results.is_readable = line is not None and is_text(reader.received)
    if not results.is_readable:
        return results
    for test in TESTS:
        progress(test.name)
        test.run(reader, results)
        if results.fault is not None:
            results.ended_by = test
        if results.fault is not None or not results.echo:
            break
    return results


class Test(NamedTuple):
    """One test.

    name: name in messages. step: number in docs/bring-up.md. run: sends the commands of the test and stores what it
    measures in the `Measurements`.
    """

    name: str
    step: int
    run: Callable[[LineReader, Measurements], None]


def _read_until(reader: LineReader, results: Measurements, name: str) -> list[Line]:
    """Read the lines up to the first with this name.

    The line of an exception of the image ends the reading earlier; it is stored in `results.fault`.
    """
    lines = reader.read_until(name, LINE_TIMEOUT_S)
    results.fault = next((line for line in lines if line.name == FAULT), None)
    return lines


def _run(reader: LineReader, results: Measurements, command: str, names: tuple[str, ...]) -> list[Line]:
    """Run one command, and return all lines up to the line "done".

    names: names of result lines, which are stored in `results`; those that do not arrive are stored as missing.
    """
    reader.send(command)
    lines = _read_until(reader, results, "done")
    found = {line.name: line for line in lines if line.name in names}
    results.lines |= found
    results.missing += [name for name in names if name not in found]
    return lines


def _measure_ticks(reader: LineReader, results: Measurements) -> None:
    """Measure the mean interval of the lines that the image prints at equal intervals.

    Nothing is stored if a line is missing, because it would change the mean.
    """
    times = [line.time_s for line in _run(reader, results, "t", ("tick",)) if line.name == "tick"]
    if len(times) == TICKS:  # a lost line would change the mean
        results.tick_s = (times[-1] - times[0]) / (len(times) - 1)


def _measure_echo(reader: LineReader, results: Measurements) -> None:
    """Send the bytes `ECHO` and store the bytes that the board sends back."""
    reader.send("e")
    reader.send_bytes(ECHO)
    results.echo = b""
    for line in _read_until(reader, results, "done"):
        if line.name == "echo":
            with contextlib.suppress(ValueError):
                results.echo = bytes.fromhex(line.fields.get("bytes", ""))


def _find_interrupts(reader: LineReader, results: Measurements) -> None:
    """Let the image find the numbers of its interrupts and of the sample clock, and store its result lines."""
    _run(reader, results, "i", ("interrupts", "converter"))


def _test_bus(reader: LineReader, results: Measurements) -> None:
    """Let the image test the lines of the I2C bus and the I2C master, and store its result line."""
    _run(reader, results, "b", ("bus",))


def _write_row(reader: LineReader, results: Measurements) -> None:
    """Let the image write a flash row, and store its result line."""
    _run(reader, results, "f", ("flash",))


def _measure_counts(reader: LineReader, results: Measurements) -> None:
    """Let the image count the known capacitor with both variants of the circuit; store the counts.

    A damaged line is omitted.
    """
    for line in _run(reader, results, "c", ("count", "repeats")):
        capacitors, code, count = line.get("capacitors"), line.get("code"), line.get("count")
        if line.name == "count" and capacitors is not None and code is not None and count is not None:
            results.counts[capacitors, code] = count
        elif line.name == "repeats" and capacitors is not None:
            results.repeats[capacitors] = line


def _test_memory(reader: LineReader, results: Measurements) -> None:
    """Let the image reset the board; store its next start line, which states what survived in RAM."""
    reader.send("m")
    lines = _read_until(reader, results, START)
    results.restart = next((line for line in lines if line.name == START), None)


def _measure_watchdog(reader: LineReader, results: Measurements) -> None:
    """Let the watchdog reset the board, and store the time until the next start line.

    Lines with other names, such as noise, are ignored.
    """
    reader.send("w")
    waiting = _read_until(reader, results, "watchdog")
    if not waiting or waiting[-1].name != "watchdog":
        results.missing.append("watchdog")
        return
    while (line := reader.read_line(WATCHDOG_TIMEOUT_S)) is not None:
        if line.name == START:
            results.watchdog_s, results.watchdog_start = line.time_s - waiting[-1].time_s, line
        if line.name in (START, "watchdog"):
            return


TESTS: Final = (
    Test("received bytes", 3, _measure_echo),
    Test("clock", 2, _measure_ticks),
    Test("interrupt numbers", 4, _find_interrupts),
    Test("I2C bus", 6, _test_bus),
    Test("flash row", 7, _write_row),
    Test("known capacitor", 10, _measure_counts),
    Test("memory over a reset", 8, _test_memory),
    Test("watchdog", 9, _measure_watchdog),
)
"""Tests in their order: without received bytes no other test can be started."""
