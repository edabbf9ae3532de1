"""Inverse kinematics of the arm: joint angles for a palm pose in the world."""

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
ANGLE_WEIGHT_M: Final = 0.2  # metres per radian of orientation error; length of the hand
STARTS: Final = 32  # start angles of the search; a six-joint arm has at most eight solutions within a turn
SEED: Final = 1  # of the start angles
ITERATIONS: Final = 60
STEP_RAD: Final = 0.5  # largest step of a joint
DAMPING: Final = 0.05  # per squared metre of error
DAMPING_FLOOR: Final = 1e-12
DISTINCT_RAD: Final = 0.01  # smallest difference of a joint angle between two distinct solutions
CLEARANCE_M: Final = 0.02  # smallest height of the moving joints above the table


class UnreachableError(TaxelError, ValueError):
    """The arm cannot reach the palm pose.

    robot: name of the robot. link_name: link that was to be placed. position: requested position, metres. miss_m:
    remaining error of the best try, metres.
    """

    def __init__(self, robot: str, link_name: str, position: tuple[float, float, float], miss_m: float) -> None:
        """Create the error of a pose that an arm cannot reach.

        position: requested position, metres. miss_m: smallest remaining pose error of all start angles, metres; the
        error combines the position error and the rotation error times `ANGLE_WEIGHT_M`.
        """
        super().__init__(robot, link_name, position, miss_m)
        self.robot = robot
        self.link_name = link_name
        self.position = position
        self.miss_m = miss_m

    def _format_message(self) -> str:
        """Format the error as one line with robot, link, requested position, remaining error and remedy."""
        x, y, z = self.position
        return (
            f"robot {self.robot!r}: expected a pose within reach for link {self.link_name!r}, found ({x:.3f}, {y:.3f}, "
            f"{z:.3f}) m with a remaining error of {self.miss_m * 1e3:.2g} mm, the rotation error included; move the "
            "object or change the approach"
        )


@dataclass(frozen=True)
class _Chain:
    """The a revolute joints between the root and a link.

    joints: their indices in `robot.joints`. axes: their unit axes f64[3], in the frames of their child links. columns:
    i64[a], their positions in an array of all joint angles.
    """

    joints: tuple[int, ...]
    axes: tuple[FloatArray, ...]
    columns: npt.NDArray[np.intp]


class ArmReach:
    """Inverse kinematics of the joints between the root of a robot and a link, the palm.

    link_name: the link to place. Raises UnknownLinkError if the robot has no such link.

    Method: damped least squares (Levenberg 1944) from a fixed set of start angles, so the result is deterministic. Of
    the solutions within the joint limits and above the table, the solution farthest from a singularity is selected.
    """

    def __init__(self, robot: Robot, link_name: str = "palm") -> None:
        """Create the solver of the inverse kinematics of a robot arm. link_name: link to place at a pose."""
        self.robot = robot
        self.link_name = link_name
        self._kinematics = Kinematics(robot)
        self._target = robot.get_link_index(link_name)
        self._chain = _find_chain(robot, link_name)
        self._lower, self._upper = (bound[self._chain.columns] for bound in (robot.lower, robot.upper))

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the arm's joints that the solver computes, in the order of the robot."""
        return tuple(self.robot.joint_names[column] for column in self._chain.columns)

    def solve(self, palm_pose: FloatArray, near: FloatArray | None = None, iterations: int = ITERATIONS) -> FloatArray:
        """Solve for the joint angles f64[a], radians, that place the arm's link at `palm_pose` f64[4, 4], to 1e-9 m.

        near: f64[a], start angles, radians; the search then starts only there and finds a solution nearby. None: the
        best solution from many random start angles. iterations: number of steps; a few suffice near the solution.
        Raises UnreachableError.
        """
        angles = self._make_start_angles() if near is None else np.clip(near, self._lower, self._upper)[None]
        solutions = self._search(angles, palm_pose, near is None, iterations)
        return np.asarray(solutions[np.argmax(self._compute_score(solutions))])

    def solve_all(self, palm_pose: FloatArray) -> FloatArray:
        """Solve for all joint angles f64[k, a], radians, that place the link at `palm_pose` f64[4, 4], best first.

        Of solutions that differ only by full turns, one is returned. The first solution is the result of `solve`.
        Raises UnreachableError.
        """
        solutions = self._search(self._make_start_angles(), palm_pose, True)
        distinct: list[FloatArray] = []
        for index in np.argsort(-self._compute_score(solutions), kind="stable"):
            differences = [np.abs(np.angle(np.exp(1j * (solutions[index] - other)))).max() for other in distinct]
            if not differences or min(differences) > DISTINCT_RAD:
                distinct.append(solutions[index])
        return np.stack(distinct)

    def _search(
        self, angles: FloatArray, palm_pose: FloatArray, unwinds: bool, iterations: int = ITERATIONS
    ) -> FloatArray:
        """Search from start angles f64[starts, a] for the solutions f64[k, a], k > 0. Raises UnreachableError.

        unwinds: move the angles by full turns into -pi..pi where the limits allow.
        """
        for _ in range(iterations):
            angles = self._improve(angles, palm_pose)
        if unwinds:
            angles = self._unwind(angles)
        error = self._compute_error(angles, palm_pose)
        is_solution = _is_converged(error)
        if not is_solution.any():
            x, y, z = (float(value) for value in palm_pose[:3, 3])
            miss = float(np.linalg.norm(error, axis=1).min())
            raise UnreachableError(self.robot.name, self.link_name, (x, y, z), miss)
        return np.asarray(angles[is_solution])

    def _make_start_angles(self) -> FloatArray:
        """Make random start angles of the search, f64[starts, a] radians, within one turn.

        Solutions beyond a turn give the same poses.
        """
        low, high = np.maximum(self._lower, -np.pi), np.minimum(self._upper, np.pi)
        return np.asarray(low + np.random.default_rng(SEED).uniform(size=(STARTS, len(low))) * (high - low))

    def _unwind(self, angles: FloatArray) -> FloatArray:
        """Move each joint angle by full turns into -pi..pi where the limits allow; the pose is unchanged."""
        wrapped = (angles + np.pi) % (2 * np.pi) - np.pi
        return np.where((wrapped >= self._lower) & (wrapped <= self._upper), wrapped, angles)

    def _compute_poses(self, angles: FloatArray) -> FloatArray:
        """Compute the poses of all links f64[..., l, 4, 4] for angles of the arm's joints f64[..., a].

        The angles of the other joints are 0.
        """
        all_angles = np.zeros((*angles.shape[:-1], len(self.robot.joint_names)))
        all_angles[..., self._chain.columns] = angles
        return self._kinematics.compute_link_poses(all_angles)

    def _improve(self, angles: FloatArray, palm_pose: FloatArray) -> FloatArray:
        """Perform one damped least-squares step of the inverse kinematics, for all start angles f64[starts, a] at once.

        palm_pose: target f64[4, 4]. Returns the new angles f64[starts, a]. The damping decreases with the squared pose
        error, down to `DAMPING_FLOOR`.
        """
        error, jacobian = self._compute_error(angles, palm_pose), self._compute_jacobian(angles)
        damping = DAMPING * np.sum(error**2, axis=-1)[:, None, None]
        transposed = np.swapaxes(jacobian, -1, -2)
        square = jacobian @ transposed + (damping + DAMPING_FLOOR) * np.eye(6)
        step = (transposed @ np.linalg.solve(square, error[..., None]))[..., 0]
        longest = np.abs(step).max(axis=-1, keepdims=True)
        step *= np.minimum(1.0, STEP_RAD / np.maximum(longest, STEP_RAD))
        return np.asarray(np.clip(angles - step, self._lower, self._upper))

    def _compute_error(self, angles: FloatArray, palm_pose: FloatArray) -> FloatArray:
        """Compute the pose errors of joint angles, f64[..., 6], metres.

        Elements 0 to 2: position of the origin of the placed link minus target position. Elements 3 to 5: rotation
        vector from the target to the link, in the world, scaled by `ANGLE_WEIGHT_M`. palm_pose: target f64[4, 4].
        """
        pose = self._compute_poses(angles)[..., self._target, :, :]
        rotation = np.broadcast_to(np.eye(4), pose.shape).copy()
        rotation[..., :3, :3] = pose[..., :3, :3] @ palm_pose[:3, :3].T
        position_error = pose[..., :3, 3] - palm_pose[:3, 3]
        return np.concatenate([position_error, ANGLE_WEIGHT_M * to_rotation_vector(rotation)], -1)

    def _compute_jacobian(self, angles: FloatArray) -> FloatArray:
        """Compute the Jacobian of the arm for the errors of `_compute_error`, f64[..., 6, a], metres per radian.

        angles: f64[..., a], radians. Rows 0 to 2: velocity of the origin of the placed link in the world. Rows 3 to 5:
        angular velocity of the link in the world, scaled by `ANGLE_WEIGHT_M`. The rows of the position are the exact
        derivatives of the position error. The rows of the rotation are the exact derivatives of the scaled rotation
        vector only where the rotation error is 0.
        """
        poses = self._compute_poses(angles)
        tip = poses[..., self._target, :3, 3]
        columns = []
        for index, local_axis in zip(self._chain.joints, self._chain.axes, strict=True):
            frame = poses[..., index + 1, :, :]
            axis = frame[..., :3, :3] @ local_axis
            columns.append(np.concatenate([np.cross(axis, tip - frame[..., :3, 3]), ANGLE_WEIGHT_M * axis], axis=-1))
        return np.stack(columns, axis=-1)

    def _compute_score(self, angles: FloatArray) -> FloatArray:
        """Compute a score of joint angles f64[..., a], f64[...]: the smallest singular value of the Jacobian.

        A higher score is better: the posture is farther from a singularity. The score is reduced by 1 if a joint is
        nearer to the table than `CLEARANCE_M`.
        """
        frames = [index + 1 for index in self._chain.joints[1:]]  # the first joint is mounted on the table
        lowest = self._compute_poses(angles)[..., frames, 2, 3].min(axis=-1, initial=np.inf)
        smallest = np.linalg.svd(self._compute_jacobian(angles), compute_uv=False)[..., -1]
        return np.asarray(np.where(lowest >= CLEARANCE_M, smallest, smallest - 1.0))


def _find_chain(robot: Robot, link_name: str) -> _Chain:
    """Find the joints of a robot from its base to a link: indices, rotation axes and columns of the joint angles."""
    parents = {joint.child: index for index, joint in enumerate(robot.joints)}
    path: list[int] = []
    while link_name in parents:
        path.append(parents[link_name])
        link_name = robot.joints[path[-1]].parent
    joints = [(index, robot.joints[index]) for index in reversed(path)]
    revolute = [(index, joint.name, joint.axis) for index, joint in joints if joint.axis is not None]
    columns = np.array([robot.joint_names.index(name) for _, name, _ in revolute], dtype=np.intp)
    return _Chain(tuple(index for index, _, _ in revolute), tuple(axis for _, _, axis in revolute), columns)


def _is_converged(error: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which residuals f64[k, 6] of the inverse kinematics are within the tolerances, bool[k].

    A residual is a position error and a weighted rotation vector, metres.
    """
    position, rotation = np.linalg.norm(error[:, :3], axis=1), np.linalg.norm(error[:, 3:], axis=1) / ANGLE_WEIGHT_M
    return np.asarray((position <= POSITION_TOLERANCE_M) & (rotation <= ROTATION_TOLERANCE_RAD))
