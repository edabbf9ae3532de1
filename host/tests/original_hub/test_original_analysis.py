"""An original hub as a source of `taxel ros` and, with its frames in grasp datasets, of `taxel gap diagnose`."""

import json
from pathlib import Path

import numpy as np
import pytest

from host.tests.command_line import run_taxel
from taxel.gap.verdict.verdict import MEANINGS, UNKNOWN
from taxel.grasp.timeline import Phase
from taxel.hand import load_hand
from taxel.recording import DatasetHeader, GraspDatasetWriter, GraspRecord
from taxel.recording.grasp_dataset import GraspDataset
from taxel.ros.cdr import encode
from taxel.ros.topics import TopicMessage
from taxel.sim.sensor_model import SimSensor
from taxel.types import FloatArray

PHASE_ENDS_S = {Phase.BASELINE: 4.0, Phase.CLOSING: 6.0, Phase.HOLD: 7.5, Phase.RELEASE: 8.5, Phase.RECOVERY: np.inf}
SIGNAL_COUNTS = 600
"""Signal that is added to two taxels in the hold."""
SEED = 5


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record an emulated original hub for ten virtual seconds; return the capture file."""
    path = tmp_path_factory.mktemp("original") / "skin.bin"
    url = f"emulator:?protocol=original&speed=max&seed={SEED}&duration_s=20"
    assert run_taxel("record", url, "--seconds", "10", "--out", str(path)) == 0
    return path


class CollectingNode:
    """A ROS node without ROS, which encodes every message."""

    is_alive = True

    def __init__(self) -> None:
        self.messages: list[TopicMessage] = []

    def publish(self, message: TopicMessage) -> None:
        assert encode(message.type, message.message)
        self.messages.append(message)

    def close(self) -> None:
        pass


@pytest.mark.parametrize("options", [(), ("--original-topics",)])
def test_ros_publishes_messages_of_all_boards_of_an_original_hub_at_most_at_its_rate(
    capture: Path, options: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    node = CollectingNode()
    monkeypatch.setattr("taxel.cli.ros.open_node", lambda version: node)
    assert run_taxel("ros", f"file:{capture}", "--seconds", "3", *options) == 0
    boards, topics = load_hand("original").boards, {message.topic for message in node.messages}
    if options:
        assert topics == {f"/sensor_{board.address}_readings" for board in boards}
    else:
        assert {"/tf", "/joint_states"} <= topics
        assert all(any(board.name in topic for topic in topics) for board in boards)
    numbers = [sum(message.topic == topic for message in node.messages) for topic in topics]
    assert min(numbers) >= 1
    assert max(numbers) < 17 * 3 * 6  # 17 boards, 3 s, below 6 poll cycles per second; the hub has 5.2


def make_grasps(capture: Path, tmp_path: Path, force: FloatArray | None) -> Path:
    """Write a dataset of four grasps with the times and counts of the hub; two taxels of the palm are loaded in hold.

    force: f64[n], newtons, contact forces of a simulated dataset; None: the dataset is a real one.
    """
    frames, out = tmp_path / "frames.h5", tmp_path / ("real.h5" if force is None else "sim.h5")
    if not frames.exists():
        assert run_taxel("convert", str(capture), str(frames), "--object", "cylinder", "--approach", "side_1") == 0
    loaded = np.arange(load_hand("original").n_taxels)[load_hand("original").get_slice(0x15)][40:42]
    with GraspDataset(frames) as data:
        (grasp,) = data
        time_s = grasp.timestamp - grasp.timestamp.min()
        ends = np.array(list(PHASE_ENDS_S.values()))
        phase = np.searchsorted(ends, time_s.mean(axis=1) if time_s.ndim > 1 else time_s).astype(np.uint8)
        counts = grasp.raw_counts.copy()
        counts[np.ix_(phase == Phase.HOLD, loaded)] -= SIGNAL_COUNTS
        forces = None if force is None else np.where((phase == Phase.HOLD)[:, None], force, 0.0)
        model = None if force is None else SimSensor().make_dataset_model(load_hand("original"), 1000.0, "uncoupled")
        source = "real" if force is None else "sim"
        header = DatasetHeader(source, data.hand, data.taxels, data.sensors, data.objects, "test", sensor_model=model)
        with GraspDatasetWriter.create(out, header) as writer:
            for iteration in range(4):
                record = GraspRecord(
                    "cylinder",
                    "side_1",
                    iteration,
                    iteration // 2,
                    grasp.timestamp,
                    phase,
                    counts,
                    grasp.valid,
                    grasp.sensor_pose,
                    grasp.object_pose,
                    contact_force=forces,
                    separation=None if forces is None else np.full(forces.shape, 0.01),
                )
                writer.add(record, f"g{iteration}")
    return out


def test_gap_diagnose_reports_on_grasps_recorded_with_an_original_hub(
    capture: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    real = make_grasps(capture, tmp_path, None)
    sim = make_grasps(capture, tmp_path, np.zeros(load_hand("original").n_taxels))
    capsys.readouterr()
    names = set(MEANINGS) - {"noise", UNKNOWN}
    excluded = [word for name in sorted(names) for word in ("--without", name)]  # saves time
    assert run_taxel("gap", "diagnose", str(real), str(sim), "--out", str(tmp_path / "gap"), *excluded) == 0
    report = json.loads((tmp_path / "gap" / "report.json").read_text())
    assert report["counts"]["real"] == {"grasps": 4, "sessions": 2}
    assert len(report["sensors"]) == 17
    assert '<svg class="hand"' in (tmp_path / "gap" / "report.html").read_text()
