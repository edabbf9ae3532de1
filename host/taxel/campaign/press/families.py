"""Objects that are pressed: drawn boxes, triangular prisms, wedges and cylinders, and what of them can touch a skin."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.objects import GraspObject
from taxel.grasp.shapes import ConvexPolytope, Cylinder
from taxel.types import FloatArray

SIZE_M = (0.015, 0.060)
"""Of every side of an object."""

ROUNDING_M = (0.005, 0.010)
"""Radius of the edges: no skin of silicone survives a sharp one, no model of cells a millimetre wide resolves it."""

ROUNDING_STEP_RAD = np.radians(15.0)

THICKEST = 0.3
"""Rounding, as a share of the smallest side: something of every face is left."""

FeatureKind = Literal["face", "edge", "round"]


class Feature(NamedTuple):
    """A part of an object's surface that can be pressed, object frame.

    outward: unit vector f64[3]. along: unit vector across it: an edge's line, an axis. middle: f64[3], metres.
    reach_m: how far it goes along that line on either side.
    """

    kind: FeatureKind
    outward: FloatArray
    along: FloatArray
    middle: FloatArray
    reach_m: float


class PressObject(NamedTuple):
    """An object and what of it can be pressed."""

    item: GraspObject
    features: tuple[Feature, ...]


def drawn_objects(rng: np.random.Generator, count: int) -> list[PressObject]:
    """`count` objects of families in a drawn order, each family once before any comes again."""
    makers = list(FAMILIES.items())
    made = []
    for number in range(count):
        if number % len(makers) == 0:
            order = rng.permutation(len(makers))
        family, make = makers[order[number % len(makers)]]
        made.append(make(rng, f"{family}_{number + 1}"))
    return made


def _box(rng: np.random.Generator, name: str) -> PressObject:
    sides = _sizes(rng, 3)
    return _polytope(rng, name, ConvexPolytope.box(*sides), f"Box, {_millimetres(*sides)}")


def _prism(rng: np.random.Generator, name: str) -> PressObject:
    side, height = float(rng.uniform(0.030, SIZE_M[1])), _sizes(rng, 1)[0]
    return _polytope(rng, name, ConvexPolytope.prism(side, height), f"Triangular prism, {_millimetres(side, height)}")


def _wedge(rng: np.random.Generator, name: str) -> PressObject:
    """A box whose top slopes down along x."""
    width, depth, height = _sizes(rng, 3)
    toe = height * float(rng.uniform(0.45, 0.8))
    box = ConvexPolytope.box(width, depth, height)
    slope = np.array([height - toe, 0.0, width])
    offset = slope @ [0.5 * width, 0.0, toe]
    # The box's own top would touch the slope in an edge only.
    normals, offsets = np.delete(box.normals, 2, axis=0), np.delete(box.offsets, 2)
    sharp = ConvexPolytope(np.vstack([normals, slope]), np.append(offsets, offset))
    return _polytope(rng, name, sharp, f"Wedge, {_millimetres(width, depth, height, toe)}")


def _cylinder(rng: np.random.Generator, name: str) -> PressObject:
    radius, height = float(rng.uniform(0.5 * SIZE_M[0], 0.5 * SIZE_M[1])), float(rng.uniform(0.030, SIZE_M[1]))
    up = np.array([0.0, 0.0, 1.0])
    around = [
        np.array([np.cos(angle), np.sin(angle), 0.0]) for angle in np.arange(8) * np.pi / 4 + rng.uniform(0, np.pi)
    ]
    middle = 0.5 * height * up
    features = [Feature("round", out, up, middle + radius * out, 0.5 * height) for out in around]
    text = f"Cylinder, {_millimetres(2.0 * radius, height)}"
    return PressObject(GraspObject(name, Cylinder(radius, height), text), tuple(features))


FAMILIES: dict[str, Callable[[np.random.Generator, str], PressObject]] = {
    "box": _box,
    "prism": _prism,
    "wedge": _wedge,
    "cylinder": _cylinder,
}


def _sizes(rng: np.random.Generator, count: int) -> list[float]:
    return [float(size) for size in rng.uniform(*SIZE_M, count)]


def _millimetres(*sizes: float) -> str:
    return " x ".join(f"{1e3 * size:.1f}" for size in sizes) + " mm"


def _polytope(rng: np.random.Generator, name: str, sharp: ConvexPolytope, text: str) -> PressObject:
    side = float(np.ptp(sharp.bounds, axis=0).min())
    shape = sharp.rounded(min(float(rng.uniform(*ROUNDING_M)), THICKEST * side), ROUNDING_STEP_RAD)
    return PressObject(GraspObject(name, shape, text), (*_faces(sharp), *_edges(sharp)))


def _corners(sharp: ConvexPolytope) -> NDArray[np.bool_]:
    """Which corners lie in which face, bool[faces, corners]."""
    above = sharp.normals @ sharp.vertices.T - sharp.offsets[:, None]
    return np.asarray(np.abs(above) < 1e-9)


def _faces(sharp: ConvexPolytope) -> list[Feature]:
    """Each face, along the longest way across it."""
    features = []
    for normal, own in zip(sharp.normals, _corners(sharp), strict=True):
        corners = sharp.vertices[own]
        middle = corners.mean(axis=0)
        _, _, axes = np.linalg.svd(corners - middle)
        along = axes[0] - (axes[0] @ normal) * normal
        along /= np.linalg.norm(along)
        features.append(Feature("face", normal, along, middle, float(np.abs((corners - middle) @ along).max())))
    return features


def _edges(sharp: ConvexPolytope) -> list[Feature]:
    on, features = _corners(sharp), []
    for first in range(len(on)):
        for second in range(first + 1, len(on)):
            ends = sharp.vertices[on[first] & on[second]]
            if len(ends) == 2:
                outward = sharp.normals[first] + sharp.normals[second]
                line = ends[1] - ends[0]
                length = float(np.linalg.norm(line))
                unit = outward / np.linalg.norm(outward)
                features.append(Feature("edge", unit, line / length, ends.mean(axis=0), 0.5 * length))
    return features
