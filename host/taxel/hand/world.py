"""The emulator's world file (firmware/emulator/world_file.h) of a hand."""

import random
from collections.abc import Sequence
from dataclasses import dataclass, field

from taxel.hand.description import Hand


@dataclass(frozen=True)
class ScanSettings:
    """How boards measure a crossing at power-on; the fields of taxel_protocol.registers.ScanSettings."""

    sub_conversions: int = 160
    sense_clock_divider: int = 40
    modulator_clock_divider: int = 1
    idac_code: int = 16
    settle_cycles: int = 96


@dataclass(frozen=True)
class WorldSettings:
    """What surrounds the hand in the emulator.

    `noise_counts`: standard deviation of white read-out noise, counts. `clock_spread_ppm`: each board's oscillator is
    off by up to this much (PSoC 4200: up to 2 %). `parts_seed`: draws what stays from one power-up to the next: clocks,
    unique ids, gains and stiffness of taxels; None: `seed` does. `boot_ms`: from power to the first acknowledge.
    `faults`: lines of the world file without the word `fault`, in order of time, such as "1.5 unplug 0x22". `effects`:
    lines without the word `effect`, such as "spread film length_m=0.002" (firmware/emulator/README.md lists them).
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

    @property
    def parts(self) -> int:
        """The seed of what stays."""
        return self.seed if self.parts_seed is None else self.parts_seed


def sample_board_clocks_ppm(hand: Hand, settings: WorldSettings) -> list[float]:
    """How far each board's oscillator is off in this world, parts per million, in the order of `hand.boards`."""
    generator = random.Random(f"clock {settings.parts}")
    return [round(generator.uniform(-1.0, 1.0) * settings.clock_spread_ppm, 3) for _ in hand.boards]


def format_world(hand: Hand, settings: WorldSettings | None = None) -> str:
    """The world file of `hand` under `settings`."""
    settings = settings or WorldSettings()
    scan = settings.scan
    lines = [
        "taxel-world 1",
        f"# hand {hand.name}: {len(hand.boards)} boards, {hand.n_taxels} taxels",
        f"seed {settings.seed}",
        f"parts_seed {settings.parts}",
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
        unique_id = random.Random(f"unique id {settings.parts} {board.address}").randbytes(8).hex()
        lines.append(
            f"board 0x{board.address:02X} {kind.code} {kind.tx_count} {kind.rx_count} {kind.taxel_count} "
            f"{kind.crossing_bitmap().hex()} {unique_id} {ppm!r} {settings.boot_ms!r}"
        )
    lines += [f"fault {fault}" for fault in settings.faults]
    lines += [f"effect {effect}" for effect in settings.effects]
    return "\n".join(lines) + "\n"
