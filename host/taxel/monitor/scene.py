"""The hand in 3-D, as shapes that any viewer can draw. Metres, in the frame of the hand's base."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.hand import Hand
from taxel.hand.errors import HandGeometryError
from taxel.hand.kinematics import Kinematics, compute_taxel_normals, compute_taxel_positions
from taxel.hand.robot import Robot, Shape, load_robot

LIFT_M = 0.001
"""A taxel is drawn so far above its electrode, so that it stands out of what carries it."""

ROOT = "palm"
"""Link that a hand is drawn from, where its robot has one: without the arm."""

OPEN_HAND = {"th_j0": 0.9, "th_j1": 0.3, "th_j2": 0.2}
"""Joint angles of the drawn hand, radians; others at 0 or as near as their range allows. The true ones are unknown."""


@dataclass(frozen=True, eq=False)
class HandScene:
    """Everything to draw.

    Attributes:
        position: f64[n, 3], where taxels are drawn. size_m: side of a taxel.
        links: shapes of the robot with their poses f64[4, 4].
        board_position: f64[b, 3], the middle of each board, a little above it.
        outwards: f64[3], unit vector that the palm (or a flat skin) faces. up: f64[3], where its fingers point.
    """

    position: NDArray[np.float64]
    size_m: float
    links: tuple[tuple[Shape, NDArray[np.float64]], ...]
    board_position: NDArray[np.float64]
    outwards: NDArray[np.float64]
    up: NDArray[np.float64]

    @property
    def centre(self) -> NDArray[np.float64]:
        """The middle of all taxels, [3]."""
        return np.asarray(0.5 * (self.position.min(axis=0) + self.position.max(axis=0)))

    @property
    def radius(self) -> float:
        """Of the ball around the centre that holds all taxels."""
        return float(np.linalg.norm(self.position - self.centre, axis=1).max())


def scene_of(hand: Hand) -> HandScene:
    """The scene of a hand; raises `HandGeometryError` if its description does not say where its taxels are."""
    if hand.robot is None:
        raise HandGeometryError(hand.name)
    robot = load_robot(hand.robot)
    if ROOT in robot.links:
        robot = robot.get_subtree(ROOT)
    kinematics = Kinematics(robot, hand)
    angles = _angles(robot)
    links, brackets = kinematics.compute_link_poses(angles), kinematics.compute_sensor_poses(angles)
    position, normal = compute_taxel_positions(hand, brackets), compute_taxel_normals(hand, brackets)
    distal = np.einsum("nij,nj->ni", brackets[hand.board_index, :3, :3], hand.distal)
    middles = [
        (position + 0.01 * normal)[hand.get_slice(board.address)].mean(axis=0) for board in hand.boards
    ]  # a centimetre off the skin, for a name
    first = hand.get_slice(hand.boards[0].address)
    return HandScene(
        position=position + LIFT_M * normal,
        size_m=hand.size_m,
        links=tuple((shape, links[robot.get_link_index(shape.link)] @ shape.origin) for shape in robot.shapes),
        board_position=np.array(middles),
        outwards=_unit(normal[first].mean(axis=0)),
        up=_unit(distal[first].mean(axis=0)),
    )


def _angles(robot: Robot) -> NDArray[np.float64]:
    angles = np.array([OPEN_HAND.get(name, 0.0) for name in robot.joint_names])
    return np.asarray(np.clip(angles, robot.lower, robot.upper))


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
