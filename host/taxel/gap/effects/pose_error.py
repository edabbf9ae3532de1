"""An object or a bracket is not where the model has it."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from taxel.gap.effects.effect import OBJECT, Array, Effect, Parameter
from taxel.gap.effects.geometry import geometry_of
from taxel.gap.state import Signal, State
from taxel.hand.transforms import from_rotation_vector, inverse
from taxel.recording.grasp_format import Phase

PRIOR_MM, PRIOR_DEG = 3.0, 4.0
"""How far off things are mounted, about; it settles what a press cannot tell, such as a slide along a face."""


class PoseError(Effect):
    """Each object (scope "object", its own frame) or bracket ("board") is moved and turned about its origin.

    The rays along the normals meet the mesh elsewhere; each board approaches until its net force is what it was.
    """

    name = "pose_error"
    order = 10
    needs_force: ClassVar[bool] = True

    def __init__(self, scope: str = OBJECT) -> None:
        self.scope = scope
        self.variant = f"{scope}s" if scope == OBJECT else "brackets"

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Translation and rotation vector."""
        move = [Parameter(f"{axis}_mm", "mm", -15.0, 15.0, 0.0, 0.0, PRIOR_MM) for axis in "xyz"]
        turn = [Parameter(f"r{axis}_deg", "deg", -25.0, 25.0, 0.0, 0.0, PRIOR_DEG) for axis in "xyz"]
        return (*move, *turn)

    def apply(self, state: State, signal: Signal, values: Array) -> Signal:
        """See `Effect`."""
        if not values.any() or signal.force is None:
            return signal
        change = self._change(state, values)
        hold = state.clock.phase == Phase.HOLD
        # Each taxel changes as its board's net force does: nothing before contact, all of it in hold.
        board = state.pair.groups.sums[2]
        net = (board @ signal.force.reshape(-1, state.pair.n).T).T.reshape(*signal.force.shape[:2], -1)
        share = net / np.maximum(net[:, hold].mean(axis=1, keepdims=True), 1e-9)
        return signal.with_force(
            np.maximum(signal.force + share[:, :, state.pair.groups.sensor] * change[state.cell][:, None], 0.0)
        )

    def _change(self, state: State, values: Array) -> Array:
        """What the displacement adds to the force in hold, newtons, f64[C, n]."""
        geometry = geometry_of(state)
        blocks = self.blocks(state)
        motions = self._motions(values)
        change = np.zeros((len(state.pair.cells), state.pair.n))
        for number, contact in enumerate(geometry.contacts):
            block = blocks[contact.cell, contact.taxels[0]]
            if values[:, block].any():
                motion = motions[block]
                if self.scope != OBJECT:
                    motion = contact.object_from_board @ motion @ contact.board_from_object
                rest = geometry.rest[number].mean(axis=1)
                change[contact.cell, contact.taxels] = geometry.displaced(state, number, motion) - rest
        return change

    def _motions(self, values: Array) -> Array:
        """Of each block, f64[G, 4, 4]: of boards as an object that is moved sees them, or of brackets in their own
        frames.
        """
        steps = from_rotation_vector(np.radians(values[3:].T))
        steps[:, :3, 3] = 1e-3 * values[:3].T
        return inverse(steps) if self.scope == OBJECT else steps
