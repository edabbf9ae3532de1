"""Text of docs/firmware-cycles.md: the definition and the measurement of each figure of costs.h, and the total load."""

import re
from typing import Final

from firmware_cycles import BoardCycles, FirmwareCycles

MEANINGS: Final[dict[str, tuple[str, str]]] = {
    "CONVERSION": (
        "conversion interrupt, from the request to the start of the next conversion, without the additions below",
        "each interrupt of a scan; the remainder from the scan length on the board's clock",
    ),
    "SETTLE_LOOP": ("one iteration of the loop that waits for `settle_cycles`", "instructions"),
    "QUOTIENT": ("added for computing the TX line: lines 0 to 15", "differences between lines of 0x2C and 0x20"),
    "NEW_TX": ("added if the TX line changes", "first conversion of a line minus its other conversions"),
    "SKIPPED_CROSSING": ("added for a crossing without a taxel", "conversions after holes of the crossing map"),
    "SCAN": ("added at the end of a scan: publish the snapshot, restart the CRC", "the longest interrupt of a scan"),
    "AFTER_START": (
        "remainder of the interrupt after the start of the next conversion",
        "scan lengths of two boards compared with the sums of their interrupts",
    ),
    "AFTER_SCAN": ("added to the remainder at the end of a scan", "as AFTER_START"),
    "SENSOR_INIT": (
        "from the image's first instruction to the start of the first conversion",
        "time of the first scan",
    ),
    "TICK": ("SysTick interrupt", "mean of all"),
    "TICK_PERIOD": ("period of the SysTick interrupt", "`ticks.c`: 4,096 us"),
    "TAIL_CHAIN": ("saved by a tail-chained interrupt", "`cortex_m0_timing`: 16 + 12 - 6"),
    "SLAVE_WRITE": ("address for writing and the first byte: processor", "minimum of 12 transfers"),
    "SLAVE_WRITE_HOLD": (
        "address for writing and the first byte: SCL is held",
        "length of the transfer minus its clocks, minimum of 12",
    ),
    "SLAVE_READ": ("address for reading, FIFO filled: processor", "as SLAVE_WRITE"),
    "SLAVE_READ_HOLD": ("address for reading, FIFO filled: SCL is held", "as SLAVE_WRITE_HOLD"),
    "SLAVE_BYTE": ("each further byte written: processor", "two transfers that differ by one byte"),
    "SLAVE_BYTE_HOLD": ("each further byte written: SCL is held", "as SLAVE_BYTE"),
    "SLAVE_REFILL": ("refill of the FIFO with four bytes; SCL is not held", "a read of 6 bytes minus a read of 2"),
    "SLAVE_STOP": ("stop condition", "the shortest interrupt of the slave"),
    "SLAVE_FIFO": ("bytes in the FIFO", "hardware"),
    "COMPACT": (
        "coding of a compact snapshot in the board's main loop",
        "two boards, streamed as compact and as uncompressed frames",
    ),
    "COMPACT_TAXEL": ("added for each taxel of a compact snapshot (noise of 4 counts)", "as COMPACT"),
    "MASTER_DONE": ("hub: I2C interrupt that ends a transfer", "the shortest I2C interrupt of the hub"),
    "MASTER_BYTE": (
        "hub: I2C interrupts per byte on the bus; SCL is rarely held (not charged)",
        "sum of the interrupts divided by the bytes, while the hub streams a board",
    ),
    "HUB_PASS": ("hub: pass of the main loop that starts a transfer", "time between two probes of unused addresses"),
    "HUB_FRAME_BYTE": (
        "hub: each byte of a frame: CRC, whitening, byte stuffing",
        "60,000 samples of the program counter during streaming",
    ),
    "UART_INTERRUPT": ("UART interrupt", "the shortest of these interrupts"),
    "UART_BYTE": ("added for each byte that a UART interrupt transfers", "sum of the interrupts minus UART_INTERRUPT"),
}
"""Definition and measurement of each figure."""

PAGE: Final = """# Cycles of the firmware

This page lists the processor cycles that the firmware of boards and hub uses. It is written by
`python tools/firmware/calibrate_costs.py` (run `make firmware` first; `--check` reports whether the page is stale).
The program runs the images on the emulated Cortex-M0 at 48 MHz, including the wait state of the flash. The
[README of the processor](../firmware/emulator/cortex_m0/README.md) lists which parts of its timing are published and
which are assumed. No figure was measured on silicon.

## Processor load

The table gives the cycles in which the processor of a [board](glossary.md#board) is awake. One
[scan](glossary.md#scan) measures all taxels, and lasts as long as its conversions. During this length of a scan, the
processor must complete the scan and one poll, a read of a whole snapshot by the hub.

{boards}

While the [hub](glossary.md#hub) streams all {count} boards (natively emulated), its processor spends, for each
[frame](glossary.md#frame) of 61 [taxels](glossary.md#taxel) on average, {poll:,} cycles in I2C interrupts and
{frame:,} cycles on framing, the UART ({uart:,}) and the main loop, which waits awake when the transmit ring is full.
Frames are sent every {length:,} cycles, and the processor is awake for {share:.0%} of this time. I2C, framing and UART
must fit into the time between frames, so `make size` fails if the processor never sleeps.

## Cycles charged by the native emulator

A board or hub is emulated in one of two ways: its image is executed on the emulated processor, or the same C code
runs natively on the PC and is charged the cycles of `firmware/emulator/base/costs.h`. Both kinds of emulated boards
produce the same scans with the same counts, and their scans start at nearly the same times
(`hil_tests/test_hil_cortex_m0.py`). The difference is a random walk and grows with time. If a conversion ends while a
read is served, microseconds decide whether the conversion or the read is delayed. After 4 s and 80 reads at random
times the difference reached 52 us.

{costs}
"""


def parse_costs(header: str) -> dict[str, str]:
    """Return the values of the constants `COST_*` in the text of costs.h, by name without the prefix.

    Raises ValueError unless `MEANINGS` has exactly these constants.
    """
    values = dict(re.findall(r"#define COST_(\w+) (\{.*\}|\d+u)", header))
    unmatched = values.keys() ^ MEANINGS.keys()
    if unmatched:
        raise ValueError(f"costs.h and tools/firmware/costs_page.py do not both define {sorted(unmatched)[0]}")
    return {name: value.strip("{}").removesuffix("u") for name, value in values.items()}


def _format_board_line(board: BoardCycles) -> str:
    """Return the table row of a board kind: cycles of a scan and of a poll, length of a scan, and the share of the scan
    in which the processor is awake.
    """
    share = (board.scan + board.poll) / board.budget
    numbers = f"{board.taxels} | {board.scan:,} | {board.poll:,} | {board.length:,} | {share:.0%}"
    return f"| {board.kind} | {numbers} |"


def format_costs_page(costs: dict[str, str], cycles: FirmwareCycles) -> str:
    """Return the text of docs/firmware-cycles.md.

    costs: result of `parse_costs`. cycles: counted processor cycles of all boards and of the hub.
    """
    boards = ["| board | taxels | scan | poll | length of a scan | awake |", "|---|---:|---:|---:|---:|---:|"]
    boards += [_format_board_line(board) for board in cycles.boards]
    rows = ["| `COST_` | cycles | meaning | measurement |", "|---|---:|---|---|"]
    rows += [f"| {name} | {value} | {' | '.join(MEANINGS[name])} |" for name, value in costs.items()]
    hub = cycles.hub
    return PAGE.format(
        boards="\n".join(boards),
        costs="\n".join(rows),
        count=hub.boards,
        poll=hub.poll,
        frame=hub.frame,
        uart=hub.uart,
        length=hub.length,
        share=(hub.poll + hub.frame) / hub.length,
    )
