"""The objects that are grasped, and what they stand on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.grasp.shapes import ConvexPolytope, Cylinder, Shape
from taxel.hand.transforms import make_pose

# Metres. The thesis shows the objects (figure 5.1) without their sizes: tools/objects/search_sizes.py found these.
BOX_WIDTH_M: Final = 0.069  # of the wide side faces, along x
BOX_DEPTH_M: Final = 0.035  # of the narrow side faces, along y
BOX_HEIGHT_M: Final = 0.130
CYLINDER_RADIUS_M: Final = 0.021
CYLINDER_HEIGHT_M: Final = 0.130
PRISM_SIDE_M: Final = 0.036  # of the equilateral triangle
PRISM_HEIGHT_M: Final = 0.130
EDGE_RADIUS_M: Final = 0.0025  # assumed: prints are sanded, and no skin of silicone survives a sharp edge

# Assumed: how far the object, what it stands on and the arm give way. Well below the stiffness of a print or of a
# finger link, well above that of a light object standing free.
MOUNT_STIFFNESS_N_PER_M: Final = 8000.0
MOUNT_STIFFNESS_NM_PER_RAD: Final = 40.0

# Assumed: where the object stands in front of the arm's base. The stand keeps the hand and its wrist off the table.
STAND_HEIGHT_M: Final = 0.10
STAND_DISTANCE_M: Final = 0.50


@dataclass(frozen=True)
class GraspObject:
    """A rigid object.

    Attributes:
        name: such as "cylinder".
        shape: convex; the object's frame has its origin in the middle of the bottom face and z up.
        description: one line for people.
    """

    name: str
    shape: Shape
    description: str


def thesis_objects() -> dict[str, GraspObject]:
    """The three test objects of the thesis (section 5.2) by name."""
    objects = (
        GraspObject(
            "rectangular_prism",
            ConvexPolytope.box(BOX_WIDTH_M, BOX_DEPTH_M, BOX_HEIGHT_M).rounded(EDGE_RADIUS_M),
            "Box; its wide side faces look along +y and -y, its narrow ones along +x and -x",
        ),
        GraspObject("cylinder", Cylinder(CYLINDER_RADIUS_M, CYLINDER_HEIGHT_M), "Upright cylinder"),
        GraspObject(
            "triangular_prism",
            ConvexPolytope.prism(PRISM_SIDE_M, PRISM_HEIGHT_M).rounded(EDGE_RADIUS_M),
            "Upright equilateral triangular prism; one side face looks along +y",
        ),
    )
    return {item.name: item for item in objects}


def standing_pose() -> npt.NDArray[np.float64]:
    """The nominal pose of an object in the world (the robot's base), f64[4, 4]: upright on the stand, not turned."""
    return make_pose([STAND_DISTANCE_M, 0.0, STAND_HEIGHT_M], [1.0, 0.0, 0.0, 0.0])
