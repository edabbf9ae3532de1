"""A physical grasp campaign with an original hub: virtual hand, simulated arm, emulated original skin in real time."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import numpy as np

from taxel.campaign.physical import PhysicalSettings, Workstation, run_physical
from taxel.campaign.setup import Setup
from taxel.grasp.plan import make_thesis_plan
from taxel.grasp.timeline import Timeline
from taxel.hand import load_hand
from taxel.hand.allegro import AllegroHand, FreeJoints, VirtualAllegro
from taxel.hand.arm import UPRIGHT_RAD, SimulatedArm
from taxel.recording.grasp_dataset import GraspDataset
from taxel.skin import open_skin

CHANNEL = "original-hub-test"
TIMELINE = Timeline(baseline_s=1.0, closing_s=0.6, hold_s=1.0, release_s=0.6, recovery_s=0.4)
SILENCE_LIMIT_S = 1.2
"""Time without reports after which the driver raises an error; long, because a loaded machine can suspend the thread
of the virtual hand."""


@contextmanager
def open_workstation(setup: Setup) -> Iterator[Workstation]:
    """Open a workstation with a virtual hand in its own thread, an emulated original skin and a simulated arm."""
    stop = threading.Event()
    with can.Bus(CHANNEL, "virtual") as host_bus, can.Bus(CHANNEL, "virtual") as hand_bus:
        thread = threading.Thread(target=VirtualAllegro(hand_bus, FreeJoints()).run, args=(stop,))
        thread.start()
        try:
            with (
                AllegroHand(host_bus, silence_limit_s=SILENCE_LIMIT_S, reply_timeout_s=SILENCE_LIMIT_S) as hand,
                open_skin("emulator:?protocol=original", setup.hand) as skin,
            ):
                arm = SimulatedArm(UPRIGHT_RAD)
                yield Workstation(arm, hand, skin, arm.step)
        finally:
            stop.set()
            thread.join()


def test_physical_campaign_records_a_grasp_with_the_frames_of_an_original_hub(tmp_path: Path) -> None:
    setup = Setup(load_hand("original"))
    grasps = [planned for planned in make_thesis_plan(1) if planned.object == "cylinder"][:1]
    path = tmp_path / "real.h5"
    with open_workstation(setup) as station:
        run_physical(path, tuple(grasps), station, PhysicalSettings(TIMELINE, lambda _: None), setup)
    with GraspDataset(path) as data:
        data.check()
        (grasp,) = data
        assert grasp.raw_counts.shape[1] == 1037
        assert np.diff(grasp.timestamp).mean() < 0.25
