"""Inverse kinematics of the arm: its joint angles for a pose of the palm in the world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.errors import TaxelError
from taxel.hand.kinematics import Kinematics
from taxel.hand.robot import Robot
from taxel.hand.transforms import to_rotation_vector
from taxel.types import FloatArray

POSITION_TOLERANCE_M: Final = 1e-9
ROTATION_TOLERANCE_RAD: Final = 1e-8
ANGLE_WEIGHT_M: Final = 0.2  # metres that a radian counts for: the length of the hand
STARTS: Final = 32  # of the search; a six-joint arm has at most eight solutions inside a turn
SEED: Final = 1  # of the starts
ITERATIONS: Final = 60
STEP_RAD: Final = 0.5  # longest step of a joint
DAMPING: Final = 0.05  # per squared metre of error
DAMPING_FLOOR: Final = 1e-12
CLEARANCE_M: Final = 0.02  # height over the table of every moving joint of the arm


class UnreachableError(TaxelError, ValueError):
    """A palm pose that the arm cannot take. Attributes: robot, link, position (m), miss_m (m)."""

    def __init__(self, robot: str, link: str, position: tuple[float, float, float], miss_m: float) -> None:
        super().__init__(robot, link, position, miss_m)
        self.robot = robot
        self.link = link
        self.position = position
        self.miss_m = miss_m

    def __str__(self) -> str:
        x, y, z = self.position
        return (
            f"robot {self.robot!r}: expected a pose within reach for link {self.link!r}, found ({x:.3f}, {y:.3f}, "
            f"{z:.3f}) m with that orientation, missed by {self.miss_m * 1e3:.2g} mm; move the object or the approach"
        )


@dataclass(frozen=True)
class _Chain:
    """The moving joints between the root and a link, and where their angles stand."""

    joints: tuple[int, ...]
    axes: tuple[FloatArray, ...]
    columns: npt.NDArray[np.intp]


class ArmReach:
    """Inverse kinematics of the joints between the robot's root and one link, the palm.

    robot: its description. link: the link to place. Raises UnknownLinkError for a link that the robot lacks.

    The search (damped least squares, Levenberg 1944, from fixed starts at once) is deterministic. Of the solutions
    inside the joint limits and above the table it keeps the one farthest from a singularity.
    """

    def __init__(self, robot: Robot, link: str = "palm") -> None:
        self.robot = robot
        self.link = link
        self._kinematics = Kinematics(robot)
        self._target = robot.get_link_index(link)
        self._chain = _chain(robot, link)
        self._lower, self._upper = (bound[self._chain.columns] for bound in (robot.lower, robot.upper))

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The joints that it solves for, in the robot's order."""
        return tuple(self.robot.joint_names[column] for column in self._chain.columns)

    def solve(self, palm_pose: FloatArray, near: FloatArray | None = None) -> FloatArray:
        """Joint angles f64[a], radians, that put the link at `palm_pose` f64[4, 4] in the world, to 1e-9 m.

        near: f64[a]; if given, the solution that the search reaches from these angles (for a path), else the
        best-conditioned one. Raises UnreachableError.
        """
        angles = self._starts() if near is None else np.clip(near, self._lower, self._upper)[None]
        for _ in range(ITERATIONS):
            angles = self._improved(angles, palm_pose)
        if near is None:
            angles = self._unwound(angles)
        error = self._error(angles, palm_pose)
        reached = _close(error)
        if not reached.any():
            x, y, z = (float(value) for value in palm_pose[:3, 3])
            miss = float(np.linalg.norm(error, axis=1).min())
            raise UnreachableError(self.robot.name, self.link, (x, y, z), miss)
        found = angles[reached]
        return np.asarray(found[np.argmax(self._score(found))])

    def _starts(self) -> FloatArray:
        """Angles f64[starts, a] spread over one turn: solutions further round are the same poses."""
        low, high = np.maximum(self._lower, -np.pi), np.minimum(self._upper, np.pi)
        return np.asarray(low + np.random.default_rng(SEED).uniform(size=(STARTS, len(low))) * (high - low))

    def _unwound(self, angles: FloatArray) -> FloatArray:
        """The same pose with each angle within half a turn of 0, where the limits allow."""
        turned = (angles + np.pi) % (2 * np.pi) - np.pi
        return np.where((turned >= self._lower) & (turned <= self._upper), turned, angles)

    def _poses(self, angles: FloatArray) -> FloatArray:
        every = np.zeros((*angles.shape[:-1], len(self.robot.joint_names)))
        every[..., self._chain.columns] = angles
        return self._kinematics.compute_link_poses(every)

    def _improved(self, angles: FloatArray, palm_pose: FloatArray) -> FloatArray:
        """One damped step of every start; the damping fades with the error, so that the end is Newton's."""
        error, jacobian = self._error(angles, palm_pose), self._jacobian(angles)
        damping = DAMPING * np.sum(error**2, axis=-1)[:, None, None]
        transposed = np.swapaxes(jacobian, -1, -2)
        square = jacobian @ transposed + (damping + DAMPING_FLOOR) * np.eye(6)
        step = (transposed @ np.linalg.solve(square, error[..., None]))[..., 0]
        longest = np.abs(step).max(axis=-1, keepdims=True)
        step *= np.minimum(1.0, STEP_RAD / np.maximum(longest, STEP_RAD))
        return np.asarray(np.clip(angles - step, self._lower, self._upper))

    def _error(self, angles: FloatArray, palm_pose: FloatArray) -> FloatArray:
        """Residuals f64[..., 6], metres: position, and the rotation vector from the wanted to the found orientation."""
        found = self._poses(angles)[..., self._target, :, :]
        turn = np.broadcast_to(np.eye(4), found.shape).copy()
        turn[..., :3, :3] = found[..., :3, :3] @ palm_pose[:3, :3].T
        return np.concatenate([found[..., :3, 3] - palm_pose[:3, 3], ANGLE_WEIGHT_M * to_rotation_vector(turn)], -1)

    def _jacobian(self, angles: FloatArray) -> FloatArray:
        """Geometric Jacobian f64[..., 6, a], metres a radian; exact at a solution, where the rotation error is 0."""
        poses = self._poses(angles)
        tip = poses[..., self._target, :3, 3]
        columns = []
        for index, own in zip(self._chain.joints, self._chain.axes, strict=True):
            frame = poses[..., index + 1, :, :]
            axis = frame[..., :3, :3] @ own
            columns.append(np.concatenate([np.cross(axis, tip - frame[..., :3, 3]), ANGLE_WEIGHT_M * axis], axis=-1))
        return np.stack(columns, axis=-1)

    def _score(self, angles: FloatArray) -> FloatArray:
        """Smallest singular value of the Jacobian, f64[...]; below 0 if a joint's frame is in the table."""
        frames = [index + 1 for index in self._chain.joints[1:]]  # the first stands on the table
        lowest = self._poses(angles)[..., frames, 2, 3].min(axis=-1, initial=np.inf)
        smallest = np.linalg.svd(self._jacobian(angles), compute_uv=False)[..., -1]
        return np.asarray(np.where(lowest >= CLEARANCE_M, smallest, smallest - 1.0))


def _chain(robot: Robot, link: str) -> _Chain:
    parents = {joint.child: index for index, joint in enumerate(robot.joints)}
    path: list[int] = []
    while link in parents:
        path.append(parents[link])
        link = robot.joints[path[-1]].parent
    moving = [(index, robot.joints[index]) for index in reversed(path)]
    turning = [(index, joint.name, joint.axis) for index, joint in moving if joint.axis is not None]
    columns = np.array([robot.joint_names.index(name) for _, name, _ in turning], dtype=np.intp)
    return _Chain(tuple(index for index, _, _ in turning), tuple(axis for _, _, axis in turning), columns)


def _close(error: FloatArray) -> npt.NDArray[np.bool_]:
    position, turn = np.linalg.norm(error[:, :3], axis=1), np.linalg.norm(error[:, 3:], axis=1) / ANGLE_WEIGHT_M
    return np.asarray((position <= POSITION_TOLERANCE_M) & (turn <= ROTATION_TOLERANCE_RAD))
