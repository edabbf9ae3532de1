"""A report's effects added to one grasp of a simulation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taxel.gap.apply.draws import Chance, drifts, lost, noise, repeated
from taxel.gap.apply.frames import SimulatedGrasp, moving
from taxel.gap.data.pair import Pair
from taxel.gap.effects.latency import is_delay
from taxel.gap.errors import GapInputError
from taxel.gap.fitting.state import State
from taxel.gap.report.model import block_names
from taxel.gap.report.reading import ReportedEffect
from taxel.recording.grasp_format import Phase
from taxel.recording.grasp_sensor_model import LARGEST_COUNT
from taxel.types import FloatArray


def with_effects(
    state: State, grasp: SimulatedGrasp, effects: Sequence[ReportedEffect], chance: Chance
) -> tuple[NDArray[np.uint16], NDArray[np.bool_]]:
    """A grasp's raw_counts u16[T, n] and valid bool[T, s] with effects, which stand in the order in which they act.

    state: of the grasp's frames. A part that no effect changes is returned as it was, bit for bit. Raises GapInputError
    where the grasp's forces are too large for numbers.
    """
    pair, raw, valid = state.pair, grasp.raw_counts, grasp.valid
    change = np.zeros((len(grasp.phase), pair.n))
    change[moving(grasp)] = compute_signal_change(state, effects, chance)
    still = np.zeros(pair.n, bool)
    for one in effects:
        if one.name == "noise":
            change -= noise(noise_of(one, pair), pair.groups, len(grasp.phase), chance)
        if any(one.missing.values()):
            missing = np.array([one.missing.get(int(address), 0.0) for address in pair.sensors.address])
            valid = lost(grasp, valid, missing, chance)
        still[list(one.stuck)] = True
    if not np.isfinite(change).all():
        where = f"{pair.paths[1]}: /grasps/{grasp.id}/contact_force"
        raise GapInputError(where, "forces with finite counts", "larger forces", "correct contact_force")
    if change.any():
        raw = np.clip(np.rint(raw - change), 0, LARGEST_COUNT).astype(np.uint16)
    if still.any():
        raw = np.where(still, _at_rest(grasp), raw).astype(np.uint16)
    if raw is not grasp.raw_counts or valid is not grasp.valid:
        raw = repeated(raw, valid, pair.groups.sensor)
    return raw, valid


def _at_rest(grasp: SimulatedGrasp) -> FloatArray:
    rest = grasp.phase == Phase.BASELINE
    return np.asarray(np.rint(np.median(grasp.raw_counts[rest | ~rest.any()], axis=0)))


def compute_signal_change(state: State, effects: Sequence[ReportedEffect], chance: Chance) -> FloatArray:
    """What effects add to the drops of the frames of one grasp, f64[K, n], counts.

    A board's latency counts from the simulator's own time, so what all boards share belongs to it.
    """
    signal = state.base
    for one in effects:
        if one.name == "noise":
            continue  # drops are means
        values = placed(one, one.effect.neutral(state), state.pair)
        if one.name == "baseline_drift":
            since = state.since / state.since[-1]
            late = float(since[state.clock.phase == state.clock.phase[-1]].mean())
            values = drifts(values, late, state.since[-1] / one.until_s, chance)
        if is_delay(one.effect) and values.any():
            values = values + one.shift_s
        signal = one.effect.apply(state, signal, values)
    if signal is state.base:
        return np.zeros(state.signal_counts.shape[1:])
    return np.asarray(np.squeeze(state.to_signal_counts(signal) - state.signal_counts, axis=0))


def noise_of(one: ReportedEffect, pair: Pair) -> FloatArray:
    """Standard deviations of each taxel's noise, f64[4, n], see `NOISE_PARTS`."""
    blocks = one.effect.blocks_of(pair)[0]
    return placed(one, np.zeros((len(one.parameters), int(blocks.max()) + 1)), pair)[:, blocks]


def placed(one: ReportedEffect, neutral: FloatArray, pair: Pair) -> FloatArray:
    """An effect's values f64[P, G] in the blocks of a pair, by their names; neutral where the report has no such."""
    values = neutral.copy()
    column = {name: number for number, name in enumerate(one.blocks)}
    for block, name in enumerate(block_names(pair, one.effect.scope)[: values.shape[1]]):
        if name in column:
            values[:, block] = one.values[:, column[name]]
    return values
