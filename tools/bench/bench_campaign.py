"""Rate of grasp campaigns, compared with the rate needed for 144 grasps in the allowed time."""

import os
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from figures import Figure

from taxel.campaign.emulated import run_emulated
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.simulated import SimSettings, run_simulated
from taxel.grasp.plan import PlannedGrasp, make_thesis_plan

GRASPS = 144
SIM_S, EMULATED_S = 180.0, 360.0
"""Seconds allowed for a campaign of that many grasps on two cores."""

GRASPS_PER_SESSION = 3


def _make_short_plan() -> list[PlannedGrasp]:
    """Create a plan with a few grasps per session and as many sessions as processes.

    Every process then has the same load.
    """
    sessions = min(os.cpu_count() or 1, 6)
    plan: list[PlannedGrasp] = []
    for session in range(sessions):
        session_plan = [planned for planned in make_thesis_plan(1) if planned.session == session]
        plan += session_plan[:GRASPS_PER_SESSION]
    return plan


def _measure_rate(run_campaign: Callable[[Path], object], count: int) -> float:
    """Measure the grasps per second of a campaign of `count` grasps.

    run_campaign: writes the campaign to the given path.
    """
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        start = time.perf_counter()
        run_campaign(Path(folder) / "campaign.h5")
        return count / (time.perf_counter() - start)


def measure() -> list[Figure]:
    """Run the benchmark of campaigns: grasps per second in the simulator and in the emulator.

    The time includes the start of the processes.
    """
    plan = _make_short_plan()
    sim = _measure_rate(lambda path: run_simulated(path, plan, SimSettings()), len(plan))
    emulated = _measure_rate(lambda path: run_emulated(path, plan, EmulatedSettings()), len(plan))
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    child = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    memory = f"largest process {max(own, child) / 1024:.0f} MB"
    return [
        Figure(
            "grasp campaign, simulator",
            sim * SIM_S / GRASPS,
            1.0,
            f"{GRASPS} grasps in {SIM_S / 60:g} minutes",
            f"{sim:.2f} grasps/s; {memory}",
        ),
        Figure(
            "grasp campaign, emulated hand",
            emulated * EMULATED_S / GRASPS,
            1.0,
            f"{GRASPS} grasps in {EMULATED_S / 60:g} minutes",
            f"{emulated:.2f} grasps/s; default effects on; {memory}",
        ),
    ]
