"""One dataset, reduced to what the comparison needs: drops at nodes of time, noise, missing frames, onsets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from taxel.gap.data.clock import Clock
from taxel.gap.data.readable import ReadableDataset, ReadableGrasp
from taxel.gap.errors import GapInputError
from taxel.recording.grasp_format import BASELINE_FRAMES, SIM, Phase
from taxel.types import FloatArray

Progress = Callable[[int, int], None]

LEAST_BASELINE = 10
"""Frames; with fewer the baseline's own noise would be the gap."""

EDGE_S = 1e-6
"""Seconds by which a frame at the edge of two nodes belongs to the later one: rounding of times of different origin
must not divide the frames of equal recordings differently."""

ONSET_LEAST_COUNTS = 300.0
"""Sum of a board's drops in hold under which it was not touched."""

ONSET_NOISES = 8.0
"""Standard deviations of that sum at rest under which nobody can say when it rises."""


@dataclass(frozen=True, eq=False)
class Recording:
    """R grasps, K nodes, n taxels, s sensors. Drops are counts below the baseline; NaN where no frame arrived.

    Attributes:
        cell: [R], index of the grasp's (object, approach) in the pair's list. session, iteration: i64[R].
        nodes: f32[R, K, n], mean drop. hold: f64[R, n], mean drop over all of hold.
        noise: f32[R, 2, n], standard deviation in baseline and in hold, of what changes from frame to frame.
        common: f64[R, 3], counts^2, mean covariance of such changes between taxels on one TX line, on one RX line, and
            on the same board but on neither.
        missing: f64[R, s], share of frames that did not arrive. onset: f64[R, s], seconds after closing began at which
            a board's drops reached half their hold level; NaN for an untouched one.
        baseline: f64[R, n], counts.
        force, separation: f32[R, K, n], newtons and metres; None without them.
        frames: [R], baseline frames that were used.
    """

    condition: NDArray[np.intp]
    session: NDArray[np.int64]
    iteration: NDArray[np.int64]
    nodes: NDArray[np.float32]
    hold: FloatArray
    noise: NDArray[np.float32]
    common: FloatArray
    missing: FloatArray
    onset: FloatArray
    baseline: FloatArray
    force: NDArray[np.float32] | None
    separation: NDArray[np.float32] | None
    frames: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.condition)

    def without_nodes(self, unknown: NDArray[np.bool_]) -> Recording:
        """With the drops of some nodes of each cell unknown, bool[C, K]."""
        return replace(self, nodes=np.where(unknown[self.condition][:, :, None], np.float32(np.nan), self.nodes))


@dataclass(frozen=True, eq=False)
class Groups:
    """Which taxels belong together. sensor: [n], column of `valid`. tx, rx: [n], number of the line in all boards."""

    sensor: NDArray[np.intp]
    tx: NDArray[np.intp]
    rx: NDArray[np.intp]

    @cached_property
    def sums(self) -> tuple[csr_array, csr_array, csr_array]:
        """Sums over TX lines, RX lines and boards: [groups, n] of ones."""
        n = len(self.sensor)
        ones = np.ones(n)
        made = [csr_array((ones, (group, np.arange(n)))) for group in (self.tx, self.rx, self.sensor)]
        return made[0], made[1], made[2]


def read_recording(
    data: ReadableDataset,
    grasps: list[ReadableGrasp],
    conditions: dict[tuple[str, str], int],
    clock: Clock,
    groups: Groups,
    columns: NDArray[np.intp],
    progress: Progress,
) -> Recording:
    """Reduce `grasps`, which empties the list: a grasp holds what was read of it as long as it lives.

    columns: [s], this dataset's sensor columns in the pair's order.
    """
    rows, total = [], len(grasps)
    condition, session, iteration = [], [], []
    grasps.reverse()
    while grasps:
        grasp = grasps.pop()
        rows.append(_reduce(data, grasp, clock, groups, columns))
        condition.append(conditions[grasp.object, grasp.approach])
        session.append(grasp.session)
        iteration.append(grasp.iteration)
        progress(len(rows), total)
    fields: dict[str, Any] = {key: _stacked([row[key] for row in rows]) for key in rows[0]}
    fields["condition"] = np.array(condition, np.intp)
    fields["session"] = np.array(session, np.int64)
    fields["iteration"] = np.array(iteration, np.int64)
    return Recording(**fields)


def _stacked(values: list[Any]) -> Any:
    return None if any(value is None for value in values) else np.stack(values)


def _reduce(
    data: ReadableDataset, grasp: ReadableGrasp, clock: Clock, groups: Groups, columns: NDArray[np.intp]
) -> dict[str, Any]:
    phase, valid = grasp.phase, grasp.valid[:, columns]
    since = since_phase_began(grasp.timestamp, phase)
    frames, poor = baseline_frames(data, grasp, valid)
    rest = valid & (phase == Phase.BASELINE)[:, None] & ~poor
    rest &= np.cumsum(rest, axis=0) <= frames
    raw = grasp.raw_counts.astype(np.float64)
    baseline = _masked_mean(raw, rest, groups.sensor)
    signal_counts = baseline - raw
    with np.errstate(invalid="ignore"):
        own = since + EDGE_S
        in_sample = (phase == clock.phase[:, None]) & (own >= clock.begin[:, None]) & (own < clock.end[:, None])
    nodes = _node_means(signal_counts, in_sample, valid, groups.sensor)
    hold = _masked_mean(signal_counts, valid & (phase == Phase.HOLD)[:, None], groups.sensor)
    still, held = _changes(raw, rest, groups), _changes(raw, valid & (phase == Phase.HOLD)[:, None], groups)
    simulated = data.source == SIM and grasp.contact_force is not None and grasp.separation is not None
    everything = np.ones_like(valid)
    return {
        "nodes": nodes.astype(np.float32),
        "hold": hold,
        "noise": np.stack([still[0], held[0]]).astype(np.float32),
        "common": still[1],
        "missing": 1.0 - valid.mean(axis=0),
        "onset": _onsets(signal_counts, hold, since, phase, valid, groups.sensor),
        "baseline": baseline,
        "force": _node_means(grasp.contact_force, in_sample, everything, groups.sensor).astype(np.float32)
        if simulated and grasp.contact_force is not None
        else None,
        "separation": _node_means(grasp.separation, in_sample, everything, groups.sensor).astype(np.float32)
        if simulated and grasp.separation is not None
        else None,
        "frames": frames,
    }


def since_phase_began(time_s: FloatArray, phase: NDArray[np.uint8]) -> FloatArray:
    """Seconds since the first frame of each frame's phase, f64[T]."""
    since = np.zeros(len(time_s))
    for value in np.unique(phase):
        own = phase == value
        since[own] = time_s[own] - time_s[own][0]
    return since


class Phases(Protocol):
    """A grasp, as far as the hand was told what to do."""

    @property
    def id(self) -> str:
        """Its name in a file."""
        ...

    @property
    def phase(self) -> NDArray[np.uint8]:
        """u8[T]."""
        ...


def require_hold(grasp: Phases, path: str) -> None:
    """Raises GapInputError for a grasp without frames of hold: nothing of it could be compared."""
    if not (grasp.phase == Phase.HOLD).any():
        where = f"{path}: /grasps/{grasp.id}/phase"
        raise GapInputError(where, "frames in hold (phase 2)", "none", "remove this grasp")


def baseline_frames(
    data: ReadableDataset, grasp: ReadableGrasp, valid: NDArray[np.bool_]
) -> tuple[int, NDArray[np.bool_]]:
    """How many baseline frames every sensor has that has enough of them, 100 at most; and the sensors that have not,
    bool[s]: they lost frames, and their drops in this grasp are unknown.

    Raises GapInputError if none has 10.
    """
    counts = (valid & (grasp.phase == Phase.BASELINE)[:, None]).sum(axis=0)
    present = valid.any(axis=0)
    poor = counts < LEAST_BASELINE
    if present.any() and poor[present].all():
        where = f"{data.path}: /grasps/{grasp.id}/phase"
        remedy = "record the open hand longer before closing, or remove this grasp"
        found = str(int(counts[present].max()))
        raise GapInputError(where, f"at least {LEAST_BASELINE} valid baseline frames (phase 0)", found, remedy)
    return int(min(counts[~poor].min(initial=BASELINE_FRAMES), BASELINE_FRAMES)) if present.any() else 0, poor


def _masked_mean(values: FloatArray, frames: NDArray[np.bool_], sensor: NDArray[np.intp]) -> FloatArray:
    """Mean over the frames of each taxel's sensor, f64[n]; NaN without one."""
    weight = frames[:, sensor]
    count = frames.sum(axis=0)[sensor]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.einsum("tn,tn->n", values, weight.astype(np.float64)) / np.where(count, count, np.nan))


def _node_means(
    values: FloatArray, in_sample: NDArray[np.bool_], valid: NDArray[np.bool_], sensor: NDArray[np.intp]
) -> FloatArray:
    """Mean in each node, f64[K, n]; NaN where no frame of the taxel's sensor lies in it."""
    chosen = in_sample.astype(np.float64)
    if valid.all():
        count = chosen.sum(axis=1)[:, None]
        return np.asarray(chosen @ np.nan_to_num(values) / np.where(count, count, np.nan))
    good = valid[:, sensor]
    count = (chosen @ valid.astype(np.float64))[:, sensor]
    return np.asarray(chosen @ np.where(good, values, 0.0) / np.where(count, count, np.nan))


def _changes(raw: FloatArray, frames: NDArray[np.bool_], groups: Groups) -> tuple[FloatArray, FloatArray]:
    """Noise from differences of successive frames (von Neumann et al. 1941): f64[n], and covariances f64[3]."""
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
    return deviation, _covariances(steps, groups)


def _covariances(steps: FloatArray, groups: Groups) -> FloatArray:
    """Mean covariance of pairs on a TX line, on an RX line, and on the board's others, counts^2, f64[3]."""
    sums, pairs = [], []
    square = float(np.sum(steps**2))
    for belongs in groups.sums:
        size = np.asarray(belongs.sum(axis=1)).ravel()
        sums.append(float(np.sum((belongs @ steps.T) ** 2)) - square)
        pairs.append(float(np.sum(size * (size - 1.0))))
    sums[2] -= sums[0] + sums[1]  # one line of each axis holds a pair at most once
    pairs[2] -= pairs[0] + pairs[1]
    scale = 2.0 * len(steps)
    return np.array([value / (scale * count) if count > 0 else 0.0 for value, count in zip(sums, pairs, strict=True)])


def _onsets(
    signal_counts: FloatArray,
    hold: FloatArray,
    since: FloatArray,
    phase: NDArray[np.uint8],
    valid: NDArray[np.bool_],
    sensor: NDArray[np.intp],
) -> FloatArray:
    """When each board's summed drop first passes half its hold level, seconds after closing began, f64[s]."""
    sensors = valid.shape[1]
    onset = np.full(sensors, np.nan)
    part = np.flatnonzero((phase == Phase.CLOSING) | (phase == Phase.HOLD))
    if not (phase[part] == Phase.CLOSING).any():
        return onset
    closing = phase[part] == Phase.CLOSING
    lasted = since[part][closing].max(initial=0.0)
    time = np.where(closing, since[part], since[part] + lasted)
    touched = np.where(np.nan_to_num(hold) > 0, 1.0, 0.0)
    level = np.bincount(sensor, np.nan_to_num(hold) * touched, sensors)
    still = np.flatnonzero(phase == Phase.BASELINE)
    for board in np.flatnonzero(level > ONSET_LEAST_COUNTS):
        own, rows = np.flatnonzero((sensor == board) & (touched > 0)), part[np.asarray(valid[part, board])]
        rest: FloatArray = signal_counts[np.ix_(still[np.asarray(valid[still, board])], own)].sum(axis=1)
        if level[board] < ONSET_NOISES * float(np.std(rest)):
            continue
        sums: FloatArray = signal_counts[np.ix_(rows, own)].sum(axis=1)
        onset[board] = _crossing(time[np.asarray(valid[part, board])], sums, 0.5 * float(level[board]))
    return onset


def _crossing(time: FloatArray, values: FloatArray, level: float) -> float:
    """When values f64[T] rise over a level: halfway between the first time and the last, since noise makes the one
    early and the other late. NaN if they begin above it or never pass it.
    """
    above = values >= level
    ups = np.flatnonzero(above[1:] & ~above[:-1])
    if above[0] or not len(ups):
        return np.nan
    share = (level - values[ups]) / (values[ups + 1] - values[ups])
    times = time[ups] + share * (time[ups + 1] - time[ups])
    return 0.5 * float(times[0] + times[-1])
