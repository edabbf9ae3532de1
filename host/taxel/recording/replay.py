"""Measured touches through the emulated skin, and what the host library makes of them.

Recorded counts take the place of the boards' front ends; everything after that is the skin's own: the sensor firmware's
scan, I2C, the hub firmware, its UART, a capture, decoding, clocks, baseline and activation. The score compares what
comes out with thresholding the recording itself.
"""

import os
import tempfile
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.hand import Board, Hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import CaptureError, run_emulator, write_stimulus
from taxel.recording.capfingerid import TouchRecording
from taxel.recording.errors import RecordingError
from taxel.recording.scoring import DecodedBoard, ReplayScore, SourceTouches, score_replay
from taxel.recording.tiling import REST_COUNTS, Tiling
from taxel.signal import ACTIVATION_THRESHOLD_COUNTS, BASELINE_SAMPLES, Activation, Baseline
from taxel.skin import open_skin
from taxel.stream import TaxelFrame
from taxel.stream.start_script import START_S, write_start_script

LEAD_IN_MIN_S = 4.0
"""At rest before the recording begins, seconds; by then every board's clock has been read twice."""

CONVERSION_S = 145e-6
"""A taxel's share of a default scan: 6,400 modulator clocks at 48 MHz, settling and the interrupt, 2 % slow."""

BITS_PER_BYTE_I2C = 9.0
BOARD_OVERHEAD_BYTES = 16
"""Addresses and the snapshot's header and CRC, I2C bytes a board."""

SCAN_MARGIN = 1.3
"""How much longer a poll cycle may be than the estimate from bus and scan."""

_MODULUS = 1 << 16  # of cycles and scan numbers


def replay_touches(
    recording: TouchRecording,
    hand: Hand,
    start_s: float = 0.0,
    stop_s: float | None = None,
    folder: str | os.PathLike[str] | None = None,
    *,
    seconds: float | None = None,
    threshold: float = ACTIVATION_THRESHOLD_COUNTS,
    rest: int = REST_COUNTS,
    settings: WorldSettings | None = None,
) -> ReplayScore:
    """Send frames of a recording through an emulated skin of `hand` and score what comes out.

    start_s, stop_s: which frames, in the recording's seconds; stop_s None: to the end. seconds: instead of `stop_s`,
    how long from `start_s`. folder: where stimulus, host script and capture are left for another look; None: nowhere.
    threshold: counts, of the skin and of the source alike. rest: raw count of an untouched taxel. settings: None: the
    default world, I2C at 400 kHz.

    Raises `RecordingError` if there is no frame in that time, the hand is too small, or a board brings too few frames
    for a baseline; `CaptureError` if `folder` holds a capture already; `LinkError` if the emulator refuses its input.
    """
    if seconds is not None:
        stop_s = start_s + seconds
    end_s = np.inf if stop_s is None else stop_s
    part = recording.between(start_s, end_s)
    if not len(part.time_s):
        wanted = f"no frame from {start_s:g} s to {end_s:g} s"
        raise RecordingError(f"recording {recording.name!r}: {wanted}; it lasts {recording.duration_s:.1f} s")
    settings = settings or WorldSettings()
    tiling = Tiling.of(hand)
    lead_in_s = lead_in(hand, settings)
    with ExitStack() as stack:
        where = Path(folder or stack.enter_context(tempfile.TemporaryDirectory(prefix="taxel-")))
        time_s = part.time_s - part.time_s[0]
        capture = _emulate(where, hand, settings, lead_in_s + time_s, tiling.to_counts(part.values, rest), rest)
        boards = decode_capture(capture, hand, lead_in_s, threshold)
    return score_replay(SourceTouches(time_s, tiling.spread(part.values), threshold), boards)


def lead_in(hand: Hand, settings: WorldSettings) -> float:
    """Virtual seconds at rest, long enough for the baseline of every board."""
    bus_bytes = sum(2 * board.kind.taxel_count + BOARD_OVERHEAD_BYTES for board in hand.boards)
    scan_s = CONVERSION_S * max(board.kind.taxel_count for board in hand.boards)
    cycle_s = SCAN_MARGIN * max(BITS_PER_BYTE_I2C * bus_bytes / settings.scl_hz, scan_s)
    return max(LEAD_IN_MIN_S, START_S + BASELINE_SAMPLES * cycle_s)


def _emulate(
    folder: Path,
    hand: Hand,
    settings: WorldSettings,
    time_s: NDArray[np.float64],
    counts: NDArray[np.uint16],
    rest: int,
) -> Path:
    """The capture of a skin on which `counts` [T, n] act at `time_s` [T], virtual seconds, after rest."""
    stimulus, script, capture = folder / "touches.stimulus", folder / "host.capture", folder / "touches.capture"
    if capture.exists():
        raise CaptureError(str(capture), "exists already; choose another folder")
    write_stimulus(stimulus, [0.0, *time_s], np.vstack([np.full((1, hand.n_taxels), rest), counts]), "counts")
    write_start_script(script)
    held_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
    run_emulator(format_world(hand, settings), capture, float(time_s[-1]) + held_s + 0.1, script, stimulus)
    return capture


def decode_capture(
    path: str | os.PathLike[str], hand: Hand, begin_s: float, threshold: float = ACTIVATION_THRESHOLD_COUNTS
) -> list[DecodedBoard]:
    """Every board's samples in a capture from its time `begin_s` on, decoded as a live host does it.

    The baseline is that of each board's first 100 frames. Raises `RecordingError` if a board has fewer before
    `begin_s`, `DisturbedBaselineError` if they are not at rest.
    """
    frames: dict[int, list[TaxelFrame]] = {board.address: [] for board in hand.boards}
    with open_skin(f"file:{os.fspath(path)}", hand) as skin:
        for frame in skin:
            frames[frame.address].append(frame)
    first_cycle = next((own[0].cycle for own in frames.values() if own), 0)
    return [_decode_board(hand, board, frames[board.address], first_cycle, begin_s, threshold) for board in hand.boards]


def _decode_board(
    hand: Hand, board: Board, frames: list[TaxelFrame], first_cycle: int, begin_s: float, threshold: float
) -> DecodedBoard:
    time_s = np.array([frame.time_s for frame in frames])
    ready = int((time_s < begin_s).sum())
    if ready < BASELINE_SAMPLES or len(frames) - ready < 2:
        raise RecordingError(
            f"board {board.name} of hand '{hand.name}': expected {BASELINE_SAMPLES} frames before {begin_s:.2f} s and "
            f"2 after, found {ready} and {len(frames) - ready}; is the board silent, or the hub's port too slow?"
        )
    raw = np.stack([frame.raw_counts for frame in frames])
    baseline = Baseline(raw.shape[1])
    for counts in raw[:BASELINE_SAMPLES]:
        baseline.update(counts)
    baseline.result().require_undisturbed()
    decoded = Activation(baseline.result().mean, threshold)(raw[ready:])
    sampled_s = time_s[ready:, None] + _taxel_offsets(frames[ready:], time_s[ready:], raw.shape[1]) - begin_s
    cycle = _unwrapped(np.array([first_cycle, *(frame.cycle for frame in frames)]))[1 + ready :]
    return DecodedBoard(hand.get_slice(board.address), cycle, sampled_s, decoded.signal_counts, decoded.active)


def _taxel_offsets(frames: list[TaxelFrame], time_s: NDArray[np.float64], n_taxels: int) -> NDArray[np.float64]:
    """From the start of a scan to the middle of each taxel's conversion, seconds, f64[n].

    A board scans without a pause, so the time of one taxel is that between two scans over scans and taxels.
    """
    scans = _unwrapped(np.array([frame.sequence for frame in frames]))
    period_s = (time_s[-1] - time_s[0]) / (scans[-1] - scans[0]) / n_taxels
    offsets: NDArray[np.float64] = (np.arange(n_taxels) + 0.5) * period_s
    return offsets


def _unwrapped(numbers: NDArray[np.int64]) -> NDArray[np.int64]:
    """Numbers that count modulo 65,536, beginning at the first."""
    steps = np.diff(numbers, prepend=numbers[0])
    unwrapped: NDArray[np.int64] = numbers[0] + np.cumsum((steps + _MODULUS // 2) % _MODULUS - _MODULUS // 2)
    return unwrapped
