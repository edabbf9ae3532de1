"""Effects of a report, added to the frames of one simulated grasp."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taxel.gap.apply.frames import SimulatedGrasp, find_effect_frames
from taxel.gap.apply.random_samples import (
    RandomStreams,
    remove_lost_frames,
    repeat_last_counts,
    sample_drift,
    sample_noise,
)
from taxel.gap.data.pair import Pair
from taxel.gap.effects.latency import is_delay
from taxel.gap.errors import GapInputError
from taxel.gap.fitting.state import State
from taxel.gap.report.model import list_block_names
from taxel.gap.report.reading import ReportedEffect
from taxel.recording.grasp_format import Phase
from taxel.recording.grasp_sensor_model import LARGEST_COUNT
from taxel.types import FloatArray


def add_effects_to_grasp(
    state: State, grasp: SimulatedGrasp, effects: Sequence[ReportedEffect], streams: RandomStreams
) -> tuple[NDArray[np.uint16], NDArray[np.bool_]]:
    """Return raw_counts u16[T, n] (T frames, n taxels) and valid bool[T, s] (s boards) of a grasp with effects.

    state: state of the frames of the grasp (`FrameStates.build_state`). effects: effects in the order in which they
    act. streams: random numbers of this grasp. An array that no effect changes is returned as the same object. Raises
    GapInputError if the forces of the grasp produce counts that are not finite.
    """
    pair, raw, valid = state.pair, grasp.raw_counts, grasp.valid
    change = np.zeros((len(grasp.phase), pair.n))
    change[find_effect_frames(grasp)] = compute_signal_change(state, effects, streams)
    is_stuck = np.zeros(pair.n, bool)
    for reported in effects:
        if reported.name == "noise":
            change -= sample_noise(get_noise_deviations(reported, pair), pair.groups, len(grasp.phase), streams)
        if any(reported.missing.values()):
            missing = np.array([reported.missing.get(int(address), 0.0) for address in pair.sensors.address])
            valid = remove_lost_frames(grasp, valid, missing, streams)
        is_stuck[list(reported.stuck)] = True
    if not np.isfinite(change).all():
        where = f"{pair.paths[1]}: /grasps/{grasp.id}/contact_force"
        raise GapInputError(where, "forces with finite counts", "larger forces", "correct contact_force")
    if change.any():  # the signal is baseline minus raw count: an increase of the signal lowers the count
        raw = np.clip(np.rint(raw - change), 0, LARGEST_COUNT).astype(np.uint16)
    if is_stuck.any():
        raw = np.where(is_stuck, _compute_rest_counts(grasp), raw).astype(np.uint16)
    if raw is not grasp.raw_counts or valid is not grasp.valid:
        raw = repeat_last_counts(raw, valid, pair.groups.sensor)
    return raw, valid


def _compute_rest_counts(grasp: SimulatedGrasp) -> FloatArray:
    """Return the median baseline counts of each taxel, f64[n] (n taxels); the median of all frames if the grasp has no
    baseline frames.
    """
    is_baseline = grasp.phase == Phase.BASELINE
    return np.asarray(np.rint(np.median(grasp.raw_counts[is_baseline | ~is_baseline.any()], axis=0)))


def compute_signal_change(state: State, effects: Sequence[ReportedEffect], streams: RandomStreams) -> FloatArray:
    """Return the change of the signal by effects in the K frames of one grasp, f64[K, n] (n taxels), counts.

    Noise is omitted, because it does not change the mean signal. The report states delays relative to the simulation
    after the time alignment, but the frames have the simulator's own times. The shift of the alignment (`shift_s`) is
    therefore added to each delay.
    """
    signal = state.base
    for reported in effects:
        if reported.name == "noise":
            continue  # noise does not change the mean signal
        values = map_values_to_blocks(reported, reported.effect.make_neutral_values(state), state.pair)
        if reported.name == "baseline_drift":
            # The standard deviation of a drift was measured in the last phase, where the drift is not yet complete.
            relative_time = state.node_times_s / state.node_times_s[-1]
            measured_share = float(relative_time[state.time_grid.phase == state.time_grid.phase[-1]].mean())
            values = sample_drift(values, measured_share, state.node_times_s[-1] / reported.until_s, streams)
        if is_delay(reported.effect) and values.any():
            values = values + reported.shift_s
        signal = reported.effect.apply(state, signal, values)
    if signal is state.base:
        return np.zeros(state.signal_counts.shape[1:])
    return np.asarray(np.squeeze(state.to_signal_counts(signal) - state.signal_counts, axis=0))


def get_noise_deviations(reported: ReportedEffect, pair: Pair) -> FloatArray:
    """Return the standard deviations of the noise components of each taxel, f64[4, n] (n taxels), counts.

    The components are independent: white noise, and noise common to the TX line, the RX line and the board.
    """
    blocks = reported.effect.find_blocks_of_pair(pair)[0]
    return map_values_to_blocks(reported, np.zeros((len(reported.parameters), int(blocks.max()) + 1)), pair)[:, blocks]


def map_values_to_blocks(reported: ReportedEffect, neutral: FloatArray, pair: Pair) -> FloatArray:
    """Return the values of a reported effect in the blocks of a pair, f64[P, G] (P parameters; G blocks: the hand,
    boards, objects or taxels), matched by the names of the blocks.

    neutral: f64[P, G], neutral values, which apply to blocks that the report lacks.
    """
    values = neutral.copy()
    column = {name: number for number, name in enumerate(reported.blocks)}
    for block, name in enumerate(list_block_names(pair, reported.effect.scope)[: values.shape[1]]):
        if name in column:
            values[:, block] = reported.values[:, column[name]]
    return values
