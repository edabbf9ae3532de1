"""Approaches that a simulation has and the recording lacks, read as presses that could be made."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from os import PathLike

from taxel.errors import TaxelError
from taxel.gap.data.pair import Key, check_tables, first_poses, silent
from taxel.gap.data.prepare import means_of, simulated_state
from taxel.gap.data.readable import ReadableGrasp
from taxel.gap.data.reading import Progress, read_recording, require_hold
from taxel.gap.errors import GapInputError
from taxel.gap.fitting.state import State
from taxel.hand.errors import format_path
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import SIM


def unrecorded(
    state: State, path: str | PathLike[str], known: Collection[Key] = (), progress: Progress = silent
) -> State | None:
    """The approaches of a simulation that neither the state nor `known` has, as a state; None if it has no more.

    Raises DatasetError and GapInputError of one line: no simulation, or of another hand than the state's.
    """
    pair = state.pair
    with GraspDataset(path) as more:
        name = format_path(more.path)
        if more.source != SIM:
            raise GapInputError(f"{name}: /source", f'"{SIM}"', f'"{more.source}"', "give a simulated dataset")
        with GraspDataset(pair.paths[0]) as real:
            columns = check_tables(real, more)
        old = {*pair.conditions, *known}
        grasps: list[ReadableGrasp] = [grasp for grasp in more if (grasp.object, grasp.approach) not in old]
        if not grasps:
            return None
        for grasp in grasps:
            require_hold(grasp, name)
        conditions = tuple(sorted({(grasp.object, grasp.approach) for grasp in grasps}))
        brackets, objects = first_poses(grasps, conditions, columns)
        meshes = {**pair.objects, **more.objects}
        new = replace(pair, conditions=conditions, objects=meshes, sensor_poses=brackets, object_poses=objects)
        numbers = {key: index for index, key in enumerate(conditions)}
        recording = read_recording(more, grasps, numbers, pair.clock, pair.groups, columns, progress)
    new = replace(new, real=recording, sim=recording)
    return simulated_state(new, means_of(new, recording, state.layout), state.layout).shifted(state.shift_s)


def left_out(state: State) -> list[State]:
    """What the pair's own simulation has besides; nothing where that cannot be used: a diagnosis goes without it."""
    if not state.pair.unrecorded:
        return []
    try:
        more = unrecorded(state, state.pair.paths[1])
    except TaxelError:
        return []
    return [] if more is None else [more]
