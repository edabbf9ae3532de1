"""The skin's rate with plain frames: the least of what scanning, I2C and UART allow, and how much of it is reached.

The emulator's boards and hub take the time that the firmware's images were counted to take (firmware/emulator/costs.h).
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from figures import Figure
from recorded import record

from taxel.hand import load_hand
from taxel.hand.world import ScanSettings, WorldSettings
from taxel.recording import read_boards
from taxel.signal import ACTIVATION_THRESHOLD_COUNTS
from taxel.stream.start_script import START_S
from taxel_protocol.limits import SNAPSHOT_OVERHEAD

VIRTUAL_S = 12.0
SETTLED_S = 2.0
I2C_CLOCKS_A_BYTE = 9
I2C_ADDRESS, I2C_START_STOP = 1, 2
UART_BITS_A_BYTE = 10
FRAME_OVERHEAD = 17
"""Bytes of a taxel frame's body beside the snapshot: frame header 5, taxel header 8, CRC 4."""

DELIMITERS = 2
SIGMAS = 5.0
DEFAULT = ScanSettings()
SCANS = {"default": DEFAULT, "fast": ScanSettings(sub_conversions=80), "fastest": ScanSettings(sub_conversions=40)}
CASES = (
    (100e3, 1e6, "default"), (400e3, 1e6, "default"), (1e6, 3e6, "default"), (1e6, 1e6, "default"),
    (400e3, 1e6, "fast"), (1e6, 3e6, "fast"), (1e6, 3e6, "fastest"),
)  # fmt: skip
I2C_SHARE, UART_SHARE = 0.95, 0.98


@dataclass(frozen=True)
class Rates:
    """Cycles a second that each part allows, the ones measured, and the noise.

    `sigma`: counts, root mean square over the taxels. `threshold`: what 150 counts at the default settings are here.
    """

    scan: float
    i2c: float
    uart: float
    measured: float
    sigma: float
    threshold: float

    @property
    def limit(self) -> str:
        """Which part allows least."""
        return min(("scan", "I2C", "UART"), key=lambda name: getattr(self, name.lower()))

    @property
    def ceiling(self) -> float:
        """What that part allows."""
        return min(self.scan, self.i2c, self.uart)


def i2c_bits(sizes: list[int]) -> int:
    """Bits on the bus of one read of each board of so many taxels."""
    data = [I2C_CLOCKS_A_BYTE * (I2C_ADDRESS + SNAPSHOT_OVERHEAD + 2 * n) + I2C_START_STOP for n in sizes]
    return sum(data)


def uart_bits(sizes: list[int]) -> int:
    """Bits on the UART of a frame of each board: body, a byte of stuffing for every 254, delimiters."""
    bodies = [FRAME_OVERHEAD + SNAPSHOT_OVERHEAD + 2 * n for n in sizes]
    return UART_BITS_A_BYTE * sum(body + 1 + body // 254 + DELIMITERS for body in bodies)


def rates(scl_hz: float, baud: float, scan: ScanSettings) -> Rates:
    """Measured on an emulated skin at rest."""
    sizes = [board.kind.taxel_count for board in load_hand("allegro").boards]
    with tempfile.TemporaryDirectory() as name:
        settings = WorldSettings(scl_hz=scl_hz, baud=baud, scan=scan)
        capture, statistics = record(Path(name), VIRTUAL_S, settings=settings)
        pieces = list(read_boards(capture))
    cycles, variances = [], []
    for address in pieces[0]:
        time_s = np.concatenate([piece[address].time_s for piece in pieces if address in piece])
        counts = np.concatenate([piece[address].raw_counts for piece in pieces if address in piece])
        late = time_s > START_S + SETTLED_S
        cycles.append((late.sum() - 1) / np.ptp(time_s[late]))
        variances.append(counts[late].var(axis=0, ddof=1))
    # A board scans all the time, from when it has booted.
    scans = min(board["scans"] for board in statistics["boards"]) / (VIRTUAL_S - 1e-3 * settings.boot_ms)
    return Rates(
        scans,
        scl_hz / i2c_bits(sizes),
        baud / uart_bits(sizes),
        float(np.median(cycles)),
        float(np.sqrt(np.concatenate(variances).mean())),
        ACTIVATION_THRESHOLD_COUNTS * scan.sub_conversions / DEFAULT.sub_conversions,
    )


def _figure(scl_hz: float, baud: float, name: str) -> Figure:
    scan, found = SCANS[name], rates(scl_hz, baud, SCANS[name])
    counts = found.threshold >= SIGMAS * found.sigma
    target = {"I2C": I2C_SHARE, "UART": UART_SHARE}.get(found.limit)
    speed = f"{scl_hz / 1e3:g} kHz" if scl_hz < 1e6 else f"{scl_hz / 1e6:g} MHz"
    detail = (
        f"{found.measured:.2f} Hz; scan {found.scan:.1f}, I2C {found.i2c:.2f}, UART {found.uart:.1f} Hz; "
        f"{scan.sub_conversions} sub-conversions of {scan.sense_clock_divider}; noise {found.sigma:.2f} counts, "
        f"threshold {found.threshold / found.sigma:.0f} sigma"
    )
    if not counts:
        return Figure(f"skin's rate, {speed}", None, target, f"{found.limit} ceiling", f"{detail}: too noisy to count")
    return Figure(
        f"skin's rate, {speed}, {baud / 1e6:g} Mbaud, {name} scan",
        found.measured / found.ceiling,
        target,
        f"{found.limit} ceiling",
        detail,
    )


def measure() -> list[Figure]:
    """Measured over the lowest ceiling, plain frames."""
    return [_figure(*case) for case in CASES]
