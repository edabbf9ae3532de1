"""Approaches that a simulation has and the recording lacks, read as presses that could be made."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from os import PathLike

import numpy as np

from taxel.errors import TaxelError
from taxel.gap.errors import GapInputError
from taxel.gap.features import features_of, known_mean, session_means, untouched_cells
from taxel.gap.pair import Key, check_tables, silent
from taxel.gap.reading import Progress, read_recording
from taxel.gap.state import State, state_of
from taxel.hand.errors import shown_path
from taxel.recording.grasp import Grasp
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import SIM, Phase


def unrecorded(
    state: State, path: str | PathLike[str], known: Collection[Key] = (), progress: Progress = silent
) -> State | None:
    """The approaches of a simulation that neither the state nor `known` has, as a state; None if it has no more.

    Raises DatasetError and GapInputError of one line: no simulation, or of another hand than the state's.
    """
    pair = state.pair
    with GraspDataset(path) as more:
        name = shown_path(more.path)
        if more.source != SIM:
            raise GapInputError(f"{name}: /source", f'"{SIM}"', f'"{more.source}"', "give approaches of the simulator")
        with GraspDataset(pair.paths[0]) as real:
            columns = check_tables(real, more)
        old = {*pair.cells, *known}
        grasps = [grasp for grasp in more if (grasp.object, grasp.approach) not in old]
        if not grasps:
            return None
        for grasp in grasps:
            _check(grasp, name)
        cells = tuple(sorted({(grasp.object, grasp.approach) for grasp in grasps}))
        firsts = [next(grasp for grasp in grasps if (grasp.object, grasp.approach) == key) for key in cells]
        new = replace(
            pair,
            cells=cells,
            objects={**pair.objects, **more.objects},
            sensor_poses=np.stack([grasp.sensor_pose[columns] for grasp in firsts]),
            object_poses=np.stack([grasp.object_pose for grasp in firsts]),
        )
        numbers = {key: index for index, key in enumerate(cells)}
        recording = read_recording(more, grasps, numbers, pair.clock, pair.groups, columns, progress)
    new = replace(new, real=recording, sim=recording)
    sessions, layout = np.unique(recording.session), state.layout
    features = features_of(new, recording, layout, untouched_cells(new))
    mean = known_mean(session_means(features, recording, len(cells), sessions, layout).value, 1)
    return state_of(new, layout, np.nan_to_num(mean)).shifted(state.shift_s)


def left_out(state: State) -> list[State]:
    """What the pair's own simulation has besides; nothing where that cannot be used: a diagnosis goes without it."""
    if not state.pair.unrecorded:
        return []
    try:
        more = unrecorded(state, state.pair.paths[1])
    except TaxelError:
        return []
    return [] if more is None else [more]


def _check(grasp: Grasp, name: str) -> None:
    if not (grasp.phase == Phase.HOLD).any():
        where = f"{name}: /grasps/{grasp.id}/phase"
        raise GapInputError(where, "frames of hold (phase 2)", "none", "leave this grasp out")
