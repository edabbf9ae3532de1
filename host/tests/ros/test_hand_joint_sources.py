"""Joint angles from the hand on CAN and from a topic, hand control by the command line."""

import re
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import can
import numpy as np
import pytest

from host.tests.command_line import run_refused_command
from taxel.cli import joint_sources, ros_hand
from taxel.hand import load_hand
from taxel.hand.allegro import FreeJoints, VirtualAllegro, open_bus
from taxel.hand.allegro.listener import AllegroListener
from taxel.hand.control_loop import ControlLoop
from taxel.hand.joint_names import ROBOT_JOINT_NAMES, ROS_JOINT_NAMES
from taxel.hand.kinematics import build_kinematics
from taxel.recording.formats.recorded_joints import load_recorded_joints
from taxel.ros.hand_control import DEFAULT_LIMITS
from taxel.ros.node import JointListener
from taxel.skin.recorder import open_recorded

TARGET = (DEFAULT_LIMITS.lower + DEFAULT_LIMITS.upper) / 2 + 0.1


class FakeNode:
    """A ROS node that stores published messages; one command for the subscriber at its start and in each period."""

    def __init__(self, commands: Callable[[int], Any], count: int) -> None:
        self.published: list[Any] = []
        self.is_alive = True
        self._commands = (commands(index) for index in range(count))
        self._subscriber: Callable[[Any], None] | None = None

    def listen(self, topic: str, type_name: str, callback: Callable[[Any], None]) -> None:
        assert (topic, type_name) == ("allegroHand_0/joint_cmd", "sensor_msgs/JointState")
        self._subscriber = callback
        self._send_command()

    def _send_command(self) -> None:
        command = next(self._commands, None)
        if command is not None and self._subscriber is not None:
            self._subscriber(command)

    def listen_to_joints(self, topic: str, callback: Callable[[list[str], list[float]], None]) -> None:
        self.callback = callback

    def publish(self, message: Any) -> None:
        self.published.append(message)
        self._send_command()

    def wait(self, timeout_s: float) -> None:
        self._send_command()

    def close(self) -> None:
        self.is_alive = False


class VirtualTime:
    """Substitute for the module `time`: the seconds advance only in `sleep`."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def monotonic(self) -> float:
        return self.now_s

    def time_ns(self) -> int:
        return round(self.now_s * 1e9)

    def sleep(self, seconds: float) -> None:
        self.now_s += max(seconds, 1e-6)


def make_command(index: int) -> Any:
    return SimpleNamespace(name=list(ROS_JOINT_NAMES), position=TARGET.tolist(), effort=[])


def run_ros_hand(monkeypatch: pytest.MonkeyPatch, node: FakeNode, **options: Any) -> None:
    """Run `taxel ros-hand` with the virtual hand in virtual time."""
    clock = VirtualTime()
    monkeypatch.setattr(ros_hand, "open_node", lambda version: node)
    monkeypatch.setattr(ros_hand, "time", clock)
    monkeypatch.setattr(ros_hand, "ControlLoop", lambda: ControlLoop(clock=clock.monotonic, sleep=clock.sleep))
    arguments: dict[str, Any] = {"hold_after_s": 0.1, "stop_after_s": 0.4, "hand": "allegro", "seconds": None}
    ros_hand.ros_hand("can:emulated", **{"prefix": "allegroHand_0", **arguments, **options})


def test_command_moves_the_virtual_hand_and_publishes_its_encoder_angles(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    node = FakeNode(make_command, 1000)
    run_ros_hand(monkeypatch, node, seconds=1.2, original_rule=False, version=None)
    assert not node.is_alive
    first, last = node.published[0], node.published[-1]
    assert last.topic == "allegroHand_0/joint_states"
    assert np.abs(last.message["position"] - TARGET).mean() < np.abs(first.message["position"] - TARGET).mean()
    assert len(node.published) > 390  # 1.2 s with a period of 3 ms, less the wait for the first angles
    assert re.search(r"40[0-9] commands followed, 0 rejected", capsys.readouterr().out)


def test_stopped_topic_ends_the_command_with_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # The node sends five commands; `run_ros_hand` sets the time without a command until the stop to 0.4 s.
    with pytest.raises(Exception, match=r"no valid joint command for 0\.4 s: the hand held its position"):
        run_ros_hand(monkeypatch, FakeNode(make_command, 5), original_rule=False, version=None)
    assert "the hand holds its position" in capsys.readouterr().err


def test_hold_time_above_the_stop_time_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    line = run_refused_command(capsys, "ros-hand", "can:emulated", "--hold-after-s", "3")
    assert "--hold-after-s: expected less than --stop-after-s" in line


def test_listener_records_the_angles_of_the_hand_on_can_without_switching_its_motors(tmp_path: Path) -> None:
    hand = load_hand("original")
    names = build_kinematics(hand).robot.joint_names
    buses = [can.Bus("listener-test", "virtual"), open_bus("can:virtual:listener-test")]
    virtual = VirtualAllegro(buses[0], FreeJoints())
    stop = threading.Event()
    thread = threading.Thread(target=virtual.run, args=(stop,), daemon=True)
    thread.start()
    base = np.full(22, 0.5)  # angles of the joints that the hand on CAN does not measure
    listener = AllegroListener(buses[1], names, base)
    try:
        while not len(listener.history):
            time.sleep(0.01)
        path = tmp_path / "x.bin"
        with open_recorded("emulator:?duration_s=0.7", path, hand, joint_position=listener.history) as skin:
            for _ in skin:
                pass
        assert not virtual.servo_on
    finally:
        listener.close()
        stop.set()
        thread.join()
        for bus in buses:
            bus.shutdown()
    joints = load_recorded_joints(path, "capture", hand)
    assert joints is not None
    angles = dict(zip(names, joints.interpolate(joints.last_s).tolist(), strict=True))
    measured = [angles[name] for name in ROBOT_JOINT_NAMES]
    np.testing.assert_allclose(measured, virtual.dynamics.angles, atol=1e-3)
    assert all(angle == 0.5 for name, angle in angles.items() if name not in ROBOT_JOINT_NAMES)


def test_topic_with_the_names_of_the_driver_gives_the_joints_of_the_robot() -> None:
    # joint_1.0 is the name of ff_j1 in the driver. The topic has no angle of the elbow, which keeps the base angle 0.7.
    node = FakeNode(make_command, 0)
    listener = JointListener(node, "allegroHand_0/joint_states", ["elbow", "ff_j1"], np.array([0.7, 0.0]))  # type: ignore[arg-type]
    history = listener.record("allegroHand_0/joint_states")
    node.callback(["joint_1.0", "joint_2.0"], [0.25, 0.5])
    np.testing.assert_array_equal(history(), [0.7, 0.25])


def test_two_sources_of_joint_angles_are_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "x.bin"
    arguments = ("record", "emulator:", "--out", str(out), "--joint-topic", "/a", "--hand-can", "can:virtual:b")
    assert "--joint-topic and --hand-can: expected at most one source" in run_refused_command(capsys, *arguments)
    assert not out.exists()


def test_hand_that_sends_no_angles_is_one_line_and_nothing_is_recorded(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(joint_sources, "FIRST_SAMPLE_S", 0.2)
    out = tmp_path / "x.bin"
    line = run_refused_command(capsys, "record", "emulator:", "--out", str(out), "--hand-can", "can:virtual:silent")
    assert "no joint angles in 0.2 s; start the program that sends them" in line
    assert not out.exists()
