"""Synthetic dataset pairs of flat plates in contact with convex objects, computed without code of the diagnosis.

The real layer has another stiffness than the simulated one, or the real plates have other poses. A taxel consists of
5 x 5 springs with forces proportional to their depth; a plate moves along its normal until the sum of these forces
equals the net force. The sensor model converts forces into counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from taxel.recording import (
    DatasetHeader,
    GraspDatasetWriter,
    GraspRecord,
    ObjectMesh,
    SensorModel,
    SensorTable,
    TaxelTable,
)

BOARDS, ROWS, COLUMNS, PITCH_M = 3, 7, 6, 5e-3
CROSSINGS = ROWS * COLUMNS
RATE = 20.0
PHASE = np.repeat([0, 1, 2, 3, 4], [110, 14, 16, 12, 20]).astype(np.uint8)
TIME = np.arange(len(PHASE)) / RATE
STIFFNESS_N_PER_M = 1800.0
MODEL = SensorModel(32_000.0, 2600.0, 1.4, 4.0, contact_stiffness_n_per_m=STIFFNESS_N_PER_M, layer="uncoupled")
SPRINGS_PER_AXIS = 5
"""Number of springs of a taxel along each axis; odd, so that one spring is in the centre of the taxel."""

FORCE_LEVELS = np.linspace(0.0, 1.2, 9)
"""Net forces, relative to the net force of a contact, at which forces are solved; linear interpolation between them."""


def make_hull(points: np.ndarray) -> ObjectMesh:
    """Return the convex hull of points f64[k, 3] in metres, with outward faces."""
    faces = ConvexHull(points).simplices.astype(np.int32)
    a, b, c = (points[faces[:, k]] for k in range(3))
    inwards = np.einsum("fi,fi->f", np.cross(b - a, c - a), a - points.mean(axis=0)) < 0
    faces[inwards] = faces[inwards][:, ::-1]
    return ObjectMesh(points, faces)


def make_ball(radius: float) -> ObjectMesh:
    """Return a ball with 160 vertices, radius in metres."""
    number = np.arange(160) + 0.5
    height, turn = 1.0 - number / 80.0, np.pi * (1.0 + 5.0**0.5) * number
    wide = np.sqrt(1.0 - height**2)
    return make_hull(radius * np.column_stack([wide * np.cos(turn), wide * np.sin(turn), height]))


def make_brick(*size: float) -> ObjectMesh:
    """Return a box with three edge lengths in metres."""
    corners = np.stack(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5]), axis=-1).reshape(-1, 3)
    return make_hull(corners * size)


OBJECTS = {"ball": make_ball(0.018), "brick": make_brick(0.03, 0.022, 0.03)}


@dataclass(frozen=True)
class Plates:
    """Parameters of a hand with three plates and of its simulator.

    stiffness_scale: stiffness of the real layer divided by the stiffness of the simulated layer.
    displacements: displacement of each real plate in its own frame, f64[3, 6]: translation in metres and rotation
        vector in radians.
    approaches: number of approaches of each object.
    """

    seed: int
    stiffness_scale: float = 1.0
    displacements: tuple[tuple[float, ...], ...] = ((0.0,) * 6,) * BOARDS
    approaches: int = 4
    sessions: int = 4
    repeats: int = 2

    def write(self, folder: Path) -> tuple[str, str]:
        """Write both datasets and return their paths, real and simulated."""
        paths = tuple(str(folder / f"{source}.h5") for source in ("real", "sim"))
        for path, source in zip(paths, ("real", "sim"), strict=True):
            self._write(path, source)
        return paths[0], paths[1]

    def _write(self, path: str, source: str) -> None:
        """Write one dataset. source: "real" or "sim"."""
        crossing = np.tile(np.arange(CROSSINGS), BOARDS)
        table = TaxelTable(
            np.repeat(np.arange(0x20, 0x20 + BOARDS), CROSSINGS).astype(np.uint8),
            (crossing // COLUMNS).astype(np.uint8),
            (crossing % COLUMNS).astype(np.uint8),
            np.tile(list_centres(), (BOARDS, 1)),
            np.tile([0.0, 0.0, 1.0], (len(crossing), 1)),
            np.full(len(crossing), 0.003),
        )
        sensors = SensorTable(
            np.arange(0x20, 0x20 + BOARDS).astype(np.uint8), ("a", "b", "c"), ("plate",) * BOARDS, np.full(BOARDS, RATE)
        )
        with GraspDatasetWriter.create(
            path,
            DatasetHeader(
                source=source,
                hand="three plates",
                taxels=table,
                sensors=sensors,
                objects=OBJECTS,
                generator="a test",
                sensor_model=MODEL if source == "sim" else None,
            ),
        ) as out:
            for number, record in enumerate(self._grasps(source == "real")):
                out.add(record, f"{number:04d}")

    def _grasps(self, real: bool):
        """Yield the grasps of one dataset in order of time.

        real: whether the plates have the real stiffness and displacements, and sessions and repeats vary.
        """
        plan = np.random.default_rng(self.seed)
        conditions = []
        for name in OBJECTS:
            for way in range(self.approaches):
                turn = Rotation.from_rotvec(plan.normal(0.0, [0.15, 0.15, 1.5], (BOARDS, 3))).as_matrix()
                place = np.column_stack([plan.uniform(-0.008, 0.008, (BOARDS, 2)), np.full(BOARDS, 0.02)])
                conditions.append((name, f"way_{way}", make_poses(turn, place), plan.uniform(3.0, 14.0, BOARDS)))
        rng = np.random.default_rng([self.seed, real])
        fixed = np.array(self.displacements) if real else np.zeros((BOARDS, 6))
        stiffness_scale = self.stiffness_scale if real else 1.0
        for session in range(self.sessions if real else 1):
            mounting = rng.normal(0.0, [2e-4, 2e-4, 0.0, 2e-3, 2e-3, 2e-3], (BOARDS, 6)) * real
            for name, way, nominal_pose, net in conditions:
                for repeat in range(self.repeats):
                    slip = rng.normal(0.0, [1e-4, 1e-4, 0.0, 1e-3, 1e-3, 1e-3], (BOARDS, 6)) * real
                    # In the frame of the plate, the object moves in the opposite direction.
                    object_at = np.linalg.inv(make_motions(fixed)) @ make_motions(mounting + slip) @ nominal_pose
                    force_scale = float(np.exp(rng.normal(0.0, 0.02 * real)))
                    force, separation = self._compute_forces(
                        name, object_at, net, self.stiffness_scale if real else 1.0, force_scale
                    )
                    half = MODEL.half_force_n * stiffness_scale
                    signal_counts = MODEL.full_scale_drop_counts * force / (force + half)
                    raw = 32_000.0 - signal_counts + rng.normal(0.0, 5.0, signal_counts.shape)
                    yield GraspRecord(
                        object=name,
                        approach=way,
                        iteration=repeat,
                        session=session,
                        timestamp=TIME + 100.0 * session,
                        phase=PHASE,
                        raw_counts=np.clip(np.rint(raw), 0, 65_535).astype(np.uint16),
                        valid=np.ones((len(TIME), BOARDS), bool),
                        sensor_pose=np.linalg.inv(nominal_pose),
                        object_pose=np.eye(4),
                        contact_force=None if real else force,
                        separation=None if real else separation,
                    )

    def _compute_forces(self, name: str, object_at: np.ndarray, net: np.ndarray, scale: float, force_scale: float):
        """Return the force in N and the separation in metres over time, f64[T, n] each (T frames, n taxels).

        object_at: pose of the object in the frame of each plate, f64[3, 4, 4]. net: net force of each plate in N.
        scale: factor on the stiffness of the simulated layer. force_scale: factor on the net forces.
        """
        closing = np.clip((TIME - 5.5) / 0.6, 0.0, 1.0) - np.clip((TIME - 7.0) / 0.5, 0.0, 1.0)
        level = np.clip(force_scale * np.clip(closing, 0.0, 1.0), 0.0, FORCE_LEVELS[-1])
        force, separation = [], []
        for board in range(BOARDS):
            above = compute_heights(OBJECTS[name], object_at[board])
            rows = [solve_contact(above, share * net[board], scale * STIFFNESS_N_PER_M) for share in FORCE_LEVELS]
            level_values = np.stack([row[0] for row in rows]), np.stack([row[1] for row in rows])
            for results, values in zip((force, separation), level_values, strict=True):
                results.append(
                    np.stack([np.interp(level, FORCE_LEVELS, values[:, k]) for k in range(CROSSINGS)], axis=1)
                )
        return np.concatenate(force, axis=1), np.concatenate(separation, axis=1)


def list_centres() -> np.ndarray:
    """Return the centres of the taxels of a plate in metres, f64[42, 3]."""
    number = np.arange(CROSSINGS)
    x, y = number // COLUMNS - (ROWS - 1) / 2, number % COLUMNS - (COLUMNS - 1) / 2
    return PITCH_M * np.column_stack([x, y, np.zeros(CROSSINGS)])


def make_poses(turn: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return poses f64[m, 4, 4] of m plates from rotations f64[m, 3, 3] and translations f64[m, 3] in metres."""
    out = np.tile(np.eye(4), (len(turn), 1, 1))
    out[:, :3, :3], out[:, :3, 3] = turn, place
    return out


def make_motions(step: np.ndarray) -> np.ndarray:
    """Return poses f64[m, 4, 4] of m plates from translations in metres and rotation vectors in radians, f64[m, 6]."""
    return make_poses(Rotation.from_rotvec(step[:, 3:]).as_matrix(), step[:, :3])


def compute_heights(mesh: ObjectMesh, object_at: np.ndarray) -> np.ndarray:
    """Return the height of the object above each spring in metres, f64[42, 25]; 1 where no object is above it."""
    within = PITCH_M * ((np.arange(SPRINGS_PER_AXIS) + 0.5) / SPRINGS_PER_AXIS - 0.5)
    x, y = np.meshgrid(within, within)
    springs = (list_centres()[:, None, :2] + np.stack([x.ravel(), y.ravel()], axis=1)).reshape(-1, 2)
    planes = ConvexHull(mesh.vertices @ object_at[:3, :3].T + object_at[:3, 3]).equations
    level, slope = springs @ planes[:, :2].T + planes[:, 3], planes[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = -level / slope
    low = np.where(slope < 0, crossing, -np.inf).max(axis=1)
    high = np.where(slope > 0, crossing, np.inf).min(axis=1)
    return np.where(low < high, low, 1.0).reshape(CROSSINGS, -1)


def solve_contact(above: np.ndarray, net: float, stiffness: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the forces of the 42 taxels in N and the separation of their centres in metres, f64[42] each.

    above: heights of `compute_heights`, f64[42, 25] in metres. net: net force in N. stiffness: stiffness of a taxel in
    N/m.
    """
    lowest, centre = float(above.min()), above[:, SPRINGS_PER_AXIS**2 // 2]
    low, high = lowest, lowest + 0.02
    if net <= 0.0:
        return np.zeros(CROSSINGS), np.minimum(centre - lowest + 0.003, 0.05)
    for _ in range(50):
        middle = 0.5 * (low + high)
        force = stiffness * np.maximum(middle - above, 0.0).mean(axis=1).sum()
        low, high = (middle, high) if force < net else (low, middle)
    return stiffness * np.maximum(high - above, 0.0).mean(axis=1), np.minimum(centre - high, 0.05)
