"""Storage of a grasp dataset on disk, such that a file stays readable if its writer is killed.

HDF5 changes a file by many small writes, and a file in which only some of them have happened may be unreadable.
Therefore:

1. The header of a new file is written under another name, and the file is then renamed.
2. A grasp is written as an anonymous group and flushed. These writes use only space that nothing refers to yet.
3. Then the group is linked under ``/grasps`` and flushed again. All links of ``/grasps`` are in its one object header,
   in space that is reserved when the file is created, so that this flush changes the file by one write. By default HDF5
   stores more than 8 links in a heap and a B-tree: several writes, with an unreadable file between them.
4. The object header is within the first page of the file, because a kill can split a longer write at a page boundary.
5. If the file already has its final name, it is flushed to the disk after steps 2 and 3, so that a power failure loses
   no complete grasp and no link refers to missing data.

The metadata cache may write entries at any time. This does no harm: during step 2 it contains nothing that the file
refers to, and step 3 is too small to evict an entry. One risk remains: from about `RESERVED_GRASPS` grasps on, the
header grows by further blocks, each linked by a separate write. A kill between these two writes, some microseconds of
each grasp, leaves a file that does not open.
"""

import ctypes
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_path, format_value
from taxel.optional import optional_import
from taxel.output import OutputError, PendingOutput
from taxel.recording.errors import DatasetError
from taxel.recording.grasp_checks import Location
from taxel.recording.hdf5_output import WritableFile, hold_signals

with optional_import("h5py", "a grasp dataset (.h5)"):
    import h5py  # type: ignore[import-untyped, unused-ignore]
    from h5py import h5g, h5p
    from h5py._objects import phil  # type: ignore[import-untyped, unused-ignore]

PAGE_BYTES = 4096
RESERVED_GRASPS = 200  # a link with an id of four digits needs 19 bytes, so 200 links fit into the first page
_GRASP_NAME_BYTES = 4
_MAX_COMPACT_LINKS = 65_535  # the largest value that HDF5 accepts

_CHUNK_BYTES = 2**20
_COMPRESS_FROM_BYTES = 2**14
_GZIP_LEVEL = 1


@contextmanager
def convert_writing_errors(location: Location) -> Iterator[None]:
    """Context manager that converts exceptions of the system and the HDF5 library during writing into a DatasetError.

    Ctrl-C and SIGTERM are delayed to the end of the block, so that a grasp is written completely or not at all.
    location: the place in the file that the error message names.
    """
    try:
        with hold_signals():
            yield
    except OutputError as error:
        location.fail(error.expected, error.found, error.remedy)
    except (OSError, RuntimeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or format_value(str(error).partition("\n")[0])
        location.fail("space and permission to write", reason, "correct that and write the grasp again")


def check_target(target: Path, overwrite: bool, location: Location) -> None:
    """Raise DatasetError for a path at which a new file must not be created: a folder, or a file not to overwrite."""
    if target.is_dir() or (target.exists() and not overwrite):
        location.fail("a new file", "an existing one", "choose another name, or request overwriting")


@contextmanager
def open_whole_dataset(path: str | os.PathLike[str], overwrite: bool) -> Iterator[Path]:
    """Context manager that yields an empty temporary file, which gets the name `path` at the end of the block.

    An exception leaves an existing dataset as it was. A DatasetError of the block that names the temporary file is
    replaced by one that names `path`. Raises DatasetError.
    """
    target, location = Path(path), Location(str(path))
    check_target(target, overwrite, location)
    with convert_writing_errors(location):
        pending = PendingOutput(target, overwrite=overwrite)
    try:
        yield pending.part
        with convert_writing_errors(location):
            pending.commit()
    except DatasetError as error:
        if error.file != format_path(pending.part):
            raise
        raise DatasetError(format_path(target), *error.args[1:]) from None
    finally:
        pending.discard()


def create_group(parent: Any, name: str | None) -> Any:
    """Create an HDF5 group without time stamps.

    name: None: a group without a name, which is lost unless it is linked later.
    """
    return h5py.Group(h5g.create(parent.id, _encode_name(name), None, _group_properties()))


def create_grasps_group(parent: Any) -> None:
    """Create the group ``/grasps`` with all links in its object header.

    A new link then changes the file by one write, and a program that is killed leaves a readable file. The group is the
    first one of the file, so that its header is within the first page.
    """
    properties = _group_properties()
    # h5py does not offer these two calls, but its HDF5 library has them. If they cannot be called, HDF5's default
    # layout is equally readable, and only the time in which a kill damages the file is longer. HDF5 is not thread-safe:
    # without h5py's lock `phil`, simultaneous calls of two threads fail or damage the data of both.
    try:
        library = ctypes.CDLL(h5py.defs.__file__)
        for function, a, b in (
            (library.H5Pset_link_phase_change, _MAX_COMPACT_LINKS, 0),
            (library.H5Pset_est_link_info, RESERVED_GRASPS, _GRASP_NAME_BYTES),
        ):
            function.argtypes = (ctypes.c_int64, ctypes.c_uint, ctypes.c_uint)
            with phil:
                function(properties.id, a, b)
    except (OSError, AttributeError):
        pass
    h5g.create(parent.id, b"grasps", None, properties)


def write_array(group: Any, name: str, array: NDArray[Any] | tuple[str, ...]) -> None:
    """Write an array, or strings, as an HDF5 dataset without time stamps.

    An array of `_COMPRESS_FROM_BYTES` or more is compressed in chunks of whole frames, about 1 MiB each.
    """
    arguments: dict[str, Any] = {"data": array}
    if isinstance(array, tuple):
        arguments = {"data": list(array), "dtype": h5py.string_dtype()}
    elif array.nbytes >= _COMPRESS_FROM_BYTES:
        frames = max(1, _CHUNK_BYTES // (prod(array.shape[1:]) * array.itemsize))
        chunks = (min(len(array), frames), *array.shape[1:])
        arguments |= {"chunks": chunks, "compression": "gzip", "compression_opts": _GZIP_LEVEL, "shuffle": True}
    dataset = group.create_dataset(name, track_times=False, **arguments)
    # HDF5 allocates the space of the content when the dataset is closed. Python would close it when the last stack
    # frame with a reference ends, which a profiler (as in a Dask worker) delays; the bytes of the file would then
    # differ.
    dataset.id.close()


def write_attributes(group: Any, values: Mapping[str, Any]) -> None:
    """Write attributes of an HDF5 group; integers are stored as int64."""
    for name, value in values.items():
        group.attrs.create(name, np.int64(value) if isinstance(value, int) else value)


def link_grasp(file: WritableFile, grasp: Any, grasp_id: str, is_durable: bool = False) -> None:
    """Link a complete grasp (an HDF5 group without a name) into the file under its id.

    A program that is killed at any time during this call leaves a readable file. is_durable: the grasp also survives a
    power failure after the call. Raises OSError.
    """
    _flush(file, is_durable)
    file["grasps"][grasp_id] = grasp
    _flush(file, is_durable)


def _flush(file: WritableFile, is_durable: bool) -> None:
    """Write all buffered data to the HDF5 file; a program that is killed during this call leaves a readable file.

    is_durable: also wait until the data are on the disk, and raise OSError for a failed write.
    """
    # HDF5 writes the end address before it extends the file; a kill between these writes would leave a truncated file.
    file.raw.extend_to(file.id.get_filesize())
    file.flush()
    if is_durable:
        file.raw.sync()
        file.check()


def _group_properties() -> Any:
    """Return HDF5 creation properties for a group without time stamps, so that equal content gives equal bytes."""
    properties = h5p.create(h5p.GROUP_CREATE)
    properties.set_obj_track_times(False)
    return properties


def _encode_name(name: str | None) -> bytes | None:
    """Return the bytes of an HDF5 name; None for an anonymous group."""
    return None if name is None else name.encode()
