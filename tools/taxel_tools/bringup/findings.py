"""Compares the measurements of a board with the assumptions of the firmware, and names the step of docs/bring-up.md."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from taxel_tools.bringup.capacitor import IDAC_STEP_A, CapacitorResult, evaluate_counts
from taxel_tools.bringup.lines import Line
from taxel_tools.bringup.measuring import ECHO, Measurements, Test

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
NOISE_MAX: Final = 40
"""Noise threshold of the original boards, counts (their CapSense parameters)."""


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


def _judge(step: int, point: str, expected: str, measured: str, is_equal: bool, advice: str) -> Finding:
    """Create the finding about a measured value: status and, only if the value is not as expected, the advice.

    is_equal: whether the measured value is as expected.
    """
    return Finding(step, point, expected, measured, AS_ASSUMED if is_equal else DIFFERS, "" if is_equal else advice)


def list_findings(
    results: Measurements, known_pf: float | None = None, supply_v: float = 3.3, capacitors: int = 1
) -> list[Finding]:
    """List the findings in the order of the steps.

    results: what the tests of the bring-up image measured. known_pf: known capacitor between TX and RX, picofarads;
    None if it is unknown. supply_v: supply voltage of the board. capacitors: integration capacitors of the board, 1
    (P4.2) or 2 (P3.6 and P3.7). Tests that a failed test prevented have no finding.
    """
    findings = [*_find_text(results)]
    if results.is_readable and not results.echo:
        findings += _find_echo(results)
    elif results.is_readable:
        for part in (_find_clock, _find_echo, _find_interrupts, _find_sample_clock):
            findings += part(results)
        findings += _find_sense_clock(results, capacitors)
        for part in (_find_bus, _find_flash, _find_memory, _find_watchdog):
            findings += part(results)
        findings += _find_counts(results, known_pf, supply_v, capacitors)
    if results.fault is not None and results.ended_by is not None:
        findings.append(_describe_fault(results.fault, results.ended_by))
    return findings


def _describe_fault(line: Line, test: Test) -> Finding:
    """Create the finding of an exception in a test, after which the tests ended."""
    measured = f"exception {line.get('exception')} at 0x{line.fields.get('pc', '?')}"
    advice = (
        "exception 2: the NMI uses the vectors in RAM (startup.c); 3: a HardFault, look up the address in bringup.elf"
    )
    return Finding(test.step, f"exceptions during the test of the {test.name}", "none", measured, DIFFERS, advice)


def _find_text(results: Measurements) -> Iterator[Finding]:
    """Judge whether the image prints readable text on its UART; the advice depends on what arrived."""
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
    """Judge the processor clock by the mean interval of lines that the image prints every 0.2 s."""
    point, expected = "processor clock", "48 MHz within 2 %"
    if results.tick_s is None:
        yield Finding(2, point, expected, "no lines", NOT_MEASURED)
        return
    rate = TICK_S / results.tick_s
    advice = "the trims of the main oscillator are wrong: clocks.c, order of the trims; sflash.h, entries of 48 MHz"
    yield _judge(2, point, expected, f"{48 * rate:.2f} MHz", abs(rate - 1) <= CLOCK_TOLERANCE, advice)


def _find_echo(results: Measurements) -> Iterator[Finding]:
    """Judge whether the board sends back the bytes that it received."""
    found = "nothing" if not results.echo else results.echo.hex(" ")
    advice = "check the wire of P0.4; single wrong bytes: bit rate or supply of the adapter (uart.c)"
    yield _judge(3, "UART: received bytes", ECHO.hex(" "), found, results.echo == ECHO, advice)


def _get_number(line: Line | None, field: str) -> int | None:
    """Return a number of a result line; None if the line or the field is missing or damaged."""
    return None if line is None else line.get(field)


def _find_numbers(
    step: int, line: Line | None, points: tuple[tuple[str, str, int], ...], header: str
) -> Iterator[Finding]:
    """Judge the numbers of interrupts or clocks that the image found.

    step: step of docs/bring-up.md. points: field of the line, name, assumed number. header: file to change if a number
    differs.
    """
    for field, name, assumed in points:
        number = _get_number(line, field)
        if number is None:
            yield Finding(step, name, str(assumed), "no result", NOT_MEASURED)
            continue
        advice = (
            f"no number works: check that the block is clocked and enabled ({header})"
            if number == NONE
            else f"write {number} for {name} in {header}"
        )
        yield _judge(step, name, str(assumed), "none" if number == NONE else str(number), number == assumed, advice)


def _find_interrupts(results: Measurements) -> Iterator[Finding]:
    """Judge the interrupt numbers of both serial blocks and of the converter, which the firmware assumes.

    The findings belong to step 4 of docs/bring-up.md.
    """
    points = (
        ("scb0", "interrupt of SCB0", 10),
        ("scb1", "interrupt of SCB1", 11),
        ("csd", "interrupt of the converter", 15),
    )
    yield from _find_numbers(4, results.lines.get("interrupts"), points, "part/numbers.h")


def _find_sample_clock(results: Measurements) -> Iterator[Finding]:
    """Judge the number of the converter's sample clock (step 5 of docs/bring-up.md)."""
    points = (("sample_clock", "sample clock of the converter", 5),)
    yield from _find_numbers(5, results.lines.get("converter"), points, "part/peri_clk.h")


def _find_sense_clock(results: Measurements, capacitors: int) -> Iterator[Finding]:
    """Judge the number of the converter's sense clock (step 5 of docs/bring-up.md).

    capacitors: integration capacitors of the board, 1 or 2. The number is found by conversions, preferably with the
    circuit that the board has, otherwise with the other circuit.
    """
    # 3 - capacitors: number of integration capacitors of the other circuit.
    lines = [results.repeats[each] for each in (capacitors, 3 - capacitors) if each in results.repeats]
    found = [line for line in lines if _get_number(line, "sense_clock") not in (None, NONE)]
    if found:
        points = (("sense_clock", "sense clock of the converter", 4),)
        yield from _find_numbers(5, found[0], points, "part/peri_clk.h")
    else:
        yield Finding(5, "sense clock of the converter", "4", "no counts with any clock: see step 10", NOT_MEASURED)


def _find_bus(results: Measurements) -> Iterator[Finding]:
    """Judge the released I2C lines, shorts between them, and the answers of the I2C block as a master.

    Later tests need released lines that are high; otherwise only the first finding is returned. Levels are bits: 1 if
    SCL is high, 2 if SDA is high.
    """
    line = results.lines.get("bus")
    if line is None:
        yield Finding(6, "I2C bus", "both lines high", "no result", NOT_MEASURED)
        return
    idle = _get_number(line, "idle")
    if idle is None:
        yield Finding(6, "I2C bus", "both lines high", "a damaged line", NOT_MEASURED)
        return
    levels = {0: "both lines low", 1: "SDA low", 2: "SCL low", 3: "both lines high"}
    advice = {
        0: "pull-up resistors or their supply are missing, or both lines touch ground",
        1: "SDA (P4.1) touches ground or a device holds it low",
        2: "SCL (P4.0) touches ground or a device holds it low",
    }
    yield _judge(6, "I2C: released lines", levels[3], levels.get(idle, "?"), idle == 3, advice.get(idle, ""))
    if idle != 3:
        return
    driven = _get_number(line, "scl_low"), _get_number(line, "sda_low")
    yield _judge(
        6, "I2C: each line alone", "the other stays high", f"SCL low: {driven[0]}, SDA low: {driven[1]}",
        driven == (2, 1), "SCL and SDA touch each other, or a driver does not reach its pin (bus_pins.h)",
    )  # fmt: skip
    acks, refused, failed = (_get_number(line, name) or 0 for name in ("acks", "nacks", "failed"))
    advice_master = "the master does not end a transfer: clock of SCB0 (peri_clk.h), bus_clock.h"
    measured = f"{acks} acknowledged, {refused} not, {failed} failed"
    is_equal = acks + refused == ADDRESSES
    yield _judge(6, "I2C: addresses", f"{ADDRESSES} answers of the block", measured, is_equal, advice_master)


def _find_flash(results: Measurements) -> Iterator[Finding]:
    """Judge the bytes of the written flash row, and the stack that the ROM used for it."""
    line = results.lines.get("flash")
    wrong, stack = _get_number(line, "wrong"), _get_number(line, "stack")
    if wrong is None or stack is None:
        yield Finding(7, "flash row", "0 wrong bytes", "no result", NOT_MEASURED)
        return
    advice = "the ROM did not write the row: keys and order of the call (srom.h, flash_rows.c), clock during the call"
    yield _judge(7, "flash row", "0 wrong bytes", f"{wrong} wrong bytes", wrong == 0, advice)
    yield _judge(
        7, "stack of a flash write", f"at most {ROM_STACK_MAX} bytes", f"{stack} bytes", stack <= ROM_STACK_MAX,
        "the ROM needs more RAM than the images reserve: reduce RAM_BUDGET of the images (CMakeLists.txt)",
    )  # fmt: skip


def _find_memory(results: Measurements) -> Iterator[Finding]:
    """Judge the restart of the image after a software reset: reset cause and the words in RAM that must survive."""
    if results.restart is None:
        # After an exception the test did not run, or the exception has a finding of its own.
        status = DIFFERS if results.fault is None else NOT_MEASURED
        yield Finding(8, "software reset", "a start line", "none", status, "the reset does not restart the image")
        return
    causes = results.restart.get("causes", 16)
    yield _judge(
        8, "cause of a software reset", "0x10", _format_causes(causes), causes == SOFTWARE_RESET,
        "RES_CAUSE has other bits: part/srss.h",
    )  # fmt: skip
    for field, name, address in (("stay", "request to the bootloader", 0x80), ("record", "fault record", 0xBF0)):
        kept = _get_number(results.restart, field) == 1
        yield _judge(
            8, f"RAM over a reset: {name}", "kept", "kept" if kept else "lost", kept,
            f"the word at 0x2000{address:04X} does not survive: choose another address (image.ld.in)",
        )  # fmt: skip


def _format_causes(causes: int | None) -> str:
    """Format the bits of the reset cause register RES_CAUSE; "no result" for None."""
    return "no result" if causes is None else f"0x{causes:02X}"


def _find_watchdog(results: Measurements) -> Iterator[Finding]:
    """Judge the time after which the watchdog resets the board, and the reset cause."""
    low, high = (WATCHDOG_COUNTS / hz for hz in reversed(ILO_HZ))
    expected = f"a reset after {low:.1f} to {high:.1f} s"
    if results.watchdog_s is None:
        advice = "the 32 kHz oscillator does not run, or the watchdog does not accept its settings: watchdog.c, srss.h"
        if results.fault is None:
            yield Finding(9, "watchdog", expected, "no reset in 8 s", DIFFERS, advice)
        else:
            yield Finding(9, "watchdog", expected, "no result", NOT_MEASURED)
        return
    hz = WATCHDOG_COUNTS / results.watchdog_s
    yield _judge(
        9, "watchdog", expected, f"{results.watchdog_s:.2f} s ({hz / 1e3:.1f} kHz)",
        low <= results.watchdog_s <= high, "the 32 kHz oscillator is outside its range: watchdog.h",
    )  # fmt: skip
    causes = None if results.watchdog_start is None else results.watchdog_start.get("causes", 16)
    is_watchdog = bool((causes or 0) & WATCHDOG_RESET)
    yield _judge(9, "cause of a watchdog reset", "0x01", _format_causes(causes), is_watchdog, "part/srss.h")


def _find_counts(results: Measurements, known_pf: float | None, supply_v: float, capacitors: int) -> Iterator[Finding]:
    """Judge the counts of the converter with the circuit that the board has.

    The other circuit may count, too, because the lines and the analog bus themselves are a small capacitor.
    """
    evaluated = {
        number: evaluate_counts({code: count for (n, code), count in results.counts.items() if n == number}, supply_v)
        for number in (1, 2)
    }
    names = {1: "one capacitor (P4.2)", 2: "CintA and CintB (P3.6, P3.7)"}
    point, expected = "counts", f"with {names[capacitors]}"
    result, other = evaluated[capacitors], evaluated[3 - capacitors]
    if not results.counts:
        yield Finding(10, point, expected, "no result", NOT_MEASURED)
        return
    if result is None:
        advice = (
            "check the known capacitor (P2.0 to P2.2), then each integration capacitor with a meter; without a fault "
            "there: registers of the converter (part/csd.h)"
            if other is None
            else f"the circuit is the other one (--capacitors {3 - capacitors}), or an integration capacitor is missing"
        )
        measured = "none" if other is None else f"with {names[3 - capacitors]}"
        yield Finding(10, point, expected, measured, DIFFERS, advice)
        return
    yield Finding(10, point, expected, expected if other is None else "with both circuits", AS_ASSUMED)
    yield _judge(
        10, "count and current", "inversely proportional", f"{result.usable} codes", result.follows_law,
        "the converter does not balance the charge: reference buffer, comparator, drive strength (part/csd.h)",
    )  # fmt: skip
    yield from _find_current(result, known_pf)
    low, high = (_get_number(results.repeats.get(capacitors), field) for field in ("low", "high"))
    if low is None or high is None:
        yield Finding(10, "noise of 16 conversions", f"at most {NOISE_MAX} counts", "no result", NOT_MEASURED)
        return
    yield _judge(
        10, "noise of 16 conversions", f"at most {NOISE_MAX} counts", f"{high - low} counts", high - low <= NOISE_MAX,
        "shorter leads; filter bits (part/csd.h); the other circuit",
    )  # fmt: skip


def _find_current(result: CapacitorResult, known_pf: float | None) -> Iterator[Finding]:
    """Judge the step of the current source; not measured without a known capacitor."""
    if known_pf is None:
        measured = f"{result.capacitance_pf:.2f} pF between P2.0 and P2.2, if the step is {IDAC_STEP_A * 1e6:.1f} uA"
        yield Finding(10, "step of the current source", "1.2 uA", measured, NOT_MEASURED)
        return
    step = result.compute_step_ua(known_pf)
    is_equal = abs(step / (IDAC_STEP_A * 1e6) - 1) <= CURRENT_TOLERANCE
    advice = (
        "compare the known capacitor and the supply voltage (--capacitor-pf, --supply-v); then range and trim of the "
        "current source (part/csd.h, sflash.h)"
    )
    yield _judge(10, "step of the current source", "1.2 uA within 20 %", f"{step:.2f} uA", is_equal, advice)
