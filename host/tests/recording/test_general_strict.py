"""Datasets of version 2 are read exactly: an inexact value, a link or another type gives one error line."""

import math

import h5py
import numpy as np
import pytest

from taxel.recording.errors import DatasetError
from taxel.recording.general.dataset import GeneralDataset
from taxel.recording.general.format import Contact, GeneralHeader, Properties, TaxelPlaces
from taxel.recording.general.writer import write_general


@pytest.fixture
def path(tmp_path):
    """Path of a valid dataset of version 2 with one contact of 40 frames and three taxels."""
    places = TaxelPlaces(np.zeros(3, np.int64), position=np.arange(9.0).reshape(3, 3) * 0.01)
    contacts = [Contact("c0", 1, np.arange(40) * 0.02, np.arange(120.0).reshape(40, 3), phase=np.zeros(40, np.uint8))]
    write_general(tmp_path / "a.h5", GeneralHeader("real", "mat", "t", Properties("kPa"), places), contacts)
    return tmp_path / "a.h5"


def read_all(path):
    """Return the header of a dataset and the list of its contacts."""
    with GeneralDataset(path) as data:
        return data.header, list(data)


def replace_array(name, array):
    """Return a function that replaces the array `name` of an open HDF5 file."""

    def change(file):
        del file[name]
        file[name] = array

    return change


def set_attribute(group, name, value):
    """Return a function that sets an attribute of a group of an open HDF5 file."""
    return lambda file: file[group].attrs.__setitem__(name, value)


def link_to_other_file(file):
    del file["grasps/c0/values"]
    file["grasps/c0/values"] = h5py.ExternalLink("other.h5", "/values")


def store_outside(file):
    del file["grasps/c0/time"]
    file["grasps/c0"].create_dataset("time", (40,), "f8", external=[("other.raw", 0, 320)])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (set_attribute("grasps/c0", "session", 0.5), "/grasps/c0/session: expected an integer of 0 or more, found 0.5"),
        (set_attribute("grasps/c0", "session", -1), "/grasps/c0/session: expected an integer of 0 or more, found -1"),
        (set_attribute("grasps/c0", "iteration", True), "/grasps/c0/iteration: expected an integer of 0 or more"),
        (set_attribute("grasps/c0", "object", True), "/grasps/c0/object: expected a string of at most 1000 characters"),
        (set_attribute("/", "sensor", 5), "/sensor: expected a string of at most 1000 characters, found 5"),
        (set_attribute("/", "full_scale", True), "/full_scale: expected one number, found true"),
        (set_attribute("/", "full_scale", [1.0, 2.0]), "/full_scale: expected one number"),
        (replace_array("taxels/sensor", [0.0, 0.5, 1.0]), "/taxels/sensor: expected integers, found other numbers"),
        (replace_array("taxels/position", np.zeros((3, 3), complex)), "/taxels/position: expected an array of numbers"),
        (replace_array("grasps/c0/phase", np.full(40, -1)), "/grasps/c0/phase: expected 0 to 4, found -1 to -1"),
        (replace_array("grasps/c0/phase", np.full(40, 1.5)), "/grasps/c0/phase: expected integers"),
        (replace_array("grasps/c0/valid", np.full(40, 2)), "/grasps/c0/valid: expected booleans, or 0 and 1"),
        (link_to_other_file, "/grasps/c0/values: expected data of this file, found a link"),
        (store_outside, "/grasps/c0/time: expected data in this file, found data in another file"),
    ],
)
def test_a_wrong_value_or_a_link_to_other_data_is_refused_with_its_path(path, change, message):
    with h5py.File(path, "r+") as file:
        if "valid" not in file["grasps/c0"]:
            file["grasps/c0/valid"] = np.ones(40, bool)
        change(file)
    with pytest.raises(DatasetError) as caught:
        read_all(path)
    assert message in str(caught.value)


def test_integers_that_are_stored_as_floats_or_one_element_arrays_are_read(path):
    with h5py.File(path, "r+") as file:
        file["grasps/c0"].attrs["session"] = [3.0]
        replace_array("taxels/sensor", np.array([0.0, 0.0, 1.0], np.float32))(file)
    header, (contact,) = read_all(path)
    assert contact.session == 3
    assert header.places.sensor.tolist() == [0, 0, 1]


def test_a_string_heap_whose_free_space_has_size_0_is_refused(path):
    # A global heap of HDF5 starts with "GCOL" and has 16 bytes of header, then its objects. Each object has 16 bytes
    # of header (number in bytes 0 to 1, size in bytes 8 to 15) and its content, padded to a multiple of 8 bytes. The
    # object with the number 0 is the free space at the end.
    data = bytearray(path.read_bytes())
    heap = data.find(b"GCOL")
    assert heap > 0
    heap_object = heap + 16
    while int.from_bytes(data[heap_object : heap_object + 2], "little") != 0:
        size = int.from_bytes(data[heap_object + 8 : heap_object + 16], "little")
        heap_object += 16 + math.ceil(size / 8) * 8
    data[heap_object + 8 : heap_object + 16] = bytes(8)
    path.write_bytes(data)
    with pytest.raises(DatasetError, match=rf"expected undamaged heaps of texts, found a damaged one at byte {heap}"):
        GeneralDataset(path)
