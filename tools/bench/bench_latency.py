"""Latency from contact to activation: virtual time to the last byte of the frame, plus the host's processing time.

One taxel of every board is pressed at the same random time. The latency timer of the USB adapter is disabled for the
figures and reported separately.
"""

import statistics
import tempfile
import time
from pathlib import Path

import numpy as np
from figures import Figure
from numpy.typing import NDArray
from recordings import record

from taxel.hand import Hand, load_hand
from taxel.hand.world import WorldSettings
from taxel.link import CaptureLink, write_stimulus
from taxel.signal import ACTIVATION_THRESHOLD_COUNTS, Activation
from taxel.stream import CaptureDecoder, StreamDecoder
from taxel.stream.clock import ClockMap
from taxel.stream.frames import build_taxel_frames

SEED = 7
CONTACTS, FIRST_S, CONTACT_PERIOD_S, CONTACT_S, FORCE_N, STEP_S = 60, 1.5, 0.3, 0.15, 2.0, 1e-6
SCL_HZ = 400e3
ALLOWED_PERIODS_FAST_SCAN, ALLOWED_PERIODS_SLOW_SCAN, ALLOWANCE_S = 1.5, 1.9, 2e-3
USB_LATENCY_MS = 16.0


def _write_contacts(hand: Hand, path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Write the contacts as a stimulus file.

    Returns the contact times f64[p] in seconds for p contacts, and the loaded taxel of each board i64[p, boards].
    """
    rng = np.random.default_rng(SEED)
    # Each contact begins at a random time in the first 40 % of its period.
    onsets = FIRST_S + CONTACT_PERIOD_S * (np.arange(CONTACTS) + 0.4 * rng.random(CONTACTS))
    taxels = np.stack([rng.integers(board.kind.taxel_count, size=CONTACTS) for board in hand.boards], axis=1)
    starts = np.array([hand.get_slice(board.address).start for board in hand.boards])
    times = (onsets[:, None] + [-STEP_S, 0.0, CONTACT_S, CONTACT_S + STEP_S]).ravel()
    forces = np.zeros((CONTACTS, 4, hand.n_taxels))
    forces[np.arange(CONTACTS)[:, None], 1:3, (starts + taxels)] = FORCE_N
    write_stimulus(path, times, forces.reshape(-1, hand.n_taxels))
    return onsets, taxels


def _measure_delays(hand: Hand, folder: Path, usb_latency_ms: float) -> tuple[NDArray[np.float64], float, float]:
    """Measure the delay from a contact to the last byte of the frame in which the touched taxel is active.

    usb_latency_ms: latency of the USB adapter. Returns the delays f64[p, boards] in s for p contacts (infinite without
    activation), the period in s of the poll cycle of the hub, and the period in s of a scan of the slowest board.
    """
    onsets, taxels = _write_contacts(hand, folder / "contacts.stm")
    settings = WorldSettings(scl_hz=SCL_HZ, usb_latency_ms=usb_latency_ms)
    length = FIRST_S + CONTACT_PERIOD_S * (CONTACTS + 1)
    capture, statistics_of_run = record(folder, length, folder / "contacts.stm", settings)
    arrival_times: dict[int, list[NDArray[np.float64]]] = {board.address: [] for board in hand.boards}
    counts: dict[int, list[NDArray[np.uint16]]] = {board.address: [] for board in hand.boards}
    for batch, arrivals in CaptureDecoder(capture):
        # A frame arrives with the first read whose end is at or behind the stream position of the frame.
        indices = np.searchsorted(arrivals["end"], batch.taxel_rows["stream_position"], side="left")
        for row, arrival_s in zip(batch.taxel_rows, (arrivals["time_ns"][indices] * 1e-9).tolist(), strict=True):
            arrival_times[int(row["address"])].append(arrival_s)
            counts[int(row["address"])].append(batch.counts[row["offset"] : row["offset"] + row["size"]])
    delays = np.empty(taxels.shape)
    for column, board in enumerate(hand.boards):
        times, raw = np.array(arrival_times[board.address]), np.array(counts[board.address]).astype(float)
        signals = np.median(raw[times < FIRST_S], axis=0) - raw
        for contact, onset in enumerate(onsets):
            active = (signals[:, taxels[contact, column]] > ACTIVATION_THRESHOLD_COUNTS) & (times > onset)
            delays[contact, column] = times[np.argmax(active)] - onset if active.any() else np.inf
    scans = min(board["scans"] for board in statistics_of_run["boards"])
    return delays, 1e-6 * statistics_of_run["cycle_time_us"], length / scans


def measure_host_s(capture: Path) -> float:
    """Measure the median time in s that the host takes from the bytes of a frame to its active taxels.

    The frames of the capture are decoded one at a time. The time is wall-clock time (`perf_counter`).
    """
    with CaptureLink(capture) as link:
        data = b"".join(link.read().data for _ in range(3000))
    decoder, clock = StreamDecoder(), ClockMap(1e6, has_arrivals=False)
    activations: dict[int, Activation] = {}
    durations: list[float] = []
    for chunk in data.split(b"\0\0"):  # a frame begins and ends with a delimiter: each chunk is one frame
        start = time.perf_counter()
        for batch in decoder.push(chunk + b"\0"):
            rows = batch.taxel_rows
            for frame in build_taxel_frames(batch, rows, clock.host_times_s(clock.hub_times_us(rows))):
                activation = activations.get(frame.address)
                if activation is None:
                    activation = activations[frame.address] = Activation(frame.raw_counts)
                activation(frame.raw_counts)
                durations.append(time.perf_counter() - start)
    return statistics.median(durations)


def _format_percentiles(values: NDArray[np.float64]) -> str:
    """Format the 5th, 50th, 95th and 100th percentile of times in s as milliseconds."""
    return " / ".join(f"{1e3 * np.percentile(values, share):.1f}" for share in (5, 50, 95, 100))


def measure() -> list[Figure]:
    """Run the benchmark of the latency: allowed latency divided by the measured latency.

    The measured latency is the 95th percentile for single boards, and for the last board of the hand.
    """
    hand = load_hand("original")
    with tempfile.TemporaryDirectory() as name:
        delays, period, scan = _measure_delays(hand, Path(name), 0.0)
        host = measure_host_s(Path(name) / "capture.bin")
        buffered, _, _ = _measure_delays(hand, Path(name), USB_LATENCY_MS)
    periods = ALLOWED_PERIODS_FAST_SCAN if scan <= 0.5 * period else ALLOWED_PERIODS_SLOW_SCAN
    allowed = periods * period + ALLOWANCE_S
    percentile_s = float(np.percentile(delays + host, 95))
    usb = 1e3 * float(np.mean(buffered) - np.mean(delays))
    last = delays.max(axis=1)
    return [
        Figure(
            "contact to activation, 95th percentile",
            allowed / percentile_s,
            1.0,
            f"{periods:g} frame periods + 2 ms",
            f"{1e3 * percentile_s:.1f} of {1e3 * allowed:.1f} ms; "
            f"5 / 50 / 95 / 100 %: {_format_percentiles(delays)} ms; host "
            f"{1e6 * host:.0f} us per frame in addition; USB latency timer of {USB_LATENCY_MS:g} ms adds {usb:.1f} ms",
        ),
        Figure(
            "contact on all boards to the last activation",
            allowed / float(np.percentile(last, 95)),
            None,
            f"{periods:g} frame periods + 2 ms",
            f"5 / 50 / 95 / 100 %: {_format_percentiles(last)} ms; "
            f"period {1e3 * period:.1f} ms, scan {1e3 * scan:.1f} ms",
        ),
    ]
