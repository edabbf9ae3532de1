"""A box that indents the flat board of the packaged rig, for tests of the twin's simulator mode."""

from __future__ import annotations

import numpy as np

from taxel.grasp.shapes import ConvexPolytope
from taxel.hand import load_hand
from taxel.hand.kinematics import compute_taxel_normals, compute_taxel_positions
from taxel.hand.transforms import from_rotation_vector
from taxel.twin.simulated.contact_fit import ContactPoses, ContactSimulator

HAND = load_hand("rig4")
BOX = ConvexPolytope.box(0.028, 0.024, 0.03)
BOARD = HAND.find_board("slab")


def make_simulator() -> ContactSimulator:
    """Make the simulator of the rig and the box."""
    return ContactSimulator(HAND, BOX)


def make_poses(depth_m: float = 0.0007, tilt_rad: float = 0.02) -> ContactPoses:
    """Return the poses at which the lower face of the box indents the middle of the flat board.

    depth_m: indentation at the middle of the face. tilt_rad: rotation of the box about its x axis.
    """
    sensor = np.stack([board.pose for board in HAND.boards])
    of_board = HAND.get_slice(BOARD.address)
    normal = compute_taxel_normals(HAND, sensor)[of_board].mean(axis=0)
    middle = compute_taxel_positions(HAND, sensor)[of_board].mean(axis=0)
    upright = from_rotation_vector([0.0, np.arctan2(normal[0], normal[2]), 0.0])  # the lower face faces the board
    item = upright @ from_rotation_vector([tilt_rad, 0.0, 0.3])
    item[:3, 3] = middle + (HAND.layer_m - depth_m) * normal
    return ContactPoses(sensor, item)


def move_object(poses: ContactPoses, translation_m: tuple[float, float, float], turn_rad: float) -> ContactPoses:
    """Return the poses after a translation of the object, and a rotation about the vertical axis."""
    item = poses.object.copy()
    item[:3, :3] = from_rotation_vector([0.0, 0.0, turn_rad])[:3, :3] @ item[:3, :3]
    item[:3, 3] += translation_m
    return ContactPoses(poses.sensor, item)
