"""Replay of measured touches on the emulated skin, and the score of the decoded result.

Recorded counts replace the front ends of the boards. Everything behind them is the skin's own: the scan of the sensor
firmware, I2C, the hub firmware, its UART, a capture, decoding, clock mapping, baseline and activation. The score
compares the result with the recording itself after the same threshold.
"""

import os
import tempfile
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from taxel.hand import Board, Hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import CaptureError, run_emulator, write_stimulus
from taxel.recording.capfingerid import TouchRecording
from taxel.recording.errors import RecordingError
from taxel.recording.scoring import DecodedBoard, ReplayScore, SourceTouches, score_replay
from taxel.recording.tiling import UNTOUCHED_COUNTS, Tiling
from taxel.signal import ACTIVATION_THRESHOLD_COUNTS, BASELINE_SAMPLES, Activation, Baseline
from taxel.skin import open_skin
from taxel.stream import TaxelFrame
from taxel.stream.start_script import START_S, write_start_script
from taxel.types import CountArray, FloatArray, IntArray

LEAD_IN_MIN_S = 4.0
"""Smallest time without contact before the recording starts, seconds. At its end, each board's clock has been read
twice.
"""

CONVERSION_S = 145e-6
"""Conversion time of one taxel in a default scan, seconds: 6,400 modulator clocks at 48 MHz, settling and interrupt, of
a board whose clock is 2 % slow.
"""

BITS_PER_BYTE_I2C = 9.0
"""Clock cycles of one byte on the I2C bus: 8 data bits and the acknowledgement."""

BOARD_OVERHEAD_BYTES = 16
"""I2C bytes for the addresses, header and CRC of one board's snapshot."""

SCAN_MARGIN = 1.3
"""Factor between the longest expected poll cycle and the estimate from bus and scan time."""

_MODULUS = 1 << 16  # of cycle and scan numbers


@dataclass(frozen=True)
class ReplayOptions:
    """Options of the replay of a touch recording through an emulated skin.

    start_s: first replayed time of the recording, seconds. seconds: replayed duration; None: to the end. threshold:
    signal above which a taxel of the skin, or a value of the recording, is active, counts. untouched_counts: raw count
    of an untouched taxel. settings: settings of the emulated world; the default has I2C at 400 kHz.
    """

    start_s: float = 0.0
    seconds: float | None = None
    threshold: float = ACTIVATION_THRESHOLD_COUNTS
    untouched_counts: int = UNTOUCHED_COUNTS
    settings: WorldSettings = field(default_factory=WorldSettings)


def replay_touches(
    recording: TouchRecording,
    hand: Hand,
    options: ReplayOptions | None = None,
    folder: str | os.PathLike[str] | None = None,
) -> ReplayScore:
    """Send frames of a touch recording through an emulated skin of `hand`, and score the decoded touches.

    folder: folder for the stimulus, the host script and the capture; None: a temporary folder. Raises `RecordingError`
    if the recording has no frame in the selected time, the hand is too small, or a board delivers too few frames for a
    baseline; `CaptureError` if `folder` contains a capture already; `LinkError` if the emulator rejects its input.
    """
    options = options or ReplayOptions()
    stop_s = np.inf if options.seconds is None else options.start_s + options.seconds
    frames = recording.between(options.start_s, stop_s)
    if not len(frames.time_s):
        text = f"no frame from {options.start_s:g} s to {stop_s:g} s"
        raise RecordingError(f"recording {recording.name!r}: {text}; it lasts {recording.duration_s:.1f} s")
    tiling = Tiling.for_hand(hand)
    lead_in_s = compute_lead_in_s(hand, options.settings)
    with ExitStack() as stack:
        path = Path(folder or stack.enter_context(tempfile.TemporaryDirectory(prefix="taxel-")))
        time_s = frames.time_s - frames.time_s[0]
        counts = tiling.to_counts(frames.values, options.untouched_counts)
        capture = _emulate_capture(path, hand, options, lead_in_s + time_s, counts)
        boards = decode_capture(capture, hand, lead_in_s, options.threshold)
    return score_replay(SourceTouches(time_s, tiling.to_taxels(frames.values), options.threshold), boards)


def compute_lead_in_s(hand: Hand, settings: WorldSettings) -> float:
    """Return the emulated seconds without contact before a replay, long enough for the baseline of every board.

    The baseline needs `BASELINE_SAMPLES` poll cycles. A cycle lasts as long as the bus transfer of all boards (2 bytes
    for each taxel) or the scan of the largest board, whichever is longer.
    """
    bus_bytes = sum(2 * board.kind.taxel_count + BOARD_OVERHEAD_BYTES for board in hand.boards)
    scan_s = CONVERSION_S * max(board.kind.taxel_count for board in hand.boards)
    cycle_s = SCAN_MARGIN * max(BITS_PER_BYTE_I2C * bus_bytes / settings.scl_hz, scan_s)
    return max(LEAD_IN_MIN_S, START_S + BASELINE_SAMPLES * cycle_s)


def _emulate_capture(folder: Path, hand: Hand, options: ReplayOptions, time_s: FloatArray, counts: CountArray) -> Path:
    """Emulate a skin with given raw counts, and return the path of the capture of its stream.

    counts: u16[T, n], from the times `time_s` [T] on, emulated seconds. folder: for the files of the emulation.
    """
    stimulus, script, capture = folder / "touches.stimulus", folder / "host.capture", folder / "touches.capture"
    if capture.exists():
        raise CaptureError(str(capture), "exists already; choose another folder")
    untouched = np.full((1, hand.n_taxels), options.untouched_counts)
    write_stimulus(stimulus, [0.0, *time_s], np.vstack([untouched, counts]), "counts")
    write_start_script(script)
    last_frame_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
    world = format_world(hand, options.settings)
    run_emulator(world, capture, float(time_s[-1]) + last_frame_s + 0.1, script, stimulus)
    return capture


def decode_capture(
    path: str | os.PathLike[str], hand: Hand, start_s: float, threshold: float = ACTIVATION_THRESHOLD_COUNTS
) -> list[DecodedBoard]:
    """Return the samples of every board in a capture from its time `start_s` on, decoded as from a port.

    The baseline is the mean of each board's first 100 frames. threshold: signal above which a taxel is active, counts.
    Raises `RecordingError` if a board has fewer than 100 frames before `start_s` or fewer than 2 after, and
    `DisturbedBaselineError` if a taxel is touched during the baseline.
    """
    frames: dict[int, list[TaxelFrame]] = {board.address: [] for board in hand.boards}
    with open_skin(f"file:{os.fspath(path)}", hand) as skin:
        for frame in skin:
            frames[frame.address].append(frame)
    first_cycle = next((board_frames[0].cycle for board_frames in frames.values() if board_frames), 0)
    return [_decode_board(hand, board, frames[board.address], first_cycle, start_s, threshold) for board in hand.boards]


def _decode_board(
    hand: Hand, board: Board, frames: list[TaxelFrame], first_cycle: int, start_s: float, threshold: float
) -> DecodedBoard:
    """Compute signal and activity of one board after `start_s`; its frames before that time give the baseline.

    first_cycle: poll cycle of the first frame of the skin. threshold: signal above which a taxel is active, counts.
    Raises RecordingError for too few frames.
    """
    time_s = np.array([frame.time_s for frame in frames])
    before = int((time_s < start_s).sum())
    if before < BASELINE_SAMPLES or len(frames) - before < 2:
        raise RecordingError(
            f"board {board.name} of hand '{hand.name}': expected {BASELINE_SAMPLES} frames before {start_s:.2f} s and "
            f"2 after, found {before} and {len(frames) - before}; check that the board responds and that the hub's "
            "port is fast enough"
        )
    raw = np.stack([frame.raw_counts for frame in frames])
    baseline = Baseline(raw.shape[1])
    for counts in raw[:BASELINE_SAMPLES]:
        baseline.update(counts)
    baseline.result().require_undisturbed()
    activation = Activation(baseline.result().mean, threshold)(raw[before:])
    sampled_s = time_s[before:, None] + _compute_taxel_offsets(frames[before:], time_s[before:], raw.shape[1]) - start_s
    cycle = _unwrap(np.array([first_cycle, *(frame.cycle for frame in frames)]))[1 + before :]
    return DecodedBoard(hand.get_slice(board.address), cycle, sampled_s, activation.signal_counts, activation.active)


def _compute_taxel_offsets(frames: list[TaxelFrame], time_s: FloatArray, n_taxels: int) -> FloatArray:
    """Return the time from the start of a scan to the middle of each taxel's conversion, seconds, f64[n].

    frames, time_s: frames of one board and their times. A board scans without a pause, so that the time of one taxel is
    the time from the first to the last scan, divided by the number of scans and by the number of taxels.
    """
    scans = _unwrap(np.array([frame.sequence for frame in frames]))
    period_s = (time_s[-1] - time_s[0]) / (scans[-1] - scans[0]) / n_taxels
    offsets: FloatArray = (np.arange(n_taxels) + 0.5) * period_s
    return offsets


def _unwrap(numbers: IntArray) -> IntArray:
    """Convert numbers that wrap at 65,536 to continuous numbers that start with the first number."""
    # Each step is replaced by the step nearest to 0 that is equal modulo 65,536.
    steps = np.diff(numbers, prepend=numbers[0])
    unwrapped: IntArray = numbers[0] + np.cumsum((steps + _MODULUS // 2) % _MODULUS - _MODULUS // 2)
    return unwrapped
