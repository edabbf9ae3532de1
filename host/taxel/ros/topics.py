"""The skin as topics: which there are, and the messages that each frame of a skin becomes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from taxel.hand import Hand
from taxel.ros.contacts import activations, baseline_message, contact_cloud
from taxel.ros.diagnostics import diagnostics
from taxel.ros.tree import FrameTree, header
from taxel.signal import ACTIVATION_THRESHOLD_COUNTS, BASELINE_SAMPLES, Activation, Baseline, BaselineResult
from taxel.stream import HubClient, TaxelFrame
from taxel.stream.cycles import CycleSorter

TREE_PERIOD_S = 0.1
"""Joint states and the moving part of the TF tree are published at most so often."""

DIAGNOSTICS_PERIOD_S = 1.0

NS_PER_S = 1_000_000_000


class TopicMessage(NamedTuple):
    """A message for a topic. `type`: "package/Name"; `time_ns`: of what it tells, Unix time where that is known;
    `message`: fields by name; `is_latched`: who comes later wants it too.
    """

    topic: str
    type: str
    time_ns: int
    message: dict[str, Any]
    is_latched: bool = False


class SkinTopics:
    """Turns frames into messages, in constant memory.

    `hub`: whose counters the diagnostics show. `epoch_offset_ns`: from the stream's clock to Unix time. `joints`: gives
    the joint angles of the hand's robot, radians [j], None: all 0. The first `baseline_samples` scans are the baseline:
    nothing may touch the skin; activations and contact clouds come after it. A hand that is described without places
    has no TF tree and no contact cloud.
    """

    def __init__(
        self,
        hand: Hand,
        hub: HubClient,
        epoch_offset_ns: int = 0,
        joints: Callable[[], npt.ArrayLike] | None = None,
        baseline_samples: int = BASELINE_SAMPLES,
        threshold_counts: float = ACTIVATION_THRESHOLD_COUNTS,
    ) -> None:
        self._hand = hand
        self._hub = hub
        self._offset_ns = epoch_offset_ns
        self._threshold = threshold_counts
        self.tree = FrameTree(hand, joints)
        self._sorter = CycleSorter(len(hand.boards))
        self._baseline = Baseline(hand.n_taxels, samples=baseline_samples)
        self._scans = 0
        self._activation: Activation | None = None
        self._known = np.zeros(hand.n_taxels, dtype=bool)
        self.baseline: BaselineResult | None = None
        self._names = {board.address: board.name for board in hand.boards}
        self._last_sequence: dict[int, int] = {}
        self._tree_s = self._diagnostics_s = float("-inf")
        self._is_begun = False

    @property
    def scan_topics(self) -> dict[int, str]:
        """The topic of each board, by address."""
        return {address: f"/taxel/{name}/scan" for address, name in self._names.items()}

    def time_ns(self, time_s: float) -> int:
        """A time of the stream as nanoseconds since the epoch."""
        return round(time_s * NS_PER_S) + self._offset_ns

    def take(self, frame: TaxelFrame) -> Iterator[TopicMessage]:
        """The messages that a frame brings. Use all of them before the next frame."""
        if not self._is_begun:
            self._is_begun = True
            yield from self._opening(self.time_ns(frame.time_s))
        yield self._scan(frame)
        self._sorter.add(frame)
        yield from self._cycles(is_end=False)

    def finish(self) -> Iterator[TopicMessage]:
        """What is left when no more frames come."""
        yield from self._cycles(is_end=True)

    def _opening(self, time_ns: int) -> Iterator[TopicMessage]:
        if self.tree.is_known:
            yield TopicMessage("/robot_description", "std_msgs/String", time_ns, {"data": self.tree.urdf}, True)
            yield TopicMessage("/tf_static", "tf2_msgs/TFMessage", time_ns, self.tree.static(time_ns), True)

    def _scan(self, frame: TaxelFrame) -> TopicMessage:
        time_ns = self.time_ns(frame.time_s)
        name = self._names[frame.address]
        self._last_sequence[frame.address] = frame.sequence
        message = {
            "header": header(time_ns, self.tree.bracket(frame.address)),
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

    def _cycles(self, is_end: bool) -> Iterator[TopicMessage]:
        while (frames := self._sorter.pop(is_end)) is not None:
            yield from self._cycle(frames)

    def _cycle(self, frames: list[TaxelFrame]) -> Iterator[TopicMessage]:
        time_s = min(frame.time_s for frame in frames)
        time_ns = self.time_ns(time_s)
        yield from self._silent(frames, time_ns)
        if self.tree.is_known and time_s >= self._tree_s + TREE_PERIOD_S:
            self._tree_s = time_s
            yield TopicMessage("/joint_states", "sensor_msgs/JointState", time_ns, self.tree.joint_states(time_ns))
            yield TopicMessage("/tf", "tf2_msgs/TFMessage", time_ns, self.tree.moving(time_ns))
        yield from self._contact(frames, time_ns)
        if time_s >= self._diagnostics_s + DIAGNOSTICS_PERIOD_S:
            self._diagnostics_s = time_s
            message = diagnostics(self._hand, self._hub, time_ns)
            yield TopicMessage("/diagnostics", "diagnostic_msgs/DiagnosticArray", time_ns, message)

    def _silent(self, frames: list[TaxelFrame], time_ns: int) -> Iterator[TopicMessage]:
        """A message that is not valid for each board that has spoken before and is not in this cycle."""
        for address in self._last_sequence.keys() - {frame.address for frame in frames}:
            silent = TaxelFrame(
                address, frames[0].cycle, self._last_sequence[address], 0.0, 0, 0, np.zeros(0, dtype=np.uint16)
            )
            message = self._scan(silent)
            fields = message.message | {"valid": False, "header": header(time_ns, self.tree.bracket(address))}
            yield message._replace(time_ns=time_ns, message=fields)

    def _contact(self, frames: list[TaxelFrame], time_ns: int) -> Iterator[TopicMessage]:
        counts = np.zeros(self._hand.n_taxels, dtype=np.uint16)
        valid = np.zeros(self._hand.n_taxels, dtype=bool)
        for frame in frames:
            where = self._hand.slice_of(frame.address)
            counts[where] = frame.raw_counts
            valid[where] = True
        if self._activation is None:
            if self._is_baseline_done(counts, valid) and self.baseline is not None:
                message = baseline_message(self.baseline, self._baseline.samples, time_ns)
                yield TopicMessage("/taxel/baseline", "taxel_msgs/Baseline", time_ns, message, True)
            return
        felt = self._activation(counts, valid & self._known)
        message = activations(self._hand, felt, frames[0].cycle, self._threshold, time_ns)
        yield TopicMessage("/taxel/activations", "taxel_msgs/Activations", time_ns, message)
        if self.tree.is_known:
            cloud = contact_cloud(self._hand, felt, *self.tree.taxels(), header(time_ns, self.tree.root))
            yield TopicMessage("/taxel/contact_cloud", "sensor_msgs/PointCloud2", time_ns, cloud)

    def _is_baseline_done(self, counts: npt.NDArray[np.uint16], valid: npt.NDArray[np.bool_]) -> bool:
        self._baseline.update(counts, valid)
        self._scans += 1
        late = self._scans >= 2 * self._baseline.samples and bool(self._baseline.ready_mask.any())
        if not (self._baseline.ready or late):
            return False
        own = self._baseline
        self.baseline = (
            own.result() if own.ready else BaselineResult(own.mean, own.noise, own.disturbed, own.count)
        )  # as Skin.take_baseline: boards that do not answer have NaN
        self._known = np.isfinite(self.baseline.mean)
        self._activation = Activation(np.where(self._known, self.baseline.mean, 0.0), self._threshold)
        return True
