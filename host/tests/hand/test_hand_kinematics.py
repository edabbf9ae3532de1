"""Forward kinematics agree with the Denavit-Hartenberg table of the arm and with MuJoCo, for every taxel.

The reference is independent: the dimensions of arm and fingers are constants of this file, and the brackets are read
from the description with a TOML parser.
"""

import pickle
import tomllib
from dataclasses import replace
from functools import cache
from importlib import resources
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.hand import transforms as tf
from taxel.hand.errors import HandGeometryError, UnknownLinkError
from taxel.hand.kinematics import JointCountError, Kinematics, build_kinematics
from taxel.hand.robot import load_robot

HAND = load_hand("allegro")
KINEMATICS = build_kinematics(HAND)
ROBOT = KINEMATICS.robot
SEED = 32
VECTORS = 50
TOLERANCE = 1e-9  # metres, and entries of a rotation matrix

# UR5e: d (along z), a (along x), alpha (about x) of each joint.
DENAVIT_HARTENBERG = (
    (0.1625, 0.0, np.pi / 2),
    (0.0, -0.425, 0.0),
    (0.0, -0.3922, 0.0),
    (0.1333, 0.0, np.pi / 2),
    (0.0997, 0.0, -np.pi / 2),
    (0.0996, 0.0, 0.0),
)
PALM_ABOVE_FLANGE_M = 0.115  # 20 mm of adapter, 95 mm of palm

# Allegro V4, right: body, its position in the previous body, the joint axis. Three fingers differ only in their base.
BASES = {
    "ff": ("0 0.0435 -0.001542", "0.999048 -0.0436194 0 0"),
    "mf": ("0 0 0.0007", "1 0 0 0"),
    "rf": ("0 -0.0435 -0.001542", "0.999048 0.0436194 0 0"),
}
FINGER = (("proximal", "0 0 0.0164"), ("medial", "0 0 0.054"), ("distal", "0 0 0.0384"))
THUMB = (
    ("base", "-0.0182 0.019333 -0.045987", "0.477714 -0.521334 -0.521334 -0.477714", "-1 0 0"),
    ("proximal", "-0.027 0.005 0.0399", "1 0 0 0", "0 0 1"),
    ("medial", "0 0 0.0177", "1 0 0 0", "0 1 0"),
    ("distal", "0 0 0.0514", "1 0 0 0", "0 1 0"),
)


def sample_joint_angles(count: int = VECTORS) -> NDArray[np.float64]:
    print(f"seed {SEED}")
    return np.random.default_rng(SEED).uniform(ROBOT.lower, ROBOT.upper, (count, 22))


def denavit_hartenberg(theta: float, d: float, a: float, alpha: float) -> NDArray[np.float64]:
    """Return the transform of one joint from its Denavit-Hartenberg parameters."""
    c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]])


def compute_flange_pose(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the pose of the flange in the base frame from the six arm joint angles."""
    pose = np.eye(4)
    for theta, (d, a, alpha) in zip(angles, DENAVIT_HARTENBERG, strict=True):
        pose = pose @ denavit_hartenberg(theta, d, a, alpha)
    return pose


def compute_palm_pose(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the palm pose: its z axis is the z axis of the flange, its x axis (out of the front) the -x axis."""
    return compute_flange_pose(angles) @ np.array(
        [[-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 1, PALM_ABOVE_FLANGE_M], [0, 0, 0, 1]]
    )


def format_finger(finger: str, bodies: list[tuple[str, str, str, str]], skin: dict[str, str]) -> str:
    """Format the MJCF of a finger as nested bodies.

    bodies: name, position, quaternion and joint axis of each remaining body. skin: MJCF of the brackets by link name.
    """
    if not bodies:
        return ""
    name, position, quaternion, axis = bodies[0]
    joint = f'<joint name="{finger}_j{4 - len(bodies)}" axis="{axis}"/>'
    inertia = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    start = f'<body name="{finger}_{name}" pos="{position}" quat="{quaternion}">'
    boards = skin.get(f"{finger}_{name}", "")
    return start + inertia + joint + boards + format_finger(finger, bodies[1:], skin) + "</body>"


def join_numbers(numbers: list[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)


def format_brackets() -> dict[str, str]:
    """Format the MJCF bodies of the brackets of each link, with a site per taxel, from the text of the description."""
    text = resources.files("taxel.hand").joinpath("descriptions/allegro.toml").read_text(encoding="utf-8")
    document = tomllib.loads(text)
    bodies: dict[str, str] = {}
    for board in sorted(document["boards"], key=lambda board: board["address"]):
        rows = document["geometry"][board["kind"]]["taxels"]
        sites = "".join(
            f'<site name="{board["name"]}/{index}" pos="{join_numbers(row[:3])}" zaxis="{join_numbers(row[3:])}"/>'
            for index, row in enumerate(rows)
        )
        attributes = f'pos="{join_numbers(board["position_m"])}" quat="{join_numbers(board["quaternion_wxyz"])}"'
        body = f'<body name="{board["name"]}_board" {attributes}>{sites}</body>'
        bodies[board["link"]] = bodies.get(board["link"], "") + body
    return bodies


@cache
def load_mujoco_hand() -> Any:
    """Load the hand without the arm into MuJoCo; the palm is at the origin."""
    skin = format_brackets()
    fingers = "".join(
        format_finger(
            finger,
            [("base", *BASES[finger], "0 0 1"), *((name, position, "1 0 0 0", "0 1 0") for name, position in FINGER)],
            skin,
        )
        for finger in BASES
    )
    thumb = format_finger("th", list(THUMB), skin)
    xml = f'<body name="palm">{skin["palm"]}{fingers}{thumb}</body>'
    return mujoco.MjModel.from_xml_string(f'<mujoco><compiler angle="radian"/><worldbody>{xml}</worldbody></mujoco>')


def set_joints(model: Any, angles: NDArray[np.float64]) -> Any:
    """Return MuJoCo's data of the hand at the joint angles of arm and hand; the arm is not part of the model."""
    data = mujoco.MjData(model)
    for name, angle in zip(ROBOT.joint_names[6:], angles[6:], strict=True):
        data.qpos[model.joint(name).qposadr[0]] = angle
    mujoco.mj_kinematics(model, data)
    return data


def find_sites(model: Any) -> list[int]:
    """Return the MuJoCo site of each taxel, in the order of the hand."""
    counts = [(board.name, board.kind.taxel_count) for board in HAND.boards]
    return [model.site(f"{name}/{index}").id for name, count in counts for index in range(count)]


def test_the_joints_are_the_six_arm_joints_followed_by_the_finger_joints() -> None:
    fingers = tuple(f"{finger}_j{joint}" for finger in ("ff", "mf", "rf", "th") for joint in range(4))
    assert ROBOT.joint_names[6:] == fingers
    assert len(ROBOT.joint_names) == 22


def test_the_flange_agrees_with_the_denavit_hartenberg_table() -> None:
    q = sample_joint_angles()
    poses = KINEMATICS.compute_link_poses(q)
    expected = np.stack([compute_flange_pose(angles[:6]) for angles in q])
    np.testing.assert_allclose(poses[:, ROBOT.get_link_index("flange")], expected, rtol=0, atol=TOLERANCE)


def test_the_palm_is_mounted_on_the_flange_with_the_fingers_away_from_it() -> None:
    q = sample_joint_angles()
    expected = np.stack([compute_palm_pose(angles[:6]) for angles in q])
    np.testing.assert_allclose(
        KINEMATICS.compute_link_poses(q)[:, ROBOT.get_link_index("palm")], expected, rtol=0, atol=TOLERANCE
    )


def test_every_link_pose_of_the_hand_agrees_with_mujoco() -> None:
    model, q = load_mujoco_hand(), sample_joint_angles()
    links = [link for link in ROBOT.link_names if link[:3] in ("ff_", "mf_", "rf_", "th_")]
    assert len(links) == 16
    bodies = [model.body(link).id for link in links]
    poses = KINEMATICS.compute_link_poses(q)[:, [ROBOT.get_link_index(link) for link in links]]
    for index, angles in enumerate(q):
        data, palm = set_joints(model, angles), compute_palm_pose(angles[:6])
        np.testing.assert_allclose(poses[index, :, :3, 3], tf.apply(palm, data.xpos[bodies]), rtol=0, atol=TOLERANCE)
        rotation = palm[:3, :3] @ data.xmat[bodies].reshape(-1, 3, 3)
        np.testing.assert_allclose(poses[index, :, :3, :3], rotation, rtol=0, atol=TOLERANCE)


def test_every_taxel_position_and_normal_agrees_with_mujoco() -> None:
    model, q = load_mujoco_hand(), sample_joint_angles(10)
    sites = find_sites(model)
    assert len(sites) == HAND.n_taxels == 1073
    positions, normals = KINEMATICS.compute_taxel_positions(q), KINEMATICS.compute_taxel_normals(q)
    for index, angles in enumerate(q):
        data, palm = set_joints(model, angles), compute_palm_pose(angles[:6])
        np.testing.assert_allclose(positions[index], tf.apply(palm, data.site_xpos[sites]), rtol=0, atol=TOLERANCE)
        outward = data.site_xmat[sites].reshape(-1, 3, 3)[..., 2]
        np.testing.assert_allclose(normals[index], tf.rotate(palm, outward), rtol=0, atol=TOLERANCE)


def test_every_bracket_pose_agrees_with_mujoco() -> None:
    model = load_mujoco_hand()
    angles = sample_joint_angles(1)[0]
    data, palm = set_joints(model, angles), compute_palm_pose(angles[:6])
    poses = KINEMATICS.compute_sensor_poses(angles)
    for pose, board in zip(poses, HAND.boards, strict=True):
        body = data.body(f"{board.name}_board")
        np.testing.assert_allclose(pose[:3, 3], tf.apply(palm, body.xpos), rtol=0, atol=TOLERANCE)
        np.testing.assert_allclose(pose[:3, :3], palm[:3, :3] @ body.xmat.reshape(3, 3), rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize(
    "name", ["compute_link_poses", "compute_sensor_poses", "compute_taxel_positions", "compute_taxel_normals"]
)
def test_a_batch_of_times_equals_the_single_times(name: str) -> None:
    function = getattr(KINEMATICS, name)
    q = sample_joint_angles(12)
    expected = np.stack([function(angles) for angles in q])
    # Matrix products of other batch sizes may round differently.
    np.testing.assert_allclose(function(q), expected, rtol=0, atol=1e-15)
    np.testing.assert_allclose(
        function(q.reshape(3, 4, 22)), expected.reshape(3, 4, *expected.shape[1:]), rtol=0, atol=1e-15
    )


def test_an_empty_batch_gives_an_empty_array() -> None:
    assert KINEMATICS.compute_link_poses(np.empty((0, 22))).shape == (0, len(ROBOT.link_names), 4, 4)
    assert KINEMATICS.compute_taxel_positions(np.empty((0, 22))).shape == (0, 1073, 3)


def test_joint_angles_can_be_a_list_of_integers() -> None:
    np.testing.assert_array_equal(KINEMATICS.compute_link_poses([0] * 22), KINEMATICS.compute_link_poses(np.zeros(22)))


def test_every_pose_is_rigid() -> None:
    tf.check_rigid(KINEMATICS.compute_link_poses(sample_joint_angles()))
    tf.check_rigid(KINEMATICS.compute_sensor_poses(sample_joint_angles()))


@pytest.mark.parametrize(("angles", "joint_count"), [(np.zeros(16), 16), (np.zeros((22, 5)), 5), (0.0, 0), ([], 0)])
def test_another_number_of_joints_raises_a_one_line_error(angles: Any, joint_count: int) -> None:
    with pytest.raises(JointCountError) as caught:
        KINEMATICS.compute_taxel_positions(angles)
    line = f"robot 'ur5e_allegro': expected 22 joint angles on the last axis, found {joint_count}"
    assert str(caught.value) == line
    assert isinstance(caught.value, TaxelError)
    assert str(pickle.loads(pickle.dumps(caught.value))) == line


def test_the_error_of_a_hand_on_another_robot_lists_the_links() -> None:
    with pytest.raises(UnknownLinkError, match="robot 'plate' has no link 'palm'; expected one of world, plate"):
        Kinematics(load_robot("plate"), HAND)


def test_taxel_positions_require_a_hand_but_link_poses_do_not() -> None:
    kinematics = Kinematics(ROBOT)
    np.testing.assert_array_equal(
        kinematics.compute_link_poses(np.zeros(22)), KINEMATICS.compute_link_poses(np.zeros(22))
    )
    with pytest.raises(ValueError, match="expected a hand, found None"):
        kinematics.compute_taxel_positions(np.zeros(22))


def test_the_index_finger_flexes_towards_the_front_of_the_palm() -> None:
    straight, bent = np.zeros(22), np.zeros(22)
    bent[ROBOT.joint_names.index("ff_j1")] = 0.5  # rad
    palm = tf.inverse(KINEMATICS.compute_link_poses(straight)[ROBOT.get_link_index("palm")])
    tips = [
        tf.apply(palm, KINEMATICS.compute_link_poses(q)[ROBOT.get_link_index("ff_distal")][:3, 3])
        for q in (straight, bent)
    ]
    assert tips[1][0] > tips[0][0] + 0.02  # out of the front
    assert tips[1][2] < tips[0][2]
    assert tips[0][1] > 0.03  # the index finger is on the thumb's side


def test_the_hinge_of_flat8_lifts_its_distal_edge() -> None:
    hand = load_hand("flat8")
    kinematics = build_kinematics(hand)
    lowered, raised = kinematics.compute_taxel_positions([[0.0], [np.pi / 2]])
    np.testing.assert_allclose(lowered, hand.position + np.array([0.0, 0.0, 0.1]), rtol=0, atol=TOLERANCE)
    # The hinge is 0.1 m above the origin. A quarter turn maps x to z and z to -x.
    x, y, z = hand.position.T
    np.testing.assert_allclose(raised, np.column_stack([-z, y, x + 0.1]), rtol=0, atol=TOLERANCE)


def test_a_hand_without_a_robot_has_no_kinematics() -> None:
    with pytest.raises(HandGeometryError, match="'allegro'"):
        build_kinematics(replace(HAND, robot=None))


def test_neighbours_on_a_line_are_one_pitch_apart_along_the_sheet() -> None:
    """The sheet is flat between neighbours with equal normals; checked in world coordinates."""
    q = sample_joint_angles(1)[0]
    positions, normals = KINEMATICS.compute_taxel_positions(q), KINEMATICS.compute_taxel_normals(q)
    checked = 0
    for board in HAND.boards:
        board_taxels = HAND.get_slice(board.address)
        index_of = {key: board_taxels.start + i for i, key in enumerate(zip(board.kind.tx, board.kind.rx, strict=True))}
        for (tx, rx), index in index_of.items():
            for neighbour in (index_of.get((tx + 1, rx)), index_of.get((tx, rx + 1))):
                if neighbour is not None and normals[index] @ normals[neighbour] > 1 - 1e-9:
                    distance = np.linalg.norm(positions[neighbour] - positions[index])
                    assert distance == pytest.approx(HAND.pitch_m, abs=2e-6), (board.name, tx, rx)
                    checked += 1
    assert checked > 1000
