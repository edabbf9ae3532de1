"""MuJoCo and Pinocchio read the exported URDF and compute the same link poses."""

import importlib
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.hand import load_hand
from taxel.hand import transforms as tf
from taxel.hand.errors import HandGeometryError, UnknownLinkError
from taxel.hand.kinematics import Kinematics
from taxel.hand.robot import Joint, Robot, Shape, load_robot
from taxel.hand.urdf import DEFAULT_RADIUS_M, DENSITY_KG_M3, format_urdf

ROBOT = load_robot("ur5e_allegro")
HAND = load_hand("allegro")
SEED = 31
VECTORS = 200
TOLERANCE = 1e-9  # metres and radians


def parse_urdf(robot: Robot = ROBOT, hand: Any = None) -> ET.Element:
    return ET.fromstring(format_urdf(robot, hand))


def sample_joint_angles(robot: Robot = ROBOT) -> NDArray[np.float64]:
    print(f"seed {SEED}")
    return np.random.default_rng(SEED).uniform(robot.lower, robot.upper, (VECTORS, len(robot.joint_names)))


def assert_same_poses(result: NDArray[np.float64], expected: NDArray[np.float64]) -> None:
    """Check that poses agree within `TOLERANCE` in position and rotation angle."""
    np.testing.assert_allclose(result[..., :3, 3], expected[..., :3, 3], rtol=0, atol=TOLERANCE)
    rotation = tf.to_rotation_vector(tf.inverse(expected) @ result)
    assert np.linalg.norm(rotation, axis=-1).max() < TOLERANCE


def compute_mujoco_poses(text: str, names: list[str], joint_names: tuple[str, ...], q: NDArray[np.float64]) -> Any:
    """Compute the link poses of a URDF with MuJoCo, f64[T, links, 4, 4]."""
    spec = mujoco.MjSpec.from_string(text)
    spec.compiler.fusestatic = False  # otherwise MuJoCo merges fixed links into their parents
    model = spec.compile()
    data = mujoco.MjData(model)
    bodies = [model.body(name).id for name in names]
    addresses = [model.joint(name).qposadr[0] for name in joint_names]
    poses = np.zeros((len(q), len(names), 4, 4))
    poses[..., 3, 3] = 1.0
    for index, angles in enumerate(q):
        data.qpos[addresses] = angles
        mujoco.mj_kinematics(model, data)
        poses[index, :, :3, :3] = data.xmat[bodies].reshape(-1, 3, 3)
        poses[index, :, :3, 3] = data.xpos[bodies]
    return poses


def make_link(*shapes: Shape) -> Robot:
    """Make a robot whose only moving link, "part", has the given shapes."""
    joint = Joint("j", "root", "part", np.eye(4), np.array([0.0, 0.0, 1.0]), -1.0, 1.0)
    return Robot("one", "A link", "root", (joint,), shapes)


def test_every_link_and_joint_occurs_once_with_parents_first() -> None:
    root = parse_urdf()
    assert root.tag == "robot"
    assert root.get("name") == "ur5e_allegro"
    assert [link.get("name") for link in root.findall("link")] == list(ROBOT.link_names)
    assert [joint.get("name") for joint in root.findall("joint")] == [joint.name for joint in ROBOT.joints]
    assert len(root.findall("joint[@type='revolute']")) == 22
    assert len(root.findall("joint[@type='fixed']")) == len(ROBOT.joints) - 22


def test_a_revolute_joint_has_an_axis_and_all_limits() -> None:
    for element, joint in zip(parse_urdf().findall("joint"), ROBOT.joints, strict=True):
        limit, axis = element.find("limit"), element.find("axis")
        if joint.axis is None:
            assert limit is None
            assert axis is None
            continue
        assert limit is not None
        assert axis is not None
        assert [float(value) for value in axis.attrib["xyz"].split()] == joint.axis.tolist()
        assert (float(limit.attrib["lower"]), float(limit.attrib["upper"])) == (joint.lower, joint.upper)
        assert float(limit.attrib["effort"]) > 0
        assert float(limit.attrib["velocity"]) > 0


def test_a_capsule_is_a_cylinder_and_two_spheres_in_visual_and_collision_geometry() -> None:
    boxes = sum(shape.type == "box" for shape in ROBOT.shapes)
    capsules = len(ROBOT.shapes) - boxes
    for role in ("visual", "collision"):
        root = parse_urdf()
        assert len(root.findall(f"link/{role}/geometry/box")) == boxes
        assert len(root.findall(f"link/{role}/geometry/cylinder")) == capsules
        assert len(root.findall(f"link/{role}/geometry/sphere")) == 2 * capsules


def test_the_spheres_of_a_capsule_are_at_the_ends_of_its_cylinder() -> None:
    # The z axis of the capsule is the x axis of the link.
    rotated = tf.make_pose([0.1, 0.2, 0.3], [np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])
    link = parse_urdf(make_link(Shape("part", "capsule", (0.01, 0.04), rotated))).find("link[@name='part']")
    assert link is not None
    centres = [
        [float(value) for value in geometry.find("origin").attrib["xyz"].split()]  # type: ignore[union-attr]
        for geometry in link.findall("collision")
    ]
    np.testing.assert_allclose(centres, [[0.1, 0.2, 0.3], [0.14, 0.2, 0.3], [0.06, 0.2, 0.3]], atol=1e-15)


@pytest.mark.parametrize("kind", ["box", "capsule"])
def test_mass_and_inertia_agree_with_mujoco(kind: str) -> None:
    size = (0.01, 0.02, 0.05) if kind == "box" else (0.012, 0.03)
    origin = tf.make_pose([0.01, -0.02, 0.03], [0.9, 0.1, -0.3, 0.2])
    w, x, y, z = tf.to_quaternion(origin)
    geom = f'<geom type="{kind}" size="{" ".join(map(str, size))}" density="{DENSITY_KG_M3}" pos="0.01 -0.02 0.03"'
    expected = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body><joint/>{geom} quat="{w} {x} {y} {z}"/></body></worldbody></mujoco>'
    )
    result = mujoco.MjModel.from_xml_string(format_urdf(make_link(Shape("part", kind, size, origin))))
    np.testing.assert_allclose(result.body_mass[-1], expected.body_mass[-1], rtol=1e-12)
    np.testing.assert_allclose(result.body_ipos[-1], expected.body_ipos[-1], rtol=1e-12)
    np.testing.assert_allclose(np.sort(result.body_inertia[-1]), np.sort(expected.body_inertia[-1]), rtol=1e-9)


def test_the_inertia_of_two_half_boxes_equals_the_inertia_of_the_box() -> None:
    half_poses = [tf.make_pose([0.0, 0.0, z], [1.0, 0.0, 0.0, 0.0]) for z in (0.01, 0.03)]
    halves = [Shape("part", "box", (0.01, 0.02, 0.01), end) for end in half_poses]
    box_pose = tf.make_pose([0.0, 0.0, 0.02], [1.0, 0.0, 0.0, 0.0])
    box = parse_urdf(make_link(Shape("part", "box", (0.01, 0.02, 0.02), box_pose)))
    for tag in ("origin", "mass", "inertia"):
        result = parse_urdf(make_link(*halves)).find(f"link/inertial/{tag}")
        expected = box.find(f"link/inertial/{tag}")
        assert result is not None
        assert expected is not None
        for key in expected.attrib:
            numbers = [[float(value) for value in e.attrib[key].split()] for e in (result, expected)]
            np.testing.assert_allclose(*numbers, rtol=1e-12, atol=1e-18)


def test_a_moving_link_without_shapes_has_the_mass_of_a_small_sphere() -> None:
    robot = load_robot("ur5e_allegro")
    shapes = tuple(shape for shape in robot.shapes if shape.link_name not in ("forearm", "flange"))
    root = parse_urdf(replace(robot, shapes=shapes))
    mass = root.find("link[@name='forearm']/inertial/mass")
    assert mass is not None
    volume_m3 = 4 / 3 * np.pi * DEFAULT_RADIUS_M**3
    assert float(mass.attrib["value"]) == pytest.approx(DENSITY_KG_M3 * volume_m3)
    assert root.find("link[@name='flange']/inertial") is None


def test_a_bracket_is_a_link_with_a_fixed_joint_to_its_carrier() -> None:
    root = parse_urdf(hand=HAND)
    links = [link.get("name") for link in root.findall("link")]
    assert links[len(ROBOT.link_names) :] == ["palm_bracket", *(board.name for board in HAND.boards[1:])]
    joint = root.find("joint[child][@name='fingertip_index']")
    assert joint is not None
    assert joint.get("type") == "fixed"
    assert joint.find("parent").get("link") == "ff_distal"  # type: ignore[union-attr]


def test_link_and_joint_names_are_unique_if_a_board_has_the_suffixed_name() -> None:
    boards = (*HAND.boards[:1], replace(HAND.boards[1], name="palm_bracket"))
    root = parse_urdf(hand=replace(HAND, boards=boards))
    for tag in ("link", "joint"):
        names = [element.get("name") for element in root.findall(tag)]
        assert len(set(names)) == len(names)


@pytest.mark.parametrize(("robot", "hand"), [("ur5e_allegro", "allegro"), ("plate", "flat8")])
def test_link_poses_agree_with_mujoco(robot: str, hand: str) -> None:
    model, skin = load_robot(robot), load_hand(hand)
    q = sample_joint_angles(model)
    kinematics = Kinematics(model, skin)
    expected = np.concatenate([kinematics.compute_link_poses(q), kinematics.compute_sensor_poses(q)], axis=1)
    text = format_urdf(model, skin)
    names = [link.attrib["name"] for link in ET.fromstring(text).findall("link")]
    assert_same_poses(compute_mujoco_poses(text, names, model.joint_names, q), expected)


def test_mujoco_reads_the_joint_limits() -> None:
    model = mujoco.MjModel.from_xml_string(format_urdf(ROBOT))
    ranges = [model.joint(name).range for name in ROBOT.joint_names]
    np.testing.assert_allclose(ranges, np.column_stack([ROBOT.lower, ROBOT.upper]), rtol=0, atol=1e-12)


def test_link_poses_agree_with_pinocchio() -> None:
    pytest.importorskip("pinocchio")
    pinocchio: Any = importlib.import_module("pinocchio")
    model = pinocchio.buildModelFromXML(format_urdf(ROBOT, HAND))
    data = model.createData()
    q = sample_joint_angles()
    kinematics = Kinematics(ROBOT, HAND)
    expected = np.concatenate([kinematics.compute_link_poses(q), kinematics.compute_sensor_poses(q)], axis=1)
    names = [*ROBOT.link_names, "palm_bracket", *(board.name for board in HAND.boards[1:])]
    frames = [model.getFrameId(name, pinocchio.FrameType.BODY) for name in names]
    indices = [model.joints[model.getJointId(name)].idx_q for name in ROBOT.joint_names]
    result = np.empty_like(expected)
    for index, angles in enumerate(q):
        values = np.empty(model.nq)
        values[indices] = angles
        pinocchio.framesForwardKinematics(model, data, values)
        result[index] = [data.oMf[frame].homogeneous for frame in frames]
    assert_same_poses(result, expected)


def test_special_characters_in_names_are_escaped() -> None:
    robot = replace(ROBOT, name='a<b> & "c"')
    assert parse_urdf(robot).get("name") == 'a<b> & "c"'


def test_the_text_is_deterministic_with_one_element_per_line() -> None:
    text = format_urdf(ROBOT, HAND)
    assert text == format_urdf(load_robot("ur5e_allegro"), load_hand("allegro"))
    assert text.startswith('<?xml version="1.0"?>\n<robot name="ur5e_allegro">\n  <link name="world" />\n')
    assert all(line.count("<") in (1, 2) for line in text.splitlines())
    assert re.search(r'-0\.0[ "]', text) is None


def test_a_hand_without_bracket_poses_is_rejected() -> None:
    boards = tuple(replace(board, link_name=None, pose=None) for board in HAND.boards)
    with pytest.raises(HandGeometryError, match="'allegro': the description contains no taxel positions"):
        format_urdf(ROBOT, replace(HAND, boards=boards))


def test_a_hand_of_another_robot_is_rejected() -> None:
    with pytest.raises(UnknownLinkError, match="'plate' has no link 'palm'"):
        format_urdf(load_robot("plate"), HAND)
