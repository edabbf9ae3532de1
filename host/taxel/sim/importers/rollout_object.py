"""The object of a rollout: a known shape in the frame of its body, or the shape of its only geom."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NoReturn

import mujoco
import numpy as np
from numpy.typing import NDArray

from taxel.grasp.objects import GraspObject
from taxel.grasp.shapes import ConvexPolytope, Cylinder, Shape
from taxel.hand.errors import format_value
from taxel.hand.transforms import apply, make_pose
from taxel.sim.importers.errors import FileLocation, suggest_names
from taxel.sim.importers.rollout_names import ModelParts, model_names
from taxel.types import FloatArray

__all__ = ["RolloutObject", "make_rollout_object"]

_BOX, _CYLINDER, _MESH = (
    int(kind) for kind in (mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_MESH)
)


@dataclass(frozen=True, eq=False)
class RolloutObject:
    """The grasped object and its part of the MuJoCo model.

    grasp_object: name and shape. frame: f64[4, 4], frame of the shape in the body of the object. is_geom: bool[geoms],
    whether a geom of the model belongs to the object.
    """

    grasp_object: GraspObject
    frame: FloatArray
    is_geom: NDArray[np.bool_]


def make_rollout_object(
    model: mujoco.MjModel, parts: ModelParts, objects: Mapping[str, GraspObject], source: FileLocation
) -> RolloutObject:
    """Determine the shape of the grasped object in a MuJoCo model.

    If the model map names a known shape, this shape is in the frame of the object's body; otherwise the shape is that
    of the body's only geom. Raises ImportDataError for an unknown name of a shape, and for a body without exactly one
    colliding box, cylinder or mesh.
    """
    is_geom = np.asarray(model.geom_bodyid == parts.object_body)
    known_shape = parts.known_shape
    if known_shape:
        if known_shape not in objects:
            suggestion = suggest_names(known_shape, objects)
            source.key("object").key("known").fail("a known object", format_value(known_shape), suggestion)
        return RolloutObject(objects[known_shape], np.eye(4), is_geom)
    name = model_names(model, "body")[parts.object_body]
    shape, frame = _find_shape(model, is_geom, source.key(f"body {name}"))
    return RolloutObject(GraspObject(name.replace("/", "_"), shape, "From a MuJoCo model"), frame, is_geom)


def _find_shape(model: mujoco.MjModel, is_geom: NDArray[np.bool_], location: FileLocation) -> tuple[Shape, FloatArray]:
    """Return the shape of the only colliding geom of the object, and the pose of the shape in its body, f64[4, 4].

    is_geom: geoms of the object's body. Raises ImportDataError.
    """
    colliding = np.flatnonzero(is_geom & ((model.geom_contype != 0) | (model.geom_conaffinity != 0)))
    if len(colliding) != 1:
        _fail_for_shape(location, f"{len(colliding)} colliding geoms")
    geom = int(colliding[0])
    pose, size = make_pose(model.geom_pos[geom], model.geom_quat[geom]), model.geom_size[geom]
    kind = int(model.geom_type[geom])
    if kind == _CYLINDER:
        base = np.eye(4)
        base[2, 3] = -size[
            1
        ]  # the origin of a `Cylinder` is in its bottom face, that of a MuJoCo cylinder in its centre
        return Cylinder(float(size[0]), 2 * float(size[1])), pose @ base
    if kind == _BOX:
        corners = np.array(np.meshgrid(*([-half, half] for half in size))).reshape(3, -1).T
        return ConvexPolytope.from_mesh(apply(pose, corners)), np.eye(4)
    if kind != _MESH:
        _fail_for_shape(location, f"a geom of type {mujoco.mjtGeom(kind).name.removeprefix('mjGEOM_').lower()}")
    mesh = int(model.geom_dataid[geom])
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = np.asarray(model.mesh_vert[first : first + count], np.float64)
    return ConvexPolytope.from_mesh(apply(pose, vertices)), np.eye(4)


def _fail_for_shape(location: FileLocation, found: str) -> NoReturn:
    """Raise ImportDataError for an object without exactly one usable shape; found: geoms in the model, for the text."""
    remedy = "change the model, or set the key known under [object] of the map"
    location.fail("one colliding geom: a box, a cylinder or a convex mesh", found, remedy)
