"""Forward kinematics agree with the arm's own Denavit-Hartenberg table and with MuJoCo, down to every taxel.

Neither side of the comparison reads what the other reads: the figures of arm and fingers are written here by hand, and
the brackets are taken from the description's text by a TOML parser alone.
"""

from __future__ import annotations

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
EXACT = 1e-9  # metres; of a rotation's entries: none

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

# Allegro V4, right: body, its place in the one before, the joint's axis. Three fingers differ only in their base.
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


def joint_vectors(count: int = VECTORS) -> NDArray[np.float64]:
    print(f"seed {SEED}")
    return np.random.default_rng(SEED).uniform(ROBOT.lower, ROBOT.upper, (count, 22))


def denavit_hartenberg(theta: float, d: float, a: float, alpha: float) -> NDArray[np.float64]:
    c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]])


def arm_flange(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    pose = np.eye(4)
    for theta, (d, a, alpha) in zip(angles, DENAVIT_HARTENBERG, strict=True):
        pose = pose @ denavit_hartenberg(theta, d, a, alpha)
    return pose


def palm_in_world(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """The palm's z is the flange's; its x, out of the front, is the flange's -x."""
    return arm_flange(angles) @ np.array([[-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 1, PALM_ABOVE_FLANGE_M], [0, 0, 0, 1]])


def chain(finger: str, bodies: list[tuple[str, str, str, str]], skin: dict[str, str]) -> str:
    if not bodies:
        return ""
    name, position, quaternion, axis = bodies[0]
    joint = f'<joint name="{finger}_j{4 - len(bodies)}" axis="{axis}"/>'
    inertia = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    place = f'<body name="{finger}_{name}" pos="{position}" quat="{quaternion}">'
    boards = skin.get(f"{finger}_{name}", "")
    return place + inertia + joint + boards + chain(finger, bodies[1:], skin) + "</body>"


def spaced(numbers: list[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)


def skin_bodies() -> dict[str, str]:
    """For each link the bodies of its brackets, with a site for every taxel, from the description's text."""
    text = resources.files("taxel.hand").joinpath("descriptions/allegro.toml").read_text(encoding="utf-8")
    document = tomllib.loads(text)
    bodies: dict[str, str] = {}
    for board in sorted(document["boards"], key=lambda board: board["address"]):
        rows = document["geometry"][board["kind"]]["taxels"]
        sites = "".join(
            f'<site name="{board["name"]}/{index}" pos="{spaced(row[:3])}" zaxis="{spaced(row[3:])}"/>'
            for index, row in enumerate(rows)
        )
        place = f'pos="{spaced(board["position_m"])}" quat="{spaced(board["quaternion_wxyz"])}"'
        body = f'<body name="{board["name"]}_board" {place}>{sites}</body>'
        bodies[board["link"]] = bodies.get(board["link"], "") + body
    return bodies


@cache
def mujoco_hand() -> Any:
    """The hand alone: the palm is at the world's origin."""
    skin = skin_bodies()
    fingers = "".join(
        chain(
            finger,
            [("base", *BASES[finger], "0 0 1"), *((name, place, "1 0 0 0", "0 1 0") for name, place in FINGER)],
            skin,
        )
        for finger in BASES
    )
    thumb = chain("th", list(THUMB), skin)
    xml = f'<body name="palm">{skin["palm"]}{fingers}{thumb}</body>'
    return mujoco.MjModel.from_xml_string(f'<mujoco><compiler angle="radian"/><worldbody>{xml}</worldbody></mujoco>')


def moved(model: Any, angles: NDArray[np.float64]) -> Any:
    data = mujoco.MjData(model)
    for name, angle in zip(ROBOT.joint_names[6:], angles[6:], strict=True):
        data.qpos[model.joint(name).qposadr[0]] = angle
    mujoco.mj_kinematics(model, data)
    return data


def site_ids(model: Any) -> list[int]:
    counts = [(board.name, board.kind.taxel_count) for board in HAND.boards]
    return [model.site(f"{name}/{index}").id for name, count in counts for index in range(count)]


def test_the_joints_are_the_arms_six_and_then_the_fingers() -> None:
    fingers = tuple(f"{finger}_j{joint}" for finger in ("ff", "mf", "rf", "th") for joint in range(4))
    assert ROBOT.joint_names[6:] == fingers
    assert len(ROBOT.joint_names) == 22


def test_the_arm_follows_its_denavit_hartenberg_table() -> None:
    q = joint_vectors()
    poses = KINEMATICS.compute_link_poses(q)
    expected = np.stack([arm_flange(angles[:6]) for angles in q])
    np.testing.assert_allclose(poses[:, ROBOT.get_link_index("flange")], expected, rtol=0, atol=EXACT)


def test_the_palm_sits_on_the_flange_with_its_fingers_pointing_away() -> None:
    q = joint_vectors()
    expected = np.stack([palm_in_world(angles[:6]) for angles in q])
    np.testing.assert_allclose(
        KINEMATICS.compute_link_poses(q)[:, ROBOT.get_link_index("palm")], expected, rtol=0, atol=EXACT
    )


def test_every_link_of_the_hand_is_where_mujoco_puts_it() -> None:
    model, q = mujoco_hand(), joint_vectors()
    links = [link for link in ROBOT.links if link[:3] in ("ff_", "mf_", "rf_", "th_")]
    assert len(links) == 16
    bodies = [model.body(link).id for link in links]
    found = KINEMATICS.compute_link_poses(q)[:, [ROBOT.get_link_index(link) for link in links]]
    for index, angles in enumerate(q):
        data, palm = moved(model, angles), palm_in_world(angles[:6])
        np.testing.assert_allclose(found[index, :, :3, 3], tf.apply(palm, data.xpos[bodies]), rtol=0, atol=EXACT)
        turned = palm[:3, :3] @ data.xmat[bodies].reshape(-1, 3, 3)
        np.testing.assert_allclose(found[index, :, :3, :3], turned, rtol=0, atol=EXACT)


def test_every_taxel_is_where_mujoco_puts_its_site_and_looks_the_same_way() -> None:
    model, q = mujoco_hand(), joint_vectors(10)
    sites = site_ids(model)
    assert len(sites) == HAND.n_taxels == 1073
    positions, normals = KINEMATICS.compute_taxel_positions(q), KINEMATICS.compute_taxel_normals(q)
    for index, angles in enumerate(q):
        data, palm = moved(model, angles), palm_in_world(angles[:6])
        np.testing.assert_allclose(positions[index], tf.apply(palm, data.site_xpos[sites]), rtol=0, atol=EXACT)
        outward = data.site_xmat[sites].reshape(-1, 3, 3)[..., 2]
        np.testing.assert_allclose(normals[index], tf.rotate(palm, outward), rtol=0, atol=EXACT)


def test_every_bracket_is_where_mujoco_puts_its_body() -> None:
    model = mujoco_hand()
    angles = joint_vectors(1)[0]
    data, palm = moved(model, angles), palm_in_world(angles[:6])
    found = KINEMATICS.compute_sensor_poses(angles)
    for pose, board in zip(found, HAND.boards, strict=True):
        body = data.body(f"{board.name}_board")
        np.testing.assert_allclose(pose[:3, 3], tf.apply(palm, body.xpos), rtol=0, atol=EXACT)
        np.testing.assert_allclose(pose[:3, :3], palm[:3, :3] @ body.xmat.reshape(3, 3), rtol=0, atol=EXACT)


@pytest.mark.parametrize("name", ["compute_link_poses", "compute_sensor_poses", "compute_taxel_positions", "compute_taxel_normals"])
def test_many_times_at_once_are_the_times_one_by_one(name: str) -> None:
    function = getattr(KINEMATICS, name)
    q = joint_vectors(12)
    one_by_one = np.stack([function(angles) for angles in q])
    # Products of other batch sizes may round differently.
    np.testing.assert_allclose(function(q), one_by_one, rtol=0, atol=1e-15)
    np.testing.assert_allclose(
        function(q.reshape(3, 4, 22)), one_by_one.reshape(3, 4, *one_by_one.shape[1:]), rtol=0, atol=1e-15
    )


def test_no_times_give_no_poses() -> None:
    assert KINEMATICS.compute_link_poses(np.empty((0, 22))).shape == (0, len(ROBOT.links), 4, 4)
    assert KINEMATICS.compute_taxel_positions(np.empty((0, 22))).shape == (0, 1073, 3)


def test_joint_angles_may_be_a_list_of_integers() -> None:
    np.testing.assert_array_equal(KINEMATICS.compute_link_poses([0] * 22), KINEMATICS.compute_link_poses(np.zeros(22)))


def test_every_pose_is_rigid() -> None:
    tf.check_rigid(KINEMATICS.compute_link_poses(joint_vectors()))
    tf.check_rigid(KINEMATICS.compute_sensor_poses(joint_vectors()))


@pytest.mark.parametrize(("angles", "found"), [(np.zeros(16), 16), (np.zeros((22, 5)), 5), (0.0, 0), ([], 0)])
def test_another_number_of_joints_is_refused_with_one_line(angles: Any, found: int) -> None:
    with pytest.raises(JointCountError) as caught:
        KINEMATICS.compute_taxel_positions(angles)
    line = f"robot 'ur5e_allegro': expected 22 joint angles on the last axis, found {found}"
    assert str(caught.value) == line
    assert isinstance(caught.value, TaxelError)
    assert str(pickle.loads(pickle.dumps(caught.value))) == line


def test_a_hand_on_another_robot_is_refused_with_the_links_that_it_has() -> None:
    with pytest.raises(UnknownLinkError, match="robot 'plate' has no link 'palm'; it has world, plate"):
        Kinematics(load_robot("plate"), HAND)


def test_links_need_no_hand_but_taxels_do() -> None:
    bare = Kinematics(ROBOT)
    np.testing.assert_array_equal(bare.compute_link_poses(np.zeros(22)), KINEMATICS.compute_link_poses(np.zeros(22)))
    with pytest.raises(ValueError, match="without a hand"):
        bare.compute_taxel_positions(np.zeros(22))


def test_the_index_finger_flexes_towards_the_palms_front() -> None:
    straight, bent = np.zeros(22), np.zeros(22)
    bent[7] = 0.5
    palm = tf.inverse(KINEMATICS.compute_link_poses(straight)[ROBOT.get_link_index("palm")])
    tips = [
        tf.apply(palm, KINEMATICS.compute_link_poses(q)[ROBOT.get_link_index("ff_distal")][:3, 3])
        for q in (straight, bent)
    ]
    assert tips[1][0] > tips[0][0] + 0.02  # out of the front
    assert tips[1][2] < tips[0][2]
    assert tips[0][1] > 0.03  # the index finger is on the thumb's side


def test_flat8_lifts_its_distal_edge_on_the_hinge() -> None:
    hand = load_hand("flat8")
    kinematics = build_kinematics(hand)
    down, up = kinematics.compute_taxel_positions([[0.0], [np.pi / 2]])
    np.testing.assert_allclose(down, hand.position + np.array([0.0, 0.0, 0.1]), rtol=0, atol=EXACT)
    x, y, z = hand.position.T
    np.testing.assert_allclose(up, np.column_stack([-z, y, x + 0.1]), rtol=0, atol=EXACT)


def test_a_hand_without_a_robot_has_no_kinematics() -> None:
    with pytest.raises(HandGeometryError, match="'allegro'"):
        build_kinematics(replace(HAND, robot=None))


def test_neighbours_on_a_line_are_one_pitch_apart_along_the_sheet() -> None:
    """Where both look the same way the sheet is flat between them; the world's figures, not the bracket's."""
    q = joint_vectors(1)[0]
    positions, normals = KINEMATICS.compute_taxel_positions(q), KINEMATICS.compute_taxel_normals(q)
    checked = 0
    for board in HAND.boards:
        part = HAND.get_slice(board.address)
        place = {key: part.start + i for i, key in enumerate(zip(board.kind.tx, board.kind.rx, strict=True))}
        for (tx, rx), index in place.items():
            for neighbour in (place.get((tx + 1, rx)), place.get((tx, rx + 1))):
                if neighbour is not None and normals[index] @ normals[neighbour] > 1 - 1e-9:
                    distance = np.linalg.norm(positions[neighbour] - positions[index])
                    assert distance == pytest.approx(HAND.pitch_m, abs=2e-6), (board.name, tx, rx)
                    checked += 1
    assert checked > 1000
