"""ctypes binding of the C codec library inside the installed package."""

import ctypes
from functools import cache

from taxel.errors import TaxelError
from taxel.native_library import load_library


class NativeLibraryError(TaxelError):
    """The compiled codec is missing or belongs to another version of the package."""


ROW_SIZE = 40
"""Size of `struct taxel_batch_row`, bytes; checked when the library is loaded."""


class BatchOutput(ctypes.Structure):
    """`struct taxel_batch_output`: output buffers of a decoder call, their capacities and their filled sizes."""

    _fields_ = [
        ("taxel_rows", ctypes.c_void_p),
        ("message_rows", ctypes.c_void_p),
        ("counts", ctypes.c_void_p),
        ("payloads", ctypes.c_void_p),
        ("row_capacity", ctypes.c_size_t),
        ("count_capacity", ctypes.c_size_t),
        ("payload_capacity", ctypes.c_size_t),
        ("taxel_count", ctypes.c_size_t),
        ("other_count", ctypes.c_size_t),
        ("count_count", ctypes.c_size_t),
        ("payload_count", ctypes.c_size_t),
    ]


@cache
def load_codec_library() -> ctypes.CDLL:
    """Load and return the codec library. Raises `NativeLibraryError` if it is missing or does not match."""
    library = load_library("taxel_codec", "the compiled codec", NativeLibraryError)
    size, pointer = ctypes.c_size_t, ctypes.c_void_p
    library.taxel_batch_struct_size.restype = size
    library.taxel_batch_row_size.restype = size
    library.taxel_batch_init.argtypes = [pointer, ctypes.c_uint8]
    library.taxel_batch_init.restype = None
    library.taxel_batch_decode.argtypes = [pointer, pointer, size, pointer]
    library.taxel_batch_decode.restype = size
    library.taxel_batch_finish.argtypes = [pointer, pointer]
    library.taxel_batch_finish.restype = ctypes.c_bool
    library.taxel_batch_forget_cycles.argtypes = [pointer]
    library.taxel_batch_forget_cycles.restype = None
    library.taxel_batch_take_acknowledgements.argtypes = [pointer, pointer, size]
    library.taxel_batch_take_acknowledgements.restype = size
    library.taxel_batch_totals.argtypes = [pointer]
    library.taxel_batch_totals.restype = pointer
    library.taxel_batch_discarded_bytes.argtypes = [pointer]
    library.taxel_batch_discarded_bytes.restype = ctypes.c_uint64
    library.taxel_capture_gather.argtypes = [pointer, size, ctypes.c_uint64, pointer, pointer]
    library.taxel_capture_gather.restype = None
    if library.taxel_batch_row_size() != ROW_SIZE:
        raise NativeLibraryError(
            "the compiled codec belongs to another version of the package; install taxel again (pip install .)"
        )
    return library
