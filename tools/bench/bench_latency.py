"""From contact to activation on the host: in virtual time up to the last byte, and what the host takes beside.

Taxels of all boards are pressed at once, at random instants of the poll cycle. The USB adapter's latency timer is
switched off for the figures and shown by itself.
"""

import statistics
import tempfile
import time
from pathlib import Path

import numpy as np
from figures import Figure
from numpy.typing import NDArray
from recorded import record

from taxel.hand import Hand, load_hand
from taxel.hand.world import WorldSettings
from taxel.link import CaptureLink, write_stimulus
from taxel.signal import ACTIVATION_THRESHOLD_COUNTS, Activation
from taxel.stream import CaptureDecoder, StreamDecoder
from taxel.stream.clock import ClockMap
from taxel.stream.frames import build_taxel_frames

SEED = 7
PRESSES, FIRST_S, EACH_S, HELD_S, FORCE_N, STEP_S = 60, 1.5, 0.3, 0.15, 2.0, 1e-6
SCL_HZ = 400e3
PERIODS_QUICK_SCAN, PERIODS_SLOW_SCAN, ALLOWED_S = 1.5, 1.9, 2e-3
USB_LATENCY_MS = 16.0


def _presses(hand: Hand, path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """(instants [p], taxel of each board that is pressed [p, boards]), written as a stimulus."""
    rng = np.random.default_rng(SEED)
    onsets = FIRST_S + EACH_S * (np.arange(PRESSES) + 0.4 * rng.random(PRESSES))
    taxels = np.stack([rng.integers(board.kind.taxel_count, size=PRESSES) for board in hand.boards], axis=1)
    starts = np.array([hand.get_slice(board.address).start for board in hand.boards])
    times = (onsets[:, None] + [-STEP_S, 0.0, HELD_S, HELD_S + STEP_S]).ravel()
    forces = np.zeros((PRESSES, 4, hand.n_taxels))
    forces[np.arange(PRESSES)[:, None], 1:3, (starts + taxels)] = FORCE_N
    write_stimulus(path, times, forces.reshape(-1, hand.n_taxels))
    return onsets, taxels


def _delays(hand: Hand, folder: Path, usb_latency_ms: float) -> tuple[NDArray[np.float64], float, float]:
    """(seconds from contact to the activation's last byte [p, boards], frame period, longest scan)."""
    onsets, taxels = _presses(hand, folder / "press.stm")
    settings = WorldSettings(scl_hz=SCL_HZ, usb_latency_ms=usb_latency_ms)
    length = FIRST_S + EACH_S * (PRESSES + 1)
    capture, counted = record(folder, length, folder / "press.stm", settings)
    arrived: dict[int, list[NDArray[np.float64]]] = {board.address: [] for board in hand.boards}
    counts: dict[int, list[NDArray[np.uint16]]] = {board.address: [] for board in hand.boards}
    for batch, arrivals in CaptureDecoder(capture):
        places = np.searchsorted(arrivals["end"], batch.taxel_rows["stream_position"], side="left")
        for row, at in zip(batch.taxel_rows, (arrivals["time_ns"][places] * 1e-9).tolist(), strict=True):
            arrived[int(row["address"])].append(at)
            counts[int(row["address"])].append(batch.counts[row["offset"] : row["offset"] + row["size"]])
    delays = np.empty(taxels.shape)
    for column, board in enumerate(hand.boards):
        times, raw = np.array(arrived[board.address]), np.array(counts[board.address]).astype(float)
        signals = np.median(raw[times < FIRST_S], axis=0) - raw
        for press, onset in enumerate(onsets):
            active = (signals[:, taxels[press, column]] > ACTIVATION_THRESHOLD_COUNTS) & (times > onset)
            delays[press, column] = times[np.argmax(active)] - onset if active.any() else np.inf
    scans = min(board["scans"] for board in counted["boards"])
    return delays, 1e-6 * counted["cycle_time_us"], length / scans


def host_s_of_a_frame(capture: Path) -> float:
    """Processor time from a frame's bytes to what is active in it, one frame at a time; the median."""
    with CaptureLink(capture) as link:
        data = b"".join(link.read().data for _ in range(3000))
    decoder, clock = StreamDecoder(), ClockMap(1e6, has_arrivals=False)
    judges: dict[int, Activation] = {}
    taken: list[float] = []
    for chunk in data.split(b"\0\0"):
        begun = time.perf_counter()
        for batch in decoder.push(chunk + b"\0"):
            rows = batch.taxel_rows
            for frame in build_taxel_frames(batch, rows, clock.host_times_s(clock.hub_times_us(rows))):
                judge = judges.get(frame.address)
                if judge is None:
                    judge = judges[frame.address] = Activation(frame.raw_counts)
                judge(frame.raw_counts)
                taken.append(time.perf_counter() - begun)
    return statistics.median(taken)


def _spread(values: NDArray[np.float64]) -> str:
    return " / ".join(f"{1e3 * np.percentile(values, share):.1f}" for share in (5, 50, 95, 100))


def measure() -> list[Figure]:
    """What is allowed over the 95th percentile of one board and of the whole hand."""
    hand = load_hand("allegro")
    with tempfile.TemporaryDirectory() as name:
        delays, period, scan = _delays(hand, Path(name), 0.0)
        host = host_s_of_a_frame(Path(name) / "capture.bin")
        buffered, _, _ = _delays(hand, Path(name), USB_LATENCY_MS)
    periods = PERIODS_QUICK_SCAN if scan <= 0.5 * period else PERIODS_SLOW_SCAN
    allowed = periods * period + ALLOWED_S
    found = float(np.percentile(delays + host, 95))
    usb = 1e3 * float(np.mean(buffered) - np.mean(delays))
    last = delays.max(axis=1)
    return [
        Figure(
            "contact to activation, 95th percentile",
            allowed / found,
            1.0,
            f"{periods:g} frame periods + 2 ms",
            f"{1e3 * found:.1f} of {1e3 * allowed:.1f} ms; 5 / 50 / 95 / 100 %: {_spread(delays)} ms; host besides "
            f"{1e6 * host:.0f} us a frame; USB latency timer of {USB_LATENCY_MS:g} ms adds {usb:.1f} ms",
        ),
        Figure(
            "contact on all boards to the last activation",
            allowed / float(np.percentile(last, 95)),
            None,
            f"{periods:g} frame periods + 2 ms",
            f"5 / 50 / 95 / 100 %: {_spread(last)} ms; period {1e3 * period:.1f} ms, scan {1e3 * scan:.1f} ms",
        ),
    ]
