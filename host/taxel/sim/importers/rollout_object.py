"""The object of a rollout: a known shape in its body's frame, or the shape of its one geom."""

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
from taxel.sim.importers.errors import Source, near_names
from taxel.sim.importers.rollout_names import ModelParts, model_names
from taxel.types import FloatArray

__all__ = ["RolloutObject", "object_of"]

_BOX, _CYLINDER, _MESH = (
    int(kind) for kind in (mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_MESH)
)


@dataclass(frozen=True, eq=False)
class RolloutObject:
    """item: name and shape. frame: f64[4, 4], the shape's frame in the body. geoms: bool[geoms], its own."""

    item: GraspObject
    frame: FloatArray
    geoms: NDArray[np.bool_]


def object_of(
    model: mujoco.MjModel, parts: ModelParts, objects: Mapping[str, GraspObject], source: Source
) -> RolloutObject:
    """The object. Raises ImportDataError for an unknown one, and for a shape that is not one box, cylinder or mesh."""
    geoms = np.asarray(model.geom_bodyid == parts.object_body)
    if parts.known:
        if parts.known not in objects:
            near = near_names(parts.known, objects)
            source.key("object").key("known").fail("a known object", format_value(parts.known), near)
        return RolloutObject(objects[parts.known], np.eye(4), geoms)
    name = model_names(model, "body")[parts.object_body]
    shape, frame = _shape(model, geoms, source.key(f"body {name}"))
    return RolloutObject(GraspObject(name.replace("/", "_"), shape, "From a MuJoCo model"), frame, geoms)


def _shape(model: mujoco.MjModel, geoms: NDArray[np.bool_], place: Source) -> tuple[Shape, FloatArray]:
    colliding = np.flatnonzero(geoms & ((model.geom_contype != 0) | (model.geom_conaffinity != 0)))
    if len(colliding) != 1:
        _refuse(place, f"{len(colliding)} geoms that collide")
    geom = int(colliding[0])
    where, size = make_pose(model.geom_pos[geom], model.geom_quat[geom]), model.geom_size[geom]
    kind = int(model.geom_type[geom])
    if kind == _CYLINDER:
        base = np.eye(4)
        base[2, 3] = -size[1]  # a shape's origin lies in the bottom face, MuJoCo's in the middle
        return Cylinder(float(size[0]), 2 * float(size[1])), where @ base
    if kind == _BOX:
        corners = np.array(np.meshgrid(*([-half, half] for half in size))).reshape(3, -1).T
        return ConvexPolytope.from_mesh(apply(where, corners)), np.eye(4)
    if kind != _MESH:
        _refuse(place, f"a geom of type {mujoco.mjtGeom(kind).name.removeprefix('mjGEOM_').lower()}")
    mesh = int(model.geom_dataid[geom])
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = np.asarray(model.mesh_vert[first : first + count], np.float64)
    return ConvexPolytope.from_mesh(apply(where, vertices)), np.eye(4)


def _refuse(place: Source, found: str) -> NoReturn:
    remedy = "make it one, or name a known shape as known under [object] of the map"
    place.fail("one box, cylinder or convex mesh that collides", found, remedy)
