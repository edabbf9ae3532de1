import mujoco
import numpy as np
import pytest

from taxel.grasp.objects import GraspObject, make_thesis_objects
from taxel.grasp.shapes import ConvexPolytope
from taxel.hand import load_hand
from taxel.hand.errors import UnknownLinkError
from taxel.hand.kinematics import build_kinematics
from taxel.hand.sheet import build_sheet
from taxel.hand.transforms import apply, inverse
from taxel.sim.scene import BACKING_M, build_scene

HAND = load_hand("allegro")
OBJECTS = make_thesis_objects()


@pytest.fixture(scope="module")
def scene():
    return build_scene(HAND, OBJECTS["cylinder"], "palm")


def test_the_links_below_the_wrist_and_their_joints_are_simulated(scene):
    robot = scene.robot
    assert scene.joint_names == robot.joint_names[6:]
    assert scene.links == robot.link_names[robot.get_link_index("palm") :]
    assert np.allclose(scene.model.jnt_range[[scene.model.joint(n).id for n in scene.joint_names], 0], robot.lower[6:])


def test_bodies_are_where_forward_kinematics_puts_the_links(scene):
    seed = 4
    rng = np.random.default_rng(seed)
    kinematics = build_kinematics(HAND)
    angles = np.concatenate([np.zeros(6), rng.uniform(scene.robot.lower[6:], scene.robot.upper[6:])])
    data = mujoco.MjData(scene.model)
    data.qpos[scene.joint_addresses] = angles[6:]
    mujoco.mj_kinematics(scene.model, data)
    links = kinematics.compute_link_poses(angles)
    wanted = inverse(links[scene.robot.get_link_index("palm")]) @ links[scene.robot.get_link_index("palm") :]
    assert np.allclose(data.xpos[scene.link_bodies], wanted[:, :3, 3], atol=1e-9), f"seed {seed}"
    assert np.allclose(data.xmat[scene.link_bodies].reshape(-1, 3, 3), wanted[:, :3, :3], atol=1e-9), f"seed {seed}"


def solid_of(scene, board):
    """Corners of a board's collision solid, bracket frame."""
    model = scene.model
    geom = int(np.flatnonzero(scene.board_of_geom == HAND.boards.index(board))[0])
    mesh = int(model.geom_dataid[geom])
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    local = model.mesh_vert[first : first + count].astype(float)
    in_link, rotation = np.zeros_like(local), np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    in_link = local @ rotation.reshape(3, 3).T + model.geom_pos[geom]
    return apply(inverse(board.pose), in_link)


@pytest.mark.parametrize("board", HAND.boards, ids=lambda board: board.name)
def test_a_boards_solid_holds_its_whole_sheet_and_the_layer_on_it_and_no_more(scene, board):
    """Squares one pitch wide over taxels and bare margin, from the bracket below to the layer's surface."""
    vertices = solid_of(scene, board)
    solid = ConvexPolytope.from_mesh(vertices)
    sheet = build_sheet(HAND)
    part = sheet.board_index == HAND.boards.index(board)
    position, normal, distal = sheet.position[part], sheet.normal[part], sheet.distal[part]
    lateral, half = np.cross(normal, distal), HAND.pitch_m / 2
    for a, b in ((0, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
        at = position + half * (a * distal + b * lateral)
        for out in (HAND.layer_m, -BACKING_M):
            assert solid.signed_distance(at + out * normal).max() < 1e-6
    corner = np.hypot(np.sqrt(2) * half, max(HAND.layer_m, BACKING_M))
    assert np.linalg.norm(vertices[:, None] - position, axis=2).min(axis=1).max() < corner + 1e-6


def test_the_palms_solid_reaches_one_and_a_half_pitches_beyond_its_outermost_taxels(scene):
    """Half a pitch of the taxel's own square and a whole one of bare margin."""
    palm = HAND.find_board("palm")
    corners, taxels = solid_of(scene, palm), HAND.position[HAND.get_slice(palm.address)]
    assert np.allclose(corners[:, :2].max(axis=0), taxels[:, :2].max(axis=0) + 1.5 * HAND.pitch_m, atol=1e-6)
    assert np.allclose(corners[:, :2].min(axis=0), taxels[:, :2].min(axis=0) - 1.5 * HAND.pitch_m, atol=1e-6)
    assert np.allclose([corners[:, 2].min(), corners[:, 2].max()], [-BACKING_M, HAND.layer_m], atol=1e-6)


@pytest.mark.parametrize("item", OBJECTS.values(), ids=OBJECTS)
@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_any_object_can_be_put_in_the_hand(item, friction):
    model = build_scene(HAND, item, "palm", friction).model
    geom = model.geom("object").id
    assert model.geom_condim[geom] == (3 if friction else 1)
    assert model.body_mass.sum() > 0.3


def test_a_small_hand_on_another_robot_needs_no_code():
    flat = load_hand("flat8")
    scene = build_scene(flat, GraspObject("brick", ConvexPolytope.box(0.05, 0.05, 0.05), ""), "world")
    assert scene.joint_names == ("hinge",)
    assert (scene.board_of_geom >= 0).sum() == len(flat.boards)


def test_a_wrist_that_carries_not_all_boards_is_refused():
    with pytest.raises(UnknownLinkError):
        build_scene(HAND, OBJECTS["cylinder"], "elbow_pad")
    with pytest.raises(UnknownLinkError, match="below ff_base"):
        build_scene(HAND, OBJECTS["cylinder"], "ff_base")


def contacts_of_the_hand(scene, angles):
    """How many contacts the hand has at joint angles f64[16] while the object is far away."""
    data = mujoco.MjData(scene.model)
    data.mocap_pos[scene.model.body_mocapid[scene.model.body("mount").id]] = [1.0, 0.0, 0.0]
    data.qpos[scene.joint_addresses] = np.clip(angles, scene.robot.lower[6:], scene.robot.upper[6:])
    mujoco.mj_forward(scene.model, data)
    return data.ncon


def test_the_open_hand_touches_neither_itself_nor_a_distant_object():
    for own in (False, True):
        open_hand = build_scene(HAND, OBJECTS["cylinder"], "palm", self_contact=own)
        assert contacts_of_the_hand(open_hand, np.zeros(16)) == 0


def test_a_fist_touches_itself_only_where_that_is_asked_for(scene):
    fist = np.tile([0.0, 1.6, 1.7, 1.6], 4)
    assert contacts_of_the_hand(scene, fist) == 0
    assert contacts_of_the_hand(build_scene(HAND, OBJECTS["cylinder"], "palm", self_contact=True), fist) > 0
