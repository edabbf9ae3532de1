"""Load a compiled library of the package."""

import ctypes
import importlib.resources

from taxel.errors import TaxelError


def load_library(name: str, purpose: str, error: type[TaxelError], use_errno: bool = False) -> ctypes.CDLL:
    """Load the shared library `libNAME.so` of the package.

    purpose: the library's name in messages to users, such as "the decoder". use_errno: `ctypes.get_errno` returns the
    error number of the latest call. Raises `error` with one line if the library is missing.
    """
    path = importlib.resources.files("taxel") / "native" / f"lib{name}.so"
    try:
        return ctypes.CDLL(str(path), use_errno=use_errno)
    except OSError as reason:
        raise error(f"{purpose} is missing from the package; install taxel again (pip install .)") from reason


def check_structure(
    library: ctypes.CDLL, name: str, structure: type[ctypes.Structure], purpose: str, error: type[TaxelError]
) -> None:
    """Raise `error` with one line unless `struct NAME` of a library has the size of `structure`.

    The library states the size in its function `NAME_struct_size`. purpose: the library's name in the message.
    """
    compute_size = getattr(library, f"{name}_struct_size")
    compute_size.restype = ctypes.c_size_t
    if compute_size() != ctypes.sizeof(structure):
        raise error(f"{purpose} belongs to another version of the package; install taxel again (pip install .)")
