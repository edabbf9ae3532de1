"""The experimenter's other hand, which steadies the object while the robot hand closes and opens."""

import mujoco
import numpy as np

from taxel.grasp.objects import (
    STEADYING_N_PER_M,
    STEADYING_N_S_PER_M,
    STEADYING_NM_PER_RAD,
    STEADYING_NM_S_PER_RAD,
)
from taxel.sim.scene import Scene
from taxel.types import FloatArray


class Steadying:
    """Springs and dampers that keep the object at the pose at which the experimenter took hold of it.

    firmness: factor from 0 (no hold) to 1 on all springs and dampers; set it before each time step with `set_firmness`.
    """

    def __init__(self, scene: Scene) -> None:
        """Prepare the hold on the object of a scene, at full firmness and at the object's pose in the first step."""
        model = scene.model
        body = model.body("object").id
        self._position = slice(
            model.jnt_qposadr[model.body_jntadr[body]], model.jnt_qposadr[model.body_jntadr[body]] + 7
        )
        self._centre = model.body_ipos[body].copy()
        self._rest: FloatArray | None = None
        self.firmness = 1.0

    def set_firmness(self, firmness: float) -> None:
        """Set the firmness of the hold, a factor from 0 to 1 on the stiffness of springs and dampers; 0 is no hold.

        When the firmness rises from 0, the next `compute_load` takes the object's pose as the rest pose of the hold.
        """
        if self.firmness == 0.0 and firmness > 0.0:
            self._rest = None
        self.firmness = firmness

    def compute_load(self, data: mujoco.MjData) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Compute the force of the springs on the object's six coordinates, and the stiffness and damping of the hold.

        The springs act at the centre of mass; they pull its position and the rotation of the object towards the rest
        pose, which is the pose in the first call after the hold began. The coordinates are those of MuJoCo's free
        joint: position of the object's origin in the world (m), then rotation in the object's frame (rad).

        Returns the force f64[6] (N, then Nm), the stiffness f64[6, 6] (negative derivative of the force with respect to
        the coordinates: N/m, N/rad, Nm/m, Nm/rad) and the damping f64[6, 6] (the same units times s). The force does
        not contain the force of the dampers, which is minus the damping times the velocities of the coordinates. All
        three are proportional to the firmness.
        """
        pose = data.qpos[self._position]
        if self._rest is None:
            self._rest = pose.copy()
        turn, rotation = np.zeros(3), np.zeros(9)
        mujoco.mju_subQuat(turn, pose[3:], self._rest[3:])
        mujoco.mju_quat2Mat(rotation, pose[3:])
        jacobian = np.eye(6)  # motion of the centre and rotation in the object's frame, from the coordinates
        jacobian[:3, 3:] = -rotation.reshape(3, 3) @ _make_cross(self._centre)
        motion = np.concatenate([pose[:3] - self._rest[:3] + jacobian[:3, 3:] @ turn, turn])
        stiffness = self.firmness * np.repeat([STEADYING_N_PER_M, STEADYING_NM_PER_RAD], 3)
        damping = self.firmness * np.repeat([STEADYING_N_S_PER_M, STEADYING_NM_S_PER_RAD], 3)
        return (
            -(stiffness * motion) @ jacobian,
            jacobian.T @ (stiffness[:, None] * jacobian),
            jacobian.T @ (damping[:, None] * jacobian),
        )


def _make_cross(vector: FloatArray) -> FloatArray:
    """Build the matrix f64[3, 3] that computes the cross product with a vector f64[3]."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
