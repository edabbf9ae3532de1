"""Grasped objects, their mount and their nominal pose."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.grasp.shapes import ConvexPolytope, Cylinder, Shape
from taxel.hand.transforms import make_pose

# Metres. The thesis shows the objects (figure 5.1) without sizes; these were found with tools/objects/search_sizes.py.
BOX_WIDTH_M: Final = 0.069  # of the wide side faces, along x
BOX_DEPTH_M: Final = 0.035  # of the narrow side faces, along y
BOX_HEIGHT_M: Final = 0.130
CYLINDER_RADIUS_M: Final = 0.021
CYLINDER_HEIGHT_M: Final = 0.130
PRISM_SIDE_M: Final = 0.036  # of the equilateral triangle
PRISM_HEIGHT_M: Final = 0.130
EDGE_RADIUS_M: Final = 0.0025  # assumed: prints are sanded, because sharp edges damage a silicone skin

# Assumed compliance of object, stand and arm: well below the stiffness of a print or of a finger link, well above that
# of a light free-standing object.
MOUNT_STIFFNESS_N_PER_M: Final = 8000.0
MOUNT_STIFFNESS_NM_PER_RAD: Final = 40.0

# Assumed position of the object in front of the arm's base. The stand keeps hand and wrist above the table.
STAND_HEIGHT_M: Final = 0.10
STAND_DISTANCE_M: Final = 0.50


@dataclass(frozen=True)
class GraspObject:
    """Rigid object.

    Attributes:
        name: such as "cylinder".
        shape: convex; origin of the object frame in the centre of the bottom face, z up.
        description: one line of text.
    """

    name: str
    shape: Shape
    description: str


def make_thesis_objects() -> dict[str, GraspObject]:
    """Make the three test objects of the thesis (section 5.2): a box, a cylinder and a triangular prism, by name."""
    objects = (
        GraspObject(
            "rectangular_prism",
            ConvexPolytope.box(BOX_WIDTH_M, BOX_DEPTH_M, BOX_HEIGHT_M).rounded(EDGE_RADIUS_M),
            "Box with wide side faces towards +y and -y, narrow side faces towards +x and -x",
        ),
        GraspObject("cylinder", Cylinder(CYLINDER_RADIUS_M, CYLINDER_HEIGHT_M), "Upright cylinder"),
        GraspObject(
            "triangular_prism",
            ConvexPolytope.prism(PRISM_SIDE_M, PRISM_HEIGHT_M).rounded(EDGE_RADIUS_M),
            "Upright equilateral triangular prism with a side face towards +y",
        ),
    )
    return {item.name: item for item in objects}


def make_standing_pose() -> npt.NDArray[np.float64]:
    """Make the nominal pose of an object, f64[4, 4], upright on the stand, relative to the base of the robot."""
    return make_pose([STAND_DISTANCE_M, 0.0, STAND_HEIGHT_M], [1.0, 0.0, 0.0, 0.0])
