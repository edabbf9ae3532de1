"""Small campaigns of the three objects of the thesis: one board in contact with the surface of the object."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.cloud.models import get_builtin_models
from taxel.recording import (
    DatasetHeader,
    GraspDatasetWriter,
    GraspRecord,
    ObjectMesh,
    SensorModel,
    SensorTable,
    TaxelTable,
)

SIDE = 8
TAXELS = SIDE * SIDE
PHASES = np.repeat([0, 1, 2, 3], [10, 2, 4, 2]).astype(np.uint8)
REST_COUNTS = 30_000
OBJECTS = ("cylinder", "rectangular_prism", "triangular_prism")
MODEL = SensorModel(30_000.0, 2000.0, 1.5, 4.0, layer="uncoupled")


def build_board() -> TaxelTable:
    """Make the table of a flat board of 8 x 8 taxels at a 5 mm pitch."""
    number = np.arange(TAXELS)
    tx, rx = number // SIDE, number % SIDE
    position = np.column_stack([0.005 * (tx - 3.5), 0.005 * (rx - 3.5), np.zeros(TAXELS)])
    normal = np.tile([0.0, 0.0, 1.0], (TAXELS, 1))
    return TaxelTable(
        np.full(TAXELS, 0x20, np.uint8),
        tx.astype(np.uint8),
        rx.astype(np.uint8),
        position,
        normal,
        np.full(TAXELS, 0.003),
    )


def sample_surface_pose(mesh, rng) -> np.ndarray:
    """Sample a pose of the board, f64[4, 4], at a random point of the surface, with its normal into the object."""
    face = rng.choice(len(mesh.faces), p=mesh.areas / mesh.areas.sum())
    corners, normal = mesh.vertices[mesh.faces[face]], mesh.normals[face]
    pose = np.eye(4)
    across = np.cross(normal, [0.3, 0.5, 0.8])
    across /= np.linalg.norm(across)
    pose[:3, :3] = np.column_stack([across, np.cross(-normal, across), -normal])
    pose[:3, 3] = rng.dirichlet(np.ones(3)) @ corners
    return pose


def write_campaign(path, source: str, contact_width: float, noise_m: float, grasps: int = 6):
    """Write a dataset of `grasps` grasps of each of the three objects; return its path.

    source: "real" or "sim". contact_width: width of the contact's signal (standard deviation of a normal curve), in
    taxels. noise_m: standard deviation of the board's position in each grasp.
    """
    sensors = SensorTable(np.array([0x20], np.uint8), ("palm",), ("palm",), np.full(1, 6.0))
    shapes = get_builtin_models()
    meshes = {name: ObjectMesh(shapes[name].vertices, shapes[name].faces.astype(np.int32)) for name in OBJECTS}
    with GraspDatasetWriter.create(
        path,
        DatasetHeader(
            source=source,
            hand="one board",
            taxels=build_board(),
            sensors=sensors,
            objects=meshes,
            generator="a test",
            sensor_model=MODEL if source == "sim" else None,
        ),
    ) as out:
        for number in range(grasps * len(OBJECTS)):
            name = OBJECTS[number % len(OBJECTS)]
            pose_rng, noise_rng = (
                np.random.default_rng([3, number]),
                np.random.default_rng([4, number, source == "sim"]),
            )
            pose = sample_surface_pose(shapes[name], pose_rng)
            pose[:3, 3] += noise_rng.normal(0.0, noise_m, 3)
            distance = np.linalg.norm(build_board().position, axis=1) / 0.005
            signal = np.rint(600.0 * np.exp(-0.5 * (distance / contact_width) ** 2)).astype(np.uint16)
            raw = np.full((len(PHASES), TAXELS), REST_COUNTS, np.uint16)
            raw[PHASES == 2] -= signal
            record = GraspRecord(
                object=name,
                approach=f"side_{number % 2}",
                iteration=number,
                session=number % 3,
                timestamp=np.arange(len(PHASES)) / 6.0 + 10.0 * number,
                phase=PHASES,
                raw_counts=raw,
                valid=np.ones((len(PHASES), 1), bool),
                sensor_pose=pose[None],
                object_pose=np.eye(4),
            )
            if source == "sim":
                force = MODEL.half_force_n * signal / (MODEL.full_scale_drop_counts - signal)
                hold_force = np.where(PHASES[:, None] == 2, force, 0.0)
                record = replace(record, contact_force=hold_force, separation=np.where(hold_force > 0, -0.001, 0.05))
            out.add(record, f"{number:04d}")
    return path


@pytest.fixture(scope="session")
def campaign(tmp_path_factory):
    """Paths of a real and of a simulated dataset; the real contacts are wider and displaced."""
    folder = tmp_path_factory.mktemp("campaign")
    return write_campaign(folder / "real.h5", "real", 2.0, 0.0015), write_campaign(folder / "sim.h5", "sim", 1.2, 0.0)
