"""Grasp datasets of measured touches: the panel as one board, the finger as a box, one grasp for each repeat."""

from pathlib import Path
from typing import Final

import numpy as np

from taxel.blind.measured_touches import N_TAXELS, ROW_OF_TAXEL, Repeat
from taxel.recording import (
    DatasetHeader,
    GraspDatasetWriter,
    GraspRecord,
    ObjectMesh,
    SensorTable,
    TaxelTable,
)
from taxel.recording.capfingerid import COLUMNS
from taxel.types import FloatArray

PITCH_M: Final = 0.0041
"""Pitch of the panel: a Nexus 5 has 15 x 27 electrodes of 4.1 mm (H. V. Le, huyle.de/blog/capacitive-images)."""

ADDRESS: Final = 0x20
REST_RAW_COUNTS: Final = 30_000.0
"""Assumed raw count without contact; the recordings contain counts above an unknown baseline."""

FINGER_M: Final = 0.008
"""Edge length of the box that represents the finger."""


def build_panel() -> tuple[TaxelTable, SensorTable]:
    """Build the tables of the touch panel: one sensor board of 27 x 15 taxels with 14 frames per second."""
    row, column = ROW_OF_TAXEL, np.arange(N_TAXELS) % COLUMNS
    position = np.column_stack([-PITCH_M * row, -PITCH_M * column, np.zeros(N_TAXELS)])
    taxels = TaxelTable(
        np.full(N_TAXELS, ADDRESS, np.uint8),
        row.astype(np.uint8),
        column.astype(np.uint8),
        position,
        np.tile([0.0, 0.0, 1.0], (N_TAXELS, 1)),
        np.full(N_TAXELS, PITCH_M),
    )
    return taxels, SensorTable(np.array([ADDRESS], np.uint8), ("panel",), ("panel",), np.array([14.0]))


def build_finger() -> ObjectMesh:
    """Build the mesh of a box in place of the finger, whose shape is unknown and not used."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)]) * FINGER_M
    faces = [[0, 2, 4], [2, 6, 4], [1, 5, 3], [3, 5, 7], [0, 1, 2], [1, 3, 2]]
    faces += [[4, 6, 5], [5, 6, 7], [0, 4, 1], [1, 4, 5], [2, 3, 6], [3, 7, 6]]
    return ObjectMesh(corners, np.array(faces, np.int32))


def write_dataset(path: Path, repeats: list[Repeat], version: str) -> None:
    """Write repeats of touches as a grasp dataset. version: name of the counts in `Frames`, such as "measured"."""
    taxels, sensors = build_panel()
    objects = {repeat.touch.frames.name: build_finger() for repeat in repeats}
    with GraspDatasetWriter.create(
        path,
        DatasetHeader(
            source="real",
            hand="touch panel",
            taxels=taxels,
            sensors=sensors,
            objects=objects,
            generator=f"tools/gap/capfingerid.py, {version}",
        ),
        overwrite=True,
    ) as out:
        for number, repeat in enumerate(repeats):
            counts: FloatArray = getattr(repeat.touch.frames, version)[repeat.frames]
            record = GraspRecord(
                object=repeat.touch.frames.name,
                approach=f"touch_{repeat.touch.number:03d}_row_{repeat.touch.row:02d}",
                iteration=0,
                session=repeat.number,
                timestamp=repeat.time_s,
                phase=repeat.phase,
                raw_counts=np.rint(REST_RAW_COUNTS - counts).astype(np.uint16),
                valid=np.ones((len(repeat.frames), 1), bool),
                sensor_pose=np.eye(4)[None],
                object_pose=np.eye(4),
            )
            out.add(record, f"{number:05d}")
