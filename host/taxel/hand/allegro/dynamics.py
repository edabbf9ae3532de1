"""How sixteen joints move under torques: the seam to a physics engine, and joints that hang in the air."""

from collections.abc import Callable
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from taxel.hand.allegro.joints import JOINT_MAX_RAD, JOINT_MIN_RAD, sixteen
from taxel.types import FloatArray

# Chosen, not measured: the joint's own inertia with its gear, and a friction that leaves small demands without motion.
INERTIA_KG_M2: Final = 2e-3
FRICTION_NM: Final = 0.02
# So that 0.7 Nm without load turns a joint at about 9 rad/s, the order of a geared finger joint's free speed.
DAMPING_NM_S: Final = 0.075

ExternalTorque = Callable[[FloatArray, FloatArray], npt.ArrayLike]


class JointDynamics(Protocol):
    """What a virtual hand drives. Arrays are f64[16] in the joint order of `joints.py`."""

    @property
    def angles(self) -> FloatArray:
        """f64[16], radians."""
        ...

    def step(self, torque_nm: FloatArray, dt_s: float) -> FloatArray:
        """Apply motor torques f64[16], newton metres, for `dt_s` seconds; returns the angles, f64[16], radians."""
        ...


class FreeJoints:
    """Sixteen joints, each with its inertia, viscous damping, Coulomb friction and hard stops. No links, no gravity.

    angles: f64[16], radians, start, clipped to the ranges; default is their middle.
    inertia_kg_m2, damping_nm_s (Nm per rad/s), friction_nm: of every joint.
    external: (angles, velocities) -> f64[16], Nm, such as a contact; taken at the start of a step, so a stiff one needs
        short steps.

    Semi-implicit Euler: damping and friction act at the new velocity, I (v' - v) = dt (torque - b v' - c sgn v'). That
    has a closed form and is stable for every step when the torque is bounded. A stop takes all the velocity.
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
        if not (inertia_kg_m2 > 0 and damping_nm_s >= 0 and friction_nm >= 0):
            raise ValueError("joints: expected inertia above 0, damping and friction of at least 0")
        start = (JOINT_MIN_RAD + JOINT_MAX_RAD) / 2 if angles is None else sixteen("angles", angles)
        self._angles: FloatArray = np.clip(start, JOINT_MIN_RAD, JOINT_MAX_RAD)
        self._velocities: FloatArray = np.zeros_like(self._angles)
        self._inertia, self._damping, self._friction = inertia_kg_m2, damping_nm_s, friction_nm
        self._external = external

    @property
    def angles(self) -> FloatArray:
        """f64[16], radians."""
        return self._angles.copy()

    @property
    def velocities(self) -> FloatArray:
        """f64[16], radians a second."""
        return self._velocities.copy()

    def step(self, torque_nm: npt.ArrayLike, dt_s: float) -> FloatArray:
        """Apply f64[16] Nm for `dt_s` seconds; returns the angles. Raises ValueError for a wrong shape or step."""
        if not 0 <= dt_s < np.inf:
            raise ValueError(f"dt_s: expected at least 0, found {dt_s}")
        torque = sixteen("torque_nm", torque_nm)
        if self._external is not None:
            torque += sixteen("external torque", self._external(self.angles, self.velocities))
        momentum = self._inertia * self._velocities + dt_s * torque
        moving = np.sign(momentum) * np.maximum(np.abs(momentum) - dt_s * self._friction, 0.0)
        self._velocities = moving / (self._inertia + dt_s * self._damping)
        wanted = self._angles + dt_s * self._velocities
        self._angles = np.clip(wanted, JOINT_MIN_RAD, JOINT_MAX_RAD)
        self._velocities[self._angles != wanted] = 0.0
        return self.angles
