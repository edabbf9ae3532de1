"""Three-dimensional shapes of a hand for a viewer, in metres and in the frame of the hand's base."""

from dataclasses import dataclass

import numpy as np

from taxel.hand import Hand
from taxel.hand.errors import HandGeometryError
from taxel.hand.kinematics import Kinematics, compute_taxel_normals, compute_taxel_positions
from taxel.hand.robot import Robot, Shape, load_robot
from taxel.types import FloatArray

LIFT_M = 0.001
"""Distance of a drawn taxel from its electrode along the normal, metres, so that the link does not cover it."""

BOARD_LIFT_M = 0.01
"""Distance of a board's name from the skin, metres."""

ROOT = "palm"
"""Root of the drawn part of a robot that has this link: the hand without the arm."""

OPEN_HAND = {"th_j0": 0.9, "th_j1": 0.3, "th_j2": 0.2}
"""Joint angles of the drawn hand, radians; other joints are at 0, or at the nearest angle in their range. The monitor
receives no joint angles.
"""


@dataclass(frozen=True, eq=False)
class HandScene:
    """Shapes and positions of a hand to draw in 3D, metres.

    Attributes:
        position: f64[n, 3], positions of the drawn taxels. size_m: side of a taxel.
        links: shapes of the robot with their poses f64[4, 4].
        board_position: f64[b, 3], a point 1 cm above the centre of each board.
        outwards: f64[3], unit normal of the palm (or of a flat skin). up: f64[3], unit vector towards the fingertips.
    """

    position: FloatArray
    size_m: float
    links: tuple[tuple[Shape, FloatArray], ...]
    board_position: FloatArray
    outwards: FloatArray
    up: FloatArray

    @property
    def centre(self) -> FloatArray:
        """Centre of the bounding box of all taxels, f64[3]."""
        return np.asarray(0.5 * (self.position.min(axis=0) + self.position.max(axis=0)))

    @property
    def radius(self) -> float:
        """Radius of the sphere around the centre that contains all taxels."""
        return float(np.linalg.norm(self.position - self.centre, axis=1).max())


def build_scene(hand: Hand) -> HandScene:
    """Build the 3D scene of a hand: poses of its links, positions of its taxels, and viewing directions.

    Raises `HandGeometryError` for a hand description without geometry.
    """
    if hand.robot is None:
        raise HandGeometryError(hand.name)
    robot = load_robot(hand.robot)
    if ROOT in robot.link_names:
        robot = robot.get_subtree(ROOT)
    kinematics = Kinematics(robot, hand)
    angles = _compute_drawn_angles(robot)
    links, brackets = kinematics.compute_link_poses(angles), kinematics.compute_sensor_poses(angles)
    position, normal = compute_taxel_positions(hand, brackets), compute_taxel_normals(hand, brackets)
    # The distal directions of the taxels, rotated from the frames of their brackets to the frame of the scene.
    distal = np.einsum("nij,nj->ni", brackets[hand.board_index, :3, :3], hand.distal)
    lifted = position + BOARD_LIFT_M * normal
    centres = [lifted[hand.get_slice(board.address)].mean(axis=0) for board in hand.boards]
    first = hand.get_slice(hand.boards[0].address)
    return HandScene(
        position=position + LIFT_M * normal,
        size_m=hand.size_m,
        links=tuple((shape, links[robot.get_link_index(shape.link_name)] @ shape.origin) for shape in robot.shapes),
        board_position=np.array(centres),
        outwards=_normalise(normal[first].mean(axis=0)),
        up=_normalise(distal[first].mean(axis=0)),
    )


def _compute_drawn_angles(robot: Robot) -> FloatArray:
    """Compute the joint angles of the drawn hand, f64[j] for j joints, radians, limited to the joint ranges."""
    angles = np.array([OPEN_HAND.get(name, 0.0) for name in robot.joint_names])
    return np.asarray(np.clip(angles, robot.lower, robot.upper))


def _normalise(vector: FloatArray) -> FloatArray:
    """Divide a vector by its length; a zero vector becomes (0, 0, 1)."""
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
