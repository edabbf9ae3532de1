"""The ROS 2 package `taxel_ros2` with a substitute for rclpy: states of the node, topics, errors, package files."""

import ast
import importlib
import sys
import time
import types
from pathlib import Path
from xml.etree import ElementTree

import pytest

import taxel
from host.tests.ros.ros2_substitute import LifecycleNode, make_modules

PACKAGE = Path(__file__).resolve().parents[2] / "taxel_ros2"
CONFIGURE, ACTIVATE = 1, 3
"""Ids of the transitions in lifecycle_msgs/msg/Transition."""


@pytest.fixture
def make_node(monkeypatch):
    """A function that makes a node with the given parameters; the node is shut down after the test."""
    for name, module in make_modules().items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.syspath_prepend(str(PACKAGE))
    for name in [name for name in sys.modules if name.split(".")[0] == "taxel_ros2"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(LifecycleNode, "instances", [])
    skin_node = importlib.import_module("taxel_ros2.skin_node")

    def make(**values):
        node = skin_node.SkinNode()
        node.values |= values
        return node

    yield make
    for node in LifecycleNode.instances:
        node.on_shutdown(None)


def wait_for(condition) -> bool:
    """Wait up to 20 s until `condition()` is true; return whether it is true."""
    end_s = time.monotonic() + 20.0
    while not condition() and time.monotonic() < end_s:
        time.sleep(0.01)
    return condition()


def collect_topics(node) -> set[str]:
    """Return the topics on which a node has published."""
    return {topic for topic, _, _ in node.published}


def test_node_publishes_in_the_state_active_only_and_can_be_activated_again(make_node):
    node = make_node(url="emulator:?speed=real", hand="rig4", baseline_frames=5)
    assert node.change_state("configure")
    assert node.published == []
    assert node.change_state("activate")
    assert wait_for(lambda: any(topic.endswith("/scan") for topic in collect_topics(node))), node.log
    assert node.change_state("deactivate")
    count = len(node.published)
    time.sleep(0.2)
    assert len(node.published) == count
    assert node.timers == []
    assert node.change_state("activate")
    assert wait_for(lambda: len(node.published) > count)


@pytest.fixture
def ended_node(make_node, recorded):
    """A node that has published a whole recording with joint angles from a topic."""
    node = make_node(url=f"file:{recorded.path}", joint_topic="/arm/joint_states")
    sys.modules["taxel_ros2.skin_node"].Pace = lambda speed: types.SimpleNamespace(wait=lambda time_s: None)
    assert node.change_state("configure")
    assert node.change_state("activate")
    assert wait_for(lambda: "end of the recording" in node.log)
    assert wait_for(lambda: not node._thread.is_alive())
    return node


def test_node_returns_to_the_state_inactive_at_the_end_of_a_recording(ended_node):
    (check_thread,) = ended_node.timers
    check_thread()
    assert ended_node.state == "inactive"


def test_node_publishes_the_topics_of_a_recording_but_not_the_joint_states_of_another_node(ended_node):
    topics = collect_topics(ended_node)
    assert {"/tf", "/tf_static", "/robot_description", "/diagnostics", "/taxel/palm/scan"} <= topics
    assert "/joint_states" not in topics
    assert {durability for topic, durability, _ in ended_node.published if topic == "/tf_static"} == {"latched"}


def test_missing_port_prevents_the_activation_and_is_one_line_in_the_log(make_node):
    node = make_node(url="serial:///dev/ttyNONE")
    assert node.change_state("configure")
    assert not node.change_state("activate")
    (message,) = node.log
    assert "/dev/ttyNONE" in message
    assert "\n" not in message


def test_unknown_hand_prevents_the_configuration_and_is_one_line_in_the_log(make_node):
    node = make_node(hand="no_hand.toml")
    assert not node.change_state("configure")
    (message,) = node.log
    assert "no_hand.toml" in message
    assert "\n" not in message


def test_the_service_restarts_the_baseline_of_an_active_node_only(make_node):
    node = make_node(url="emulator:?speed=real", hand="rig4", baseline_frames=5)
    assert node.change_state("configure")
    restart = node.services["~/restart_baseline"]
    assert not restart(None, types.SimpleNamespace()).success
    assert node.change_state("activate")

    def count_baselines():
        return sum(topic == "/taxel/baseline" for topic, _, _ in node.published)

    assert wait_for(lambda: count_baselines() == 1), sorted(collect_topics(node))
    assert restart(None, types.SimpleNamespace()).success
    assert wait_for(lambda: count_baselines() == 2)


def test_every_parameter_has_a_description_and_is_in_the_parameter_file_in_the_same_order(make_node):
    node = make_node()
    assert all(descriptor.description for descriptor in node.declared.values())
    lines = (PACKAGE / "config" / "skin.yaml").read_text().splitlines()
    names = [line.strip().partition(":")[0] for line in lines if line.startswith("    ")]
    assert names == list(node.declared)


def test_package_xml_names_every_imported_ros_package():
    declared = {element.text for element in ElementTree.parse(PACKAGE / "package.xml").getroot().iter("exec_depend")}
    imported = set()
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [node.module] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            imported |= {name.split(".")[0] for name in names}
    imported_ros_packages = imported - set(sys.stdlib_module_names) - {"taxel", "taxel_ros2", "setuptools"}
    assert imported_ros_packages >= {"launch", "ament_index_python"}  # the imports of the launch file are found, too
    assert imported_ros_packages <= declared


def test_package_has_the_version_of_taxel_and_installs_existing_files():
    version = taxel.__version__
    assert ElementTree.parse(PACKAGE / "package.xml").getroot().findtext("version") == version
    text = (PACKAGE / "setup.py").read_text()
    assert f'version="{version}"' in text
    for name in ("launch/skin.launch.py", "config/skin.yaml", "package.xml"):
        assert name in text
        assert (PACKAGE / name).is_file()
    assert (PACKAGE / "resource" / "taxel_ros2").is_file()


def test_launch_file_configures_and_then_activates_the_node(monkeypatch):
    class Recorder(types.ModuleType):
        """A module whose functions return their own name and arguments."""

        def __getattr__(self, name):
            if name.startswith("__"):
                raise AttributeError(name)
            return lambda *arguments, **options: types.SimpleNamespace(kind=name, arguments=arguments, options=options)

    for name in (
        "launch", "launch.actions", "launch.events", "launch.substitutions", "launch_ros", "launch_ros.actions",
        "launch_ros.event_handlers", "launch_ros.events", "launch_ros.events.lifecycle", "ament_index_python",
    ):  # fmt: skip
        monkeypatch.setitem(sys.modules, name, Recorder(name))
    packages, messages = types.ModuleType("ament_index_python.packages"), types.ModuleType("lifecycle_msgs.msg")
    packages.get_package_share_directory = lambda name: f"/share/{name}"
    messages.Transition = types.SimpleNamespace(TRANSITION_CONFIGURE=CONFIGURE, TRANSITION_ACTIVATE=ACTIVATE)
    monkeypatch.setitem(sys.modules, "ament_index_python.packages", packages)
    monkeypatch.setitem(sys.modules, "lifecycle_msgs", types.ModuleType("lifecycle_msgs"))
    monkeypatch.setitem(sys.modules, "lifecycle_msgs.msg", messages)
    scope: dict[str, object] = {}
    exec(compile((PACKAGE / "launch" / "skin.launch.py").read_text(), "skin.launch.py", "exec"), scope)
    (actions,) = scope["generate_launch_description"]().arguments
    kinds = [action.kind for action in actions]
    assert kinds.index("RegisterEventHandler") < kinds.index("EmitEvent")  # the handler exists before the transition
    (handler,) = actions[kinds.index("RegisterEventHandler")].arguments
    (activate,) = handler.options["entities"]
    assert activate.options["event"].options["transition_id"] == ACTIVATE
    assert actions[-1].options["event"].options["transition_id"] == CONFIGURE
