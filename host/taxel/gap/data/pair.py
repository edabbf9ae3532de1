"""The pair of datasets of a diagnosis: the common conditions, with the data of both sides reduced to time nodes."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.boards import BoardLayout, make_board_layouts
from taxel.gap.data.differences import describe_differences
from taxel.gap.data.general_pair import open_pair
from taxel.gap.data.losses import list_losses, require_usable_data
from taxel.gap.data.missing_inputs import LINES
from taxel.gap.data.readable import ReadableDataset, ReadableGrasp
from taxel.gap.data.reading import Progress, Recording, TaxelGroups, read_recording
from taxel.gap.data.simulator_faults import SimulatorFault, exclude_faulty_grasps, find_faults
from taxel.gap.data.time_grid import TimeGrid
from taxel.gap.data.timing import measure_timing
from taxel.gap.errors import GapInputError
from taxel.input_files import open_regular_file
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import REAL, SIM
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable

POSITION_TOLERANCE_M = 1e-5
"""Largest distance in metres between the positions of a taxel in the two files. With a larger distance the files
belong to different hands, and are refused."""

ConditionKey = tuple[str, str]
"""Object and approach of a condition."""


@dataclass(frozen=True, eq=False)
class Pair:
    """A real and a simulated recording of the same conditions (object x approach) on the same hand.

    Attributes:
        conditions: the C conditions (object, approach) that both datasets contain, sorted.
        taxels, sensors, groups: tables of the hand, and boards and lines of its taxels; sensors in the order of the
            real file.
        time_grid: the K time nodes. frame_s: frame period of the slower recording, seconds.
        real, sim: the reduced recordings.
        sensor_model: sensor model of the simulator; None if its file contains none.
        objects: meshes of the simulator, by name of the object.
        sensor_poses, object_poses: poses in the first simulated grasp of each condition, f64[C, s, 4, 4] (s boards) and
            f64[C, 4, 4].
        paths: paths of the real and of the simulated file. digests: SHA-256 of these files.
        losses: sentences for the report on excluded or missing data.
        unrecorded_conditions: the conditions that only the simulated dataset contains, sorted.
        faults: faulty grasps of the simulator (`taxel.gap.data.simulator_faults`).
        missing_inputs: optional data that the datasets lack, keys of `taxel.gap.data.missing_inputs.REASONS`.
        unit: unit of the values in the files, and equivalent counts per unit; None for counts.
        is_real_real: True if the second recording is real, too.
    """

    conditions: tuple[ConditionKey, ...]
    taxels: TaxelTable
    sensors: SensorTable
    groups: TaxelGroups
    time_grid: TimeGrid
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
    unrecorded_conditions: tuple[ConditionKey, ...] = ()
    faults: tuple[SimulatorFault, ...] = ()
    missing_inputs: frozenset[str] = frozenset()
    unit: tuple[str, float] | None = None
    is_real_real: bool = False

    @cached_property
    def sessions(self) -> NDArray[np.int64]:
        """Sessions of the real recording, sorted."""
        return np.unique(self.real.session)

    @cached_property
    def baseline_age_s(self) -> float:
        """Mean age of the baseline of the hand when closing begins, seconds: half the duration of the baseline."""
        return 0.5 * float(self.real.baseline_frames.mean()) * self.frame_s

    @cached_property
    def boards(self) -> tuple[BoardLayout, ...]:
        """Layout of the taxels of each board."""
        return make_board_layouts(self.groups.sensor, self.taxels)

    @cached_property
    def object_names(self) -> tuple[str, ...]:
        """Names of the objects of the conditions, sorted."""
        return tuple(sorted({item for item, _ in self.conditions}))

    @property
    def n(self) -> int:
        """Number of taxels."""
        return len(self.groups.sensor)


def ignore_progress(done: int, total: int) -> None:
    """Do nothing: the default callback for progress."""


def read_pair(
    real_path: str | PathLike[str],
    sim_path: str | PathLike[str],
    progress: Progress = ignore_progress,
    faults: Sequence[SimulatorFault] | None = None,
) -> Pair:
    """Return the pair of recordings of the conditions that two datasets have in common.

    progress: called after each grasp. faults: faulty grasps of the simulator, if the simulated file has already been
    examined; None: examine it. Raises DatasetError for an invalid file, and GapInputError for two datasets that
    cannot be compared, both with a one-line message.
    """
    with open_pair(real_path, sim_path) as opened:
        real, sim = opened.real, opened.sim
        if (real.source, sim.source) == (SIM, REAL):
            where, found = f"{real.path}: /", "the simulation first and the recording second"
            raise GapInputError(where, "the recording of the hand first", found, "exchange the two files")
        columns = check_tables(real, sim)
        real_columns = np.arange(len(columns))
        if faults is None:
            faults = find_faults(sim) if isinstance(sim, GraspDataset) else []
        conditions, real_grasps, sim_grasps, unrecorded_conditions, losses = _find_common_conditions(real, sim, faults)
        timing = measure_timing(((real, real_grasps), (sim, sim_grasps)), conditions)
        time_grid = timing.time_grid
        groups = group_taxels(real.taxels, real.sensors, LINES not in opened.missing_inputs)
        numbers = {key: index for index, key in enumerate(conditions)}
        count, total = len(real_grasps), len(real_grasps) + len(sim_grasps)
        poses = collect_first_poses(sim_grasps, conditions, columns)
        real_poses = collect_first_poses(real_grasps, conditions, real_columns)
        tables, meshes = (real.taxels, sim.taxels), (real.objects, sim.objects)
        deviations = describe_differences(tables, meshes, (real_poses, poses), conditions)
        first = read_recording(
            real, real_grasps, numbers, time_grid, groups, real_columns, lambda done, _: progress(done, total)
        )
        second = read_recording(
            sim, sim_grasps, numbers, time_grid, groups, columns, lambda done, _: progress(count + done, total)
        )
        unknown = time_grid.find_nodes_beyond(timing.durations)
        first, second = first.mask_nodes(unknown), second.mask_nodes(unknown)
        paths = (str(real_path), str(sim_path))
        require_usable_data(paths, first, second, real.sensors)
        return Pair(
            conditions,
            real.taxels,
            real.sensors,
            groups,
            time_grid,
            timing.frame_s,
            first,
            second,
            sim.sensor_model,
            dict(sim.objects),
            *poses,
            paths,
            (_compute_digest(real.path), _compute_digest(sim.path)),
            (*opened.notes, *losses, *deviations, *timing.lost_phases, *list_losses(first, second, groups)),
            unrecorded_conditions,
            tuple(faults),
            opened.missing_inputs,
            opened.unit,
            sim.source == REAL,
        )


def check_tables(real: ReadableDataset, sim: ReadableDataset) -> NDArray[np.intp]:
    """Return the sensor columns of the simulated file in the order of the real file, [s] (s boards).

    Raises GapInputError if the two files have different taxels, lines, positions or boards.
    """
    remedy = "give two datasets of the same hand, with the same taxels in the same order"
    if real.taxels.n != sim.taxels.n:
        raise GapInputError(
            f"{sim.path}: /taxels", f"{real.taxels.n} taxels as in {real.path}", str(sim.taxels.n), remedy
        )
    for name in ("sensor", "tx", "rx"):
        expected, actual = getattr(real.taxels, name), getattr(sim.taxels, name)
        if (expected != actual).any():
            k = int(np.flatnonzero(expected != actual)[0])
            where = f"{sim.path}: /taxels/{name}[{k}]"
            raise GapInputError(where, f"{int(expected[k])} as in {real.path}", str(int(actual[k])), remedy)
    distance_m = np.linalg.norm(real.taxels.position - sim.taxels.position, axis=1)
    if distance_m.max() > POSITION_TOLERANCE_M:
        k = int(distance_m.argmax())
        where = f"{sim.path}: /taxels/position[{k}]"
        found = f"a position {1e3 * distance_m[k]:.3g} mm away"
        raise GapInputError(where, f"the position in {real.path}", found, remedy)
    sim_addresses = sim.sensors.address.tolist()
    for address in real.sensors.address.tolist():
        if address not in sim_addresses:
            where = f"{sim.path}: /sensors/address"
            raise GapInputError(where, f"board {address} as in {real.path}", "none", remedy)
    return np.array([sim_addresses.index(address) for address in real.sensors.address.tolist()], dtype=np.intp)


def collect_first_poses(
    grasps: Sequence[ReadableGrasp], conditions: Sequence[ConditionKey], columns: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the poses in the first grasp of each condition: brackets f64[C, s, 4, 4] (C conditions, s boards), objects
    f64[C, 4, 4].

    columns: [s], columns of the grasps' sensor poses in the order of the result.
    """
    firsts = [next(grasp for grasp in grasps if (grasp.object, grasp.approach) == key) for key in conditions]
    brackets = np.stack([grasp.sensor_pose[columns] for grasp in firsts])
    return brackets, np.stack([grasp.object_pose for grasp in firsts])


def _find_common_conditions(
    real: ReadableDataset, sim: ReadableDataset, faults: Sequence[SimulatorFault]
) -> tuple[tuple[ConditionKey, ...], list[ReadableGrasp], list[ReadableGrasp], tuple[ConditionKey, ...], list[str]]:
    """Return the common conditions, their real grasps, their simulated grasps, the conditions that only the simulated
    dataset contains, and sentences on the excluded conditions.

    Raises GapInputError if the datasets have no common condition.
    """
    sides = [list(real), exclude_faulty_grasps(list(sim), faults)]
    keys = [{(grasp.object, grasp.approach) for grasp in grasps} for grasps in sides]
    common = tuple(sorted(keys[0] & keys[1]))
    if not common:
        shown = ", ".join(f"{item} {name}" for item, name in sorted(keys[0])[:3]) or "no grasp"
        found = ", ".join(f"{item} {name}" for item, name in sorted(keys[1])[:3]) or "no grasp"
        where, remedy = f"{sim.path}: /grasps", "simulate the recorded grasps"
        raise GapInputError(where, f"an (object, approach) of {real.path} ({shown})", found, remedy)
    losses = []
    for data, data_keys, other in ((real, keys[0], "simulation"), (sim, keys[1], "recording")):
        excluded = sorted(data_keys - set(common))
        if excluded:
            names = ", ".join(f"{item} {name}" for item, name in excluded[:4])
            losses.append(f"{data.path}: {len(excluded)} conditions without a {other} were excluded ({names})")
    real_grasps, sim_grasps = ([one for one in grasps if (one.object, one.approach) in set(common)] for grasps in sides)
    return common, real_grasps, sim_grasps, tuple(sorted(keys[1] - set(common))), losses


def group_taxels(taxels: TaxelTable, sensors: SensorTable, has_lines: bool = True) -> TaxelGroups:
    """Return the board and the lines of each taxel. has_lines: whether the dataset has electrode lines; if False, each
    taxel gets lines of its own.
    """
    board = sensors.index_of(taxels)
    if not has_lines:
        return TaxelGroups(board, np.arange(taxels.n), np.arange(taxels.n))
    # Line numbers are below 256, so the sum is unique for each line of each board.
    tx = np.unique(board * 256 + taxels.tx, return_inverse=True)[1]
    rx = np.unique(board * 256 + taxels.rx, return_inverse=True)[1]
    return TaxelGroups(board, tx, rx)


def _compute_digest(path: Path) -> str:
    """Return the SHA-256 of a file."""
    with open_regular_file(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
