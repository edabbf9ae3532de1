"""Skin rate with uncompressed frames: the lowest of the limits of scanning, I2C and UART, and the share that is
reached.

The boards and the hub of the emulator take the time counted in the firmware's images (firmware/emulator/base/costs.h).
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from figures import Figure
from recordings import make_settings, record

from taxel.hand import load_hand
from taxel.hand.world import ScanSettings
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
"""Bytes of a taxel frame's body besides the snapshot: frame header 5, taxel header 8, CRC 4."""

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
    """Poll cycles per second: the limit of each part and the measured rate; and the noise.

    sigma: counts, root mean square over the taxels. threshold: equivalent of 150 counts at the default settings.
    """

    scan: float
    i2c: float
    uart: float
    measured: float
    sigma: float
    threshold: float

    @property
    def limit(self) -> str:
        """Name of the part (scan, I2C, UART) that limits the rate of the skin."""
        return min(("scan", "I2C", "UART"), key=lambda name: getattr(self, name.lower()))

    @property
    def ceiling(self) -> float:
        """Rate in Hz that the slowest of scan, I2C and UART permits."""
        return min(self.scan, self.i2c, self.uart)


def count_i2c_bits(sizes: list[int]) -> int:
    """Count the clocks on the I2C bus for one read of each board. sizes: number of taxels of each board."""
    data = [I2C_CLOCKS_A_BYTE * (I2C_ADDRESS + SNAPSHOT_OVERHEAD + 2 * n) + I2C_START_STOP for n in sizes]
    return sum(data)


def count_uart_bits(sizes: list[int]) -> int:
    """Count the bits on the UART for one frame of each board: body, one stuffing byte per 254, delimiters.

    sizes: number of taxels of each board.
    """
    bodies = [FRAME_OVERHEAD + SNAPSHOT_OVERHEAD + 2 * n for n in sizes]
    return UART_BITS_A_BYTE * sum(body + 1 + body // 254 + DELIMITERS for body in bodies)


def measure_rates(scl_hz: float, baud: float, scan: ScanSettings) -> Rates:
    """Measure the rates of an emulated skin at rest, and compute their limits.

    scl_hz: clock of the I2C bus. baud: rate of the UART. scan: scan settings of the boards.
    """
    sizes = [board.kind.taxel_count for board in load_hand("original").boards]
    with tempfile.TemporaryDirectory() as name:
        settings = make_settings(scl_hz, baud, scan=scan)
        capture, statistics = record(Path(name), VIRTUAL_S, settings=settings)
        pieces = list(read_boards(capture))
    cycles, variances = [], []
    for address in pieces[0]:
        time_s = np.concatenate([piece[address].time_s for piece in pieces if address in piece])
        counts = np.concatenate([piece[address].raw_counts for piece in pieces if address in piece])
        is_settled = time_s > START_S + SETTLED_S
        # n frames enclose n - 1 periods.
        cycles.append((is_settled.sum() - 1) / np.ptp(time_s[is_settled]))
        variances.append(counts[is_settled].var(axis=0, ddof=1))
    # A board scans continuously after its boot.
    scans = min(board["scans"] for board in statistics["boards"]) / (VIRTUAL_S - 1e-3 * settings.boot_ms)
    return Rates(
        scans,
        scl_hz / count_i2c_bits(sizes),
        baud / count_uart_bits(sizes),
        float(np.median(cycles)),
        float(np.sqrt(np.concatenate(variances).mean())),
        # All counts are proportional to the number of sub-conversions, and so is the threshold.
        ACTIVATION_THRESHOLD_COUNTS * scan.sub_conversions / DEFAULT.sub_conversions,
    )


def _make_figure(scl_hz: float, baud: float, name: str) -> Figure:
    """Measure one configuration and create its result: bus clock (Hz), UART rate (baud), name of the scan settings.

    No ratio if the noise is too high for the activation threshold.
    """
    scan, rates = SCANS[name], measure_rates(scl_hz, baud, SCANS[name])
    has_enough_signal = rates.threshold >= SIGMAS * rates.sigma
    target = {"I2C": I2C_SHARE, "UART": UART_SHARE}.get(rates.limit)
    speed = f"{scl_hz / 1e3:g} kHz" if scl_hz < 1e6 else f"{scl_hz / 1e6:g} MHz"
    detail = (
        f"{rates.measured:.2f} Hz; scan {rates.scan:.1f}, I2C {rates.i2c:.2f}, UART {rates.uart:.1f} Hz; "
        f"{scan.sub_conversions} sub-conversions of {scan.sense_clock_divider}; noise {rates.sigma:.2f} counts, "
        f"threshold {rates.threshold / rates.sigma:.0f} sigma"
    )
    if not has_enough_signal:
        return Figure(f"skin rate, {speed}", None, target, f"{rates.limit} limit", f"{detail}: noise too high")
    return Figure(
        f"skin rate, {speed}, {baud / 1e6:g} Mbaud, {name} scan",
        rates.measured / rates.ceiling,
        target,
        f"{rates.limit} limit",
        detail,
    )


def measure() -> list[Figure]:
    """Run the benchmark of the skin rate with uncompressed frames.

    The ratio is the measured rate divided by the limit of the slowest part.
    """
    return [_make_figure(*case) for case in CASES]
