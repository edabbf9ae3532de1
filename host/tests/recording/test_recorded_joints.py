"""Measured joint angles of every poll cycle in recordings of every format, and taxel positions computed from them."""

import threading
from pathlib import Path

import numpy as np
import pytest

from taxel.cloud.contacts import locate_taxels
from taxel.errors import TaxelError
from taxel.hand import Hand, load_hand
from taxel.hand.joint_history import JointFileError, JointHistory
from taxel.hand.kinematics import build_kinematics
from taxel.recording.formats import convert
from taxel.recording.formats.grasp_options import GraspOptions
from taxel.recording.formats.recorded_joints import load_joint_file, load_recorded_joints
from taxel.recording.grasp_dataset import GraspDataset
from taxel.skin.joint_recording import get_joint_path
from taxel.skin.opening import open_source
from taxel.skin.recorder import open_recorded, record_link
from taxel.skin.recording_link import make_recording_header

URL = "emulator:?speed=max&duration_s=1.5"
FILES = {
    "capture": "x.bin",
    "pcapng": "x.pcapng",
    "mcap": "x.mcap",
    "csv": "x.csv",
    "parquet": "x.parquet",
    "hdf5": "x.h5",
}


def compute_motion_angles(time_s: float) -> np.ndarray:
    """Return the 22 joint angles of a motion with constant velocities, radians."""
    return np.linspace(-0.2, 0.3, 22) * time_s


@pytest.fixture(scope="module")
def hand() -> Hand:
    return load_hand("original")


def make_motion(hand: Hand) -> JointHistory:
    """Make the joint angles of `compute_motion_angles` for 4 s, every 10 ms."""
    history = JointHistory(build_kinematics(hand).robot.joint_names, "motion")
    for time_s in np.arange(0.0, 4.0, 0.01).tolist():
        history.add(time_s, compute_motion_angles(time_s))
    return history


@pytest.fixture(scope="module", params=["x.bin", "x.mcap"])
def recorded(request: pytest.FixtureRequest, hand: Hand, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Path of a recording of an emulated hand in motion, in each of two formats."""
    path = tmp_path_factory.mktemp("joints") / str(request.param)
    with open_recorded(URL, path, hand, joint_position=make_motion(hand)) as skin:
        for _ in skin:
            pass
    return path


def test_recording_has_the_joint_angles_of_every_poll_cycle(recorded: Path, hand: Hand) -> None:
    joints = load_recorded_joints(recorded, "mcap" if recorded.suffix == ".mcap" else "capture", hand)
    assert joints is not None
    assert len(joints) > 15
    for time_s in np.linspace(joints.first_s, joints.last_s, 7).tolist():
        np.testing.assert_allclose(joints.interpolate(time_s), compute_motion_angles(max(time_s, 0.0)), atol=1e-5)


@pytest.mark.parametrize("format_name", list(FILES))
def test_conversion_keeps_the_joint_angles(recorded: Path, hand: Hand, tmp_path: Path, format_name: str) -> None:
    target = tmp_path / FILES[format_name]
    convert(recorded, target)
    joints = load_recorded_joints(target, format_name, hand)
    assert joints is not None
    for time_s in np.linspace(joints.first_s, joints.last_s, 5).tolist():
        np.testing.assert_allclose(joints.interpolate(time_s), compute_motion_angles(max(time_s, 0.0)), atol=1e-4)
    again = tmp_path / "again.mcap"
    convert(target, again)
    last = load_recorded_joints(again, "mcap", hand)
    assert last is not None
    # A Parquet file has the joint angles in every row, not only once per poll cycle.
    assert len(last) == pytest.approx(len(joints), abs=0.1 * len(joints) + 2) or format_name == "parquet"
    np.testing.assert_allclose(last.interpolate(joints.last_s), compute_motion_angles(joints.last_s), atol=1e-2)


@pytest.mark.parametrize(
    ("name", "joint_count"),
    [("x.bin", 22), ("x.mcap", 3)],
    ids=["joint file exists", "wrong number of joint angles"],
)
def test_link_is_closed_if_the_joint_angles_cannot_be_recorded(
    hand: Hand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, joint_count: int
) -> None:
    path = tmp_path / name
    get_joint_path(path).write_text("existing file")
    history = JointHistory([f"joint{index}" for index in range(joint_count)], "motion")
    history.add(0.0, np.zeros(joint_count))
    link, description = open_source(URL, hand)
    header = make_recording_header(URL, link, description, hand)
    close_link, closings, threads = link.close, [], set(threading.enumerate())

    def close() -> None:
        """Close the link and count the call."""
        closings.append(1)
        close_link()

    monkeypatch.setattr(link, "close", close)
    with pytest.raises(TaxelError):
        record_link(link, description, header, path, joint_position=history)
    assert closings
    assert not path.exists()
    assert set(threading.enumerate()) <= threads  # the thread that reads the link has ended


def test_dataset_has_the_sensor_poses_of_each_frame(recorded: Path, hand: Hand, tmp_path: Path) -> None:
    convert(recorded, tmp_path / "x.h5")
    kinematics = build_kinematics(hand)
    with GraspDataset(tmp_path / "x.h5") as data:
        grasp = data[data.ids[0]]
        assert grasp.sensor_pose_t is not None
        for row in (0, len(grasp.timestamp) // 2, -1):
            expected = kinematics.compute_sensor_poses(compute_motion_angles(float(grasp.timestamp[row])))
            np.testing.assert_allclose(grasp.sensor_pose_t[row], expected, atol=1e-5)


def test_cloud_positions_are_those_of_the_hold_frames(recorded: Path, hand: Hand, tmp_path: Path) -> None:
    convert(recorded, tmp_path / "x.h5", options=GraspOptions(baseline_frames=2))
    kinematics = build_kinematics(hand)
    with GraspDataset(tmp_path / "x.h5") as data:
        grasp = data[data.ids[0]]
        # The first two frames are the baseline, all others the hold.
        times = grasp.timestamp[2:].tolist()
        expected = np.mean(
            [kinematics.compute_taxel_positions(compute_motion_angles(time_s)) for time_s in times], axis=0
        )
        np.testing.assert_allclose(locate_taxels(data, grasp), expected, atol=1e-5)


def test_constant_angles_replace_the_measured_ones_on_request(recorded: Path, hand: Hand, tmp_path: Path) -> None:
    convert(recorded, tmp_path / "x.h5", joint_position=np.full(22, 0.1))
    with GraspDataset(tmp_path / "x.h5") as data:
        grasp = data[data.ids[0]]
        assert grasp.sensor_pose_t is None
        assert (np.asarray(grasp.joint_position) == 0.1).all()


def test_joint_file_in_unix_time_is_shifted_to_the_clock_of_the_recording(hand: Hand, tmp_path: Path) -> None:
    names = build_kinematics(hand).robot.joint_names
    path = tmp_path / "joints.csv"
    rows = [f"{1_700_000_000 + time_s}" + ",0.5" * 22 for time_s in (1.0, 2.0)]
    path.write_text("\n".join([",".join(("time_s", *names)), *rows]) + "\n")
    history = load_joint_file(path, hand, {"epoch_offset_ns": 1_700_000_000 * 10**9})
    assert history.first_s == pytest.approx(1.0)


def test_a_damaged_joint_file_of_a_capture_is_refused_and_nothing_is_written(hand: Hand, tmp_path: Path) -> None:
    path = tmp_path / "x.bin"
    with open_recorded(URL, path, hand, joint_position=make_motion(hand)) as skin:
        for _ in skin:
            pass
    joint_path = get_joint_path(path)
    joint_path.write_text(joint_path.read_text().replace("ff_j0", "ff_x0", 1))
    with pytest.raises(JointFileError, match="expected a column ff_j0") as error:
        convert(path, tmp_path / "y.mcap")
    assert isinstance(error.value, TaxelError)
    assert not (tmp_path / "y.mcap").exists()
