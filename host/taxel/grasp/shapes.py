"""Convex solids as exact geometry: rays and distances from their formulas, never from a mesh."""

from taxel.grasp.cylinder import Cylinder
from taxel.grasp.polytope import ConvexPolytope
from taxel.grasp.shape import Shape, ShapeError

__all__ = ["ConvexPolytope", "Cylinder", "Shape", "ShapeError"]
