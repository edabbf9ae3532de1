"""Faulty grasps of a simulated dataset, which are excluded from the comparison and reported."""

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
"""Largest share of faulty grasps that are excluded. A larger share is a property of the simulator: all grasps are then
kept, and the faults are only reported."""

MAX_RECOVERY_FORCE_SHARE: Final = 0.1
"""Ratio of the median force in recovery to the median force in hold above which a grasp is faulty. The format defines
the recovery as free of contact."""

HANDLING_EXCLUDED, HANDLING_KEPT = "left out", "kept, because most grasps are affected"
"""Texts of the report on the treatment of a faulty grasp."""

ConditionKey = tuple[str, str]
"""Object and approach of a condition."""


@dataclass(frozen=True)
class SimulatorFault:
    """A fault of one simulated grasp.

    grasp: name of the grasp. frames: first and last faulty frame. problem: description for the report. handled:
    treatment of the grasp, `HANDLING_EXCLUDED` or `HANDLING_KEPT`.
    """

    grasp: str
    frames: tuple[int, int]
    problem: str
    handled: str = HANDLING_EXCLUDED

    def to_json(self) -> dict[str, Any]:
        """Return the entry of the report."""
        return {
            "file": "sim",
            "grasp": self.grasp,
            "frames": list(self.frames),
            "problem": self.problem,
            "handled": self.handled,
        }


def find_faults(data: GraspDataset) -> list[SimulatorFault]:
    """Return one fault for each faulty grasp of a simulated dataset; an empty list for a dataset without contact
    forces.

    A grasp is faulty if it violates physics (`taxel.recording.grasp_invariants`), if contact remains in the recovery,
    or if the object is missing. The object of a grasp without force in the hold is missing if other grasps of the
    condition have force, or if every other condition has force. If more than the share `MAX_FAULTY_SHARE` of all grasps
    is faulty, the faults state that the grasps are kept (`HANDLING_KEPT`).
    """
    checker = InvariantChecker(data)
    faults: dict[str, SimulatorFault] = {}
    holds: dict[ConditionKey, dict[str, float]] = {}
    last_frame: dict[str, int] = {}
    for grasp in data:  # one grasp at a time is in memory
        if grasp.contact_force is None:
            return []
        total = grasp.contact_force.sum(axis=1)
        last_frame[grasp.id] = len(total) - 1
        hold = grasp.phase == Phase.HOLD
        hold_force = float(np.median(total[hold])) if hold.any() else 0.0
        holds.setdefault((grasp.object, grasp.approach), {})[grasp.id] = hold_force
        # A force that changes during the hold ("not at rest") does not make a grasp faulty.
        violations = [one for one in checker.check_grasp(grasp) if one.kind != "not at rest"]
        after = np.flatnonzero(grasp.phase == Phase.RECOVERY)
        if violations:
            frames = [one.frame for one in violations]
            problem = f"{violations[0].kind}: {violations[0].text}"
            faults[grasp.id] = SimulatorFault(grasp.id, (min(frames), max(frames)), problem)
        elif len(after) and hold_force > 0.0 and float(np.median(total[after])) > MAX_RECOVERY_FORCE_SHARE * hold_force:
            problem = "contact in the recovery, after the release"
            faults[grasp.id] = SimulatorFault(grasp.id, (int(after[0]), int(after[-1])), problem)
    missing = "no contact in the hold: the object is missing"
    for name in _list_missing_objects(holds):
        faults.setdefault(name, SimulatorFault(name, (0, last_frame[name]), missing))
    if len(faults) > MAX_FAULTY_SHARE * len(last_frame):
        return [SimulatorFault(one.grasp, one.frames, one.problem, HANDLING_KEPT) for one in faults.values()]
    return list(faults.values())


def _list_missing_objects(holds: Mapping[ConditionKey, Mapping[str, float]]) -> list[str]:
    """Return the names of the grasps without force in the hold in which force is expected: another grasp of the same
    condition has force, or every other condition has force.

    holds: for each condition, the median total force in hold of each grasp, newtons.
    """
    with_force = {key for key, forces in holds.items() if any(force > 0.0 for force in forces.values())}
    has_every_other_force = len(with_force) >= len(holds) - 1
    return [
        name
        for key, forces in holds.items()
        if key in with_force or (has_every_other_force and with_force)
        for name, force in forces.items()
        if force <= 0.0
    ]


def exclude_faulty_grasps(grasps: Sequence[ReadableGrasp], faults: Sequence[SimulatorFault]) -> list[ReadableGrasp]:
    """Return the grasps without those that are excluded because of a fault."""
    excluded = {one.grasp for one in faults if one.handled == HANDLING_EXCLUDED}
    return [grasp for grasp in grasps if grasp.id not in excluded]
