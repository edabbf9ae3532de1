"""Pose error: an object or a bracket is displaced and rotated relative to the simulation."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from taxel.gap.effects.effect import OBJECT, Effect, Parameter
from taxel.gap.effects.force_changes import apply_change, assemble_change
from taxel.gap.effects.geometry import compute_geometry
from taxel.gap.fitting.state import Signal, State
from taxel.hand.transforms import from_rotation_vector, inverse
from taxel.types import FloatArray

PRIOR_STD_MM, PRIOR_STD_DEG = 3.0, 4.0
"""Prior standard deviation of each component of translation, millimetres, and of rotation, degrees. Chosen: a usual
mounting error. The prior determines components that are not identifiable, such as a translation along a plane face."""

MOUNT_N_PER_MM, MAX_MOUNT_N_PER_MM = 2.0, 20.0
"""Start value (also the prior standard deviation) and upper bound of the stiffness of an object's mount, N/mm."""

TRANSLATION, ROTATION, MOUNT = slice(0, 3), slice(3, 6), 6
"""Rows of the parameter values."""


class PoseError(Effect):
    """Translation and rotation about the origin of each object (scope "object", in the frame of the object) or of each
    bracket (scope "board", in the frame of the bracket).

    The depths follow from rays along the taxel normals to the displaced mesh. Each board is shifted until its net force
    equals the force without displacement. If several boards carry an object, its mount holds back a displaced object,
    and the boards share the load differently (`held_object.py`).
    """

    name = "pose_error"
    order = 10
    needs_force: ClassVar[bool] = True

    def __init__(self, scope: str = OBJECT) -> None:
        self.scope = scope
        self.variant = f"{scope}s" if scope == OBJECT else "brackets"

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return the parameters: translation, rotation vector, and for an object the stiffness of its mount."""
        # name, unit, lower and upper bound, neutral value, start value, standard deviation of the prior
        translation = [Parameter(f"{axis}_mm", "mm", -15.0, 15.0, 0.0, 0.0, PRIOR_STD_MM) for axis in "xyz"]
        rotation = [Parameter(f"r{axis}_deg", "deg", -25.0, 25.0, 0.0, 0.0, PRIOR_STD_DEG) for axis in "xyz"]
        if self.scope != OBJECT:
            return (*translation, *rotation)
        return (
            *translation,
            *rotation,
            Parameter("held_n_per_mm", "N/mm", 0.0, MAX_MOUNT_N_PER_MM, 0.0, MOUNT_N_PER_MM, MOUNT_N_PER_MM),
        )

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the signal with the forces of the displaced contacts; `signal` itself without contact forces, or if
        all translations and rotations are 0. values: f64[P, G] (P parameters; G blocks: the hand, boards, objects or
        taxels), the parameters of `own_parameters` for each block.
        """
        if not values[: ROTATION.stop].any() or signal.force is None:
            return signal
        return apply_change(state, signal, self._compute_change(state, values))

    def _compute_change(self, state: State, values: FloatArray) -> FloatArray:
        """Return the change of the taxel forces, f64[Q, 2, L, n] (Q simulated contacts, n taxels): kept share and
        gained force at L levels of the net force, see `force_changes.apply_change`. values: f64[P, G] (P parameters; G
        blocks: the hand, boards, objects or taxels).
        """
        geometry = compute_geometry(state)
        blocks, motions = self.find_blocks(state), self._compute_motions(values)
        board_motions, mounts = {}, {}
        for number, contact in enumerate(geometry.contacts):
            block = blocks[contact.condition, contact.taxels[0]]
            if values[: ROTATION.stop, block].any():
                motion = motions[block]
                if self.scope == OBJECT:
                    mounts[number] = 1e3 * float(values[MOUNT, block])
                else:  # convert the motion from the bracket frame to the object frame
                    motion = contact.object_from_board @ motion @ contact.board_from_object
                board_motions[number] = motion
        return assemble_change(
            state, geometry.contacts, geometry.compute_displacement_changes(state, board_motions, mounts)
        )

    def _compute_motions(self, values: FloatArray) -> FloatArray:
        """Return the motion of each of the G blocks, f64[G, 4, 4], metres. values: f64[P, G] (P parameters).

        Scope "object": motion of the boards relative to the object, the inverse of the object's motion. Scope "board":
        motion of the bracket in its own frame.
        """
        steps = from_rotation_vector(np.radians(values[ROTATION].T))
        steps[:, :3, 3] = 1e-3 * self.convert_to_reported(values)[TRANSLATION].T
        return inverse(steps) if self.scope == OBJECT else steps

    def convert_to_reported(self, values: FloatArray) -> FloatArray:
        """Convert fitted values f64[P, G] (P parameters; G blocks: the hand, boards, objects or taxels) to reported
        values f64[P, G].

        The reported translation is the motion of the origin, with components along the axes of the frame before the
        rotation. Values of objects do not change. The translation of a bracket is fitted along the axes after the
        rotation, for the following reason. A board is shifted until its net force is kept; the translation along the
        normal of a flat board is therefore not identifiable, and only the prior determines it. Along the axes after the
        rotation this translation is one component. Along the axes before the rotation it would affect all three.
        """
        if self.scope == OBJECT:
            return values
        rotation = from_rotation_vector(np.radians(values[ROTATION].T))[:, :3, :3]
        return np.concatenate([np.einsum("gij,jg->ig", rotation, values[TRANSLATION]), values[ROTATION]])
