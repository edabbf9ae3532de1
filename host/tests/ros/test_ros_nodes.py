"""The skin in ROS 1, as a real master, rospy and tf2 have it; in ROS 2 against a stand-in; and without either."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import types

import numpy as np
import pytest

from host.tests.command_line import refusal
from taxel.cli.ros import publish_skin
from taxel.hand.kinematics import kinematics_of
from taxel.hand.transforms import pose
from taxel.ros import find
from taxel.ros.pace import Pace
from taxel.ros.ros2 import Ros2Node
from taxel.skin import open_skin

LISTENER = os.path.join(os.path.dirname(__file__), "ros1_listener.py")
PYTHON = "/usr/bin/python3"
PUBLISH = """
import sys
from taxel.cli.joints import joint_angles
from taxel.cli.ros import publish_skin
from taxel.ros.node import open_node
from taxel.ros.pace import Pace
from taxel.skin import open_skin
node = open_node(1)
with open_skin("file:" + sys.argv[1]) as skin:
    publish_skin(skin, node, joint_angles(sys.argv[2]), None, 0.0, Pace(3.0))
input()  # latched topics are there as long as the node
node.close()
"""
EXAMPLE = "from taxel.cli.ros import ros; ros('emulator:', None, '', '', 1, 1.0)"  # taxel ros "emulator:" --seconds 1


def missing_for_ros1():
    """What this test needs and the machine lacks; "" for nothing."""
    if shutil.which("roscore") is None:
        return "no roscore here (apt-get install ros-core)"
    asked = subprocess.run([PYTHON, "-c", "import rospy, tf2_ros, sensor_msgs"], capture_output=True, text=True)
    return asked.stderr.strip().splitlines()[-1] if asked.returncode else ""


@pytest.fixture(scope="module")
def master(tmp_path_factory):
    """The environment of a roscore of our own, on a free port of loopback."""
    lacking = missing_for_ros1()
    if lacking:
        pytest.skip(lacking)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    home = str(tmp_path_factory.mktemp("ros"))
    own = {"ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1", "ROS_HOME": home, "ROS_LOG_DIR": home}
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | own
    core = subprocess.Popen(
        ["roscore", "-p", str(port)], env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    try:
        for line in core.stdout:
            if "started core service" in line:
                break
        yield environment
    finally:
        core.send_signal(signal.SIGINT)
        try:
            core.wait(timeout=10.0)
        except subprocess.TimeoutExpired:
            core.kill()
        core.stdout.close()


@pytest.fixture(scope="module")
def heard(master, recorded):
    """What a subscriber hears of the recording, played at three times its speed."""
    topics = "/taxel/palm/scan,/taxel/fingertip_index/scan"
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True, "env": master}
    angles = ",".join(map(str, np.linspace(-0.2, 0.2, 22)))
    listener = subprocess.Popen([PYTHON, LISTENER, topics, "palm_bracket,fingertip_index"], **pipes)
    publisher = subprocess.Popen([sys.executable, "-c", PUBLISH, str(recorded.path), angles], **pipes)
    try:
        assert listener.stdout.readline() == "ready\n"
        assert publisher.stdout.readline() == f"{len(recorded.frames)} frames published\n"
        told, _ = listener.communicate(timeout=20.0)
        publisher.communicate("\n", timeout=20.0)
        return json.loads(told)
    finally:
        listener.kill()
        publisher.kill()


def test_ros_has_a_topic_for_each_sensor(heard, recorded):
    wanted = {f"/taxel/{board.name}/scan" for board in recorded.hand.boards}
    wanted |= {"/tf", "/tf_static", "/joint_states", "/taxel/activations", "/taxel/contact_cloud", "/taxel/baseline"}
    assert wanted | {"/diagnostics", "/robot_description"} <= set(heard["topics"])


def test_a_subscriber_hears_the_scans_as_they_were(heard, recorded):
    for name in ("palm", "fingertip_index"):
        address = recorded.hand.board_named(name).address
        frames = {frame.sequence: frame.raw_counts.tolist() for frame in recorded.frames if frame.address == address}
        scans = heard["scans"][f"/taxel/{name}/scan"]
        assert len(scans) > len(frames) // 2
        assert all(frames[sequence] == counts for sequence, *counts in scans)


def test_tf2_finds_the_brackets_where_the_kinematics_have_them(heard, recorded):
    angles = np.linspace(-0.2, 0.2, 22)
    assert np.allclose(heard["joints"][-1], angles)
    poses = kinematics_of(recorded.hand).sensor_poses(angles)
    for frame, (*place, w, x, y, z) in heard["transforms"].items():
        board = recorded.hand.board_named(frame.removesuffix("_bracket"))
        wanted = poses[recorded.hand.boards.index(board)]
        assert np.allclose(pose(place, [w, x, y, z]), wanted, atol=1e-9)


def test_a_subscriber_hears_a_cloud_at_taxels_of_the_pressed_board(heard, recorded):
    points = np.array(heard["clouds"][-1])
    assert len(points) > 3
    assert (points[:, 6] > 150.0).all()
    places = kinematics_of(recorded.hand).taxel_positions(np.linspace(-0.2, 0.2, 22))
    palm = places[recorded.hand.slice_of(recorded.hand.board_named("palm").address)]
    assert np.linalg.norm(points[:, None, :3] - palm, axis=2).min(axis=1).max() < 1e-6


def test_the_example_of_the_help_runs(master):
    done = subprocess.run([sys.executable, "-c", EXAMPLE], env=master, capture_output=True, text=True, timeout=60.0)
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("frames published\n")


def test_a_missing_master_is_one_line(monkeypatch, capsys):
    lacking = missing_for_ros1()
    if lacking:
        pytest.skip(lacking)
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:9")
    monkeypatch.setattr(sys, "path", list(sys.path))
    told = refusal(capsys, "ros", "emulator:", "--ros", "1")
    assert "no ROS master answers at http://127.0.0.1:9; start one (roscore)" in told


def test_without_any_ros_there_is_one_line(monkeypatch, capsys):
    for name in ("rospy", "rclpy"):
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setattr(find, "PLACES", ())
    assert "neither rclpy (ROS 2) nor rospy (ROS 1) can be imported" in refusal(capsys, "ros", "emulator:")


@pytest.fixture
def rclpy(monkeypatch):
    """A stand-in for rclpy and its message packages that keeps what is published."""
    sent = []

    class Message(types.SimpleNamespace):
        pass

    class Package(types.ModuleType):
        def __getattr__(self, name):
            if name.startswith("__"):
                raise AttributeError(name)
            return type(name, (Message,), {})

    def node(name):
        made = types.SimpleNamespace(destroy_node=lambda: None)
        made.create_publisher = lambda kind, topic, qos: types.SimpleNamespace(
            publish=lambda message: sent.append((topic, qos.durability, message))
        )
        made.create_subscription = lambda kind, topic, take, depth: take(Message(name=["elbow"], position=[0.5]))
        return made

    policy = types.SimpleNamespace(TRANSIENT_LOCAL="latched", VOLATILE="volatile")
    qos = types.ModuleType("rclpy.qos")
    qos.DurabilityPolicy, qos.QoSProfile = policy, lambda **options: types.SimpleNamespace(**options)
    module = types.ModuleType("rclpy")
    module.init = module.shutdown = lambda: None
    module.ok, module.create_node, module.spin_once = lambda: True, node, lambda node, timeout_sec: None
    packages = ("std", "sensor", "geometry", "tf2", "diagnostic", "taxel")
    names = {"rclpy": module, "rclpy.qos": qos, "builtin_interfaces.msg": Package("builtin_interfaces.msg")}
    names |= {f"{package}_msgs.msg": Package(f"{package}_msgs.msg") for package in packages}
    for name, each in names.items():
        monkeypatch.setitem(sys.modules, name, each)
    return sent


def test_ros_2_gets_the_same_topics_and_joint_angles_of_a_topic(rclpy, recorded, capsys):
    node = Ros2Node()
    with open_skin(f"file:{recorded.path}") as skin:
        publish_skin(skin, node, None, "/arm/joint_states", 0.5, Pace(None))
    node.close()
    assert capsys.readouterr().out.endswith("frames published\n")
    by_topic = {topic: (durability, message) for topic, durability, message in rclpy}
    assert "/joint_states" not in by_topic  # they come from a topic: nobody else's are published again
    assert by_topic["/tf_static"][0] == by_topic["/robot_description"][0] == "latched"
    durability, scan = by_topic["/taxel/palm/scan"]
    assert durability == "volatile"
    assert len(scan.raw_counts) == 121
    forearm = next(each for each in by_topic["/tf"][1].transforms if each.child_frame_id == "forearm")
    assert forearm.transform.rotation.z == pytest.approx(np.sin(0.25))
    assert by_topic["/diagnostics"][1].status[0].level == b"\0"


def test_a_ros_2_without_our_messages_says_how_to_build_them(rclpy, recorded, monkeypatch):
    monkeypatch.setitem(sys.modules, "taxel_msgs.msg", None)
    node = Ros2Node()
    told = pytest.raises(find.RosError, match="colcon build --packages-select taxel_msgs")
    with told, open_skin(f"file:{recorded.path}") as skin:
        publish_skin(skin, node, None, None, 0.5, Pace(None))
