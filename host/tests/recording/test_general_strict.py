"""Datasets of version 2 are read exactly: an inexact value, a link or another type gives one error line."""

import h5py
import numpy as np
import pytest

from taxel.recording.errors import DatasetError
from taxel.recording.general.dataset import GeneralDataset
from taxel.recording.general.format import Contact, GeneralHeader, Properties, TaxelPlaces
from taxel.recording.general.writer import write_general


@pytest.fixture
def path(tmp_path):
    places = TaxelPlaces(np.zeros(3, np.int64), position=np.arange(9.0).reshape(3, 3) * 0.01)
    contacts = [Contact("c0", 1, np.arange(40) * 0.02, np.arange(120.0).reshape(40, 3), phase=np.zeros(40, np.uint8))]
    write_general(tmp_path / "a.h5", GeneralHeader("real", "mat", "t", Properties("kPa"), places), contacts)
    return tmp_path / "a.h5"


def read_all(path):
    with GeneralDataset(path) as data:
        return data.header, list(data)


def replace_array(name, array):
    def change(file):
        del file[name]
        file[name] = array

    return change


def set_attribute(group, name, value):
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
        (set_attribute("grasps/c0", "object", True), "/grasps/c0/object: expected a text of at most 1000 characters"),
        (set_attribute("/", "sensor", 5), "/sensor: expected a text of at most 1000 characters, found 5"),
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
def test_an_inexact_value_or_a_link_is_refused(path, change, message):
    with h5py.File(path, "r+") as file:
        if "valid" not in file["grasps/c0"]:
            file["grasps/c0/valid"] = np.ones(40, bool)
        change(file)
    with pytest.raises(DatasetError) as caught:
        read_all(path)
    assert message in str(caught.value)


def test_integers_that_a_program_has_stored_as_floats_are_read(path):
    with h5py.File(path, "r+") as file:
        file["grasps/c0"].attrs["session"] = [3.0]
        replace_array("taxels/sensor", np.array([0.0, 0.0, 1.0], np.float32))(file)
    header, (contact,) = read_all(path)
    assert contact.session == 3
    assert header.places.sensor.tolist() == [0, 0, 1]


def test_a_damaged_heap_of_texts_is_refused_instead_of_read_without_end(path):
    data = bytearray(path.read_bytes())
    start = data.find(b"GCOL")
    assert start > 0
    place = start + 16
    while int.from_bytes(data[place : place + 2], "little"):
        place += 16 + -(-int.from_bytes(data[place + 8 : place + 16], "little") // 8) * 8
    data[place + 8 : place + 16] = bytes(8)
    path.write_bytes(data)
    with pytest.raises(DatasetError, match=rf"expected undamaged heaps of texts, found a damaged one at byte {start}"):
        GeneralDataset(path)
