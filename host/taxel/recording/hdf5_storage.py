"""Storage of HDF5 files of unknown origin: heaps and chunks are checked before the HDF5 library reads them.

The library reads outside its memory if a chunk is shorter than its header states, and it loops without end over a
damaged heap.
"""

from __future__ import annotations

import mmap
import os
import struct
import zlib
from collections.abc import Iterable
from math import prod
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.input_files import open_regular_file
from taxel.input_files.numpy_archive import ArchiveError, check_expansion
from taxel.optional import optional_import
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_format import LARGEST_ARRAY_BYTES

with optional_import("h5py", "a grasp dataset (.h5)"):
    import h5py  # type: ignore[import-untyped, unused-ignore]

DAMAGED: Final = "the file is damaged or truncated; copy it again or record it again"

_HEAP_SIGNATURE: Final = b"GCOL\x01\0\0\0"
_HEAP_HEADER: Final = struct.Struct("<8xQ")
"""Header of a global heap: signature, version, and size of the heap with its header, bytes."""
_HEAP_OBJECT: Final = struct.Struct("<H6xQ")
"""Header of an object in a heap: number of the object, and size of its data, bytes. The size of object 0 (the free
space) includes its header.
"""

_DEFLATE: Final = 1
_SHUFFLE: Final = 2
_FLETCHER32: Final = 3
"""Numbers of the filters that h5py writes for gzip, shuffle and fletcher32 (HDF5 File Format Specification 3.0, section
IV.A.2.l, Filter Pipeline Message). Each of them occurs at most once.
"""
_LZF: Final = 32000
"""Number of h5py's filter lzf."""
_CHECKSUM_BYTES: Final = 4


def check_heaps(path: Path, location: Location) -> None:
    """Raise DatasetError for a damaged global heap (storage of strings), over which HDF5 would loop without end.

    A heap consists of objects, each with its size; the object 0 is the free space at the end. The library advances by
    the size without checking that it is not 0 (HDF5 File Format Specification 3.0, section III.E, Global Heap).
    """
    with open_regular_file(path) as file:
        if not os.fstat(file.fileno()).st_size:
            return
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            start = data.find(_HEAP_SIGNATURE)
            while start >= 0:
                if not _is_complete_heap(data, start):
                    location.fail("undamaged heaps of texts", f"a damaged one at byte {start}", DAMAGED)
                start = data.find(_HEAP_SIGNATURE, start + 1)


def _is_complete_heap(data: mmap.mmap, start: int) -> bool:
    """Whether the objects of the heap at byte `start` end exactly at the end of the heap.

    False also for a heap that extends beyond the data, and for free space with a size below that of its header.
    """
    if start + _HEAP_HEADER.size > len(data):
        return False
    (size,) = _HEAP_HEADER.unpack_from(data, start)
    place, end = start + _HEAP_HEADER.size, start + size
    if end > len(data):
        return False
    while place + _HEAP_OBJECT.size <= end:
        index, length = _HEAP_OBJECT.unpack_from(data, place)
        if index == 0 and length < _HEAP_OBJECT.size:
            return False
        # The length of object 0 includes its header; the data of other objects are padded to a multiple of 8 bytes.
        place += length if index == 0 else _HEAP_OBJECT.size + (length + 7) // 8 * 8
    return bool(place <= end)


def check_names(names: Iterable[Any], location: Location) -> None:
    """Raise DatasetError for a name of a group or array that is not UTF-8; h5py returns such a name as bytes."""
    other = next((name for name in names if not isinstance(name, str)), None)
    if other is not None:
        location.fail("names in UTF-8", format_value(other), "rename it")


def check_layout(dataset: Any, location: Location) -> None:
    """Check where and how an array is stored, without reading its values. dataset: `h5py.Dataset`, not empty.

    Raises DatasetError for data in another file, for an array whose stored bytes are far fewer than its bytes in
    memory, for chunks above `LARGEST_ARRAY_BYTES`, for a filter that is applied twice, and for filters other than gzip,
    lzf, shuffle and fletcher32. Other filters are refused, because this module cannot check the size of their output.
    """
    if dataset.is_virtual or dataset.external is not None:
        location.fail("data in this file", "data in another file", "store the data itself; links are not followed")
    try:
        check_expansion(dataset.nbytes, dataset.id.get_storage_size())
    except ArchiveError as error:
        location.fail("an array of bounded size", str(error), "store the array without compression")
    if dataset.chunks is None:
        return
    if _chunk_bytes(dataset) > LARGEST_ARRAY_BYTES:
        location.fail(f"chunks of at most {LARGEST_ARRAY_BYTES} bytes", f"{list(dataset.chunks)}", "use smaller chunks")
    filters = _list_filters(dataset)
    if len(set(filters)) < len(filters) or not set(filters) <= {_DEFLATE, _LZF, _SHUFFLE, _FLETCHER32}:
        location.fail("no compression, or gzip or lzf", f"filters {filters}", "write it again with gzip of h5py")


def read_values(dataset: Any, location: Location) -> Any:
    """Read an array, shape and type as in the file; strings as h5py returns them.

    dataset: `h5py.Dataset` that passed `check_layout`. Raises DatasetError unless each stored chunk expands to exactly
    the bytes of a chunk.
    """
    if dataset.chunks is None:
        return dataset[()]
    size, filters = _chunk_bytes(dataset), _list_filters(dataset)
    values = np.full(dataset.shape, dataset.fillvalue, dataset.dtype) if _is_plain(dataset, filters) else None
    stored: list[Any] = []
    dataset.id.chunk_iter(stored.append)
    for chunk in stored:
        # The stored bytes may exceed `size` by the checksum, and data that cannot be compressed grow by 1/1000 at most.
        if not 0 < chunk.size <= size + size // 100 + 1024:
            location.fail(f"complete chunks of {size} bytes", f"one of {chunk.size} stored bytes", DAMAGED)
        # HDF5 2.0 does not return the filter mask here, and returns more than the stored bytes if there is no filter.
        _, data = dataset.id.read_direct_chunk(chunk.chunk_offset)
        applied = [code for index, code in enumerate(filters) if not chunk.filter_mask >> index & 1]
        expanded = _expand(data, applied, size, dataset.dtype.itemsize) if len(data) == chunk.size else b""
        if len(expanded) != size:
            location.fail(f"complete chunks of {size} bytes", "one that is damaged or has another size", DAMAGED)
        if values is not None:
            _insert(values, chunk.chunk_offset, expanded, dataset.chunks)
    # `values` is None for arrays that the library must read: it verifies checksums, expands lzf, and converts strings,
    # booleans and other types. For all other arrays the library would only expand the chunks a second time.
    return dataset[()] if values is None else values


def _chunk_bytes(dataset: Any) -> int:
    """Return the bytes of a chunk before its filters are applied.

    A string of variable length is stored as three numbers: its length (4 bytes), the address of a heap, and the index
    of the string in this heap (4 bytes).
    """
    item_bytes = int(dataset.dtype.itemsize)
    text = h5py.check_string_dtype(dataset.dtype)
    if text is not None and text.length is None:
        item_bytes = 4 + int(dataset.file.id.get_create_plist().get_sizes()[0]) + 4
    return int(prod(dataset.chunks)) * item_bytes


def _list_filters(dataset: Any) -> list[int]:
    """Return the numbers of the filters of an array, in the order of their application when the array is written."""
    properties = dataset.id.get_create_plist()
    return [properties.get_filter(index)[0] for index in range(properties.get_nfilters())]


def _is_plain(dataset: Any, filters: list[int]) -> bool:
    """Whether the expanded chunks of an array can be copied into a NumPy array without the HDF5 library.

    True for integers and floating-point numbers that are stored in NumPy's layout. False for an array with a checksum,
    which the library verifies, and for an array with lzf, whose content `_expand` does not restore. filters: numbers of
    the array's filters.
    """
    properties, dtype = dataset.id.get_create_plist(), dataset.dtype
    return (
        dtype.kind in "iuf"
        and not {_FLETCHER32, _LZF} & set(filters)
        and all(
            properties.get_filter_by_id(_SHUFFLE)[1][:1] == (dtype.itemsize,) for code in filters if code == _SHUFFLE
        )
        and bool(dataset.id.get_type().equal(h5py.h5t.py_create(dtype)))
    )


def _expand(data: bytes | memoryview, filters: list[int], size: int, item_bytes: int) -> bytes | memoryview:
    """Reverse the filters of a chunk; the result has another length than `size` if the chunk is damaged.

    filters: applied filters, in the order of their application. size: bytes of a complete chunk. At most a few bytes
    more than `size` are returned. item_bytes: bytes of an element. Instead of data that lzf compressed, zeros of the
    expanded length are returned, because only this length is checked.
    """
    for code in reversed(filters):
        if code == _FLETCHER32:
            data = data[: max(len(data) - _CHECKSUM_BYTES, 0)]
        elif code == _DEFLATE:
            stream = zlib.decompressobj()
            try:
                data = stream.decompress(data, size + _CHECKSUM_BYTES + 1)
            except zlib.error:
                return b""
            if not stream.eof:
                return b""
        elif code == _LZF:
            data = bytes(min(_find_lzf_size(data), size + _CHECKSUM_BYTES + 1))
        elif len(data) % item_bytes == 0:
            data = _restore_order(data, item_bytes)
    return data


def _find_lzf_size(data: bytes | memoryview) -> int:
    """Return the number of bytes into which lzf data expand, or 0 for incomplete data (LibLZF 3.6, lzf_d.c).

    The data consist of literal runs and references to earlier bytes; each begins with a control byte c. If c is below
    32, a run of c + 1 bytes follows. Otherwise the length of the reference is 2 plus the upper three bits of c, plus
    the next byte if all three bits are 1; one further byte belongs to the position of the earlier bytes.
    """
    size = place = 0
    while place < len(data):
        control, place = data[place], place + 1
        if control < 32:
            size, place = size + control + 1, place + control + 1
            continue
        if control >> 5 == 7:
            size += data[place] if place < len(data) else 0
            place += 1
        size, place = size + (control >> 5) + 2, place + 1
    return size if place == len(data) else 0


def _restore_order(shuffled: bytes | memoryview, item_bytes: int) -> memoryview:
    """Reverse the filter shuffle, which stores the first bytes of all elements, then the second bytes, and so on."""
    elements = np.empty((len(shuffled) // item_bytes, item_bytes), np.uint8)
    for place, values in enumerate(np.frombuffer(shuffled, np.uint8).reshape(item_bytes, -1)):
        elements[:, place] = values  # faster than a transposed copy
    return elements.reshape(-1).data


def _insert(
    values: NDArray[Any], offset: tuple[int, ...], expanded: bytes | memoryview, chunks: tuple[int, ...]
) -> None:
    """Insert a chunk into the array at `offset`; its elements beyond the array's end are omitted."""
    region = tuple(slice(start, start + length) for start, length in zip(offset, chunks, strict=True))
    part = values[region]
    block = np.frombuffer(expanded, values.dtype).reshape(chunks)
    part[...] = block[tuple(slice(length) for length in part.shape)]
