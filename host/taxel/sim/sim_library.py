"""The simulator's compiled library (`native/`), and arrays whose memory it uses."""

import ctypes
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from taxel.errors import TaxelError
from taxel.native_library import load_library


class SimLibraryError(TaxelError):
    """The simulator's compiled library is missing or belongs to another version of the package."""


@cache
def load_sim_library() -> ctypes.CDLL:
    """Load the simulator's compiled library. Raises `SimLibraryError` if it is missing."""
    library = load_library("taxel_sim", "the simulator's compiled library", SimLibraryError)
    for name in ("sim_layer", "sim_push"):
        getattr(library, f"{name}_struct_size").restype = ctypes.c_size_t
    library.sim_layer_load.argtypes = [*[ctypes.c_void_p] * 6, ctypes.c_int]
    library.sim_layer_load.restype = None
    library.sim_push_step.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_double]
    library.sim_push_step.restype = ctypes.c_double
    return library


def check_structure(library: ctypes.CDLL, name: str, structure: type[ctypes.Structure]) -> None:
    """Raise `SimLibraryError` unless the structure `struct NAME` of the library has the size of `structure`."""
    if getattr(library, f"{name}_struct_size")() != ctypes.sizeof(structure):
        raise SimLibraryError(
            "the simulator's compiled library belongs to another version of the package; install taxel again "
            "(pip install .)"
        )


class ReferencedArrays:
    """NumPy arrays to which a C structure points, kept alive as long as this object."""

    def __init__(self) -> None:
        """Create an empty collection of arrays."""
        self._arrays: list[npt.NDArray[Any]] = []

    def add(self, array: npt.ArrayLike, dtype: npt.DTypeLike | None = None) -> int:
        """Return the memory address of an array, and keep the array alive.

        An array with a dtype other than `dtype`, or with a memory layout other than C's, is copied first.
        """
        contiguous = np.require(array, dtype, "C")
        self._arrays.append(contiguous)
        return int(contiguous.ctypes.data)
