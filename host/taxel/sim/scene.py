"""A MuJoCo scene built from descriptions: a hand with its skin, and an object that stands freely on a stand.

The module contains no property of a particular hand. The links below the wrist are simulated; the poses of wrist and
stand are prescribed. Each board is a rigid part as thick as its bracket plus the layer. With rigid contact the
compression of the layer is computed afterwards from the contact forces.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Final
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull

from taxel.grasp.objects import (
    GRAVITY_M_PER_S2,
    OBJECT_DENSITY_KG_PER_M3,
    SKIN_FRICTION,
    STAND_FRICTION,
    STAND_N_PER_M,
    GraspObject,
)
from taxel.grasp.shapes import Cylinder
from taxel.hand import Board, Hand
from taxel.hand.errors import HandGeometryError, UnknownLinkError
from taxel.hand.robot import Joint, Robot, Shape, load_robot
from taxel.hand.sheet import build_sheet
from taxel.hand.transforms import to_quaternion
from taxel.types import FloatArray

STEP_S: Final = 0.002
"""Time step of rigid contact, seconds (chosen)."""
# MuJoCo's contact parameters: time constant and damping ratio; impedance. Stiffer contact chatters at this time step
# when the edge of a finger lies on the edge of an object. Shapes overlap by at most half a millimetre under load.
CONTACT_SOLREF: Final = "0.006 2"
CONTACT_SOLIMP: Final = "0.98 0.995 0.0005"
STEADYING_SOLREF: Final = "0.02 1"  # hold of the experimenter on the object with rigid contact
SOLVER_TOLERANCE: Final = 1e-12
SOLVER_ITERATIONS: Final = 100

# Source of the density: the public model of the Allegro hand. The other values of this block are chosen.
LINK_DENSITY_KG_PER_M3: Final = 800.0
JOINT_ARMATURE_KG_M2: Final = 1e-3
JOINT_DAMPING_NM_S: Final = 0.03
JOINT_FRICTION_NM: Final = 0.02  # a geared joint does not move under a smaller torque; without friction, fingers creep
BOARD_MASS_KG: Final = 0.002
BACKING_M: Final = 0.002  # thickness of circuit and bracket under the electrodes
STAND_HALF_M: Final = (0.08, 0.08, 0.01)
# Chosen: a light plate on the spring of the stand, damped critically.
PLATE_MASS_KG: Final = 0.5
PLATE_DAMPING_N_S_PER_M: Final = 450.0
TABLE_HALF_M: Final = (0.8, 0.8, 0.02)

_HAND_BIT, _OBJECT_BIT, _STAND_BIT = 1, 2, 4
_MAX_RELATED_JOINTS = 2
"""Two links separated by at most this number of joints do not collide: their volumes overlap at the hinges."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A compiled scene, which all grasps of one object by one hand can use.

    Attributes:
        hand, robot, grasp_object: descriptions from which the scene is built.
        wrist: link whose pose is prescribed; links above the wrist are not simulated.
        links: simulated links, beginning with the wrist.
        joint_names: simulated joints in the robot's order: the last axis of angles and torques.
        model: MuJoCo's model; read-only.
        board_of_geom: i64[geoms], index in `hand.boards`, -1 for any other geom.
    """

    hand: Hand
    robot: Robot
    grasp_object: GraspObject
    wrist: str
    links: tuple[str, ...]
    joint_names: tuple[str, ...]
    model: mujoco.MjModel
    board_of_geom: npt.NDArray[np.int64]

    @cached_property
    def joint_addresses(self) -> npt.NDArray[np.intp]:
        """Indices of the joint angles in MuJoCo's qpos, [j]."""
        return np.array([self.model.joint(name).qposadr[0] for name in self.joint_names], dtype=np.intp)

    @cached_property
    def joint_dofs(self) -> npt.NDArray[np.intp]:
        """Indices of the joint velocities and torques in MuJoCo's qvel and qfrc_applied, [j]."""
        return np.array([self.model.joint(name).dofadr[0] for name in self.joint_names], dtype=np.intp)

    @cached_property
    def link_bodies(self) -> npt.NDArray[np.intp]:
        """Indices of MuJoCo's bodies of `links`, [L]."""
        return np.array([self.model.body(_make_link_name(name)).id for name in self.links], dtype=np.intp)

    @cached_property
    def board_bodies(self) -> npt.NDArray[np.intp]:
        """Indices of MuJoCo's bodies to which the boards are attached, [s]."""
        names = [board.link_name for board in self.hand.boards if board.link_name is not None]
        return np.array([self.model.body(_make_link_name(name)).id for name in names], dtype=np.intp)

    @cached_property
    def board_poses(self) -> FloatArray:
        """Poses of the brackets in the frames of their links, f64[s, 4, 4]."""
        return np.stack([board.pose for board in self.hand.boards if board.pose is not None])

    def place_object(self, data: mujoco.MjData, pose: FloatArray) -> None:
        """Place the object, its stand and the experimenter's hold at a pose f64[4, 4] in the world, at rest."""
        quaternion = to_quaternion(pose)
        for name in ("stand", "experimenter"):
            index = self.model.body_mocapid[self.model.body(name).id]
            data.mocap_pos[index], data.mocap_quat[index] = pose[:3, 3], quaternion
        address = self.model.jnt_qposadr[self.model.body("object").jntadr[0]]
        data.qpos[address : address + 7] = [*pose[:3, 3], *quaternion]


def build_scene(
    hand: Hand,
    grasp_object: GraspObject,
    wrist: str,
    friction: float = SKIN_FRICTION,
    self_contact: bool = False,
    layer_m: Mapping[str, float] | None = None,
) -> Scene:
    """Return the compiled MuJoCo scene of a hand and of an object on its stand.

    Args:
        hand: hand whose description has positions and a robot.
        grasp_object: object on the stand.
        wrist: name of the link whose pose is prescribed, such as "palm".
        friction: sliding friction coefficient between hand and object; 0: no friction.
        self_contact: True if parts of the hand more than two joints apart collide with each other. By default these
            parts pass through each other, as on the emulated hand; in the planned grasps the fingers touch the object
            first.
        layer_m: height of the rigid boards' surface over their electrodes, metres, by name of the board; None: the
            thickness of the hand's layer on every board.

    Raises:
        HandGeometryError: the hand's description gives no positions or no robot.
        UnknownLinkError: the robot has no link `wrist`, or a board is attached to a link above the wrist.
    """
    robot = _load_robot_of(hand)
    robot.get_link_index(wrist)
    joints = tuple(_iterate_joints_below(robot, wrist))
    links = (wrist, *(joint.child for joint in joints))
    for board in hand.boards:
        if board.link_name is None or board.pose is None:
            raise HandGeometryError(hand.name)
        if board.link_name not in links:
            raise UnknownLinkError(f"{robot.name} below {wrist}", board.link_name, links)
    heights = tuple((hand.layer_m or 0.0) if layer_m is None else layer_m[board.name] for board in hand.boards)
    text = _write_scene(hand, robot, grasp_object, wrist, friction, self_contact, heights)
    model = mujoco.MjModel.from_xml_string(text)
    board_of_geom = np.full(model.ngeom, -1, dtype=np.int64)
    for index, board in enumerate(hand.boards):
        board_of_geom[model.geom(_make_board_name(board)).id] = index
    movable_joints = tuple(joint.name for joint in joints if joint.axis is not None)
    return Scene(hand, robot, grasp_object, wrist, links, movable_joints, model, board_of_geom)


def _write_scene(
    hand: Hand,
    robot: Robot,
    grasp_object: GraspObject,
    wrist: str,
    friction: float,
    self_contact: bool,
    heights_m: tuple[float, ...],
) -> str:
    """Return a MuJoCo scene as MJCF text; arguments as for `build_scene`.

    heights_m: height of each board's surface over its electrodes, metres.
    """
    dimensions = 3 if friction > 0 else 1  # of a contact force: with or without friction (attribute condim)
    collides_with = _OBJECT_BIT | _HAND_BIT if self_contact else _OBJECT_BIT
    contact = f'solref="{CONTACT_SOLREF}" solimp="{CONTACT_SOLIMP}" condim="{dimensions}" friction="{friction!r} 0 0"'
    # The controller compensates the weight of the hand (gravcomp).
    return f"""<mujoco model={quoteattr(f"{hand.name} and {grasp_object.name}")}>
<compiler angle="radian" boundmass="1e-3" boundinertia="1e-7"/>
<option timestep="{STEP_S}" gravity="0 0 -{GRAVITY_M_PER_S2}" integrator="implicitfast" cone="elliptic" solver="Newton"
  tolerance="{SOLVER_TOLERANCE}" iterations="{SOLVER_ITERATIONS}"><flag multiccd="enable"/></option>
<visual><global offwidth="800" offheight="800"/></visual>
<default>
<geom density="{LINK_DENSITY_KG_PER_M3}" {contact}/>
<default class="hand"><geom contype="{_HAND_BIT}" conaffinity="{collides_with}" rgba="0.3 0.3 0.35 1"/>
<joint damping="{JOINT_DAMPING_NM_S}" armature="{JOINT_ARMATURE_KG_M2}"
  frictionloss="{JOINT_FRICTION_NM}"/></default>
</default>
<asset>
{_write_board_meshes(hand, heights_m)}{_write_object_mesh(grasp_object)}</asset>
<worldbody>
<light pos="0 0 2"/>
<geom name="table" type="box" size="{_write_row(TABLE_HALF_M)}" pos="0 0 {-TABLE_HALF_M[2]}"
  contype="0" conaffinity="0" rgba="0.8 0.75 0.7 1"/>
{_write_object_body(grasp_object)}{_write_hand_body(hand, robot, wrist)}</worldbody>
<contact>
{"".join(_write_excludes(wrist, list(_iterate_joints_below(robot, wrist))))}</contact>
<equality><weld name="steadying" body1="experimenter" body2="object" relpose="0 0 0 1 0 0 0"
  solref="{STEADYING_SOLREF}"/></equality>
</mujoco>"""


@lru_cache(maxsize=4)
def _load_robot_of(hand: Hand) -> Robot:
    """Load the robot of a hand; the result is cached, because scenes with several objects share the robot.

    Raises HandGeometryError for a hand without a robot.
    """
    if hand.robot is None:
        raise HandGeometryError(hand.name)
    return load_robot(hand.robot)


@lru_cache(maxsize=4)
def _write_board_meshes(hand: Hand, heights_m: tuple[float, ...]) -> str:
    """Return the MJCF of the meshes of all boards; cached, because scenes with several objects share the hand."""
    return "".join(
        _write_mesh(_make_board_name(board), _compute_board_hull(hand, board, height))
        for board, height in zip(hand.boards, heights_m, strict=True)
    )


def _make_link_name(name: str) -> str:
    """Return the name of a link's body in the MuJoCo model."""
    return f"link:{name}"  # MuJoCo reserves the name "world"


def _make_board_name(board: Board) -> str:
    """Return the name of a board's geom and mesh in the MuJoCo model."""
    return f"board:{board.name}"


def _iterate_joints_below(robot: Robot, wrist: str) -> Iterator[Joint]:
    """Yield the joints below the link `wrist`, in the robot's order."""
    links = {wrist}
    for joint in robot.joints:
        if joint.parent in links:
            links.add(joint.child)
            yield joint


def _write_row(values: npt.ArrayLike) -> str:
    """Format the numbers of an array for MJCF, separated by spaces, with all digits."""
    return " ".join(repr(float(value)) for value in np.asarray(values).ravel())


def _write_pose(transform: FloatArray) -> str:
    """Format a pose f64[4, 4] as the MJCF attributes pos and quat."""
    return f'pos="{_write_row(transform[:3, 3])}" quat="{_write_row(to_quaternion(transform))}"'


def _write_mesh(name: str, vertices: FloatArray) -> str:
    """Return the MJCF of a convex mesh; vertices: f64[v, 3], metres."""
    return f'<mesh name={quoteattr(name)} vertex="{_write_row(vertices)}"/>\n'


def _compute_board_hull(hand: Hand, board: Board, height_m: float) -> FloatArray:
    """Compute the convex hull of a board with its bracket and soft layer: vertices f64[v, 3], bracket frame, metres.

    height_m: height of the layer over the electrodes.
    """
    sheet = build_sheet(hand)
    on_board = sheet.board_index == hand.boards.index(board)
    position, normal, distal = sheet.position[on_board], sheet.normal[on_board], sheet.distal[on_board]
    lateral = np.cross(normal, distal)
    half = hand.pitch_m / 2
    corners = [position + half * (a * distal + b * lateral) for a in (-1, 1) for b in (-1, 1)]
    points = np.concatenate([corner + height * normal for corner in corners for height in (height_m, -BACKING_M)])
    return points[ConvexHull(points).vertices]


def _write_object_mesh(grasp_object: GraspObject) -> str:
    """Return the MJCF of the object's mesh; "" for a cylinder, which needs no mesh."""
    return "" if isinstance(grasp_object.shape, Cylinder) else _write_mesh("object", grasp_object.shape.mesh()[0])


def _write_object_body(grasp_object: GraspObject) -> str:
    """Return the MJCF of the stand (a plate on a spring, with its surface at z = 0) and of the free object on it."""
    if isinstance(grasp_object.shape, Cylinder):
        middle = f"0 0 {grasp_object.shape.height / 2!r}"
        geom = f'type="cylinder" size="{grasp_object.shape.radius!r} {grasp_object.shape.height / 2!r}" pos="{middle}"'
    else:
        geom = 'type="mesh" mesh="object"'
    return f"""<body name="stand" mocap="true"><body name="plate" gravcomp="1">
<joint type="slide" axis="0 0 1" stiffness="{STAND_N_PER_M}" damping="{PLATE_DAMPING_N_S_PER_M}"/>
<geom name="stand" type="box" size="{_write_row(STAND_HALF_M)}" pos="0 0 {-STAND_HALF_M[2]}" mass="{PLATE_MASS_KG}"
  condim="3" friction="{STAND_FRICTION} 0 0" contype="{_STAND_BIT}" conaffinity="0" rgba="0.7 0.7 0.7 1"/></body></body>
<body name="experimenter" mocap="true"/>
<body name="object"><freejoint/>
<geom name="object" {geom} density="{OBJECT_DENSITY_KG_PER_M3}" contype="{_OBJECT_BIT}"
  conaffinity="{_HAND_BIT | _STAND_BIT}" rgba="0.9 0.7 0.3 0.5"/></body>
"""


@lru_cache(maxsize=4)
def _write_hand_body(hand: Hand, robot: Robot, wrist: str) -> str:
    """Return the MJCF of the hand below the link `wrist`; cached, because scenes with several objects share it."""
    return _write_link_body(hand, robot, wrist, list(_iterate_joints_below(robot, wrist)))


def _write_link_body(hand: Hand, robot: Robot, link: str, joints: list[Joint], joint: Joint | None = None) -> str:
    """Return the MJCF of the body of a link and of all bodies below the link.

    joint: the joint above the link; None for the wrist, whose pose is prescribed. joints: all joints below the wrist.
    """
    pose = 'mocap="true"' if joint is None else _write_pose(joint.origin)
    elements = [f'<body name={quoteattr(_make_link_name(link))} childclass="hand" gravcomp="1" {pose}>\n']
    if joint is not None and joint.axis is not None:
        elements.append(
            f'<joint name={quoteattr(joint.name)} axis="{_write_row(joint.axis)}" '
            f'range="{joint.lower!r} {joint.upper!r}" limited="true"/>\n'
        )
    elements += [_write_shape_geom(shape) for shape in robot.shapes if shape.link_name == link]
    elements += [_write_board_geom(board) for board in hand.boards if board.link_name == link]
    elements += [_write_link_body(hand, robot, child.child, joints, child) for child in joints if child.parent == link]
    return "".join([*elements, "</body>\n"])


def _write_shape_geom(shape: Shape) -> str:
    """Return the MJCF of a collision shape of a link."""
    return f'<geom type="{shape.type}" size="{_write_row(shape.size)}" {_write_pose(shape.origin)}/>\n'


def _write_board_geom(board: Board) -> str:
    """Return the MJCF of the rigid solid of a board at its pose on its link."""
    assert board.pose is not None  # build_scene has checked the boards
    name = quoteattr(_make_board_name(board))
    mass = f'mass="{BOARD_MASS_KG}" rgba="0.2 0.5 0.3 1"'
    return f'<geom name={name} type="mesh" mesh={name} {_write_pose(board.pose)} {mass}/>\n'


def _write_excludes(wrist: str, joints: list[Joint]) -> Iterator[str]:
    """Yield MJCF elements that disable contact between links at most `_MAX_RELATED_JOINTS` joints apart."""
    path = {wrist: [wrist]}
    for joint in joints:
        path[joint.child] = [*path[joint.parent], joint.child]
    links = list(path)
    for i, a in enumerate(links):
        for b in links[i + 1 :]:
            common = sum(x == y for x, y in zip(path[a], path[b], strict=False))
            if len(path[a]) + len(path[b]) - 2 * common <= _MAX_RELATED_JOINTS:
                yield f"<exclude body1={quoteattr(_make_link_name(a))} body2={quoteattr(_make_link_name(b))}/>\n"
