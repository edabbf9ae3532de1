"""Joint dynamics under torques: interface to a physics engine, and sixteen free joints without links."""

from collections.abc import Callable
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from taxel.hand.allegro.joints import JOINT_MAX_RAD, JOINT_MIN_RAD, check_joint_values
from taxel.types import FloatArray

# Assumed values: inertia of a joint with its gear, and a friction that prevents motion at small torques.
INERTIA_KG_M2: Final = 2e-3
FRICTION_NM: Final = 0.02
# Assumed: 0.7 Nm without load gives about 9 rad/s, the order of the free speed of a geared finger joint.
DAMPING_NM_S: Final = 0.075

ExternalTorque = Callable[[FloatArray, FloatArray], npt.ArrayLike]


class JointDynamics(Protocol):
    """Interface of the joint dynamics of a virtual hand. Arrays are f64[16] in the joint order of `joints.py`."""

    @property
    def angles(self) -> FloatArray:
        """Joint angles, f64[16], radians."""
        ...

    def step(self, torque_nm: FloatArray, dt_s: float) -> FloatArray:
        """Apply motor torques f64[16], newton metres, for `dt_s` seconds; return the angles, f64[16], radians."""
        ...


class FreeJoints:
    """Sixteen independent joints with inertia, viscous damping, Coulomb friction and hard stops; no links, no gravity.

    angles: start angles, f64[16], radians, clipped to the joint ranges; default: middle of the ranges.
    inertia_kg_m2, damping_nm_s (Nm per rad/s), friction_nm: of every joint.
    external: (angles, velocities) -> external torque f64[16], Nm, for example of a contact; evaluated at the start of a
        step, so a stiff contact requires short steps.

    Semi-implicit Euler method; damping and friction at the new velocity: I (v' - v) = dt (torque - b v' - c sgn v').
    The solution has a closed form and is stable for every step length with bounded torque. A hard stop sets the
    velocity to 0.
    """

    def __init__(
        self,
        angles: npt.ArrayLike | None = None,
        *,
        inertia_kg_m2: float = INERTIA_KG_M2,
        damping_nm_s: float = DAMPING_NM_S,
        friction_nm: float = FRICTION_NM,
        external: ExternalTorque | None = None,
    ) -> None:
        """Create sixteen independent joints at rest, as a model of the Allegro hand without links and gravity.

        angles: start angles f64[16], radians, clipped to the joint ranges; None: middle of the ranges. inertia_kg_m2,
        damping_nm_s (Nm per rad/s) and friction_nm hold for every joint. external: function (angles, velocities) ->
        external torque f64[16], Nm; None: no external torque. Raises ValueError for a negative parameter.
        """
        if not (inertia_kg_m2 > 0 and damping_nm_s >= 0 and friction_nm >= 0):
            raise ValueError("joints: expected an inertia above 0, and damping and friction of at least 0")
        start = (JOINT_MIN_RAD + JOINT_MAX_RAD) / 2 if angles is None else check_joint_values("angles", angles)
        self._angles: FloatArray = np.clip(start, JOINT_MIN_RAD, JOINT_MAX_RAD)
        self._velocities: FloatArray = np.zeros_like(self._angles)
        self._inertia, self._damping, self._friction = inertia_kg_m2, damping_nm_s, friction_nm
        self._external = external

    @property
    def angles(self) -> FloatArray:
        """Joint angles, f64[16], radians."""
        return self._angles.copy()

    @property
    def velocities(self) -> FloatArray:
        """Joint velocities, f64[16], radians per second."""
        return self._velocities.copy()

    def step(self, torque_nm: npt.ArrayLike, dt_s: float) -> FloatArray:
        """Apply torques f64[16], Nm, for `dt_s` seconds; return the angles after the step, f64[16], radians.

        Raises ValueError for a wrong shape, a value that is not finite, or a negative duration.
        """
        if not 0 <= dt_s < np.inf:
            raise ValueError(f"dt_s: expected a finite number of at least 0, found {dt_s}")
        torque = check_joint_values("torque_nm", torque_nm)
        if self._external is not None:
            torque += check_joint_values("external torque", self._external(self.angles, self.velocities))
        # Friction and damping use the velocity after the step (implicit Euler), so that they never reverse the motion.
        momentum = self._inertia * self._velocities + dt_s * torque
        remaining = np.sign(momentum) * np.maximum(np.abs(momentum) - dt_s * self._friction, 0.0)
        self._velocities = remaining / (self._inertia + dt_s * self._damping)
        unclipped = self._angles + dt_s * self._velocities
        self._angles = np.clip(unclipped, JOINT_MIN_RAD, JOINT_MAX_RAD)
        self._velocities[self._angles != unclipped] = 0.0
        return self.angles
