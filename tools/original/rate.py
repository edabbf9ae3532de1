"""Rate of the emulated original hub, with a table of where the time of its poll cycle goes.

    python tools/original/rate.py             # print the table
    python tools/original/rate.py --update    # also write it to firmware/emulator/README.md

Every figure is the emulator's own account of 20 s of virtual time, without the first poll cycle. Each row switches some
causes of the rate: the delay after a cycle, the pacing of the UART driver, the size of its ring, the clock of the bus.
"""

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from taxel.hand import Hand, load_hand
from taxel.hand.original_firmware import FIRST_GENERATION, THESIS, OriginalFirmware
from taxel.hand.world import format_world, make_original_settings
from taxel.link.emulator import run_emulator
from taxel.output import write_whole

README: Final = Path(__file__).resolve().parents[2] / "firmware" / "emulator" / "README.md"
BEGIN, END = "<!-- table of tools/original/rate.py -->\n", "<!-- end of the table -->\n"
SECONDS: Final = 20.0

DROPPED_BY_THE_HOST: Final = (0x0B, 0x17)
"""The two fingertip boards whose messages the parser of the original host dropped; 15 boards, 905 taxels, remain."""

THESIS_RATE_HZ: Final = 115200.0 / 10.0 / 1930.0
"""5.97 Hz: bytes per second of the UART divided by the bytes of 15 messages."""


@dataclass(frozen=True)
class Configuration:
    """A row of the table: name, packaged hand, firmware settings, and settings of the world."""

    name: str
    hand: str
    firmware: OriginalFirmware
    settings: dict[str, float]


@dataclass(frozen=True)
class Measurement:
    """Means over the poll cycles of one run, in milliseconds per cycle unless stated otherwise.

    call, read, retry, blocked, delay: time of the main program of the hub; their sum is `cycle`. wire: time in which
    the UART sends. pacing: time in which bytes wait for a tick of the UART driver while the wire is idle. rate_hz:
    cycles per second. wire_bytes: bytes per cycle.
    """

    rate_hz: float
    cycle: float
    call: float
    read: float
    retry: float
    blocked: float
    delay: float
    wire: float
    pacing: float
    wire_bytes: float

    @property
    def wire_share(self) -> float:
        """Share of the time in which the wire of the UART is busy, 0 to 1."""
        return self.wire / self.cycle


def list_configurations() -> list[Configuration]:
    """Return the rows of the table, from the public firmware to the settings of the thesis."""
    kept = replace(FIRST_GENERATION, skipped_addresses=DROPPED_BY_THE_HOST)
    thesis = replace(THESIS, skipped_addresses=DROPPED_BY_THE_HOST)
    row = Configuration
    return [
        row("first generation, 22 boards", "first_generation", FIRST_GENERATION, {}),
        row("15 boards of the thesis, same firmware", "original", kept, {}),
        row("without delay", "original", replace(kept, delay_ms=0.0), {}),
        row("without pacing", "original", replace(kept, is_paced=False), {}),
        row("without delay and pacing", "original", replace(kept, delay_ms=0.0, is_paced=False), {}),
        row("**also a ring of 256 bytes (settings of the thesis)**", "original", thesis, {}),
        row("without delay and pacing, bus at 400 kbit/s", "original",
            replace(kept, delay_ms=0.0, is_paced=False), {"scl_hz": 400e3}),
        row("settings of the thesis, all 17 boards", "original", THESIS, {}),
        row("settings of the thesis, 230,400 baud", "original", thesis, {"baud": 230400.0}),
        row("settings of the thesis, bus at 400 kbit/s", "original", thesis, {"scl_hz": 400e3}),
        row("settings of the thesis, both", "original", thesis, {"baud": 230400.0, "scl_hz": 400e3}),
        row("settings of the thesis, 117,647 baud (divider of the hub)", "original", thesis, {"baud": 117647.0}),
        row("with the delay: ring of 1,024 bytes, bus at 400 kbit/s", "original",
            replace(thesis, delay_ms=50.0, ring_size=1024), {"scl_hz": 400e3}),
    ]  # fmt: skip


def measure(hand: Hand, configuration: Configuration, seconds: float = SECONDS) -> Measurement:
    """Run the emulated hub of a configuration for `seconds` of virtual time and return its rate and times."""
    numbers: dict[str, Any] = configuration.settings
    world = format_world(hand, make_original_settings(configuration.firmware, clock_spread_ppm=0.0, **numbers))
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        account = run_emulator(world, Path(folder) / "stream.bin", seconds)["original"]
    # The account contains times in seconds, with names such as "wire_s"; the result has milliseconds per cycle.
    per_cycle = {name[:-2]: 1e3 * account[name] / account["cycles"] for name in account if name.endswith("_s")}
    return Measurement(
        rate_hz=account["cycles"] / account["seconds"],
        cycle=1e3 * account["seconds"] / account["cycles"],
        wire_bytes=account["wire_bytes"] / account["cycles"],
        **per_cycle,
    )


def format_table(rows: Sequence[tuple[Configuration, Measurement]]) -> str:
    """Return the Markdown table of the measurements, one row per configuration."""
    lines = [
        "| configuration | rate, Hz | cycle | call and reads | failed tries | hub waits for the ring | delay "
        "| wire busy | wire waits for a tick | bytes | wire busy, % |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for configuration, m in rows:
        lines.append(
            f"| {configuration.name} | {m.rate_hz:.2f} | {m.cycle:.1f} | {m.call + m.read:.1f} | {m.retry:.1f} "
            f"| {m.blocked:.1f} | {m.delay:.1f} | {m.wire:.1f} | {m.pacing:.1f} | {m.wire_bytes:.0f} "
            f"| {100 * m.wire_share:.1f} |"
        )
    return "\n".join(lines) + "\n"


def measure_table(seconds: float = SECONDS) -> str:
    """Measure all configurations and return the Markdown table."""
    configurations = list_configurations()
    hands = {name: load_hand(name) for name in {row.hand for row in configurations}}
    return format_table([(row, measure(hands[row.hand], row, seconds)) for row in configurations])


def replace_table(page: str, table: str) -> str:
    """Return the page with the table between its two marks replaced. Raises ValueError if a mark is missing."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{README}: expected the marks {BEGIN!r} and {END!r}")
    return before + begin + table + end + after


def main() -> None:
    """Print the table; with --update, also write it to the emulator's page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--update", action="store_true", help="write the table to firmware/emulator/README.md")
    arguments = parser.parse_args()
    table = measure_table()
    print(table, end="")
    print(f"limit of the UART for 15 boards: {THESIS_RATE_HZ:.2f} Hz")
    if arguments.update:
        write_whole(README, replace_table(README.read_text(), table))


if __name__ == "__main__":
    main()
