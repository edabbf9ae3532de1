"""Targets: files of other programs that `taxel import` reads."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow
import pyarrow.parquet

from fuzz_files.array_codecs import Hdf5, Npz, Parquet, Sqlite, Zip, encode_npz
from fuzz_files.binary_codecs import Bag, Mcap
from fuzz_files.codec import Codec
from fuzz_files.document import Flat, flatten
from fuzz_files.target import COARSE, Rules, Target
from fuzz_files.targets.datasets import read_version_1
from fuzz_files.text_codecs import Csv, Json, Toml
from taxel.hand import Hand, load_hand
from taxel.hand.kinematics import Kinematics, compute_taxel_positions
from taxel.hand.robot import load_robot
from taxel.hand.transforms import make_pose
from taxel.recording.importers.sources import open_source
from taxel.sim.importers.active_points import import_active
from taxel.sim.importers.gazebo_csv import import_contacts
from taxel.sim.importers.options import ImportOptions
from taxel.sim.importers.original_contacts import read_original_contacts
from taxel.sim.importers.rollout_names import load_map
from taxel.sim.importers.rollout_states import read_states

_ROWS: Final = 40


def make_table() -> dict[str, Any]:
    """Create the columns of a recording of four taxels by name: times and values."""
    values = 0.25 * np.arange(_ROWS * 4).reshape(_ROWS, 4)
    return {"t": np.arange(_ROWS) * 0.02, **{f"a{column}": values[:, column] for column in range(4)}}


def write_csv(folder: Path) -> str:
    """Write the table as CSV and return the file's name."""
    table = make_table()
    rows = [list(table), *zip(*(map(float, column) for column in table.values()), strict=True)]
    (folder / "a.csv").write_bytes(Csv().encode([list(row) for row in rows]))
    return "a.csv"


def write_npz(folder: Path) -> str:
    """Write the table and an array of strings as a NumPy archive, and return the file's name."""
    (folder / "a.npz").write_bytes(encode_npz({**make_table(), "label": np.array(["x", "y"])}))
    return "a.npz"


def write_hdf5(folder: Path) -> str:
    """Write the table as HDF5 and return the file's name."""
    (folder / "a.h5").write_bytes(Hdf5().encode({f"run/{name}": column for name, column in make_table().items()}))
    return "a.h5"


def write_parquet(folder: Path) -> str:
    """Write the table as Parquet and return the file's name."""
    pyarrow.parquet.write_table(pyarrow.table(make_table()), folder / "a.parquet")
    return "a.parquet"


def _make_store(is_ros1: bool) -> Any:
    """Create a store of ROS message types that contains a type which the reader does not know in advance."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg("std_msgs/Header header\nuint16[4] values\nstring label\n", "a/msg/Pad"))
    return store


def _make_message(store: Any, number: int, is_ros1: bool) -> Any:
    """Create message `number` of the type a/msg/Pad: a header, four values and a label."""
    time = store.types["builtin_interfaces/msg/Time"](sec=100 + number, nanosec=0)
    fields = {"stamp": time, "frame_id": "pad"} | ({"seq": number} if is_ros1 else {})
    values = np.arange(4, dtype=np.uint16) + number
    return store.types["a/msg/Pad"](store.types["std_msgs/msg/Header"](**fields), values, "grasp")


def write_bag1(folder: Path) -> str:
    """Write a ROS 1 bag of eight messages and return its name."""
    from rosbags.rosbag1 import Writer

    store = _make_store(True)
    with Writer(folder / "a.bag") as writer:
        connection = writer.add_connection("/pad", "a/msg/Pad", typestore=store)
        for number in range(8):
            message = _make_message(store, number, True)
            writer.write(connection, 10**18 + number, store.serialize_ros1(message, "a/msg/Pad"))
    return "a.bag"


def _write_bag2(plugin: str) -> Callable[[Path], str]:
    """Return a function that writes a ROS 2 bag, a folder. plugin: name of the storage format."""

    def make(folder: Path) -> str:
        """Write the bag of eight messages and return the folder's name."""
        from rosbags.rosbag2 import StoragePlugin, Writer

        store = _make_store(False)
        with Writer(folder / "bag", version=9, storage_plugin=StoragePlugin[plugin]) as writer:
            connection = writer.add_connection("/pad", "a/msg/Pad", typestore=store)
            for number in range(8):
                message = _make_message(store, number, False)
                writer.write(connection, 10**18 + number, store.serialize_cdr(message, "a/msg/Pad"))
        return "bag"

    return make


def write_lerobot(folder: Path) -> str:
    """Write a LeRobot dataset of version 2.1 with one episode, and return its folder."""
    (folder / "set/meta").mkdir(parents=True)
    (folder / "set/data/chunk-000").mkdir(parents=True)
    (folder / "set/meta/info.json").write_text(json.dumps({"codebase_version": "v2.1", "fps": 50}))
    (folder / "set/meta/tasks.jsonl").write_text(
        '{"task_index": 0, "task": "pick"}\n{"task_index": 1, "task": "put"}\n'
    )
    columns = {
        "observation.tactile": [[float(row), 1.0] for row in range(10)],
        "timestamp": [0.02 * row for row in range(10)],
        "episode_index": [0] * 10,
        "task_index": [0] * 5 + [1] * 5,
    }
    path = folder / "set/data/chunk-000/episode_000000.parquet"
    pyarrow.parquet.write_table(pyarrow.table(columns), path)
    return "set"


def write_zarr(folder: Path) -> str:
    """Write the table as a Zarr store of format 2 with one uncompressed chunk for each array, and return its name."""
    store = folder / "a.zarr"
    for name, column in make_table().items():
        (store / name).mkdir(parents=True)
        head = {"zarr_format": 2, "shape": [_ROWS], "chunks": [_ROWS], "dtype": "<f8", "fill_value": 0.0, "order": "C"}
        (store / name / ".zarray").write_text(json.dumps({**head, "compressor": None, "filters": None}))
        (store / name / "0").write_bytes(np.asarray(column, "<f8").tobytes())
    (store / ".zgroup").write_text('{"zarr_format": 2}')
    return "a.zarr"


def read_source(path: Path) -> Flat:
    """Read all fields of a file that `taxel import` can open."""
    source = open_source(path)
    return {name.lstrip("/"): source.read(name) for name in source.fields}


HAND_NAME: Final = "allegro"
_POSE: Final = "x,y,z,qw,qx,qy,qz"


@cache
def _get_hand() -> tuple[Hand, Any, ImportOptions]:
    """Return the hand, the centres f64[n, 3] of its taxels with all joint angles 0, and the options of an import."""
    hand = load_hand(HAND_NAME)
    robot = load_robot(str(hand.robot)).get_subtree("palm")
    wrist = make_pose(np.array([0.5, 0.0, 0.3]), np.array([1.0, 0.0, 0.0, 0.0]))
    centres = compute_taxel_positions(hand, wrist @ Kinematics(robot, hand).compute_sensor_poses(np.zeros(16)))
    pose = make_pose(np.array([0.535, 0.0, 0.2]), np.array([1.0, 0.0, 0.0, 0.0]))
    return hand, centres, ImportOptions(hand, object_poses={"cylinder": pose}, wrist_pose=wrist, baseline_frames=100)


def write_contacts(folder: Path) -> str:
    """Write a table of three contact points, as Gazebo gives them, and the joint angles. Returns ".", the folder."""
    hand, centres, _ = _get_hand()
    rows = [["1", "cylinder", "top", 0.5 + 0.1 * step, *centres[step].tolist(), 0.25] for step in range(3)]
    header = ["grasp", "object", "approach", "time", "x", "y", "z", "force"]
    (folder / "c.csv").write_bytes(Csv().encode([header, *rows]))
    names = load_robot(str(hand.robot)).get_subtree("palm").joint_names
    (folder / "j.csv").write_bytes(Csv().encode([["grasp", *names], ["1", *[0] * 16]]))
    return "."


def write_active(folder: Path) -> str:
    """Write a table of three active taxels and the joint angles. Returns ".", the folder."""
    write_contacts(folder)
    _, centres, _ = _get_hand()
    rows = [["1", "cylinder", "top", *centres[step].tolist(), 1] for step in range(3)]
    (folder / "c.csv").write_bytes(Csv().encode([["grasp", "object", "approach", "x", "y", "z", "active"], *rows]))
    return "."


def _read_contacts(convert: Callable[..., Any]) -> Callable[[Path], Flat]:
    """Return a function that imports the contacts and joint angles of a folder with `convert` and reads the dataset."""

    def read(path: Path) -> Flat:
        """Import the files of a folder to a dataset, return the dataset's data, and delete the dataset."""
        out = path / "out.h5"
        try:
            convert(path / "c.csv", out, joints=path / "j.csv", options=_get_hand()[2])
            return read_version_1(out)
        finally:
            out.unlink(missing_ok=True)

    return read


def write_original(folder: Path) -> str:
    """Write a contact file of the original simulator and return its name."""
    (folder / "a.csv").write_bytes(Csv().encode([[0.1, 0.2, 0.3, 1.5], [0.4, 0.5, 0.6, 2.5]]))
    return "a.csv"


def read_original(path: Path) -> Flat:
    """Read the contacts of a file of the original simulator."""
    return {"points": read_original_contacts(path)[1]}


SIZES: Final[dict[str, tuple[int, ...]]] = {
    "qpos": (3,), "qvel": (2,), "act": (0,), "ctrl": (2,), "mocap_pos": (0, 3), "mocap_quat": (0, 4),
}  # fmt: skip
"""Shapes of the states of a model, without the axis of time."""


def write_states(folder: Path) -> str:
    """Write the states of a MuJoCo model at six times and return the file's name."""
    rows = np.arange(6.0)
    states = {"qpos": rows[:, None] + [0.0, 1.0, 2.0], "qvel": rows[:, None] * [1.0, 0.5], "time": 0.01 * rows}
    texts = {"phase": np.array(["hold"] * 6), "grasp": np.array(["1"] * 6)}
    (folder / "a.npz").write_bytes(encode_npz({**states, **texts}))
    return "a.npz"


def read_state_file(path: Path) -> Flat:
    """Read the states of a MuJoCo model."""
    states = read_states(path, SIZES, 0.01)
    states.rows_by_grasp()
    return flatten(states, "", ("source",))


def write_map(folder: Path) -> str:
    """Write a file that maps the names of a MuJoCo model to boards and the object, and return its name."""
    text = (
        'prefix = "rh_"\n[object]\nbody = "can"\n[boards]\npalm = "palm_pad"\nfingertip_index = { body = "ff_tip" }\n'
    )
    (folder / "a.toml").write_text(text)
    return "a.toml"


def read_map(path: Path) -> Flat:
    """Read the content of a map of a MuJoCo model's names."""
    return flatten(load_map(path)[0])


_NAMES: Final = Rules(unused=re.compile("^metadata"), derived=re.compile(r"^\[0\]\["))
"""Rules of a table whose first line has names; a name is a part of a path of the data."""


def _source(name: str, make: Callable[[Path], str], weight: float, *codecs: tuple[str, tuple[Codec, ...]]) -> Target:
    """Create the target of a file that `open_source` reads.

    The codec of a bag and of a store models the file only coarsely, so the rules permit every difference.
    """
    is_coarse = name.startswith("import-bag") or name in ("import-zarr", "import-lerobot")
    return Target(name, make, codecs, read_source, weight, COARSE if is_coarse else _NAMES)


_BLANK: Final = Rules(derived=re.compile(r"^\[\d+\]\[0\]$"))
"""Rules of a file in which blank lines are skipped."""

_STATES: Final = Rules(derived=re.compile("phase|grasp"))

_POSED: Final = Rules(derived=re.compile(""))
"""Rules of contacts and joint angles, from which forces and poses are computed."""

TARGETS: Final = (
    _source("import-csv", write_csv, 6.0, (r"\.csv$", (Csv(),))),
    _source("import-npz", write_npz, 3.0, (r"\.npz$", (Npz(), Zip()))),
    _source("import-hdf5", write_hdf5, 1.0, (r"\.h5$", (Hdf5(),))),
    _source("import-parquet", write_parquet, 1.0, (r"\.parquet$", (Parquet(),))),
    _source("import-bag-1", write_bag1, 0.5, (r"\.bag$", (Bag(),))),
    _source("import-bag-mcap", _write_bag2("MCAP"), 0.5, (r"\.mcap$", (Mcap(),))),
    _source("import-bag-sqlite", _write_bag2("SQLITE3"), 0.5, (r"\.db3$", (Sqlite(),))),
    _source("import-lerobot", write_lerobot, 0.5, (r"\.json$", (Json(),)), (r"\.parquet$", (Parquet(),))),
    _source("import-zarr", write_zarr, 0.3, (r"\.zarray$|\.zgroup$", (Json(),))),
    Target("gazebo", write_contacts, ((r"\.csv$", (Csv(),)),), _read_contacts(import_contacts), 0.1, _POSED),
    Target("active", write_active, ((r"\.csv$", (Csv(),)),), _read_contacts(import_active), 0.1, _POSED),
    Target("original-contacts", write_original, ((r"\.csv$", (Csv(),)),), read_original, 8.0, _BLANK),
    Target(
        "rollout",
        write_states,
        ((r"\.npz$", (Npz(), Zip())),),
        read_state_file,
        3.0,
        Rules(derived=re.compile("phase|grasp")),
    ),
    Target("model-map", write_map, ((r"\.toml$", (Toml(),)),), read_map, 8.0, Rules()),
)
