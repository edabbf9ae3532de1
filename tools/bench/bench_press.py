"""How long a press campaign takes one core, against what hundreds of small worlds allow for each."""

from __future__ import annotations

import resource
import tempfile
from collections.abc import Callable
from pathlib import Path

from figures import Figure

from taxel.campaign.indentation import (
    SimIndentationSettings,
    indentation_settings,
    run_emulated_indentations,
    run_simulated_indentations,
    sample_indentation_plan,
)
from taxel.hand import load_hand

HAND, SEED = "rig4", 1
PLAN_S, EMULATED_S, SIM_S = 1.0, 5.0, 2.0
"""Seconds of one core for a plan of 8 approaches, 6 sessions, 2 repeats, for its presses, and for 8 x 4 simulated."""


def _core_seconds(action: Callable[[], object]) -> float:
    """Of this process and those that it started: what others do on the machine meanwhile counts little."""

    def spent() -> float:
        uses = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        return sum(use.ru_utime + use.ru_stime for use in uses)

    before = spent()
    action()
    return spent() - before


def measure() -> list[Figure]:
    """Seconds allowed over seconds taken, default effects off."""
    hand = load_hand(HAND)
    drawn = _core_seconds(lambda: sample_indentation_plan(hand, SEED))
    plan = sample_indentation_plan(hand, SEED)
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        real, sim = Path(folder) / "real.h5", Path(folder) / "sim.h5"
        emulated = _core_seconds(lambda: run_emulated_indentations(real, plan, indentation_settings(hand)))
        simulated = _core_seconds(lambda: run_simulated_indentations(sim, plan, SimIndentationSettings()))
        size = (real.stat().st_size + sim.stat().st_size) / 1e6
    presses = len(plan.indentations)
    return [
        Figure("press plan", PLAN_S / drawn, 1.0, f"{PLAN_S:g} s of one core", f"{drawn:.2f} s, {HAND}, 8 approaches"),
        Figure(
            "press campaign, emulated skin",
            EMULATED_S / emulated,
            1.0,
            f"{presses} presses in {EMULATED_S:g} s of one core",
            f"{emulated:.2f} s, {1e3 * emulated / presses:.0f} ms a press",
        ),
        Figure(
            "press campaign, simulator",
            SIM_S / simulated,
            1.0,
            f"32 presses in {SIM_S:g} s of one core",
            f"{simulated:.2f} s; both files {size:.1f} MB",
        ),
    ]
