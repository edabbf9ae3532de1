"""NumPy archives (.npz) of unknown origin: plain arrays of bounded size, read one at a time."""

import io
import math
import os
import zipfile
from types import TracebackType
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.input_files.regular_file import open_regular_file
from taxel.input_files.text_error import format_reason

MEMBERS_MAX: Final = 100_000
"""Largest number of arrays. An archive of a dataset has about fifteen for each grasp."""

EXPANDED_BYTES_MAX: Final = 1 << 28
EXPANSION_MAX: Final = 200
"""An array above `EXPANDED_BYTES_MAX` bytes is read only if it has at most `EXPANSION_MAX` times the size of its
compressed data. Otherwise a one-megabyte file that expands to a gigabyte of zeros would exhaust the memory.
"""

_SUFFIX: Final = ".npy"
HEADER_BYTES: Final = 1 << 16
"""Number of bytes that are read to parse the header of an array; for plain numbers NumPy writes a 128-byte header."""


class ArchiveError(ValueError):
    """An archive or one of its arrays cannot be read. The message is the reason, without names of file and array."""


class ArrayHeader(NamedTuple):
    """Header of an array. offset: bytes before the elements. is_column_major: elements are in Fortran order."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    is_column_major: bool
    offset: int


class NumpyArchive:
    """An open archive. names: names of its arrays, without the suffix .npy.

    No array is unpickled, and no memory is allocated before the size in the header agrees with the stored bytes. Raises
    ArchiveError for a file that is no archive, and OSError for a file that cannot be opened.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Open an archive and read its directory."""
        self._file = open_regular_file(path)
        try:
            self._zip = zipfile.ZipFile(self._file)
            self._members = {name.removesuffix(_SUFFIX): name for name in self._zip.namelist()}
            if len(self._members) != len(self._zip.namelist()):
                raise ArchiveError("two arrays have the same name")
            if len(self._members) > MEMBERS_MAX:
                raise ArchiveError(f"there are more than {MEMBERS_MAX} arrays")
        except ArchiveError:
            self._file.close()
            raise
        except Exception as error:  # zipfile raises several types for a damaged directory
            self._file.close()
            raise ArchiveError(format_reason(error)) from None
        self.names = tuple(self._members)

    def __enter__(self) -> "NumpyArchive":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the archive at the end of the `with` block."""
        self.close()

    def close(self) -> None:
        """Close the archive."""
        self._zip.close()
        self._file.close()

    def read_header(self, name: str) -> ArrayHeader:
        """Return the header of an array.

        Raises ArchiveError for a damaged array, an unknown name, and an array of Python objects.
        """
        try:
            with self._zip.open(self._members[name]) as file:
                return parse_array_header(file.read(HEADER_BYTES), self._zip.getinfo(self._members[name]).file_size)
        except ArchiveError:
            raise
        except Exception as error:  # of zipfile and of the decompressors
            raise ArchiveError(format_reason(error)) from None

    def read(self, name: str, size_max: int) -> NDArray[Any]:
        """Return an array of at most `size_max` bytes. Raises ArchiveError, also for an unknown name."""
        header = self.read_header(name)
        try:
            member = self._zip.getinfo(self._members[name])
            if member.file_size > size_max + header.offset:
                raise ArchiveError(f"it has more than {size_max} bytes")
            check_expansion(member.file_size, member.compress_size)
            data = self._zip.read(self._members[name])
        except ArchiveError:
            raise
        except Exception as error:  # as in `read_header`
            raise ArchiveError(format_reason(error)) from None
        return parse_array(data, header)


def check_expansion(size: int, stored_size: int) -> None:
    """Raise ArchiveError for a large array that expands by more than a factor of `EXPANSION_MAX`.

    size: bytes in memory. stored_size: bytes in the file.
    """
    if size > EXPANDED_BYTES_MAX and size > EXPANSION_MAX * stored_size:
        raise ArchiveError(f"{stored_size} stored bytes expand to {size}")


def parse_array_header(data: bytes, size: int) -> ArrayHeader:
    """Parse the header of a .npy file. data: first bytes of the file. size: number of bytes of the whole file.

    Raises ArchiveError for a damaged header, Python objects, records, and a size that differs from that in the header.
    """
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, is_column_major, dtype = read(stream)
    except Exception as error:  # numpy evaluates the header as a literal, which raises several types
        raise ArchiveError(format_reason(error)) from None
    if dtype.hasobject or dtype.names or dtype.subdtype:
        raise ArchiveError("it contains Python objects or records")
    if not all(type(length) is int and length >= 0 for length in shape):
        raise ArchiveError("its shape is not valid")
    offset = stream.tell()
    expected = math.prod(shape) * dtype.itemsize
    if expected != size - offset:
        raise ArchiveError(f"it has {size - offset} bytes, not {expected} as its header states")
    return ArrayHeader(shape, dtype, is_column_major, offset)


def parse_array(data: bytes, header: ArrayHeader) -> NDArray[Any]:
    """Convert the bytes of a .npy file to an array, which is a writeable copy. Raises ArchiveError."""
    try:
        flat = np.frombuffer(data, header.dtype, offset=header.offset) if header.dtype.itemsize else np.zeros(0)
        array = flat.reshape(header.shape, order="F" if header.is_column_major else "C").copy()
        if array.dtype.kind == "U":
            _check_characters(flat)
        return array
    except ValueError as error:
        raise ArchiveError(format_reason(error)) from None


def _check_characters(texts: NDArray[Any]) -> None:
    """Raise ArchiveError for strings with a code above U+10FFFF, which Python cannot convert to a character."""
    codes = np.frombuffer(texts.tobytes(), np.dtype(np.uint32).newbyteorder(texts.dtype.byteorder))
    if len(codes) and codes.max() > 0x10FFFF:
        raise ArchiveError("a text contains a code that is no character")
