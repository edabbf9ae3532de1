"""Bodies of a workstation for collision checks: links, sensor boards, table, stand and object, as a MuJoCo model.

The model has no contacts and no dynamics: only kinematics and distances between pairs of bodies are computed.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull

from taxel.grasp.objects import GraspObject
from taxel.grasp.shapes import Cylinder
from taxel.hand import Board, Hand
from taxel.hand.errors import HandGeometryError
from taxel.hand.robot import Joint, Robot
from taxel.hand.sheet import build_sheet
from taxel.hand.transforms import to_quaternion
from taxel.types import FloatArray, IndexArray

WRIST_LINK: Final = "palm"
"""Link at which the hand begins."""

BACKING_M: Final = 0.002
"""Thickness of circuit and bracket under the electrodes of a board, metres; as in the simulated scene."""

CLEARANCE_M: Final = 0.005
"""Smallest distance of arm, hand and boards from table, stand, object and from each other in a plan, metres (chosen).

Larger than the following error of the arm (0.1 mm) and of the brackets (1 mm); with a smaller value, errors of the
object's pose cause contacts before the grasp; with a larger value, fewer approaches between object and table exist.
"""

HAND_CLEARANCE_M: Final = 0.001
"""Smallest distance between two parts of the hand, metres (chosen): fingers pass each other at a few millimetres."""

_HAND_RELATED_JOINTS: Final = 2
_ARM_RELATED_JOINTS: Final = 1
"""Links of hand or arm separated by at most this number of revolute joints cannot collide, or overlap at the hinge."""

TABLE, STAND, OBJECT = "table", "stand", "object"


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Table, stand and object around the robot. Poses are in the frame of the robot's root.

    table_z_m: height of the table's surface; everything below it is treated as table. grasp_object: the object, or
    None. object_pose: its pose, f64[4, 4]; None only without object. Between table and object stands a box with the
    object's extent.
    """

    table_z_m: float = 0.0
    grasp_object: GraspObject | None = None
    object_pose: FloatArray | None = None

    @property
    def stand_height_m(self) -> float:
        """Height of the stand between table and object, metres; 0 without stand."""
        if self.object_pose is None:
            return 0.0
        return max(0.0, float(self.object_pose[2, 3]) - self.table_z_m)


@dataclass(frozen=True)
class Body:
    """One convex body. label: name in messages. link: its link, TABLE, STAND or OBJECT. in_hand: below the wrist."""

    label: str
    link: str
    in_hand: bool


class BodyModel:
    """Compiled bodies of a robot with its skin in its surroundings, and the pairs of bodies that may not touch.

    Attributes:
        robot, hand, surroundings: descriptions from which the model is built.
        model: MuJoCo's model; joint angles are in the order of `robot.joint_names`.
        bodies: one for each geom of the model.
        pairs: i64[p, 2], indices of the bodies of each checked pair.
        clearance: required distance of each pair, f64[p], metres.
        reach: largest speed of one body of a pair relative to the other for a joint speed of 1, f64[p, j], m/rad.

    Raises HandGeometryError if the description of the hand contains no positions.
    """

    def __init__(self, robot: Robot, hand: Hand, surroundings: Surroundings) -> None:
        """Compile the bodies of a robot, its boards and its surroundings."""
        self.robot, self.hand, self.surroundings = robot, hand, surroundings
        self._hand_links = _find_links_below(robot, WRIST_LINK)
        self._paths = _find_joint_paths(robot)
        texts = list(self._write_bodies())
        self.bodies = tuple(body for body, _, _ in texts)
        self.model = mujoco.MjModel.from_xml_string(_write_model(robot, texts))
        for index in range(len(self.bodies)):  # MuJoCo orders geoms by body; the names give the order of `bodies`
            assert self.model.geom(f"{index}").id >= 0
        self.geom_ids: IndexArray = np.array(
            [self.model.geom(f"{index}").id for index in range(len(self.bodies))], dtype=np.intp
        )
        self.radius: FloatArray = self.model.geom_rbound[self.geom_ids].copy()
        self.is_plane = np.array([body.link == TABLE for body in self.bodies])
        self.pairs = self._find_pairs()
        self.clearance: FloatArray = np.array(
            [HAND_CLEARANCE_M if self._is_within_hand(*pair) else CLEARANCE_M for pair in self.pairs.tolist()]
        )

    def format_pair(self, pair: int) -> str:
        """Format the names of the two bodies of a pair, such as "board palm and object cylinder"."""
        first, second = (self.bodies[k].label for k in self.pairs[pair].tolist())
        return f"{first} and {second}"

    @cached_property
    def is_contact_pair(self) -> npt.NDArray[np.bool_]:
        """Whether a pair consists of a part of the hand and the object, which touch in a grasp; bool[p]."""
        return np.array(
            [
                any(self.bodies[k].in_hand for k in pair) and any(self.bodies[k].link == OBJECT for k in pair)
                for pair in self.pairs
            ]
        )

    @cached_property
    def reach(self) -> FloatArray:
        """Upper bound of the relative speed of the bodies of each pair for each joint, f64[p, j], m/rad.

        A joint moves a point at most by its angle times the distance of the point from the axis. A joint that carries
        both bodies moves neither relative to the other.
        """
        arms = np.stack([self._compute_lever_arms(index) for index in range(len(self.bodies))])
        first, second = arms[self.pairs[:, 0]], arms[self.pairs[:, 1]]
        return np.asarray(np.where((first > 0) & (second > 0), 0.0, np.maximum(first, second)))

    def _compute_lever_arms(self, index: int) -> FloatArray:
        """Compute upper bounds of the distances of a body's points from the axes of the joints, f64[j], metres.

        0 for a joint that does not move the body, and for table, stand and object.
        """
        result = np.zeros(len(self.robot.joint_names))
        body = self.bodies[index]
        if body.link in (TABLE, STAND, OBJECT):
            return result
        geom = int(self.geom_ids[index])
        centre, radius = np.append(self.model.geom_pos[geom], 1.0), float(self.radius[index])
        # The path leads from the body to the root. offset: vector in the present link frame to the centre of the body,
        # or to the origin of the revolute joint passed last. length: length of the path from there to the centre.
        offset, length = centre, 0.0
        for joint in reversed(self._paths[body.link]):
            if joint.axis is None:
                offset = joint.origin @ offset
                continue
            lateral = float(np.linalg.norm(offset[:3] - (offset[:3] @ joint.axis) * joint.axis))
            result[self.robot.joint_names.index(joint.name)] = lateral + length + radius
            length += float(np.linalg.norm(offset[:3]))
            offset = joint.origin @ np.array([0.0, 0.0, 0.0, 1.0])
        return result

    def _write_bodies(self) -> Iterator[tuple[Body, str, str]]:
        """Yield each body with the MJCF attributes of its geom and the MJCF of its mesh, "" without mesh."""
        for link in self.robot.link_names:
            for shape in self.robot.shapes:
                if shape.link_name == link:
                    attributes = f'type="{shape.type}" size="{_write_row(shape.size)}" {_write_pose(shape.origin)}'
                    yield Body(f"link {link}", link, link in self._hand_links), attributes, ""
        for board in self.hand.boards:
            if board.link_name is None or board.pose is None:
                raise HandGeometryError(self.hand.name)
            self.robot.get_link_index(board.link_name)  # raises UnknownLinkError
            name = f"board:{board.name}"
            mesh = f'<mesh name={quoteattr(name)} vertex="{_write_row(compute_board_vertices(self.hand, board))}"/>'
            attributes = f'type="mesh" mesh={quoteattr(name)} {_write_pose(board.pose)}'
            yield Body(f"board {board.name}", board.link_name, board.link_name in self._hand_links), attributes, mesh
        yield from self._write_surroundings()

    def _write_surroundings(self) -> Iterator[tuple[Body, str, str]]:
        """Yield table, object and stand with their MJCF, as `_write_bodies` does; only the table without an object."""
        around = self.surroundings
        yield Body("table", TABLE, False), f'type="plane" size="0 0 1" pos="0 0 {around.table_z_m!r}"', ""
        item, pose = around.grasp_object, around.object_pose
        if item is None or pose is None:
            return
        # The origin of an object frame is the centre of the bottom face; a geom of MuJoCo has its origin in its middle.
        middle = pose.copy()
        middle[:3, 3] += item.shape.height / 2 * pose[:3, 2]
        label = f"object {item.name}"
        if isinstance(item.shape, Cylinder):
            size = f"{item.shape.radius!r} {item.shape.height / 2!r}"
            yield Body(label, OBJECT, False), f'type="cylinder" size="{size}" {_write_pose(middle)}', ""
        else:
            mesh = f'<mesh name="object" vertex="{_write_row(item.shape.mesh()[0])}"/>'
            yield Body(label, OBJECT, False), f'type="mesh" mesh="object" {_write_pose(pose)}', mesh
        if around.stand_height_m > 0:
            low, high = item.shape.bounds
            half = np.array([*(high - low)[:2] / 2, around.stand_height_m / 2])
            stand = pose.copy()
            stand[:3, 3] += pose[:3, :2] @ ((low + high)[:2] / 2) - [0.0, 0.0, around.stand_height_m / 2]
            yield Body("stand", STAND, False), f'type="box" size="{_write_row(half)}" {_write_pose(stand)}', ""

    def _find_pairs(self) -> IndexArray:
        """Find the pairs of bodies that are checked, i64[p, 2]: those whose distance can change, except neighbours."""
        pairs = [
            (i, j)
            for i in range(len(self.bodies))
            for j in range(i + 1, len(self.bodies))
            if self._is_checked(self.bodies[i], self.bodies[j])
        ]
        return np.array(pairs, dtype=np.intp).reshape(-1, 2)

    def _is_within_hand(self, i: int, j: int) -> bool:
        """Return whether two bodies are parts of the hand or of the flange, which the arm moves as a whole.

        Criterion: the last moving joint of the arm is on the path from the root to each of the two links.
        """
        wrist = [joint for joint in self._paths[WRIST_LINK] if joint.axis is not None][-1:]
        return all(
            self.bodies[k].link in self._paths and set(map(id, wrist)) <= set(map(id, self._paths[self.bodies[k].link]))
            for k in (i, j)
        )

    def _is_checked(self, a: Body, b: Body) -> bool:
        """Return whether two bodies must be checked for collisions, by the number of revolute joints between them."""
        around = (TABLE, STAND, OBJECT)
        if a.link in around and b.link in around:
            return False
        if a.link in around or b.link in around:
            moving, other = (b, a) if a.link in around else (a, b)
            joints = sum(joint.axis is not None for joint in self._paths[moving.link])
            # The base stands on the table, and the first joint turns the next link about the vertical above it.
            return joints > _ARM_RELATED_JOINTS or (other.link != TABLE and joints > 0)
        path_a, path_b = self._paths[a.link], self._paths[b.link]
        common = sum(x is y for x, y in zip(path_a, path_b, strict=False))
        joints = sum(joint.axis is not None for joint in path_a[common:] + path_b[common:])
        return joints > (_HAND_RELATED_JOINTS if a.in_hand and b.in_hand else _ARM_RELATED_JOINTS)


def compute_board_vertices(hand: Hand, board: Board) -> FloatArray:
    """Compute the vertices f64[v, 3] of the hull of a board with bracket and soft layer, bracket frame, metres.

    The hull contains a square of one pitch over each taxel and each square of the margin: at the surface of the layer,
    and `BACKING_M` below the electrodes.
    """
    sheet = build_sheet(hand)
    on_board = sheet.board_index == hand.boards.index(board)
    position, normal, distal = sheet.position[on_board], sheet.normal[on_board], sheet.distal[on_board]
    lateral = np.cross(normal, distal)
    half = hand.pitch_m / 2
    corners = [position + half * (a * distal + b * lateral) for a in (-1, 1) for b in (-1, 1)]
    points = np.concatenate([corner + z * normal for corner in corners for z in (hand.layer_m or 0.0, -BACKING_M)])
    return points[ConvexHull(points).vertices]


def _find_links_below(robot: Robot, wrist: str) -> set[str]:
    """Find the link `wrist` and all links below it. Raises UnknownLinkError if there is no such link."""
    robot.get_link_index(wrist)
    links = {wrist}
    for joint in robot.joints:
        if joint.parent in links:
            links.add(joint.child)
    return links


def _find_joint_paths(robot: Robot) -> dict[str, list[Joint]]:
    """Find the joints from the root to each link, by name of the link."""
    paths: dict[str, list[Joint]] = {robot.root: []}
    for joint in robot.joints:
        paths[joint.child] = [*paths[joint.parent], joint]
    return paths


def _write_model(robot: Robot, texts: list[tuple[Body, str, str]]) -> str:
    """Return the MJCF of a robot with the given bodies; the geom of body k has the name "k".

    texts: each body with the MJCF of its geom's attributes and of its mesh.
    """
    geoms: dict[str, list[str]] = {}
    for index, (body, attributes, _) in enumerate(texts):
        geoms.setdefault(body.link, []).append(f'<geom name="{index}" {attributes}/>')
    around = "".join(line for link in (TABLE, STAND, OBJECT) for line in geoms.get(link, []))
    return f"""<mujoco><compiler angle="radian" boundmass="1e-3" boundinertia="1e-7"/>
<default><geom contype="0" conaffinity="0"/></default>
<asset>{"".join(mesh for _, _, mesh in texts)}</asset>
<worldbody>{around}{"".join(geoms.get(robot.root, []))}{_write_links(robot, robot.root, geoms)}</worldbody></mujoco>"""


def _write_links(robot: Robot, parent: str, geoms: dict[str, list[str]]) -> str:
    """Return the MJCF of all links below the link `parent`; geoms: MJCF of the geoms by link name."""
    text = ""
    for joint in robot.joints:
        if joint.parent == parent:
            hinge = (
                "" if joint.axis is None else f'<joint name={quoteattr(joint.name)} axis="{_write_row(joint.axis)}"/>'
            )
            inner = "".join(geoms.get(joint.child, [])) + _write_links(robot, joint.child, geoms)
            text += f"<body {_write_pose(joint.origin)}>{hinge}{inner}</body>"
    return text


def _write_row(values: npt.ArrayLike) -> str:
    """Format the numbers of an array for MJCF, separated by spaces, with all digits."""
    return " ".join(repr(float(value)) for value in np.asarray(values).ravel())


def _write_pose(transform: FloatArray) -> str:
    """Format a pose f64[4, 4] as the MJCF attributes pos and quat."""
    return f'pos="{_write_row(transform[:3, 3])}" quat="{_write_row(to_quaternion(transform))}"'
