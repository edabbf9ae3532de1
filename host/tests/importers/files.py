"""Small files of the documented layouts, written by the tests of the importers."""

import json
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

FRAMES = 40


def make_time(frames=FRAMES, rate_hz=50.0):
    """Return the times of the frames, seconds."""
    return np.arange(frames) / rate_hz


def make_values(*shape, frames=FRAMES):
    """Make values f64[frames, *shape], all different.

    The values of the first half of the frames are halved: without contact.
    """
    values = np.arange(frames * int(np.prod(shape)), dtype=np.float64).reshape(frames, *shape) * 0.25
    values[: frames // 2] *= 0.5
    return values


def write_csv(path: Path, columns: dict, header=True):
    """Write a CSV table of columns (numbers or strings by name), and return its path."""
    rows = [",".join(columns)] if header else []
    rows += [",".join(str(entry) for entry in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join(rows) + "\n")
    return path


def number_columns(prefix, values, first=0):
    """Return the columns of a matrix by name: the prefix and a number from `first` on."""
    return {f"{prefix}{index + first}": column for index, column in enumerate(np.asarray(values).T)}


def write_lerobot(folder: Path, version: str, episodes: list[np.ndarray], tasks=("pick", "place")):
    """Write a LeRobotDataset with the feature observation.tactile, and return its folder.

    version: "v2..." (one file for each episode) or "v3..." (one file). episodes: values [T frames, k taxels]. tasks:
    names; the episodes have them in turn.
    """
    (folder / "meta").mkdir(parents=True)
    (folder / "data/chunk-000").mkdir(parents=True)
    is_v2 = version.startswith("v2")
    name = "episode_{episode_index:06d}" if is_v2 else "file-{file_index:03d}"
    info = {"codebase_version": version, "fps": 50, "data_path": f"data/chunk-{{chunk:03d}}/{name}.parquet"}
    (folder / "meta/info.json").write_text(json.dumps(info))
    tables = []
    for number, values in enumerate(episodes):
        frames = len(values)
        tactile = pyarrow.FixedSizeListArray.from_arrays(values.astype(np.float32).ravel(), values.shape[1])
        columns = {
            "observation.tactile": tactile,
            "timestamp": make_time(frames).astype(np.float32),
            "frame_index": np.arange(frames),
            "episode_index": np.full(frames, number),
            "index": np.arange(frames),
            "task_index": np.full(frames, number % len(tasks)),
        }
        tables.append(pyarrow.table(columns))
    if is_v2:
        for number, table in enumerate(tables):
            pyarrow.parquet.write_table(table, folder / f"data/chunk-000/episode_{number:06d}.parquet")
        lines = [json.dumps({"task_index": number, "task": task}) for number, task in enumerate(tasks)]
        (folder / "meta/tasks.jsonl").write_text("\n".join(lines))
    else:
        pyarrow.parquet.write_table(pyarrow.concat_tables(tables), folder / "data/chunk-000/file-000.parquet")
        names = pyarrow.table({"task_index": np.arange(len(tasks)), "__index_level_0__": list(tasks)})
        pyarrow.parquet.write_table(names, folder / "meta/tasks.parquet")
    return folder


PAD_TEXT = "std_msgs/Header header\nthird_party/Pad[2] pads\nstring label\n"
PAD_TYPES = {"third_party/msg/Pad": "uint16[4] values\n", "third_party/msg/Tactile": PAD_TEXT}


def _make_store(store):
    """Return a ROS type store with a third-party message type: two pads of four values each."""
    typestore = get_typestore(store)
    types = {}
    for name, text in PAD_TYPES.items():
        types |= get_types_from_msg(text, name)
    typestore.register(types)
    return typestore


def _make_message(typestore, values, time_ns, has_sequence):
    """Make a third-party message with 8 values. has_sequence: its ROS 1 header has a sequence number."""
    types = typestore.types
    stamp = types["builtin_interfaces/msg/Time"](sec=time_ns // 10**9, nanosec=time_ns % 10**9)
    arguments = {"stamp": stamp, "frame_id": "pad"} | ({"seq": 0} if has_sequence else {})
    pads = [types["third_party/msg/Pad"](values=values[half : half + 4].astype(np.uint16)) for half in (0, 4)]
    header = types["std_msgs/msg/Header"](**arguments)
    return types["third_party/msg/Tactile"](header=header, pads=pads, label="grasp")


START_NS = 1_700_000_000_000_000_001


def write_bag2(path: Path, values, storage=StoragePlugin.MCAP, step_ns=20_000_000):
    """Write a ROS 2 bag with the topic /tactile, and return its folder. values: [T frames, 8]."""
    typestore = _make_store(Stores.ROS2_HUMBLE)
    with Writer2(path, version=9, storage_plugin=storage) as writer:
        connection = writer.add_connection("/tactile", "third_party/msg/Tactile", typestore=typestore)
        for number, row in enumerate(values):
            time_ns = START_NS + number * step_ns
            message = _make_message(typestore, row, time_ns, has_sequence=False)
            writer.write(connection, time_ns + 5, typestore.serialize_cdr(message, connection.msgtype))
    return path


def write_bag1(path: Path, values, step_ns=20_000_000):
    """Write a ROS 1 bag with the topic /tactile, and return its path. values: [T frames, 8]."""
    typestore = _make_store(Stores.ROS1_NOETIC)
    with Writer1(path) as writer:
        connection = writer.add_connection("/tactile", "third_party/msg/Tactile", typestore=typestore)
        for number, row in enumerate(values):
            time_ns = START_NS + number * step_ns
            message = _make_message(typestore, row, time_ns, has_sequence=True)
            writer.write(connection, time_ns + 5, bytes(typestore.serialize_ros1(message, connection.msgtype)))
    return path


def write_map(path: Path, text: str):
    """Write a mapping file with the required first lines and `text`, and return its path."""
    path.write_text(f'format = "taxel-import-map"\nversion = 1\nsource = "real"\n{text}')
    return path
