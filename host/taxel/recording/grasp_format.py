"""The grasp dataset, version 1, as tables: HDF5 path, type and shape of each array.

Each array of the format page (docs: grasp dataset) has one entry. The reader, the writer and the importer of plain
arrays check against these entries. Axes are letters: n taxels, s sensors, T frames, v vertices, f faces, j joints.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from taxel.grasp.timeline import Phase as Phase

FORMAT = "taxel-grasp-dataset"
VERSION = 1

REAL = "real"
SIM = "sim"
LAYERS = ("uncoupled", "coupled")

BASELINE_FRAMES = 100
"""Number of valid phase-0 frames that the baseline averages (format page, "What counts as active")."""

ACTIVE_SIGNAL_COUNTS = 150.0
"""A taxel is active when its signal exceeds this value, counts (format page, "What counts as active")."""


LARGEST_AXIS: Mapping[str, int] = {
    "n": 2**20,
    "s": 256,  # an address is one byte
    "T": 10**7,
    "v": 2**24,
    "f": 2**24,
    "j": 2**12,
}
"""Largest number of elements along an axis. The limit bounds the memory that a damaged file can use."""

LARGEST_ARRAY_BYTES = 2**32
"""Largest size of one array in memory and of one chunk in the file, bytes."""

LONGEST_TEXT = 1000
"""Largest number of characters of a name or another text."""

STRING = "str"


@dataclass(frozen=True)
class ArraySpec:
    """Specification of one array of the grasp dataset format.

    dtype: NumPy type in memory ("u1", "u2", "i4", "f8", "?") or STRING. axes: letters and fixed lengths, such as ("n",
    3). required: False if the array is optional. sim_only: True if only a file with source "sim" may contain the array.
    """

    dtype: str
    axes: tuple[str | int, ...]
    required: bool = True
    sim_only: bool = False


TAXELS: Mapping[str, ArraySpec] = {
    "sensor": ArraySpec("u1", ("n",)),
    "tx": ArraySpec("u1", ("n",)),
    "rx": ArraySpec("u1", ("n",)),
    "position": ArraySpec("f8", ("n", 3)),
    "normal": ArraySpec("f8", ("n", 3)),
    "size": ArraySpec("f8", ("n",)),
}

SENSORS: Mapping[str, ArraySpec] = {
    "address": ArraySpec("u1", ("s",)),
    "name": ArraySpec(STRING, ("s",)),
    "kind": ArraySpec(STRING, ("s",)),
    "rate_hz": ArraySpec("f8", ("s",)),
}

MESH: Mapping[str, ArraySpec] = {
    "vertices": ArraySpec("f8", ("v", 3)),
    "faces": ArraySpec("i4", ("f", 3)),
}

GRASP: Mapping[str, ArraySpec] = {
    "timestamp": ArraySpec("f8", ("T",)),
    "phase": ArraySpec("u1", ("T",)),
    "raw_counts": ArraySpec("u2", ("T", "n")),
    "valid": ArraySpec("?", ("T", "s")),
    "sensor_pose": ArraySpec("f8", ("s", 4, 4)),
    "object_pose": ArraySpec("f8", (4, 4)),
    "sensor_time": ArraySpec("f8", ("T", "s"), required=False),
    "sensor_pose_t": ArraySpec("f8", ("T", "s", 4, 4), required=False),
    "joint_position": ArraySpec("f8", ("T", "j"), required=False),
    "contact_force": ArraySpec("f8", ("T", "n"), sim_only=True),
    "separation": ArraySpec("f8", ("T", "n"), sim_only=True),
    "distance": ArraySpec("f8", ("T", "n"), required=False, sim_only=True),
}

ROOT_ATTRIBUTES = ("source", "hand", "created", "generator")
GRASP_ATTRIBUTES = ("object", "approach", "iteration", "session")
OPTIONAL_GRASP_ATTRIBUTES = ("attempts", "failure")
NO_FAILURE = "none"
"""Attribute `failure` of a grasp that was checked and is successful."""


def is_required(spec: ArraySpec, source: str) -> bool:
    """Whether a dataset must contain the array that `spec` describes; source: "real" or "sim"."""
    return spec.required and (source == SIM or not spec.sim_only)
