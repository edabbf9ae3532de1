"""Model of the robot that carries a skin: joint tree and link shapes, loaded from a description file."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import UnknownLinkError, format_path
from taxel.hand.robot_schema import parse_robot
from taxel.hand.toml_text import read_description
from taxel.hand.transforms import make_pose

_SUFFIX = ".toml"


@dataclass(frozen=True, eq=False)
class Joint:
    """Joint and the link that it moves.

    Attributes:
        parent, child: link names.
        origin: pose of the child in the frame of the parent at joint angle 0, f64[4, 4].
        axis: unit vector in the frame of the child, f64[3]; None for a fixed joint.
        lower, upper: range of a revolute joint, radians.
    """

    name: str
    parent: str
    child: str
    origin: NDArray[np.float64]
    axis: NDArray[np.float64] | None = None
    lower: float = 0.0
    upper: float = 0.0


@dataclass(frozen=True, eq=False)
class Shape:
    """Box, or capsule along z, that fills a part of a link.

    `size`: half sizes (x, y, z) of a box; radius and half length of a capsule; metres.
    """

    link_name: str
    type: str
    size: tuple[float, ...]
    origin: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Robot:
    """Tree of links and joints of a robot, such as an arm with a hand.

    Attributes:
        joints: every joint, parents before children.
        root: name of the root link.
        joint_names: revolute joints in the order of `joints`; last axis of every array of joint angles.
        link_names: the root, then the child of each joint; link axis of every array of poses.
    """

    name: str
    description: str
    root: str
    joints: tuple[Joint, ...]
    shapes: tuple[Shape, ...]
    joint_names: tuple[str, ...] = field(init=False)
    link_names: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        """Set `joint_names` (revolute joints only) and `link_names` (root first) from the joints."""
        names = tuple(joint.name for joint in self.joints if joint.axis is not None)
        object.__setattr__(self, "joint_names", names)
        object.__setattr__(self, "link_names", (self.root, *(joint.child for joint in self.joints)))

    @property
    def lower(self) -> NDArray[np.float64]:
        """Lower limits of the revolute joints, radians, f64[j]."""
        return np.array([joint.lower for joint in self.joints if joint.axis is not None])

    @property
    def upper(self) -> NDArray[np.float64]:
        """Upper limits of the revolute joints, radians, f64[j]."""
        return np.array([joint.upper for joint in self.joints if joint.axis is not None])

    def get_link_index(self, link_name: str) -> int:
        """Return the index of a link on the link axis. Raises UnknownLinkError if there is no such link."""
        try:
            return self.link_names.index(link_name)
        except ValueError:
            raise UnknownLinkError(self.name, link_name, self.link_names) from None

    def get_subtree(self, root: str) -> Robot:
        """Return the robot below a link, which becomes the root. Raises UnknownLinkError if there is no such link."""
        subtree = {self.link_names[self.get_link_index(root)]}
        joints = []
        for joint in self.joints:
            if joint.parent in subtree:
                subtree.add(joint.child)
                joints.append(joint)
        shapes = tuple(shape for shape in self.shapes if shape.link_name in subtree)
        return replace(self, root=root, joints=tuple(joints), shapes=shapes)


def list_packaged_robots() -> list[str]:
    """List the names of the packaged robot descriptions, sorted."""
    return sorted(entry.name.removesuffix(_SUFFIX) for entry in _get_folder().iterdir() if entry.name.endswith(_SUFFIX))


def load_robot(name_or_path: str | os.PathLike[str]) -> Robot:
    """Load a robot description.

    Args:
        name_or_path: a packaged name ("ur5e_allegro", "plate") or a path to a TOML file.

    Raises:
        HandDescriptionError: unknown name, missing or unreadable file, or an error in the file.
    """
    if name_or_path in list_packaged_robots():
        file = f"{name_or_path}{_SUFFIX}"
        return _build_robot(parse_robot(_get_folder().joinpath(file).read_bytes(), file))
    file = format_path(os.fspath(name_or_path))
    return _build_robot(parse_robot(read_description(name_or_path, "robot", list_packaged_robots()), file))


def _get_folder() -> Any:
    """Return the folder of the packaged robot descriptions."""
    return resources.files("taxel.hand").joinpath("robots")


def _build_origin(table: dict[str, Any]) -> NDArray[np.float64]:
    """Build the pose f64[4, 4] of a joint or shape from its table; position and quaternion are optional."""
    position = np.array(table.get("position_m", [0.0, 0.0, 0.0]), dtype=float)
    return make_pose(position, np.array(table.get("quaternion_wxyz", [1.0, 0.0, 0.0, 0.0]), dtype=float))


def _build_robot(document: dict[str, Any]) -> Robot:
    """Build a robot from its checked description; joints are sorted so that parents precede children."""
    by_parent: dict[str, list[dict[str, Any]]] = {}
    for table in document["joints"]:
        by_parent.setdefault(table["parent"], []).append(table)
    return Robot(
        document["name"],
        document["description"],
        document["root"],
        tuple(_order_joints(document["root"], by_parent)),
        tuple(_build_shape(table) for table in document.get("shapes", [])),
    )


def _order_joints(link: str, by_parent: dict[str, list[dict[str, Any]]]) -> list[Joint]:
    """Build the joints below a link, parents first, each branch in the order of the file."""
    joints: list[Joint] = []
    pending = list(reversed(by_parent.get(link, [])))
    while pending:
        table = pending.pop()
        joints.append(_build_joint(table))
        pending += reversed(by_parent.get(table["child"], []))
    return joints


def _build_joint(table: dict[str, Any]) -> Joint:
    """Build a joint from its checked table in the robot description."""
    origin = _build_origin(table)
    if table["type"] == "fixed":
        return Joint(table["name"], table["parent"], table["child"], origin)
    axis = np.array(table["axis"], dtype=float)
    lower, upper = map(float, table["range_rad"])
    return Joint(table["name"], table["parent"], table["child"], origin, axis / np.linalg.norm(axis), lower, upper)


def _build_shape(table: dict[str, Any]) -> Shape:
    """Build a collision shape (box or capsule) from its checked table in the robot description."""
    if table["type"] == "box":
        return Shape(table["link"], "box", tuple(map(float, table["half_size_m"])), _build_origin(table))
    return Shape(
        table["link"], "capsule", (float(table["radius_m"]), float(table["half_length_m"])), _build_origin(table)
    )
