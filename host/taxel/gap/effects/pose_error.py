"""An object or a bracket is not where the model has it."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from taxel.gap.effects.effect import OBJECT, Effect, Parameter
from taxel.gap.effects.geometry import changed, geometry_of, with_change
from taxel.gap.fitting.state import Signal, State
from taxel.hand.transforms import from_rotation_vector, inverse
from taxel.types import FloatArray

PRIOR_MM, PRIOR_DEG = 3.0, 4.0
"""How far off things are mounted, about; it settles what a press cannot tell, such as a slide along a face."""

HELD_N_PER_MM, HELD_MOST = 2.0, 20.0
"""What holds an object gives way like this, to begin with, and at most."""

PLACE, TURN, HELD = slice(0, 3), slice(3, 6), 6
"""Rows of the values."""


class PoseError(Effect):
    """Each object (scope "object", its own frame) or bracket ("board") is moved and turned about its origin.

    The rays along the normals meet the mesh elsewhere; each board approaches until its net force is what it was. Where
    boards bear an object together, one that stands elsewhere is held aside, and they share it differently
    (`held_object.py`).
    """

    name = "pose_error"
    order = 10
    needs_force: ClassVar[bool] = True

    def __init__(self, scope: str = OBJECT) -> None:
        self.scope = scope
        self.variant = f"{scope}s" if scope == OBJECT else "brackets"

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Translation and rotation vector; of an object also how stiffly it is held."""
        move = [Parameter(f"{axis}_mm", "mm", -15.0, 15.0, 0.0, 0.0, PRIOR_MM) for axis in "xyz"]
        turn = [Parameter(f"r{axis}_deg", "deg", -25.0, 25.0, 0.0, 0.0, PRIOR_DEG) for axis in "xyz"]
        if self.scope != OBJECT:
            return (*move, *turn)
        return (*move, *turn, Parameter("held_n_per_mm", "N/mm", 0.0, HELD_MOST, 0.0, HELD_N_PER_MM, HELD_N_PER_MM))

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """See `Effect`."""
        if not values[: TURN.stop].any() or signal.force is None:
            return signal
        return with_change(state, signal, self._change(state, values))

    def _change(self, state: State, values: FloatArray) -> FloatArray:
        """What the displacement does to the forces, f64[C, 2, L, n] as `with_change` takes it."""
        geometry = geometry_of(state)
        blocks, motions = self.blocks(state), self._motions(values)
        displaced, held = {}, {}
        for number, contact in enumerate(geometry.contacts):
            block = blocks[contact.condition, contact.taxels[0]]
            if values[: TURN.stop, block].any():
                motion = motions[block]
                if self.scope == OBJECT:
                    held[number] = 1e3 * float(values[HELD, block])
                else:
                    motion = contact.object_from_board @ motion @ contact.board_from_object
                displaced[number] = motion
        return changed(state, geometry.displaced(state, displaced, held))

    def _motions(self, values: FloatArray) -> FloatArray:
        """Of each block, f64[G, 4, 4]: of boards as an object that is moved sees them, or of brackets in their own
        frames.
        """
        steps = from_rotation_vector(np.radians(values[TURN].T))
        steps[:, :3, 3] = 1e-3 * self.told(values)[PLACE].T
        return inverse(steps) if self.scope == OBJECT else steps

    def told(self, values: FloatArray) -> FloatArray:
        """Values as people are told them: the translation of the origin, in the frame before the turn.

        A bracket's is fitted in the frame after it, in which no press tells a translation along a flat board's normal,
        since the approach is solved anew: there it stays where the prior has it, instead of a little anywhere.
        """
        if self.scope == OBJECT:
            return values
        turn = from_rotation_vector(np.radians(values[TURN].T))[:, :3, :3]
        return np.concatenate([np.einsum("gij,jg->ig", turn, values[PLACE]), values[TURN]])
