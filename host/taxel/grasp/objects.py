"""Grasped objects, their mount and their nominal pose."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.grasp.shapes import ConvexPolytope, Cylinder, Shape
from taxel.hand.transforms import make_pose


@dataclass(frozen=True)
class ObjectSizes:
    """Sizes of the three test objects, metres.

    box_width_m: of the wide side faces, along x. box_depth_m: of the narrow side faces, along y. prism_side_m: of the
    equilateral triangle. height_m: of all objects. box_edge_m, prism_edge_m: radius of the rounded edges, 0: sharp.
    """

    box_width_m: float
    box_depth_m: float
    cylinder_radius_m: float
    prism_side_m: float
    height_m: float
    box_edge_m: float
    prism_edge_m: float


ORIGINAL_SIZES: Final = ObjectSizes(0.060, 0.035, 0.020, 0.03464, 0.215, 0.0, 0.001)
"""Sizes of the meshes of the original simulation (final version), from which the objects were printed."""

ASSUMED_SIZES: Final = ObjectSizes(0.069, 0.035, 0.021, 0.036, 0.130, 0.0025, 0.0025)
"""Sizes that were found with tools/objects/search_sizes.py before the original meshes were known; used with the assumed
hand `allegro`.
"""

ASSUMED_ROBOT: Final = "ur5e_allegro"
"""Robot of the assumed hand."""

ORIGINAL_ROBOT: Final = "ur5e_original"
"""Robot of the original workstation, whose objects and grasps are recorded; other robots use the assumed ones."""

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


def select_object_sizes(robot: str | None) -> ObjectSizes:
    """Select the sizes of the test objects for a hand on the robot with this name: assumed only for `ur5e_allegro`."""
    return ASSUMED_SIZES if robot == ASSUMED_ROBOT else ORIGINAL_SIZES


def make_thesis_objects(sizes: ObjectSizes = ORIGINAL_SIZES) -> dict[str, GraspObject]:
    """Make the three test objects of the thesis (section 5.2): a box, a cylinder and a triangular prism, by name."""
    box = ConvexPolytope.box(sizes.box_width_m, sizes.box_depth_m, sizes.height_m)
    prism = ConvexPolytope.prism(sizes.prism_side_m, sizes.height_m)
    objects = (
        GraspObject(
            "rectangular_prism",
            box.rounded(sizes.box_edge_m) if sizes.box_edge_m else box,
            "Box with wide side faces towards +y and -y, narrow side faces towards +x and -x",
        ),
        GraspObject("cylinder", Cylinder(sizes.cylinder_radius_m, sizes.height_m), "Upright cylinder"),
        GraspObject(
            "triangular_prism",
            prism.rounded(sizes.prism_edge_m) if sizes.prism_edge_m else prism,
            "Upright equilateral triangular prism with a side face towards +y",
        ),
    )
    return {item.name: item for item in objects}


def make_standing_pose() -> npt.NDArray[np.float64]:
    """Make the nominal pose of an object, f64[4, 4], upright on the stand, relative to the base of the robot."""
    return make_pose([STAND_DISTANCE_M, 0.0, STAND_HEIGHT_M], [1.0, 0.0, 0.0, 0.0])
