"""Sampled placement of the hand at an object: the thesis's approaches, or any approach from the side or from above.

For the hand of the original experiment, an approach of the thesis is a grasp recorded in this experiment. For other
hands it is a `PalmPlacement`: the pose of the palm relative to the object.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from taxel.generate.solids import ObjectKind
from taxel.grasp.plan import FINGERS, PALM_PLACEMENTS, Approach, PalmPlacement
from taxel.grasp.shapes import Shape
from taxel.types import FloatArray

# Mean values of the thesis's approaches (`taxel.grasp.plan`).
SIDE_THUMB_RAD: Final = (1.15, 0.40)
TOP_THUMB_RAD: Final = (0.50, 0.50)
SIDE_MIDDLE_M: Final = -0.008  # position of the object's middle, towards the fingertips
TOP_EDGE_M: Final = -0.030

RECORDED_PRESS_M: Final = 0.0015
"""Motion of the palm after its first contact in a recorded grasp, metres (assumed: the middle of the default range of
`press_mm`). The larger this value is, the farther the shifted palm is from the object.
"""


def sample_placement(
    kind: ObjectKind, shape: Shape, top_share: float, rng: np.random.Generator
) -> tuple[str, PalmPlacement]:
    """Sample the name of an approach and the placement of the palm at an object, before `shift_placement` varies it.

    top_share: probability of an approach from above, for objects that may be approached from any side. Every call
    consumes three random numbers, so that later samples do not depend on the kind of object.
    """
    choice, top, azimuth = rng.random(3).tolist()
    if kind.approaches == "thesis":
        names = [name for item, name in PALM_PLACEMENTS if item == kind.name]
        name = names[int(choice * len(names))]
        return name, PALM_PLACEMENTS[kind.name, name]
    angle = 2.0 * np.pi * azimuth
    if top < top_share:
        return "top", PalmPlacement(angle, edge_z_m=TOP_EDGE_M, thumb_rad=TOP_THUMB_RAD, top=True)
    # z axis of the palm; its x axis points at the object, its y axis upwards
    fingers = np.array([-np.sin(angle), np.cos(angle), 0.0])
    reach = float((shape.mesh()[0] @ fingers).max())
    return "side", PalmPlacement(angle, edge_z_m=SIDE_MIDDLE_M + reach, thumb_rad=SIDE_THUMB_RAD)


def shift_placement(placement: PalmPlacement, sampled: dict[str, float]) -> PalmPlacement:
    """Return a placement of the palm that is shifted by the sampled values turn_deg, reach_mm, along_mm and thumb_deg.

    `press_mm` replaces the depth of the palm's indentation. `GraspRanges` defines the five values: turn_deg about the
    axis of the object, reach_mm towards the fingertips, along_mm along the axis, thumb_deg of two joints of the thumb.
    """
    thumb = np.radians(sampled["thumb_deg"])
    return replace(
        placement,
        azimuth_rad=placement.azimuth_rad + float(np.radians(sampled["turn_deg"])),
        edge_z_m=placement.edge_z_m + 1e-3 * sampled["reach_mm"],
        axis_y_m=placement.axis_y_m + 1e-3 * sampled["along_mm"],
        indentation_m=1e-3 * sampled["press_mm"],
        thumb_rad=(placement.thumb_rad[0] + thumb, placement.thumb_rad[1] + thumb),
    )


def shift_recorded_approach(approach: Approach, shape: Shape, nominal: Shape, sampled: dict[str, float]) -> Approach:
    """Return a recorded grasp that is adapted to an object of another size and shifted as `shift_placement` does.

    shape: shape of the sampled object. nominal: shape of the object in the recorded grasp. Without a shift, the palm
    keeps its distance from the surface.
    """
    x, y, z = approach.palm_pose[:3, :3].T  # axes of the palm: x towards the object, z towards the fingertips
    wider_m = _compute_extent(shape, -x) - _compute_extent(nominal, -x)
    pose, angle = approach.palm_pose.copy(), np.radians(sampled["turn_deg"])
    pose[:3, 3] += x * (1e-3 * sampled["press_mm"] - RECORDED_PRESS_M - wider_m)
    pose[:3, 3] -= 1e-3 * (z * sampled["reach_mm"] + y * sampled["along_mm"])
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    base, opened = approach.base_targets.copy(), approach.open_angles.copy()
    # The joints of the thumb follow those of the fingers, 4 each. A joint without a held target stays NaN.
    thumb = slice(4 * FINGERS, 4 * FINGERS + 2)
    base[thumb] += np.radians(sampled["thumb_deg"])
    opened[thumb] += np.where(np.isfinite(base[thumb]), np.radians(sampled["thumb_deg"]), 0.0)
    return replace(approach, palm_pose=turn @ pose, base_targets=base, open_angles=opened)


def _compute_extent(shape: Shape, direction: FloatArray) -> float:
    """Compute how far a shape reaches in a direction f64[3] from the origin of its frame, metres."""
    return float((shape.mesh()[0] @ direction).max())
