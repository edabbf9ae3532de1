"""Failure of a grasp: one definition on the true poses of hand and object, for the emulated hand and the simulator.

A grasp fails if, in its hold phase, the hand does not hold the object as the planned approach intends. Every limit
follows from the plan, from the shape of the object or from the description of the hand; there is no tuned threshold
(docs/grasp-campaign.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np

from taxel.campaign.setup import Setup
from taxel.grasp.objects import compute_mass_properties
from taxel.grasp.plan import PlannedGrasp
from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.transforms import apply, inverse
from taxel.types import BoolArray, FloatArray

ROUNDING_M: Final = 1e-9
"""Distance below which a computed point lies on the surface of an object, metres: rounding of float64, no tolerance."""


class Failure(StrEnum):
    """How a grasp failed; the values are the words that grasp datasets contain."""

    LOST = "lost"
    """At the end of the hold the object is farther from every taxel than a touch permits."""
    TOPPLED = "toppled"
    """The object is tilted so far that it falls over without the hand: its centre of mass is beside its base."""
    TURNED = "turned"
    """The object has turned so far that the palm's direction is closer to another approach's than to the planned one.
    """
    MOVING = "moving"
    """In the hold the object moves at a touching taxel by more than half the pitch: the contact would shift to another
    taxel.
    """


@dataclass(frozen=True, eq=False)
class GraspCheck:
    """Checks whether the motion of one planned grasp is a failure.

    hand: its pitch and its layer thickness give the limits of touch and motion. shape: shape of the object. centre_m:
    f64[3], centre of mass, object frame. up: f64[3], normal of the stand, world. palm_axis: f64[3], direction from the
    palm to the object in the hold, world. planned_axis: f64[3], the same direction in the frame of the undisturbed
    object. other_axes: f64[a, 3], this direction for each of the object's a other approaches, object frame.
    """

    hand: Hand
    shape: Shape
    centre_m: FloatArray
    up: FloatArray
    palm_axis: FloatArray
    planned_axis: FloatArray
    other_axes: FloatArray

    def find_failure(self, object_poses: FloatArray, bracket_poses: FloatArray) -> Failure | None:
        """Find the failure of a grasp from its hold phase.

        object_poses: true poses f64[k, 4, 4] of the object at k times of the hold, in order of time, world.
        bracket_poses: f64[k, s, 4, 4], poses of the brackets of the s boards. Returns the first failure that applies,
        in the order of `Failure`; None for a successful grasp and for a grasp without a hold phase (k = 0).
        """
        if not len(object_poses):
            return None
        taxels = self._compute_taxel_positions(object_poses[-1], bracket_poses[-1])
        contacts = taxels[self._find_touching_taxels(taxels)]
        if not len(contacts):
            return Failure.LOST
        if self._is_toppled(object_poses[-1]):
            return Failure.TOPPLED
        if self._is_turned(object_poses[-1]):
            return Failure.TURNED
        return Failure.MOVING if self._has_moved(object_poses, contacts) else None

    def _has_moved(self, poses: FloatArray, contacts: FloatArray) -> bool:
        """Return whether a contact point of the object moves by more than half the pitch during the hold.

        Each pose is compared with the last one. poses: f64[k, 4, 4] of the object. contacts: f64[m, 3], object frame.
        Only the motion of the object counts: the palm is at rest, and a finger may still move on an object at rest.
        """
        points = contacts @ poses[:, :3, :3].transpose(0, 2, 1) + poses[:, None, :3, 3]
        return bool(np.linalg.norm(points - points[-1], axis=2).max() > self.hand.pitch_m / 2.0)

    def _compute_taxel_positions(self, object_pose: FloatArray, bracket_poses: FloatArray) -> FloatArray:
        """Compute the centres of all taxels in the frame of the object, f64[n, 3].

        object_pose: f64[4, 4], bracket_poses: f64[s, 4, 4], world.
        """
        positions = np.empty((self.hand.n_taxels, 3))
        for board, pose in zip(self.hand.boards, inverse(object_pose) @ bracket_poses, strict=True):
            part = self.hand.get_slice(board.address)
            positions[part] = apply(pose, self.hand.position[part])
        return positions

    def _find_touching_taxels(self, positions: FloatArray) -> BoolArray:
        """Return for each of n taxels whether the object may touch the layer over it, bool[n].

        positions: centres of the taxels f64[n, 3], object frame. The layer's surface over a taxel is at most the layer
        thickness above the taxel's centre and half the diagonal of the taxel's square beside it.
        """
        reach_m = np.hypot(self.hand.layer_m or 0.0, self.hand.pitch_m / np.sqrt(2.0))
        return np.asarray(self.shape.signed_distance(positions) < reach_m)

    def _is_toppled(self, pose: FloatArray) -> bool:
        """Return whether the object would fall over: the vertical through its centre of mass misses its base.

        pose: f64[4, 4] of the object. An object that lies upside down is treated as toppled.
        """
        up = pose[:3, :3].T @ self.up
        if up[2] <= 0.0:
            return True
        foot = self.centre_m - up * (self.centre_m[2] / up[2])
        foot[2] = 0.0
        return bool(self.shape.signed_distance(foot) > ROUNDING_M)

    def _is_turned(self, pose: FloatArray) -> bool:
        """Return whether the object has turned so far in the hand that the grasp resembles another approach.

        This is the case if the palm's direction, seen from the object, is closer to the direction of another approach
        than to the direction of the planned approach. pose: f64[4, 4] of the object.
        """
        axis = pose[:3, :3].T @ self.palm_axis
        return bool((self.other_axes @ axis).max(initial=-np.inf) > self.planned_axis @ axis)


def make_grasp_check(setup: Setup, planned: PlannedGrasp) -> GraspCheck:
    """Make the failure check of a planned grasp from the planned poses and the approaches to the same object."""
    approaches = setup.approaches_to(planned.object)
    planned_axis = approaches[planned.approach].palm_pose[:3, 0]
    other = [approach.palm_pose[:3, 0] for name, approach in approaches.items() if name != planned.approach]
    pose, shape = setup.object_pose(planned.object), setup.objects[planned.object].shape
    return GraspCheck(
        hand=setup.hand,
        shape=shape,
        centre_m=compute_mass_properties(shape).centre_m,
        up=pose[:3, 2],
        palm_axis=pose[:3, :3] @ planned_axis,
        planned_axis=planned_axis,
        other_axes=np.array(other).reshape(-1, 3),
    )
