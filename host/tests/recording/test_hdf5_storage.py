"""Chunks of HDF5 files: a chunk of another size than its header states is refused before the HDF5 library reads it."""

import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest

from taxel.recording import DatasetError
from taxel.recording.general.hdf5_fields import check_links, read_array
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_format import ArraySpec
from taxel.recording.grasp_hdf5 import Node
from taxel.recording.hdf5_storage import check_layout, read_values
from taxel.recording.importers.source_hdf5 import open_file

COUNT = 1000
VALUES = np.arange(COUNT, dtype=float)

DAMAGED = {
    "gzip data that expand to 16 bytes": ({"compression": "gzip"}, zlib.compress(bytes(16))),
    "gzip data that expand to a byte too many": ({"compression": "gzip"}, zlib.compress(bytes(8 * COUNT + 1))),
    "incomplete gzip data": ({"compression": "gzip"}, zlib.compress(VALUES.tobytes())[:-9]),
    "other bytes than gzip": ({"compression": "gzip"}, b"no zlib stream"),
    "an uncompressed chunk of 16 bytes": ({}, bytes(16)),
    "a chunk that is shorter than its checksum": ({"fletcher32": True}, b"ab"),
    "lzf data that expand to 13 bytes": ({"compression": "lzf"}, b"\3abcd\xe0\0\1"),
    "incomplete lzf data": ({"compression": "lzf"}, b"\3abcd\xe0\xff" * 30),
    "compressed data that are shorter than their checksum": ({"fletcher32": True, "compression": "gzip"}, b"ab"),
}
COMPLETE = {
    "no filter": {},
    "gzip": {"compression": "gzip"},
    "gzip of shuffled bytes": {"compression": "gzip", "shuffle": True},
    "lzf": {"compression": "lzf"},
    "lzf of shuffled bytes with a checksum": {"compression": "lzf", "shuffle": True, "fletcher32": True},
    "checksum": {"fletcher32": True},
    "all filters": {"compression": "gzip", "shuffle": True, "fletcher32": True},
}


def read_with_node(path):
    """Read the array as a field of a version 1 dataset."""
    with h5py.File(path) as file:
        return Node(file, Location(str(path))).array("a", ArraySpec("f8", (COUNT,)), {})


def read_with_fields(path):
    """Read the array as a field of a version 2 dataset."""
    with h5py.File(path) as file:
        return read_array(file["a"], Location(str(path)).key("a"))


def read_with_import(path):
    """Read the array as a field of a file of another program."""
    return open_file(path).fields["a"].load()


READERS = [read_with_node, read_with_fields, read_with_import]


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize("damage", DAMAGED)
def test_a_damaged_chunk_is_refused_and_the_array_named(tmp_path, damage, read):
    options, stored = DAMAGED[damage]
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("a", (COUNT,), "f8", chunks=(COUNT,), **options).id.write_direct_chunk((0,), stored)
    with pytest.raises(DatasetError, match=r"a\.h5: /?a: expected complete chunks of 8000 bytes"):
        read(path)


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize("name", COMPLETE)
def test_complete_chunks_are_read(tmp_path, name, read):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("a", data=VALUES, chunks=(300,), **COMPLETE[name])
    assert np.array_equal(read(path), VALUES)


@pytest.mark.parametrize("read", READERS)
def test_filters_whose_output_size_cannot_be_checked_are_refused(tmp_path, read):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("a", data=VALUES, chunks=(300,), scaleoffset=2)
    with pytest.raises(DatasetError, match="write it again with gzip"):
        read(path)


@pytest.mark.parametrize(
    "list_names",
    [
        lambda file: Node(file, Location("a.h5")).names(),
        lambda file: check_links(file, Location("a.h5"), 1),
        lambda file: open_file(Path(file.filename)),
    ],
)
def test_a_name_in_another_code_than_utf_8_is_refused(tmp_path, list_names):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("a", data=VALUES)
        file.create_dataset(b"r\xfchrt", data=VALUES)
    with h5py.File(path) as file, pytest.raises(DatasetError, match="names in UTF-8"):
        list_names(file)


def test_chunk_to_which_a_filter_was_not_applied_is_accepted(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        array = file.create_dataset("a", (COUNT,), "f8", chunks=(COUNT,), compression="gzip")
        array.id.write_direct_chunk((0,), VALUES.tobytes(), filter_mask=1)
    assert np.array_equal(read_with_fields(tmp_path / "a.h5"), VALUES)


@pytest.mark.parametrize("dtype", [h5py.string_dtype(), "S5", bool])
def test_chunks_of_strings_and_booleans_are_accepted(tmp_path, dtype):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        values = np.array([1, 0] * 50).astype(bool if dtype is bool else "S5")
        array = file.create_dataset("a", data=values, dtype=dtype, chunks=(30,), compression="gzip")
        check_layout(array, Location("a.h5"))
        assert np.array_equal(read_values(array, Location("a.h5")), array[()])


@pytest.mark.parametrize("dtype", ["<f8", ">f8", "<u2", ">i4", "<f4", "<i1"])
@pytest.mark.parametrize("chunks", [(1, 1), (2, 5), (4, 9), (16, 16)])
def test_numbers_of_each_type_and_chunk_shape_are_read_as_the_library_reads_them(tmp_path, dtype, chunks):
    values = (np.arange(72).reshape(8, 9) * 3 - 50).astype(dtype)
    options = {"compression": "gzip", "shuffle": True, "maxshape": (None, None)}
    with h5py.File(tmp_path / "a.h5", "w") as file:
        read = read_values(file.create_dataset("a", data=values, chunks=chunks, **options), Location("a.h5"))
    assert read.dtype == np.dtype(dtype)
    assert np.array_equal(read, values)


def test_array_with_chunks_that_were_never_written_is_accepted(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        array = file.create_dataset("a", (COUNT,), "f8", chunks=(100,), compression="gzip", fillvalue=7.0)
        array[:50] = 1.0
        assert np.array_equal(read_values(array, Location("a.h5")), array[()])
