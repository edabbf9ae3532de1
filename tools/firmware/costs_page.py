"""docs/firmware-cycles.md: what each figure of costs.h is, how it was counted, and what the firmware takes in all."""

from __future__ import annotations

import re
from typing import Final

from firmware_cycles import BoardCycles, FirmwareCycles

MEANINGS: Final[dict[str, tuple[str, str]]] = {
    "CONVERSION": (
        "a conversion's interrupt, from the request to the start of the next conversion, without what follows",
        "interrupts of a scan, one by one; the rest of a scan's length as the board's clock tells it",
    ),
    "SETTLE_LOOP": ("a turn of the loop that waits for `settle_cycles`", "by instruction"),
    "QUOTIENT": ("besides, for finding the TX line: 0 to 15", "differences between lines of 0x2C and 0x20"),
    "NEW_TX": ("besides, if the TX line is another than before", "first conversion of a line less its others"),
    "SKIPPED_CROSSING": ("besides, for a crossing that is no taxel", "conversions behind holes of the crossing map"),
    "SCAN": ("besides, at the end of a scan: snapshot published, CRC begun anew", "the longest interrupt of a scan"),
    "AFTER_START": (
        "the rest of the interrupt, behind the start of the next conversion",
        "scans' lengths of two boards against the sum of their interrupts",
    ),
    "AFTER_SCAN": ("the same at the end of a scan, besides", "as before"),
    "SENSOR_INIT": ("from the image's first instruction to the start of the first conversion", "the first scan's time"),
    "TICK": ("SysTick's interrupt", "mean of all"),
    "TICK_PERIOD": ("between two of them", "`ticks.c`: 4,096 us"),
    "TAIL_CHAIN": ("saved by an interrupt that follows another at once", "`cortex_m0_timing`: 16 + 12 - 6"),
    "SLAVE_WRITE": ("address for writing, and the first byte: processor", "the fewest of 12 transfers"),
    "SLAVE_WRITE_HOLD": ("the same: SCL is held", "length of the transfer less its clocks, the fewest of 12"),
    "SLAVE_READ": ("address for reading, FIFO filled: processor", "as SLAVE_WRITE"),
    "SLAVE_READ_HOLD": ("the same: SCL is held", "as SLAVE_WRITE_HOLD"),
    "SLAVE_BYTE": ("each further byte written: processor", "a byte more against a byte less"),
    "SLAVE_BYTE_HOLD": ("the same: SCL is held", "as before"),
    "SLAVE_REFILL": ("four bytes more into the FIFO; SCL is not held", "a read of 6 bytes against one of 2"),
    "SLAVE_STOP": ("a stop condition", "the cheapest interrupt of the slave"),
    "SLAVE_FIFO": ("bytes in the FIFO", "the block"),
    "COMPACT": (
        "a compact snapshot, coded by the board's main loop",
        "two boards, streamed compact and plain",
    ),
    "COMPACT_TAXEL": ("besides, each of its taxels (noise of 4 counts)", "as before"),
    "MASTER_DONE": ("the hub's I2C interrupt that ends a transfer", "the cheapest of its I2C interrupts"),
    "MASTER_BYTE": (
        "the hub's I2C interrupts, for each byte on the bus: SCL is seldom held (not charged)",
        "their sum over the bytes while it streams a board",
    ),
    "HUB_PASS": ("a pass of the hub's main loop that starts a transfer", "between two probes of empty addresses"),
    "HUB_FRAME_BYTE": (
        "each byte of a frame: CRC, whitening, byte stuffing",
        "60,000 samples of where the processor is while it streams",
    ),
    "UART_INTERRUPT": ("the UART's interrupt", "the cheapest of them"),
    "UART_BYTE": ("besides, each byte that it moves", "their sum less the row above"),
}
"""What each figure is, and how it was counted."""

PAGE: Final = """# Cycles of the firmware

Written by `python tools/firmware/calibrate_costs.py` (`--check` says whether it is stale; `make firmware` first). The
images run on the emulator's Cortex-M0 at 48 MHz, the wait state of the flash included; what of its timing is published
and what is taken is in [its README](../firmware/emulator/cortex_m0/README.md). Nothing was counted on silicon.

## What they take

Cycles in which a board's processor is awake. A scan lasts as long as its conversions; the budget of scan and poll
together is that length. A poll is a read of the whole snapshot.

{boards}

The hub while it streams all {count} boards (natively emulated), per frame of 63 taxels in the mean: {poll:,} cycles in
I2C interrupts; {frame:,} for framing, the UART ({uart:,}) and the main loop, which waits awake when its transmit ring
is full. A frame goes out every {length:,} cycles: awake for {share:.0%} of them. The budget of both is that time, so
`make size` fails when the processor never sleeps.

## What the native emulator charges

`firmware/emulator/costs.h`. A natively emulated board or hub runs the same C at once and is charged these cycles.
Executed and native boards then show the same scans with the same counts, begun within 50 us of each other over
seconds. It is a random walk: where a conversion ends while a read is answered, microseconds decide which waits. After
4 s and 80 reads at random instants it reached 52 us.
(`hil_tests/test_hil_cortex_m0.py`).

{costs}
"""


def costs_of(header: str) -> dict[str, str]:
    """The figures of costs.h by name, as they stand there. Raises ValueError for one that nobody has explained."""
    found = dict(re.findall(r"#define COST_(\w+) (\{.*\}|\d+u)", header))
    unknown = found.keys() ^ MEANINGS.keys()
    if unknown:
        raise ValueError(f"costs.h and tools/firmware/costs_page.py disagree about {sorted(unknown)[0]}")
    return {name: value.strip("{}").removesuffix("u") for name, value in found.items()}


def _board_line(board: BoardCycles) -> str:
    share = (board.scan + board.poll) / board.budget
    numbers = f"{board.taxels} | {board.scan:,} | {board.poll:,} | {board.length:,} | {share:.0%}"
    return f"| {board.kind} | {numbers} |"


def costs_page(costs: dict[str, str], cycles: FirmwareCycles) -> str:
    """The whole page."""
    boards = ["| board | taxels | scan | poll | length of a scan | awake |", "|---|---:|---:|---:|---:|---:|"]
    boards += [_board_line(board) for board in cycles.boards]
    rows = ["| `COST_` | cycles | what | counted by |", "|---|---:|---|---|"]
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
