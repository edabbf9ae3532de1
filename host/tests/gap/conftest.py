"""Pairs of datasets of two flat boards, made by the format page alone: what the simulator lacks is put in by hand."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from taxel.gap.diagnosis import diagnose
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


def taxels() -> TaxelTable:
    number = np.arange(N) % (ROWS * COLUMNS)
    tx, rx = number // COLUMNS, number % COLUMNS
    place = np.column_stack([-0.005 * tx, -0.005 * rx, np.zeros(N)])
    sensor = np.repeat([0x20, 0x21], ROWS * COLUMNS).astype(np.uint8)
    normal = np.tile([0.0, 0.0, 1.0], (N, 1))
    return TaxelTable(sensor, tx.astype(np.uint8), rx.astype(np.uint8), place, normal, np.full(N, 0.003))


@dataclass
class World:
    """A hand and its simulator. Sizes are of what repeats and sessions scatter.

    most: newtons that no taxel exceeds. scales: every cell is pressed with its force times each of these; cells of the
    second one follow those of the first. recorded: cells that the hand has pressed; None: all.
    """

    seed: int = 1
    conditions: int = 6
    sessions: int = 5
    repeats: int = 2
    session_scatter: float = 0.03
    repeat_scatter: float = 0.03
    effect: object = None  # (force [T, n], drop of force) -> drop [T, n]
    after: object = None  # (raw [T, n], valid [T, s], rng) -> the same two
    objects: tuple[str, ...] = ("cube", "block")
    most: float = np.inf
    scales: tuple[float, ...] = (1.0,)
    recorded: int | None = None
    absent: object = None  # (session, cell) -> whether the hand has left it out
    noise: float = 4.0  # counts, of the simulator
    mesh: ObjectMesh = field(default_factory=lambda: ObjectMesh(CUBE, FACES))

    def force(self, condition: int, scale: np.ndarray | float = 1.0) -> np.ndarray:
        """Newtons over time, f64[T, n]: a patch that differs from cell to cell, pressed and let go."""
        condition, ladder = condition % self.conditions, self.scales[condition // self.conditions]
        rng = np.random.default_rng([7, condition])
        board = condition % BOARDS
        centre = rng.uniform([0.0, 0.0], [ROWS - 1.0, COLUMNS - 1.0])
        number = np.arange(ROWS * COLUMNS)
        apart = np.hypot(number // COLUMNS - centre[0], number % COLUMNS - centre[1])
        patch = np.zeros(N)
        patch[board * ROWS * COLUMNS :][: ROWS * COLUMNS] = np.maximum(rng.uniform(1.2, 3.0) - apart, 0.0)
        patch = np.minimum(patch, self.most) * ladder
        closing = np.clip((TIME - 5.7) / 0.5, 0.0, 1.0)
        opening = np.clip((TIME - 7.7) / 0.4, 0.0, 1.0)
        return (closing - opening)[:, None] * patch * scale

    def write(self, folder) -> tuple[str, str]:
        """Both files."""
        real, sim = folder / "real.h5", folder / "sim.h5"
        self._write(real, "real")
        self._write(sim, "sim")
        return str(real), str(sim)

    def _write(self, path, source: str) -> None:
        sensors = SensorTable(np.array([0x20, 0x21], np.uint8), ("a", "b"), ("k", "k"), np.full(2, RATE))
        meshes = dict.fromkeys(self.objects, self.mesh)
        model = MODEL if source == "sim" else None
        with GraspDatasetWriter.create(
            path,
            DatasetHeader(
                source=source,
                hand="two boards",
                taxels=taxels(),
                sensors=sensors,
                objects=meshes,
                generator="a test",
                sensor_model=model,
            ),
        ) as out:
            for number, record in enumerate(self._grasps(source)):
                out.add(record, f"{number:04d}")

    def _grasps(self, source: str):
        rng = np.random.default_rng([self.seed, source == "sim"])
        sessions, repeats = (self.sessions, self.repeats) if source == "real" else (1, 2)
        conditions = self.conditions * len(self.scales)
        if source == "real" and self.recorded is not None:
            conditions = self.recorded
        for session in range(sessions):
            mounting = np.exp(rng.normal(0.0, self.session_scatter, N))
            for condition in range(conditions):
                if source == "real" and self.absent is not None and self.absent(session, condition):
                    continue
                for repeat in range(repeats):
                    scale = 1.0
                    if source == "real":
                        scale = mounting * np.exp(rng.normal(0.0, self.repeat_scatter))
                    yield self._grasp(source, condition, session, repeat, self.force(condition, scale), rng)

    def _grasp(self, source, condition, session, repeat, force, rng) -> GraspRecord:
        signal_counts = MODEL.predict_signal(force)
        if source == "real" and self.effect is not None:
            signal_counts = self.effect(force, signal_counts)
        raw = np.rint(30_000.0 - signal_counts + rng.normal(0.0, 4.0 if source == "real" else self.noise, force.shape))
        valid = np.ones((len(TIME), BOARDS), bool)
        if source == "real" and self.after is not None:
            raw, valid = self.after(raw, valid, rng)
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
def world():
    """Makes a world and writes it: `world(folder, **changes)` gives both paths."""

    def make(folder, **changes) -> tuple[str, str]:
        return World(**changes).write(folder)

    return make


@pytest.fixture(scope="session")
def written(world, tmp_path_factory):
    """The same without a folder, `written(**changes)`: each world is made once, and its files are not to be changed."""
    known: dict[tuple, tuple[str, str]] = {}

    def once(**changes) -> tuple[str, str]:
        key = tuple(sorted(changes.items(), key=lambda item: item[0]))
        if key not in known:
            known[key] = world(tmp_path_factory.mktemp("world"), **changes)
        return known[key]

    return once


@pytest.fixture(scope="session")
def reported(written):
    """The report of a world's diagnosis, `reported(**changes)`: each is made once, and nobody changes it."""
    known: dict[tuple[str, str], dict] = {}

    def once(**changes) -> dict:
        paths = written(**changes)
        if paths not in known:
            known[paths] = diagnose(*paths).report
        return known[paths]

    return once
