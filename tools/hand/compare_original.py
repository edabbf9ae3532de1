"""Compare the description of the original hand with the extracted figures.

    python tools/hand/compare_original.py

Prints the largest difference of the taxel centres of each kind in the bracket's frame (without alignment, by index), of
the bracket poses for random joint angles, and of the recorded taxel positions of a posed hand; exit status 1 if one
exceeds 0.1 mm or 0.1 degrees.
"""

import sys
from typing import Final, NamedTuple

import numpy as np
from original_figures import compute_frames, read_boards, read_rows, read_taxels
from original_robot import JOINT_NAMES, map_to_palm
from scipy.optimize import least_squares

from taxel.hand import Hand, load_hand
from taxel.hand.kinematics import Kinematics
from taxel.hand.robot import load_robot
from taxel.hand.transforms import apply, inverse, to_rotation_vector
from taxel.types import FloatArray

LIMIT_MM: Final = 0.1
LIMIT_DEGREES: Final = 0.1
FINGERS: Final = {"index": "ff", "middle": "mf", "pinkie": "rf"}


class Difference(NamedTuple):
    """Largest difference of one comparison. value: in `unit`."""

    name: str
    value: float
    unit: str

    @property
    def is_within_limit(self) -> bool:
        """Whether the difference is at most 0.1 mm or 0.1 degrees."""
        return self.value <= (LIMIT_MM if self.unit == "mm" else LIMIT_DEGREES)


def compare_centres(hand: Hand) -> list[Difference]:
    """Return the largest distance between described and extracted taxel centres of each board kind.

    Centres of the same index are compared.
    """
    differences = []
    for kind in {board.kind.name: board.kind for board in hand.boards}.values():
        assert kind.surface is not None
        distance = np.linalg.norm(kind.surface.position - read_taxels(kind.name)[:, :3], axis=1)
        differences.append(Difference(f"centres of {kind.name}", float(1e3 * distance.max()), "mm"))
    return differences


def compare_brackets(hand: Hand, poses: int = 200, seed: int = 1) -> list[Difference]:
    """Return the largest differences of position (mm) and of orientation (degrees) of the brackets in the palm frame.

    The bracket poses of `hand` are compared with those of the extracted joints, at `poses` random sets of joint angles.
    """
    rng = np.random.default_rng(seed)
    robot = load_robot("ur5e_original")
    kinematics = Kinematics(robot, hand)
    brackets = {board.address: board.bracket for board in read_boards()}
    worst_mm, worst_degrees = 0.0, 0.0
    for _ in range(poses):
        angles = rng.uniform(robot.lower, robot.upper)
        by_name = dict(zip(robot.joint_names, angles.tolist(), strict=True))
        original = compute_frames({JOINT_NAMES[name]: angle for name, angle in by_name.items() if name in JOINT_NAMES})
        palm = kinematics.compute_link_poses(angles)[robot.link_names.index("palm")]
        for board, pose in zip(hand.boards, kinematics.compute_sensor_poses(angles), strict=True):
            if brackets[board.address] in original:
                expected = map_to_palm(original[brackets[board.address]])
                change = inverse(expected) @ inverse(palm) @ pose
                worst_mm = max(worst_mm, 1e3 * float(np.linalg.norm(change[:3, 3])))
                worst_degrees = max(worst_degrees, float(np.degrees(np.linalg.norm(to_rotation_vector(change)))))
    return [
        Difference(f"bracket positions, {poses} random poses", worst_mm, "mm"),
        Difference(f"bracket orientations, {poses} random poses", worst_degrees, "degrees"),
    ]


def read_recorded_positions() -> dict[int, FloatArray]:
    """Read the recorded taxel centres of a posed hand, f64[n, 3] by board address.

    They are metres in the palm frame of the description; taxels without a position are NaN.
    """
    boards = read_boards()
    total = sum(board.taxels for board in boards)
    table = np.full((total, 3), np.nan)
    for row in read_rows("recorded_taxel_positions"):
        table[int(row["row"])] = [float(row[f"{axis}_m"]) for axis in "xyz"]
    table = apply(map_to_palm(np.eye(4)), table)
    first, positions = 0, {}
    for board in boards:
        positions[board.address] = table[first : first + board.taxels]
        first += board.taxels
    return positions


def fit_recorded_pose(hand: Hand) -> list[Difference]:
    """Return the largest distances of the recorded taxel positions after a fit of each finger's joint angles.

    The first entry belongs to palm and back, which no joint moves.
    """
    robot = load_robot("ur5e_original")
    kinematics = Kinematics(robot, hand)
    recorded = read_recorded_positions()
    differences = []
    palm_link = robot.link_names.index("palm")

    def compute_residual(angles: FloatArray, addresses: list[int]) -> FloatArray:
        """Return described minus recorded positions f64[n, 3] of the boards' recorded taxels, in the palm frame,
        metres.
        """
        palm = inverse(kinematics.compute_link_poses(angles)[palm_link])
        positions = apply(palm, kinematics.compute_taxel_positions(angles))
        residual = np.concatenate([positions[hand.get_slice(a)] - recorded[a] for a in addresses])
        return np.asarray(residual[np.isfinite(residual).all(axis=1)])

    zero = np.zeros(len(robot.joint_names))
    fixed = [board.address for board in hand.boards if board.link_name == "palm"]
    residual = np.linalg.norm(compute_residual(zero, fixed), axis=1)
    differences.append(Difference("recorded positions, palm and back", float(1e3 * residual.max()), "mm"))
    for finger, prefix in FINGERS.items():
        addresses = [board.address for board in hand.boards if board.name.endswith(finger)]
        joints = [robot.joint_names.index(f"{prefix}_j{index}") for index in range(4)]

        # The defaults of the following functions bind the variables of this loop at each pass.
        def place(values: FloatArray, joints: list[int] = joints) -> FloatArray:
            """Return all joint angles, with those of the finger set to `values` and the others 0."""
            angles = zero.copy()
            angles[joints] = values
            return angles

        def fit_residual(
            values: FloatArray, addresses: list[int] = addresses, joints: list[int] = joints
        ) -> FloatArray:
            """Return the residuals f64[3 n] (metres) of the finger's n recorded taxels, for the optimiser.

            values: the four joint angles of the finger, radians.
            """
            return compute_residual(place(values, joints), addresses).ravel()

        fit = least_squares(fit_residual, np.full(4, 0.1))  # from 0.1 rad at each joint
        residual = np.linalg.norm(compute_residual(place(fit.x), addresses), axis=1)
        text = ", ".join(f"{angle:.3f}" for angle in fit.x)
        differences.append(Difference(f"recorded positions, {finger} at {text} rad", float(1e3 * residual.max()), "mm"))
    return differences


def main() -> int:
    """Print all differences; the exit status is 1 if one exceeds its limit."""
    hand = load_hand("original")
    differences = [
        *compare_centres(load_hand("original_complete")),
        *compare_brackets(load_hand("original_complete")),
        *fit_recorded_pose(hand),
    ]
    for difference in differences:
        mark = "" if difference.is_within_limit else "  EXCEEDS THE LIMIT"
        print(f"{difference.name}: {difference.value:.4f} {difference.unit}{mark}")
    return 0 if all(difference.is_within_limit for difference in differences) else 1


if __name__ == "__main__":
    sys.exit(main())
