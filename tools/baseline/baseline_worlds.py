"""Emulated worlds of the comparison: hours of use with drift, and one lasting contact."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from taxel.blind.world_datasets import MAX_ATTEMPTS
from taxel.campaign.indentation import IndentationDesign, IndentationPlan, indentation_settings, sample_indentation_plan
from taxel.campaign.indentation.plan import PlannedIndentation
from taxel.campaign.indentation.stream import TimedIndentation, run_emulated_stream
from taxel.campaign.poll_cycles import PollCycles
from taxel.errors import TaxelError
from taxel.hand import Hand

DEGREES = 10.0
COUNTS_PER_DEGREE = 12.0
"""Warming of the board during the run, and its effect at rest (assumed: 0.4 % per degree, the temperature coefficient
of a silicone's permittivity, of a count of 3,000)."""

WARM_UP_S = 1800.0
AMBIENT_COUNTS, AMBIENT_S = 20.0, 1800.0
"""Time constant of the warming; standard deviation and correlation time of the ambient temperature on top of it."""

FIRST_CONTACT_S = 30.0
FORCE_N = 1.0
AFTER_S = 180.0


@dataclass(frozen=True, eq=False)
class LastingContact:
    """Frames of a run with a lasting contact, and of the same run without it.

    begin_s, end_s: duration of the contact, from the start of its closing phase to the end of its release. board:
    i64[n], index of each taxel's board.
    """

    with_contact: PollCycles
    without: PollCycles
    begin_s: float
    end_s: float
    board: np.ndarray


def run_world(hand: Hand, seed: int, use_s: float, hold_s: float) -> LastingContact:
    """Emulate a hand with drift and a lasting contact, and return its frames with and without the lasting contact.

    The run consists of random contacts for `use_s` seconds, a contact of 1 N for `hold_s` seconds, and three minutes at
    rest. The same run, with the same seed, is also emulated without the contact of 1 N.
    """
    rng = np.random.default_rng(seed)
    plan = _sample_plan(hand, rng)
    contacts = _plan_use(plan, use_s, rng)
    begin_s = contacts[-1].begin_s + contacts[-1].timeline.duration_s + 10.0
    approach = replace(plan.approaches[int(rng.integers(len(plan.approaches)))], force_n=FORCE_N)
    timeline = replace(plan.timeline, hold_s=hold_s)
    lasting = TimedIndentation(PlannedIndentation("lasting", approach, len(contacts), 0), begin_s, timeline)
    end_s = begin_s + timeline.duration_s
    effects = (
        f"drift warm_up counts={DEGREES * COUNTS_PER_DEGREE:.1f} seconds={WARM_UP_S:.0f}",
        f"drift wander counts={AMBIENT_COUNTS:.1f} seconds={AMBIENT_S:.0f}",
        "noise pink counts=2.0",
    )
    settings = indentation_settings(hand, seed=int(rng.integers(2**31)), effects=effects)
    runs = [run_emulated_stream(plan, some, settings, end_s + AFTER_S) for some in ([*contacts, lasting], contacts)]
    board = np.repeat(np.arange(len(hand.boards)), [one.kind.taxel_count for one in hand.boards])
    release_s = end_s - timeline.recovery_s
    return LastingContact(runs[0], runs[1], begin_s + timeline.baseline_s, release_s, board)


def _sample_plan(hand: Hand, rng: np.random.Generator) -> IndentationPlan:
    """Sample a plan of six approaches; repeated, because random objects may not fit the boards.

    Raises `TaxelError` if several samples do not fit.
    """
    for last in (*[False] * (MAX_ATTEMPTS - 1), True):
        try:
            return sample_indentation_plan(hand, int(rng.integers(2**31)), IndentationDesign(6, sessions=1, repeats=2))
        except TaxelError:
            if last:
                raise
    raise AssertionError


def _plan_use(plan: IndentationPlan, use_s: float, rng: np.random.Generator) -> list[TimedIndentation]:
    """Plan contacts with random pauses until at least `use_s` seconds, one contact or more."""
    found: list[TimedIndentation] = []
    time_s = FIRST_CONTACT_S
    while time_s < use_s or not found:
        approach = plan.approaches[int(rng.integers(len(plan.approaches)))]
        timeline = replace(plan.timeline, baseline_s=round(float(rng.uniform(4.1, 25.0)), 2))
        number = len(found)
        found.append(TimedIndentation(PlannedIndentation(f"t{number}", approach, number, 0), time_s, timeline))
        time_s += timeline.duration_s
    return found
