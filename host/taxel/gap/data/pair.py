"""Two datasets that are to be compared: what they have in common, read and reduced."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.boards import BoardLayout, layouts_of
from taxel.gap.data.clock import Clock
from taxel.gap.data.differences import differences
from taxel.gap.data.general_pair import open_pair
from taxel.gap.data.lacking import LINES
from taxel.gap.data.losses import losses_of, require_answers
from taxel.gap.data.readable import ReadableDataset, ReadableGrasp
from taxel.gap.data.reading import Groups, Progress, Recording, read_recording
from taxel.gap.data.simulator_faults import SimulatorFault, find_faults, without_faults
from taxel.gap.data.timing import timing_of
from taxel.gap.errors import GapInputError
from taxel.input_files import open_regular_file
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import REAL, SIM
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable

PLACE_TOLERANCE_M = 1e-5

Key = tuple[str, str]


@dataclass(frozen=True, eq=False)
class Pair:
    """A real and a simulated recording of the same (object, approach) cells on the same hand.

    Attributes:
        cells: the C keys (object, approach) that both have, sorted.
        taxels, sensors, groups: of the hand; sensors in the order of the real file.
        clock: nodes of time. frame_s: frame period of the slower recording. real, sim: the reduced recordings.
        sensor_model: of the simulator, if its file states one.
        objects: the simulator's meshes by name. sensor_poses, object_poses: of the simulation's first grasp of each
            cell, f64[C, s, 4, 4] and f64[C, 4, 4].
        paths: of both files. digests: their SHA-256.
        losses: what this pair lacks, in words, for the report.
        unrecorded: cells that only the simulator has, sorted.
        faults: simulated grasps that violate physics.
        lacking: what the datasets lack, by the keys of `taxel.gap.data.lacking.REASONS`.
        unit: unit of the values, and counts of this pair per unit; None for counts.
        is_real_real: whether the second recording is a real one, too.
    """

    conditions: tuple[Key, ...]
    taxels: TaxelTable
    sensors: SensorTable
    groups: Groups
    clock: Clock
    frame_s: float
    real: Recording
    sim: Recording
    sensor_model: SensorModel | None
    objects: dict[str, ObjectMesh]
    sensor_poses: NDArray[np.float64]
    object_poses: NDArray[np.float64]
    paths: tuple[str, str]
    digests: tuple[str, str]
    losses: tuple[str, ...]
    unrecorded: tuple[Key, ...] = ()
    faults: tuple[SimulatorFault, ...] = ()
    lacking: frozenset[str] = frozenset()
    unit: tuple[str, float] | None = None
    is_real_real: bool = False

    @cached_property
    def sessions(self) -> NDArray[np.int64]:
        """Sessions of the real recording, sorted."""
        return np.unique(self.real.session)

    @cached_property
    def baseline_age_s(self) -> float:
        """How old the hand's baselines are when closing begins: the middle of their frames."""
        return 0.5 * float(self.real.frames.mean()) * self.frame_s

    @cached_property
    def boards(self) -> tuple[BoardLayout, ...]:
        """Where each board's taxels lie."""
        return layouts_of(self.groups.sensor, self.taxels)

    @cached_property
    def object_names(self) -> tuple[str, ...]:
        """Objects of the cells, sorted."""
        return tuple(sorted({item for item, _ in self.conditions}))

    @property
    def n(self) -> int:
        """Number of taxels."""
        return len(self.groups.sensor)


def silent(done: int, total: int) -> None:
    """No progress is shown."""


def read_pair(real_path: str | PathLike[str], sim_path: str | PathLike[str], progress: Progress = silent) -> Pair:
    """Read what two datasets have in common. Raises DatasetError and GapInputError of one line."""
    with open_pair(real_path, sim_path) as opened:
        real, sim = opened.real, opened.sim
        if (real.source, sim.source) == (SIM, REAL):
            where, found = f"{real.path}: /", "the simulation first and the recording second"
            raise GapInputError(where, "the recording of the hand first", found, "exchange the two files")
        columns = check_tables(real, sim)
        faults = find_faults(sim) if isinstance(sim, GraspDataset) else []
        conditions, made, simulated, unrecorded, losses = _common_conditions(real, sim, faults)
        timing = timing_of(((real, made), (sim, simulated)), conditions)
        clock = timing.clock
        groups = grouped(real.taxels, real.sensors, LINES not in opened.lacking)
        numbers = {key: index for index, key in enumerate(conditions)}
        count, total = len(made), len(made) + len(simulated)
        poses = first_poses(simulated, conditions, columns)
        believed = first_poses(made, conditions, np.arange(len(columns)))
        otherwise = differences((real.taxels, sim.taxels), (real.objects, sim.objects), (believed, poses), conditions)
        first = read_recording(
            real, made, numbers, clock, groups, np.arange(len(columns)), lambda done, _: progress(done, total)
        )
        second = read_recording(
            sim, simulated, numbers, clock, groups, columns, lambda done, _: progress(count + done, total)
        )
        unknown = clock.beyond(timing.lasts)
        first, second = first.without_nodes(unknown), second.without_nodes(unknown)
        paths = (str(real_path), str(sim_path))
        require_answers(paths, first, second, real.sensors)
        return Pair(
            conditions,
            real.taxels,
            real.sensors,
            groups,
            clock,
            timing.frame_s,
            first,
            second,
            sim.sensor_model,
            dict(sim.objects),
            *poses,
            paths,
            (_digest(real.path), _digest(sim.path)),
            (*opened.notes, *losses, *otherwise, *timing.lost, *losses_of(first, second, groups)),
            unrecorded,
            tuple(faults),
            opened.lacking,
            opened.unit,
            sim.source == REAL,
        )


def check_tables(real: ReadableDataset, sim: ReadableDataset) -> NDArray[np.intp]:
    """The simulator's sensor columns in the order of the real file's."""
    remedy = "give two datasets of the same hand, with the same taxels in the same order"
    if real.taxels.n != sim.taxels.n:
        raise GapInputError(
            f"{sim.path}: /taxels", f"{real.taxels.n} taxels as in {real.path}", str(sim.taxels.n), remedy
        )
    for name in ("sensor", "tx", "rx"):
        ours, theirs = getattr(real.taxels, name), getattr(sim.taxels, name)
        if (ours != theirs).any():
            k = int(np.flatnonzero(ours != theirs)[0])
            where = f"{sim.path}: /taxels/{name}[{k}]"
            raise GapInputError(where, f"{int(ours[k])} as in {real.path}", str(int(theirs[k])), remedy)
    apart = np.linalg.norm(real.taxels.position - sim.taxels.position, axis=1)
    if apart.max() > PLACE_TOLERANCE_M:
        k = int(apart.argmax())
        where = f"{sim.path}: /taxels/position[{k}]"
        found = f"a position {1e3 * apart[k]:.3g} mm away"
        raise GapInputError(where, f"the position in {real.path}", found, remedy)
    own = sim.sensors.address.tolist()
    for address in real.sensors.address.tolist():
        if address not in own:
            where = f"{sim.path}: /sensors/address"
            raise GapInputError(where, f"board {address} as in {real.path}", "none", remedy)
    return np.array([own.index(address) for address in real.sensors.address.tolist()], dtype=np.intp)


def first_poses(
    grasps: Sequence[ReadableGrasp], conditions: Sequence[Key], columns: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Poses of each cell's first grasp: brackets f64[C, s, 4, 4] in the order of `columns`, objects f64[C, 4, 4]."""
    firsts = [next(grasp for grasp in grasps if (grasp.object, grasp.approach) == key) for key in conditions]
    brackets = np.stack([grasp.sensor_pose[columns] for grasp in firsts])
    return brackets, np.stack([grasp.object_pose for grasp in firsts])


def _common_conditions(
    real: ReadableDataset, sim: ReadableDataset, faults: Sequence[SimulatorFault]
) -> tuple[tuple[Key, ...], list[ReadableGrasp], list[ReadableGrasp], tuple[Key, ...], list[str]]:
    """Cells of both, their grasps on either side, cells of the simulator alone, and what is lost."""
    every = [list(real), without_faults(list(sim), faults)]
    keys = [{(grasp.object, grasp.approach) for grasp in grasps} for grasps in every]
    common = tuple(sorted(keys[0] & keys[1]))
    if not common:
        shown = ", ".join(f"{item} {name}" for item, name in sorted(keys[0])[:3]) or "no grasp"
        found = ", ".join(f"{item} {name}" for item, name in sorted(keys[1])[:3]) or "no grasp"
        where, remedy = f"{sim.path}: /grasps", "simulate the recorded grasps"
        raise GapInputError(where, f"an (object, approach) of {real.path} ({shown})", found, remedy)
    losses = []
    for data, own, other in ((real, keys[0], "simulation"), (sim, keys[1], "recording")):
        left = sorted(own - set(common))
        if left:
            names = ", ".join(f"{item} {name}" for item, name in left[:4])
            losses.append(f"{data.path}: {len(left)} conditions without a {other} were excluded ({names})")
    made, simulated = ([one for one in grasps if (one.object, one.approach) in set(common)] for grasps in every)
    return common, made, simulated, tuple(sorted(keys[1] - set(common))), losses


def grouped(taxels: TaxelTable, sensors: SensorTable, has_lines: bool = True) -> Groups:
    """Which taxels of a hand belong together. has_lines: False: each taxel has lines of its own."""
    board = sensors.index_of(taxels)
    if not has_lines:
        return Groups(board, np.arange(taxels.n), np.arange(taxels.n))
    tx = np.unique(board * 256 + taxels.tx, return_inverse=True)[1]
    rx = np.unique(board * 256 + taxels.rx, return_inverse=True)[1]
    return Groups(board, tx, rx)


def _digest(path: Path) -> str:
    with open_regular_file(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
