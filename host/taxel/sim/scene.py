"""A MuJoCo scene made from descriptions alone: a hand with its skin, and an object in a compliant mount.

Nothing here knows a particular hand. The links below the wrist are simulated; the wrist and the mount are placed from
outside. Each board is a rigid body part as thick as its bracket with the layer on it: how the layer yields is computed
afterwards, from the forces that this scene gives.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Final
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull

from taxel.grasp.objects import MOUNT_STIFFNESS_N_PER_M, MOUNT_STIFFNESS_NM_PER_RAD, GraspObject
from taxel.grasp.shapes import Cylinder
from taxel.hand import Board, Hand
from taxel.hand.errors import HandGeometryError, UnknownLinkError
from taxel.hand.robot import Joint, Robot, Shape, load_robot
from taxel.hand.sheet import build_sheet
from taxel.hand.transforms import to_quaternion
from taxel.types import FloatArray

STEP_S: Final = 0.002
# MuJoCo's contact: time constant and damping ratio, impedance. Stiffer ones chatter at this step when a finger's edge
# lies on an object's edge. Shapes overlap by at most half a millimetre under load.
CONTACT_SOLREF: Final = "0.01 3"
CONTACT_SOLIMP: Final = "0.98 0.995 0.0005"
SOLVER_TOLERANCE: Final = 1e-12
SOLVER_ITERATIONS: Final = 100

# Density: of the public model of the Allegro hand. The other figures of this block are chosen.
LINK_DENSITY_KG_PER_M3: Final = 800.0
JOINT_ARMATURE_KG_M2: Final = 1e-3
JOINT_DAMPING_NM_S: Final = 0.03
JOINT_FRICTION_NM: Final = 0.02  # a geared joint stands still under less; without it frictionless fingers creep
BOARD_MASS_KG: Final = 0.002
BACKING_M: Final = 0.002  # what lies under the electrodes: circuit and bracket
OBJECT_MASS_KG: Final = 0.3
# Critical for the object's mass and size: 2 sqrt(k m).
MOUNT_DAMPING_N_S_PER_M: Final = 100.0
MOUNT_DAMPING_NM_S: Final = 0.6
TABLE_HALF_M: Final = (0.8, 0.8, 0.02)

_HAND_BIT, _OBJECT_BIT = 1, 2
_RELATED = 2  # joints between two links that are so near that they may not touch each other


@dataclass(frozen=True, eq=False)
class Scene:
    """A compiled scene; reused for every grasp of one object by one hand.

    Attributes:
        hand, robot, item: what it was made of.
        wrist: the link that is placed from outside; what lies above it is not simulated.
        links: the simulated links, the wrist first.
        joint_names: the simulated joints, in the robot's order: the last axis of angles and torques.
        model: MuJoCo's; not to be changed.
        board_of_geom: i64[geoms], index in `hand.boards`, -1 for any other geom.
    """

    hand: Hand
    robot: Robot
    item: GraspObject
    wrist: str
    links: tuple[str, ...]
    joint_names: tuple[str, ...]
    model: mujoco.MjModel
    board_of_geom: npt.NDArray[np.int64]

    @cached_property
    def joint_addresses(self) -> npt.NDArray[np.intp]:
        """Where the joints' angles stand in MuJoCo's qpos, [j]."""
        return np.array([self.model.joint(name).qposadr[0] for name in self.joint_names], dtype=np.intp)

    @cached_property
    def joint_dofs(self) -> npt.NDArray[np.intp]:
        """Where the joints' velocities and torques stand in MuJoCo's qvel and qfrc_applied, [j]."""
        return np.array([self.model.joint(name).dofadr[0] for name in self.joint_names], dtype=np.intp)

    @cached_property
    def link_bodies(self) -> npt.NDArray[np.intp]:
        """MuJoCo's bodies of `links`."""
        return np.array([self.model.body(_link(name)).id for name in self.links], dtype=np.intp)

    @cached_property
    def board_bodies(self) -> npt.NDArray[np.intp]:
        """MuJoCo's bodies that carry the boards, [s]."""
        names = [board.link_name for board in self.hand.boards if board.link_name is not None]
        return np.array([self.model.body(_link(name)).id for name in names], dtype=np.intp)

    @cached_property
    def board_poses(self) -> FloatArray:
        """The brackets in their links, f64[s, 4, 4]."""
        return np.stack([board.pose for board in self.hand.boards if board.pose is not None])


def build_scene(hand: Hand, item: GraspObject, wrist: str, friction: float = 0.0, self_contact: bool = False) -> Scene:
    """Compile the scene.

    Args:
        hand: with positions and a robot in its description.
        item: the object.
        wrist: link that is placed from outside ("palm").
        friction: sliding friction coefficient between hand and object; 0 is frictionless.
        self_contact: whether parts of the hand that are more than two joints apart meet each other. By default they
            pass through: the emulated hand does not model such contact either, and the planned grasps are chosen so
            that the fingers meet the object first.

    Raises:
        HandGeometryError: the hand's description gives no positions or no robot.
        UnknownLinkError: the robot has no such wrist, or a board sits on a link above it.
    """
    robot = _robot_of(hand)
    robot.get_link_index(wrist)
    joints = tuple(_below(robot, wrist))
    links = (wrist, *(joint.child for joint in joints))
    for board in hand.boards:
        if board.link_name is None or board.pose is None:
            raise HandGeometryError(hand.name)
        if board.link_name not in links:
            raise UnknownLinkError(f"{robot.name} below {wrist}", board.link_name, links)
    model = mujoco.MjModel.from_xml_string(scene_xml(hand, robot, item, wrist, friction, self_contact))
    board_of_geom = np.full(model.ngeom, -1, dtype=np.int64)
    for index, board in enumerate(hand.boards):
        board_of_geom[model.geom(_board(board)).id] = index
    moving = tuple(joint.name for joint in joints if joint.axis is not None)
    return Scene(hand, robot, item, wrist, links, moving, model, board_of_geom)


def scene_xml(
    hand: Hand, robot: Robot, item: GraspObject, wrist: str, friction: float = 0.0, self_contact: bool = False
) -> str:
    """The scene as MJCF text; see `build_scene`."""
    slide, dimensions = friction, 3 if friction > 0 else 1
    met = _OBJECT_BIT | _HAND_BIT if self_contact else _OBJECT_BIT
    contact = f'solref="{CONTACT_SOLREF}" solimp="{CONTACT_SOLIMP}" condim="{dimensions}" friction="{slide!r} 0 0"'
    # No gravity: the hand's controller carries the hand's weight, and the stand carries the object's.
    return f"""<mujoco model={quoteattr(f"{hand.name} and {item.name}")}>
<compiler angle="radian" boundmass="1e-3" boundinertia="1e-7"/>
<option timestep="{STEP_S}" gravity="0 0 0" integrator="implicitfast" cone="elliptic" solver="Newton"
  tolerance="{SOLVER_TOLERANCE}" iterations="{SOLVER_ITERATIONS}"><flag multiccd="enable"/></option>
<visual><global offwidth="800" offheight="800"/></visual>
<default>
<geom density="{LINK_DENSITY_KG_PER_M3}" {contact}/>
<default class="hand"><geom contype="{_HAND_BIT}" conaffinity="{met}" rgba="0.3 0.3 0.35 1"/>
<joint damping="{JOINT_DAMPING_NM_S}" armature="{JOINT_ARMATURE_KG_M2}"
  frictionloss="{JOINT_FRICTION_NM}"/></default>
</default>
<asset>
{_board_meshes(hand)}{_object_mesh(item)}</asset>
<worldbody>
<light pos="0 0 2"/>
<geom name="table" type="box" size="{_row(TABLE_HALF_M)}" pos="0 0 {-TABLE_HALF_M[2]}"
  contype="0" conaffinity="0" rgba="0.8 0.75 0.7 1"/>
{_object_body(item)}{_hand_body(hand, robot, wrist)}</worldbody>
<contact>
{"".join(_excludes(wrist, list(_below(robot, wrist))))}</contact>
</mujoco>"""


@lru_cache(maxsize=4)
def _robot_of(hand: Hand) -> Robot:
    """Read once for a hand: many objects may be put before it."""
    if hand.robot is None:
        raise HandGeometryError(hand.name)
    return load_robot(hand.robot)


@lru_cache(maxsize=4)
def _board_meshes(hand: Hand) -> str:
    return "".join(_mesh(_board(board), _board_hull(hand, board)) for board in hand.boards)


def _link(name: str) -> str:
    return f"link:{name}"  # a bare "world" would be MuJoCo's own


def _board(board: Board) -> str:
    return f"board:{board.name}"


def _below(robot: Robot, wrist: str) -> Iterator[Joint]:
    below = {wrist}
    for joint in robot.joints:
        if joint.parent in below:
            below.add(joint.child)
            yield joint


def _row(values: npt.ArrayLike) -> str:
    return " ".join(repr(float(value)) for value in np.asarray(values).ravel())


def _place(transform: FloatArray) -> str:
    return f'pos="{_row(transform[:3, 3])}" quat="{_row(to_quaternion(transform))}"'


def _mesh(name: str, vertices: FloatArray) -> str:
    return f'<mesh name={quoteattr(name)} vertex="{_row(vertices)}"/>\n'


def _board_hull(hand: Hand, board: Board) -> FloatArray:
    """Corners of the smallest convex solid round a board's sheet: bracket below, layer above; bracket frame."""
    sheet = build_sheet(hand)
    part = sheet.board_index == hand.boards.index(board)
    position, normal, distal = sheet.position[part], sheet.normal[part], sheet.distal[part]
    lateral = np.cross(normal, distal)
    half = hand.pitch_m / 2
    corners = [position + half * (a * distal + b * lateral) for a in (-1, 1) for b in (-1, 1)]
    layer = hand.layer_m or 0.0
    points = np.concatenate([corner + out * normal for corner in corners for out in (layer, -BACKING_M)])
    return points[ConvexHull(points).vertices]


def _object_mesh(item: GraspObject) -> str:
    return "" if isinstance(item.shape, Cylinder) else _mesh("object", item.shape.mesh()[0])


def _object_body(item: GraspObject) -> str:
    middle = f"0 0 {item.shape.height / 2!r}"
    if isinstance(item.shape, Cylinder):
        geom = f'type="cylinder" size="{item.shape.radius!r} {item.shape.height / 2!r}" pos="{middle}"'
    else:
        geom = 'type="mesh" mesh="object"'
    slides = "".join(
        f'<joint type="slide" axis="{axis}" stiffness="{MOUNT_STIFFNESS_N_PER_M}" damping="{MOUNT_DAMPING_N_S_PER_M}"/>'
        for axis in ("1 0 0", "0 1 0", "0 0 1")
    )
    return f"""<body name="mount" mocap="true"><body name="object">
{slides}<joint type="ball" pos="{middle}" stiffness="{MOUNT_STIFFNESS_NM_PER_RAD}" damping="{MOUNT_DAMPING_NM_S}"/>
<geom name="object" {geom} mass="{OBJECT_MASS_KG}" contype="{_OBJECT_BIT}" conaffinity="{_HAND_BIT}"
  rgba="0.9 0.7 0.3 0.5"/></body></body>
"""


@lru_cache(maxsize=4)
def _hand_body(hand: Hand, robot: Robot, wrist: str) -> str:
    return _link_body(hand, robot, wrist, list(_below(robot, wrist)))


def _link_body(hand: Hand, robot: Robot, link: str, joints: list[Joint], joint: Joint | None = None) -> str:
    """The body of a link and all below it."""
    place = 'mocap="true"' if joint is None else _place(joint.origin)
    parts = [f'<body name={quoteattr(_link(link))} childclass="hand" {place}>\n']
    if joint is not None and joint.axis is not None:
        parts.append(
            f'<joint name={quoteattr(joint.name)} axis="{_row(joint.axis)}" '
            f'range="{joint.lower!r} {joint.upper!r}" limited="true"/>\n'
        )
    parts += [_shape_geom(shape) for shape in robot.shapes if shape.link_name == link]
    parts += [_board_geom(board) for board in hand.boards if board.link_name == link]
    parts += [_link_body(hand, robot, below.child, joints, below) for below in joints if below.parent == link]
    return "".join([*parts, "</body>\n"])


def _shape_geom(shape: Shape) -> str:
    return f'<geom type="{shape.type}" size="{_row(shape.size)}" {_place(shape.origin)}/>\n'


def _board_geom(board: Board) -> str:
    assert board.pose is not None  # checked by build_scene
    name = quoteattr(_board(board))
    mass = f'mass="{BOARD_MASS_KG}" rgba="0.2 0.5 0.3 1"'
    return f'<geom name={name} type="mesh" mesh={name} {_place(board.pose)} {mass}/>\n'


def _excludes(wrist: str, joints: list[Joint]) -> Iterator[str]:
    """Pairs of links at most `_RELATED` joints apart: their extents overlap where they are hinged."""
    path = {wrist: [wrist]}
    for joint in joints:
        path[joint.child] = [*path[joint.parent], joint.child]
    links = list(path)
    for i, a in enumerate(links):
        for b in links[i + 1 :]:
            shared = sum(x == y for x, y in zip(path[a], path[b], strict=False))
            if len(path[a]) + len(path[b]) - 2 * shared <= _RELATED:
                yield f"<exclude body1={quoteattr(_link(a))} body2={quoteattr(_link(b))}/>\n"
