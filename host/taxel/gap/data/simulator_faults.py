"""Faulty grasps of a simulated dataset: they are found before the comparison, left out, and reported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from taxel.gap.data.readable import ReadableGrasp
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import Phase
from taxel.recording.grasp_invariants import InvariantChecker

MAX_FAULTY_SHARE: Final = 0.2
"""Largest share of grasps that are left out. More faults than that are a property of the simulator, not accidents."""

CONTACT_LEFT_SHARE: Final = 0.1
"""Share of the force of the hold above which the recovery, which the format defines to be free of contact, has contact.
"""

LEFT_OUT, KEPT = "left out", "kept, because most grasps are affected"

Key = tuple[str, str]


@dataclass(frozen=True)
class SimulatorFault:
    """A fault of one simulated grasp. frames: first and last one. problem: words. handled: what was done."""

    grasp: str
    frames: tuple[int, int]
    problem: str
    handled: str = LEFT_OUT

    def to_json(self) -> dict[str, Any]:
        """For the report."""
        return {
            "file": "sim",
            "grasp": self.grasp,
            "frames": list(self.frames),
            "problem": self.problem,
            "handled": self.handled,
        }


def find_faults(data: GraspDataset) -> list[SimulatorFault]:
    """Find the simulated grasps that violate physics (`taxel.recording.grasp_invariants`), stop, or lack the object.

    Returns one fault for each grasp. A dataset without contact forces has none. A grasp without any force in the hold
    lacks the object if other grasps of the condition have force, or if every other condition has force.
    """
    checker = InvariantChecker(data)
    found: dict[str, SimulatorFault] = {}
    holds: dict[Key, dict[str, float]] = {}
    last_frame: dict[str, int] = {}
    for grasp in data:  # one grasp at a time is in memory
        if grasp.contact_force is None:
            return []
        total = grasp.contact_force.sum(axis=1)
        last_frame[grasp.id] = len(total) - 1
        hold = grasp.phase == Phase.HOLD
        held = float(np.median(total[hold])) if hold.any() else 0.0
        holds.setdefault((grasp.object, grasp.approach), {})[grasp.id] = held
        violations = [one for one in checker.check_grasp(grasp) if one.kind != "not at rest"]
        after = np.flatnonzero(grasp.phase == Phase.RECOVERY)
        if violations:
            frames = [one.frame for one in violations]
            problem = f"{violations[0].kind}: {violations[0].text}"
            found[grasp.id] = SimulatorFault(grasp.id, (min(frames), max(frames)), problem)
        elif len(after) and held > 0.0 and float(np.median(total[after])) > CONTACT_LEFT_SHARE * held:
            problem = "contact in the recovery, after the release"
            found[grasp.id] = SimulatorFault(grasp.id, (int(after[0]), int(after[-1])), problem)
    missing = "no contact in the hold: the object is missing"
    for name in _list_empty(holds):
        found.setdefault(name, SimulatorFault(name, (0, last_frame[name]), missing))
    if len(found) > MAX_FAULTY_SHARE * len(last_frame):
        return [SimulatorFault(one.grasp, one.frames, one.problem, KEPT) for one in found.values()]
    return list(found.values())


def _list_empty(holds: Mapping[Key, Mapping[str, float]]) -> list[str]:
    """Grasps without force in the hold, where force is expected."""
    with_force = {key for key, own in holds.items() if any(held > 0.0 for held in own.values())}
    every = len(with_force) >= len(holds) - 1
    return [
        name
        for key, own in holds.items()
        if key in with_force or (every and with_force)
        for name, held in own.items()
        if held <= 0.0
    ]


def without_faults(grasps: Sequence[ReadableGrasp], faults: Sequence[SimulatorFault]) -> list[ReadableGrasp]:
    """The grasps that are not left out."""
    out = {one.grasp for one in faults if one.handled == LEFT_OUT}
    return [grasp for grasp in grasps if grasp.id not in out]
