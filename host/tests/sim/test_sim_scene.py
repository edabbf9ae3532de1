"""MuJoCo scenes of a hand and an object: bodies, collision solids, and contacts of the hand with itself."""

import mujoco
import numpy as np
import pytest

from taxel.grasp.objects import ASSUMED_SIZES, GraspObject, compute_mass_properties, make_thesis_objects
from taxel.grasp.shapes import ConvexPolytope
from taxel.hand import load_hand
from taxel.hand.errors import UnknownLinkError
from taxel.hand.kinematics import build_kinematics
from taxel.hand.sheet import build_sheet
from taxel.hand.transforms import apply, inverse, make_pose
from taxel.sim.scene import BACKING_M, build_scene

HAND = load_hand("allegro")
OBJECTS = make_thesis_objects(ASSUMED_SIZES)


@pytest.fixture(scope="module")
def scene():
    return build_scene(HAND, OBJECTS["cylinder"], "palm")


def test_the_links_below_the_wrist_and_their_joints_are_simulated(scene):
    robot = scene.robot
    assert scene.joint_names == robot.joint_names[6:]
    assert scene.links == robot.link_names[robot.get_link_index("palm") :]
    assert np.allclose(scene.model.jnt_range[[scene.model.joint(n).id for n in scene.joint_names], 0], robot.lower[6:])


def test_body_poses_agree_with_forward_kinematics(scene):
    seed = 4
    rng = np.random.default_rng(seed)
    kinematics = build_kinematics(HAND)
    # The first six joints are those of the arm, which the scene does not contain.
    angles = np.concatenate([np.zeros(6), rng.uniform(scene.robot.lower[6:], scene.robot.upper[6:])])
    data = mujoco.MjData(scene.model)
    data.qpos[scene.joint_addresses] = angles[6:]
    mujoco.mj_kinematics(scene.model, data)
    links = kinematics.compute_link_poses(angles)
    expected = inverse(links[scene.robot.get_link_index("palm")]) @ links[scene.robot.get_link_index("palm") :]
    assert np.allclose(data.xpos[scene.link_bodies], expected[:, :3, 3], atol=1e-9), f"seed {seed}"
    assert np.allclose(data.xmat[scene.link_bodies].reshape(-1, 3, 3), expected[:, :3, :3], atol=1e-9), f"seed {seed}"


def read_solid_corners(scene, board):
    """Read the corners of a board's collision solid, f64[n, 3], in the frame of its bracket, metres."""
    model = scene.model
    geom = int(np.flatnonzero(scene.board_of_geom == HAND.boards.index(board))[0])
    mesh = int(model.geom_dataid[geom])
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    local = model.mesh_vert[first : first + count].astype(float)
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    in_link = local @ rotation.reshape(3, 3).T + model.geom_pos[geom]
    return apply(inverse(board.pose), in_link)


@pytest.mark.parametrize("board", HAND.boards, ids=lambda board: board.name)
def test_the_collision_solid_of_a_board_encloses_its_sheet_and_its_layer_tightly(scene, board):
    """The sheet consists of squares of one pitch over taxels and margin; the layer lies on the sheet."""
    vertices = read_solid_corners(scene, board)
    solid = ConvexPolytope.from_mesh(vertices)
    sheet = build_sheet(HAND)
    on_board = sheet.board_index == HAND.boards.index(board)
    position, normal, distal = sheet.position[on_board], sheet.normal[on_board], sheet.distal[on_board]
    lateral, half = np.cross(normal, distal), HAND.pitch_m / 2
    for a, b in ((0, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
        point = position + half * (a * distal + b * lateral)
        for height in (HAND.layer_m, -BACKING_M):
            assert solid.signed_distance(point + height * normal).max() < 1e-6
    corner = np.hypot(np.sqrt(2) * half, max(HAND.layer_m, BACKING_M))
    assert np.linalg.norm(vertices[:, None] - position, axis=2).min(axis=1).max() < corner + 1e-6


def test_the_collision_solid_of_the_palm_extends_1_5_pitches_beyond_its_outermost_taxels(scene):
    """Half a pitch belongs to the square of the outermost taxel, and one pitch to the margin without taxels."""
    palm = HAND.find_board("palm")
    corners, taxels = read_solid_corners(scene, palm), HAND.position[HAND.get_slice(palm.address)]
    assert np.allclose(corners[:, :2].max(axis=0), taxels[:, :2].max(axis=0) + 1.5 * HAND.pitch_m, atol=1e-6)
    assert np.allclose(corners[:, :2].min(axis=0), taxels[:, :2].min(axis=0) - 1.5 * HAND.pitch_m, atol=1e-6)
    assert np.allclose([corners[:, 2].min(), corners[:, 2].max()], [-BACKING_M, HAND.layer_m], atol=1e-6)


@pytest.mark.parametrize("item", OBJECTS.values(), ids=OBJECTS)
@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_scene_is_built_for_every_object_with_and_without_friction(item, friction):
    model = build_scene(HAND, item, "palm", friction).model
    geom = model.geom("object").id
    assert model.geom_condim[geom] == (3 if friction else 1)
    expected = compute_mass_properties(item.shape)
    body = model.body("object")
    assert body.mass[0] == pytest.approx(expected.mass_kg, rel=2e-3)  # the mesh of a cylinder is a polygon
    assert body.ipos == pytest.approx(expected.centre_m, abs=1e-4)
    assert sorted(body.inertia) == pytest.approx(sorted(np.linalg.eigvalsh(expected.inertia_kg_m2)), rel=5e-3)


def test_a_scene_is_built_for_a_hand_of_one_board_on_one_hinge():
    flat = load_hand("flat8")
    scene = build_scene(flat, GraspObject("brick", ConvexPolytope.box(0.05, 0.05, 0.05), ""), "world")
    assert scene.joint_names == ("hinge",)
    assert (scene.board_of_geom >= 0).sum() == len(flat.boards)


def test_a_wrist_link_that_does_not_carry_all_boards_is_refused():
    with pytest.raises(UnknownLinkError):
        build_scene(HAND, OBJECTS["cylinder"], "elbow_pad")
    with pytest.raises(UnknownLinkError, match="below ff_base"):
        build_scene(HAND, OBJECTS["cylinder"], "ff_base")


def count_hand_contacts(scene, angles):
    """Count the contacts of the hand at joint angles f64[16] while the object is 1 m away."""
    data = mujoco.MjData(scene.model)
    scene.place_object(data, make_pose([1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]))
    data.qpos[scene.joint_addresses] = np.clip(angles, scene.robot.lower[6:], scene.robot.upper[6:])
    mujoco.mj_forward(scene.model, data)
    return int((scene.model.geom("stand").id != data.contact.geom).all(axis=1).sum())


def test_the_open_hand_touches_neither_itself_nor_a_distant_object():
    for self_contact in (False, True):
        open_hand = build_scene(HAND, OBJECTS["cylinder"], "palm", self_contact=self_contact)
        assert count_hand_contacts(open_hand, np.zeros(16)) == 0


def test_a_fist_has_contacts_with_itself_only_if_enabled(scene):
    fist = np.tile([0.0, 1.6, 1.7, 1.6], 4)
    assert count_hand_contacts(scene, fist) == 0
    assert count_hand_contacts(build_scene(HAND, OBJECTS["cylinder"], "palm", self_contact=True), fist) > 0
