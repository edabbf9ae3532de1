"""Frame rate of a skin relative to the ceiling of its I2C bus, and frames that are missing without a counted cause."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from taxel.errors import TaxelError
from taxel.link import Link, get_clock
from taxel.stream import HubClient
from taxel_protocol.limits import SNAPSHOT_OVERHEAD

CLOCKS_A_BYTE: Final = 9
"""Eight bits and the acknowledge (I2C specification UM10204, section 3.1.5)."""

START_STOP_CLOCKS: Final = 2
DISCOVERY_S: Final = 1.0
"""Longest wait for boards, seconds: as `taxel.skin.DISCOVERY_TIMEOUT_S`."""

SETTLING_S: Final = 1.0
"""Time after START that is not measured, seconds: the hub reads the clock of each board in the first cycles."""


@dataclass(frozen=True)
class SkinRate:
    """Measured rate of a skin.

    `boards`: frames per second by address. `hz`: the lowest of them. `scl_hz`: clock of the bus. `ceiling_hz`: rate of
    a bus that transfers nothing but one uncompressed snapshot of each board in turn. `share`: `hz` / `ceiling_hz`.
    `frames`, `missing`: received and missing frames of the measurement; `unexplained`: missing frames that no counter
    of the hub explains, and frames lost between hub and host.
    """

    boards: dict[int, float]
    hz: float
    scl_hz: float
    ceiling_hz: float
    share: float
    seconds: float
    frames: int
    missing: int
    unexplained: int


def compute_ceiling_hz(scl_hz: float, taxel_counts: Mapping[int, int]) -> float:
    """Compute the poll cycles per second of a bus that transfers snapshots without pauses.

    scl_hz: clock of the bus. taxel_counts: number of taxels of each board, by address. A transfer has an address byte,
    the overhead of the snapshot (such as its CRC), and two bytes for each taxel.
    """
    clocks = sum(
        CLOCKS_A_BYTE * (1 + SNAPSHOT_OVERHEAD + 2 * taxels) + START_STOP_CLOCKS for taxels in taxel_counts.values()
    )
    return scl_hz / clocks


def measure_rate(link: Link, scl_hz: float, seconds: float) -> SkinRate:
    """Stream uncompressed frames for `seconds` on the link's clock, and compare their rate with the ceiling of the bus.

    scl_hz: clock of the bus, Hz. Raises `TaxelError` if no board answers or a board sends no frames.
    """
    now_s = get_clock(link)
    hub = HubClient(link)
    try:
        hub.handshake()
        taxel_counts = _read_taxel_counts(hub, link)
        hub.set_rate(None)
        hub.start()
        hub.wait(SETTLING_S)
        failed_before, missing_before = _count_failed_polls(hub), _count_missing(hub)
        lost_before, start_s = hub.stream.losses.lost_on_wire, now_s()
        hub.stream.frames.clear()
        hub.wait(seconds)
        elapsed_s, frames = now_s() - start_s, list(hub.stream.frames)
        missing = _count_missing(hub) - missing_before
        explained = _count_failed_polls(hub) - failed_before
        lost = hub.stream.losses.lost_on_wire - lost_before
        hub.stop()
    finally:
        hub.stream.release()
    counts = {address: sum(frame.address == address for frame in frames) for address in taxel_counts}
    rates = {address: count / elapsed_s for address, count in sorted(counts.items())}
    ceiling_hz, lowest = compute_ceiling_hz(scl_hz, taxel_counts), min(rates.values())
    unexplained = max(0, missing - explained) + lost
    return SkinRate(
        rates, lowest, scl_hz, ceiling_hz, lowest / ceiling_hz, elapsed_s, len(frames), missing, unexplained
    )


def _read_taxel_counts(hub: HubClient, link: Link) -> dict[int, int]:
    """Read the number of taxels of each board that the hub has found, by address.

    The search ends when two successive readings have the same number of boards. Raises `TaxelError` if there is no
    board after `DISCOVERY_S`.
    """
    now_s = get_clock(link)
    deadline, found = now_s() + DISCOVERY_S, -1
    while True:
        hub.read_boards()
        if len(hub.boards) == found > 0:
            return {address: int(fields["identity_taxel_count"]) for address, fields in hub.boards.items()}
        if now_s() > deadline:
            raise TaxelError(f"{link.name}: no board answers; check power and wiring, and run taxel scan")
        found = len(hub.boards)
        hub.wait(0.1)


def _count_failed_polls(hub: HubClient) -> int:
    """Read the hub's counters, and count the polls of all boards that led to no forwarded snapshot."""
    hub.read_status()
    names = ("repeated", "nacks", "timeouts", "crc_errors", "bus_errors", "dropped")
    return sum(int(fields[name]) for fields in hub.board_status.values() for name in names)


def _count_missing(hub: HubClient) -> int:
    """Count the frames of all boards that are missing in the stream, according to their poll cycles."""
    return sum(count.missing for count in hub.stream.losses.boards.values())
