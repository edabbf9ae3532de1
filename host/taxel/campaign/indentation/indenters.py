"""Random indenters: boxes, triangular prisms, wedges and cylinders, with the features that can touch a skin."""

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.objects import GraspObject
from taxel.grasp.shapes import ConvexPolytope, Cylinder
from taxel.types import FloatArray

SIZE_M = (0.015, 0.060)
"""Range of the side lengths of an object."""

ROUNDING_M = (0.005, 0.010)
"""Range of the radius of the edges. A sharp edge would damage a silicone skin, and a contact model with a grid of one
millimetre does not resolve it."""

ROUNDING_STEP_RAD = np.radians(15.0)

MAX_ROUNDING_SHARE = 0.3
"""Largest radius of the edges as a share of the smallest side, so that a flat part of every face remains."""

FeatureKind = Literal["face", "edge", "round"]


class Feature(NamedTuple):
    """A part of an object's surface that can be pressed into a skin: a face, an edge or a line on a cylinder's side.

    All vectors are in the object frame. kind: "round" is a line on a cylinder's side. outward: unit normal f64[3].
    along: unit vector f64[3] of the longest line within the feature, such as an edge or the direction of an axis.
    middle: centre f64[3], metres. half_length_m: extent along that line on either side of the centre.
    """

    kind: FeatureKind
    outward: FloatArray
    along: FloatArray
    middle: FloatArray
    half_length_m: float


class Indenter(NamedTuple):
    """An object to press into a skin, and the features of its surface that can touch the skin."""

    item: GraspObject
    features: tuple[Feature, ...]


def sample_indenters(rng: np.random.Generator, count: int) -> list[Indenter]:
    """Sample `count` random objects to press into the skin.

    The families of shapes (box, prism, wedge, cylinder) are in random order, and none is repeated before all have been
    used.
    """
    families = list(FAMILIES.items())
    indenters = []
    for number in range(count):
        if number % len(families) == 0:
            order = rng.permutation(len(families))
        family, sample = families[order[number % len(families)]]
        indenters.append(sample(rng, f"{family}_{number + 1}"))
    return indenters


def _sample_box(rng: np.random.Generator, name: str) -> Indenter:
    """Sample a box of random size as an indenter."""
    sides = _sample_sizes(rng, 3)
    return _make_polytope(rng, name, ConvexPolytope.box(*sides), f"Box, {_format_millimetres(*sides)}")


def _sample_prism(rng: np.random.Generator, name: str) -> Indenter:
    """Sample a triangular prism of random size as an indenter."""
    side, height = float(rng.uniform(0.030, SIZE_M[1])), _sample_sizes(rng, 1)[0]
    return _make_polytope(
        rng, name, ConvexPolytope.prism(side, height), f"Triangular prism, {_format_millimetres(side, height)}"
    )


def _sample_wedge(rng: np.random.Generator, name: str) -> Indenter:
    """Sample a wedge as an indenter: a box of random size whose top slopes downwards along x."""
    width, depth, height = _sample_sizes(rng, 3)
    low_height = height * float(rng.uniform(0.45, 0.8))
    box = ConvexPolytope.box(width, depth, height)
    slope_normal = np.array([height - low_height, 0.0, width])
    offset = slope_normal @ [0.5 * width, 0.0, low_height]
    # The flat top (face 2) is removed: only one of its edges would remain, at the high end of the slope.
    normals, offsets = np.delete(box.normals, 2, axis=0), np.delete(box.offsets, 2)
    sharp = ConvexPolytope(np.vstack([normals, slope_normal]), np.append(offsets, offset))
    return _make_polytope(rng, name, sharp, f"Wedge, {_format_millimetres(width, depth, height, low_height)}")


def _sample_cylinder(rng: np.random.Generator, name: str) -> Indenter:
    """Sample a cylinder of random size as an indenter, with eight features evenly spaced around its side.

    Each feature is a line on the side, parallel to the axis, with its outward direction.
    """
    radius, height = float(rng.uniform(0.5 * SIZE_M[0], 0.5 * SIZE_M[1])), float(rng.uniform(0.030, SIZE_M[1]))
    up = np.array([0.0, 0.0, 1.0])
    around = [
        np.array([np.cos(angle), np.sin(angle), 0.0]) for angle in np.arange(8) * np.pi / 4 + rng.uniform(0, np.pi)
    ]
    middle = 0.5 * height * up
    features = [Feature("round", out, up, middle + radius * out, 0.5 * height) for out in around]
    text = f"Cylinder, {_format_millimetres(2.0 * radius, height)}"
    return Indenter(GraspObject(name, Cylinder(radius, height), text), tuple(features))


FAMILIES: dict[str, Callable[[np.random.Generator, str], Indenter]] = {
    "box": _sample_box,
    "prism": _sample_prism,
    "wedge": _sample_wedge,
    "cylinder": _sample_cylinder,
}


def _sample_sizes(rng: np.random.Generator, count: int) -> list[float]:
    """Sample `count` random side lengths, metres."""
    return [float(size) for size in rng.uniform(*SIZE_M, count)]


def _format_millimetres(*sizes: float) -> str:
    """Format lengths in metres as a string such as "40.0 x 25.0 mm"."""
    return " x ".join(f"{1e3 * size:.1f}" for size in sizes) + " mm"


def _make_polytope(rng: np.random.Generator, name: str, sharp: ConvexPolytope, text: str) -> Indenter:
    """Make an indenter with rounded edges of random radius and with a feature for each face and each edge.

    sharp: the solid without rounding. text: description of the object.
    """
    side = float(np.ptp(sharp.bounds, axis=0).min())
    shape = sharp.rounded(min(float(rng.uniform(*ROUNDING_M)), MAX_ROUNDING_SHARE * side), ROUNDING_STEP_RAD)
    return Indenter(GraspObject(name, shape, text), (*_make_face_features(sharp), *_make_edge_features(sharp)))


def _find_corners_on_faces(sharp: ConvexPolytope) -> NDArray[np.bool_]:
    """Return which corners belong to which face of a polytope, bool[F, C] for F faces and C corners."""
    above = sharp.normals @ sharp.vertices.T - sharp.offsets[:, None]
    return np.asarray(np.abs(above) < 1e-9)


def _make_face_features(sharp: ConvexPolytope) -> list[Feature]:
    """Make a feature for each face of a polytope; the line of the feature lies along the longest extent of the face."""
    features = []
    for normal, is_corner in zip(sharp.normals, _find_corners_on_faces(sharp), strict=True):
        corners = sharp.vertices[is_corner]
        middle = corners.mean(axis=0)
        _, _, axes = np.linalg.svd(corners - middle)  # axes[0]: direction of the largest extent
        along = axes[0] - (axes[0] @ normal) * normal
        along /= np.linalg.norm(along)
        features.append(Feature("face", normal, along, middle, float(np.abs((corners - middle) @ along).max())))
    return features


def _make_edge_features(sharp: ConvexPolytope) -> list[Feature]:
    """Make a feature for each edge of a polytope.

    The outward direction of the feature is midway between the normals of the two faces that meet at the edge.
    """
    incidence, features = _find_corners_on_faces(sharp), []
    for first in range(len(incidence)):
        for second in range(first + 1, len(incidence)):
            ends = sharp.vertices[incidence[first] & incidence[second]]
            if len(ends) == 2:  # two faces with an edge in common share exactly its two ends
                outward = sharp.normals[first] + sharp.normals[second]
                line = ends[1] - ends[0]
                length = float(np.linalg.norm(line))
                unit = outward / np.linalg.norm(outward)
                features.append(Feature("edge", unit, line / length, ends.mean(axis=0), 0.5 * length))
    return features
