"""Missing data of a pair of recordings: sentences for the report, and refusal of unusable recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.reading import Recording, TaxelGroups
from taxel.gap.errors import GapInputError
from taxel.recording.grasp_format import BASELINE_FRAMES, Phase
from taxel.recording.grasp_tables import SensorTable

MAX_HOLD_RATIO = 50.0
"""Largest ratio of the median durations of hold of the two sides (chosen). Beyond this ratio, the times of one file are
probably not in seconds, and the report states the durations."""


def require_usable_data(paths: tuple[str, str], real: Recording, sim: Recording, sensors: SensorTable) -> None:
    """Raise GapInputError if one recording cannot be compared at all.

    This is the case for a real recording without valid frames in hold, for constant counts (in the simulation only if
    contact forces occur), and for a board without any frame in the simulation. paths: paths of the real and of the
    simulated file, for the message.
    """
    if not np.isfinite(real.hold_signal_counts).any():
        where, remedy = f"{paths[0]}: /grasps/*/valid", "record grasps with valid frames"
        raise GapInputError(where, "valid frames in hold", "none in any grasp", remedy)
    silent = np.flatnonzero((sim.missing_share >= 1.0).all(axis=0))
    if len(silent):
        board, remedy = int(sensors.address[silent[0]]), "simulate this board, or remove it from both files"
        raise GapInputError(f"{paths[1]}: /grasps/*/valid", f"frames of sensor {board}", "none in any grasp", remedy)
    if _is_constant(real):
        where, remedy = f"{paths[0]}: /grasps/*/raw_counts", "check the recording of the hand"
        raise GapInputError(where, "counts that change", "constant counts in each grasp", remedy)
    if sim.force is not None and _is_constant(sim) and (np.nan_to_num(sim.force) > 0.0).any():
        where, remedy = f"{paths[1]}: /grasps/*/raw_counts", "write the counts that the sensor model gives"
        raise GapInputError(where, "counts that depend on contact_force", "constant counts in each grasp", remedy)


def list_losses(real: Recording, sim: Recording, groups: TaxelGroups) -> list[str]:
    """Return sentences for the report on missing data that limit the results: sessions, forces, repeats and frames."""
    losses = []
    sessions = np.unique(real.session)
    if len(sessions) < 3:
        count = "one session" if len(sessions) == 1 else f"{len(sessions)} sessions"
        losses.append(f"only {count}: no intervals; the held-out grasps have the same mounting of the skin")
    if sim.force is None:
        losses.append("the simulation has no contact_force and separation: effects that act on force are unavailable")
    confounded = [
        s for s in sessions if len(np.unique(real.condition[real.session == s])) < len(np.unique(real.condition))
    ]
    if len(sessions) > 1 and len(confounded) == len(sessions):
        losses.append("no session has every approach: differences between sessions and between approaches are mixed")
    repeats = np.bincount(real.condition)
    if repeats.max() < 2:
        losses.append("no condition was repeated: the variance is unknown, and a gap is not distinguishable from it")
    elif _has_identical_repeats(real):
        losses.append("the repeats of each condition are bit-identical: the variance is unknown")
    elif repeats.min() < 2:
        losses.append("a condition was recorded only once: its variance is taken from the other conditions")
    for one, side in ((real, "hand"), (sim, "simulator")):
        losses += _list_lost_frames(one, side, groups)
    return losses


def list_lost_phases(
    sides: Sequence[tuple[str, Sequence[str]]], durations: Mapping[Phase, Sequence[Sequence[float]]]
) -> list[str]:
    """Return sentences for the report on phases that are excluded because some grasps lack them, and on unequal holds.

    sides: path and names of the grasps, of the hand, then of the simulator. durations: for each phase, for the hand and
    the simulator, the seconds of each grasp; 0 if the grasp lacks the phase. Every grasp has a hold (`require_hold`). A
    further sentence states the median durations of hold if their ratio exceeds `MAX_HOLD_RATIO`.
    """
    losses = []
    for phase, durations_of_sides in durations.items():
        if not any(any(grasp_durations) for grasp_durations in durations_of_sides):
            continue  # a phase that both files lack is no difference between them
        for (path, names), grasp_durations in zip(sides, durations_of_sides, strict=True):
            without = [name for name, seconds in zip(names, grasp_durations, strict=True) if seconds <= 0]
            if without:
                affected = f"{len(without)} of {len(names)} grasps ({without[0]})"
                losses.append(f"{path}: {phase.name.lower()} is missing in {affected}: excluded from the comparison")
    real, sim = (float(np.median(grasp_durations)) for grasp_durations in durations[Phase.HOLD])
    if not 1.0 / MAX_HOLD_RATIO < real / sim < MAX_HOLD_RATIO:
        losses.append(f"hold lasts {real:.3g} s on the hand and {sim:.3g} s in the simulator: check the unit of time")
    return losses


def _is_constant(recording: Recording) -> bool:
    """Return True if the counts are constant in the valid frames of every grasp."""
    return not any(np.nan_to_num(values).any() for values in (recording.node_signal_counts, recording.noise))


def _has_identical_repeats(recording: Recording) -> bool:
    """Return True if all grasps of each condition have bit-identical signals in hold and noise."""
    # index of the first grasp of the same condition, for each grasp
    first = np.unique(recording.condition, return_index=True)[1][np.unique(recording.condition, return_inverse=True)[1]]
    arrays: tuple[NDArray[np.floating], ...] = (recording.hold_signal_counts, recording.noise)
    return all(np.array_equal(values, values[first], equal_nan=True) for values in arrays)


def _list_lost_frames(recording: Recording, side: str, groups: TaxelGroups) -> list[str]:
    """Return sentences on grasps without valid frames, short baselines, and boards without a baseline. side: "hand" or
    "simulator".
    """
    losses = []
    arrived = (recording.missing_share < 1.0).any(axis=1)
    if not arrived.all():
        losses.append(f"{int((~arrived).sum())} of {len(recording)} grasps of the {side} have no valid frame")
    least = int(recording.baseline_frames[arrived].min(initial=BASELINE_FRAMES))
    if least < BASELINE_FRAMES:
        losses.append(f"the baselines of the {side} have {least} frames instead of {BASELINE_FRAMES}")
    count = 0
    for baseline, missing in zip(recording.baseline, recording.missing_share, strict=True):
        boards = np.unique(groups.sensor[np.isnan(baseline)])
        count += int((missing[boards] < 1.0).any())
    if count:
        affected = f"{count} of {len(recording)} grasps of the {side}"
        losses.append(f"in {affected} a board has no baseline: its signal there is unknown")
    return losses
