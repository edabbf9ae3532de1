"""Grasped objects, their mass and their nominal pose."""

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.grasp.shapes import ConvexPolytope, Cylinder, Shape
from taxel.hand.transforms import make_pose
from taxel.types import FloatArray


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
"""Robot of the original workstation, whose objects and grasps are recorded."""

OBJECT_DENSITY_KG_PER_M3: Final = 224.0
"""Mean density of the printed objects, from the masses in the original simulation: the box weighs 101 g."""

GRAVITY_M_PER_S2: Final = 9.81

SKIN_FRICTION: Final = 1.0
"""Friction coefficient between the skin and an object (assumed: dry silicone on a print)."""

STAND_N_PER_M: Final = 1e5
"""Stiffness of stand, table and arm against a force of the hand from above (assumed: 50 N deflect them by 0.5 mm; the
thesis names the deformation of the table)."""

STAND_FRICTION: Final = 0.4
"""Friction coefficient between an object and its stand (assumed: dry plastic on metal)."""

# Assumed stiffness and damping of the experimenter's other hand, which steadies the object while the hand closes.
STEADYING_N_PER_M: Final = 8000.0
STEADYING_NM_PER_RAD: Final = 40.0
STEADYING_N_S_PER_M: Final = 60.0
STEADYING_NM_S_PER_RAD: Final = 0.1

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


@dataclass(frozen=True, eq=False)
class MassProperties:
    """Mass, kg, centre of mass f64[3], metres, and inertia about this centre f64[3, 3], kg m2; object frame."""

    mass_kg: float
    centre_m: FloatArray
    inertia_kg_m2: FloatArray


def compute_mass_properties(shape: Shape, density_kg_per_m3: float = OBJECT_DENSITY_KG_PER_M3) -> MassProperties:
    """Compute the mass properties of a homogeneous solid from its mesh, as a sum over tetrahedra with the origin.

    For a tetrahedron with the vertices 0, a, b, c and their sum s, the integral of x x^T is
    det(a, b, c) / 120 (a a^T + b b^T + c c^T + s s^T).
    """
    vertices, faces = shape.mesh()
    corners = vertices[faces]
    volumes = np.linalg.det(corners) / 6.0
    sums = corners.sum(axis=1)
    volume = volumes.sum()
    centre = (volumes @ sums) / (4.0 * volume)
    products = np.einsum("fki,fkj->fij", corners, corners) + np.einsum("fi,fj->fij", sums, sums)
    moments = np.einsum("f,fij->ij", volumes, products) / 20.0 - volume * np.outer(centre, centre)
    inertia = np.trace(moments) * np.eye(3) - moments
    return MassProperties(float(density_kg_per_m3 * volume), centre, density_kg_per_m3 * inertia)


def select_object_sizes(robot: str | None) -> ObjectSizes:
    """Select the sizes of the test objects for a hand on the robot with this name: assumed only for `ur5e_allegro`."""
    return ASSUMED_SIZES if robot == ASSUMED_ROBOT else ORIGINAL_SIZES


def make_thesis_objects(sizes: ObjectSizes = ORIGINAL_SIZES) -> dict[str, GraspObject]:
    """Make the three test objects of the thesis (section 5.2): a box, a cylinder and a triangular prism, by name."""
    return {item.name: item for item in _make_objects(sizes)}


@cache
def _make_objects(sizes: ObjectSizes) -> tuple[GraspObject, ...]:
    """Make the test objects of given sizes; cached, because a rounded solid takes several milliseconds."""
    box = ConvexPolytope.box(sizes.box_width_m, sizes.box_depth_m, sizes.height_m)
    prism = ConvexPolytope.prism(sizes.prism_side_m, sizes.height_m)
    return (
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


def make_standing_pose() -> npt.NDArray[np.float64]:
    """Make the nominal pose of an object, f64[4, 4], upright on the stand, relative to the base of the robot."""
    return make_pose([STAND_DISTANCE_M, 0.0, STAND_HEIGHT_M], [1.0, 0.0, 0.0, 0.0])
