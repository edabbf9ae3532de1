"""How a grasp dataset lies on the disk, so that a program killed while it writes leaves a readable file.

HDF5 changes a file in many small writes, and a file that is cut between them may be unreadable. So:

1. A file is made whole under another name, then renamed.
2. A grasp is built as an anonymous group and flushed: everything lands in space that nothing refers to yet.
3. Only then is it linked under ``/grasps`` and flushed again. The links of ``/grasps`` stand in its one object header,
   for which room is kept when the file is made, so this flush changes the file in one write. HDF5 would else keep more
   than 8 links in a heap and a B-tree: several writes, with an unreadable file between them.
4. That header lies within the first page of the file: a kill may cut a longer write between two pages, and does.

The metadata cache may evict at any moment, which is harmless: in step 2 there is nothing in it that the file refers to,
and step 3 is too small to evict. What remains: from about `ROOM_FOR_GRASPS` grasps on, the header gains further blocks,
each linked by a write of its own; a kill that lands just between the two, microseconds in a grasp, leaves a file that
does not open. A power cut is another matter: nothing here waits for the disk.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import prod
from pathlib import Path
from typing import Any, NoReturn

import h5py  # type: ignore[import-untyped, unused-ignore]
import numpy as np
from h5py import h5f, h5g, h5p
from h5py._objects import phil  # type: ignore[import-untyped, unused-ignore]
from numpy.typing import NDArray

from taxel.hand.errors import shown
from taxel.recording.grasp_checks import Place

# Files of HDF5 1.8 carry no "open for writing" mark; with later ones a killed writer's file needs h5clear to open.
LIBVER = ("v108", "v108")

PAGE_BYTES = 4096
ROOM_FOR_GRASPS = 200  # with ids of four digits: 19 bytes each, so that all fit in the first page
_GRASP_NAME_BYTES = 4
_MAX_COMPACT_LINKS = 65_535  # the largest that HDF5 takes

_CHUNK_BYTES = 2**20
_COMPRESS_FROM_BYTES = 2**14
_GZIP_LEVEL = 1


@contextmanager
def writing_errors(place: Place) -> Iterator[None]:
    """Turn what the system or the HDF5 library raises while writing into a DatasetError for this place."""
    try:
        yield
    except (OSError, RuntimeError, ValueError) as error:
        reason = shown(str(error).partition("\n")[0])
        place.fail("room and permission to write", reason, "correct that and write the grasp again")


def check_target(target: Path, overwrite: bool, place: Place) -> None:
    """Refuse a path where a new file must not or cannot be made."""
    if target.is_dir() or (target.exists() and not overwrite):
        _taken(place)
    if not target.parent.is_dir():
        place.fail("a folder to write in", "none", "make the folder first")


def part_of(target: Path) -> Path:
    """Where a file stands until it is whole; what a killed program left there is of no use."""
    return target.with_name(f".{target.name}.part")


def put_in_place(part: Path, target: Path, overwrite: bool, place: Place) -> None:
    """Give a whole file its name in one step; a file that appeared meanwhile is not replaced unasked."""
    if not overwrite:
        try:
            os.link(part, target)  # unlike a rename, this refuses a name that is taken
            part.unlink()
            return
        except FileExistsError:
            part.unlink()
            _taken(place)
        except OSError:
            pass  # a file system without hard links
    os.replace(part, target)


def _taken(place: Place) -> NoReturn:
    place.fail("a new file", "an existing one", "choose another name, or ask to overwrite it")


def create_file(path: Path) -> Any:
    """A new, empty HDF5 file without time stamps, as an h5py.File; what stood there is lost."""
    access = h5p.create(h5p.FILE_ACCESS)
    access.set_libver_bounds(h5f.LIBVER_V18, h5f.LIBVER_V18)
    creation = h5p.create(h5p.FILE_CREATE)
    creation.set_obj_track_times(False)
    return h5py.File(h5f.create(os.fsencode(path), h5f.ACC_TRUNC, creation, access))


def create_group(parent: Any, name: str | None) -> Any:
    """A group without time stamps; anonymous where name is None: it vanishes unless it is linked."""
    return h5py.Group(h5g.create(parent.id, _encoded(name), None, _group_properties()))


def create_grasps_group(parent: Any) -> None:
    """The group ``/grasps``, whose links all stand in its object header. Made first, to lie in the first page."""
    properties = _group_properties()
    # h5py does not offer these two calls; its own library has them. Where it cannot be asked, HDF5's default layout
    # is as readable, and only the window of a kill becomes longer. HDF5 bears one thread at a time: without h5py's lock
    # a call beside another thread's fails, or breaks both.
    try:
        library = ctypes.CDLL(h5py.defs.__file__)
        for function, a, b in (
            (library.H5Pset_link_phase_change, _MAX_COMPACT_LINKS, 0),
            (library.H5Pset_est_link_info, ROOM_FOR_GRASPS, _GRASP_NAME_BYTES),
        ):
            function.argtypes = (ctypes.c_int64, ctypes.c_uint, ctypes.c_uint)
            with phil:
                function(properties.id, a, b)
    except (OSError, AttributeError):
        pass
    h5g.create(parent.id, b"grasps", None, properties)


def write_array(group: Any, name: str, array: NDArray[Any] | tuple[str, ...]) -> None:
    """A dataset without time stamps; a large one compressed in chunks of about 1 MiB, whole frames each."""
    how: dict[str, Any] = {"data": array}
    if isinstance(array, tuple):
        how = {"data": list(array), "dtype": h5py.string_dtype()}
    elif array.nbytes >= _COMPRESS_FROM_BYTES:
        frames = max(1, _CHUNK_BYTES // (prod(array.shape[1:]) * array.itemsize))
        chunks = (min(len(array), frames), *array.shape[1:])
        how |= {"chunks": chunks, "compression": "gzip", "compression_opts": _GZIP_LEVEL, "shuffle": True}
    dataset = group.create_dataset(name, track_times=False, **how)
    # HDF5 finds a place for the content when the dataset is closed. Left to Python, that is when the last frame that
    # saw it goes, and a profiler beside it (a Dask worker has one) keeps frames a little longer: other bytes.
    dataset.id.close()


def write_attributes(group: Any, values: Mapping[str, Any]) -> None:
    """Attributes; integers become int64."""
    for name, value in values.items():
        group.attrs.create(name, np.int64(value) if isinstance(value, int) else value)


def link_grasp(file: Any, grasp: Any, grasp_id: str) -> None:
    """Make a built, anonymous grasp part of the file, in the order that a kill may cut anywhere."""
    _flush(file)
    file["grasps"][grasp_id] = grasp
    _flush(file)


def _flush(file: Any) -> None:
    # HDF5 writes the end address before it lengthens the file to it; a kill between both would leave a cut file.
    size = file.id.get_filesize()
    if os.path.getsize(file.filename) < size:
        os.truncate(file.filename, size)
    file.flush()


def _group_properties() -> Any:
    properties = h5p.create(h5p.GROUP_CREATE)
    properties.set_obj_track_times(False)
    return properties


def _encoded(name: str | None) -> bytes | None:
    return None if name is None else name.encode()
