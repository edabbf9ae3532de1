"""The robot that carries a skin: its tree of joints and the extents of its links, from a description file."""

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
    """A joint and the link that it moves.

    Attributes:
        origin: the child's frame in the parent's when the joint is at 0, f64[4, 4].
        axis: unit vector in the child's frame, f64[3]; None for a fixed joint.
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
    """A box or a capsule (along z) that fills part of a link; `size`: half sizes [3], or radius and half length [2]."""

    link: str
    type: str
    size: tuple[float, ...]
    origin: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Robot:
    """A tree of links.

    Attributes:
        joints: every joint, parents before children.
        joint_names: the revolute joints in that order: the last axis of every array of joint angles.
        links: the root, then each joint's child: the link axis of every array of poses.
    """

    name: str
    description: str
    root: str
    joints: tuple[Joint, ...]
    shapes: tuple[Shape, ...]
    joint_names: tuple[str, ...] = field(init=False)
    links: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        names = tuple(joint.name for joint in self.joints if joint.axis is not None)
        object.__setattr__(self, "joint_names", names)
        object.__setattr__(self, "links", (self.root, *(joint.child for joint in self.joints)))

    @property
    def lower(self) -> NDArray[np.float64]:
        """Lower limits of the revolute joints, radians, f64[j]."""
        return np.array([joint.lower for joint in self.joints if joint.axis is not None])

    @property
    def upper(self) -> NDArray[np.float64]:
        """Upper limits of the revolute joints, radians, f64[j]."""
        return np.array([joint.upper for joint in self.joints if joint.axis is not None])

    def get_link_index(self, link: str) -> int:
        """Place of a link on the link axis; UnknownLinkError if there is none of that name."""
        try:
            return self.links.index(link)
        except ValueError:
            raise UnknownLinkError(self.name, link, self.links) from None

    def get_subtree(self, link: str) -> Robot:
        """The part of the robot that hangs on a link, which becomes the root; UnknownLinkError if there is none."""
        kept = {self.links[self.get_link_index(link)]}
        joints = []
        for joint in self.joints:
            if joint.parent in kept:
                kept.add(joint.child)
                joints.append(joint)
        shapes = tuple(shape for shape in self.shapes if shape.link in kept)
        return replace(self, root=link, joints=tuple(joints), shapes=shapes)

    def joint_of(self, link: str) -> Joint:
        """The joint that moves a link; UnknownLinkError for the root or an unknown link."""
        for joint in self.joints:
            if joint.child == link:
                return joint
        raise UnknownLinkError(self.name, link, self.links[1:])


def list_packaged_robots() -> list[str]:
    """Names of the robots that come with the library, sorted."""
    return sorted(entry.name.removesuffix(_SUFFIX) for entry in _folder().iterdir() if entry.name.endswith(_SUFFIX))


def load_robot(name_or_path: str | os.PathLike[str]) -> Robot:
    """Load a robot description.

    Args:
        name_or_path: a packaged name ("ur5e_allegro", "plate"), or else a path to a TOML file.

    Raises:
        HandDescriptionError: no such name or file, not readable, or a mistake in it.
    """
    if name_or_path in list_packaged_robots():
        file = f"{name_or_path}{_SUFFIX}"
        return _build(parse_robot(_folder().joinpath(file).read_bytes(), file))
    file = format_path(os.fspath(name_or_path))
    return _build(parse_robot(read_description(name_or_path, "robot", list_packaged_robots()), file))


def _folder() -> Any:
    return resources.files("taxel.hand").joinpath("robots")


def _origin(table: dict[str, Any]) -> NDArray[np.float64]:
    position = np.array(table.get("position_m", [0.0, 0.0, 0.0]), dtype=float)
    return make_pose(position, np.array(table.get("quaternion_wxyz", [1.0, 0.0, 0.0, 0.0]), dtype=float))


def _build(document: dict[str, Any]) -> Robot:
    by_parent: dict[str, list[dict[str, Any]]] = {}
    for table in document["joints"]:
        by_parent.setdefault(table["parent"], []).append(table)
    return Robot(
        document["name"],
        document["description"],
        document["root"],
        tuple(_ordered(document["root"], by_parent)),
        tuple(_build_shape(table) for table in document.get("shapes", [])),
    )


def _ordered(link: str, by_parent: dict[str, list[dict[str, Any]]]) -> list[Joint]:
    """Joints below a link, parents first, each branch in the file's order."""
    joints: list[Joint] = []
    waiting = list(reversed(by_parent.get(link, [])))
    while waiting:
        table = waiting.pop()
        joints.append(_build_joint(table))
        waiting += reversed(by_parent.get(table["child"], []))
    return joints


def _build_joint(table: dict[str, Any]) -> Joint:
    origin = _origin(table)
    if table["type"] == "fixed":
        return Joint(table["name"], table["parent"], table["child"], origin)
    axis = np.array(table["axis"], dtype=float)
    lower, upper = map(float, table["range_rad"])
    return Joint(table["name"], table["parent"], table["child"], origin, axis / np.linalg.norm(axis), lower, upper)


def _build_shape(table: dict[str, Any]) -> Shape:
    if table["type"] == "box":
        return Shape(table["link"], "box", tuple(map(float, table["half_size_m"])), _origin(table))
    return Shape(table["link"], "capsule", (float(table["radius_m"]), float(table["half_length_m"])), _origin(table))
