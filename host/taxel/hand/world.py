"""World file of the emulator (firmware/emulator/world_file/world_file.h) for a hand."""

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from taxel.hand.boards import BoardKind
from taxel.hand.description import Hand
from taxel.hand.original_firmware import THESIS, OriginalFirmware, format_original
from taxel.hand.sheet import build_sheet
from taxel.hand.wiring import Wiring
from taxel.types import FloatArray
from taxel_protocol.limits import CROSSING_MAP_SIZE, LINES_MAX


@dataclass(frozen=True)
class ScanSettings:
    """Scan settings of the boards at power-on; fields of `taxel_protocol.registers.ScanSettings`."""

    sub_conversions: int = 160
    sense_clock_divider: int = 40
    modulator_clock_divider: int = 1
    idac_code: int = 16
    settle_cycles: int = 96


@dataclass(frozen=True)
class WorldSettings:
    """Settings of the emulated world of a hand.

    `noise_counts`: standard deviation of white read-out noise, counts. `clock_spread_ppm`: largest rate error of a
    board's oscillator (PSoC 4200: up to 2 %). `parts_seed`: seed of the properties that persist over power cycles
    (clocks, unique ids, taxel gains and stiffness); None: `seed`. `boot_ms`: time from power-on to the first
    acknowledge. `faults`: lines of the world file without the keyword `fault`, in order of time, such as "1.5 unplug
    0x1C". `effects`: lines without the keyword `effect`, such as "spread film length_m=0.002" (see
    firmware/emulator/README.md). `wiring`: branches with other values than those of the hand; None: those of the hand.
    A fault of a branch may name the branch instead of an address: "2 branch_open index 0". `original`: the original
    hub and boards in place of the project's own firmware; `make_original_settings` sets the other fields to the values
    of the original hardware.
    """

    seed: int = 1
    parts_seed: int | None = None
    scl_hz: float = 400e3
    baud: float = 1e6
    usb_latency_ms: float = 16.0
    noise_counts: float = 4.0
    clock_spread_ppm: float = 20e3
    hub_clock_ppm: float = 0.0
    boot_ms: float = 40.0
    scan: ScanSettings = field(default_factory=ScanSettings)
    faults: Sequence[str] = ()
    effects: Sequence[str] = ()
    wiring: Wiring | None = None
    original: OriginalFirmware | None = None

    @property
    def effective_parts_seed(self) -> int:
        """Seed of the properties of parts that persist over power cycles: `parts_seed`, or `seed` if that is None."""
        return self.seed if self.parts_seed is None else self.parts_seed


ADDRESSES_PER_LINE: Final = 16
"""Largest number of addresses in a branch line of the world file."""

ORIGINAL_SCAN: Final = ScanSettings(100, 40, 4, 4, 0)
"""Scan settings of the original boards: 12 MHz modulator clock, 300 kHz TX clock, 4,000 counts in 333 us per taxel.

With the capacitance of the emulated taxels the IDAC code gives 38 % of full scale at rest; original boards calibrate to
40 %.
"""


def make_original_settings(firmware: OriginalFirmware = THESIS, **settings: Any) -> WorldSettings:
    """Make world settings with the original hub and boards, 100 kbit/s I2C, 115,200 baud and the original scan.

    settings: further fields of `WorldSettings`, which take precedence.
    """
    return WorldSettings(**{"scl_hz": 100e3, "baud": 115200.0, "scan": ORIGINAL_SCAN, **settings}, original=firmware)


def sample_board_clocks_ppm(hand: Hand, settings: WorldSettings) -> list[float]:
    """Sample the rate error of each board's oscillator, parts per million, in the order of `hand.boards`."""
    generator = random.Random(f"clock {settings.effective_parts_seed}")
    return [round(generator.uniform(-1.0, 1.0) * settings.clock_spread_ppm, 3) for _ in hand.boards]


def format_world(hand: Hand, settings: WorldSettings | None = None) -> str:
    """Format the world file of `hand` with `settings`; None: default settings.

    Raises ValueError if the original hub of `settings` skips a board that the hand does not have, or all boards.
    """
    settings = settings or WorldSettings()
    scan = settings.scan
    lines = [
        "taxel-world 1",
        f"# hand {hand.name}: {len(hand.boards)} boards, {hand.n_taxels} taxels",
        f"seed {settings.seed}",
        f"parts_seed {settings.effective_parts_seed}",
        *([format_original(hand, settings.original)] if settings.original else []),
        f"scl_hz {settings.scl_hz!r}",
        f"baud {settings.baud:.10g}",
        f"usb_latency_ms {settings.usb_latency_ms!r}",
        f"noise_counts {settings.noise_counts!r}",
        f"hub_clock_ppm {settings.hub_clock_ppm!r}",
        f"scan {scan.sub_conversions} {scan.sense_clock_divider} {scan.modulator_clock_divider} {scan.idac_code} "
        f"{scan.settle_cycles}",
        "# board address kind rows columns taxels crossing_map unique_id clock_ppm boot_ms",
    ]
    for board, ppm in zip(hand.boards, sample_board_clocks_ppm(hand, settings), strict=True):
        kind = board.kind
        unique_id = random.Random(f"unique id {settings.effective_parts_seed} {board.address}").randbytes(8).hex()
        lines.append(
            f"board 0x{board.address:02X} {kind.code} {_format_lines(kind, settings)} "
            f"{unique_id} {ppm!r} {settings.boot_ms!r}"
        )
    lines += format_surface(hand) if has_layout(hand) else []
    lines += _format_wiring(hand, settings.wiring or hand.wiring)
    lines += [f"fault {_resolve_branch(hand, fault)}" for fault in settings.faults]
    lines += [f"effect {effect}" for effect in settings.effects]
    return "\n".join(lines) + "\n"


def _format_wiring(hand: Hand, wiring: Wiring | None) -> list[str]:
    """Format the world-file lines of the star of branches; no lines for a hand without branches."""
    if wiring is None:
        return []
    kind = "buffered" if wiring.is_buffered else "passive"
    lines = [f"wiring {kind} {wiring.hub_pullup_ohm!r} {wiring.hub_capacitance_pf!r}"]
    for branch in wiring.branches:
        values = f"branch {branch.name} {branch.pullup_ohm!r} {branch.capacitance_pf!r} {branch.series_ohm!r}"
        addresses = [f"0x{board.address:02X}" for board in hand.boards if board.branch == branch.name]
        for first in range(0, len(addresses), ADDRESSES_PER_LINE):
            lines.append(f"{values} {' '.join(addresses[first : first + ADDRESSES_PER_LINE])}")
    return lines


def _resolve_branch(hand: Hand, fault: str) -> str:
    """Return a fault line in which the name of a branch is replaced by the address of its first board."""
    words = fault.split()
    if len(words) > 2 and words[1].startswith("branch_") and words[2] in hand.branches:
        words[2] = f"0x{hand.find_branch(words[2])[0].address:02X}"
    return " ".join(words)


def _format_lines(kind: BoardKind, settings: WorldSettings) -> str:
    """Format the words of a board line for its kind: TX lines, RX lines, taxels and crossing map.

    With the original firmware, a kind may have more than 16 lines: a board of the first generation has one TX line and
    up to 25 RX lines. Its taxels are then described as consecutive crossings of 16 RX lines. The taxels keep their
    order, so the order of the counts in a message is unchanged.
    """
    if settings.original and max(kind.tx_count, kind.rx_count) > LINES_MAX:
        crossings = (1 << kind.taxel_count) - 1
        rows = -(-kind.taxel_count // LINES_MAX)
        return f"{rows} {LINES_MAX} {kind.taxel_count} {crossings.to_bytes(CROSSING_MAP_SIZE, 'little').hex()}"
    return f"{kind.tx_count} {kind.rx_count} {kind.taxel_count} {kind.crossing_bitmap().hex()}"


def has_layout(hand: Hand) -> bool:
    """Return whether the layout of a kind of board is described; a world file then contains the hand's surface."""
    return any(board.kind.layout is not None for board in hand.boards)


def format_surface(hand: Hand) -> list[str]:
    """Format the world-file lines of taxels and margin: pose, sides of the square (metres); row and column of taxels.

    Raises HandGeometryError if the description contains no positions.
    """
    sheet = build_sheet(hand)
    poses = np.hstack([sheet.position, sheet.normal, sheet.distal, sheet.size])
    addresses = [hand.boards[index].address for index in sheet.board_index.tolist()]
    lines = ["# surface board x y z nx ny nz dx dy dz a b row column (d: distal direction, a, b: sides of the square)"]
    places = zip(hand.row.tolist(), hand.column.tolist(), strict=True)
    # The sheet begins with the taxels, so that this loop ends before the margin.
    for address, pose, (row, column) in zip(addresses, poses, places, strict=False):
        lines.append(f"surface 0x{address:02X} {_format_numbers(pose)} {row} {column}")
    margin = slice(hand.n_taxels, None)
    for address, pose in zip(addresses[margin], poses[margin], strict=True):
        lines.append(f"margin 0x{address:02X} {_format_numbers(pose)}")
    return lines


def _format_numbers(values: FloatArray) -> str:
    """Format numbers with 12 digits, separated by spaces."""
    return " ".join(f"{value:.12g}" for value in values.tolist())
