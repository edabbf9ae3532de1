"""Collisions of postures and paths by Pinocchio and Coal, independent of the planner.

Kinematics: Pinocchio, from the URDF of the robot. Bodies: the URDF's boxes, cylinders and spheres, the convex hulls of
the boards from their taxels, a box as table. Distances: Coal. Neither MuJoCo nor `taxel.planning` is used, and paths
are sampled instead of bounded.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull

from taxel.grasp.objects import GraspObject
from taxel.grasp.shapes import Cylinder
from taxel.hand import Hand
from taxel.hand.robot import Robot
from taxel.hand.urdf import format_urdf
from taxel.types import FloatArray

STEP_M = 0.002
"""Largest motion of a point of the hand between two samples of a path, metres; below half of the clearance."""

REACH_M = (1.5, 1.5, 1.1, 0.7, 0.6, 0.25)
"""Largest distance of a point of the hand from each axis of the arm, metres: lengths of the links beyond, stretched."""

FINGER_REACH_M = 0.25
"""Largest distance of a point of a finger from an axis of the finger, metres."""

BOARD_BACK_M = 0.002
"""Thickness of circuit and bracket under the electrodes, metres."""

TABLE_HALF_M = (3.0, 3.0, 0.5)


@dataclass(frozen=True)
class Overlap:
    """Two overlapping bodies. first, second: names. depth_m: depth of the overlap. sample: index of the posture."""

    first: str
    second: str
    depth_m: float
    sample: int

    def __str__(self) -> str:
        """Format the overlap as one line."""
        return f"{self.first} and {self.second} overlap by {self.depth_m * 1e3:.2f} mm in sample {self.sample}"


class IndependentCheck:
    """Collision check of a robot with its skin, a table at height `table_z_m`, and an object at its pose f64[4, 4]."""

    def __init__(
        self, robot: Robot, hand: Hand, table_z_m: float, grasp_object: GraspObject, object_pose: FloatArray
    ) -> None:
        """Build Pinocchio's model of the robot and Coal's models of the bodies.

        table_z_m: height of the table's surface, metres. object_pose: f64[4, 4]. Both are in the frame of the robot's
        root.
        """
        text = format_urdf(robot, hand)
        self.model = pin.buildModelFromXML(text)
        self.data = self.model.createData()
        self.geometry = pin.buildGeomFromUrdfString(self.model, text, pin.GeometryType.COLLISION)
        self._kinds = ["robot"] * self.geometry.ngeoms
        self._add_boards(hand)
        self._add_surroundings(table_z_m, grasp_object, object_pose)
        for pair in self._find_pairs():
            self.geometry.addCollisionPair(pin.CollisionPair(*pair))
        self.geometry_data = pin.GeometryData(self.geometry)
        self._broad = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(
            self.model, self.geometry, self.geometry_data
        )
        self._columns = [self.model.joints[self.model.getJointId(name)].idx_q for name in robot.joint_names]

    def find_overlap(self, angles: FloatArray, allowed_depth_m: float = 0.0, sample: int = 0) -> Overlap | None:
        """Return two overlapping bodies at the joint angles f64[j], or None if no bodies overlap.

        allowed_depth_m: depth to which hand and object may overlap (the soft layer in contact), metres. sample: number
        that the result states.
        """
        q = np.zeros(self.model.nq)
        q[self._columns] = angles
        if not pin.computeCollisions(self.model, self.data, self._broad, q, True):
            return None
        pin.computeCollisions(self.model, self.data, self.geometry, self.geometry_data, q, False)
        for index, result in enumerate(self.geometry_data.collisionResults):
            if not result.isCollision():
                continue
            pair = self.geometry.collisionPairs[index]
            pin.computeDistance(self.geometry, self.geometry_data, index)
            depth_m = -self.geometry_data.distanceResults[index].min_distance
            is_contact = "object" in (self._kinds[pair.first], self._kinds[pair.second]) and self._is_in_hand(pair)
            if not is_contact or depth_m > allowed_depth_m:
                first, second = (self.geometry.geometryObjects[k].name for k in (pair.first, pair.second))
                return Overlap(first, second, depth_m, sample)
        return None

    def find_overlap_on_path(self, waypoints: FloatArray, allowed_depth_m: float = 0.0) -> Overlap | None:
        """Return the first overlap on the straight segments between the waypoints f64[k, j]; None if there is none.

        The path is sampled such that no point of the hand moves by more than `STEP_M` between samples.
        """
        sample = 0
        for begin, end in itertools.pairwise(waypoints):
            reach = np.r_[REACH_M, np.full(len(begin) - len(REACH_M), FINGER_REACH_M)]
            count = max(1, int(np.ceil(np.abs(end - begin) @ reach / STEP_M)))
            for share in np.linspace(0.0, 1.0, count + 1):
                overlap = self.find_overlap(begin + share * (end - begin), allowed_depth_m, sample)
                if overlap is not None:
                    return overlap
                sample += 1
        return None

    def _add_boards(self, hand: Hand) -> None:
        """Add the convex hull of every board: its taxels, from the back of the bracket to the surface of the layer."""
        for index, board in enumerate(hand.boards):
            is_own = hand.board_index == index
            position, normal, distal = hand.position[is_own], hand.normal[is_own], hand.distal[is_own]
            lateral = np.cross(normal, distal)
            half = hand.size_m / 2
            points = np.concatenate(
                [
                    position + z * normal + half * (a * distal + b * lateral)
                    for a in (-1, 1)
                    for b in (-1, 1)
                    for z in (hand.layer_m or 0.0, -BOARD_BACK_M)
                ]
            )
            frame = self.model.frames[self.model.getFrameId(board.link_name, pin.FrameType.BODY)]
            assert board.pose is not None
            placement = frame.placement * pin.SE3(board.pose[:3, :3], board.pose[:3, 3])
            self._add(f"board {board.name}", frame.parentJoint, placement, make_hull(points), "robot")

    def _add_surroundings(self, table_z_m: float, item: GraspObject, pose: FloatArray) -> None:
        """Add the table, the object, and the stand between them if the object is above the table."""
        table = pin.SE3(np.eye(3), np.array([0.0, 0.0, table_z_m - TABLE_HALF_M[2]]))
        self._add("table", 0, table, coal.Box(*(2 * np.array(TABLE_HALF_M))), "table")
        if isinstance(item.shape, Cylinder):
            middle = pose[:3, 3] + item.shape.height / 2 * pose[:3, 2]
            solid: Any = coal.Cylinder(item.shape.radius, item.shape.height)
            self._add("object", 0, pin.SE3(pose[:3, :3], middle), solid, "object")
        else:
            self._add("object", 0, pin.SE3(pose[:3, :3], pose[:3, 3]), make_hull(item.shape.mesh()[0]), "object")
        height = float(pose[2, 3]) - table_z_m
        if height > 0:
            low, high = item.shape.bounds
            centre = pose[:3, 3] + pose[:3, :2] @ ((low + high)[:2] / 2) - np.array([0.0, 0.0, height / 2])
            self._add("stand", 0, pin.SE3(pose[:3, :3], centre), coal.Box(*(high - low)[:2], height), "stand")

    def _add(self, name: str, joint: int, placement: Any, solid: Any, kind: str) -> None:
        """Add a body at a pose in the frame of a joint of Pinocchio's model.

        kind: "robot", "table", "object" or "stand", which decides the pairs that can collide.
        """
        self.geometry.addGeometryObject(pin.GeometryObject(name, joint, placement, solid))
        self._kinds.append(kind)

    def _count_joints(self, a: int, b: int) -> int:
        """Return the number of joints between two joints of the kinematic tree."""
        path_a, path_b = list(self.model.supports[a]), list(self.model.supports[b])
        common = sum(x == y for x, y in zip(path_a, path_b, strict=False))
        return int(len(path_a) + len(path_b) - 2 * common)

    def _is_in_hand(self, pair: Any) -> bool:
        """Return whether a body of a pair moves with the last joint of the arm, the sixth, or a joint of the hand."""
        return any(self.geometry.geometryObjects[k].parentJoint >= 6 for k in (pair.first, pair.second))

    def _find_pairs(self) -> Iterator[tuple[int, int]]:
        """Yield the index pairs of bodies that can collide.

        Two bodies of the robot need at least two joints between them, or three within the hand (joint 6 of the arm and
        beyond). Robot and table need at least two joints, robot and object or stand at least one.
        """
        for i, first in enumerate(self.geometry.geometryObjects):
            for j in range(i + 1, self.geometry.ngeoms):
                second = self.geometry.geometryObjects[j]
                kinds = {self._kinds[i], self._kinds[j]}
                joints = self._count_joints(first.parentJoint, second.parentJoint)
                if kinds == {"robot"}:
                    is_hand = min(first.parentJoint, second.parentJoint) >= 6
                    if joints > (2 if is_hand else 1):
                        yield i, j
                elif "robot" in kinds and joints > (1 if "table" in kinds else 0):
                    yield i, j


def make_hull(points: FloatArray) -> Any:
    """Make Coal's convex body of the hull of the points f64[n, 3], metres."""
    hull = ConvexHull(points)
    index = {int(old): new for new, old in enumerate(hull.vertices)}
    vertices = coal.StdVec_Vec3s()
    for point in points[hull.vertices]:
        vertices.append(point)
    centre = points[hull.vertices].mean(axis=0)
    triangles = coal.StdVec_Triangle()
    for simplex in hull.simplices:
        a, b, c = (points[k] for k in simplex)
        order = simplex if np.dot(np.cross(b - a, c - a), a - centre) > 0 else simplex[::-1]
        triangles.append(coal.Triangle(*(index[int(k)] for k in order)))
    return coal.Convex(vertices, triangles)
