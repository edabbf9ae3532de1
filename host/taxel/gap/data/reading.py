"""Reduction of one dataset to signals at time nodes, noise, missing frames, onsets and baselines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from taxel.gap.data.readable import ReadableDataset, ReadableGrasp
from taxel.gap.data.time_grid import TimeGrid
from taxel.gap.errors import GapInputError
from taxel.recording.grasp_format import BASELINE_FRAMES, SIM, Phase
from taxel.types import FloatArray

Progress = Callable[[int, int], None]
"""Called with the number of finished grasps and the total number of grasps."""

MIN_BASELINE_FRAMES = 10
"""Smallest number of baseline frames of a board (chosen). With fewer frames, the noise of the baseline mean would
appear as a gap."""

EDGE_TOLERANCE_S = 1e-6
"""Tolerance in seconds at the edge of two nodes: a frame that is earlier than the edge by at most this time belongs to
the later node. Otherwise rounding of times with different origins would divide the frames of equal recordings
differently."""

MIN_ONSET_COUNTS = 300.0
"""Smallest sum of the signals of a board in hold, in counts, for which an onset is computed (chosen). A board with a
smaller sum is treated as untouched."""

MIN_ONSET_NOISE_RATIO = 8.0
"""Smallest ratio of the sum of the signals of a board in hold to the standard deviation of this sum in the baseline
(chosen). Below this ratio, the time of the rise is not measurable in the noise, and the board has no onset."""


@dataclass(frozen=True, eq=False)
class Recording:
    """The reduced data of R grasps at K time nodes, on n taxels of s boards (sensors).

    Contact lowers the raw count; the signal is the baseline minus the raw count. Values without a valid frame are NaN.

    Attributes:
        condition: [R], index of the condition (object, approach) of the grasp in `Pair.conditions`.
        session, iteration: i64[R].
        node_signal_counts: f32[R, K, n], mean signal in each node, counts.
        hold_signal_counts: f64[R, n], mean signal over all frames of hold, counts.
        noise: f32[R, 2, n], standard deviation of the frame-to-frame noise in baseline and in hold, counts.
        common_covariance: f64[R, 3], counts^2, mean covariance of the frame-to-frame noise in the baseline between
            taxels on the same TX line, on the same RX line, and on the same board but on no common line.
        missing_share: f64[R, s], share of frames that did not arrive.
        onset_s: f64[R, s], seconds from the beginning of closing to half of the board's summed signal in hold; NaN
            for a board without an onset, for example an untouched board.
        baseline: f64[R, n], counts.
        force, separation: f32[R, K, n], newtons and metres; None if the dataset lacks them.
        baseline_frames: [R], number of baseline frames that were used.
    """

    condition: NDArray[np.intp]
    session: NDArray[np.int64]
    iteration: NDArray[np.int64]
    node_signal_counts: NDArray[np.float32]
    hold_signal_counts: FloatArray
    noise: NDArray[np.float32]
    common_covariance: FloatArray
    missing_share: FloatArray
    onset_s: FloatArray
    baseline: FloatArray
    force: NDArray[np.float32] | None
    separation: NDArray[np.float32] | None
    baseline_frames: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.condition)

    def mask_nodes(self, is_unknown: NDArray[np.bool_]) -> Recording:
        """Return a copy with NaN as the signal of some nodes. is_unknown: bool[C, K] (C conditions, K time nodes),
        nodes to mask in each condition.
        """
        signal_counts = self.node_signal_counts
        masked = np.where(is_unknown[self.condition][:, :, None], np.float32(np.nan), signal_counts)
        return replace(self, node_signal_counts=masked)


@dataclass(frozen=True, eq=False)
class TaxelGroups:
    """Board and electrode lines of each taxel.

    sensor: [n] (n taxels), index of the board, which is the column of `valid`. tx, rx: [n], numbers of the TX and RX
    line; lines of different boards have different numbers.
    """

    sensor: NDArray[np.intp]
    tx: NDArray[np.intp]
    rx: NDArray[np.intp]

    @cached_property
    def sum_matrices(self) -> tuple[csr_array, csr_array, csr_array]:
        """Matrices of zeros and ones, [groups, n] (n taxels), that sum over TX lines, over RX lines and over boards."""
        n = len(self.sensor)
        ones = np.ones(n)
        matrices = [csr_array((ones, (group, np.arange(n)))) for group in (self.tx, self.rx, self.sensor)]
        return matrices[0], matrices[1], matrices[2]


def read_recording(
    data: ReadableDataset,
    grasps: list[ReadableGrasp],
    conditions: dict[tuple[str, str], int],
    time_grid: TimeGrid,
    groups: TaxelGroups,
    columns: NDArray[np.intp],
    progress: Progress,
) -> Recording:
    """Return the reduced data of the grasps. Raises GapInputError for a grasp without a sufficient baseline.

    The list `grasps` is empty afterwards, because a grasp keeps its arrays in memory until it is deleted.

    conditions: index of each condition (object, approach). columns: [s] (s boards), the sensor columns of this dataset
    in the order of the pair. progress: called after each grasp.
    """
    rows, total = [], len(grasps)
    condition, session, iteration = [], [], []
    grasps.reverse()
    while grasps:
        grasp = grasps.pop()
        rows.append(_reduce_grasp(data, grasp, time_grid, groups, columns))
        condition.append(conditions[grasp.object, grasp.approach])
        session.append(grasp.session)
        iteration.append(grasp.iteration)
        progress(len(rows), total)
    fields: dict[str, Any] = {key: _stack_values([row[key] for row in rows]) for key in rows[0]}
    fields["condition"] = np.array(condition, np.intp)
    fields["session"] = np.array(session, np.int64)
    fields["iteration"] = np.array(iteration, np.int64)
    return Recording(**fields)


def _stack_values(values: list[Any]) -> Any:
    """Return the stacked arrays of all grasps, or None if at least one grasp lacks the value."""
    return None if any(value is None for value in values) else np.stack(values)


def _reduce_grasp(
    data: ReadableDataset, grasp: ReadableGrasp, time_grid: TimeGrid, groups: TaxelGroups, columns: NDArray[np.intp]
) -> dict[str, Any]:
    """Return the fields of `Recording` for one grasp by name, without its condition, session and iteration.

    columns: intp[s], the file's column of each of the s boards in `grasp.valid`; the taxels of both files are in the
    same order.
    """
    phase, valid = grasp.phase, grasp.valid[:, columns]
    phase_time_s = compute_phase_time(grasp.timestamp, phase)
    frames, lacks_baseline = count_baseline_frames(data, grasp, valid)
    is_baseline = valid & (phase == Phase.BASELINE)[:, None] & ~lacks_baseline
    is_baseline &= np.cumsum(is_baseline, axis=0) <= frames  # the first `frames` baseline frames of each board
    raw = grasp.raw_counts.astype(np.float64)
    baseline = _compute_masked_mean(raw, is_baseline, groups.sensor)
    signal_counts = baseline - raw
    with np.errstate(invalid="ignore"):
        time_s = phase_time_s + EDGE_TOLERANCE_S
        begin, end = time_grid.begin[:, None], time_grid.end[:, None]
        in_node = (phase == time_grid.phase[:, None]) & (time_s >= begin) & (time_s < end)
    nodes = _compute_node_means(signal_counts, in_node, valid, groups.sensor)
    hold = _compute_masked_mean(signal_counts, valid & (phase == Phase.HOLD)[:, None], groups.sensor)
    baseline_noise, common_covariance = _estimate_noise(raw, is_baseline, groups)
    hold_noise, _ = _estimate_noise(raw, valid & (phase == Phase.HOLD)[:, None], groups)
    has_contact = data.source == SIM and grasp.contact_force is not None and grasp.separation is not None
    every_frame = np.ones_like(valid)
    return {
        "node_signal_counts": nodes.astype(np.float32),
        "hold_signal_counts": hold,
        "noise": np.stack([baseline_noise, hold_noise]).astype(np.float32),
        "common_covariance": common_covariance,
        "missing_share": 1.0 - valid.mean(axis=0),
        "onset_s": _find_onsets(signal_counts, hold, phase_time_s, phase, valid, groups.sensor),
        "baseline": baseline,
        "force": _compute_node_means(grasp.contact_force, in_node, every_frame, groups.sensor).astype(np.float32)
        if has_contact and grasp.contact_force is not None
        else None,
        "separation": _compute_node_means(grasp.separation, in_node, every_frame, groups.sensor).astype(np.float32)
        if has_contact and grasp.separation is not None
        else None,
        "baseline_frames": frames,
    }


def compute_phase_time(time_s: FloatArray, phase: NDArray[np.uint8]) -> FloatArray:
    """Return for each frame the seconds since the first frame of its phase, f64[T] (T frames).

    time_s: f64[T], times of the frames. phase: u8[T], phase of each frame.
    """
    phase_time_s = np.zeros(len(time_s))
    for value in np.unique(phase):
        in_phase = phase == value
        phase_time_s[in_phase] = time_s[in_phase] - time_s[in_phase][0]
    return phase_time_s


class GraspPhases(Protocol):
    """A grasp with its name and the phase of each frame."""

    @property
    def id(self) -> str:
        """Name of the grasp in its file."""
        ...

    @property
    def phase(self) -> NDArray[np.uint8]:
        """Phase of each frame, u8[T] (T frames)."""
        ...


def require_hold(grasp: GraspPhases, path: str) -> None:
    """Raise GapInputError if a grasp has no frames of hold: it cannot be compared. path: path of its file."""
    if not (grasp.phase == Phase.HOLD).any():
        where = f"{path}: /grasps/{grasp.id}/phase"
        raise GapInputError(where, "frames in hold (phase 2)", "none", "remove this grasp")


def count_baseline_frames(
    data: ReadableDataset, grasp: ReadableGrasp, valid: NDArray[np.bool_]
) -> tuple[int, NDArray[np.bool_]]:
    """Return the number of baseline frames to use, and the boards with too few baseline frames, bool[s] (s boards).

    The number is the smallest number among the boards with at least `MIN_BASELINE_FRAMES` baseline frames, at most
    `BASELINE_FRAMES`; 0 if no frame of the grasp is valid. The other boards lost frames, and their signal in this grasp
    is unknown.

    valid: bool[T, s] (T frames), frames that arrived. Raises GapInputError if every board with a valid frame has fewer
    than `MIN_BASELINE_FRAMES` baseline frames.
    """
    counts = (valid & (grasp.phase == Phase.BASELINE)[:, None]).sum(axis=0)
    present = valid.any(axis=0)
    lacks_baseline = counts < MIN_BASELINE_FRAMES
    if present.any() and lacks_baseline[present].all():
        where = f"{data.path}: /grasps/{grasp.id}/phase"
        remedy = "record the open hand longer before closing, or remove this grasp"
        found = str(int(counts[present].max()))
        raise GapInputError(where, f"at least {MIN_BASELINE_FRAMES} valid baseline frames (phase 0)", found, remedy)
    smallest = counts[~lacks_baseline].min(initial=BASELINE_FRAMES)
    return int(min(smallest, BASELINE_FRAMES)) if present.any() else 0, lacks_baseline


def _compute_masked_mean(values: FloatArray, frames: NDArray[np.bool_], sensor: NDArray[np.intp]) -> FloatArray:
    """Return the mean over the selected frames, f64[n] (n taxels); NaN for a taxel whose board has none of these
    frames.

    values: f64[T, n] (T frames). frames: bool[T, s], the selected frames of each board. sensor: [n], board of each
    taxel.
    """
    weight = frames[:, sensor]
    count = frames.sum(axis=0)[sensor]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.einsum("tn,tn->n", values, weight.astype(np.float64)) / np.where(count, count, np.nan))


def _compute_node_means(
    values: FloatArray, in_node: NDArray[np.bool_], valid: NDArray[np.bool_], sensor: NDArray[np.intp]
) -> FloatArray:
    """Return the mean of the valid frames in each node, f64[K, n] (K time nodes, n taxels); NaN if no valid frame of
    the taxel's board lies in the node.

    values: f64[T, n] (T frames). in_node: bool[K, T], frames of each node. valid: bool[T, s]. sensor: [n], board of
    each taxel.
    """
    chosen = csr_array(in_node.astype(np.float64))  # few frames lie in each node
    if valid.all():
        count = in_node.sum(axis=1)[:, None]
        return np.asarray(chosen @ np.nan_to_num(values) / np.where(count, count, np.nan))
    good = valid[:, sensor]
    count = (chosen @ valid.astype(np.float64))[:, sensor]
    return np.asarray(chosen @ np.where(good, values, 0.0) / np.where(count, count, np.nan))


def _estimate_noise(raw: FloatArray, frames: NDArray[np.bool_], groups: TaxelGroups) -> tuple[FloatArray, FloatArray]:
    """Return the noise in counts, f64[n] (n taxels), and the mean covariances of `_estimate_covariances` in counts^2,
    f64[3].

    The estimates use differences of successive frames (von Neumann et al. 1941); NaN with fewer than three frames.

    raw: f64[T, n] (T frames). frames: bool[T, s], the frames of each board that are used.
    """
    rows = np.flatnonzero(frames.any(axis=1))
    if len(rows) < 3:
        return np.full(raw.shape[1], np.nan), np.full(3, np.nan)
    both = frames[rows[1:]] & frames[rows[:-1]]
    good = both[:, groups.sensor]
    steps = np.where(good, np.diff(raw[rows], axis=0), 0.0)
    count = np.maximum(both.sum(axis=0)[groups.sensor], 1)
    variance = np.einsum("tn,tn->n", steps, steps) / (2.0 * count)
    known: NDArray[np.bool_] = np.any(both, axis=0)
    deviation = np.where(known[groups.sensor], np.sqrt(variance), np.nan)
    steps -= steps.mean(axis=0)
    return deviation, _estimate_covariances(steps, groups)


def _estimate_covariances(steps: FloatArray, groups: TaxelGroups) -> FloatArray:
    """Return the mean covariance of the noise of pairs of taxels, counts^2, f64[3].

    steps: [T, n] (T frames, n taxels), differences of successive frames, counts. The three values refer to pairs on a
    common TX line, on a common RX line, and on a common board without a common line; 0 without such pairs. The sum of
    the products of all pairs of a group is the square of the sum of its steps minus the sum of their squares.
    """
    sums, pairs = [], []
    square = float(np.sum(steps**2))
    for matrix in groups.sum_matrices:
        size = np.asarray(matrix.sum(axis=1)).ravel()
        sums.append(float(np.sum((matrix @ steps.T) ** 2)) - square)
        pairs.append(float(np.sum(size * (size - 1.0))))
    sums[2] -= sums[0] + sums[1]  # a pair of taxels has at most one common line
    pairs[2] -= pairs[0] + pairs[1]
    scale = 2.0 * len(steps)  # the difference of two frames has twice the covariance of a frame
    return np.array([value / (scale * count) if count > 0 else 0.0 for value, count in zip(sums, pairs, strict=True)])


def _find_onsets(
    signal_counts: FloatArray,
    hold: FloatArray,
    phase_time_s: FloatArray,
    phase: NDArray[np.uint8],
    valid: NDArray[np.bool_],
    sensor: NDArray[np.intp],
) -> FloatArray:
    """Return the onset of each board: seconds from the beginning of closing to half of the signal in hold, f64[s].

    The signal of a board is the sum over its taxels with a positive signal in hold. The onset is NaN in these cases:
    the grasp has no closing; the signal in hold is at most `MIN_ONSET_COUNTS`, or below `MIN_ONSET_NOISE_RATIO`
    standard deviations of the signal in the baseline; the signal never rises through the half (`_find_crossing`).

    signal_counts: f64[T, n] (T frames, n taxels). hold: mean signal in hold, f64[n], counts. phase_time_s: seconds
    since the beginning of the phase, f64[T]. phase: u8[T]. valid: bool[T, s]. sensor: [n], board of each taxel.
    """
    sensors = valid.shape[1]
    onset = np.full(sensors, np.nan)
    frames = np.flatnonzero((phase == Phase.CLOSING) | (phase == Phase.HOLD))
    if not (phase[frames] == Phase.CLOSING).any():
        return onset
    is_closing = phase[frames] == Phase.CLOSING
    closing_s = phase_time_s[frames][is_closing].max(initial=0.0)
    time = np.where(is_closing, phase_time_s[frames], phase_time_s[frames] + closing_s)
    is_loaded = np.where(np.nan_to_num(hold) > 0, 1.0, 0.0)
    level = np.bincount(sensor, np.nan_to_num(hold) * is_loaded, sensors)
    baseline = np.flatnonzero(phase == Phase.BASELINE)
    for board in np.flatnonzero(level > MIN_ONSET_COUNTS):
        taxels, rows = np.flatnonzero((sensor == board) & (is_loaded > 0)), frames[np.asarray(valid[frames, board])]
        baseline_rows = baseline[np.asarray(valid[baseline, board])]
        baseline_sums: FloatArray = signal_counts[np.ix_(baseline_rows, taxels)].sum(axis=1)
        if level[board] < MIN_ONSET_NOISE_RATIO * float(np.std(baseline_sums)):
            continue
        sums: FloatArray = signal_counts[np.ix_(rows, taxels)].sum(axis=1)
        onset[board] = _find_crossing(time[np.asarray(valid[frames, board])], sums, 0.5 * float(level[board]))
    return onset


def _find_crossing(time: FloatArray, values: FloatArray, level: float) -> float:
    """Return the time at which values f64[T] (T frames) rise through a level: the mean of the first and the last upward
    crossing.

    Noise makes the first crossing early and the last crossing late. The result is NaN if the values begin at or above
    the level, or never reach it. time: times of the values, f64[T], seconds.
    """
    is_above = values >= level
    crossings = np.flatnonzero(is_above[1:] & ~is_above[:-1])
    if is_above[0] or not len(crossings):
        return np.nan
    share = (level - values[crossings]) / (values[crossings + 1] - values[crossings])
    times = time[crossings] + share * (time[crossings + 1] - time[crossings])
    return 0.5 * float(times[0] + times[-1])
