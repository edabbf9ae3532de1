"""An indentation campaign on the emulated skin: each session through firmware, bus, hub, UART and host."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from taxel.campaign.indentation.emulated_equilibrium import EmulatedEquilibrium, EquilibriumPath
from taxel.campaign.indentation.errors import EquilibriumError
from taxel.campaign.indentation.plan import IndentationPlan, PlannedIndentation
from taxel.campaign.indentation.settings import compute_poll_rate
from taxel.campaign.indentation.stroke import AWAY_M, Stroke
from taxel.campaign.poll_cycles import PollCycles
from taxel.campaign.processes import map_in_processes
from taxel.campaign.progress import Progress, no_progress
from taxel.campaign.session import LEAD_IN_S, SceneMotion, run_emulated_skin
from taxel.campaign.session_world import check_world, format_session_world
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.campaign.store import open_campaign_writer
from taxel.campaign.variation import FACTORS
from taxel.emulated.contact import SkinContact
from taxel.recording.grasp_record import GraspRecord

WITHDRAWN_SHARES = (1.0, 0.7, 0.45, 0.25, 0.1, 0.0)
"""Shares of the withdrawn distance at which the scene is recorded, for effects of a distant object (proximity)."""

_STREAM = 4


@dataclass(frozen=True, eq=False)
class EmulatedCampaign:
    """Plan and settings that all indentations of a campaign share."""

    plan: IndentationPlan
    settings: EmulatedSettings


def run_emulated_indentations(
    path: str | os.PathLike[str],
    plan: IndentationPlan,
    settings: EmulatedSettings,
    jobs: int | None = 1,
    overwrite: bool = False,
    resume: bool = False,
    progress: Progress = no_progress,
) -> None:
    """Run the indentations of `plan` on the emulated skin and write them to the dataset `path`.

    settings: seed, effects, clocks and variation (its `grip` varies the force); the phases are those of the plan.
    `indentation_settings` returns the settings of a rig. jobs: number of processes; None: one per core; 1: the calling
    process only. overwrite: replace an existing file. resume: keep the sessions that the file already contains.
    progress: called with the number of finished indentations and the total. The same plan and settings give the same
    indentations for any `jobs`. Raises `TaxelError` with a one-line message.
    """
    setup = plan.setup
    check_world(setup, settings)
    rate_hz, description = compute_poll_rate(plan.hand, settings.scl_hz), f"{settings.describe()}, {plan.describe()}"
    with open_campaign_writer(path, "real", setup, rate_hz, description, overwrite, resume) as out:
        finished = set(out.ids)
        sessions = [list(part) for _, part in groupby(plan.indentations, key=lambda indentation: indentation.session)]
        missing = [part for part in sessions if not finished.issuperset(indentation.id for indentation in part)]
        total = len(plan.indentations)
        done = total - sum(len(part) for part in missing)
        progress(done, total)
        campaign = EmulatedCampaign(plan, settings)
        sessions_of_records = map_in_processes(run_indentation_session, setup, missing, campaign, jobs)
        for part, records in zip(missing, sessions_of_records, strict=True):
            for indentation, record in zip(part, records, strict=True):
                if indentation.id not in finished:
                    out.add(record, indentation.id)
                done += 1
                progress(done, total)


def run_indentation_session(
    setup: Setup, indentations: Sequence[PlannedIndentation], campaign: EmulatedCampaign
) -> list[GraspRecord]:
    """Run the indentations of one session on the emulated skin and return their records in the same order.

    A session has one mounting of the skin and one power-up. campaign: plan and settings. Raises `TaxelError`.
    """
    plan, settings = campaign.plan, campaign.settings
    begins = (LEAD_IN_S + plan.timeline.duration_s * np.arange(len(indentations) + 1)).tolist()
    world = format_session_world(setup, settings, indentations[0].session)
    with SkinContact(world) as contact:
        motions = [
            make_scene_motion(plan, indentation, solve_path(plan, indentation, settings, contact), begin, end)
            for indentation, begin, end in zip(indentations, begins[:-1], begins[1:], strict=True)
        ]
    # 0.1 s longer than the last indentation, so that the capture contains all its frames.
    cycles = run_emulated_skin(plan.hand, world, motions, begins[-1] + 0.1)
    return [
        _make_record(plan, indentation, cycles, begin) for indentation, begin in zip(indentations, begins, strict=False)
    ]


def solve_path(
    plan: IndentationPlan, indentation: PlannedIndentation, settings: EmulatedSettings, contact: SkinContact
) -> EquilibriumPath:
    """Solve for the true poses of the object from first contact to hold, with random variation of pose and force.

    contact: computes the contact loads of the skin.
    """
    approach = indentation.approach
    rng = np.random.default_rng([settings.seed, _STREAM, *indentation.id.encode()])
    offset, force_factor = settings.variation.for_object(approach.object).apply(rng.normal(size=FACTORS))
    equilibrium = EmulatedEquilibrium(
        contact,
        list(plan.objects).index(approach.object),
        plan.bracket_poses,
        plan.mount,
        plan.centre(approach.object),
        approach.touch_pose @ offset,
        approach.direction,
    )
    try:
        return equilibrium.solve_path(force_factor * approach.force_n)
    except EquilibriumError as error:
        raise error.for_indentation(indentation.id) from None


def make_scene_motion(
    plan: IndentationPlan, indentation: PlannedIndentation, path: EquilibriumPath, begin_s: float, end_s: float
) -> SceneMotion:
    """Make the motion of the object in one indentation: inwards, hold, and back along the same poses.

    The poses on the way back are the same because the equilibrium has no hysteresis. path: equilibrium poses. begin_s,
    end_s: start and end of the indentation, seconds since power-up.
    """
    stroke = Stroke.through(plan.timeline, float(path.travel_m[0]), float(path.travel_m[-1]))
    free = stroke.start_m - AWAY_M * np.array(WITHDRAWN_SHARES)
    travel = np.concatenate([free, path.travel_m])
    free_poses = np.repeat(path.pose[:1], len(free), axis=0)
    free_poses[:, :3, 3] += (free - path.travel_m[0])[:, None] * indentation.approach.direction
    poses = np.concatenate([free_poses, path.pose])
    inwards, outwards = stroke.times_of(travel)
    times = np.concatenate([[begin_s], begin_s + inwards, begin_s + outwards[::-1], [end_s]])
    # Rows of `poses`: the withdrawn pose, all poses inwards, the same poses backwards, the withdrawn pose.
    rows = np.r_[0, : len(travel), len(travel) - 1 : -1 : -1, 0]
    number = np.full(len(rows), list(plan.objects).index(indentation.approach.object))
    brackets = np.broadcast_to(plan.bracket_poses, (len(rows), *plan.bracket_poses.shape))
    return SceneMotion(times, number, poses[rows], brackets)


def _make_record(
    plan: IndentationPlan, indentation: PlannedIndentation, cycles: PollCycles, begin_s: float
) -> GraspRecord:
    """Make the dataset record of one indentation from the frames of its session.

    cycles: frames of the whole session. begin_s: start of the indentation, seconds since power-up.
    """
    recorded = cycles.between(begin_s, begin_s + plan.timeline.duration_s)
    return GraspRecord(
        object=indentation.approach.object,
        approach=indentation.approach.name,
        iteration=indentation.iteration,
        session=indentation.session,
        timestamp=recorded.time_s,
        phase=plan.timeline.find_phases(recorded.time_s - begin_s),
        raw_counts=recorded.raw_counts,
        valid=recorded.valid,
        sensor_pose=plan.bracket_poses,
        object_pose=indentation.approach.held_pose,
        sensor_time=recorded.sensor_time,
    )
