"""A campaign in the simulator: every grasp of the plan on its own, on all cores, to sim.h5."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from taxel.campaign.processes import in_processes
from taxel.campaign.progress import Progress, silent
from taxel.campaign.scatter import Scatter, balanced_draw
from taxel.campaign.setup import WRIST_LINK, Setup
from taxel.campaign.store import begin_or_extend
from taxel.grasp.plan import PlannedGrasp
from taxel.grasp.timeline import Phase, Timeline
from taxel.recording.grasp_record import GraspRecord
from taxel.sim.closing import RATE_HZ, simulate_grasp
from taxel.sim.scene import Scene, build_scene
from taxel.sim.sensing import Sensing, sense
from taxel.sim.sensor_model import SimSensor

CHUNK = 2
"""Grasps that a process takes at a time."""

_STREAM = 3


@dataclass(frozen=True)
class SimSettings:
    """A campaign in the simulator.

    sensing: how contact becomes force on taxels (`taxel.sim.sensing`). scatter: of object and grip, from repeat to
    repeat, as far as repeats on the hand have told it; `taxel.campaign.scatter.balanced_draw` goes through it. Nobody
    tells the simulator how the skin is mounted.
    """

    seed: int = 1
    scatter: Scatter = field(default_factory=Scatter)
    sensing: Sensing = field(default_factory=Sensing)
    sensor: SimSensor = field(default_factory=SimSensor)
    timeline: Timeline = field(default_factory=Timeline)

    def describe(self) -> str:
        """One line for the dataset's generator."""
        key = hashlib.sha256(repr(self).encode()).hexdigest()[:12]
        return f"simulator, {self.sensing.level} sensing, settings {key}"


def run_simulated(
    path: str | os.PathLike[str],
    plan: Sequence[PlannedGrasp],
    settings: SimSettings,
    setup: Setup | None = None,
    jobs: int | None = None,
    overwrite: bool = False,
    resume: bool = False,
    progress: Progress = silent,
) -> None:
    """Simulate the grasps of `plan` and write them to `path`; arguments as those of `run_emulated`."""
    setup = setup or Setup()
    sensing = settings.sensing
    model = settings.sensor.told(sensing.stiffness_n_per_m, "coupled" if sensing.level == "coupled" else "uncoupled")
    with begin_or_extend(path, "sim", setup, RATE_HZ, settings.describe(), overwrite, resume, model) as out:
        finished = set(out.ids)
        missing = [planned for planned in plan if planned.id not in finished]
        done = len(plan) - len(missing)
        progress(done, len(plan))
        records = in_processes(simulate_planned, setup, missing, settings, jobs, CHUNK)
        for planned, record in zip(missing, records, strict=True):
            out.add(record, planned.id)
            done += 1
            progress(done, len(plan))


@lru_cache(maxsize=8)  # it keeps setups alive
def _scene(setup: Setup, name: str) -> Scene:
    return build_scene(setup.hand, setup.objects[name], WRIST_LINK)


def simulate_planned(setup: Setup, planned: PlannedGrasp, settings: SimSettings) -> GraspRecord:
    """One grasp of the plan. Its noise depends on the seed and the grasp alone."""
    rng = np.random.default_rng([settings.seed, _STREAM, *planned.id.encode()])
    where, item = setup.object_pose(planned.object), setup.objects[planned.object]
    law = settings.sensing.law if settings.sensing.level == "layer" else None
    scene, approach = _scene(setup, planned.object), setup.approach(planned)
    name = f"{planned.object} {planned.approach}"
    scatter = settings.scatter.of(planned.object)
    offset, grip = scatter.moved(balanced_draw(settings.seed, name, planned.iteration))
    motion = simulate_grasp(scene, approach, settings.timeline, RATE_HZ, offset, grip, object_pose=where, law=law)
    sensed = sense(setup.hand, item.shape, motion, settings.sensing)
    hold = motion.phase == Phase.HOLD
    middle = int(np.flatnonzero(hold)[hold.sum() // 2]) if hold.any() else len(hold) - 1
    arm = setup.arm_angles(planned, settings.timeline, motion.time_s)
    return GraspRecord(
        object=planned.object,
        approach=planned.approach,
        iteration=planned.iteration,
        session=planned.session,
        timestamp=motion.time_s,
        phase=motion.phase,
        raw_counts=settings.sensor.raw_counts(setup.hand, sensed.contact_force, rng),
        valid=np.ones((len(motion.time_s), len(setup.hand.boards)), bool),
        sensor_pose=motion.sensor_poses[middle],
        object_pose=where,
        joint_position=np.hstack([arm, motion.joint_angles]),
        contact_force=sensed.contact_force,
        separation=sensed.separation,
    )
