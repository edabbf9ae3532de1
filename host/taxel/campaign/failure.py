"""Failure of a grasp: one definition on the true poses of hand and object, for the emulated hand and the simulator.

A grasp fails if its hold contains no grasp of its approach. Every limit follows from the plan, from the shape of the
object or from the description of the hand; there is no tuned threshold (docs/grasp-campaign.md).
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
    """Kind of a failure; grasp datasets contain these words."""

    LOST = "lost"
    """At the end of the hold the object is farther from every taxel than a touch permits."""
    TOPPLED = "toppled"
    """The object is tilted so far that it falls over without the hand: its centre of mass is beside its base."""
    TURNED = "turned"
    """The object has turned so far that the palm is nearer to another approach of the plan than to its own."""
    MOVING = "moving"
    """In the hold the object moves at a touching taxel by more than half the pitch: its contact would change taxel."""


@dataclass(frozen=True, eq=False)
class GraspCheck:
    """Check of the motion of one planned grasp.

    hand: the hand, whose pitch and layer limit touch and motion. shape, centre_m: of the object, and its centre of mass
    f64[3], object frame. up: f64[3], normal of the stand, world. palm_axis: f64[3], direction from the palm to the
    object in the hold, world. own_axis, other_axes: this direction as planned, f64[3], and that of the other approaches
    to the object, f64[a, 3], object frame.
    """

    hand: Hand
    shape: Shape
    centre_m: FloatArray
    up: FloatArray
    palm_axis: FloatArray
    own_axis: FloatArray
    other_axes: FloatArray

    def find_failure(self, object_poses: FloatArray, bracket_poses: FloatArray) -> Failure | None:
        """Find the failure of a grasp from its hold; None for a successful grasp.

        object_poses: true poses f64[k, 4, 4] of the object in the hold, in order of time, world. bracket_poses: f64[k,
        s, 4, 4], of the boards. The first failure that applies is returned, in the order of `Failure`. Without a pose
        in the hold (a timeline without this phase) there is nothing to check.
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
        """Whether the object has moved at a contact by more than half the pitch, from any time of the hold to its end.

        poses: f64[k, 4, 4] of the object. contacts: f64[m, 3], object frame. The palm rests in the hold; a finger that
        still settles on an object at rest is no motion of the object.
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
        """Find the taxels that the object may touch, bool[n]; positions: their centres f64[n, 3], object frame.

        A point of the layer's surface over a taxel is at most the thickness of the layer above its plane and half the
        diagonal of its square beside its centre.
        """
        reach_m = np.hypot(self.hand.layer_m or 0.0, self.hand.pitch_m / np.sqrt(2.0))
        return np.asarray(self.shape.signed_distance(positions) < reach_m)

    def _is_toppled(self, pose: FloatArray) -> bool:
        """Whether the line of gravity through the centre of mass misses the base; pose: f64[4, 4] of the object."""
        up = pose[:3, :3].T @ self.up
        if up[2] <= 0.0:
            return True
        foot = self.centre_m - up * (self.centre_m[2] / up[2])
        foot[2] = 0.0
        return bool(self.shape.signed_distance(foot) > ROUNDING_M)

    def _is_turned(self, pose: FloatArray) -> bool:
        """Whether the palm points at the object as in another approach; pose: f64[4, 4] of the object."""
        axis = pose[:3, :3].T @ self.palm_axis
        return bool((self.other_axes @ axis).max(initial=-np.inf) > self.own_axis @ axis)


def make_grasp_check(setup: Setup, planned: PlannedGrasp) -> GraspCheck:
    """Make the check of the motion of a planned grasp."""
    approaches = setup.approaches_to(planned.object)
    own_axis = approaches[planned.approach].palm_pose[:3, 0]
    other = [approach.palm_pose[:3, 0] for name, approach in approaches.items() if name != planned.approach]
    pose, shape = setup.object_pose(planned.object), setup.objects[planned.object].shape
    return GraspCheck(
        hand=setup.hand,
        shape=shape,
        centre_m=compute_mass_properties(shape).centre_m,
        up=pose[:3, 2],
        palm_axis=pose[:3, :3] @ own_axis,
        own_axis=own_axis,
        other_axes=np.array(other).reshape(-1, 3),
    )
