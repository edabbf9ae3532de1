"""ROS nodes: ROS 1 with a real master, rospy and tf2; ROS 2 with a substitute for rclpy; and without any ROS."""

import contextlib
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
import types
import xmlrpc.client

import numpy as np
import pytest

from host.tests.command_line import run_refused_command
from host.tests.ros.ros2_substitute import Message, MessagePackage, make_modules
from taxel.cli.ros import publish_skin
from taxel.hand import load_hand
from taxel.hand.kinematics import build_kinematics
from taxel.hand.transforms import make_pose
from taxel.ros import ros_import
from taxel.ros.pace import Pace
from taxel.ros.ros2 import Ros2Node
from taxel.skin import open_skin

LISTENER = os.path.join(os.path.dirname(__file__), "ros1_listener.py")
PYTHON = "/usr/bin/python3"
PUBLISH = """
import sys
from taxel.cli.options import parse_joint_angles
from taxel.cli.ros import publish_skin
from taxel.ros.node import open_node
from taxel.ros.pace import Pace
from taxel.skin import open_skin
node = open_node(1)
with open_skin("file:" + sys.argv[1]) as skin:
    publish_skin(skin, node, parse_joint_angles(sys.argv[2]), None, None, Pace(3.0))
input()  # latched topics exist as long as the node
node.close()
"""
PUBLISH_ORIGINAL = """
from taxel.cli.ros import ros
ros("emulator:", "original", version=1, seconds=30.0, original_topics=True)
"""
READ_ORIGINAL = """
import json
from taxel.skin import open_skin
sizes = {}
with open_skin("ros:original?version=1") as skin:
    for frame in skin:
        sizes[frame.address] = len(frame.raw_counts)
        if len(sizes) == 17:
            break
print(json.dumps(sorted(sizes.items())))
"""
EXAMPLE = "from taxel.cli.ros import ros; ros('emulator:', version=1, seconds=1.0)"  # taxel ros "emulator:" --seconds 1


def find_missing_ros1_part():
    """Return a string that names the missing part of ROS 1, for pytest.skip; "" if nothing is missing."""
    if shutil.which("roscore") is None:
        return "no roscore here (apt-get install ros-core)"
    check = subprocess.run([PYTHON, "-c", "import rospy, tf2_ros, sensor_msgs"], capture_output=True, text=True)
    return check.stderr.strip().splitlines()[-1] if check.returncode else ""


def wait_for_core(uri: str, limit_s: float = 30.0) -> None:
    """Wait until the node /rosout, the last one that roscore starts, is registered at the ROS master `uri`.

    The master is queried, because roscore announces its nodes late if its output is a pipe.
    """
    deadline_s = time.monotonic() + limit_s
    with xmlrpc.client.ServerProxy(uri) as proxy:
        while time.monotonic() < deadline_s:
            with contextlib.suppress(OSError):
                code, _, _ = proxy.lookupNode("/test", "/rosout")
                if code == 1:
                    return
            time.sleep(0.1)
    pytest.fail(f"roscore at {uri}: no node /rosout within {limit_s:g} s")


@pytest.fixture(scope="module")
def master(tmp_path_factory):
    """Environment variables with which a program uses the roscore that this fixture starts on a free loopback port."""
    missing = find_missing_ros1_part()
    if missing:
        pytest.skip(missing)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    home = str(tmp_path_factory.mktemp("ros"))
    variables = {
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": home,
        "ROS_LOG_DIR": home,
    }
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | variables
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    core = subprocess.Popen(["roscore", "-p", str(port)], env=environment, **quiet)
    try:
        wait_for_core(variables["ROS_MASTER_URI"])
        yield environment
    finally:
        core.send_signal(signal.SIGINT)
        try:
            core.wait(timeout=10.0)
        except subprocess.TimeoutExpired:
            core.kill()


@pytest.fixture(scope="module")
def received(master, recorded):
    """The messages that a subscriber receives while the recording is played at three times its speed."""
    topics = "/taxel/palm/scan,/taxel/fingertip_index/scan"
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True, "env": master}
    angles = ",".join(map(str, np.linspace(-0.2, 0.2, 22)))
    listener = subprocess.Popen([PYTHON, LISTENER, topics, "palm_bracket,fingertip_index"], **pipes)
    publisher = subprocess.Popen([sys.executable, "-c", PUBLISH, str(recorded.path), angles], **pipes)
    try:
        assert listener.stdout.readline() == "ready\n"
        assert publisher.stdout.readline() == f"{len(recorded.frames)} frames published\n"
        output, _ = listener.communicate(timeout=20.0)
        publisher.communicate("\n", timeout=20.0)
        return json.loads(output)
    finally:
        listener.kill()
        publisher.kill()


def test_ros_1_has_a_topic_for_each_board(received, recorded):
    expected = {f"/taxel/{board.name}/scan" for board in recorded.hand.boards}
    expected |= {"/tf", "/tf_static", "/joint_states", "/taxel/activations", "/taxel/contact_cloud", "/taxel/baseline"}
    assert expected | {"/diagnostics", "/robot_description"} <= set(received["topics"])


def test_subscriber_receives_the_recorded_scans(received, recorded):
    for name in ("palm", "fingertip_index"):
        address = recorded.hand.find_board(name).address
        frames = {frame.sequence: frame.raw_counts.tolist() for frame in recorded.frames if frame.address == address}
        scans = received["scans"][f"/taxel/{name}/scan"]
        assert len(scans) > len(frames) // 2
        assert all(frames[sequence] == counts for sequence, *counts in scans)


def test_tf2_gives_the_bracket_poses_of_the_kinematics(received, recorded):
    angles = np.linspace(-0.2, 0.2, 22)
    assert np.allclose(received["joints"][-1], angles)
    poses = build_kinematics(recorded.hand).compute_sensor_poses(angles)
    for frame, (*position, w, x, y, z) in received["transforms"].items():
        board = recorded.hand.find_board(frame.removesuffix("_bracket"))
        expected = poses[recorded.hand.boards.index(board)]
        assert np.allclose(make_pose(position, [w, x, y, z]), expected, atol=1e-9)


def test_subscriber_receives_a_cloud_at_taxels_of_the_indented_board(received, recorded):
    points = np.array(received["clouds"][-2])  # the recording ends within the last poll cycle
    assert len(points) > 3
    assert (points[:, 6] > 150.0).all()  # column 6: signal in counts; 150 counts make a taxel active
    centres = build_kinematics(recorded.hand).compute_taxel_positions(np.linspace(-0.2, 0.2, 22))
    palm = centres[recorded.hand.get_slice(recorded.hand.find_board("palm").address)]
    assert np.linalg.norm(points[:, None, :3] - palm, axis=2).min(axis=1).max() < 1e-6


def test_example_of_the_help_runs(master):
    result = subprocess.run([sys.executable, "-c", EXAMPLE], env=master, capture_output=True, text=True, timeout=60.0)
    assert result.returncode == 0, result.stderr
    assert result.stdout.endswith("frames published\n")


def test_original_topics_of_ros_1_are_read_back_as_a_skin(master):
    """One process publishes the original topics of an emulated original hand, another process reads them."""
    reader = subprocess.Popen(
        [sys.executable, "-c", READ_ORIGINAL], env=master, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    publisher = subprocess.Popen([sys.executable, "-c", PUBLISH_ORIGINAL], env=master, stdout=subprocess.DEVNULL)
    try:
        output, errors = reader.communicate(timeout=40.0)
        assert reader.returncode == 0, errors
        assert json.loads(output) == [[board.address, board.kind.taxel_count] for board in load_hand("original").boards]
    finally:
        reader.kill()
        publisher.kill()
        publisher.wait()


def test_missing_master_is_one_line_whose_remedy_depends_on_whether_roscore_is_installed(monkeypatch, capsys):
    missing = find_missing_ros1_part()
    if missing:
        pytest.skip(missing)
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:9")
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(shutil, "which", lambda _: "/usr/bin/roscore")
    message = run_refused_command(capsys, "ros", "emulator:", "--ros-version", "1")
    assert "no ROS master answers at http://127.0.0.1:9; start one (roscore)" in message
    monkeypatch.setattr(shutil, "which", lambda _: None)
    message = run_refused_command(capsys, "ros", "emulator:", "--ros-version", "1")
    assert "install ROS (on Debian: apt-get install ros-core) and start roscore" in message


def test_missing_ros_is_reported_in_one_line(monkeypatch, capsys):
    for name in ("rospy", "rclpy"):
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setattr(ros_import, "SYSTEM_FOLDERS", ())
    assert "neither rclpy (ROS 2) nor rospy (ROS 1) can be imported" in run_refused_command(capsys, "ros", "emulator:")


@pytest.fixture
def rclpy(monkeypatch):
    """Replace rclpy and its message packages; returns the list of published (topic, durability, message)."""
    published = []

    def create_node(name):
        """Make a node that stores published messages, and whose subscription receives an angle of 0.5 rad at once."""
        node = types.SimpleNamespace(destroy_node=lambda: None)
        node.create_publisher = lambda message_class, topic, qos: types.SimpleNamespace(
            publish=lambda message: published.append((topic, qos.durability, message))
        )
        node.create_subscription = lambda message_class, topic, callback, depth: callback(
            Message(name=["elbow"], position=[0.5])
        )
        return node

    modules = make_modules() | {"bici_ros_sensor_reader.msg": MessagePackage("bici_ros_sensor_reader.msg")}
    module = modules["rclpy"]
    module.shutdown, module.ok = lambda: None, lambda: True
    module.create_node, module.spin_once = create_node, lambda node, timeout_sec: None
    for name, each in modules.items():
        monkeypatch.setitem(sys.modules, name, each)
    return published


@pytest.fixture
def published_by_topic(rclpy, recorded, capsys):
    """The last message of each topic, (durability, message), if the joint angles come from a topic."""
    node = Ros2Node()
    with open_skin(f"file:{recorded.path}") as skin:
        publish_skin(skin, node, None, joint_topic="/arm/joint_states", seconds=0.5, pace=Pace(None))
    node.close()
    assert capsys.readouterr().out.endswith("frames published\n")
    return {topic: (durability, message) for topic, durability, message in rclpy}


def test_ros_2_node_latches_the_static_topics_only(published_by_topic):
    latched = {topic for topic, (durability, _) in published_by_topic.items() if durability == "latched"}
    assert latched == {"/tf_static", "/robot_description"}


def test_ros_2_node_publishes_complete_scans_and_diagnostics_whose_level_is_a_byte(published_by_topic):
    _, scan = published_by_topic["/taxel/palm/scan"]
    assert len(scan.raw_counts) == 121
    assert published_by_topic["/diagnostics"][1].status[0].level == b"\0"


def test_ros_2_node_uses_joint_angles_of_a_topic_in_tf_and_does_not_publish_them_again(published_by_topic):
    assert "/joint_states" not in published_by_topic
    transforms = published_by_topic["/tf"][1].transforms
    forearm = next(transform for transform in transforms if transform.child_frame_id == "forearm")
    assert forearm.transform.rotation.z == pytest.approx(np.sin(0.5 / 2.0))  # the elbow is turned by 0.5 rad


def test_ros_2_node_publishes_only_the_original_topics(rclpy, recorded):
    node = Ros2Node()
    with open_skin(f"file:{recorded.path}") as skin:
        publish_skin(skin, node, None, None, seconds=0.5, pace=Pace(None), has_original_topics=True)
    assert {topic for topic, _, _ in rclpy} == {f"/sensor_{board.address}_readings" for board in recorded.hand.boards}
    palm = 21  # I2C address
    frame = next(frame for frame in recorded.frames if frame.address == palm)
    _, _, message = next(each for each in rclpy if each[0] == f"/sensor_{palm}_readings")
    assert message.data == frame.raw_counts.tolist()
    assert (message.sensor_num, message.timestamp) == (palm, frame.hub_time_us // 1000)


def test_ros_2_without_taxel_msgs_gives_the_build_command(rclpy, recorded, monkeypatch):
    monkeypatch.setitem(sys.modules, "taxel_msgs.msg", None)
    node = Ros2Node()
    raises = pytest.raises(ros_import.RosError, match="colcon build --packages-select taxel_msgs")
    with raises, open_skin(f"file:{recorded.path}") as skin:
        publish_skin(skin, node, None, None, seconds=0.5, pace=Pace(None))
