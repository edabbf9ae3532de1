"""What a pair of recordings lacks: in words where less can be told, refused where nothing can."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.reading import Groups, Recording
from taxel.gap.errors import GapInputError
from taxel.recording.grasp_format import Phase
from taxel.recording.grasp_tables import SensorTable

MOST_RATIO = 50.0
"""Of how long hold lasts on either side, beyond which one of them is hardly in seconds."""


def require_answers(paths: tuple[str, str], real: Recording, sim: Recording, sensors: SensorTable) -> None:
    """Raises GapInputError where a whole side tells nothing: no hold, counts that stand still, a board that the
    simulator never reads.
    """
    if not np.isfinite(real.hold).any():
        where, remedy = f"{paths[0]}: /grasps/*/valid", "record grasps with valid frames"
        raise GapInputError(where, "valid frames in hold", "none in any grasp", remedy)
    silent = np.flatnonzero((sim.missing >= 1.0).all(axis=0))
    if len(silent):
        board, remedy = int(sensors.address[silent[0]]), "simulate this board, or remove it from both files"
        raise GapInputError(f"{paths[1]}: /grasps/*/valid", f"frames of sensor {board}", "none in any grasp", remedy)
    if _stands_still(real):
        where, remedy = f"{paths[0]}: /grasps/*/raw_counts", "check the recording of the hand"
        raise GapInputError(where, "counts that change", "constant counts in each grasp", remedy)
    if sim.force is not None and _stands_still(sim) and (np.nan_to_num(sim.force) > 0.0).any():
        where, remedy = f"{paths[1]}: /grasps/*/raw_counts", "write the counts that the sensor model gives"
        raise GapInputError(where, "counts that depend on contact_force", "constant counts in each grasp", remedy)


def losses_of(real: Recording, sim: Recording, groups: Groups) -> list[str]:
    """What less can be told, and why: sentences for the report."""
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
    made = np.bincount(real.condition)
    if made.max() < 2:
        losses.append("no condition was repeated: the variance is unknown, and a gap is not distinguishable from it")
    elif _are_copies(real):
        losses.append("the repeats of each condition are bit-identical: the variance is unknown")
    elif made.min() < 2:
        losses.append("a condition was recorded only once: its variance is taken from the other conditions")
    for one, side in ((real, "hand"), (sim, "simulator")):
        losses += _lost_frames(one, side, groups)
    return losses


def lost_phases(
    sides: Sequence[tuple[str, Sequence[str]]], durations: Mapping[Phase, Sequence[Sequence[float]]]
) -> list[str]:
    """Phases that are compared in no grasp because some have none. sides: path and grasps of hand and simulator.
    durations: seconds of each of those grasps, by phase and side; 0 for none.
    """
    losses = []
    for phase, lasts in durations.items():
        if not any(any(own) for own in lasts):
            continue  # in neither file: nothing is lost
        for (path, names), own in zip(sides, lasts, strict=True):
            without = [name for name, seconds in zip(names, own, strict=True) if seconds <= 0]
            if without:
                those = f"{len(without)} of {len(names)} grasps ({without[0]})"
                losses.append(f"{path}: {phase.name.lower()} is missing in {those}: excluded from the comparison")
    real, sim = (float(np.median(own)) for own in durations[Phase.HOLD])
    if not 1.0 / MOST_RATIO < real / sim < MOST_RATIO:
        losses.append(f"hold lasts {real:.3g} s on the hand and {sim:.3g} s in the simulator: check the unit of time")
    return losses


def _stands_still(recording: Recording) -> bool:
    """Whether no count of any grasp ever changes, as far as frames arrived."""
    return not any(np.nan_to_num(part).any() for part in (recording.nodes, recording.noise))


def _are_copies(recording: Recording) -> bool:
    """Whether all grasps of each approach are the same."""
    first = np.unique(recording.condition, return_index=True)[1][np.unique(recording.condition, return_inverse=True)[1]]
    parts: tuple[NDArray[np.floating], ...] = (recording.hold, recording.noise)
    return all(np.array_equal(part, part[first], equal_nan=True) for part in parts)


def _lost_frames(recording: Recording, side: str, groups: Groups) -> list[str]:
    """Of grasps that never arrived, of baselines that are short, and of boards that lost theirs."""
    losses = []
    arrived = (recording.missing < 1.0).any(axis=1)
    if not arrived.all():
        losses.append(f"{int((~arrived).sum())} of {len(recording)} grasps of the {side} have no valid frame")
    least = int(recording.frames[arrived].min(initial=100))
    if least < 100:
        losses.append(f"the baselines of the {side} have {least} frames instead of 100")
    count = 0
    for baseline, missing in zip(recording.baseline, recording.missing, strict=True):
        boards = np.unique(groups.sensor[np.isnan(baseline)])
        count += int((missing[boards] < 1.0).any())
    if count:
        those = f"{count} of {len(recording)} grasps of the {side}"
        losses.append(f"in {those} a board has no baseline: its signal there is unknown")
    return losses
