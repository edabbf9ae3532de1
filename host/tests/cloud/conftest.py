"""Clouds on known shapes, and small grasp datasets of four boards."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.models import get_builtin_models
from taxel.hand.transforms import make_pose
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
BOARD = ROWS * COLUMNS
NAMES = ("palm", "fingertip_index", "fingertip_middle", "back")
KINDS = ("palm", "fingertip", "fingertip", "hand_back")
PHASES = np.repeat([0, 1, 2, 3], [10, 2, 4, 2]).astype(np.uint8)
REST_COUNTS = 30_000
OBJECT_POSE = make_pose([0.4, -0.1, 0.2], [0.6, 0.0, 0.8, 0.0])


def build_taxel_table() -> TaxelTable:
    """Make the table of four boards of 6 x 5 taxels at a 5 mm pitch; the thesis does not use the last two boards."""
    number = np.arange(4 * BOARD) % BOARD
    tx, rx = number // COLUMNS, number % COLUMNS
    return TaxelTable(
        np.repeat(np.arange(0x20, 0x24), BOARD).astype(np.uint8),
        tx.astype(np.uint8),
        rx.astype(np.uint8),
        np.column_stack([0.005 * tx, 0.005 * rx, np.zeros(4 * BOARD)]),
        np.tile([0.0, 0.0, 1.0], (4 * BOARD, 1)),
        np.full(4 * BOARD, 0.003),
    )


@dataclass(frozen=True)
class PlannedGrasp:
    """A grasp to write to a dataset.

    signals: numbers of taxels and their signals in counts; the others have the signal 0. missing_boards: numbers of
    boards without valid frames. has_baseline: whether the frames of the baseline phase are valid.
    """

    object_name: str = "cylinder"
    approach: str = "side_1"
    iteration: int = 0
    signals: tuple[tuple[int, int], ...] = ()
    missing_boards: tuple[int, ...] = ()
    has_baseline: bool = True


def write_dataset(path, grasps, source="real"):
    """Write a dataset of planned grasps; board b lies at x = 0.1 m * b in the frame of the object. Return its path."""
    sensors = SensorTable(np.arange(0x20, 0x24).astype(np.uint8), NAMES, KINDS, np.full(4, 6.0))
    meshes = {
        name: ObjectMesh(mesh.vertices, mesh.faces.astype(np.int32)) for name, mesh in get_builtin_models().items()
    }
    brackets = np.tile(np.eye(4), (4, 1, 1))
    brackets[:, 0, 3] = 0.1 * np.arange(4)
    model = SensorModel(30_000.0, 2000.0, 1.5, 4.0, layer="uncoupled") if source == "sim" else None
    with GraspDatasetWriter.create(
        path,
        DatasetHeader(
            source=source,
            hand="four boards",
            taxels=build_taxel_table(),
            sensors=sensors,
            objects={name: meshes[name] for name in ("cylinder", "rectangular_prism")},
            generator="a test",
            sensor_model=model,
        ),
    ) as out:
        for number, grasp in enumerate(grasps):
            raw = np.full((len(PHASES), 4 * BOARD), REST_COUNTS, np.uint16)
            for taxel, signal in grasp.signals:
                raw[PHASES == 2, taxel] -= signal
            valid = np.ones((len(PHASES), 4), bool)
            valid[:, list(grasp.missing_boards)] = False
            if not grasp.has_baseline:
                valid[PHASES == 0] = False
            record = GraspRecord(
                object=grasp.object_name,
                approach=grasp.approach,
                iteration=grasp.iteration,
                session=0,
                timestamp=np.arange(len(PHASES)) / 6.0 + 10.0 * number,
                phase=PHASES,
                raw_counts=raw,
                valid=valid,
                sensor_pose=OBJECT_POSE @ brackets,
                object_pose=OBJECT_POSE,
            )
            if source == "sim":
                shape = raw.shape
                record = replace(record, contact_force=np.zeros(shape), separation=np.full(shape, 0.05))
            out.add(record, f"{number:04d}")
    return path


@pytest.fixture
def dataset(tmp_path):
    """Return a function that writes grasps, given by the fields of `PlannedGrasp`, to a file and returns its path."""

    def write(*grasps, source="real"):
        return write_dataset(tmp_path / f"{source}.h5", [PlannedGrasp(**grasp) for grasp in grasps], source)

    return write


@pytest.fixture(scope="session")
def surface_cloud():
    """Return the function `build_surface_cloud`, which builds clouds on built-in shapes."""
    return build_surface_cloud


def build_surface_cloud(
    name: str, count: int = 400, noise_m: float = 0.0005, seed: int = 1, grasps: int = 8
) -> ContactCloud:
    """Build a cloud of random points on a built-in shape, with noise, assigned to random grasps of two approaches.

    noise_m: standard deviation of each coordinate. grasps: number of grasps. The cloud has no inactive points.
    """
    mesh = get_builtin_models()[name]
    rng = np.random.default_rng([seed, len(name)])
    points = mesh.sample(count, seed) + rng.normal(0.0, noise_m, (count, 3))
    cloud = ContactCloud.from_points(points, rng.uniform(150.0, 400.0, count), name)
    approach = np.arange(grasps) % 2
    return replace(
        cloud,
        grasp=rng.integers(0, grasps, count),
        taxel=rng.integers(0, 50, count),
        grasps=tuple(f"{row:04d}" for row in range(grasps)),
        grasp_approach=approach,
        approaches=("side 1", "top"),
    )
