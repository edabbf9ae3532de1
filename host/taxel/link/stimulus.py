"""The emulator's stimulus over time: force or raw count of each taxel, or a scene (poses of an object and the hand).

Format of the stream: firmware/emulator/skin/stimulus.h.
"""

import os
import struct
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from taxel.output import write_whole

Kind = Literal["force", "counts"]
_KINDS: dict[str, int] = {"force": 0, "counts": 1}
_SCENE = 2
POSE_VALUES = 12
"""Number of values of a pose in a scene: the upper three rows of its 4 x 4 matrix."""
HEADER = struct.Struct("<8sIIII")


def make_stimulus_header(taxels: int, kind: Kind = "force") -> bytes:
    """Encode the 24-byte header of a stimulus stream for a skin of `taxels` taxels. kind: meaning of the values."""
    return HEADER.pack(b"TAXELSTM", 1, _KINDS[kind], taxels, 0)


def make_stimulus_records(times_s: ArrayLike, values: ArrayLike) -> bytes:
    """Encode the records of a stimulus: `values` [T, n] (newtons or raw counts) at `times_s` [T] seconds.

    A negative time means the present time of a live emulator. Raises ValueError for shapes that do not fit.
    """
    times = np.asarray(times_s, dtype="<f8")
    table = np.asarray(values, dtype="<f4")
    if times.ndim != 1 or table.ndim != 2 or len(times) != len(table):
        raise ValueError(f"times [T] and values [T, n] do not fit: {times.shape} and {table.shape}")
    records = np.zeros(len(times), dtype=[("time", "<f8"), ("values", "<f4", (table.shape[1],))])
    records["time"] = times
    records["values"] = table
    return records.tobytes()


def write_stimulus(path: str | os.PathLike[str], times_s: ArrayLike, values: ArrayLike, kind: Kind = "force") -> None:
    """Write a stimulus file: `values` [T, n] of the hand's n taxels, in their order, at `times_s` [T], seconds.

    kind: "force", newtons, which the emulator interpolates linearly between records, or "counts", raw counts, which are
    constant until the next record. Raises ValueError for shapes that do not fit, for values that are negative or not
    finite, and for times that decrease.
    """
    times = np.asarray(times_s, dtype=float)
    with np.errstate(over="ignore"):
        table = np.asarray(values, dtype="<f4")
    if times.ndim != 1 or table.ndim != 2 or len(times) != len(table):
        raise ValueError(f"times [T] and values [T, n] do not fit: {times.shape} and {table.shape}")
    if kind not in _KINDS:
        raise ValueError(f"a stimulus kind is one of {', '.join(_KINDS)}; found {kind!r}")
    if not np.all(np.isfinite(table)) or np.any(table < 0.0):
        raise ValueError("a stimulus value is negative or not finite")
    if not np.all(np.isfinite(times)) or (times.size and (np.any(np.diff(times) < 0.0) or times[0] < 0.0)):
        raise ValueError("stimulus times go back, are negative or not finite")
    write_whole(path, make_stimulus_header(table.shape[1], kind) + make_stimulus_records(times, table))


def write_scene(
    path: str | os.PathLike[str],
    taxels: int,
    times_s: ArrayLike,
    objects: ArrayLike,
    object_poses: ArrayLike,
    bracket_poses: ArrayLike,
) -> None:
    """Write a stimulus file of a scene: an object that moves relative to the brackets of a skin of `taxels` taxels.

    times_s: [T], seconds. objects: [T], number of the object in the world file, -1 for no object. object_poses:
    [T, 4, 4], pose of the object in the world. bracket_poses: [T, b, 4, 4], pose of the bracket of each of the b boards
    in the world, in the order of the world file. The emulator interpolates the compression of the layer linearly
    between records. Raises ValueError for shapes that do not fit, for numbers that are not finite, and for times that
    decrease.
    """
    times, number = np.asarray(times_s, dtype=float), np.asarray(objects)
    poses = np.concatenate([np.asarray(object_poses)[:, None], np.asarray(bracket_poses)], axis=1)
    if poses.ndim != 4 or poses.shape[2:] != (4, 4) or not len(times) == len(number) == len(poses):
        raise ValueError(f"scene: {times.shape} times, {number.shape} objects and {poses.shape} poses do not fit")
    if not (np.all(np.isfinite(poses)) and np.all(np.isfinite(times))):
        raise ValueError("scene: a pose or a time is not finite")
    if times.size and (np.any(np.diff(times) < 0.0) or times[0] < 0.0):
        raise ValueError("scene: times go back or are negative")
    header = HEADER.pack(b"TAXELSTM", 1, _SCENE, taxels, poses.shape[1] - 1)
    # The last row of a pose is always 0 0 0 1, so only the first three rows are written.
    rows = poses[:, :, :3, :].reshape(len(times), POSE_VALUES * poses.shape[1])
    write_whole(path, header + make_stimulus_records(times, np.column_stack([number, rows])))
