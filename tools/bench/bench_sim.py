"""Processor time of a simulated grasp, and the gain of the layer's contact in C over the NumPy version."""

import statistics
import time

from figures import Figure, measure_median_seconds

from taxel.campaign.setup import WRIST_LINK, Setup
from taxel.campaign.simulated import SimSettings, simulate_planned_grasp
from taxel.grasp.plan import PlannedGrasp, make_thesis_plan
from taxel.grasp.timeline import Timeline
from taxel.sim.closing import SimulationSettings, simulate_grasp
from taxel.sim.native_contact import NativeContact
from taxel.sim.scene import build_scene
from taxel.sim.soft_contact import LayerContact, SoftContact
from taxel.sim.soft_push import SOFT_STEP_S

GRASP_S = 0.7
"""Allowed seconds of one core per grasp, from the plan to the counts of every taxel."""

REPEATS = 5


def _select_one_grasp_per_object() -> list[PlannedGrasp]:
    """Select one planned grasp of each object."""
    return list({planned.object: planned for planned in make_thesis_plan(1)}.values())


def _measure_grasp_s(setup: Setup) -> float:
    """Measure the processor time in s to simulate one grasp: median over repeats, mean over the objects."""
    settings, medians = SimSettings(), []
    for planned in _select_one_grasp_per_object():
        times = []
        for _ in range(REPEATS + 1):  # the first run builds the scene and solves the inverse kinematics
            start = time.process_time()
            simulate_planned_grasp(setup, planned, settings)
            times.append(time.process_time() - start)
        medians.append(statistics.median(times[1:]))
    return statistics.mean(medians)


def _compare_contact_models(setup: Setup) -> tuple[float, float]:
    """Compare the contact model in C with the one in NumPy for a hand that closes and holds an object.

    Returns the time of NumPy divided by the time of C, and the time of C per step in seconds.
    """
    planned, settings = _select_one_grasp_per_object()[0], SimSettings()
    item, law = setup.objects[planned.object], settings.sensing.law
    line = Timeline(baseline_s=0.0, closing_s=2.0, hold_s=0.2, release_s=0.0, recovery_s=0.0)
    scene = build_scene(setup.hand, item, WRIST_LINK)
    simulation = SimulationSettings(rate_hz=1.0 / SOFT_STEP_S, law=law)
    motion = simulate_grasp(scene, setup.approach(planned), line, simulation)

    def compute_loads(contact: LayerContact) -> None:
        """Compute the forces on the taxels for every frame of the motion with a contact model."""
        for poses, pose in zip(motion.sensor_poses, motion.object_pose, strict=True):
            contact.compute_load(poses, pose)

    numpy = measure_median_seconds(lambda: compute_loads(SoftContact(setup.hand, item.shape, law)))
    native = measure_median_seconds(lambda: compute_loads(NativeContact(setup.hand, item.shape, law)))
    return numpy / native, native / len(motion.time_s)


def measure() -> list[Figure]:
    """Run the benchmark of the simulator.

    The ratios are allowed seconds per grasp divided by used seconds, and the speed of the contact model in C relative
    to NumPy.
    """
    setup = Setup()
    grasp = _measure_grasp_s(setup)
    ratio, load = _compare_contact_models(setup)
    taxels = f"{setup.hand.n_taxels} taxels"
    return [
        Figure("simulated grasp", GRASP_S / grasp, 1.0, f"{GRASP_S:g} s of one core", f"{grasp:.2f} s, {taxels}"),
        Figure("layer's contact in C", ratio, 3.0, "the layer's contact in NumPy", f"{1e6 * load:.0f} µs per step"),
    ]
