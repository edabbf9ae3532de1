"""The C codec library inside the installed package, called through ctypes."""

import ctypes
import importlib.resources
from functools import cache

from taxel.errors import TaxelError


class NativeLibraryError(TaxelError):
    """The compiled codec is missing or is not the one that this package was built with."""


ROW_SIZE = 32
"""Bytes of `struct taxel_batch_row`: checked when the library is loaded."""


@cache
def codec_library() -> ctypes.CDLL:
    """The loaded library. Raises `NativeLibraryError` if it was not built."""
    path = importlib.resources.files("taxel") / "native" / "libtaxel_codec.so"
    try:
        library = ctypes.CDLL(str(path))
    except OSError as error:
        raise NativeLibraryError("the compiled codec is missing from the package; install taxel again (pip install .)") from error
    size, pointer = ctypes.c_size_t, ctypes.c_void_p
    out = [pointer, size, pointer, size, pointer, size, pointer]
    library.taxel_batch_struct_size.restype = size
    library.taxel_batch_row_size.restype = size
    library.taxel_batch_init.argtypes = [pointer, ctypes.c_uint8]
    library.taxel_batch_init.restype = None
    library.taxel_batch_decode.argtypes = [pointer, ctypes.c_char_p, size, *out]
    library.taxel_batch_decode.restype = size
    library.taxel_batch_finish.argtypes = [pointer, *out]
    library.taxel_batch_finish.restype = None
    library.taxel_batch_discarded_bytes.argtypes = [pointer]
    library.taxel_batch_discarded_bytes.restype = ctypes.c_uint64
    if library.taxel_batch_row_size() != ROW_SIZE:
        raise NativeLibraryError("the compiled codec belongs to another version of the package; install taxel again (pip install .)")
    return library
