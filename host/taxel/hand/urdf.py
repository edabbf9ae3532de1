"""Export of a robot, and of the skin brackets on it, as URDF."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from taxel.hand.boards import Board
from taxel.hand.description import Hand
from taxel.hand.errors import HandGeometryError
from taxel.hand.robot import Joint, Robot, Shape
from taxel.hand.transforms import to_rpy

DENSITY_KG_M3 = 800.0
"""Density of every link with solid shapes; value of the public Allegro model."""

# URDF requires an effort and a velocity limit, which descriptions do not contain. The values exceed those of every
# joint of an arm of this size and do not describe a motor.
EFFORT_NM = 150.0
VELOCITY_RAD_S = 10.0

DEFAULT_RADIUS_M = 0.02
"""Radius of the sphere whose inertia is used for a moving link without shapes: simulators reject a mass of 0."""

# Mass (kg), centre of mass f64[3] (metres) and inertia about it f64[3, 3] (kg m2), in the link frame.
_Body = tuple[float, NDArray[np.float64], NDArray[np.float64]]


def format_urdf(robot: Robot, hand: Hand | None = None) -> str:
    """Format the URDF of a robot; with a hand, every bracket is a link fixed to the link that carries it.

    The link of a bracket has the name of its board; if a link with this name exists (the palm), `_bracket` is appended.
    The text is deterministic and numbers keep all digits. Boxes and capsules (a cylinder and two spheres) are both
    visual and collision geometry. Masses follow from `DENSITY_KG_M3`; overlapping shapes count twice.

    Args:
        robot: its root is the root link of the URDF.
        hand: the skin; None for the robot alone.

    Raises:
        HandGeometryError: the hand description contains no bracket poses.
        UnknownLinkError: a bracket is on a link that the robot does not have.
    """
    root = ET.Element("robot", name=robot.name)
    moving = {joint.child for joint in robot.joints if joint.axis is not None}
    for link in robot.link_names:
        shapes = [shape for shape in robot.shapes if shape.link_name == link]
        _add_link(root, link, shapes, is_moving=link in moving)
    for joint in robot.joints:
        _add_joint(root, joint)
    if hand is not None:
        _add_brackets(root, robot, hand)
    ET.indent(root)
    return '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _add_brackets(root: ET.Element, robot: Robot, hand: Hand) -> None:
    """Add a link and a fixed joint for the bracket of each board to the URDF element `root`.

    Raises HandGeometryError and UnknownLinkError as `format_urdf`.
    """
    links, joints = set(robot.link_names), {joint.name for joint in robot.joints}
    for board in hand.boards:
        parent_link, origin = _get_mounting(hand, board)
        robot.get_link_index(parent_link)  # raises UnknownLinkError
        link, joint = _make_unique(board.name, links), _make_unique(board.name, joints)
        links.add(link)
        joints.add(joint)
        ET.SubElement(root, "link", name=link)
        _add_joint(root, Joint(joint, parent_link, link, origin))


def _get_mounting(hand: Hand, board: Board) -> tuple[str, NDArray[np.float64]]:
    """Return the link to which a board is attached, and the pose f64[4, 4] of its bracket on that link.

    Raises HandGeometryError if the description does not contain them.
    """
    if board.link_name is None or board.pose is None:
        raise HandGeometryError(hand.name)
    return board.link_name, board.pose


def _make_unique(name: str, used_names: set[str]) -> str:
    """Return `name`, with the suffix "_bracket" appended until it differs from all used names."""
    while name in used_names:
        name += "_bracket"
    return name


def _add_joint(root: ET.Element, joint: Joint) -> None:
    """Append a fixed or revolute joint to the URDF element `root`."""
    element = ET.SubElement(root, "joint", name=joint.name, type="fixed" if joint.axis is None else "revolute")
    _add_origin(element, joint.origin)
    ET.SubElement(element, "parent", link=joint.parent)
    ET.SubElement(element, "child", link=joint.child)
    if joint.axis is not None:
        ET.SubElement(element, "axis", xyz=_format_numbers(joint.axis))
        limit = {"lower": joint.lower, "upper": joint.upper, "effort": EFFORT_NM, "velocity": VELOCITY_RAD_S}
        ET.SubElement(element, "limit", {key: _format_numbers([value]) for key, value in limit.items()})


def _add_link(root: ET.Element, name: str, shapes: list[Shape], *, is_moving: bool) -> None:
    """Add a link with inertia, visual and collision shapes to the URDF element `root`.

    A moving link without shapes has the inertia of a small sphere, a fixed link without shapes has none.
    """
    element = ET.SubElement(root, "link", name=name)
    if shapes:
        _add_inertial(element, _combine_bodies([_build_body(shape) for shape in shapes]))
    elif is_moving:
        mass, inertia = _compute_sphere(DEFAULT_RADIUS_M)
        _add_inertial(element, (mass, np.zeros(3), inertia))
    for role in ("visual", "collision"):
        for shape in shapes:
            _add_shape(element, role, shape)


def _add_shape(element: ET.Element, role: str, shape: Shape) -> None:
    """Add a collision shape to a link of the URDF; a capsule becomes a cylinder with two spheres.

    element: the link. role: "visual" or "collision".
    """
    if shape.type == "box":
        size = _format_numbers(2.0 * np.array(shape.size))
        ET.SubElement(_add_geometry(element, role, shape.origin), "box", size=size)
        return
    radius, half_length = shape.size
    cylinder = _add_geometry(element, role, shape.origin)
    ET.SubElement(cylinder, "cylinder", radius=_format_numbers([radius]), length=_format_numbers([2.0 * half_length]))
    for end in (half_length, -half_length):
        centre = shape.origin.copy()
        centre[:3, 3] += end * shape.origin[:3, 2]
        ET.SubElement(_add_geometry(element, role, centre), "sphere", radius=_format_numbers([radius]))


def _add_geometry(element: ET.Element, role: str, origin: NDArray[np.float64]) -> ET.Element:
    """Append a URDF element such as "visual" with its pose, and return its new, empty "geometry" element.

    element: parent of the new element. role: tag of the new element. origin: pose f64[4, 4] in the frame of the parent
    link.
    """
    part = ET.SubElement(element, role)
    _add_origin(part, origin)
    return ET.SubElement(part, "geometry")


def _add_origin(element: ET.Element, origin: NDArray[np.float64]) -> None:
    """Append a pose f64[4, 4] to a URDF element as its "origin" (position, roll, pitch and yaw)."""
    ET.SubElement(element, "origin", xyz=_format_numbers(origin[:3, 3]), rpy=_format_numbers(to_rpy(origin)))


def _add_inertial(element: ET.Element, body: _Body) -> None:
    """Append mass (kg), centre of mass (metres) and inertia tensor (kg m^2) to a link of the URDF."""
    mass, centre, inertia = body
    inertial = ET.SubElement(element, "inertial")
    ET.SubElement(inertial, "origin", xyz=_format_numbers(centre), rpy=_format_numbers(np.zeros(3)))
    ET.SubElement(inertial, "mass", value=_format_numbers([mass]))
    pairs = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    ET.SubElement(inertial, "inertia", {key: _format_numbers([inertia[pair]]) for key, pair in pairs.items()})


def _build_body(shape: Shape) -> _Body:
    """Compute mass (kg), centre (metres) and inertia tensor (kg m^2) of a uniform shape, in the frame of its link."""
    mass, inertia = _compute_box(*shape.size) if shape.type == "box" else _compute_capsule(*shape.size)
    rotation = shape.origin[:3, :3]
    return mass, shape.origin[:3, 3], rotation @ inertia @ rotation.T


def _combine_bodies(bodies: list[_Body]) -> _Body:
    """Combine several rigid bodies into one: mass, centre and inertia tensor (parallel axis theorem)."""
    total = sum(mass for mass, _, _ in bodies)
    centre = np.sum([mass * position for mass, position, _ in bodies], axis=0) / total
    inertia = np.zeros((3, 3))
    for mass, position, inertia_about_centre in bodies:
        arm = position - centre
        inertia += inertia_about_centre + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return total, centre, inertia


def _compute_box(x: float, y: float, z: float) -> tuple[float, NDArray[np.float64]]:
    """Compute mass (kg) and inertia tensor f64[3, 3] (kg m^2) of a box with half sizes x, y, z, metres."""
    mass = DENSITY_KG_M3 * 8.0 * x * y * z
    return mass, mass / 3.0 * np.diag([y * y + z * z, x * x + z * z, x * x + y * y])


def _compute_sphere(radius: float) -> tuple[float, NDArray[np.float64]]:
    """Compute mass (kg) and inertia tensor f64[3, 3] (kg m^2) of a sphere; radius: metres."""
    mass = DENSITY_KG_M3 * 4.0 / 3.0 * math.pi * radius**3
    return mass, 0.4 * mass * radius**2 * np.eye(3)


def _compute_capsule(radius: float, half_length: float) -> tuple[float, NDArray[np.float64]]:
    """Compute mass (kg) and inertia tensor f64[3, 3] (kg m^2) of a capsule along z; lengths in metres.

    A capsule is a cylinder with a half sphere at each end. The centre of mass of a half sphere is 3/8 of the radius
    from its flat face.
    """
    # Moving each half sphere outwards adds m ((h + 3/8 r)^2 - (3/8 r)^2) = m h (h + 3/4 r), with half length h.
    cylinder = DENSITY_KG_M3 * 2.0 * math.pi * radius**2 * half_length
    caps, caps_inertia = _compute_sphere(radius)
    across = cylinder * (radius**2 / 4.0 + half_length**2 / 3.0) + caps * half_length * (half_length + 0.75 * radius)
    return cylinder + caps, caps_inertia + np.diag([across, across, cylinder * radius**2 / 2.0])


def _format_numbers(values: Iterable[float]) -> str:
    """Format numbers with all digits; adding 0.0 converts a negative zero to zero."""
    return " ".join(repr(float(value) + 0.0) for value in values)
