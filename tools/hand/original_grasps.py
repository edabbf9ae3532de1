"""Write host/taxel/grasp/original_grasps.toml: the grasps of the original experiment, relative to the object.

    python tools/hand/original_grasps.py [--check]

The original files state tool poses in the world (hardware, and moved by hand until the simulated hand touched the
object) and measured angles of the finger bases. The tool writes the pose of the palm in the frame of the object, in
which the description of the object is written (box: wide faces towards +y and -y).
"""

import sys
from pathlib import Path
from typing import Final

import numpy as np
from original_figures import read_rows
from original_robot import MOUNT_M, MOUNT_QUATERNION
from written_files import write_or_compare

from taxel.grasp.objects import ORIGINAL_SIZES, make_thesis_objects
from taxel.hand import load_hand
from taxel.hand.transforms import apply, inverse, make_pose, to_quaternion
from taxel.types import FloatArray

OUT: Final = Path(__file__).parents[2] / "host/taxel/grasp/original_grasps.toml"

OBJECT_M: Final = (-0.0049, -0.2062, 1.01645)
"""Centre of the object's bottom face in the original world frame, metres."""

OBJECT_YAW_RAD: Final = 0.0207

BASE_M: Final = (-0.0093, 0.3375, 0.99275)
"""Base of the arm in the original world frame, metres; two half turns between it and the first joint cancel."""

OBJECT_TURN_RAD: Final = -np.pi / 2
"""Rotation about z from the original frame of the object, whose box is 35 mm wide in x, to that of this project."""

CONTACT_M: Final = 0.0006
"""Distance of the nearest palm electrode from the object, metres: median of the 12 recorded poses of the simulation."""

OBJECTS: Final = {"rect": "rectangular_prism", "cyl": "cylinder", "tri": "triangular_prism"}
APPROACHES: Final = {
    "rect": ("wide_side_1", "narrow_side_1", "wide_side_2", "narrow_side_2", "top", "side_edge"),
    "cyl": ("side_1", "side_2", "side_3", "side_4", "top"),
    "tri": ("side_1", "top"),
}

HEADER: Final = """\
# Grasps of the original experiment. Written by tools/hand/original_grasps.py from the figures in tools/hand/original.
#
# position_m, quaternion_wxyz: pose of the palm link in the frame of the object. hardware: as on the arm; simulation: as
# in the original simulation, where the pose was moved by hand until the palm touched the object. finger_bases_rad:
# measured angles of joint 0 of index, middle and pinkie in each iteration. Of the sides of the triangular prism, only
# the hardware's pose at side 1 is recorded; its pose in the simulation is the same pose, moved to contact.

[object]
"""


def make_turn(angle: float) -> FloatArray:
    """Return the rotation about z by an angle in radians, as a pose f64[4, 4]."""
    return make_pose([0.0, 0.0, 0.0], [np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])


def compute_object_pose() -> FloatArray:
    """Return the pose f64[4, 4] of the object in the frame of the arm's base.

    The last rotation changes from the object frame of the original files to the object frame of this project.
    """
    world = make_pose(OBJECT_M, [1.0, 0.0, 0.0, 0.0]) @ make_turn(OBJECT_YAW_RAD)
    base = make_pose(BASE_M, [1.0, 0.0, 0.0, 0.0])
    return np.asarray(inverse(base) @ world @ make_turn(-OBJECT_TURN_RAD))


def compute_palm_pose(row: dict[str, str]) -> FloatArray:
    """Return the pose f64[4, 4] of the palm link in the object's frame, from one row of grasp_poses.csv."""
    position, quaternion = (
        [float(row[name]) for name in names] for names in (("x_m", "y_m", "z_m"), ("qw", "qx", "qy", "qz"))
    )
    tool = make_pose(position, quaternion)
    mount = make_pose(MOUNT_M, MOUNT_QUATERNION)
    turned = make_pose([0.0, 0.0, 0.0], [0.0, 0.5**0.5, 0.0, 0.5**0.5])  # half turn about the bisector of x and z
    world = make_pose(OBJECT_M, [1.0, 0.0, 0.0, 0.0]) @ make_turn(OBJECT_YAW_RAD - OBJECT_TURN_RAD)
    return np.asarray(inverse(world) @ tool @ mount @ turned)


def move_to_contact(pose: FloatArray) -> FloatArray:
    """Return the palm's pose moved along its normal until its nearest electrode is `CONTACT_M` from the triangular
    prism.
    """
    hand = load_hand("original")
    board = hand.find_board("palm")
    assert board.pose is not None
    electrodes = apply(board.pose, hand.position[hand.get_slice(board.address)])
    shape = make_thesis_objects(ORIGINAL_SIZES)["triangular_prism"].shape
    result = pose.copy()
    for _ in range(20):  # repeated, because the nearest electrode and the direction to it change with the pose
        distance = float(shape.signed_distance(apply(result, electrodes)).min())
        result[:3, 3] += (distance - CONTACT_M) * result[:3, 0]  # the normal is the x axis of the palm link
    return result


def format_pose(pose: FloatArray) -> list[str]:
    """Return the lines of a pose: position with six digits, quaternion with seven."""
    # + 0.0 changes -0.0 to 0.0.
    return [
        f"position_m = [{', '.join(f'{value + 0.0:.6f}' for value in np.round(pose[:3, 3], 6))}]",
        f"quaternion_wxyz = [{', '.join(f'{value + 0.0:.7f}' for value in np.round(to_quaternion(pose), 7))}]",
    ]


def format_grasps() -> str:
    """Return the text of original_grasps.toml: for each grasp, the angles of the finger bases and the palm poses.

    The palm pose has the suffix `hardware` or `simulation`. A simulation pose that is not recorded is the hardware pose
    moved to contact.
    """
    lines = [HEADER.rstrip("\n"), *format_pose(compute_object_pose())]
    poses, bases = read_rows("grasp_poses"), read_rows("grasp_finger_bases")
    for short, names in APPROACHES.items():
        for index, approach in enumerate(names):
            lines += ["", f"[grasps.{OBJECTS[short]}.{approach}]"]
            angles = [  # joints 0, 4 and 8 of the hand: joint 0 of index, middle and pinkie
                [float(row[f"joint_{joint}_0_rad"]) for joint in (0, 4, 8)]
                for row in bases
                if (row["object"], row["grasp"]) == (short, f"grasp_{index}")
            ]
            if angles:
                lines.append("finger_bases_rad = [")
                lines += [f"    [{', '.join(f'{angle:.5f}' for angle in row)}]," for row in angles]
                lines.append("]")
            for row in poses:
                if (row["object"], row["grasp"]) == (short, f"grasp_{index}"):
                    lines += ["", f"[grasps.{OBJECTS[short]}.{approach}.{row['setting']}]"]
                    lines += format_pose(compute_palm_pose(row))
                    if (short, approach) == ("tri", "side_1"):  # no pose of the simulation is recorded
                        lines += ["", f"[grasps.{OBJECTS[short]}.{approach}.simulation]"]
                        lines += format_pose(move_to_contact(compute_palm_pose(row)))
    return "\n".join(lines) + "\n"


def main() -> int:
    """Write original_grasps.toml, or with --check compare it; the exit status is 1 if it differs."""
    return write_or_compare({OUT: format_grasps()}, __doc__.splitlines()[0])


if __name__ == "__main__":
    sys.exit(main())
