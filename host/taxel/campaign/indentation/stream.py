"""Many indentations at given times in one run of the emulated skin, to emulate hours of use."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from taxel.campaign.indentation.emulated import make_scene_motion, solve_path
from taxel.campaign.indentation.plan import IndentationPlan, PlannedIndentation
from taxel.campaign.poll_cycles import PollCycles
from taxel.campaign.session import run_emulated_skin
from taxel.campaign.session_world import format_session_world
from taxel.campaign.settings import EmulatedSettings
from taxel.emulated.contact import SkinContact
from taxel.grasp.timeline import Timeline


@dataclass(frozen=True, eq=False)
class TimedIndentation:
    """An indentation at a given time. begin_s: start of its baseline, seconds since power-up. timeline: its phases."""

    indentation: PlannedIndentation
    begin_s: float
    timeline: Timeline


def run_emulated_stream(
    plan: IndentationPlan, contacts: Sequence[TimedIndentation], settings: EmulatedSettings, duration_s: float
) -> PollCycles:
    """Run the emulated skin for `duration_s` seconds since power-up with indentations at given times.

    Returns the frames by poll cycle. contacts: at least one indentation, all of the same session, in order of time and
    without overlap; between two indentations the object is away from the skin. Raises `TaxelError`.
    """
    session = contacts[0].indentation.session
    world = format_session_world(plan.setup, settings, session)
    ends = [*(timed.begin_s for timed in contacts[1:]), duration_s]
    with SkinContact(world) as contact:
        motions = [
            make_scene_motion(
                replace(plan, timeline=timed.timeline),
                timed.indentation,
                solve_path(plan, timed.indentation, settings, contact),
                timed.begin_s,
                end_s,
            )
            for timed, end_s in zip(contacts, ends, strict=True)
        ]
    return run_emulated_skin(plan.hand, world, motions, duration_s)
