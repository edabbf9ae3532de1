"""Targets: recordings of a skin in all formats, and files of joint angles."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from fuzz_files.array_codecs import Parquet
from fuzz_files.binary_codecs import Bag, Capture, Mcap
from fuzz_files.document import Flat, flatten
from fuzz_files.pcapng_codec import Pcapng
from fuzz_files.target import COARSE, Rules, Target
from fuzz_files.text_codecs import Csv, Json
from taxel.hand import load_hand
from taxel.hand.joint_history import read_joint_file
from taxel.link import CaptureError
from taxel.link.capture import CaptureWriter
from taxel.recording.formats import convert, open_recording
from taxel.recording.formats.recorded_joints import load_recorded_joints
from taxel.skin import Skin
from taxel.stream import TaxelFrame
from taxel.stream.encoder import FramesLink
from taxel.twin.schedule import COLUMNS as CONTACT_COLUMNS
from taxel.twin.schedule import read_schedule
from taxel.twin.simulated.object_history import COLUMNS as OBJECT_COLUMNS
from taxel.twin.simulated.object_history import read_object_poses

HAND: Final = "flat8"
JOINTS: Final = ("one", "two", "three")
_CYCLES: Final = 12
_CYCLE_S: Final = 0.02


def make_frames() -> list[TaxelFrame]:
    """Create the frames of all boards of the hand, with different counts in each taxel."""
    random = np.random.default_rng(7)
    frames = []
    for cycle in range(_CYCLES):
        for board in load_hand(HAND).boards:
            counts = random.integers(20_000, 40_000, board.kind.taxel_count).astype(np.uint16)
            time_s = 1.0 + _CYCLE_S * cycle
            frame = TaxelFrame(
                address=board.address,
                cycle=cycle,
                sequence=100 + cycle,
                time_s=time_s,
                board_time_us=1000 * cycle,
                hub_time_us=2000 * cycle,
                raw_counts=counts,
            )
            frames.append(frame)
    return frames


def write_capture(folder: Path) -> str:
    """Write a capture of all frames and return its name; the header has all fields that readers use."""
    header: dict[str, object] = {
        "source": "fuzz", "url": "fuzz:", "hand": HAND, "baud": 1e6, "clock": "host", "epoch_offset_ns": 10**18,
        "created": "2026-01-31T09:30:00+00:00", "taxel_version": "0.1",
    }  # fmt: skip
    link = FramesLink("fuzz", make_frames())
    with CaptureWriter(folder / "a.bin", header) as writer:
        try:
            while True:
                chunk = link.read()
                if chunk is not None:
                    writer.write(chunk.data, chunk.arrival_ns)
        except EOFError:
            pass
    return "a.bin"


def _convert(name: str) -> Callable[[Path], str]:
    """Return a function that writes the capture as the file `name`, whose suffix selects the format."""

    def make(folder: Path) -> str:
        """Write the recording and return its name."""
        write_capture(folder)
        convert(folder / "a.bin", folder / name)
        (folder / "a.bin").unlink()
        return name

    return make


def read_frames(path: Path) -> Flat:
    """Read the frames of a recording, as strings that contain all their data except the time.

    The frames before a damage are returned with the error under the key "reported".
    """
    link, hand = open_recording(path)
    frames: list[str] = []
    with Skin(link, hand) as skin:
        try:
            for frame in skin:
                values = (frame.address, frame.cycle, frame.sequence, frame.board_time_us)
                frames.append(f"{values} {frame.raw_counts.tobytes().hex()}")
        except CaptureError as error:
            if not frames:
                raise
            return {"frames": frames, "reported": str(error)}
    return {"frames": frames}


def read_table(path: Path) -> Flat:
    """Read the frames of a table (CSV or Parquet) with all their values, and check the joint angles.

    Unlike `read_frames` it does not encode the frames as a stream first. Raises CaptureError for a table without
    frames.
    """
    link, hand = open_recording(path)
    try:
        frames = [{**frame._asdict()} for frame in link._frames]  # type: ignore[attr-defined] # of FramesLink
        load_recorded_joints(path, "parquet" if path.suffix == ".parquet" else "csv", hand)
    finally:
        link.close()
    if not frames:
        raise CaptureError(str(path), "has no frames")
    return flatten({"frames": frames, "hand": hand.name})


def write_original_bag(folder: Path) -> str:
    """Write a ROS 1 bag with the topics of the original stack and return its name."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg("float32[] data\nuint32 timestamp\nuint8 sensor_num\n", "a/msg/TactileData"))
    with Writer(folder / "a.bag") as writer:
        connection = writer.add_connection("/sensor_8_readings", "a/msg/TactileData", typestore=store)
        count = next(board.kind.taxel_count for board in load_hand("original").boards if board.address == 8)
        for number in range(10):
            counts = np.arange(count, dtype=np.float32) + 30_000 + number
            message: Any = store.types["a/msg/TactileData"](counts, 100 * number, 8)
            writer.write(connection, 10**18 + 10**8 * number, store.serialize_ros1(message, "a/msg/TactileData"))
    return "a.bag"


def write_joints(folder: Path) -> str:
    """Write a file of joint angles and return its name."""
    with (folder / "joints.csv").open("w", newline="") as file:
        rows = [[0.1 * number, *(0.01 * number + 0.001 * joint for joint in range(3))] for number in range(8)]
        csv.writer(file).writerows([["time_s", *JOINTS], *rows])
    return "joints.csv"


def read_joints(path: Path) -> Flat:
    """Read the samples of a file of joint angles."""
    history = read_joint_file(path, JOINTS)
    return {"time": np.array(history._times), "angles": np.array(history._angles)}


def write_object_poses(folder: Path) -> str:
    """Write a file of an object's poses and return its name."""
    with (folder / "object.csv").open("w", newline="") as file:
        rows = [[0.1 * number, 0.5, 0.01 * number, 0.2, 1.0, 0.0, 0.0, 0.0] for number in range(8)]
        csv.writer(file).writerows([OBJECT_COLUMNS, *rows])
    return "object.csv"


def read_objects(path: Path) -> Flat:
    """Read the samples of a file of an object's poses."""
    history = read_object_poses(path)
    return {"time": np.array(history._times), "poses": np.array(history._poses)}


def write_contacts(folder: Path) -> str:
    """Write a file of announced contacts and return its name."""
    with (folder / "contacts.csv").open("w", newline="") as file:
        rows = [[*(8.0 * number + 0.5 * part for part in range(5)), "peg", f"press_{number}"] for number in range(8)]
        csv.writer(file).writerows([CONTACT_COLUMNS, *rows])
    return "contacts.csv"


def read_contacts(path: Path) -> Flat:
    """Read times and conditions of a file of announced contacts."""
    contacts = list(read_schedule(path))
    return {
        "times": np.array([contact.times_s for contact in contacts]),
        "conditions": np.array([contact.condition for contact in contacts]),
    }


_FRAMES: Final = Rules(subset="frames")
_TABLE: Final = Rules(
    unused=re.compile(
        r"^(?!\[\d+\]\[|columns\.)|^\[0\]\[|^\[\d+\]\[0\]$|^columns\.(?!(?:time_s|address|sequence|cycle|board_time_us|hub_time_us|raw_counts)(?:$|\[|#))"
    ),
    derived=re.compile(r"#$|^columns\.joint"),
)

TARGETS: Final = (
    Target("capture", write_capture, ((r"\.bin$", (Capture(),)),), read_frames, 4.0, _FRAMES),
    Target("pcapng", _convert("a.pcapng"), ((r"\.pcapng$", (Pcapng(),)),), read_frames, 2.0, _FRAMES),
    Target("mcap", _convert("a.mcap"), ((r"\.mcap$", (Mcap(),)),), read_frames, 1.0, _FRAMES),
    Target(
        "csv",
        _convert("a.csv"),
        ((r"\.json$", (Json(),)), (r"\.csv$", (Csv(),))),
        read_table,
        2.0,
        _TABLE,
        mutable=r"^a.csv/(?!active)",
    ),
    Target("parquet", _convert("a.parquet"), ((r"\.parquet$", (Parquet(),)),), read_table, 1.0, _TABLE),
    Target("original-bag", write_original_bag, ((r"\.bag$", (Bag(),)),), read_frames, 1.0, COARSE),
    Target(
        "object-poses",
        write_object_poses,
        ((r"\.csv$", (Csv(),)),),
        read_objects,
        8.0,
        Rules(derived=re.compile(r"^\[\d+\]\[")),
    ),
    Target(
        "contacts",
        write_contacts,
        ((r"\.csv$", (Csv(),)),),
        read_contacts,
        8.0,
        Rules(derived=re.compile("")),  # the reader sorts the rows, so that a value may appear in another place
    ),
    Target("joints", write_joints, ((r"\.csv$", (Csv(),)),), read_joints, 8.0, Rules(derived=re.compile(r"^\[0\]\["))),
)
