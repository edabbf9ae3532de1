"""Nominal poses of brackets and object at a time of the stream."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from taxel.hand.joint_history import JointHistory
from taxel.hand.kinematics import Kinematics
from taxel.recording.grasp_dataset import GraspDataset
from taxel.twin.contact_records import Poses
from taxel.twin.schedule import Contact
from taxel.twin.simulated.contact_fit import ContactPoses
from taxel.twin.simulated.object_history import ObjectHistory
from taxel.twin.sources import DatasetSource
from taxel.types import FloatArray


class PoseSource(Protocol):
    """Source of nominal poses."""

    def find(self, contact: Contact, time_s: float) -> ContactPoses | None:
        """Return the poses at a time of the stream, seconds, during a contact; None if they are unknown."""
        ...


@dataclass(frozen=True, eq=False)
class ConstantPoses:
    """The same nominal poses at all times."""

    poses: ContactPoses | None

    def find(self, contact: Contact, time_s: float) -> ContactPoses | None:
        """Return the poses."""
        return self.poses


@dataclass(frozen=True, eq=False)
class DatasetPoses:
    """Poses of the grasps of a dataset, by contact."""

    poses: Mapping[Contact, ContactPoses]

    @classmethod
    def read(cls, source: DatasetSource) -> DatasetPoses:
        """Read the poses of the contacts of a source. Raises DatasetError."""
        with GraspDataset(source.path) as data:
            return cls(
                {
                    contact: ContactPoses(grasp.sensor_pose, grasp.object_pose)
                    for contact, grasp in zip(source.schedule, data, strict=True)
                }
            )

    def find(self, contact: Contact, time_s: float) -> ContactPoses | None:
        """Return the poses of the grasp of a contact, which are those of its hold phase; None for another contact."""
        return self.poses.get(contact)


@dataclass(frozen=True, eq=False)
class MeasuredPoses:
    """Poses from measured joint angles and a measured object, and otherwise the nominal poses of the condition.

    joints: angles over time, or constant, f64[j], radians; None: not measured. objects: None: not measured. nominal:
    poses by condition, from the reference.
    """

    kinematics: Kinematics | None
    joints: JointHistory | FloatArray | None
    objects: ObjectHistory | None
    nominal: Poses

    def find(self, contact: Contact, time_s: float) -> ContactPoses | None:
        """Return the poses at a time of the stream, seconds, during a contact.

        None if neither a measurement nor the reference contains the brackets or the object. Raises NoJointAnglesError
        for a source of joint angles without any sample.
        """
        sensor, item = self.nominal.get(contact.condition, (None, None))
        if self.joints is not None and self.kinematics is not None:
            sensor = self.kinematics.compute_sensor_poses(self._find_angles(self.joints, time_s))
        measured = self.objects.find(time_s) if self.objects is not None else None
        item = item if measured is None else measured
        return None if sensor is None or item is None else ContactPoses(sensor, item)

    @staticmethod
    def _find_angles(joints: JointHistory | FloatArray, time_s: float) -> FloatArray:
        """Return the joint angles at a time, f64[j], radians.

        For a live source that has become silent, `JointHistory.select_time` reports the silence.
        """
        if not isinstance(joints, JointHistory):
            return joints
        joints.select_time(time_s)
        return joints()
