"""Simulator mode of `taxel twin`: the simulated reference, and the poses of brackets and object during the stream."""

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from taxel.cli.joint_sources import choose_url_joints, open_live_joints
from taxel.cli.options import parse_joint_angles
from taxel.errors import TaxelError
from taxel.hand import Hand, load_hand
from taxel.hand.joint_history import JointHistory
from taxel.hand.kinematics import build_kinematics
from taxel.link.url import get_recorded_path
from taxel.types import FloatArray

if TYPE_CHECKING:
    from taxel.twin.reference import Reference
    from taxel.twin.session import TwinSession
    from taxel.twin.simulated.object_history import ObjectHistory
    from taxel.twin.simulated.poses import PoseSource
    from taxel.twin.simulated.reference import SimulatedReference
    from taxel.twin.sources import Source


@dataclass(frozen=True)
class PoseOptions:
    """Values of the options that describe poses.

    angles, joint_file, joint_topic, hand_can: sources of the joint angles, as in `joint_sources`. object_file,
    object_topic: sources of the object's pose.
    """

    angles: str | None = None
    joint_file: Path | None = None
    joint_topic: str | None = None
    hand_can: str | None = None
    object_file: Path | None = None
    object_topic: str | None = None

    def require_simulation(self, is_simulated: bool) -> None:
        """Raise TaxelError if a source of poses is given without the simulator mode, or two sources of the object."""
        if not is_simulated and self != PoseOptions():
            raise TaxelError("sources of joint angles and object poses need the simulator mode; add --simulate")
        if self.object_file is not None and self.object_topic is not None:
            raise TaxelError("--object-poses and --object-topic: expected at most one source; remove one")


class SimulatorMode:
    """The simulator as the reference of a session.

    reference: the reference, whose contacts the simulator predicts.
    """

    def __init__(
        self, path: Path, known: "Reference", url: str, source: "Source", hand: str | None, options: PoseOptions
    ) -> None:
        """Prepare the simulator, which predicts contacts in place of the mean of the reference's repeats.

        path: dataset of the reference. known: reference that was learnt from this dataset. url, source: the stream to
        compare. hand: value of --hand. options: sources of joint angles and object poses. Raises TaxelError.
        """
        from taxel.twin.simulated.set_up import simulate_reference
        from taxel.twin.sources import SkinSource

        self._path, self._url, self._source, self._options = path, url, source, options
        self._hand_option = hand
        self._hand: Hand = source.skin.hand if isinstance(source, SkinSource) else _load_hand(path, hand)
        self.reference: SimulatedReference = simulate_reference(path, known, self._hand)

    def start(self, session: "TwinSession", stack: ExitStack) -> None:
        """Open the poses of the stream until the stack is closed; faults of the poses become events of the session."""
        predictions = self.reference.predictions
        predictions.poses = self._open_poses(session, stack)
        predictions.on_fault = lambda text: session.report_fault("pose", text)

    def _open_poses(self, session: "TwinSession", stack: ExitStack) -> "PoseSource":
        """Open the source of the poses during the stream.

        A dataset contains its own poses. For a skin, the poses are measured; the reference gives the poses that are not
        measured. Raises TaxelError if the stream is a dataset and the options also name a source of poses.
        """
        from taxel.twin.causes import ReferenceFile
        from taxel.twin.simulated.poses import DatasetPoses, MeasuredPoses
        from taxel.twin.sources import DatasetSource, SkinSource

        if isinstance(self._source, DatasetSource):
            if self._options != PoseOptions():
                raise TaxelError(f"{self._url}: a dataset has its own poses; leave out the sources of poses")
            return DatasetPoses.read(self._source)
        assert isinstance(self._source, SkinSource)
        joints = self._open_joints(stack)
        objects = self._open_objects(stack)
        # Live samples have host times: they fit frames only if the frames have host times too.
        if objects is not None:
            objects.uses_stream_time = self._options.object_topic is None or self._source.is_live
        if isinstance(joints, JointHistory):
            joints.uses_stream_time = not joints.is_live or self._source.is_live
            joints.on_silence = lambda text: session.report_fault("joints", text)
        kinematics = build_kinematics(self._hand) if joints is not None else None
        return MeasuredPoses(kinematics, joints, objects, ReferenceFile.read(self._path).poses)

    def _open_joints(self, stack: ExitStack) -> FloatArray | JointHistory | None:
        """Return the joint angles from the recording, from an option or from a live source.

        The angles are constant, f64[j], radians, or measured over time; None: not known. A live source is closed with
        the stack. Raises TaxelError for a live source together with a recording or a joint file.
        """
        options = self._options
        if get_recorded_path(self._url) is not None or options.joint_file is not None:
            if options.joint_topic is not None or options.hand_can is not None:
                raise TaxelError("--joint-topic and --hand-can need a live skin; use --joint-file for a recording")
            from taxel.twin.sources import SkinSource

            assert isinstance(self._source, SkinSource)
            return choose_url_joints(self._url, self._source.skin, options.angles, options.joint_file)
        angles = parse_joint_angles(options.angles)
        return stack.enter_context(open_live_joints(self._hand_option, angles, options.joint_topic, options.hand_can))

    def _open_objects(self, stack: ExitStack) -> "ObjectHistory | None":
        """Return the measured poses of the object, from a file or from a topic; None if the options name neither."""
        from taxel.twin.simulated.object_history import ObjectHistory, read_object_poses

        if self._options.object_file is not None:
            return read_object_poses(self._options.object_file)
        if self._options.object_topic is None:
            return None
        history = ObjectHistory(self._options.object_topic)
        _listen_to_object(self._options.object_topic, history, stack)
        return history


def _load_hand(path: Path, hand: str | None) -> Hand:
    """Load the hand of the option --hand, or that of a dataset."""
    from taxel.recording.grasp_dataset import GraspDataset

    if hand is not None:
        return load_hand(hand)
    with GraspDataset(path) as data:
        return load_hand(data.hand)


def _listen_to_object(topic: str, history: "ObjectHistory", stack: ExitStack) -> None:
    """Add each pose of a topic of type geometry_msgs/PoseStamped to the history until the stack is closed."""
    import time

    from taxel.ros.node import SpinningNode, open_node  # needs ROS

    def add(message: Any) -> None:
        """Add a pose with the time of its arrival; a pose with an invalid quaternion is ignored."""
        position, turn = message.pose.position, message.pose.orientation
        try:
            history.add(
                time.monotonic(),
                np.array([position.x, position.y, position.z]),
                np.array([turn.w, turn.x, turn.y, turn.z]),
            )
        except ValueError:
            return

    node = stack.enter_context(SpinningNode(open_node(None)))
    node.listen(topic, "geometry_msgs/PoseStamped", add)
