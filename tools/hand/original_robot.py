"""The robot of the original hand: the standard robot with extended fingers, and mount and limits of the original.

Link frames keep the orientation of the standard robot (x palmar, z along the finger), so that shapes and controllers
stay valid; joint axes, joint ranges and the mount are those of the original files.
"""

import re
from functools import lru_cache
from typing import Final

import numpy as np
from original_figures import compute_frames, read_rows

from taxel.hand.kinematics import Kinematics
from taxel.hand.robot import load_robot
from taxel.hand.transforms import inverse, to_quaternion
from taxel.types import FloatArray

STANDARD_ROBOT: Final = "ur5e_allegro"
FINGER_PLANE_M: Final = 0.034
"""Distance of the finger joints' plane from the original palm frame along its y axis, metres (joints.csv)."""

MOUNT_M: Final = (0.0, -0.007, 0.115)
"""Origin of the palm in the frame of the flange, metres. The original palm frame lies 41 mm behind the axis of the
flange and 115 mm before the flange (brackets.csv), and the finger plane 34 mm before the palm frame.
"""

MOUNT_QUATERNION: Final = (0.5, -0.5, -0.5, -0.5)
"""Orientation of the mount in the frame of the flange, w x y z: the palm faces the y axis of the flange. In the
original files the last joint of the arm is turned by 90 degrees, and the bracket of the hand by 90 degrees back; the
recorded tool poses, whose approaches move along the y axis of the tool, confirm the sum.
"""

LINKS: Final = {
    f"{finger}_{part}": f"link_{first + index}"
    for finger, first in (("ff", 0), ("mf", 4), ("rf", 8), ("th", 12))
    for index, part in enumerate(("base", "proximal", "medial", "distal"))
}
"""Name of each finger link in the original files, by its name in the robot description."""

JOINT_NAMES: Final = {
    f"{finger}_j{index}": f"joint_{first + index}_0"
    for finger, first in (("ff", 0), ("mf", 4), ("rf", 8), ("th", 12))
    for index in range(4)
}
"""Name of each joint in the original files, by its name in the robot description."""


def map_to_palm(pose: FloatArray) -> FloatArray:
    """Convert a pose f64[4, 4] from the original palm frame to the palm frame of the robot description.

    The x axis of the description points out of the palm (original y), its y axis to the index finger (original -x).
    """
    change = np.eye(4)
    change[:3, :3] = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    change[0, 3] = -FINGER_PLANE_M
    return np.asarray(change @ pose)


@lru_cache(maxsize=1)
def compute_link_frames() -> dict[str, FloatArray]:
    """Return the pose f64[4, 4] of each link of the hand in the frame of the palm at joint angles 0, by link name.

    The orientation is that of the standard robot. The origin is the point of the original joint axis that is nearest to
    the origin of the standard link.
    """
    robot = load_robot(STANDARD_ROBOT)
    poses = Kinematics(robot).compute_link_poses(np.zeros(len(robot.joint_names)))
    to_palm = inverse(poses[robot.link_names.index("palm")])
    original = compute_frames()
    frames = {"palm": np.eye(4)}
    for link, original_link in LINKS.items():
        frame = to_palm @ poses[robot.link_names.index(link)]
        axis = map_to_palm(original[original_link])
        point, direction = axis[:3, 3], axis[:3, 2]
        frame[:3, 3] = point + direction * (direction @ (frame[:3, 3] - point))
        frames[link] = frame
    return frames


def format_robot(standard: str) -> str:
    """Return the text of the original hand's robot description. standard: text of the standard robot's description."""
    header, arm, hand, shapes = _split(standard)
    header = (
        "# Robot of the original hand: a UR5e arm and a right Allegro hand with extended fingers, 22 revolute joints.\n"
        "#\n"
        "# Written by tools/hand/original_hand.py: arm, link frames and shapes of ur5e_allegro; joint axes, joint\n"
        "# ranges and mount of the original files (tools/hand/original). The finger bases and medial links are longer\n"
        "# than those of the standard hand. The ranges are those of the original simulation, not of the hardware.\n"
        "# Metres, radians, quaternions w x y z.\n\n"
        'format = "taxel-robot"\nversion = 1\nname = "ur5e_original"\n'
        'description = "UR5e arm with the original right Allegro hand"\nroot = "world"\n\n'
    )
    return header + arm + _format_hand(hand) + _extend_shapes(shapes)


def _split(text: str) -> tuple[str, str, str, str]:
    """Split the standard description into its header, arm, hand and shapes."""
    arm, hand, shapes = (text.index(mark) for mark in ("# --- arm ---", "# --- hand ---", "# --- shapes"))
    return text[:arm], text[arm:hand], text[hand:shapes], text[shapes:]


def _format_hand(standard: str) -> str:
    """Return the text of the hand's joints with the positions, orientations and ranges of the original."""
    frames = compute_link_frames()
    robot = load_robot(STANDARD_ROBOT)
    limits = {row["joint"]: (float(row["lower_rad"]), float(row["upper_rad"])) for row in read_rows("joints")}
    mount = f"position_m = [{', '.join(f'{value:g}' for value in MOUNT_M)}]"
    orientation = f"quaternion_wxyz = [{', '.join(f'{value:g}' for value in MOUNT_QUATERNION)}]"
    text = standard.split('[[joints]]\nname = "ff_j0"')[0]
    text = text.replace("position_m = [0, 0, 0.115]", mount)
    text = text.replace("quaternion_wxyz = [0.7071067812, 0, -0.7071067812, 0]", orientation)
    text = re.sub(
        r"# the x axis of the mount.*\n", "# x axis of the mount: finger direction, z axis of the flange\n", text
    )
    for joint in robot.joints:
        if joint.name not in JOINT_NAMES or joint.axis is None:
            continue
        pose = inverse(frames[joint.parent]) @ frames[joint.child]
        lower, upper = limits[JOINT_NAMES[joint.name]]
        text += (
            f'[[joints]]\nname = "{joint.name}"\ntype = "revolute"\n'
            f'parent = "{joint.parent}"\nchild = "{joint.child}"\n'
            f"position_m = [{_format_numbers(pose[:3, 3], 7)}]\n"
            f"quaternion_wxyz = [{_format_numbers(to_quaternion(pose), 10)}]\n"
            f"axis = [{', '.join(f'{value:g}' for value in joint.axis)}]\nrange_rad = [{lower:g}, {upper:g}]\n\n"
        )
    return text


def _extend_shapes(standard: str) -> str:
    """Return the text of the links' shapes.

    Boxes of bases and medial links end at the next joint of the longer finger.
    """
    frames = compute_link_frames()
    text = standard
    for finger in ("ff", "mf", "rf"):
        for link, following in (("base", "proximal"), ("medial", "distal")):
            length = float((inverse(frames[f"{finger}_{link}"]) @ frames[f"{finger}_{following}"])[2, 3])
            pattern = (
                rf'(link = "{finger}_{link}"\ntype = "box"\nhalf_size_m = \[[^,]+, [^,]+, )[^\]]+(\]\n)position_m = .*'
            )
            text = re.sub(pattern, rf"\g<1>{length / 2:.6g}\g<2>position_m = [0, 0, {length / 2:.6g}]", text)
    return text


def _format_numbers(values: FloatArray, digits: int) -> str:
    return ", ".join(f"{value + 0.0:.{digits}f}" for value in np.round(values, digits))
