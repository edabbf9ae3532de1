"""ROS topics of the skin, and the messages that each taxel frame of a skin produces."""

import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from taxel.hand import Hand
from taxel.hand.joint_history import EDGE_S, JointHistory
from taxel.proximity import ProximityWatch
from taxel.ros.contacts import make_activations_message, make_baseline_message, make_contact_cloud_message
from taxel.ros.diagnostics import make_diagnostics_message
from taxel.ros.proximity import MESSAGE_TYPE, make_proximity_message
from taxel.ros.tf_tree import FrameTree, make_header
from taxel.signal import ACTIVATION_THRESHOLD_COUNTS, BASELINE_SAMPLES, Activation, Baseline, BaselineResult
from taxel.stream import HubClient, TaxelFrame
from taxel.stream.cycles import CycleSorter
from taxel.types import BoolArray, CountArray

TREE_PERIOD_S = 0.1
"""Smallest interval between two messages of the joint states and of the moving part of the TF tree."""

DIAGNOSTICS_PERIOD_S = 1.0
"""Smallest interval between two diagnostics messages."""

NS_PER_S = 1_000_000_000

JointSource = Callable[[], npt.ArrayLike]
"""A function that returns the joint angles of the hand's robot, radians [j], in the order of its `joint_names`."""


def compute_epoch_offset_ns(first_s: float, is_live: bool) -> int:
    """Compute Unix time minus stream time, nanoseconds.

    first_s: time of the first frame on the stream's clock, seconds. is_live: the stream has the clock of
    `time.monotonic`; otherwise the offset maps its first frame to the present time.
    """
    return time.time_ns() - (time.monotonic_ns() if is_live else round(first_s * NS_PER_S))


class TopicMessage(NamedTuple):
    """One ROS message for one topic.

    type: "package/Name". time_ns: time of the content, nanoseconds since the Unix epoch, or of the stream's clock where
    the offset is unknown. message: values by field name. is_latched: ROS sends the message also to later subscribers.
    """

    topic: str
    type: str
    time_ns: int
    message: dict[str, Any]
    is_latched: bool = False


class SkinTopics:
    """Converter from taxel frames to ROS messages, in constant memory.

    If `joints` is a `JointHistory`, it is evaluated at the time of each poll cycle, and every cycle has a message of
    joint states. The first `baseline_samples` scans are the baseline, during which nothing may touch the skin;
    activations and contact clouds follow after the baseline. A hand description without geometry gives no TF tree and
    no contact cloud.
    """

    def __init__(
        self,
        hand: Hand,
        hub: HubClient,
        epoch_offset_ns: int = 0,
        joints: JointSource | None = None,
        baseline_samples: int = BASELINE_SAMPLES,
        threshold_counts: float = ACTIVATION_THRESHOLD_COUNTS,
        proximity: ProximityWatch | None = None,
    ) -> None:
        """Create a converter from taxel frames to ROS messages.

        hub: source of the counters in the diagnostics. epoch_offset_ns: Unix time minus stream time. joints: function
        that returns the joint angles of the hand's robot; None: all 0. baseline_samples: number of first scans that
        form the baseline. threshold_counts: signal above which a taxel is active. proximity: estimators of targets
        before contact; None: no topics of targets.
        """
        self._hand = hand
        self._hub = hub
        self._offset_ns = epoch_offset_ns
        self._threshold = threshold_counts
        self._proximity = proximity
        self.tree = FrameTree(hand, joints)
        self._measured = joints if isinstance(joints, JointHistory) else None
        self._sorter = CycleSorter(len(hand.boards))
        self._baseline = Baseline(hand.n_taxels, samples=baseline_samples)
        self._scans = 0
        self._activation: Activation | None = None
        self._has_baseline = np.zeros(hand.n_taxels, dtype=bool)
        self.baseline: BaselineResult | None = None
        self._names = {board.address: board.name for board in hand.boards}
        self._last_sequence: dict[int, int] = {}
        self._tree_s = self._diagnostics_s = float("-inf")
        self._is_started = False
        self._newest_s = float("-inf")

    def time_ns(self, time_s: float) -> int:
        """Convert a time of the stream, seconds, to nanoseconds since the Unix epoch."""
        return round(time_s * NS_PER_S) + self._offset_ns

    def take(self, frame: TaxelFrame) -> Iterator[TopicMessage]:
        """Yield the ROS messages of a taxel frame. Exhaust the iterator before the next call."""
        if not self._is_started:
            self._is_started = True
            yield from self._make_static_messages(self.time_ns(frame.time_s))
            # The first joint states get a time before the first frame, because the scans of other boards in the same
            # cycle may have started before this frame.
            yield from self._make_edge_message(frame.time_s - EDGE_S)
        self._newest_s = max(self._newest_s, frame.time_s)
        yield self._make_scan_message(frame)
        yield from self._make_proximity_message(frame)
        self._sorter.add(frame)
        yield from self._make_completed_cycle_messages(is_end=False)

    def finish(self) -> Iterator[TopicMessage]:
        """Yield the remaining messages after the last frame of the stream."""
        yield from self._make_completed_cycle_messages(is_end=True)
        yield from self._make_edge_message(self._newest_s)

    def _make_edge_message(self, time_s: float) -> Iterator[TopicMessage]:
        """Yield the joint states at the start or the end of the stream if joint angles are measured.

        time_s: time of the message on the stream's clock. If the angles have times on this clock, a time outside the
        measured period is replaced by the start or the end of the period.
        """
        if self._measured is None or not self.tree.has_geometry or not len(self._measured):
            return
        if self._measured.uses_stream_time:
            time_s = min(max(time_s, self._measured.first_s), self._measured.last_s)
        self._measured.select_time(time_s)
        time_ns = self.time_ns(time_s)
        yield TopicMessage("/joint_states", "sensor_msgs/JointState", time_ns, self.tree.joint_states(time_ns))

    def _make_static_messages(self, time_ns: int) -> Iterator[TopicMessage]:
        """Yield the messages that are sent once: robot description and static transforms."""
        if self.tree.has_geometry:
            yield TopicMessage("/robot_description", "std_msgs/String", time_ns, {"data": self.tree.urdf}, True)
            static = self.tree.make_static_transforms(time_ns)
            yield TopicMessage("/tf_static", "tf2_msgs/TFMessage", time_ns, static, True)

    def _make_scan_message(self, frame: TaxelFrame) -> TopicMessage:
        """Make the TaxelScan message of one board's frame, stamped with the start of the scan."""
        time_ns = self.time_ns(frame.time_s)
        name = self._names[frame.address]
        self._last_sequence[frame.address] = frame.sequence
        message = {
            "header": make_header(time_ns, self.tree.get_bracket_frame(frame.address)),
            "address": frame.address,
            "name": name,
            "sequence": frame.sequence,
            "cycle": frame.cycle,
            "board_time_us": frame.board_time_us,
            "hub_time_us": frame.hub_time_us,
            "valid": True,
            "raw_counts": frame.raw_counts,
        }
        return TopicMessage(f"/taxel/{name}/scan", "taxel_msgs/TaxelScan", time_ns, message)

    def _make_proximity_message(self, frame: TaxelFrame) -> Iterator[TopicMessage]:
        """Yield the message of the target in front of the frame's board, if proximity is estimated for this board."""
        estimate = None if self._proximity is None else self._proximity.take(frame)
        if estimate is not None:
            time_ns = self.time_ns(frame.time_s)
            head = make_header(time_ns, self.tree.get_bracket_frame(frame.address))
            message = make_proximity_message(estimate, head)
            yield TopicMessage(f"/taxel/{estimate.board}/proximity", MESSAGE_TYPE, time_ns, message)

    def _make_completed_cycle_messages(self, is_end: bool) -> Iterator[TopicMessage]:
        """Yield the messages of all complete poll cycles; is_end: the stream has ended, so all cycles are complete."""
        while (frames := self._sorter.pop(is_end)) is not None:
            yield from self._make_cycle_messages(frames, is_end)

    def _make_cycle_messages(self, frames: list[TaxelFrame], is_end: bool) -> Iterator[TopicMessage]:
        """Yield the messages of a poll cycle: missing scans, joint states, TF, activations, diagnostics.

        frames: frames of all boards in the cycle. is_end: the end of the stream may have truncated the cycle.
        """
        time_s = min(frame.time_s for frame in frames)
        time_ns = self.time_ns(time_s)
        if not is_end:  # boards that are missing in a truncated cycle are not a fault
            yield from self._make_missing_scan_messages(frames, time_ns)
        if self._measured is not None:
            self._measured.select_time(time_s)
        is_tree_due = self.tree.has_geometry and time_s >= self._tree_s + TREE_PERIOD_S
        if self.tree.has_geometry and (is_tree_due or self._measured is not None):
            yield TopicMessage("/joint_states", "sensor_msgs/JointState", time_ns, self.tree.joint_states(time_ns))
        if is_tree_due:
            self._tree_s = time_s
            yield TopicMessage("/tf", "tf2_msgs/TFMessage", time_ns, self.tree.make_moving_transforms(time_ns))
        yield from self._make_contact_messages(frames, time_ns)
        if time_s >= self._diagnostics_s + DIAGNOSTICS_PERIOD_S:
            self._diagnostics_s = time_s
            message = make_diagnostics_message(self._hand, self._hub, time_ns)
            yield TopicMessage("/diagnostics", "diagnostic_msgs/DiagnosticArray", time_ns, message)

    def _make_missing_scan_messages(self, frames: list[TaxelFrame], time_ns: int) -> Iterator[TopicMessage]:
        """Yield a scan message with `valid` False for each board that has sent frames before but none in this cycle."""
        for address in self._last_sequence.keys() - {frame.address for frame in frames}:
            empty = TaxelFrame(
                address, frames[0].cycle, self._last_sequence[address], 0.0, 0, 0, np.zeros(0, dtype=np.uint16)
            )
            message = self._make_scan_message(empty)
            head = make_header(time_ns, self.tree.get_bracket_frame(address))
            yield message._replace(time_ns=time_ns, message=message.message | {"valid": False, "header": head})

    def _make_contact_messages(self, frames: list[TaxelFrame], time_ns: int) -> Iterator[TopicMessage]:
        """Yield the baseline message once, and then the activations and the contact cloud of each poll cycle."""
        counts = np.zeros(self._hand.n_taxels, dtype=np.uint16)
        valid = np.zeros(self._hand.n_taxels, dtype=bool)
        for frame in frames:
            taxels = self._hand.get_slice(frame.address)
            counts[taxels] = frame.raw_counts
            valid[taxels] = True
        if self._activation is None:
            if self._update_baseline(counts, valid) and self.baseline is not None:
                message = make_baseline_message(self.baseline, self._baseline.samples, time_ns)
                yield TopicMessage("/taxel/baseline", "taxel_msgs/Baseline", time_ns, message, True)
            return
        activation = self._activation(counts, valid & self._has_baseline)
        message = make_activations_message(self._hand, activation, frames[0].cycle, self._threshold, time_ns)
        yield TopicMessage("/taxel/activations", "taxel_msgs/Activations", time_ns, message)
        if self.tree.has_geometry:
            positions, normals = self.tree.compute_taxel_centres_and_normals()
            head = make_header(time_ns, self.tree.root)
            cloud = make_contact_cloud_message(self._hand, activation, positions, normals, head)
            yield TopicMessage("/taxel/contact_cloud", "sensor_msgs/PointCloud2", time_ns, cloud)

    def _update_baseline(self, counts: CountArray, valid: BoolArray) -> bool:
        """Add one scan of the skin to the baseline, and return whether the baseline is now complete.

        counts: u16[n]. valid: bool[n], whether the taxel has a count in this scan. After twice the number of baseline
        scans, the baseline is complete without the boards that do not respond; the means of their taxels are NaN, as in
        `Skin.take_baseline`. A complete baseline also starts the activation.
        """
        baseline = self._baseline
        baseline.update(counts, valid)
        self._scans += 1
        is_overdue = self._scans >= 2 * baseline.samples and bool(baseline.ready_mask.any())
        if not (baseline.is_ready or is_overdue):
            return False
        self.baseline = (
            baseline.result()
            if baseline.is_ready
            else BaselineResult(baseline.mean, baseline.noise, baseline.disturbed, baseline.count)
        )
        self._has_baseline = np.isfinite(self.baseline.mean)
        self._activation = Activation(np.where(self._has_baseline, self.baseline.mean, 0.0), self._threshold)
        return True
