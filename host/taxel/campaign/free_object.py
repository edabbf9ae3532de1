"""The object of the emulated hand: a free rigid body under gravity that stands on a plane with dry friction.

The equations are in firmware/emulator/dynamics/free_object.c.
"""

import ctypes
from typing import Final

import numpy as np

from taxel.emulated.dynamics import OBJECT_DOF, ObjectStruct, load_dynamics_library, make_pose, view_frame
from taxel.grasp.objects import (
    GRAVITY_M_PER_S2,
    STAND_FRICTION,
    STAND_N_PER_M,
    STEADYING_N_PER_M,
    STEADYING_N_S_PER_M,
    STEADYING_NM_PER_RAD,
    STEADYING_NM_S_PER_RAD,
    compute_mass_properties,
)
from taxel.grasp.shapes import Shape
from taxel.types import FloatArray

MESH_RESOLUTION: Final = 20
"""Points on the edges of a cylinder (chosen)."""


class FreeObject:
    """Pose, inertia and support of a free object. Coordinates: motion of the centre of mass and rotation, world.

    The object touches the stand with its vertices. Each vertex is a spring normal to the plane of the stand. It sticks
    to the plane, and slides where the force along the plane exceeds the friction coefficient times the normal force.

    Attributes:
        struct: constants and state for the C library.
    """

    def __init__(self, shape: Shape, pose: FloatArray) -> None:
        """Place an object at rest on its stand, whose surface is the plane z = 0 of the object's first pose."""
        self._library = load_dynamics_library()
        mass = compute_mass_properties(shape)
        vertices = np.unique(shape.mesh(MESH_RESOLUTION)[0].round(9), axis=0)
        is_bottom = vertices[:, 2] < vertices[:, 2].min() + 1e-6
        # NaN: the vertex does not stick to the stand yet.
        self._vertices, self._stuck = np.ascontiguousarray(vertices), np.full_like(vertices, np.nan)
        item = self.struct = ObjectStruct(mass_kg=mass.mass_kg, gravity_m_per_s2=GRAVITY_M_PER_S2, firmness=1.0)
        item.centre[:], item.inertia[:] = mass.centre_m.tolist(), mass.inertia_kg_m2.ravel().tolist()
        item.up[:], item.level = pose[:3, 2].tolist(), float(pose[:3, 2] @ pose[:3, 3])
        # The springs of the bottom vertices together have the stiffness of the stand.
        item.stand_rate, item.stand_friction = STAND_N_PER_M / is_bottom.sum(), STAND_FRICTION
        item.steadying_rate[:] = STEADYING_N_PER_M, STEADYING_NM_PER_RAD
        item.steadying_damping[:] = STEADYING_N_S_PER_M, STEADYING_NM_S_PER_RAD
        item.vertex_count, item.vertices = len(vertices), self._vertices.ctypes.data
        item.stuck = self._stuck.ctypes.data
        view_frame(item.pose)[:] = view_frame(item.steadied_pose)[:] = pose[:3]

    @property
    def pose(self) -> FloatArray:
        """Pose of the object frame in the world, f64[4, 4]."""
        return make_pose(self.struct.pose)

    def steady(self, firmness: float) -> None:
        """Set how firmly the experimenter's hand steadies the object, 0 (not at all) to 1.

        If the value rises from 0, the experimenter holds the object at its present pose from now on.
        """
        if self.struct.firmness == 0.0 and firmness > 0.0:
            self.struct.steadied_pose = self.struct.pose
        self.struct.firmness = firmness

    def compute_steadying(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Compute the load of the experimenter's hand on the object, and its stiffness and its damping, each f64[6].

        The load is a force in N and a moment in Nm about the centre of mass; stiffness and damping are per coordinate.
        """
        values = np.zeros((3, OBJECT_DOF))
        self._library.taxel_dynamics_steadying(ctypes.byref(self.struct), *(row.ctypes.data for row in values))
        load, stiffness, damping = values
        return load, stiffness, damping

    def compute_support(self) -> tuple[FloatArray, FloatArray]:
        """Compute the load of weight and stand on the object, f64[6], and the stand's stiffness f64[6, 6].

        The load is a force in N and a moment in Nm about the centre of mass. The call also moves the points at which
        sliding vertices stick to the stand, so call it once per time step.
        """
        load, stiffness = np.zeros(OBJECT_DOF), np.zeros((OBJECT_DOF, OBJECT_DOF))
        self._library.taxel_dynamics_support(ctypes.byref(self.struct), load.ctypes.data, stiffness.ctypes.data)
        return load, stiffness

    def move(self, velocity: FloatArray, dt: float) -> None:
        """Move the object for `dt` seconds. velocity: f64[6], of the centre of mass (m/s), and angular (rad/s)."""
        values = np.ascontiguousarray(velocity, dtype=np.float64)
        if values.shape != (OBJECT_DOF,):
            raise ValueError(f"expected a velocity of {OBJECT_DOF} numbers, found shape {values.shape}")
        self._library.taxel_dynamics_move(ctypes.byref(self.struct), values.ctypes.data, dt)
