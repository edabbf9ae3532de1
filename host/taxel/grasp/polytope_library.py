"""The compiled library for rays and polytopes (`native/`)."""

import ctypes
from functools import cache
from typing import Final

import numpy as np

from taxel.errors import TaxelError
from taxel.native_library import check_structure, load_library
from taxel.types import FloatArray

LIBRARY: Final = "the compiled library for polytopes"
"""The library in messages to users."""


class PolytopeLibraryError(TaxelError):
    """The compiled library for polytopes is missing or belongs to another version of the package."""


class _Polytope(ctypes.Structure):
    """`struct taxel_polytope` of native/polytope_rays.h."""

    _fields_ = [("faces", ctypes.c_size_t), ("normals", ctypes.c_void_p), ("offsets", ctypes.c_void_p)]


@cache
def load_polytope_library() -> ctypes.CDLL:
    """Load the library of `native/`. Raises PolytopeLibraryError if it is missing or does not fit."""
    library = load_library("taxel_polytope", LIBRARY, PolytopeLibraryError)
    check_structure(library, "taxel_polytope", _Polytope, LIBRARY, PolytopeLibraryError)
    pointer, size = ctypes.c_void_p, ctypes.c_size_t
    library.taxel_polytope_separation.argtypes = [ctypes.POINTER(_Polytope), pointer, pointer, size, size, pointer]
    library.taxel_polytope_separation.restype = None
    return library


def compute_separation(
    normals: FloatArray, offsets: FloatArray, points: FloatArray, directions: FloatArray
) -> FloatArray:
    """Compute the distance of points to a polytope along lines, f64[m, e], metres; inf for a miss.

    normals, offsets: f64[k, 3] and f64[k], half-spaces normal . p <= offset. points: f64[m, e, 3], metres, e points of
    each of m lines. directions: f64[m, 3], unit vectors. Raises PolytopeLibraryError if the library is missing.
    """
    arrays = [np.ascontiguousarray(values, np.float64) for values in (normals, offsets, points, directions)]
    result = np.empty(points.shape[:2])
    polytope = _Polytope(len(offsets), arrays[0].ctypes.data, arrays[1].ctypes.data)
    load_polytope_library().taxel_polytope_separation(
        ctypes.byref(polytope), arrays[2].ctypes.data, arrays[3].ctypes.data, *points.shape[:2], result.ctypes.data
    )
    return result
