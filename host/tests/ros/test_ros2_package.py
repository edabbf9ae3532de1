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
STANDARD = {"launch", "ament_index_python"}


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
    """True if the condition is fulfilled within 20 s."""
    end_s = time.monotonic() + 20.0
    while not condition() and time.monotonic() < end_s:
        time.sleep(0.01)
    return condition()


def collect_topics(node) -> set[str]:
    return {topic for topic, _, _ in node.published}


def test_active_node_publishes_and_inactive_node_does_not(make_node, recorded):
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
    assert node.change_state("activate")  # the port is opened again
    assert wait_for(lambda: len(node.published) > count)


def test_recording_ends_in_the_state_inactive_with_all_topics(make_node, recorded):
    node = make_node(url=f"file:{recorded.path}", joint_topic="/arm/joint_states")
    sys.modules["taxel_ros2.skin_node"].Pace = lambda speed: types.SimpleNamespace(wait=lambda time_s: None)
    assert node.change_state("configure")
    assert node.change_state("activate")
    assert wait_for(lambda: "end of the recording" in node.log)
    assert wait_for(lambda: not node._thread.is_alive())
    node.timers[0]()
    assert node.state == "inactive"
    topics = collect_topics(node)
    assert {"/tf", "/tf_static", "/robot_description", "/diagnostics", "/taxel/palm/scan"} <= topics
    assert "/joint_states" not in topics  # joint states of another node are not published again
    assert {durability for topic, durability, _ in node.published if topic == "/tf_static"} == {"latched"}


def test_missing_port_and_unknown_hand_are_one_line_in_the_log(make_node):
    node = make_node(url="serial:///dev/ttyNONE")
    assert node.change_state("configure")
    assert not node.change_state("activate")
    assert not make_node(hand="no_hand.toml").change_state("configure")
    for message in (*LifecycleNode.instances[0].log, *LifecycleNode.instances[1].log):
        assert len(message.splitlines()) == 1
    assert "/dev/ttyNONE" in node.log[0]


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


def test_every_parameter_has_a_description_and_is_in_the_parameter_file(make_node):
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
    ros = imported - set(sys.stdlib_module_names) - {"taxel", "taxel_ros2", "setuptools"}
    assert ros <= declared
    assert declared >= STANDARD


def test_versions_and_installed_files_agree_with_the_repository():
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
    messages.Transition = types.SimpleNamespace(TRANSITION_CONFIGURE=1, TRANSITION_ACTIVATE=3)
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
    assert activate.options["event"].options["transition_id"] == 3
    assert actions[-1].options["event"].options["transition_id"] == 1
