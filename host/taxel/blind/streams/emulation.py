"""Frames of a stream: the reference contacts, then hours of use, on the emulated skin."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from taxel.blind.streams.sampling import HAND
from taxel.blind.streams.world import StreamWorld
from taxel.blind.world_datasets import MAX_ATTEMPTS, UndescribedSettings, WorldNotMadeError
from taxel.campaign.indentation import IndentationDesign, IndentationPlan, indentation_settings, sample_indentation_plan
from taxel.campaign.indentation.plan import PlannedIndentation
from taxel.campaign.indentation.stream import TimedIndentation, run_emulated_stream
from taxel.campaign.poll_cycles import PollCycles
from taxel.campaign.session import LEAD_IN_S
from taxel.campaign.store import open_campaign_writer
from taxel.errors import TaxelError
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.twin.contact_records import ContactRecorder
from taxel.twin.schedule import Contact, ContactSchedule

APPROACHES: Final = 12
REPEATS: Final = 8
"""Number of conditions, and number of contacts of each condition in the reference."""

PAUSE_S: Final = (4.1, 25.0)
"""Range of the time between the end of a contact and the next one, seconds."""

LASTING_FORCE_N: Final = 1.0
"""Force of the lasting contact that is not announced."""


@dataclass(frozen=True, eq=False)
class Stream:
    """Poll cycles after the reference, with the announced contacts. start_s: end of the reference, seconds."""

    cycles: PollCycles
    schedule: ContactSchedule
    start_s: float


def make_stream(world: StreamWorld, reference: Path) -> Stream:
    """Emulate a stream (hours of use of a skin); write its reference contacts to the dataset `reference`.

    A stream with a fault is joined from two runs of the same skin, without and with the fault: the second run is used
    from the onset on. Plans without an equilibrium are replaced. Raises WorldNotMadeError after `MAX_ATTEMPTS` plans.
    """
    hand = load_hand(HAND)
    reason = ""
    for attempt in range(MAX_ATTEMPTS):
        rng = np.random.default_rng([world.seed, attempt])
        try:
            design = IndentationDesign(approaches=APPROACHES, sessions=1, repeats=REPEATS)
            plan = sample_indentation_plan(hand, int(rng.integers(2**31)), design)
            return _emulate(world, plan, reference, rng)
        except TaxelError as error:
            reason = str(error)
    raise WorldNotMadeError(world.number, reason)


def _emulate(world: StreamWorld, plan: IndentationPlan, reference: Path, rng: np.random.Generator) -> Stream:
    """Emulate the reference contacts of a plan and the contacts of the stream; write the reference dataset.

    The reference contacts begin after `LEAD_IN_S` seconds; the contacts of the stream follow from `start_s` on.
    """
    usual = replace(plan.timeline, baseline_s=PAUSE_S[0])
    contacts = [
        TimedIndentation(one, LEAD_IN_S + number * usual.duration_s, usual)
        for number, one in enumerate(plan.indentations)
    ]
    start_s = LEAD_IN_S + len(contacts) * usual.duration_s
    later, is_announced = _plan_stream(world, plan, start_s, rng)
    end_s = start_s + 3600.0 * world.hours
    names = sorted(plan.objects)
    item = names[world.seed % len(names)]
    fault = tuple(line.replace(" OBJECT ", f" {item} ") for cause in world.hidden.causes for line in cause.lines)
    nuisances = world.hidden.nuisances
    seed = int(rng.integers(2**31))
    runs = [
        run_emulated_stream(
            plan,
            [*contacts, *later],
            UndescribedSettings(**vars(indentation_settings(plan.hand, seed=seed, effects=lines))),
            end_s + 1.0,
        )
        for lines in ([nuisances] if world.onset_s is None else [nuisances, (*fault, *nuisances)])
    ]
    cycles = runs[0] if world.onset_s is None else join_runs(runs[0], runs[1], start_s + world.onset_s)
    _write_reference(plan, contacts, cycles, start_s, reference)
    announced = [to_contact(one) for one, known in zip(later, is_announced, strict=True) if known]
    return Stream(cycles.between(start_s, end_s), ContactSchedule(announced), start_s)


def _plan_stream(
    world: StreamWorld, plan: IndentationPlan, start_s: float, rng: np.random.Generator
) -> tuple[list[TimedIndentation], list[bool]]:
    """Plan the contacts after the reference with random pauses; return them, and whether each is announced.

    Only a lasting contact (`StreamWorld.lasting_s`) is not announced.
    """
    found: list[TimedIndentation] = []
    announced: list[bool] = []
    time_s, end_s = start_s, start_s + 3600.0 * world.hours
    lasting = None if world.lasting_s is None else tuple(start_s + time for time in world.lasting_s)
    while True:
        timeline = replace(plan.timeline, baseline_s=round(float(rng.uniform(*PAUSE_S)), 2))
        approach = plan.approaches[int(rng.integers(len(plan.approaches)))]
        is_lasting = lasting is not None and time_s + timeline.duration_s > lasting[0]
        if is_lasting and lasting is not None:
            approach = replace(approach, force_n=LASTING_FORCE_N)
            timeline = replace(timeline, hold_s=lasting[1] - lasting[0])
            lasting = None
        if time_s + timeline.duration_s > end_s:
            return found, announced
        number = len(found)
        name = f"t{number:05d}_{approach.name}"
        found.append(TimedIndentation(PlannedIndentation(name, approach, number, 0), time_s, timeline))
        announced.append(not is_lasting)
        time_s += timeline.duration_s


def join_runs(first: PollCycles, second: PollCycles, time_s: float) -> PollCycles:
    """Join two runs: the poll cycles of `first` before a time, and those of `second` from this time on."""
    before, after = first.time_s < time_s, second.time_s >= time_s
    return PollCycles(
        *(
            np.concatenate([getattr(first, name)[before], getattr(second, name)[after]])
            for name in ("time_s", "raw_counts", "valid", "sensor_time")
        )
    )


def to_contact(one: TimedIndentation) -> Contact:
    """Convert an indentation to the announced contact with the times of its phases."""
    timeline: Timeline = one.timeline
    closing, hold, release, recovery = (
        one.begin_s + timeline.get_start_s(phase)
        for phase in (Phase.CLOSING, Phase.HOLD, Phase.RELEASE, Phase.RECOVERY)
    )
    approach = one.indentation.approach
    times = (closing, hold, release, recovery, one.begin_s + timeline.duration_s)
    return Contact(times, (approach.object, approach.name))


def _write_reference(
    plan: IndentationPlan, contacts: list[TimedIndentation], cycles: PollCycles, end_s: float, path: Path
) -> None:
    """Write the contacts of the reference as a dataset; each repeat of a condition gets a session number of its own.

    end_s: end of the reference, seconds.
    """
    poses = {(one.object, one.name): (plan.bracket_poses, one.held_pose) for one in plan.approaches}
    recorder = ContactRecorder(ContactSchedule([to_contact(one) for one in contacts]), poses)
    recorded_s = end_s + 1.0
    of_reference = cycles.between(0.0, recorded_s)
    records = recorder.take(of_reference.time_s, of_reference.raw_counts, of_reference.valid)
    rate_hz = len(of_reference.time_s) / recorded_s
    with open_campaign_writer(path, "real", plan.setup, rate_hz, "reference", True) as out:
        for _, record in records:
            out.add(record)
