"""Simulated approaches without a recording, read as candidate contacts."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from os import PathLike

from taxel.errors import TaxelError
from taxel.gap.data.pair import ConditionKey, check_tables, collect_first_poses, ignore_progress
from taxel.gap.data.prepare import compute_recording_means, make_simulated_state
from taxel.gap.data.readable import ReadableGrasp
from taxel.gap.data.reading import Progress, read_recording, require_hold
from taxel.gap.errors import GapInputError
from taxel.gap.fitting.state import State
from taxel.hand.errors import format_path
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import SIM


def read_unrecorded(
    state: State, path: str | PathLike[str], known: Collection[ConditionKey] = (), progress: Progress = ignore_progress
) -> State | None:
    """Read the approaches of a simulated dataset that neither `state` nor `known` contains; None if there are none.

    state: state of the diagnosed pair. path: the simulated dataset. known: conditions to omit. The result has the
    time grid and the time shift of `state`.

    Raises DatasetError and GapInputError with a one-line message, for example for a dataset that is not simulated or
    whose taxels differ from those of `state`.
    """
    pair = state.pair
    with GraspDataset(path) as simulated:
        name = format_path(simulated.path)
        if simulated.source != SIM:
            raise GapInputError(f"{name}: /source", f'"{SIM}"', f'"{simulated.source}"', "give a simulated dataset")
        with GraspDataset(pair.paths[0]) as real:
            columns = check_tables(real, simulated)
        old = {*pair.conditions, *known}
        grasps: list[ReadableGrasp] = [grasp for grasp in simulated if (grasp.object, grasp.approach) not in old]
        if not grasps:
            return None
        for grasp in grasps:
            require_hold(grasp, name)
        conditions = tuple(sorted({(grasp.object, grasp.approach) for grasp in grasps}))
        brackets, objects = collect_first_poses(grasps, conditions, columns)
        meshes = {**pair.objects, **simulated.objects}
        new = replace(pair, conditions=conditions, objects=meshes, sensor_poses=brackets, object_poses=objects)
        numbers = {key: index for index, key in enumerate(conditions)}
        recording = read_recording(simulated, grasps, numbers, pair.time_grid, pair.groups, columns, progress)
    # The real recording lacks these approaches; the simulated recording takes its place.
    new = replace(new, real=recording, sim=recording)
    return make_simulated_state(new, compute_recording_means(new, recording, state.layout), state.layout).shift_time(
        state.shift_s
    )


def read_own_unrecorded(state: State) -> list[State]:
    """Return the approaches that the simulated file of the pair contains and the real recording lacks.

    These approaches are candidates for the next recording. Errors in them are ignored, because the diagnosis itself
    does not need them. Empty if there is no such approach, or if none is usable.
    """
    if not state.pair.unrecorded_conditions:
        return []
    try:
        simulated = read_unrecorded(state, state.pair.paths[1])
    except TaxelError:
        return []
    return [] if simulated is None else [simulated]
