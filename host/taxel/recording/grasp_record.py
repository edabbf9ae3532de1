"""One grasp in memory, as a recorder or a simulator hands it to the writer."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.recording.grasp_checks import Place, check_content, check_integer, check_text, given
from taxel.recording.grasp_format import GRASP, SIM, needs


@dataclass(frozen=True, eq=False)
class GraspRecord:
    """One grasp; fields, shapes and units as those of `Grasp`. What is None is not written.

    A frame whose sensor did not answer is not valid, and its raw_counts repeat the last ones (0 before the first).
    """

    object: str
    approach: str
    iteration: int
    session: int
    timestamp: NDArray[np.float64]
    phase: NDArray[np.uint8]
    raw_counts: NDArray[np.uint16]
    valid: NDArray[np.bool_]
    sensor_pose: NDArray[np.float64]
    object_pose: NDArray[np.float64]
    sensor_time: NDArray[np.float64] | None = None
    sensor_pose_t: NDArray[np.float64] | None = None
    joint_position: NDArray[np.float64] | None = None
    contact_force: NDArray[np.float64] | None = None
    separation: NDArray[np.float64] | None = None
    distance: NDArray[np.float64] | None = None


def checked_attributes(record: GraspRecord, objects: Collection[str], place: Place) -> dict[str, Any]:
    """The four attributes of a grasp's group; raises DatasetError for the first mistake."""
    name = check_text(record.object, place.key("object"))
    if name not in objects:
        place.key("object").fail("a name that /objects has", format_value(name), "add that object or correct the name")
    return {
        "object": name,
        "approach": check_text(record.approach, place.key("approach")),
        "iteration": check_integer(record.iteration, place.key("iteration")),
        "session": check_integer(record.session, place.key("session")),
    }


def checked_arrays(record: GraspRecord, source: str, sizes: Mapping[str, int], place: Place) -> dict[str, NDArray[Any]]:
    """The arrays to write, in their documented types; raises DatasetError for the first mistake.

    sizes: of the axes n and s.
    """
    known = dict(sizes)
    arrays = {}
    for name, spec in GRASP.items():
        value, here = getattr(record, name), place.key(name)
        if value is None:
            if needs(spec, source):
                here.fail("a dataset", "nothing", "add it")
            continue
        if spec.sim_only and source != SIM:
            here.fail('no such array where source = "real"', "one", "leave it out or correct the source")
        arrays[name] = given(value, spec, known, here)
        check_content(name, arrays[name], here)
    return arrays
