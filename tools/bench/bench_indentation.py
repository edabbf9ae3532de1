"""Processor time of an indentation campaign, compared with the time available for each of hundreds of small worlds."""

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
"""Allowed seconds of one core for: a plan of 8 approaches, 6 sessions and 2 repeats; its emulation; the simulation of
8 x 4 indentations.
"""


def _measure_core_seconds(action: Callable[[], object]) -> float:
    """Measure the processor time of an action in this process and its children, in s.

    It depends less on the other load of the machine than the elapsed time.
    """

    def read_used_seconds() -> float:
        """Read the processor time in s that this process and its finished child processes have used."""
        uses = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        return sum(use.ru_utime + use.ru_stime for use in uses)

    before = read_used_seconds()
    action()
    return read_used_seconds() - before


def measure() -> list[Figure]:
    """Run the benchmark of indentation campaigns: allowed seconds divided by used processor seconds.

    Plan, emulated campaign and simulated campaign are measured with the default effects off.
    """
    hand = load_hand(HAND)
    plan_s = _measure_core_seconds(lambda: sample_indentation_plan(hand, SEED))
    plan = sample_indentation_plan(hand, SEED)
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        real, sim = Path(folder) / "real.h5", Path(folder) / "sim.h5"
        emulated = _measure_core_seconds(lambda: run_emulated_indentations(real, plan, indentation_settings(hand)))
        settings = SimIndentationSettings()
        simulated = _measure_core_seconds(lambda: run_simulated_indentations(sim, plan, settings))
        size = (real.stat().st_size + sim.stat().st_size) / 1e6
    indentation_count, simulated_count = len(plan.indentations), settings.repeats * len(plan.approaches)
    return [
        Figure(
            "indentation plan",
            PLAN_S / plan_s,
            1.0,
            f"{PLAN_S:g} s of one core",
            f"{plan_s:.2f} s, {HAND}, 8 approaches",
        ),
        Figure(
            "indentation campaign, emulated skin",
            EMULATED_S / emulated,
            1.0,
            f"{indentation_count} indentations in {EMULATED_S:g} s of one core",
            f"{emulated:.2f} s, {1e3 * emulated / indentation_count:.0f} ms per indentation",
        ),
        Figure(
            "indentation campaign, simulator",
            SIM_S / simulated,
            1.0,
            f"{simulated_count} indentations in {SIM_S:g} s of one core",
            f"{simulated:.2f} s; both files {size:.1f} MB",
        ),
    ]
