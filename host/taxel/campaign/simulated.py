"""A grasp campaign in the simulator: every grasp is simulated independently, in parallel."""

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.attempts import MAX_ATTEMPTS, Attempt, perform_attempts
from taxel.campaign.failure import Failure, make_grasp_check
from taxel.campaign.processes import map_in_processes
from taxel.campaign.progress import Progress, no_progress
from taxel.campaign.setup import WRIST_LINK, Setup
from taxel.campaign.store import open_campaign_writer
from taxel.campaign.variation import Variation, sample_balanced_variation
from taxel.grasp.plan import PlannedGrasp
from taxel.grasp.timeline import Phase, Timeline
from taxel.recording.grasp_format import NO_FAILURE
from taxel.recording.grasp_record import GraspRecord
from taxel.sim.closing import RATE_HZ, GraspMotion, SimulationSettings, simulate_grasp
from taxel.sim.original_sensing import OriginalRules, get_surface_heights, make_recorder_settings
from taxel.sim.scene import Scene, build_scene
from taxel.sim.sensing import Sensing, sense
from taxel.sim.sensor_model import SimSensor

CHUNK = 2
"""Grasps per task of a worker process."""

_STREAM = 3


@dataclass(frozen=True)
class SimSettings:
    """Settings of a campaign in the simulator.

    sensing: model that converts contact into forces on taxels (`taxel.sim.sensing`). variation: variation of object
    pose and grip between repeats, as estimated from repeats on the hand; applied as a balanced design
    (`taxel.campaign.variation.sample_balanced_variation`). Its remounting part is not used: brackets are at their
    nominal poses. max_attempts: largest number of attempts of a grasp that fails, 1: no repetition.
    """

    seed: int = 1
    variation: Variation = field(default_factory=Variation)
    sensing: Sensing = field(default_factory=Sensing)
    sensor: SimSensor = field(default_factory=SimSensor)
    timeline: Timeline = field(default_factory=Timeline)
    max_attempts: int = MAX_ATTEMPTS

    def describe(self) -> str:
        """Return one line for the generator attribute of the dataset: sensing level and a digest of the settings."""
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
    progress: Progress = no_progress,
) -> None:
    """Simulate the grasps of `plan` and write them to the dataset `path`.

    setup: hand and objects; None: those of the thesis. jobs: number of processes; None: one per core. overwrite:
    replace an existing file. resume: keep the grasps that the file of an interrupted campaign already contains.
    progress: called with the number of finished grasps and the total. Raises `TaxelError` with a one-line message.
    """
    setup = setup or Setup()
    sensing = settings.sensing
    model = settings.sensor.make_dataset_model(
        setup.hand, sensing.stiffness_n_per_m, "coupled" if sensing.level == "coupled" else "uncoupled"
    )
    with open_campaign_writer(path, "sim", setup, RATE_HZ, settings.describe(), overwrite, resume, model) as out:
        finished = set(out.ids)
        missing = [planned for planned in plan if planned.id not in finished]
        done = len(plan) - len(missing)
        progress(done, len(plan))
        records = map_in_processes(simulate_planned_grasp, setup, missing, settings, jobs, CHUNK)
        for planned, record in zip(missing, records, strict=True):
            out.add(record, planned.id)
            done += 1
            progress(done, len(plan))


@lru_cache(maxsize=8)  # small, because a cached scene keeps its setup in memory
def _build_scene(setup: Setup, name: str, rules: OriginalRules | None) -> Scene:
    """Build the simulated scene of the hand and the object `name`; the latest scenes are cached.

    rules: rules of the original simulator, whose boards have no elastic layer; None: the boards have the hand's layer.
    """
    heights = None if rules is None else get_surface_heights(setup.hand, rules)
    return build_scene(setup.hand, setup.objects[name], WRIST_LINK, layer_m=heights)


def simulate_motion(
    setup: Setup, planned: PlannedGrasp, settings: SimSettings, sample: NDArray[np.float64] | None = None
) -> GraspMotion:
    """Simulate the motion and the contacts of one attempt of a planned grasp.

    sample: unit samples f64[7] of the variation; None: those of the first attempt. With the sensing level "original"
    the motion contains the messages of the boards' contact sensors.
    """
    law = settings.sensing.law if settings.sensing.level == "layer" else None
    rules = settings.sensing.original if settings.sensing.level == "original" else None
    recorder = None if rules is None else make_recorder_settings(setup.hand, rules)
    scene, approach = _build_scene(setup, planned.object, rules), setup.approach(planned)
    variation = settings.variation.for_object(planned.object)
    offset, grip = variation.apply(_sample_variation(planned, settings, 0) if sample is None else sample)
    simulation = SimulationSettings(
        RATE_HZ,
        object_offset=offset,
        torque_scale=grip,
        object_pose=setup.object_pose(planned.object),
        law=law,
        recorder=recorder,
    )
    return simulate_grasp(scene, approach, settings.timeline, simulation)


def _sample_variation(planned: PlannedGrasp, settings: SimSettings, attempt: int) -> NDArray[np.float64]:
    """Compute the unit samples f64[7] of the variation of an attempt. attempt: number of earlier, failed attempts."""
    name = f"{planned.object} {planned.approach}"
    return sample_balanced_variation(settings.seed, name, planned.iteration, attempt)


def _perform_grasp(setup: Setup, planned: PlannedGrasp, settings: SimSettings) -> Attempt[GraspMotion]:
    """Simulate the motion of a grasp, and repeat it with another variation if it fails; return the kept attempt."""
    check = make_grasp_check(setup, planned)

    def find_failure(motion: GraspMotion) -> Failure | None:
        """Return the failure of the grasp in the hold phase of `motion`; None for a successful grasp."""
        is_hold = motion.phase == Phase.HOLD
        return check.find_failure(motion.object_pose[is_hold], motion.sensor_poses[is_hold])

    return perform_attempts(
        lambda sample: simulate_motion(setup, planned, settings, sample),
        find_failure,
        lambda attempt: _sample_variation(planned, settings, attempt),
        settings.max_attempts,
    )


def simulate_planned_grasp(setup: Setup, planned: PlannedGrasp, settings: SimSettings) -> GraspRecord:
    """Simulate one planned grasp and return its record. The noise depends only on the seed and the grasp.

    A failed grasp is repeated with another variation (`taxel.campaign.attempts`).
    """
    rng = np.random.default_rng([settings.seed, _STREAM, *planned.id.encode()])
    object_pose, item = setup.object_pose(planned.object), setup.objects[planned.object]
    attempt = _perform_grasp(setup, planned, settings)
    motion = attempt.motion
    sensed = sense(setup.hand, item.shape, motion, settings.sensing)
    # Some sensor models compute the counts from another force than the contact force.
    counts_force = sensed.contact_force if sensed.signal_force is None else sensed.signal_force
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
        raw_counts=settings.sensor.raw_counts(setup.hand, counts_force, rng),
        valid=np.ones((len(motion.time_s), len(setup.hand.boards)), bool),
        sensor_pose=motion.sensor_poses[middle],
        object_pose=object_pose,
        joint_position=np.hstack([arm, motion.joint_angles]),
        contact_force=sensed.contact_force,
        separation=sensed.separation,
        attempts=attempt.attempts,
        failure=attempt.failure or NO_FAILURE,
    )
