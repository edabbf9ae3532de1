"""Compares the measurements of a board with the assumptions of the firmware, and names the step of docs/bring-up.md."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from taxel_tools.bringup.capacitor import IDAC_STEP_A, CapacitorResult, evaluate_counts
from taxel_tools.bringup.lines import Line
from taxel_tools.bringup.measuring import ECHO, Measurements

AS_ASSUMED: Final = "as assumed"
DIFFERS: Final = "differs"
NOT_MEASURED: Final = "not measured"

TICK_S: Final = 0.2
CLOCK_TOLERANCE: Final = 0.02
"""Accuracy of the main oscillator: data sheet 001-87197."""
ILO_HZ: Final = (15e3, 60e3)
WATCHDOG_COUNTS: Final = 65_535
CURRENT_TOLERANCE: Final = 0.2
"""Deviation that the calibration of the original boards accepted."""
NONE: Final = 255
"""Number that stands for no interrupt or no clock."""
ROM_STACK_MAX: Final = 1024
"""RAM that the images leave free beside their largest stack, bytes (docs/firmware-size.md)."""
SOFTWARE_RESET, WATCHDOG_RESET = 1 << 4, 1 << 0
ADDRESSES: Final = 112


@dataclass(frozen=True)
class Finding:
    """One point. step: number in docs/bring-up.md. status: `AS_ASSUMED`, `DIFFERS` or `NOT_MEASURED`. advice: next
    action, if the point differs.
    """

    step: int
    point: str
    expected: str
    measured: str
    status: str
    advice: str = ""


def _compare(step: int, point: str, expected: str, measured: str, is_equal: bool, advice: str) -> Finding:
    """A finding about a measured value; the advice applies if the value is not as expected."""
    return Finding(step, point, expected, measured, AS_ASSUMED if is_equal else DIFFERS, "" if is_equal else advice)


def find(results: Measurements, known_pf: float | None = None, supply_v: float = 3.3) -> list[Finding]:
    """List the findings in the order of the steps.

    known_pf: known capacitor between TX and RX, picofarads; None: not known. supply_v: supply voltage of the board.
    """
    findings = [*_find_text(results)]
    if results.is_readable:
        for part in (_find_clock, _find_echo, _find_interrupts, _find_converter_clocks, _find_bus, _find_flash):
            findings += part(results)
        findings += _find_memory(results)
        findings += _find_watchdog(results)
        findings += _find_counts(results, known_pf, supply_v)
    return findings


def _find_text(results: Measurements) -> Iterator[Finding]:
    expected = "lines of text at 115,200 baud"
    if results.is_readable:
        yield Finding(1, "UART: text", expected, "text", AS_ASSUMED)
    elif results.received:
        advice = (
            "measure the clock pin P1.7: at 1.00 kHz the divider or the oversampling of the UART is wrong (peri_clk.h, "
            "bringup/text.c); at another frequency the processor clock is wrong (clocks.c, sflash.h)"
        )
        yield Finding(1, "UART: text", expected, "bytes that are no text", DIFFERS, advice)
    else:
        advice = (
            "measure the clock pin P1.7: at 1 kHz the image runs, and the UART has no clock (number of its clock in "
            "peri_clk.h), or the wire of P0.5 is open; without a signal the image does not run (power, programmer)"
        )
        yield Finding(1, "UART: text", expected, "no byte", DIFFERS, advice)


def _find_clock(results: Measurements) -> Iterator[Finding]:
    point, expected = "processor clock", "48 MHz within 2 %"
    if results.tick_s is None:
        yield Finding(2, point, expected, "no lines", NOT_MEASURED)
        return
    rate = TICK_S / results.tick_s
    advice = "the trims of the main oscillator are wrong: clocks.c, order of the trims; sflash.h, entries of 48 MHz"
    yield _compare(2, point, expected, f"{48 * rate:.2f} MHz", abs(rate - 1) <= CLOCK_TOLERANCE, advice)


def _find_echo(results: Measurements) -> Iterator[Finding]:
    found = "nothing" if not results.echo else results.echo.hex(" ")
    advice = "check the wire of P0.4; single wrong bytes: bit rate or supply of the adapter (uart.c)"
    yield _compare(3, "UART: received bytes", ECHO.hex(" "), found, results.echo == ECHO, advice)


def _number(line: Line | None, field: str) -> int:
    """A number of a result line; `NONE` if the line or the field is missing or no number."""
    try:
        return NONE if line is None else line.get(field)
    except (KeyError, ValueError):
        return NONE


def _find_numbers(
    step: int, line: Line | None, points: tuple[tuple[str, str, int], ...], header: str
) -> Iterator[Finding]:
    """Findings about numbers of interrupts or clocks. points: field, name, assumed number. header: file to change."""
    for field, name, assumed in points:
        number = _number(line, field)
        advice = (
            f"no number works: check that the block is clocked and enabled ({header})"
            if number == NONE
            else f"write {number} for {name} in {header}"
        )
        yield _compare(step, name, str(assumed), "none" if number == NONE else str(number), number == assumed, advice)


def _find_interrupts(results: Measurements) -> Iterator[Finding]:
    points = (
        ("scb0", "interrupt of SCB0", 10),
        ("scb1", "interrupt of SCB1", 11),
        ("csd", "interrupt of the converter", 15),
    )
    yield from _find_numbers(4, results.lines.get("interrupts"), points, "regs/core.h")


def _find_converter_clocks(results: Measurements) -> Iterator[Finding]:
    points = (("sample_clock", "sample clock of the converter", 5),)
    yield from _find_numbers(5, results.lines.get("converter"), points, "regs/peri_clk.h")
    lines = [line for line in results.repeats.values() if _number(line, "sense_clock") != NONE]
    if lines:
        points = (("sense_clock", "sense clock of the converter", 4),)
        yield from _find_numbers(5, lines[0], points, "regs/peri_clk.h")
    else:
        yield Finding(5, "sense clock of the converter", "4", "no counts with any clock: see step 10", NOT_MEASURED)


def _find_bus(results: Measurements) -> Iterator[Finding]:
    line = results.lines.get("bus")
    if line is None:
        yield Finding(6, "I2C bus", "both lines high", "no result", NOT_MEASURED)
        return
    idle = _number(line, "idle")
    levels = {0: "both lines low", 1: "SDA low", 2: "SCL low", 3: "both lines high"}
    advice = {
        0: "pull-up resistors or their supply are missing, or both lines touch ground",
        1: "SDA (P4.1) touches ground or a device holds it low",
        2: "SCL (P4.0) touches ground or a device holds it low",
    }
    yield _compare(6, "I2C: released lines", levels[3], levels.get(idle, "?"), idle == 3, advice.get(idle, ""))
    if idle != 3:
        return
    driven = _number(line, "scl_low"), _number(line, "sda_low")
    yield _compare(
        6, "I2C: each line alone", "the other stays high", f"SCL low: {driven[0]}, SDA low: {driven[1]}",
        driven == (2, 1), "SCL and SDA touch each other, or a driver does not reach its pin (bus_pins.h)",
    )  # fmt: skip
    acks, refused, failed = (_number(line, name) for name in ("acks", "nacks", "failed"))
    advice_master = "the master does not end a transfer: clock of SCB0 (peri_clk.h), bus_clock.h"
    measured = f"{acks} acknowledged, {refused} not, {failed} failed"
    is_equal = acks + refused == ADDRESSES
    yield _compare(6, "I2C: addresses", f"{ADDRESSES} answers of the block", measured, is_equal, advice_master)


def _find_flash(results: Measurements) -> Iterator[Finding]:
    wrong = _number(results.lines.get("flash"), "wrong")
    advice = "the ROM did not write the row: keys and order of the call (srom.h, flash_rows.c), clock during the call"
    measured = "no result" if results.lines.get("flash") is None else f"{wrong} wrong bytes"
    yield _compare(7, "flash row", "0 wrong bytes", measured, wrong == 0, advice)
    if results.lines.get("flash") is not None:
        stack = int(results.lines["flash"].fields.get("stack", ROM_STACK_MAX + 1))
        yield _compare(
            7, "stack of a flash write", f"at most {ROM_STACK_MAX} bytes", f"{stack} bytes", stack <= ROM_STACK_MAX,
            "the ROM needs more RAM than the images reserve: reduce RAM_BUDGET of the images (CMakeLists.txt)",
        )  # fmt: skip


def _find_memory(results: Measurements) -> Iterator[Finding]:
    if results.restart is None:
        yield Finding(8, "software reset", "a start line", "none", DIFFERS, "the reset does not restart the image")
        return
    causes = _number(results.restart, "causes")
    yield _compare(
        8, "cause of a software reset", "0x10", f"0x{causes:02X}", causes == SOFTWARE_RESET,
        "RES_CAUSE has other bits: regs/srss.h",
    )  # fmt: skip
    for field, name, address in (("stay", "request to the bootloader", 0x80), ("record", "fault record", 0xBF0)):
        kept = _number(results.restart, field) == 1
        yield _compare(
            8, f"RAM over a reset: {name}", "kept", "kept" if kept else "lost", kept,
            f"the word at 0x2000{address:04X} does not survive: choose another address (image.ld.in)",
        )  # fmt: skip


def _find_watchdog(results: Measurements) -> Iterator[Finding]:
    low, high = (WATCHDOG_COUNTS / hz for hz in reversed(ILO_HZ))
    expected = f"a reset after {low:.1f} to {high:.1f} s"
    if results.watchdog_s is None:
        advice = "the 32 kHz oscillator does not run, or the watchdog does not accept its settings: watchdog.c, srss.h"
        yield Finding(9, "watchdog", expected, "no reset in 8 s", DIFFERS, advice)
        return
    hz = WATCHDOG_COUNTS / results.watchdog_s
    yield _compare(
        9, "watchdog", expected, f"{results.watchdog_s:.2f} s ({hz / 1e3:.1f} kHz)",
        low <= results.watchdog_s <= high, "the 32 kHz oscillator is outside its range: watchdog.h",
    )  # fmt: skip
    causes = _number(results.watchdog_start, "causes")
    yield _compare(
        9, "cause of a watchdog reset", "0x01", f"0x{causes:02X}", bool(causes & WATCHDOG_RESET), "regs/srss.h"
    )


def _find_counts(results: Measurements, known_pf: float | None, supply_v: float) -> Iterator[Finding]:
    evaluated = {
        number: evaluate_counts({code: count for (n, code), count in results.counts.items() if n == number}, supply_v)
        for number in (1, 2)
    }
    working = {number: result for number, result in evaluated.items() if result is not None}
    names = {1: "one capacitor (P4.2)", 2: "CintA and CintB (P3.6, P3.7)"}
    point, expected = "variant that counts", "exactly one"
    if len(working) != 1:
        advice = (
            "check the known capacitor (P2.0 to P2.2), then each integration capacitor with a meter; without a fault "
            "there: registers of the converter (regs/csd.h)"
            if not working
            else "both circuits are connected: remove one, then repeat"
        )
        yield Finding(10, point, expected, "none" if not working else "both", DIFFERS, advice)
        return
    ((number, result),) = working.items()
    yield Finding(10, point, expected, names[number], AS_ASSUMED)
    yield _compare(
        10, "count and current", "inversely proportional", f"{result.usable} codes", result.follows_law,
        "the converter does not balance the charge: reference buffer, comparator, drive strength (regs/csd.h)",
    )  # fmt: skip
    yield from _find_current(result, known_pf)
    low, high = (_number(results.repeats.get(number), field) for field in ("low", "high"))
    yield Finding(10, "noise of 16 conversions", "some counts", f"{low} to {high}", AS_ASSUMED)


def _find_current(result: CapacitorResult, known_pf: float | None) -> Iterator[Finding]:
    if known_pf is None:
        measured = f"{result.capacitance_pf:.2f} pF between P2.0 and P2.2, if the step is {IDAC_STEP_A * 1e6:.1f} uA"
        yield Finding(10, "step of the current source", "1.2 uA", measured, NOT_MEASURED)
        return
    step = result.compute_step_ua(known_pf)
    is_equal = abs(step / (IDAC_STEP_A * 1e6) - 1) <= CURRENT_TOLERANCE
    advice = (
        "compare the known capacitor and the supply voltage (--capacitor-pf, --supply-v); then range and trim of the "
        "current source (regs/csd.h, sflash.h)"
    )
    yield _compare(10, "step of the current source", "1.2 uA within 20 %", f"{step:.2f} uA", is_equal, advice)
