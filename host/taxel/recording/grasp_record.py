"""One grasp in memory, as a recorder or a simulator passes it to the writer."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.recording.grasp_checks import (
    Location,
    check_array,
    check_content,
    check_integer,
    check_outcome,
    check_text,
)
from taxel.recording.grasp_format import GRASP, OPTIONAL_GRASP_ATTRIBUTES, SIM, is_required
from taxel.types import BoolArray, ByteArray, CountArray, FloatArray


@dataclass(frozen=True, eq=False)
class GraspRecord:
    """One grasp to be written to a dataset; fields, shapes and units as those of `Grasp`.

    A field that is None is not written. A frame whose sensor did not answer is invalid, and its raw_counts repeat the
    last counts (0 before the first). attempts, failure: the outcome of the grasp, as in `Grasp`.
    """

    object: str
    approach: str
    iteration: int
    session: int
    timestamp: FloatArray
    phase: ByteArray
    raw_counts: CountArray
    valid: BoolArray
    sensor_pose: FloatArray
    object_pose: FloatArray
    sensor_time: FloatArray | None = None
    sensor_pose_t: FloatArray | None = None
    joint_position: FloatArray | None = None
    contact_force: FloatArray | None = None
    separation: FloatArray | None = None
    distance: FloatArray | None = None
    attempts: int | None = None
    failure: str | None = None


def check_attributes(record: GraspRecord, objects: Collection[str], location: Location) -> dict[str, Any]:
    """Return the attributes of a grasp's HDF5 group; raises DatasetError for the first error.

    objects: names of the objects in the dataset.
    """
    name = check_text(record.object, location.key("object"))
    if name not in objects:
        location.key("object").fail("a name in /objects", format_value(name), "add that object or correct the name")
    outcome = check_outcome(record.attempts, record.failure, location)
    return {
        "object": name,
        "approach": check_text(record.approach, location.key("approach")),
        "iteration": check_integer(record.iteration, location.key("iteration")),
        "session": check_integer(record.session, location.key("session")),
        **{key: value for key, value in zip(OPTIONAL_GRASP_ATTRIBUTES, outcome, strict=True) if value is not None},
    }


def check_arrays(
    record: GraspRecord, source: str, sizes: Mapping[str, int], location: Location
) -> dict[str, NDArray[Any]]:
    """Return the arrays of a grasp to write, in the types of the format; raises DatasetError for the first error.

    source: "real" or "sim". sizes: numbers n of taxels and s of sensors.
    """
    lengths = dict(sizes)
    arrays = {}
    for name, spec in GRASP.items():
        value, array_location = getattr(record, name), location.key(name)
        if value is None:
            if is_required(spec, source):
                array_location.fail("a dataset", "nothing", "add it")
            continue
        if spec.sim_only and source != SIM:
            array_location.fail('no such array where source = "real"', "one", "leave it out or correct the source")
        arrays[name] = check_array(value, spec, lengths, array_location)
        check_content(name, arrays[name], array_location)
    return arrays
