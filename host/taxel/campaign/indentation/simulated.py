"""An indentation campaign in the simulator: every indentation is simulated independently."""

import os
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from taxel.campaign.indentation.errors import EquilibriumError
from taxel.campaign.indentation.fixed_layer import FixedSkinLayer
from taxel.campaign.indentation.plan import IndentationApproach, IndentationPlan, PlannedIndentation
from taxel.campaign.indentation.settings import SimIndentationSettings
from taxel.campaign.indentation.simulated_equilibrium import SimulatedEquilibrium, SimulatedPath
from taxel.campaign.indentation.stroke import Stroke
from taxel.campaign.processes import map_in_processes
from taxel.campaign.progress import Progress, no_progress
from taxel.campaign.setup import Setup
from taxel.campaign.store import open_campaign_writer
from taxel.campaign.variation import sample_balanced_variation
from taxel.recording.grasp_record import GraspRecord
from taxel.sim.layer import STIFFNESS_N_PER_M
from taxel.sim.separation import compute_separations
from taxel.sim.soft_contact import LayerLaw
from taxel.types import FloatArray

CHUNK = 4
"""Indentations per task of a worker process."""

_STREAM = 5


@dataclass(frozen=True, eq=False)
class SimulatedCampaign:
    """Plan and settings that all indentations of a campaign share."""

    plan: IndentationPlan
    settings: SimIndentationSettings


def run_simulated_indentations(
    path: str | os.PathLike[str],
    plan: IndentationPlan,
    settings: SimIndentationSettings | None = None,
    jobs: int | None = 1,
    overwrite: bool = False,
    resume: bool = False,
    progress: Progress = no_progress,
) -> None:
    """Simulate every approach of an indentation plan, `settings.repeats` times each, and write the records to `path`.

    settings: None: the default ones. jobs: number of processes; None: one per core; 1: the calling process only.
    overwrite: replace an existing file. resume: keep the indentations that the file already contains. progress: called
    with the number of finished indentations and the total. Raises `TaxelError` with a one-line message.
    """
    settings, setup = settings or SimIndentationSettings(), plan.setup
    description = f"{settings.describe()}, {plan.describe()}"
    model = settings.sensor.make_dataset_model(setup.hand, STIFFNESS_N_PER_M)
    with open_campaign_writer(path, "sim", setup, settings.rate_hz, description, overwrite, resume, model) as out:
        finished = set(out.ids)
        indentations = plan_simulated_indentations(plan, settings.repeats)
        missing = [indentation for indentation in indentations if indentation.id not in finished]
        done = len(indentations) - len(missing)
        progress(done, len(indentations))
        campaign = SimulatedCampaign(plan, settings)
        records = map_in_processes(simulate_indentation, setup, missing, campaign, jobs, CHUNK)
        for indentation, record in zip(missing, records, strict=True):
            out.add(record, indentation.id)
            done += 1
            progress(done, len(indentations))


def plan_simulated_indentations(plan: IndentationPlan, repeats: int) -> list[PlannedIndentation]:
    """List the indentations to simulate, in a single session: every approach of the plan `repeats` times."""
    keys = [(approach, number) for approach in plan.approaches for number in range(repeats)]
    width = len(str(len(keys) - 1))
    return [
        PlannedIndentation(f"{index:0{width}d}_{approach.name}_{number}", approach, number, 0)
        for index, (approach, number) in enumerate(keys)
    ]


@lru_cache(maxsize=1)
def _make_layer(plan: IndentationPlan, law: LayerLaw) -> FixedSkinLayer:
    """Make the elastic layer of the plan's hand with its boards at fixed poses; the latest result is cached."""
    return FixedSkinLayer(plan.hand, plan.bracket_poses, law)


def simulate_indentation(setup: Setup, indentation: PlannedIndentation, campaign: SimulatedCampaign) -> GraspRecord:
    """Simulate one indentation and return its record. The noise depends only on the seed and the indentation.

    campaign: plan and settings. Raises `EquilibriumError` if the object has no equilibrium.
    """
    plan, settings, approach = campaign.plan, campaign.settings, indentation.approach
    offset, force_factor = settings.variation.for_object(approach.object).apply(
        sample_balanced_variation(settings.seed, f"{approach.object} {approach.name}", indentation.iteration)
    )
    shape = setup.objects[approach.object].shape
    layer = _make_layer(plan, settings.law)
    equilibrium = SimulatedEquilibrium(layer, shape, plan.mount, approach.touch_pose @ offset, approach.direction)
    times = plan.timeline.make_sample_times(settings.rate_hz)
    try:
        path = equilibrium.solve_path(force_factor * approach.force_n)
    except EquilibriumError as error:
        raise error.for_indentation(indentation.id) from None
    force, separation = _compute_force_and_separation(plan, approach, equilibrium, path, times)
    rng = np.random.default_rng([settings.seed, _STREAM, *indentation.id.encode()])
    return GraspRecord(
        object=approach.object,
        approach=approach.name,
        iteration=indentation.iteration,
        session=indentation.session,
        timestamp=times,
        phase=plan.timeline.find_phases(times),
        raw_counts=settings.sensor.raw_counts(setup.hand, force, rng),
        valid=np.ones((len(times), len(setup.hand.boards)), bool),
        sensor_pose=plan.bracket_poses.copy(),
        object_pose=approach.held_pose.copy(),
        contact_force=force,
        separation=separation,
    )


def _compute_force_and_separation(
    plan: IndentationPlan,
    approach: IndentationApproach,
    equilibrium: SimulatedEquilibrium,
    path: SimulatedPath,
    times: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Compute the force on every taxel, newtons, and its separation from the object, metres, each f64[T, n].

    path: equilibrium motion of the object. times: f64[T], seconds since the start of the indentation. The values are
    computed once for each distinct travel of the mount.
    """
    stroke = Stroke.through(plan.timeline, float(path.curve.x[0]), path.travel_m)
    travel, travel_index = np.unique(stroke.travel_at(times), return_inverse=True)
    motions = path.motions(travel, approach.direction)
    poses = np.stack([equilibrium.pose(motion) for motion in motions])
    force = np.zeros((len(travel), plan.hand.n_taxels))
    for index in np.flatnonzero(travel > path.curve.x[0]).tolist():
        force[index] = equilibrium.taxel_forces(motions[index])
    brackets = np.broadcast_to(plan.bracket_poses, (len(travel), *plan.bracket_poses.shape))
    separation = compute_separations(plan.hand, plan.objects[approach.object].shape, brackets, poses)
    return force[travel_index], separation[travel_index]
