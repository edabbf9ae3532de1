"""Synthetic dataset pairs of two flat boards; the real dataset has given effects that the simulated one lacks.

No code of the diagnosis computes the values of the datasets.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from host.tests.gap.stiffer_layer import stiffen
from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.diagnosis import diagnose
from taxel.gap.effects.effect import HAND
from taxel.gap.effects.stiffness import Stiffness
from taxel.gap.features.features import FeatureLayout
from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.fit import start_effect
from taxel.gap.fitting.state import build_state
from taxel.recording import (
    DatasetHeader,
    GraspDatasetWriter,
    GraspRecord,
    ObjectMesh,
    SensorModel,
    SensorTable,
    TaxelTable,
)

ROWS, COLUMNS = 6, 5
N, BOARDS = 2 * ROWS * COLUMNS, 2
RATE = 20.0
PHASES = np.repeat([0, 1, 2, 3, 4], [110, 20, 24, 14, 20]).astype(np.uint8)
TIME = np.arange(len(PHASES)) / RATE
MODEL = SensorModel(30_000.0, 2000.0, 1.5, 4.0, contact_stiffness_n_per_m=1500.0, layer="uncoupled")
CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0, 2)], float) * 0.02
FACES = np.array([[0, 2, 4], [2, 6, 4], [1, 5, 3], [3, 5, 7], [0, 1, 2], [1, 3, 2]], np.int32)
FACES = np.concatenate([FACES, [[4, 6, 5], [5, 6, 7], [0, 4, 1], [1, 4, 5], [2, 3, 6], [3, 7, 6]]]).astype(np.int32)


def make_taxel_table() -> TaxelTable:
    """Return the taxels of both boards, N rows with a pitch of 5 mm."""
    number = np.arange(N) % (ROWS * COLUMNS)
    tx, rx = number // COLUMNS, number % COLUMNS
    place = np.column_stack([-0.005 * tx, -0.005 * rx, np.zeros(N)])
    sensor = np.repeat([0x20, 0x21], ROWS * COLUMNS).astype(np.uint8)
    normal = np.tile([0.0, 0.0, 1.0], (N, 1))
    return TaxelTable(sensor, tx.astype(np.uint8), rx.astype(np.uint8), place, normal, np.full(N, 0.003))


@dataclass
class World:
    """Parameters of a hand with two boards and of its simulator.

    conditions: number of conditions at each force scale.
    sessions, repeats: their numbers in the real dataset; the simulated dataset has 1 session with 2 repeats.
    session_std: standard deviation between sessions of the logarithm of the force of each taxel.
    repeat_std: standard deviation between repeats of the logarithm of the force of all taxels.
    effect: function (force [T, n] in N, signal [T, n] in counts) -> signal [T, n] of the hand; None: no effect.
    raw_effect: function (raw counts [T, n], valid [T, 2], rng) -> raw counts and valid of the hand; None: no effect.
    largest_force_n: upper limit of the force of a taxel at a force scale of 1.
    force_scales: factors of the force; the conditions of the second factor follow those of the first.
    recorded_conditions: number of conditions that the real dataset contains; None: all.
    is_absent: function (session, condition) -> whether the real dataset lacks the grasps; None: no grasp is absent.
    noise_counts: standard deviation of the noise of the simulator; the noise of the hand is 4 counts.
    """

    seed: int = 1
    conditions: int = 6
    sessions: int = 5
    repeats: int = 2
    session_std: float = 0.03
    repeat_std: float = 0.03
    effect: object = None
    raw_effect: object = None
    objects: tuple[str, ...] = ("cube", "block")
    largest_force_n: float = np.inf
    force_scales: tuple[float, ...] = (1.0,)
    recorded_conditions: int | None = None
    is_absent: object = None
    noise_counts: float = 4.0
    mesh: ObjectMesh = field(default_factory=lambda: ObjectMesh(CUBE, FACES))

    def compute_force(self, condition: int, scale: np.ndarray | float = 1.0) -> np.ndarray:
        """Return the force in N, f64[T, n]: each condition loads another patch of one board and releases it."""
        condition, force_scale = condition % self.conditions, self.force_scales[condition // self.conditions]
        rng = np.random.default_rng([7, condition])
        board = condition % BOARDS
        centre = rng.uniform([0.0, 0.0], [ROWS - 1.0, COLUMNS - 1.0])
        number = np.arange(ROWS * COLUMNS)
        distance = np.hypot(number // COLUMNS - centre[0], number % COLUMNS - centre[1])
        patch = np.zeros(N)
        patch[board * ROWS * COLUMNS :][: ROWS * COLUMNS] = np.maximum(rng.uniform(1.2, 3.0) - distance, 0.0)
        patch = np.minimum(patch, self.largest_force_n) * force_scale
        closing = np.clip((TIME - 5.7) / 0.5, 0.0, 1.0)
        opening = np.clip((TIME - 7.7) / 0.4, 0.0, 1.0)
        return (closing - opening)[:, None] * patch * scale

    def write(self, folder) -> tuple[str, str]:
        """Write both datasets and return their paths, real and simulated."""
        real, sim = folder / "real.h5", folder / "sim.h5"
        self._write(real, "real")
        self._write(sim, "sim")
        return str(real), str(sim)

    def _write(self, path, source: str) -> None:
        """Write one dataset. source: "real" or "sim"."""
        sensors = SensorTable(np.array([0x20, 0x21], np.uint8), ("a", "b"), ("k", "k"), np.full(2, RATE))
        meshes = dict.fromkeys(self.objects, self.mesh)
        model = MODEL if source == "sim" else None
        with GraspDatasetWriter.create(
            path,
            DatasetHeader(
                source=source,
                hand="two boards",
                taxels=make_taxel_table(),
                sensors=sensors,
                objects=meshes,
                generator="a test",
                sensor_model=model,
            ),
        ) as out:
            for number, record in enumerate(self._grasps(source)):
                out.add(record, f"{number:04d}")

    def _grasps(self, source: str):
        """Yield the grasps of one dataset in order of time. source: "real" or "sim"."""
        rng = np.random.default_rng([self.seed, source == "sim"])
        sessions, repeats = (self.sessions, self.repeats) if source == "real" else (1, 2)
        conditions = self.conditions * len(self.force_scales)
        if source == "real" and self.recorded_conditions is not None:
            conditions = self.recorded_conditions
        for session in range(sessions):
            mounting = np.exp(rng.normal(0.0, self.session_std, N))
            for condition in range(conditions):
                if source == "real" and self.is_absent is not None and self.is_absent(session, condition):
                    continue
                for repeat in range(repeats):
                    scale = 1.0
                    if source == "real":
                        scale = mounting * np.exp(rng.normal(0.0, self.repeat_std))
                    yield self._grasp(source, condition, session, repeat, self.compute_force(condition, scale), rng)

    def _grasp(self, source, condition, session, repeat, force, rng) -> GraspRecord:
        """Return one grasp of a force f64[T, n] in N (T frames, n taxels). source: "real" or "sim"."""
        signal_counts = MODEL.predict_signal(force)
        if source == "real" and self.effect is not None:
            signal_counts = self.effect(force, signal_counts)
        raw = np.rint(
            30_000.0 - signal_counts + rng.normal(0.0, 4.0 if source == "real" else self.noise_counts, force.shape)
        )
        valid = np.ones((len(TIME), BOARDS), bool)
        if source == "real" and self.raw_effect is not None:
            raw, valid = self.raw_effect(raw, valid, rng)
        record = GraspRecord(
            object=self.objects[condition % len(self.objects)],
            approach=f"press_{condition}",
            iteration=repeat,
            session=session,
            timestamp=TIME + 100.0 * session,
            phase=PHASES,
            raw_counts=np.clip(raw, 0, 65_535).astype(np.uint16),
            valid=valid,
            sensor_pose=np.stack([np.eye(4), np.eye(4)]),
            object_pose=np.eye(4),
        )
        if source == "real":
            return record
        separation = np.where(force > 0, -force / 1500.0, 0.002)
        return replace(record, contact_force=force, separation=separation)


@pytest.fixture(scope="session")
def write_world():
    """Function `write_world(folder, **changes)` that writes both datasets of a world and returns their paths."""

    def write(folder, **changes) -> tuple[str, str]:
        return World(**changes).write(folder)

    return write


@pytest.fixture(scope="session")
def get_world_paths(write_world, tmp_path_factory):
    """Function `get_world_paths(**changes)` that writes each world once; a test must not change its files."""
    paths_of_worlds: dict[tuple, tuple[str, str]] = {}

    def get_paths(**changes) -> tuple[str, str]:
        key = tuple(sorted(changes.items(), key=lambda item: item[0]))
        if key not in paths_of_worlds:
            paths_of_worlds[key] = write_world(tmp_path_factory.mktemp("world"), **changes)
        return paths_of_worlds[key]

    return get_paths


@pytest.fixture(scope="session")
def fit_data(get_world_paths):
    """Prepared pair whose hand has a stiffer layer than the simulator."""
    return prepare_pair(read_pair(*get_world_paths(effect=stiffen)))


@pytest.fixture(scope="session")
def fitted(fit_data):
    """Fit of a stiffness to `fit_data`."""
    return fit_data.fit_in_sample(CompositeModel((start_effect(fit_data.state, Stiffness(HAND)),)))


@pytest.fixture(scope="session")
def get_report(get_world_paths):
    """Function `get_report(**changes)` that diagnoses each world once; a test must not change its report."""
    reports: dict[tuple[str, str], dict] = {}

    def get(**changes) -> dict:
        paths = get_world_paths(**changes)
        if paths not in reports:
            reports[paths] = diagnose(*paths).report
        return reports[paths]

    return get


@pytest.fixture(scope="module")
def state(write_world, tmp_path_factory):
    """State of the simulation of a world, with features of 0."""
    pair = read_pair(*write_world(tmp_path_factory.mktemp("state")))
    layout = FeatureLayout.from_time_grid(pair.time_grid)
    return build_state(pair, layout, np.zeros((len(pair.conditions), layout.count, pair.n)))
