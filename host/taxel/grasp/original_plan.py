"""The approaches of the original experiment: recorded palm poses, measured finger bases and commanded torques."""

import tomllib
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib import resources
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.plan import FINGERS, ITERATIONS, Approach
from taxel.hand.transforms import make_pose
from taxel.types import FloatArray

Setting = Literal["hardware", "simulation"]
"""Source of recorded values. For tool poses: the arm, or the original simulation, whose poses were moved by hand (by
1.2 to 6.6 mm) until the simulated palm touched the object.
"""

HARDWARE_TORQUE_NM: Final = (0.52, 0.375, 0.24)
"""Torques of joints 1, 2 and 3 of a finger that the hardware applies when 0.52 Nm is commanded, Nm: the PWM limits of
the hand's firmware reduce the second and third.
"""

SIMULATION_TORQUE_NM: Final = (0.52, 0.52, 0.52)
"""Torques of joints 1, 2 and 3 of a finger in the original simulation, Nm."""

PINKIE_TOP_TORQUE_NM: Final = (0.52, 0.05, 0.05)
"""Torques of the pinkie in the grasp of the box from the top, on the hardware, Nm; the other fingers are not closed."""

THUMB_TORQUE_NM: Final = (0.3, 0.3)
"""Torques of joints 2 and 3 of the thumb on the hardware, Nm."""

THUMB_RAD: Final = (0.35, -0.5)
"""Held angles of joints 0 and 1 of the thumb, radians. The original commands 0 for joint 0; 0.35 is its lower limit."""

OPEN_RAD: Final = 0.0
"""Angle of an open finger joint, radians: the lower limit in the original simulation."""


@dataclass(frozen=True, eq=False)
class OriginalGrasp:
    """One approach of the original experiment.

    palm_poses: pose of the palm in the frame of the object, f64[4, 4], by setting. finger_bases: measured angles of the
    three finger bases, f64[iterations, 3], radians; no rows where no angle was recorded.
    """

    object: str
    approach: str
    palm_poses: dict[str, FloatArray]
    finger_bases: NDArray[np.float64]


@lru_cache(maxsize=1)
def _read_document() -> dict[str, Any]:
    """Read the packaged file of the original grasps; cached."""
    return tomllib.loads(resources.files("taxel.grasp").joinpath("original_grasps.toml").read_text())


def get_original_object_pose() -> FloatArray:
    """Return the pose of the object in the frame of the arm's base, f64[4, 4], in the original experiment."""
    table = _read_document()["object"]
    return make_pose(table["position_m"], table["quaternion_wxyz"])


@lru_cache(maxsize=1)
def load_original_grasps() -> dict[tuple[str, str], OriginalGrasp]:
    """Load the recorded grasps by (object, approach), in the order of the thesis's grasp plan.

    Sides 2 and 3 of the triangular prism are in no file: they are derived from side 1 by rotations of the palm by 120
    and 240 degrees about the axis of the prism.
    """
    grasps = {}
    for name, approaches in _read_document()["grasps"].items():
        for approach, table in approaches.items():
            poses = {
                setting: make_pose(table[setting]["position_m"], table[setting]["quaternion_wxyz"])
                for setting in ("hardware", "simulation")
                if setting in table
            }
            bases = np.array(table.get("finger_bases_rad", np.empty((0, 3))), dtype=np.float64)
            grasps[name, approach] = OriginalGrasp(name, approach, poses, bases)
    first = grasps["triangular_prism", "side_1"]
    for index in (1, 2):
        turn = make_pose([0.0, 0.0, 0.0], [np.cos(index * np.pi / 3), 0.0, 0.0, np.sin(index * np.pi / 3)])
        name = f"side_{index + 1}"
        poses = {setting: turn @ pose for setting, pose in first.palm_poses.items()}
        grasps["triangular_prism", name] = OriginalGrasp("triangular_prism", name, poses, first.finger_bases)
    return {key: grasps[key] for key in ITERATIONS}


def make_original_approaches(
    withdraw_m: float = 0.0, setting: Setting = "simulation", torques: Setting = "hardware"
) -> dict[tuple[str, str], Approach]:
    """Make the fifteen approaches of the original experiment by (object, approach).

    The finger bases, the first joints of the three fingers, are held at the mean of their measured angles.
    setting: source of the tool poses; the hardware's pose where no other was recorded. torques: source of the finger
    torques. withdraw_m: distance of the palm from the object before and after the grasp.
    """
    return {key: _make_approach(grasp, withdraw_m, setting, torques) for key, grasp in load_original_grasps().items()}


def set_finger_bases(approach: Approach, iteration: int) -> Approach:
    """Return an original approach with the finger bases that were measured in one of its iterations, from 0.

    A finger base is the angle of the first of the four joints of a finger, at which the joint is held.
    Iterations beyond the number of measured ones start again from the first. Without measured angles, the approach is
    returned unchanged.
    """
    measured = load_original_grasps()[approach.object, approach.name].finger_bases
    if not len(measured):
        return approach
    targets = approach.base_targets.copy()
    targets[: 4 * FINGERS : 4] = measured[iteration % len(measured)]
    return replace(approach, base_targets=targets, open_angles=np.where(np.isfinite(targets), targets, OPEN_RAD))


def _make_approach(grasp: OriginalGrasp, withdraw_m: float, setting: Setting, torques: Setting) -> Approach:
    """Make the approach of one recorded grasp; arguments as for `make_original_approaches`.

    A grasp without measured finger bases gets the mean of those of all grasps. From the top, the fingers stay open;
    only the pinkie closes, and only on the box. Rows of `base` and `torque`: three fingers and thumb, with four joints
    each; NaN in `base`: a joint that closes with its torque.
    """
    base, torque = np.full((FINGERS + 1, 4), np.nan), np.zeros((FINGERS + 1, 4))
    measured_bases = grasp.finger_bases
    if not len(measured_bases):
        measured_bases = np.concatenate([recorded.finger_bases for recorded in load_original_grasps().values()])
    base[:FINGERS, 0] = measured_bases.mean(axis=0)
    base[FINGERS, :2] = THUMB_RAD
    torque[FINGERS, 2:] = THUMB_TORQUE_NM
    if grasp.approach != "top":
        torque[:FINGERS, 1:] = HARDWARE_TORQUE_NM if torques == "hardware" else SIMULATION_TORQUE_NM
    else:
        base[:FINGERS, 1:] = OPEN_RAD
        if grasp.object == "rectangular_prism":
            base[FINGERS - 1, 1:] = np.nan
            torque[FINGERS - 1, 1:] = PINKIE_TOP_TORQUE_NM
    return Approach(
        grasp.object,
        grasp.approach,
        grasp.palm_poses.get(setting, grasp.palm_poses["hardware"]),
        np.where(np.isfinite(base), base, OPEN_RAD).ravel(),
        base.ravel(),
        torque.ravel(),
        withdraw_m,
    )
