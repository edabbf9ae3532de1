"""Presses on the emulated skin: each session through firmware, bus, hub, UART and host, to real.h5."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from taxel.campaign.press.errors import PressError
from taxel.campaign.press.plan import PlannedPress, PressPlan
from taxel.campaign.press.rest import EmulatedRest, Pressed
from taxel.campaign.press.settings import poll_hz
from taxel.campaign.press.stroke import AWAY_M, Stroke
from taxel.campaign.processes import in_processes
from taxel.campaign.progress import Progress, silent
from taxel.campaign.rows import Rows
from taxel.campaign.scatter import FACTORS
from taxel.campaign.session import LEAD_IN_S, Moved, check_world, emulate, session_world
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.campaign.store import begin_or_extend
from taxel.emulated.contact import SkinContact
from taxel.recording.grasp_record import GraspRecord

APPROACH_SHARES = (1.0, 0.7, 0.45, 0.25, 0.1, 0.0)
"""Of the way that the object is withdrawn: what it does from afar (proximity) is made there."""

_STREAM = 4


@dataclass(frozen=True, eq=False)
class Work:
    """What every press of a campaign has in common."""

    plan: PressPlan
    settings: EmulatedSettings


def run_pressed(
    path: str | os.PathLike[str],
    plan: PressPlan,
    settings: EmulatedSettings,
    jobs: int | None = 1,
    overwrite: bool = False,
    resume: bool = False,
    progress: Progress = silent,
) -> None:
    """Make the presses of `plan` on the emulated skin and write them to `path`.

    settings: seed, effects, scatter (its grip is the force's), clocks; the phases are the plan's. `press_settings` has
    those of a rig. jobs: processes; None: one a core; 1: none but this one. overwrite, resume: as those of
    `taxel.campaign.emulated.run_emulated`. The same plan and settings give the same presses, whatever `jobs`. Raises
    `TaxelError` of one line.
    """
    setup = plan.setup
    check_world(setup, settings)
    rate_hz, told = poll_hz(plan.hand, settings.scl_hz), f"{settings.describe()}, {plan.describe()}"
    with begin_or_extend(path, "real", setup, rate_hz, told, overwrite, resume) as out:
        finished = set(out.ids)
        sessions = [list(part) for _, part in groupby(plan.presses, key=lambda press: press.session)]
        missing = [part for part in sessions if not finished.issuperset(press.id for press in part)]
        done = len(plan.presses) - sum(len(part) for part in missing)
        progress(done, len(plan.presses))
        made = in_processes(press_session, setup, missing, Work(plan, settings), jobs)
        for part, records in zip(missing, made, strict=True):
            for press, record in zip(part, records, strict=True):
                if press.id not in finished:
                    out.add(record, press.id)
                done += 1
                progress(done, len(plan.presses))


def press_session(setup: Setup, presses: Sequence[PlannedPress], work: Work) -> list[GraspRecord]:
    """The presses of one session, in order: one mounting of the skin, one power-up. Raises `TaxelError` of one line."""
    plan, settings = work.plan, work.settings
    begins = (LEAD_IN_S + plan.timeline.duration_s * np.arange(len(presses) + 1)).tolist()
    world = session_world(setup, settings, presses[0].session)
    with SkinContact(world) as contact:
        moved = [
            _moved(plan, press, _pressed(plan, press, settings, contact), begin, end)
            for press, begin, end in zip(presses, begins[:-1], begins[1:], strict=True)
        ]
    rows = emulate(plan.hand, world, moved, begins[-1] + 0.1)
    return [_record(plan, press, rows, begin) for press, begin in zip(presses, begins, strict=False)]


def _pressed(plan: PressPlan, press: PlannedPress, settings: EmulatedSettings, contact: SkinContact) -> Pressed:
    """Where the object truly is from the touch to the hold; it stands and presses a little other than planned."""
    approach = press.approach
    rng = np.random.default_rng([settings.seed, _STREAM, *press.id.encode()])
    offset, strength = settings.scatter.of(approach.object).moved(rng.normal(size=FACTORS))
    rest = EmulatedRest(
        contact,
        list(plan.objects).index(approach.object),
        plan.bracket_poses,
        plan.mount,
        plan.centre(approach.object),
        approach.touch_pose @ offset,
        approach.direction,
    )
    try:
        return rest.press(strength * approach.force_n)
    except PressError as error:
        raise error.named(press.id) from None


def _moved(plan: PressPlan, press: PlannedPress, pressed: Pressed, begin_s: float, end_s: float) -> Moved:
    """The object over the time of one press: in, held, and back the same way, since rest knows no past."""
    stroke = Stroke.through(plan.timeline, float(pressed.travel_m[0]), float(pressed.travel_m[-1]))
    free = stroke.start_m - AWAY_M * np.array(APPROACH_SHARES)
    travel = np.concatenate([free, pressed.travel_m])
    afar = np.repeat(pressed.pose[:1], len(free), axis=0)
    afar[:, :3, 3] += (free - pressed.travel_m[0])[:, None] * press.approach.direction
    poses = np.concatenate([afar, pressed.pose])
    going, coming = stroke.times_of(travel)
    times = np.concatenate([[begin_s], begin_s + going, begin_s + coming[::-1], [end_s]])
    way = np.r_[0, : len(travel), len(travel) - 1 : -1 : -1, 0]
    number = np.full(len(way), list(plan.objects).index(press.approach.object))
    brackets = np.broadcast_to(plan.bracket_poses, (len(way), *plan.bracket_poses.shape))
    return Moved(times, number, poses[way], brackets)


def _record(plan: PressPlan, press: PlannedPress, rows: Rows, begin_s: float) -> GraspRecord:
    own = rows.between(begin_s, begin_s + plan.timeline.duration_s)
    return GraspRecord(
        object=press.approach.object,
        approach=press.approach.name,
        iteration=press.iteration,
        session=press.session,
        timestamp=own.time_s,
        phase=plan.timeline.phase_at(own.time_s - begin_s),
        raw_counts=own.raw_counts,
        valid=own.valid,
        sensor_pose=plan.bracket_poses,
        object_pose=press.approach.held_pose,
        sensor_time=own.sensor_time,
    )
