"""Convex solids with exact rays and distances."""

from taxel.grasp.cylinder import Cylinder
from taxel.grasp.polytope import ConvexPolytope
from taxel.grasp.shape import Shape, ShapeError

__all__ = ["ConvexPolytope", "Cylinder", "Shape", "ShapeError"]
