"""The simulator's compiled library (`native/`), and arrays whose memory it uses."""

import ctypes
from functools import cache
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from taxel import native_library
from taxel.errors import TaxelError

LIBRARY: Final = "the simulator's compiled library"
"""The library in messages to users."""


class SimLibraryError(TaxelError):
    """The simulator's compiled library is missing or belongs to another version of the package."""


@cache
def load_sim_library() -> ctypes.CDLL:
    """Load the simulator's compiled library. Raises `SimLibraryError` if it is missing."""
    library = native_library.load_library("taxel_sim", LIBRARY, SimLibraryError)
    library.sim_layer_load.argtypes = [*[ctypes.c_void_p] * 6, ctypes.c_int]
    library.sim_layer_load.restype = None
    library.sim_push_step.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_double]
    library.sim_push_step.restype = ctypes.c_double
    return library


def check_structure(library: ctypes.CDLL, name: str, structure: type[ctypes.Structure]) -> None:
    """Raise `SimLibraryError` unless the structure `struct NAME` of the library has the size of `structure`."""
    native_library.check_structure(library, name, structure, LIBRARY, SimLibraryError)


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
