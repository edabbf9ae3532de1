"""Presses in the simulator, each on its own, to sim.h5."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from taxel.campaign.press.errors import PressError
from taxel.campaign.press.plan import PlannedPress, PressApproach, PressPlan
from taxel.campaign.press.settings import SimPressSettings
from taxel.campaign.press.soft_rest import SoftPress, SoftRest
from taxel.campaign.press.standing_layer import StandingLayer
from taxel.campaign.press.stroke import Stroke
from taxel.campaign.processes import in_processes
from taxel.campaign.progress import Progress, silent
from taxel.campaign.scatter import balanced_draw
from taxel.campaign.setup import Setup
from taxel.campaign.store import begin_or_extend
from taxel.recording.grasp_record import GraspRecord
from taxel.sim.layer import STIFFNESS_N_PER_M
from taxel.sim.separation import separations
from taxel.sim.soft_contact import LayerLaw
from taxel.types import FloatArray

CHUNK = 4
"""Presses that a process takes at a time."""

_STREAM = 5


@dataclass(frozen=True, eq=False)
class Work:
    """What every press of a campaign has in common."""

    plan: PressPlan
    settings: SimPressSettings


def simulate_pressed(
    path: str | os.PathLike[str],
    plan: PressPlan,
    settings: SimPressSettings | None = None,
    jobs: int | None = 1,
    overwrite: bool = False,
    resume: bool = False,
    progress: Progress = silent,
) -> None:
    """Simulate every approach of `plan`, `settings.repeats` times, and write them to `path`; arguments as those of
    `run_pressed`.
    """
    settings, setup = settings or SimPressSettings(), plan.setup
    told = f"{settings.describe()}, {plan.describe()}"
    model = settings.sensor.told(STIFFNESS_N_PER_M)
    with begin_or_extend(path, "sim", setup, settings.rate_hz, told, overwrite, resume, model) as out:
        finished = set(out.ids)
        presses = simulated_presses(plan, settings.repeats)
        missing = [press for press in presses if press.id not in finished]
        done = len(presses) - len(missing)
        progress(done, len(presses))
        records = in_processes(simulate_press, setup, missing, Work(plan, settings), jobs, CHUNK)
        for press, record in zip(missing, records, strict=True):
            out.add(record, press.id)
            done += 1
            progress(done, len(presses))


def simulated_presses(plan: PressPlan, repeats: int) -> list[PlannedPress]:
    """What the simulator makes: it has one session."""
    keys = [(approach, number) for approach in plan.approaches for number in range(repeats)]
    width = len(str(len(keys) - 1))
    return [
        PlannedPress(f"{place:0{width}d}_{approach.name}_{number}", approach, number, 0)
        for place, (approach, number) in enumerate(keys)
    ]


@lru_cache(maxsize=1)
def _layer(plan: PressPlan, law: LayerLaw) -> StandingLayer:
    return StandingLayer(plan.hand, plan.bracket_poses, law)


def simulate_press(setup: Setup, press: PlannedPress, work: Work) -> GraspRecord:
    """One press. Its noise depends on the seed and the press alone. Raises `PressError` if it does not rest."""
    plan, settings, approach = work.plan, work.settings, press.approach
    offset, strength = settings.scatter.of(approach.object).moved(
        balanced_draw(settings.seed, f"{approach.object} {approach.name}", press.iteration)
    )
    shape = setup.objects[approach.object].shape
    layer = _layer(plan, settings.law)
    rest = SoftRest(layer, shape, plan.mount, approach.touch_pose @ offset, approach.direction)
    times = plan.timeline.sample_times(settings.rate_hz)
    try:
        pressed = rest.press(strength * approach.force_n)
    except PressError as error:
        raise error.named(press.id) from None
    force, separation = _sensed(plan, approach, rest, pressed, times)
    rng = np.random.default_rng([settings.seed, _STREAM, *press.id.encode()])
    return GraspRecord(
        object=approach.object,
        approach=approach.name,
        iteration=press.iteration,
        session=press.session,
        timestamp=times,
        phase=plan.timeline.phase_at(times),
        raw_counts=settings.sensor.raw_counts(setup.hand, force, rng),
        valid=np.ones((len(times), len(setup.hand.boards)), bool),
        sensor_pose=plan.bracket_poses.copy(),
        object_pose=approach.held_pose.copy(),
        contact_force=force,
        separation=separation,
    )


def _sensed(
    plan: PressPlan, approach: PressApproach, rest: SoftRest, pressed: SoftPress, times: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Force on every taxel and its separation at every row, each f64[T, n]: made once for each place of the mount."""
    stroke = Stroke.through(plan.timeline, float(pressed.path.x[0]), pressed.travel_m)
    travel, row = np.unique(stroke.travel_at(times), return_inverse=True)
    motions = pressed.motions(travel, approach.direction)
    poses = np.stack([rest.pose(motion) for motion in motions])
    force = np.zeros((len(travel), plan.hand.n_taxels))
    for place in np.flatnonzero(travel > pressed.path.x[0]).tolist():
        force[place] = rest.taxel_forces(motions[place])
    brackets = np.broadcast_to(plan.bracket_poses, (len(travel), *plan.bracket_poses.shape))
    separation = separations(plan.hand, plan.objects[approach.object].shape, brackets, poses)
    return force[row], separation[row]
