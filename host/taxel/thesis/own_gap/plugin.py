"""Contacts of the original contact plug-in over the iterations of an approach, for any combination of its effects.

The plug-in belongs to the hand, which stays in the scene between the iterations of an approach. Without clearing, a
board that touches nothing therefore keeps the contact points of an earlier iteration.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from taxel.campaign.processes import map_in_processes
from taxel.campaign.progress import Progress, no_progress
from taxel.campaign.setup import Setup
from taxel.campaign.simulated import SimSettings, simulate_motion
from taxel.grasp.plan import PlannedGrasp
from taxel.grasp.timeline import Phase
from taxel.hand import Hand
from taxel.sim.contact_messages import ContactMessage
from taxel.sim.original_sensing import OriginalRules, sense_messages
from taxel.sim.sensing import Sensing
from taxel.thesis.own_gap.effects import OwnEffects
from taxel.types import BoolArray, FloatArray

ITERATION_S = 1000.0
"""Shift of the message times of an earlier iteration, seconds; longer than any grasp."""


@dataclass(frozen=True, eq=False)
class PluginGrasp:
    """One simulated grasp with its contact messages.

    Attributes:
        object, approach: names. iteration: number of earlier grasps of the approach.
        sensor_pose: f64[s, 4, 4], brackets in the world when the plug-in saves, metres.
        object_pose: f64[4, 4], nominal pose of the object in the world.
        saved_s: time at which the plug-in saves, seconds of the grasp: the last sample of hold.
        messages: all messages of the grasp in ascending order of time, also those after `saved_s`.
    """

    object: str
    approach: str
    iteration: int
    sensor_pose: FloatArray
    object_pose: FloatArray
    saved_s: float
    messages: tuple[ContactMessage, ...]


def simulate_plugin_grasps(
    plan: Sequence[PlannedGrasp],
    settings: SimSettings,
    setup: Setup,
    jobs: int | None = None,
    progress: Progress = no_progress,
) -> list[PluginGrasp]:
    """Simulate the grasps of a plan with the contact sensors of the original simulation, in the order of the plan.

    jobs: number of processes. progress: called with the number of finished grasps and the total. Raises TaxelError.
    """
    original = replace(settings, sensing=Sensing("original"))
    grasps = []
    for grasp in map_in_processes(_simulate, setup, plan, original, jobs, 2):  # two grasps per task of a process
        grasps.append(grasp)
        progress(len(grasps), len(plan))
    return grasps


def _simulate(setup: Setup, planned: PlannedGrasp, settings: SimSettings) -> PluginGrasp:
    """Simulate one planned grasp; return its contact messages and the poses when the plug-in saves."""
    motion = simulate_motion(setup, planned, settings)
    assert motion.messages is not None  # recorded with the sensing level "original"
    saved = int(np.flatnonzero(motion.phase == Phase.HOLD)[-1])
    return PluginGrasp(
        planned.object,
        planned.approach,
        planned.iteration,
        motion.sensor_poses[saved],
        setup.object_pose(planned.object),
        float(motion.time_s[saved]),
        motion.messages,
    )


def make_rules(effects: OwnEffects) -> OriginalRules:
    """Make the rules of the plug-in: stale contacts and coded centres as in `effects`, all others as in the
    original.
    """
    return OriginalRules(
        stale_contacts=effects.stale_contacts,
        coded_centres=effects.coded_simulation,
        boards_without_coordinates=True,
    )


def find_plugin_contacts(hand: Hand, grasps: Sequence[PluginGrasp], effects: OwnEffects) -> list[BoolArray]:
    """Find the taxels that the plug-in saves as active, bool[n] for each grasp in the order of `grasps`.

    The messages of the earlier iterations of an approach are processed before those of a grasp, because the plug-in may
    keep their contact points.
    """
    rules, active = make_rules(effects), [np.zeros(hand.n_taxels, bool) for _ in grasps]
    rows: dict[tuple[str, str], list[int]] = defaultdict(list)
    for row in sorted(range(len(grasps)), key=lambda row: grasps[row].iteration):
        rows[grasps[row].object, grasps[row].approach].append(row)
    for of_approach in rows.values():
        earlier: list[ContactMessage] = []
        for row in of_approach:
            grasp = grasps[row]
            messages = [*earlier, *grasp.messages]
            time_s = np.array([grasp.saved_s])
            active[row] = sense_messages(hand, grasp.sensor_pose[None], time_s, messages, rules).active[0]
            # Only a message with contacts outlasts its grasp: without stale contacts, the first messages of the next
            # grasp replace or clear the points of every board.
            kept = [message for message in messages if message.entries] if rules.stale_contacts else []
            earlier = [replace(message, time_s=message.time_s - ITERATION_S) for message in kept]
    return active
