"""A robot, and the brackets of the skin on it, as URDF text for other people's tools."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from taxel.hand.description import Board, Hand
from taxel.hand.errors import HandGeometryError
from taxel.hand.robot import Joint, Robot, Shape
from taxel.hand.transforms import to_rpy

DENSITY_KG_M3 = 800.0  # of every link, its shapes taken as solid: the density of the public Allegro model
# A description gives no strength and no speed, and URDF demands both. No joint of an arm this size exceeds these: they
# keep tools from refusing the file and say nothing about a motor.
EFFORT_NM = 150.0
VELOCITY_RAD_S = 10.0
# A moving link without a shape gets the inertia of this sphere, since simulators refuse a moving link without mass.
BARE_RADIUS_M = 0.02

# Mass in kg, centre of mass f64[3] and inertia about it f64[3, 3] along the link's axes: metres, kg m2.
_Body = tuple[float, NDArray[np.float64], NDArray[np.float64]]


def format_urdf(robot: Robot, hand: Hand | None = None) -> str:
    """The URDF of a robot; with a hand, every bracket too, as a link fixed to the one that carries it.

    A bracket's link has the name of its board; where a link has that name (the palm), `_bracket` is added. The same
    robot and hand always give the same text, and numbers keep all their digits. Boxes and capsules (a cylinder and two
    spheres) are both visual and collision; masses follow from `DENSITY_KG_M3`, shapes that overlap counting twice.

    Args:
        robot: the tree of joints; its root is the URDF's root link.
        hand: the skin, or None for the bare robot.

    Raises:
        HandGeometryError: the hand's description does not say where its brackets are.
        UnknownLinkError: a bracket is on a link that the robot does not have.
    """
    root = ET.Element("robot", name=robot.name)
    moving = {joint.child for joint in robot.joints if joint.axis is not None}
    for link in robot.links:
        shapes = [shape for shape in robot.shapes if shape.link == link]
        _add_link(root, link, shapes, moves=link in moving)
    for joint in robot.joints:
        _add_joint(root, joint)
    if hand is not None:
        _add_brackets(root, robot, hand)
    ET.indent(root)
    return '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _add_brackets(root: ET.Element, robot: Robot, hand: Hand) -> None:
    links, joints = set(robot.links), {joint.name for joint in robot.joints}
    for board in hand.boards:
        carrier, origin = _place(hand, board)
        robot.get_link_index(carrier)  # raises UnknownLinkError
        link, joint = _free(board.name, links), _free(board.name, joints)
        links.add(link)
        joints.add(joint)
        ET.SubElement(root, "link", name=link)
        _add_joint(root, Joint(joint, carrier, link, origin))


def _place(hand: Hand, board: Board) -> tuple[str, NDArray[np.float64]]:
    if board.link is None or board.pose is None:
        raise HandGeometryError(hand.name)
    return board.link, board.pose


def _free(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_bracket"
    return name


def _add_joint(root: ET.Element, joint: Joint) -> None:
    element = ET.SubElement(root, "joint", name=joint.name, type="fixed" if joint.axis is None else "revolute")
    _add_origin(element, joint.origin)
    ET.SubElement(element, "parent", link=joint.parent)
    ET.SubElement(element, "child", link=joint.child)
    if joint.axis is not None:
        ET.SubElement(element, "axis", xyz=_numbers(joint.axis))
        limit = {"lower": joint.lower, "upper": joint.upper, "effort": EFFORT_NM, "velocity": VELOCITY_RAD_S}
        ET.SubElement(element, "limit", {key: _numbers([value]) for key, value in limit.items()})


def _add_link(root: ET.Element, name: str, shapes: list[Shape], *, moves: bool) -> None:
    element = ET.SubElement(root, "link", name=name)
    if shapes:
        _add_inertial(element, _together([_body(shape) for shape in shapes]))
    elif moves:
        mass, inertia = _ball(BARE_RADIUS_M)
        _add_inertial(element, (mass, np.zeros(3), inertia))
    for role in ("visual", "collision"):
        for shape in shapes:
            _add_shape(element, role, shape)


def _add_shape(element: ET.Element, role: str, shape: Shape) -> None:
    if shape.type == "box":
        size = _numbers(2.0 * np.array(shape.size))
        ET.SubElement(_add_geometry(element, role, shape.origin), "box", size=size)
        return
    radius, half_length = shape.size
    cylinder = _add_geometry(element, role, shape.origin)
    ET.SubElement(cylinder, "cylinder", radius=_numbers([radius]), length=_numbers([2.0 * half_length]))
    for end in (half_length, -half_length):
        centre = shape.origin.copy()
        centre[:3, 3] += end * shape.origin[:3, 2]
        ET.SubElement(_add_geometry(element, role, centre), "sphere", radius=_numbers([radius]))


def _add_geometry(element: ET.Element, role: str, origin: NDArray[np.float64]) -> ET.Element:
    part = ET.SubElement(element, role)
    _add_origin(part, origin)
    return ET.SubElement(part, "geometry")


def _add_origin(element: ET.Element, origin: NDArray[np.float64]) -> None:
    ET.SubElement(element, "origin", xyz=_numbers(origin[:3, 3]), rpy=_numbers(to_rpy(origin)))


def _add_inertial(element: ET.Element, body: _Body) -> None:
    mass, centre, inertia = body
    inertial = ET.SubElement(element, "inertial")
    ET.SubElement(inertial, "origin", xyz=_numbers(centre), rpy=_numbers(np.zeros(3)))
    ET.SubElement(inertial, "mass", value=_numbers([mass]))
    pairs = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    ET.SubElement(inertial, "inertia", {key: _numbers([inertia[pair]]) for key, pair in pairs.items()})


def _body(shape: Shape) -> _Body:
    mass, inertia = _brick(*shape.size) if shape.type == "box" else _capsule(*shape.size)
    turn = shape.origin[:3, :3]
    return mass, shape.origin[:3, 3], turn @ inertia @ turn.T


def _together(bodies: list[_Body]) -> _Body:
    """Several bodies as one (parallel axis theorem)."""
    total = sum(mass for mass, _, _ in bodies)
    centre = np.sum([mass * place for mass, place, _ in bodies], axis=0) / total
    inertia = np.zeros((3, 3))
    for mass, place, own in bodies:
        arm = place - centre
        inertia += own + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return total, centre, inertia


def _brick(x: float, y: float, z: float) -> tuple[float, NDArray[np.float64]]:
    """Mass and inertia of a box of these half sizes."""
    mass = DENSITY_KG_M3 * 8.0 * x * y * z
    return mass, mass / 3.0 * np.diag([y * y + z * z, x * x + z * z, x * x + y * y])


def _ball(radius: float) -> tuple[float, NDArray[np.float64]]:
    """Mass and inertia of a sphere."""
    mass = DENSITY_KG_M3 * 4.0 / 3.0 * math.pi * radius**3
    return mass, 0.4 * mass * radius**2 * np.eye(3)


def _capsule(radius: float, half_length: float) -> tuple[float, NDArray[np.float64]]:
    """Mass and inertia of a capsule along z: a cylinder and two half spheres, whose centres of mass lie 3/8 r out."""
    tube = DENSITY_KG_M3 * 2.0 * math.pi * radius**2 * half_length
    caps, caps_inertia = _ball(radius)
    across = tube * (radius**2 / 4.0 + half_length**2 / 3.0) + caps * half_length * (half_length + 0.75 * radius)
    return tube + caps, caps_inertia + np.diag([across, across, tube * radius**2 / 2.0])


def _numbers(values: Iterable[float]) -> str:
    """Numbers with all their digits; adding 0.0 turns a negative zero into a plain one."""
    return " ".join(repr(float(value) + 0.0) for value in values)
