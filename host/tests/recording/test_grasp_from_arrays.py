"""Conversion of plain arrays, in a dictionary or an .npz file, into a grasp dataset."""

import os
import zipfile

import numpy as np
import pytest

from taxel.recording import DatasetError, GraspDataset, write_from_arrays

T, N, S = 6, 3, 2  # frames, taxels, sensors


def make_arrays(source="real"):
    """Make the arrays of a valid dataset with two grasps: dict from path to array."""
    result = {
        "source": source,
        "hand": "two boards",
        "created": "2024-05-31",
        "taxels/sensor": np.array([0x20, 0x20, 0x21], np.uint8),
        "taxels/tx": np.array([0, 0, 1], np.uint8),
        "taxels/rx": np.array([0, 1, 0], np.uint8),
        "taxels/position": np.zeros((N, 3)),
        "taxels/normal": np.tile([0.0, 0.0, 1.0], (N, 1)),
        "taxels/size": np.full(N, 0.003),
        "sensors/address": np.array([0x20, 0x21]),
        "sensors/name": np.array(["palm", "index"]),
        "sensors/kind": np.array(["palm", "fingertip"]),
        "sensors/rate_hz": np.array([6.0, 6.0]),
        "objects/cube/vertices": np.eye(3),
        "objects/cube/faces": np.array([[0, 1, 2]]),
    }
    for number, grasp in enumerate(("grasps/0001", "grasps/0002")):
        result |= {
            f"{grasp}/object": "cube",
            f"{grasp}/approach": np.array("top"),
            f"{grasp}/iteration": np.array(number),
            f"{grasp}/session": 0,
            f"{grasp}/timestamp": np.arange(T) / 6.0,
            f"{grasp}/phase": np.arange(T) // 2,
            f"{grasp}/raw_counts": np.arange(T * N).reshape(T, N) + number,
            f"{grasp}/valid": np.ones((T, S), bool),
            f"{grasp}/sensor_pose": np.tile(np.eye(4), (S, 1, 1)),
            f"{grasp}/object_pose": np.eye(4),
        }
        if source == "sim":
            result |= {f"{grasp}/contact_force": np.zeros((T, N)), f"{grasp}/separation": np.full((T, N), 0.05)}
    if source == "sim":
        result |= {"sensor_model/baseline_counts": np.array(30_000), "sensor_model/half_force_n": 2.0}
        result |= {"sensor_model/full_scale_drop_counts": np.float32(4000.0), "sensor_model/layer": np.array("coupled")}
    return result


def to_nested(flat):
    """Convert a dict by path into nested dicts, one for each group of the paths."""
    tree = {}
    for name, value in flat.items():
        *groups, leaf = name.split("/")
        branch = tree
        for group in groups:
            branch = branch.setdefault(group, {})
        branch[leaf] = value
    return tree


def check_content(path, source):
    """Check that the dataset has the content of `make_arrays(source)`."""
    with GraspDataset(path) as data:
        data.check()
        assert (data.source, data.hand, data.created) == (source, "two boards", "2024-05-31")
        assert data.generator == "taxel from_arrays"
        assert data.sensors.name == ("palm", "index")
        assert data.ids == ("0001", "0002")
        assert data["0002"].iteration == 1
        assert data["0002"].raw_counts.tolist() == (np.arange(T * N).reshape(T, N) + 1).tolist()
        if source == "sim":
            assert (data.sensor_model.baseline_counts, data.sensor_model.layer) == (30_000.0, "coupled")


@pytest.mark.parametrize("source", ["real", "sim"])
@pytest.mark.parametrize("kind", ["flat", "nested", "npz", "compressed npz"])
def test_every_kind_of_input_gives_the_same_dataset(tmp_path, source, kind):
    inputs = make_arrays(source)
    if kind == "nested":
        inputs = to_nested(inputs)
    elif kind.endswith("npz"):
        (np.savez if kind == "npz" else np.savez_compressed)(tmp_path / "x.npz", **inputs)
        inputs = tmp_path / "x.npz"
    write_from_arrays(tmp_path / "x.h5", inputs)
    check_content(tmp_path / "x.h5", source)
    write_from_arrays(tmp_path / "y.h5", make_arrays(source))
    assert (tmp_path / "x.h5").read_bytes() == (tmp_path / "y.h5").read_bytes()
    assert {name for name in os.listdir(tmp_path) if name.startswith(".")} == set()  # no temporary file remains


def test_existing_file_is_kept_without_overwrite_or_after_an_error(tmp_path):
    (tmp_path / "x.h5").write_text("existing")
    with pytest.raises(DatasetError, match="expected a new file, found an existing one"):
        write_from_arrays(tmp_path / "x.h5", make_arrays())
    broken = make_arrays() | {"grasps/0002/phase": np.full(T, 9)}
    with pytest.raises(DatasetError, match=r"x\.h5: /grasps/0002/phase: "):
        write_from_arrays(tmp_path / "x.h5", broken, overwrite=True)
    assert (tmp_path / "x.h5").read_text() == "existing"
    assert os.listdir(tmp_path) == ["x.h5"]
    write_from_arrays(tmp_path / "x.h5", make_arrays(), overwrite=True)
    check_content(tmp_path / "x.h5", "real")


@pytest.mark.parametrize(
    ("name", "value", "expected_text"),
    [
        ("source", None, "expected a value, found nothing"),
        ("taxels/rx", None, "expected a value, found nothing"),
        ("grasps/0001/session", None, "expected a value, found nothing"),
        ("grasps/0001/raw_counts", None, "found nothing"),
        ("grasps/0001/raw_count", np.zeros((T, N)), "did you mean raw_counts?"),
        ("taxel/sensor", np.zeros(N), "an unknown one"),
        ("grasps/raw_counts", np.zeros((T, N)), "an unknown one"),
        ("pressure", 1.0, "use one of source"),
        ("created", "noon", "ISO 8601"),
        ("hand", np.array(["a", "b"]), "expected a string"),
        ("taxels/size", np.zeros(N), "metres above 0"),
        ("sensors/name", np.array(["a"]), "expected 2 texts"),
        ("objects/cube/faces", np.array([[0, 1, 3]]), "vertex numbers from 0 to 2"),
        ("grasps/0002/object", "ball", "a name in /objects"),
        ("grasps/0002/iteration", 0.5, "an integer"),
        ("grasps/0002/timestamp", [[0.0], [1.0, 2.0]], "rows of different lengths"),
        ("grasps/0002/raw_counts", np.full((T, N), 70_000), "values from 0 to 65535"),
        ("grasps/0002/valid", np.ones((T, N), bool), "shape [T, s]"),
        ("grasps/0002/contact_force", np.zeros((T, N)), 'source = "real"'),
    ],
)
def test_each_error_has_one_line_and_leaves_no_file(tmp_path, name, value, expected_text):
    inputs = make_arrays()
    if value is None:
        del inputs[name]
    else:
        inputs[name] = value
    with pytest.raises(DatasetError) as caught:
        write_from_arrays(tmp_path / "x.h5", inputs)
    text = str(caught.value)
    assert text.startswith(f"{tmp_path / 'x.h5'}: /{name}: ")
    assert expected_text in text
    assert "\n" not in text
    assert os.listdir(tmp_path) == []


def test_arrays_without_objects_are_refused(tmp_path):
    inputs = {name: value for name, value in make_arrays().items() if not name.startswith("objects/")}
    with pytest.raises(DatasetError, match="/objects: expected at least one object"):
        write_from_arrays(tmp_path / "x.h5", inputs)


def test_pickled_objects_are_not_loaded(tmp_path):
    pickled = np.array([{"a": 1}], dtype=object)
    np.savez(tmp_path / "x.npz", **make_arrays() | {"grasps/0001/phase": pickled})
    with pytest.raises(DatasetError) as caught:
        write_from_arrays(tmp_path / "x.h5", tmp_path / "x.npz")
    assert "x.npz: /grasps/0001/phase: expected a plain array" in str(caught.value)
    assert os.listdir(tmp_path) == ["x.npz"]


def test_files_that_are_no_npz_are_refused(tmp_path):
    for name, content in (("missing.npz", None), ("text.npz", b"text"), ("empty.npz", b"")):
        if content is not None:
            (tmp_path / name).write_bytes(content)
        with pytest.raises(DatasetError, match=rf"{name}: /: expected an .npz file"):
            write_from_arrays(tmp_path / "x.h5", tmp_path / name)


def test_array_whose_header_states_more_than_its_content_is_refused(tmp_path):
    np.savez(tmp_path / "x.npz", **{name: item for name, item in make_arrays().items() if name != "source"})
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }".ljust(117) + b"\n"
    with zipfile.ZipFile(tmp_path / "x.npz", "a") as file:
        file.writestr("source.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header)
    with pytest.raises(DatasetError, match=r"x\.npz: /source: expected a plain array, found .it has 0 bytes"):
        write_from_arrays(tmp_path / "x.h5", tmp_path / "x.npz")
    with zipfile.ZipFile(tmp_path / "y.npz", "w") as file:
        file.writestr("source.npy", b"garbage")
    with pytest.raises(DatasetError, match=r"y\.npz: /source: expected a plain array"):
        write_from_arrays(tmp_path / "x.h5", tmp_path / "y.npz")
