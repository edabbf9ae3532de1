"""Writing of grasp datasets: round trip, refusal of errors before writing, and recovery after a kill."""

import ctypes
import os
import signal
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache

import h5py
import numpy as np
import pytest
from h5py._objects import phil

from taxel.recording import (
    DatasetError,
    DatasetHeader,
    GraspDataset,
    GraspDatasetWriter,
    GraspRecord,
    ObjectMesh,
    SensorModel,
    SensorTable,
    TaxelTable,
    grasp_writer,
    hdf5_output,
)
from taxel.recording.grasp_format import GRASP
from taxel.recording.grasp_storage import PAGE_BYTES, RESERVED_GRASPS, write_array
from taxel.recording.hdf5_output import open_new_hdf5

SEED = 7
N, S, T = 40, 2, 30  # taxels, sensors, frames
LINK_BYTES = 19
"""Size of the link to a grasp in the header of the group /grasps, bytes."""
CREATED = "2024-05-31T12:00:00+00:00"


def make_taxel_table():
    """Make the table of N taxels, the first 20 of which are on the board 0x20, the others on 0x21."""
    number = np.arange(N)
    return TaxelTable(
        sensor=np.where(number < 20, 0x20, 0x21).astype(np.uint8),
        tx=(number % 20 // 5).astype(np.uint8),
        rx=(number % 5).astype(np.uint8),
        position=number[:, None] * np.array([0.005, 0.001, 0.0]),
        normal=np.tile([0.0, 0.6, 0.8], (N, 1)),
        size=np.full(N, 0.003),
    )


def make_header(source="real", **changes):
    """Make the header of a dataset. source: "real" or "sim". changes: other values of its fields."""
    fields = {
        "source": source,
        "hand": "two boards",
        "taxels": make_taxel_table(),
        "sensors": SensorTable(np.array([0x20, 0x21], np.uint8), ("a", "b"), ("k", "k"), np.array([6.0, 6.5])),
        "objects": {"cube": ObjectMesh(np.eye(3), np.array([[0, 1, 2]], np.int32))},
        "generator": "a test",
        "created": CREATED,
        "sensor_model": SensorModel(np.full(N, 3e4), 4e3, 2.0, layer="coupled") if source == "sim" else None,
    }
    return DatasetHeader(**fields | changes)


@cache
def make_record(number, source="real", has_optional_arrays=False):
    """Make a grasp whose values depend only on its number."""
    generator = np.random.default_rng([SEED, number])
    grasp = GraspRecord(
        object="cube",
        approach=f"approach {number}",
        iteration=number,
        session=number // 2,
        timestamp=np.sort(generator.random(T)),
        phase=np.sort(generator.integers(0, 5, T)).astype(np.uint8),
        raw_counts=generator.integers(0, 65_536, (T, N)).astype(np.uint16),
        valid=generator.random((T, S)) < 0.9,
        sensor_pose=np.tile(np.eye(4), (S, 1, 1)),
        object_pose=np.eye(4),
    )
    if has_optional_arrays:
        poses = np.tile(np.eye(4), (T, S, 1, 1))
        joints = generator.random((T, 22))
        grasp = replace(grasp, sensor_time=generator.random((T, S)), sensor_pose_t=poses, joint_position=joints)
    if source == "sim":
        force, separation = generator.random((2, T, N))
        grasp = replace(
            grasp, contact_force=force, separation=separation, distance=separation if has_optional_arrays else None
        )
    return grasp


def check_grasp(grasp, expected):
    """Check that a grasp of a dataset has the attributes and arrays of the written record."""
    for name in ("object", "approach", "iteration", "session"):
        assert getattr(grasp, name) == getattr(expected, name)
    for name in GRASP:
        array, expected_array = getattr(grasp, name), getattr(expected, name)
        assert (array is None) == (expected_array is None), name
        if expected_array is not None:
            assert array.dtype == expected_array.dtype
            assert np.array_equal(array, expected_array), name


def write_dataset(path, count=3, source="real", **changes):
    """Write a dataset with `count` grasps, and return its path. changes: other header fields."""
    with GraspDatasetWriter.create(path, make_header(source, **changes)) as out:
        for number in range(count):
            out.add(make_record(number, source))
    return path


def test_the_outcome_of_a_grasp_is_read_back_and_absent_where_not_stated(tmp_path):
    with GraspDatasetWriter.create(tmp_path / "x.h5", make_header()) as out:
        out.add(make_record(0))
        out.add(replace(make_record(1), attempts=1, failure="none"))
        out.add(replace(make_record(2), attempts=3, failure="turned"))
    with GraspDataset(tmp_path / "x.h5") as data:
        assert [(grasp.attempts, grasp.failure) for grasp in data] == [(None, None), (1, "none"), (3, "turned")]
        assert [grasp.has_failed for grasp in data] == [None, False, True]


@pytest.mark.parametrize(("field", "value"), [("attempts", 0), ("attempts", 1.5), ("attempts", True), ("failure", "")])
def test_a_wrong_outcome_of_a_grasp_is_refused(tmp_path, field, value):
    with (
        GraspDatasetWriter.create(tmp_path / "x.h5", make_header()) as out,
        pytest.raises(DatasetError, match=f"/grasps/0001/{field}"),
    ):
        out.add(replace(make_record(0), **{field: value}))


@pytest.mark.parametrize("source", ["real", "sim"])
@pytest.mark.parametrize("has_optional_arrays", [False, True], ids=["required arrays", "all arrays"])
def test_written_dataset_is_read_back(tmp_path, source, has_optional_arrays):
    with GraspDatasetWriter.create(tmp_path / "x.h5", make_header(source)) as out:
        ids = [out.add(make_record(number, source, has_optional_arrays)) for number in range(3)]
        assert out.ids == tuple(ids) == ("0001", "0002", "0003")
    with GraspDataset(tmp_path / "x.h5") as data:
        data.check()
        assert (data.source, data.hand, data.generator, data.created) == (source, "two boards", "a test", CREATED)
        for name, array in vars(make_taxel_table()).items():
            assert np.array_equal(getattr(data.taxels, name), array)
        assert data.sensors.name == ("a", "b")
        assert np.array_equal(data.sensors.rate_hz, [6.0, 6.5])
        assert np.array_equal(data.objects["cube"].vertices, np.eye(3))
        for number, grasp in enumerate(data):
            check_grasp(grasp, make_record(number, source, has_optional_arrays))
        if source == "sim":
            assert np.array_equal(data.sensor_model.baseline_counts, np.full(N, 3e4))
            assert (data.sensor_model.half_force_n, data.sensor_model.layer) == (2.0, "coupled")


def test_file_has_the_hdf5_layout_of_the_format_page(tmp_path):
    with h5py.File(write_dataset(tmp_path / "x.h5", 1, "sim")) as file:
        assert set(file) == {"taxels", "sensors", "objects", "grasps", "sensor_model"}
        assert file.attrs["format"] == "taxel-grasp-dataset"
        assert file["grasps/0001"].attrs["approach"] == "approach 0"
        assert file["grasps/0001/valid"].dtype == np.bool_
        assert file["grasps/0001/contact_force"].dtype == np.float64
        assert file["sensors/name"].asstr()[()].tolist() == ["a", "b"]


def test_same_content_gives_the_same_bytes(tmp_path):
    first_bytes = write_dataset(tmp_path / "one.h5", 3, "sim").read_bytes()
    time.sleep(1.1)  # HDF5's own time stamps have a resolution of one second
    assert write_dataset(tmp_path / "two.h5", 3, "sim").read_bytes() == first_bytes
    assert write_dataset(tmp_path / "three.h5", 3, "sim", created="2024-06-01").read_bytes() != first_bytes


def test_profiler_that_keeps_stack_frames_does_not_change_the_bytes(tmp_path):
    """A profiler, such as that of a Dask worker, that keeps the stack frame of a function keeps its datasets open."""

    def write_two_arrays(path):
        with open_new_hdf5(path) as file:
            for name in "ab":
                write_array(file, name, np.zeros((4096, 3)))
        return path.read_bytes()

    expected, stack_frames = write_two_arrays(tmp_path / "one.h5"), []
    sys.setprofile(lambda frame, event, argument: stack_frames.append(frame))
    try:
        profiled = write_two_arrays(tmp_path / "two.h5")
    finally:
        sys.setprofile(None)
    assert profiled == expected


def test_direct_calls_of_hdf5_hold_the_lock_of_h5py(tmp_path, monkeypatch):
    """HDF5 is not safe for threads: every call needs the lock of h5py, `phil`, also calls that bypass h5py."""
    lock_states = []

    def is_free():
        """Return whether the lock of h5py is free, as another thread sees it."""
        is_acquired = phil.acquire(False)
        if is_acquired:
            phil.release()
        return is_acquired

    class WatchedFunction:
        """Function of the HDF5 library that stores the state of the lock at each call."""

        def __init__(self, function):
            self._function = function

        def __call__(self, *arguments):
            self._function.argtypes = self.argtypes
            lock_states.append(other_thread.submit(is_free).result())
            return self._function(*arguments)

    class WatchedLibrary:
        def __init__(self, name):
            self._library = load(name)

        def __getattr__(self, name):
            return WatchedFunction(getattr(self._library, name))

    load = ctypes.CDLL
    monkeypatch.setattr(ctypes, "CDLL", WatchedLibrary)
    with ThreadPoolExecutor(1) as other_thread:
        write_dataset(tmp_path / "x.h5")
    assert lock_states == [False, False]  # two direct calls; the lock is not free during either


def test_an_existing_file_is_overwritten_only_on_request(tmp_path):
    path = write_dataset(tmp_path / "x.h5")
    content = path.read_bytes()
    with pytest.raises(DatasetError, match=r"x\.h5: /: expected a new file, found an existing one") as caught:
        GraspDatasetWriter.create(path, make_header())
    assert "\n" not in str(caught.value)
    assert path.read_bytes() == content
    GraspDatasetWriter.create(path, make_header(), overwrite=True).close()
    with GraspDataset(path) as data:
        assert len(data) == 0
    assert os.listdir(tmp_path) == ["x.h5"]


def test_missing_folders_are_created(tmp_path):
    write_dataset(tmp_path / "new" / "folder" / "x.h5")
    assert os.listdir(tmp_path / "new" / "folder") == ["x.h5"]


def test_a_folder_is_not_replaced_by_a_dataset(tmp_path):
    with pytest.raises(DatasetError, match="expected a new file"):
        GraspDatasetWriter.create(tmp_path, make_header(), overwrite=True)


def check_first_grasps(path, last=None):
    """Check that the file contains the grasps of `make_record` from number 0 on, and return their count.

    last: number of grasps at the end whose content is compared; None: all.
    """
    with GraspDataset(path) as data:
        assert data.ids == tuple(f"{number + 1:04}" for number in range(len(data)))
        for number in range(0 if last is None else max(0, len(data) - last), len(data)):
            check_grasp(data[data.ids[number]], make_record(number))
        return len(data)


def test_file_contains_the_completed_grasps_after_every_single_write(tmp_path, monkeypatch):
    """The content of the file before and after each write is what a kill at this moment would leave."""
    first_count, last_count = 7, 10  # by default HDF5 keeps 8 links in a header, and more links in several places
    path = write_dataset(tmp_path / "x.h5", first_count)
    states = []

    def watch(name):
        """Replace a function of `os`, so that each call stores the content of the file before and after it."""
        function = getattr(os, name)

        def call(*arguments):
            states.append(path.read_bytes())
            result = function(*arguments)
            states.append(path.read_bytes())
            return result

        monkeypatch.setattr(hdf5_output.os, name, call)

    watch("pwrite")
    watch("ftruncate")
    completed = []
    with GraspDatasetWriter.extend(path) as out:
        for number in range(first_count, last_count):
            out.add(make_record(number))
            completed.append(len(states))
    monkeypatch.undo()
    previous = first_count
    copy = tmp_path / "copy.h5"
    for index, state in enumerate(states):
        if index and state == states[index - 1]:
            continue
        copy.write_bytes(state)
        count = check_first_grasps(copy, last=1)
        assert count >= previous
        # A grasp is in the file in every state after the return of its `add`.
        assert count >= first_count + sum(end <= index for end in completed)
        previous = count
    assert check_first_grasps(copy) == last_count


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_killed_writer_leaves_the_completed_grasps(tmp_path):
    """A child process that writes grasps is killed at a random time; its file is readable and can be extended."""
    print("seed", SEED)
    generator = np.random.default_rng(SEED)
    lengths = []
    for case, delay in enumerate(generator.uniform(0.0, 0.05, 12)):
        path = tmp_path / f"{case}.h5"
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            try:
                with GraspDatasetWriter.create(path, make_header()) as out:
                    os.write(writing, b"x")
                    for number in range(RESERVED_GRASPS):
                        out.add(make_record(number))
                    time.sleep(60)
            finally:
                os._exit(1)
        os.read(reading, 1)
        if case == 0:
            with pytest.raises(DatasetError, match="open elsewhere"):
                GraspDataset(path)
        time.sleep(delay)
        os.kill(child, signal.SIGKILL)
        assert os.WIFSIGNALED(os.waitpid(child, 0)[1]), "the child ended before the kill"
        os.close(reading)
        os.close(writing)
        lengths.append(check_first_grasps(path))
        with GraspDatasetWriter.extend(path) as out:
            out.add(make_record(lengths[-1]))
        assert check_first_grasps(path, last=2) == lengths[-1] + 1
    assert max(lengths) > 0


def test_interruption_of_the_creation_leaves_no_file(tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(grasp_writer, "create_grasps_group", interrupt)
    with pytest.raises(KeyboardInterrupt):
        GraspDatasetWriter.create(tmp_path / "x.h5", make_header())
    assert os.listdir(tmp_path) == []
    monkeypatch.undo()
    write_dataset(tmp_path / "x.h5", 1)
    assert os.listdir(tmp_path) == ["x.h5"]


def test_first_page_of_a_file_has_space_for_the_links_of_all_reserved_grasps(tmp_path):
    """Up to the reserved number, a grasp is added by one write: the header of /grasps needs no further block."""
    path = write_dataset(tmp_path / "x.h5", 1)
    with h5py.File(path) as file:
        info = h5py.h5o.get_info(file["grasps"].id)
        print(info.addr, info.hdr.space.total)
        assert info.hdr.nchunks == 1
        assert 1000 < info.addr + info.hdr.space.total <= PAGE_BYTES
        assert info.hdr.space.free >= LINK_BYTES * (RESERVED_GRASPS - 1)


def test_a_dataset_with_more_grasps_than_its_header_has_space_for_is_readable(tmp_path, monkeypatch):
    monkeypatch.setattr("taxel.recording.grasp_storage.RESERVED_GRASPS", 2)
    path = write_dataset(tmp_path / "x.h5", 30)
    assert check_first_grasps(path) == 30
