"""Count the cycles that the native emulator charges for the firmware in executed images.

    python tools/firmware/calibrate_costs.py [--check] [--images DIR]

Boards with the images of `make firmware` run in the emulator, which counts the cycles of every handler. Writes costs.h
and docs/firmware-cycles.md with the same figures; --check only reports whether one of them is stale.
"""

import argparse
import struct
import sys
from pathlib import Path
from typing import Final

from compact_costs import measure_compact
from costs_page import format_costs_page, parse_costs
from executed_world import BOARD_IMAGE, HUB_IMAGE, IMAGES, open_scanning_world
from firmware_cycles import measure
from hub_costs import measure_hub

from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.hand.boards import Board
from taxel.link.virtual import HandlerCost, VirtualWorld
from taxel_protocol import SNAPSHOT_OVERHEAD
from taxel_protocol.limits import REGISTER_SNAPSHOT

ROOT: Final = Path(__file__).parents[2]
COSTS: Final = ROOT / "firmware" / "emulator" / "base" / "costs.h"
PAGE: Final = ROOT / "docs" / "firmware-cycles.md"
SMALL, LARGE = 0x2C, 0x20
"""Boards of the hand `allegro` whose conversions together contain every case: the first taxel of both is behind a hole
of the crossing map, and one has 13 TX lines. The boards of the default hand begin with crossing 0, which hides the cost
of a skipped crossing at the start of a scan.
"""
CYCLES_PER_US: Final = 48
PERIOD: Final = 160 * 40
SETTLE_CYCLES: Final = 4 * (96 // 4 + 1)
QUOTIENTS: Final = 16
RUN_S: Final = 12.0
SHARE_BEFORE_START: Final = 0.9
"""Share of a conversion's interrupt before the start of the next conversion. Preemption within this share delays the
scan.
"""
TAIL_CHAIN: Final = 16 + 12 - 6
"""Cycles saved by an interrupt that is tail-chained (firmware/emulator/cortex_m0/cortex_m0.h)."""

HEAD: Final = """\
/* Cost of the firmware on a 48 MHz Cortex-M0 in CPU cycles, counted in the executed images by
 * `python tools/firmware/calibrate_costs.py`, which writes this file. docs/firmware-cycles.md defines each figure. */
#ifndef EMULATOR_BASE_COSTS_H
#define EMULATOR_BASE_COSTS_H

#define CPU_HZ 48000000.0

"""

Costs = dict[str, int | list[int]]


def round_exactly(value: float, quantity: str) -> int:
    """Round a measured number of processor cycles, which must be within 0.2 of a whole number.

    quantity: name of the number in the message. Raises ValueError if it is not whole.
    """
    if abs(value - round(value)) > 0.2:
        raise ValueError(f"{quantity}: expected whole cycles, found {value:.3f}")
    return round(value)


def list_crossings(board: Board) -> list[int]:
    """Return the indices of the crossings of a TX and an RX line at which the board has a taxel, in ascending order."""
    bits = board.kind.crossing_bitmap()
    crossings = range(board.kind.tx_count * board.kind.rx_count)
    return [crossing for crossing in crossings if bits[crossing >> 3] >> (crossing & 7) & 1]


def measure_conversions(world: VirtualWorld, board: Board) -> list[int]:
    """Return the processor cycles of each conversion interrupt of one scan, in the order of the crossings.

    The interrupt at the start of a scan is the most expensive one, which locates the scan among the interrupts.
    """
    costs: list[int] = []
    # Twice the number of taxels contains a whole scan, wherever the measurement begins.
    last = world.read_handler_costs(board.address)["CSD"]
    while len(costs) < 2 * board.kind.taxel_count + 1:
        world.run(40e-6)  # shorter than a conversion, so that no two interrupts are counted together
        now = world.read_handler_costs(board.address)["CSD"]
        if now.count > last.count:
            costs.append(now.own - last.own)
            last = now
    begin = costs.index(max(costs[: board.kind.taxel_count]))
    return costs[begin : begin + board.kind.taxel_count]


def measure_conversion_costs(scans: dict[int, tuple[Board, list[int]]]) -> Costs:
    """Return the processor cycles of the parts of a conversion interrupt.

    scans: for each board by address, the board and its result of `measure_conversions`. Keys of the result:

    - own: cycles of an interrupt for a crossing of TX line 0 that directly follows another crossing of this line.
    - quotient: additional cycles by TX line; the time of the division that computes the line depends on the quotient.
    - new_tx: additional cycles at the first crossing of a TX line.
    - skipped: additional cycles for each skipped crossing without a taxel.
    - scan_own: additional cycles at the start of a scan.

    The additional cycles are differences between interrupts. Raises ValueError if the cost of a skipped crossing is not
    a whole number, or if a board has a taxel at crossing 0.
    """
    cost_by_line: dict[int, int] = {}
    switching: list[tuple[int, int, int]] = []
    first: tuple[int, int] | None = None
    for board, costs in scans.values():
        crossings = list_crossings(board)
        if not crossings[0]:
            raise ValueError("the first crossing of a calibration board must not be number 0")
        for position, (crossing, cost) in enumerate(zip(crossings, costs, strict=True)):
            tx, skipped = (
                crossing // board.kind.rx_count,
                crossing - crossings[position - 1] - 1 if position else crossing,
            )
            if position == 0:
                first = first or (crossing, cost)
            elif tx == crossings[position - 1] // board.kind.rx_count:
                if not skipped:
                    cost_by_line[tx] = cost
            else:
                switching.append((tx, skipped, cost))
    base = cost_by_line[0]
    tx, skipped, cost = next(case for case in switching if case[1] == 0)
    new_tx = cost - cost_by_line[tx]
    tx, skipped, cost = next(case for case in switching if case[1])
    skipped_cost = round_exactly((cost - cost_by_line[tx] - new_tx) / skipped, "a skipped crossing")
    assert first is not None
    quotient_costs = {q: cost_by_line[q] - base for q in cost_by_line}
    return {
        "own": base,
        "quotient": [quotient_costs.get(q, max(quotient_costs.values())) for q in range(QUOTIENTS)],
        "new_tx": new_tx,
        "skipped": skipped_cost,
        "scan_own": first[1] - base - new_tx - skipped_cost * first[0],
    }


def read_snapshot(world: VirtualWorld, board: Board) -> tuple[int, int, HandlerCost]:
    """Read a snapshot of an emulated board.

    Returns its scan number, its board time in microseconds, and the cycle counts of the conversion interrupt.
    """
    _, data = world.transfer(board.address, b"", SNAPSHOT_OVERHEAD + 2 * board.kind.taxel_count)
    sequence, time_us = struct.unpack_from("<HI", data)
    return sequence, time_us, world.read_handler_costs(board.address)["CSD"]


def measure_scan_overhead(world: VirtualWorld, board: Board) -> tuple[float, float]:
    """Return the processor cycles of a scan beyond its conversion periods, and the board time of scan number 0.

    The board time is in microseconds. The cycles do not include the delays by other interrupts: the latency of the
    conversion interrupt, and its preemption before the start of the next conversion.
    """
    world.transfer(board.address, bytes([REGISTER_SNAPSHOT]), 0)
    world.run(0.05)
    first_scan, first_time_us, before = read_snapshot(world, board)
    world.run(RUN_S)
    last_scan, last_time_us, account = read_snapshot(world, board)
    scans = last_scan - first_scan
    period_us = (last_time_us - first_time_us) / scans
    # Inclusive minus own cycles: the cycles in which other handlers preempt the conversion interrupt.
    interrupt_delay = (account.inclusive - account.own - before.inclusive + before.own) * SHARE_BEFORE_START
    interrupt_delay += account.latency - before.latency
    overhead = period_us * CYCLES_PER_US - PERIOD * board.kind.taxel_count - interrupt_delay / scans
    return overhead, first_time_us - first_scan * period_us


def measure_slave_costs(world: VirtualWorld, board: Board) -> Costs:
    """Measure the processor cycles of a board's I2C interrupts, and the cycles by which each delays the bus
    ("..._hold").

    Each value is the minimum of several transfers, so no other interrupt has prolonged it.
    """

    def find_fastest_transfer(write: bytes, size: int) -> tuple[int, float]:
        """Return the fewest cycles of the I2C interrupt, and of the whole transfer, in 12 repetitions.

        write: bytes written. size: number of bytes read. Another interrupt may prolong a repetition.
        """
        own, durations = [], []
        # With this pause the repetitions start at different phases of the other interrupts.
        for _ in range(12):
            world.run(0.00113)
            before, begin = world.read_handler_costs(board.address)["SCB0"], world.now_s
            world.transfer(board.address, write, size)
            durations.append((world.now_s - begin) * 1e6 * CYCLES_PER_US)
            world.run(0.0001)
            own.append(world.read_handler_costs(board.address)["SCB0"].own - before.own)
        return min(own), min(durations)

    # One clock of the bus at 400 kHz, in cycles. A transfer has 9 clocks for each byte, including the address, and 2
    # clocks for start and stop: 11 for the probe, 29 for the read of 2 bytes.
    clock = CYCLES_PER_US * 2.5
    pointer = bytes([REGISTER_SNAPSHOT])
    stop = world.read_handler_costs(board.address)["SCB0"].own_min
    probe = find_fastest_transfer(b"", 0)
    # 0xF0 is not a register of the map, so these writes change no setting.
    shorter, longer = find_fastest_transfer(bytes([0xF0, 1]), 0), find_fastest_transfer(bytes([0xF0, 1, 1]), 0)
    world.transfer(board.address, pointer, 0)
    read, refilled = find_fastest_transfer(b"", 2), find_fastest_transfer(b"", 6)
    return {
        "slave_write": probe[0] - stop,
        "slave_write_hold": round(probe[1] - 11 * clock),
        "slave_read": read[0] - stop,
        "slave_read_hold": round(read[1] - 29 * clock),
        "slave_byte": longer[0] - shorter[0],
        "slave_byte_hold": round(longer[1] - shorter[1] - 9 * clock),
        "slave_refill": refilled[0] - read[0],
        "slave_stop": stop,
    }


def measure_board(image: Path) -> Costs:
    """Measure all processor costs of a sensor board that executes a firmware image, in cycles by name.

    image: path of the image. Raises ValueError if the measurements contradict the model of costs.h.
    """
    hand = load_hand("allegro")
    scans, overheads = {}, {}
    costs: Costs = {}
    for address in (SMALL, LARGE):
        board = hand.get_board(address)
        with open_scanning_world(hand, board, image) as world:
            scans[address] = (board, measure_conversions(world, board))
            tick = world.read_handler_costs(address)["SysTick"]
            overheads[address] = measure_scan_overhead(world, board)
            if address == SMALL:
                costs.update(measure_slave_costs(world, board))
    costs.update(measure_conversion_costs(scans))
    own, scan_own = costs["own"], costs["scan_own"]
    assert isinstance(own, int)
    assert isinstance(scan_own, int)
    # Cycles after the start of the next conversion do not lengthen a scan. Their number is the sum of the interrupts
    # minus the measured overhead: a constant for each conversion plus a constant for each scan.
    remainders = {address: sum(cycles) - overheads[address][0] for address, (_, cycles) in scans.items()}
    counts = {address: scans[address][0].kind.taxel_count for address in scans}
    after = round((remainders[LARGE] - remainders[SMALL]) / (counts[LARGE] - counts[SMALL]))
    after_scan = round(remainders[SMALL] - after * counts[SMALL])
    return costs | {
        "conversion": own - SETTLE_CYCLES - after,
        "scan": scan_own - after_scan,
        "after_start": after,
        "after_scan": after_scan,
        "sensor_init": round(overheads[SMALL][1] * CYCLES_PER_US),
        "tick": round(tick.own / tick.count),
    }


def format_header(board: Costs, hub: Costs) -> str:
    """Return the text of the C header costs.h with the processor costs of board and hub."""

    def format_definition(name: str, value: int | list[int]) -> str:
        """Return the C line that defines a cost as a macro: a number, or an initializer for a list."""
        text = "{" + ", ".join(map(str, value)) + "}" if isinstance(value, list) else f"{value}u"
        return f"#define COST_{name.upper()} {text}"

    # Numbers in this function are constants of firmware and processor, which are not measured.
    conversion = [
        format_definition("conversion", board["conversion"]),
        format_definition("settle_loop", 4),
        format_definition("quotient", board["quotient"]),
        format_definition("new_tx", board["new_tx"]),
        format_definition("skipped_crossing", board["skipped"]),
        *(format_definition(name, board[name]) for name in ("scan", "after_start", "after_scan", "sensor_init")),
    ]
    tick = [
        format_definition("tick", board["tick"]),
        format_definition("tick_period", 4096 * CYCLES_PER_US),
        format_definition("tail_chain", TAIL_CHAIN),
    ]
    slave = [format_definition(name, board[name]) for name in board if name.startswith("slave_")]
    slave.append(format_definition("slave_fifo", 8))
    compact = [format_definition(name, board[name]) for name in ("compact", "compact_taxel")]
    blocks = [
        "\n".join(block)
        for block in (conversion, tick, slave, compact, [format_definition(name, hub[name]) for name in hub])
    ]
    return HEAD + "\n\n".join(blocks) + "\n\n#endif\n"


def main() -> int:
    """Measure the costs of the firmware images, and write costs.h and its page, or with --check compare them.

    The exit status is 1 after an error, which is one line, or if a file is stale.
    """
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="only report whether costs.h or its page is stale")
    parser.add_argument("--images", type=Path, default=IMAGES, help="folder of the images that `make firmware` builds")
    options = parser.parse_args()
    try:
        board = options.images / BOARD_IMAGE
        costs = measure_board(board) | measure_compact(board), measure_hub(options.images / HUB_IMAGE)
        texts = {
            COSTS: format_header(*costs),
            PAGE: format_costs_page(parse_costs(format_header(*costs)), measure(options.images)),
        }
    except (TaxelError, OSError, ValueError) as error:
        print(f"calibrate_costs: {error}", file=sys.stderr)
        return 1
    stale = [path for path, text in texts.items() if not path.exists() or path.read_text() != text]
    for path in stale:
        if options.check:
            print(f"{path.relative_to(ROOT)} is stale: run python tools/firmware/calibrate_costs.py", file=sys.stderr)
        else:
            path.write_text(texts[path])
    return 1 if stale and options.check else 0


if __name__ == "__main__":
    sys.exit(main())
