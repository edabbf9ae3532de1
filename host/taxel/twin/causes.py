"""Naming of the cause: the contacts since a change, compared with the reference by the diagnosis of `taxel.gap`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Final

from taxel.gap.calibration.calibration import NO_GAP, UNKNOWN
from taxel.gap.diagnosis import diagnose
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_record import GraspRecord
from taxel.recording.grasp_writer import DatasetHeader, GraspDatasetWriter
from taxel.twin.contact_records import Poses
from taxel.twin.events import CauseEvent

ACTIONS: Final = {
    "contact_propagation": "Inspect the cover for stiffening or glue, and update the model.",
    "electrode_crosstalk": "Check ground and shield of the electrode lines, and update the model.",
    "noise": "Check supply, ground and shield of the boards.",
    "gain_mismatch": "Recalibrate the skin.",
    "stiffness": "Inspect the dielectric, and recalibrate the skin.",
    "nonlinearity": "Recalibrate the skin.",
    "baseline_drift": "Let the skin warm up, then take the baseline again.",
    "hysteresis": "Clean or replace the dielectric.",
    "saturation": "Lower the gain of the boards, or reduce the force.",
    "proximity": "Remove conductive objects near the skin, and update the model.",
    "dropout": "Check connectors and lines, and replace the board if they are intact.",
    "pose_error": "Mount the board or the object again, and calibrate its pose.",
    "latency": "Check bus load and firmware of the board.",
    UNKNOWN: "Record more contacts and inspect the place of the alarm.",
    NO_GAP: "No action is necessary.",
}
"""Recommended action by cause, one sentence."""

OTHER_ACTION: Final = "Inspect the place of the alarm."


@dataclass(frozen=True)
class ReferenceFile:
    """Path of the reference dataset, and nominal poses of brackets and object by condition."""

    path: Path
    poses: Poses

    @classmethod
    def read(cls, path: str | PathLike[str]) -> ReferenceFile:
        """Read the poses of each condition from its first contact. Raises DatasetError."""
        with GraspDataset(path) as data:
            poses = {}
            for grasp in data:
                key = (grasp.object, grasp.approach)
                if key not in poses:
                    poses[key] = (grasp.sensor_pose, grasp.object_pose)
            return cls(Path(path), poses)

    def write_contacts(self, path: Path, records: Sequence[GraspRecord]) -> None:
        """Write contacts of a stream as a dataset with the tables of the reference; an existing file is replaced."""
        with GraspDataset(self.path) as data:
            header = DatasetHeader("real", data.hand, data.taxels, data.sensors, dict(data.objects), "taxel twin")
        with GraspDatasetWriter.create(path, header, overwrite=True) as out:
            for record in records:
                out.add(record)


def name_cause(
    reference: ReferenceFile, live: Path, records: Sequence[GraspRecord], time_s: float, alarms: Sequence[int]
) -> CauseEvent:
    """Diagnose the contacts since a change against the reference; return the probabilities of the causes.

    live: path of the dataset that is written with the contacts; `taxel gap diagnose LIVE REFERENCE` gives the same
    probabilities. records: contacts since the change. time_s: time of the event. alarms: numbers of the active alarms.
    Raises TaxelError with a one-line message, for example for too few contacts.
    """
    reference.write_contacts(live, records)
    verdict = diagnose(live, reference.path).verdict
    effects = verdict.effects
    causes = effects or (NO_GAP,)
    action = ACTIONS.get(causes[0], OTHER_ACTION)
    return CauseEvent(
        time_s, len(records), dict(verdict.probabilities), effects, verdict.headline, action, tuple(alarms)
    )
