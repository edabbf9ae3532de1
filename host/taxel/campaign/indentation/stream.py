"""A long stream of indentations on the emulated skin: hours of use, with contacts at given times."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from taxel.campaign.indentation.emulated import make_scene_motion, solve_path
from taxel.campaign.indentation.plan import IndentationPlan, PlannedIndentation
from taxel.campaign.poll_cycles import PollCycles
from taxel.campaign.session import format_session_world, run_emulated_skin
from taxel.campaign.settings import EmulatedSettings
from taxel.emulated.contact import SkinContact
from taxel.grasp.timeline import Timeline


@dataclass(frozen=True, eq=False)
class TimedIndentation:
    """An indentation of a stream. begin_s: start of its baseline, seconds since power-up. timeline: its phases."""

    indentation: PlannedIndentation
    begin_s: float
    timeline: Timeline


def run_emulated_stream(
    plan: IndentationPlan, contacts: Sequence[TimedIndentation], settings: EmulatedSettings, duration_s: float
) -> PollCycles:
    """Run the emulated skin during a stream of indentations; return its poll cycles.

    contacts: in order of time, without overlap; between two contacts the object is away from the skin. duration_s: of
    the stream since power-up. Raises `TaxelError`.
    """
    session = contacts[0].indentation.session
    world = format_session_world(plan.setup, settings, session)
    ends = [*(one.begin_s for one in contacts[1:]), duration_s]
    with SkinContact(world) as contact:
        motions = [
            make_scene_motion(
                replace(plan, timeline=one.timeline),
                one.indentation,
                solve_path(plan, one.indentation, settings, contact),
                one.begin_s,
                end_s,
            )
            for one, end_s in zip(contacts, ends, strict=True)
        ]
    return run_emulated_skin(plan.hand, world, motions, duration_s)
