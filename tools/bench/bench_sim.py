"""How long a simulated grasp takes one core, and what the layer's contact in C gains against the same in NumPy."""

from __future__ import annotations

import statistics
import time

from figures import Figure, seconds

from taxel.campaign.setup import WRIST_LINK, Setup
from taxel.campaign.simulated import SimSettings, simulate_planned_grasp
from taxel.grasp.plan import PlannedGrasp, thesis_plan
from taxel.grasp.timeline import Timeline
from taxel.sim.closing import simulate_grasp
from taxel.sim.native_contact import NativeContact
from taxel.sim.scene import build_scene
from taxel.sim.soft_contact import LayerContact, SoftContact
from taxel.sim.soft_push import SOFT_STEP_S

GRASP_S = 0.7
"""Seconds of one core that a grasp may take, from the plan to what every taxel reads."""

REPEATS = 5


def _one_of_each() -> list[PlannedGrasp]:
    """A grasp of each object."""
    return list({planned.object: planned for planned in thesis_plan(1)}.values())


def _grasp_s(setup: Setup) -> float:
    """Mean over the objects of the median; of this process's own time, what others do on the machine counts little."""
    settings, medians = SimSettings(), []
    for planned in _one_of_each():
        times = []
        for _ in range(REPEATS + 1):  # the first finds the scene and the arm's joints
            begun = time.process_time()
            simulate_planned_grasp(setup, planned, settings)
            times.append(time.process_time() - begun)
        medians.append(statistics.median(times[1:]))
    return statistics.mean(medians)


def _load_ratio(setup: Setup) -> tuple[float, float]:
    """Time of NumPy over that of C, and seconds of a load in C, over a hand that closes and holds."""
    planned, settings = _one_of_each()[0], SimSettings()
    item, law = setup.objects[planned.object], settings.sensing.law
    line = Timeline(baseline_s=0.0, closing_s=2.0, hold_s=0.2, release_s=0.0, recovery_s=0.0)
    scene = build_scene(setup.hand, item, WRIST_LINK)
    motion = simulate_grasp(scene, setup.approach(planned), line, 1.0 / SOFT_STEP_S, law=law)

    def loads(contact: LayerContact) -> None:
        for poses, pose in zip(motion.sensor_poses, motion.object_pose, strict=True):
            contact.load(poses, pose)

    numpy = seconds(lambda: loads(SoftContact(setup.hand, item.shape, law)))
    native = seconds(lambda: loads(NativeContact(setup.hand, item.shape, law)))
    return numpy / native, native / len(motion.time_s)


def measure() -> list[Figure]:
    """Seconds allowed over seconds taken, and native against NumPy."""
    setup = Setup()
    grasp = _grasp_s(setup)
    ratio, load = _load_ratio(setup)
    taxels = f"{setup.hand.n_taxels} taxels"
    return [
        Figure("simulated grasp", GRASP_S / grasp, 1.0, f"{GRASP_S:g} s of one core", f"{grasp:.2f} s, {taxels}"),
        Figure("layer's contact in C", ratio, 3.0, "the same in NumPy", f"{1e6 * load:.0f} µs a step"),
    ]
