"""Malformed grasp datasets: each error is one line that names the file and the field."""

from contextlib import suppress

import h5py
import numpy as np
import pytest

from taxel.recording import DatasetError, GraspDataset

SEED = 20240531
FRAMES, TAXELS, SENSORS = 8, 3, 2


def make_contents(source):
    """Make the content of a valid file: dict from path (dataset) or path@name (attribute) to value."""
    poses = np.tile(np.eye(4), (SENSORS, 1, 1))
    items = {
        "@format": "taxel-grasp-dataset",
        "@version": 1,
        "@source": source,
        "@hand": "two boards",
        "@created": "2024-05-31T12:00:00Z",
        "@generator": "a test",
        "taxels/sensor": np.array([0x20, 0x20, 0x21], np.uint8),
        "taxels/tx": np.array([0, 0, 1], np.uint8),
        "taxels/rx": np.array([0, 1, 0], np.uint8),
        "taxels/position": np.zeros((TAXELS, 3)),
        "taxels/normal": np.tile([0.0, 0.0, 1.0], (TAXELS, 1)),
        "taxels/size": np.full(TAXELS, 0.003),
        "sensors/address": np.array([0x20, 0x21], np.uint8),
        "sensors/name": ["palm", "index"],
        "sensors/kind": ["palm", "fingertip"],
        "sensors/rate_hz": np.array([6.0, 6.0]),
        "objects/cube/vertices": np.vstack([np.zeros(3), np.eye(3)]),
        "objects/cube/faces": np.array([[0, 2, 1], [0, 1, 3]], np.int32),
    }
    for number, grasp in enumerate(("grasps/0003", "grasps/0004")):
        items |= {
            f"{grasp}@object": "cube",
            f"{grasp}@approach": "top",
            f"{grasp}@iteration": number,
            f"{grasp}@session": 0,
            f"{grasp}/timestamp": np.arange(FRAMES) / 6.0,
            f"{grasp}/phase": np.arange(FRAMES, dtype=np.uint8) // 2,
            f"{grasp}/raw_counts": np.full((FRAMES, TAXELS), 30_000, np.uint16),
            f"{grasp}/valid": np.ones((FRAMES, SENSORS), bool),
            f"{grasp}/sensor_pose": poses,
            f"{grasp}/object_pose": np.eye(4),
        }
        if source == "sim":
            items[f"{grasp}/contact_force"] = np.zeros((FRAMES, TAXELS))
            items[f"{grasp}/separation"] = np.full((FRAMES, TAXELS), 0.05)
    if source == "sim":
        model = {"baseline_counts": 3e4, "full_scale_drop_counts": 4e3, "half_force_n": 2.0}
        items |= {f"sensor_model@{name}": value for name, value in model.items()}
    return items


def write_file(path, items):
    """Write datasets and attributes with h5py."""
    with h5py.File(path, "w") as file:
        file.create_group("grasps")
        for name, value in items.items():
            group, at, attribute = name.partition("@")
            if at:
                file.require_group(group or "/").attrs[attribute] = value
            else:
                file[name] = value
    return path


def with_value(array, index, value):
    """Return a copy of the array in which one element or slice has another value."""
    array = array.copy()
    array[index] = value
    return array


def with_nan(array):
    return with_value(array, (0,) * array.ndim, np.nan)


def with_scaled_column(poses, factor):
    return with_value(poses, (..., slice(0, 3), 0), poses[..., :3, 0] * factor)


GRASP = "grasps/0003/"
# Changed field, its new value (None: the field is removed), and the source of the file.
CHANGES = {
    "format of another program": ("@format", "taxel-other", "real"),
    "format is a number": ("@format", 7, "real"),
    "no format": ("@format", None, "real"),
    "version 2": ("@version", 2, "real"),
    "version 1.0": ("@version", 1.0, "real"),
    "version as text": ("@version", "1", "real"),
    "source unknown": ("@source", "emulated", "real"),
    "no hand": ("@hand", None, "real"),
    "hand of two lines": ("@hand", "two\nlines", "real"),
    "created is not a time": ("@created", "yesterday", "real"),
    "generator is an array": ("@generator", ["a", "b"], "real"),
    "no taxel position": ("taxels/position", None, "real"),
    "position of two columns": ("taxels/position", np.zeros((TAXELS, 2)), "real"),
    "position of another length": ("taxels/position", np.zeros((TAXELS + 1, 3)), "real"),
    "position as integers": ("taxels/position", np.zeros((TAXELS, 3), int), "real"),
    "NaN position": ("taxels/position", with_nan, "real"),
    "infinite normal": ("taxels/normal", np.full((TAXELS, 3), np.inf), "real"),
    "normal of length 2": ("taxels/normal", np.full((TAXELS, 3), 2.0), "real"),
    "size 0": ("taxels/size", np.zeros(TAXELS), "real"),
    "NaN size": ("taxels/size", with_nan, "real"),
    "sensor as floats": ("taxels/sensor", np.array([32.0, 32.0, 33.0]), "real"),
    "sensor of 9 bits": ("taxels/sensor", np.array([32, 32, 300]), "real"),
    "sensor that is not in /sensors": ("taxels/sensor", np.array([0x20, 0x20, 0x22], np.uint8), "real"),
    "no address": ("sensors/address", None, "real"),
    "address twice": ("sensors/address", np.array([0x20, 0x20], np.uint8), "real"),
    "names as numbers": ("sensors/name", np.array([1, 2]), "real"),
    "three names": ("sensors/name", ["a", "b", "c"], "real"),
    "rate 0": ("sensors/rate_hz", np.zeros(SENSORS), "real"),
    "face with a vertex that does not exist": ("objects/cube/faces", np.array([[0, 1, 4]], np.int32), "real"),
    "negative vertex number": ("objects/cube/faces", np.array([[0, 1, -1]], np.int32), "real"),
    "no face": ("objects/cube/faces", np.zeros((0, 3), np.int32), "real"),
    "faces as floats": ("objects/cube/faces", np.zeros((1, 3)), "real"),
    "NaN vertex": ("objects/cube/vertices", with_nan, "real"),
    "object that is not in /objects": ("grasps/0003@object", "ball", "real"),
    "no approach": ("grasps/0003@approach", None, "real"),
    "negative iteration": ("grasps/0003@iteration", -1, "real"),
    "iteration as a float": ("grasps/0003@iteration", 1.0, "real"),
    "session as a boolean": ("grasps/0003@session", True, "real"),
    "session as an array": ("grasps/0003@session", np.array([0]), "real"),
    "no timestamp": (GRASP + "timestamp", None, "real"),
    "no frame": (GRASP + "timestamp", np.zeros(0), "real"),
    "decreasing time": (GRASP + "timestamp", np.arange(FRAMES)[::-1] / 6.0, "real"),
    "NaN time": (GRASP + "timestamp", with_nan, "real"),
    "phase 5": (GRASP + "phase", np.full(FRAMES, 5, np.uint8), "real"),
    "phase as floats": (GRASP + "phase", np.zeros(FRAMES), "real"),
    "no raw counts": (GRASP + "raw_counts", None, "real"),
    "raw counts of too few taxels": (GRASP + "raw_counts", np.zeros((FRAMES, 2), np.uint16), "real"),
    "raw counts of too few frames": (GRASP + "raw_counts", np.zeros((FRAMES - 1, TAXELS), np.uint16), "real"),
    "raw counts of one axis": (GRASP + "raw_counts", np.zeros(FRAMES, np.uint16), "real"),
    "raw counts as floats": (GRASP + "raw_counts", np.zeros((FRAMES, TAXELS)), "real"),
    "raw counts of 17 bits": (GRASP + "raw_counts", np.full((FRAMES, TAXELS), 65_536), "real"),
    "negative raw counts": (GRASP + "raw_counts", np.full((FRAMES, TAXELS), -1), "real"),
    "valid of taxels": (GRASP + "valid", np.ones((FRAMES, TAXELS), bool), "real"),
    "valid 2": (GRASP + "valid", np.full((FRAMES, SENSORS), 2, np.uint8), "real"),
    "NaN pose": (GRASP + "sensor_pose", with_nan, "real"),
    "stretched pose": (GRASP + "sensor_pose", lambda poses: with_scaled_column(poses, 1.001), "real"),
    "mirrored pose": (GRASP + "object_pose", lambda pose: with_scaled_column(pose, -1.0), "real"),
    "transposed pose": (GRASP + "object_pose", lambda pose: with_value(pose, (3, 0), 0.1), "real"),
    "infinite sensor time": (GRASP + "sensor_time", np.full((FRAMES, SENSORS), np.inf), "real"),
    "pose over time is not a pose": (GRASP + "sensor_pose_t", np.zeros((FRAMES, SENSORS, 4, 4)), "real"),
    "joints of other frames": (GRASP + "joint_position", np.zeros((FRAMES + 1, 22)), "real"),
    "force in a real file": (GRASP + "contact_force", np.zeros((FRAMES, TAXELS)), "real"),
    "separation in a real file": (GRASP + "separation", np.zeros((FRAMES, TAXELS)), "real"),
    "distance in a real file": (GRASP + "distance", np.zeros((FRAMES, TAXELS)), "real"),
    "sensor model in a real file": ("sensor_model@half_force_n", 1.0, "real"),
    "no force in a simulated file": (GRASP + "contact_force", None, "sim"),
    "no separation in a simulated file": (GRASP + "separation", None, "sim"),
    "negative force": (GRASP + "contact_force", np.full((FRAMES, TAXELS), -0.1), "sim"),
    "NaN force": (GRASP + "contact_force", with_nan, "sim"),
    "NaN separation": (GRASP + "separation", with_nan, "sim"),
    "no half force": ("sensor_model@half_force_n", None, "sim"),
    "half force 0": ("sensor_model@half_force_n", 0.0, "sim"),
    "half force as text": ("sensor_model@half_force_n", "2", "sim"),
    "infinite signal": ("sensor_model@full_scale_drop_counts", np.inf, "sim"),
    "baselines of other taxels": ("sensor_model@baseline_counts", np.ones(TAXELS + 1), "sim"),
    "NaN among the baselines": ("sensor_model@baseline_counts", np.array([1.0, np.nan, 1.0]), "sim"),
    "negative noise": ("sensor_model@noise_counts", -1.0, "sim"),
    "unknown layer": ("sensor_model@layer", "loose", "sim"),
    "stiffness 0": ("sensor_model@contact_stiffness_n_per_m", 0.0, "sim"),
}


def read_error(path):
    """Return the DatasetError of a malformed file; its text must be one printable line that starts with the path."""
    with pytest.raises(DatasetError) as caught, GraspDataset(path) as data:
        data.check()
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(f"{path}: ")
    assert text.isprintable()
    return caught.value


@pytest.mark.parametrize("source", ["real", "sim"])
def test_unmodified_file_is_valid(tmp_path, source):
    with GraspDataset(write_file(tmp_path / "x.h5", make_contents(source))) as data:
        data.check()


@pytest.mark.parametrize("change", CHANGES)
def test_each_invalid_field_is_refused_and_named(tmp_path, change):
    field, value, source = CHANGES[change]
    items = make_contents(source)
    if value is None:
        del items[field]
    else:
        items[field] = value(items[field]) if callable(value) else value
    expected = "/sensor_model" if change == "sensor model in a real file" else "/" + field.replace("@", "/").lstrip("/")
    assert read_error(write_file(tmp_path / "x.h5", items)).field == expected


def write_replaced(path, name, write_replacement):
    """Write a valid file, remove one member, and call `write_replacement(file)`, which may write a replacement."""
    write_file(path, make_contents("real"))
    with h5py.File(path, "r+") as file:
        if name in file:
            del file[name]
        write_replacement(file)
    return path


def test_repeated_crossing_is_refused(tmp_path):
    items = make_contents("real")
    items["taxels/rx"] = np.array([0, 0, 0], np.uint8)
    error = read_error(write_file(tmp_path / "x.h5", items))
    assert error.field == "/taxels/sensor"
    assert "0x20 tx 0 rx 0 again at [1]" in error.found


@pytest.mark.parametrize("group", ["taxels", "sensors", "objects", "grasps"])
def test_missing_group_is_refused(tmp_path, group):
    assert read_error(write_replaced(tmp_path / "x.h5", group, lambda file: None)).field == f"/{group}"


def test_simulated_file_without_a_sensor_model_is_refused(tmp_path):
    items = {name: value for name, value in make_contents("sim").items() if not name.startswith("sensor_model")}
    assert read_error(write_file(tmp_path / "x.h5", items)).field == "/sensor_model"


@pytest.mark.parametrize(
    ("name", "link"),
    [
        ("grasps/0003/raw_counts", h5py.ExternalLink("other.h5", "/secret")),
        ("grasps/0003/raw_counts", h5py.SoftLink("/grasps/0004/raw_counts")),
        ("grasps/0003", h5py.ExternalLink("other.h5", "/")),
        ("taxels", h5py.ExternalLink("other.h5", "/")),
        ("objects/cube", h5py.SoftLink("/nowhere")),
    ],
)
def test_links_are_not_followed(tmp_path, name, link):
    write_file(tmp_path / "other.h5", make_contents("real") | {"secret": np.zeros((FRAMES, TAXELS), np.uint16)})
    error = read_error(write_replaced(tmp_path / "x.h5", name, lambda file: file.__setitem__(name, link)))
    assert error.field == f"/{name}"
    assert error.found == "a link"


def test_external_storage_and_virtual_datasets_are_not_followed(tmp_path):
    (tmp_path / "secret.bin").write_bytes(bytes(1000))
    name = "grasps/0003/timestamp"

    def create_external_dataset(file):
        file.create_dataset(name, (FRAMES,), "f8", external=[(tmp_path / "secret.bin", 0, h5py.h5f.UNLIMITED)])

    def create_virtual_dataset(file):
        layout = h5py.VirtualLayout((FRAMES,), "f8")
        layout[:] = h5py.VirtualSource("other.h5", "x", (FRAMES,))
        file.create_virtual_dataset(name, layout)

    for write_replacement in (create_external_dataset, create_virtual_dataset):
        error = read_error(write_replaced(tmp_path / "x.h5", name, write_replacement))
        assert error.field == f"/{name}"
        assert error.found == "data in another file"


def test_references_and_compounds_are_not_numbers(tmp_path):
    name = "grasps/0003/phase"
    for dtype in (h5py.ref_dtype, h5py.vlen_dtype(np.uint8), np.dtype([("a", "u1")]), "S3"):
        error = read_error(
            write_replaced(tmp_path / "x.h5", name, lambda file, d=dtype: file.create_dataset(name, (FRAMES,), d))
        )
        assert error.field == f"/{name}"
        assert error.expected == "integers"

    def reference(file):
        file["grasps/0003"].attrs["approach"] = file["taxels"].ref

    assert read_error(write_replaced(tmp_path / "x.h5", "nothing", reference)).field == "/grasps/0003/approach"


def test_boolean_with_another_byte_value_is_refused(tmp_path):
    name = "grasps/0003/valid"
    path = write_replaced(
        tmp_path / "x.h5", name, lambda file: file.__setitem__(name, np.ones((FRAMES, SENSORS), bool))
    )
    with h5py.File(path) as file:
        offset = file[name].id.get_offset()
    with open(path, "r+b") as raw:
        raw.seek(offset)
        raw.write(b"\x07")
    assert "found 7 at [0, 0]" in str(read_error(path))


def test_excessive_size_is_refused_before_memory_is_allocated(tmp_path):
    def create_huge_dataset(file, name, shape, dtype):
        file.create_dataset(name, shape, dtype, chunks=(1,) * len(shape))

    for name, shape, dtype in (
        ("taxels/sensor", (2**40,), "u1"),
        ("grasps/0003/timestamp", (10**9,), "f8"),
        ("grasps/0003/joint_position", (FRAMES, 10**9), "f8"),
        ("objects/cube/vertices", (2**50, 3), "f8"),
    ):
        error = read_error(
            write_replaced(
                tmp_path / "x.h5", name, lambda file, item=(name, shape, dtype): create_huge_dataset(file, *item)
            )
        )
        assert error.field == f"/{name}"


def test_empty_values_are_refused(tmp_path):
    def write_empty_dataset(file):
        file["taxels/size"] = h5py.Empty("f8")

    assert read_error(write_replaced(tmp_path / "x.h5", "taxels/size", write_empty_dataset)).found == "an empty dataset"

    def write_empty_attribute(file):
        file["grasps/0003"].attrs["session"] = h5py.Empty("i8")

    error = read_error(write_replaced(tmp_path / "x.h5", "nothing", write_empty_attribute))
    assert error.field == "/grasps/0003/session"


def test_a_group_instead_of_a_dataset_and_the_reverse_are_refused(tmp_path):
    group = read_error(write_replaced(tmp_path / "x.h5", "taxels/size", lambda file: file.create_group("taxels/size")))
    assert (group.field, group.found) == ("/taxels/size", "a group")
    dataset = read_error(write_replaced(tmp_path / "x.h5", "nothing", lambda file: file.__setitem__("grasps/0005", 1)))
    assert (dataset.field, dataset.found) == ("/grasps/0005", "a dataset")


def test_text_that_is_not_utf_8_is_refused(tmp_path):
    def write_invalid_text(file):
        file.attrs["hand"] = np.bytes_(b"\xff\xfe")

    assert read_error(write_replaced(tmp_path / "x.h5", "nothing", write_invalid_text)).field == "/hand"


def test_error_for_a_name_with_a_line_break_is_one_line(tmp_path):
    def create_group_with_line_break(file):
        file.create_group("grasps/a\nb")

    error = read_error(write_replaced(tmp_path / "x.h5", "nothing", create_group_with_line_break))
    assert error.field == r"'/grasps/a\nb/object'"


def test_files_that_are_no_dataset_are_refused(tmp_path):
    assert read_error(tmp_path / "missing.h5").found == "nothing"
    assert read_error(tmp_path).found == "a folder"
    (tmp_path / "text.h5").write_text("not HDF5")
    assert read_error(tmp_path / "text.h5").expected == "an HDF5 file"
    (tmp_path / "empty.h5").write_bytes(b"")
    assert read_error(tmp_path / "empty.h5").field == "/"


def test_truncated_file_is_refused(tmp_path):
    path = write_file(tmp_path / "x.h5", make_contents("real"))
    content = path.read_bytes()
    path.write_bytes(content[:-500])
    assert "truncated" in read_error(path).found
    path.write_bytes(content[:40])  # the HDF5 signature, and a part of the first block
    read_error(path)


def test_damaged_bytes_raise_only_dataset_errors(tmp_path):
    print("seed", SEED)
    generator = np.random.default_rng(SEED)
    # Texts of fixed length: HDF5 2.0 does not return from a damaged global heap, in which it stores other texts.
    items = {
        name: np.array(item, "S") if isinstance(item, str | list) else item
        for name, item in make_contents("sim").items()
    }
    path = write_file(tmp_path / "x.h5", items)
    content = np.frombuffer(path.read_bytes(), np.uint8)
    for _ in range(60):
        damaged = content.copy()
        damaged[generator.integers(0, content.size, 20)] = generator.integers(0, 256, 20)
        path.write_bytes(damaged.tobytes())
        with suppress(DatasetError), GraspDataset(path) as data:
            data.check()
