"""Clouds on known shapes, and small datasets of two boards, written by the format page alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.models import models
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
REST = 30_000
OBJECT_POSE = make_pose([0.4, -0.1, 0.2], [0.6, 0.0, 0.8, 0.0])


def sheet() -> TaxelTable:
    """Four boards of 6 x 5 taxels, 5 mm apart; the last two do not count in the thesis."""
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
class Press:
    """A grasp to be written: taxels with their signals in counts, and boards without frames."""

    item: str = "cylinder"
    approach: str = "side_1"
    iteration: int = 0
    signals: tuple[tuple[int, int], ...] = ()
    silent: tuple[int, ...] = ()
    baseline: bool = True


def write_dataset(path, presses, source="real"):
    """A dataset whose boards lie at x = 0.1 * board in the object's frame."""
    sensors = SensorTable(np.arange(0x20, 0x24).astype(np.uint8), NAMES, KINDS, np.full(4, 6.0))
    meshes = {name: ObjectMesh(mesh.vertices, mesh.faces.astype(np.int32)) for name, mesh in models().items()}
    brackets = np.tile(np.eye(4), (4, 1, 1))
    brackets[:, 0, 3] = 0.1 * np.arange(4)
    model = SensorModel(30_000.0, 2000.0, 1.5, 4.0, layer="uncoupled") if source == "sim" else None
    with GraspDatasetWriter.create(
        path,
        DatasetHeader(
            source=source,
            hand="four boards",
            taxels=sheet(),
            sensors=sensors,
            objects={name: meshes[name] for name in ("cylinder", "rectangular_prism")},
            generator="a test",
            sensor_model=model,
        ),
    ) as out:
        for number, press in enumerate(presses):
            raw = np.full((len(PHASES), 4 * BOARD), REST, np.uint16)
            for taxel, signal in press.signals:
                raw[PHASES == 2, taxel] -= signal
            valid = np.ones((len(PHASES), 4), bool)
            valid[:, list(press.silent)] = False
            if not press.baseline:
                valid[PHASES == 0] = False
            record = GraspRecord(
                object=press.item,
                approach=press.approach,
                iteration=press.iteration,
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
    """Writes presses, of the fields of `Press`, to a file."""

    def write(*presses, source="real"):
        return write_dataset(tmp_path / f"{source}.h5", [Press(**press) for press in presses], source)

    return write


@pytest.fixture(scope="session")
def surface_cloud():
    """Makes clouds on built-in shapes, see `_surface_cloud`."""
    return _surface_cloud


def _surface_cloud(
    name: str, count: int = 400, noise_m: float = 0.0005, seed: int = 1, grasps: int = 8
) -> ContactCloud:
    """Points on a built-in shape with scatter, dealt out to grasps of two approaches."""
    mesh = models()[name]
    rng = np.random.default_rng([seed, len(name)])
    points = mesh.sample(count, seed) + rng.normal(0.0, noise_m, (count, 3))
    cloud = ContactCloud.of_points(points, rng.uniform(150.0, 400.0, count), name)
    approach = np.arange(grasps) % 2
    return replace(
        cloud,
        grasp=rng.integers(0, grasps, count),
        taxel=rng.integers(0, 50, count),
        grasps=tuple(f"{row:04d}" for row in range(grasps)),
        grasp_approach=approach,
        approaches=("side 1", "top"),
    )
