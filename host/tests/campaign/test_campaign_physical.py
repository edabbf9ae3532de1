"""A physical campaign with a virtual hand, an emulated skin in real time and a simulated arm."""

import itertools
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import can
import numpy as np
import pytest

from taxel.campaign import planned_motion
from taxel.campaign.physical import PhysicalSettings, run_physical
from taxel.campaign.planned_motion import ArmTimeoutError, Workstation
from taxel.campaign.setup import Setup
from taxel.cli.workstation import open_workstation
from taxel.errors import TaxelError
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand.allegro import AllegroHand, FreeJoints, VirtualAllegro
from taxel.hand.allegro.errors import AllegroSilentError
from taxel.hand.arm import UPRIGHT_RAD, SimulatedArm
from taxel.planning.errors import MotionPlanningError
from taxel.recording.errors import DatasetError
from taxel.recording.grasp_dataset import GraspDataset
from taxel.skin import open_skin

CHANNELS = itertools.count()
LONG_TIMELINE = Timeline(baseline_s=0.5, closing_s=0.5, hold_s=0.6, release_s=0.4, recovery_s=0.2)
SHORT_TIMELINE = Timeline(baseline_s=0.3, closing_s=0.2, hold_s=0.3, release_s=0.2, recovery_s=0.1)
SILENCE_LIMIT_S = 3.0
"""Time without reports after which the driver raises an error; long, because a loaded machine can suspend the thread
of the virtual hand."""


@dataclass
class Rig:
    """A workstation, its virtual hand and its simulated arm."""

    station: Workstation
    virtual: VirtualAllegro
    arm: SimulatedArm


@contextmanager
def open_rig(setup, silence_limit_s: float = SILENCE_LIMIT_S) -> Iterator[Rig]:
    """Open a workstation with a virtual hand in its own thread, an emulated skin in real time and a simulated arm."""
    channel, stop = f"physical-test-{next(CHANNELS)}", threading.Event()
    with can.Bus(channel, "virtual") as host_bus, can.Bus(channel, "virtual") as hand_bus:
        virtual = VirtualAllegro(hand_bus, FreeJoints())
        thread = threading.Thread(target=virtual.run, args=(stop,))
        thread.start()
        try:
            with (
                AllegroHand(host_bus, silence_limit_s=silence_limit_s, reply_timeout_s=SILENCE_LIMIT_S) as hand,
                open_skin("emulator:?speed=real", setup.hand) as skin,
            ):
                arm = SimulatedArm(UPRIGHT_RAD)
                yield Rig(Workstation(arm, hand, skin, arm.step), virtual, arm)
        finally:
            stop.set()
            thread.join()


def is_eventually(condition: Callable[[], bool]) -> bool:
    """Return whether the condition is fulfilled within 30 s."""
    end = time.monotonic() + 10 * SILENCE_LIMIT_S
    while not condition() and time.monotonic() < end:
        time.sleep(0.005)
    return condition()


@pytest.fixture(scope="module")
def finished_campaign(setup, plan, tmp_path_factory):
    """Run a campaign of two grasps; yield its file, the confirmed placements and the rig, which is still open."""
    path, placements = tmp_path_factory.mktemp("physical") / "real.h5", []
    with open_rig(setup) as rig:
        run_physical(path, plan, rig.station, PhysicalSettings(LONG_TIMELINE, placements.append), setup)
        yield path, placements, rig


def test_the_file_has_the_grasps_with_their_phases(finished_campaign, plan):
    with GraspDataset(finished_campaign[0]) as data:
        data.check()
        assert data.source == "real"
        assert data.ids == tuple(planned.id for planned in plan)
        for grasp in data:
            assert set(grasp.phase.tolist()) == set(Phase)
            assert (np.diff(grasp.phase.astype(int)) >= 0).all()
            assert grasp.timestamp[-1] - grasp.timestamp[0] < LONG_TIMELINE.duration_s


def test_most_frames_of_an_untouched_skin_are_valid_with_counts_above_1000_and_ascending_times(finished_campaign):
    with GraspDataset(finished_campaign[0]) as data:
        for grasp in data:
            assert grasp.valid.mean() > 0.9
            assert grasp.raw_counts[grasp.valid.all(axis=1)].min() > 1000
            assert (np.diff(grasp.sensor_time, axis=0) >= 0).all()


def test_the_arm_is_withdrawn_in_the_baseline_and_at_the_object_at_the_end_of_the_hold(finished_campaign, setup, plan):
    """The withdrawal of a pose of the palm is 1 for the withdrawn arm, and 0 at the object."""
    with GraspDataset(finished_campaign[0]) as data:
        for planned, grasp in zip(plan, data, strict=True):
            approach, object_pose = setup.approach(planned), setup.object_pose(planned.object)
            baseline = grasp.joint_position[grasp.phase == Phase.BASELINE][:, :6]
            withdrawn = setup.wrist_poses(baseline) - object_pose @ approach.compute_palm_pose_at(1.0)
            assert np.abs(withdrawn).max() < 1e-8
            at_object = setup.wrist_poses(grasp.joint_position[grasp.phase == Phase.HOLD][-1:, :6])[0]
            assert at_object == pytest.approx(object_pose @ approach.compute_palm_pose_at(0.0), abs=1e-6)


def test_fingers_close_in_the_hold(finished_campaign, setup, plan):
    """The virtual hand meets no object, so every joint with a closing torque bends far."""
    with GraspDataset(finished_campaign[0]) as data:
        for planned, grasp in zip(plan, data, strict=True):
            closing = setup.approach(planned).torque > 0
            fingers = grasp.joint_position[grasp.phase == Phase.HOLD][-1, 6:]
            assert (fingers[closing] > 0.3).all()


def test_sensor_poses_are_those_of_the_mean_joint_angles_in_hold(finished_campaign, setup):
    with GraspDataset(finished_campaign[0]) as data:
        for grasp in data:
            mean = grasp.joint_position[grasp.phase == Phase.HOLD].mean(axis=0)
            assert grasp.sensor_pose == pytest.approx(setup.kinematics.compute_sensor_poses(mean))


def test_the_placement_is_confirmed_before_the_grasp_of_each_session(finished_campaign, plan):
    assert finished_campaign[1] == list(plan)


def test_the_torques_are_zero_after_the_grasps(finished_campaign):
    assert is_eventually(lambda: not finished_campaign[2].virtual.torque_command.any())


def test_a_resumed_campaign_does_not_repeat_a_grasp(finished_campaign, plan, setup):
    path, _, rig = finished_campaign
    placements = []
    run_physical(path, plan, rig.station, PhysicalSettings(LONG_TIMELINE, placements.append), setup, resume=True)
    assert placements == []
    with GraspDataset(path) as data:
        data.check()
        assert data.ids == tuple(planned.id for planned in plan)


def test_an_existing_file_is_rejected_without_resume(finished_campaign, plan, setup):
    path, _, rig = finished_campaign
    with pytest.raises(DatasetError):
        run_physical(path, plan, rig.station, PhysicalSettings(LONG_TIMELINE), setup)


def test_a_hand_that_stops_responding_ends_the_campaign_and_keeps_the_first_grasp(setup, plan, tmp_path):
    with open_rig(setup) as rig:

        def silence_hand(done: int, total: int) -> None:
            if done == 1:
                rig.virtual.faults.is_silent = True

        settings = PhysicalSettings(LONG_TIMELINE)
        with pytest.raises(AllegroSilentError, match="no pose of") as caught:
            run_physical(tmp_path / "real.h5", plan, rig.station, settings, setup, progress=silence_hand)
        assert "\n" not in str(caught.value)
        rig.arm.step(60.0)
        assert not rig.arm.is_moving
        rig.virtual.faults.is_silent = False
    with GraspDataset(tmp_path / "real.h5") as data:
        data.check()
        assert data.ids == (plan[0].id,)


def test_a_hand_that_stops_responding_during_a_grasp_stops_arm_and_torques(setup, plan, tmp_path):
    with open_rig(setup, silence_limit_s=1.2) as rig:  # shorter than the grasp
        joint_angles = rig.arm.read_joint_angles

        def read_angles_with_fault() -> np.ndarray:
            """Read the arm's angles; as soon as the hand has torques, one of its fingers stops responding."""
            if rig.virtual.torque_command.any():
                rig.virtual.faults.dropped_fingers = {2}
            return joint_angles()

        rig.arm.read_joint_angles = read_angles_with_fault
        with pytest.raises(AllegroSilentError, match="no pose of"):
            run_physical(tmp_path / "real.h5", plan, rig.station, PhysicalSettings(LONG_TIMELINE), setup)
        assert is_eventually(lambda: not rig.virtual.torque_command.any())
        rig.arm.step(60.0)
        assert not rig.arm.is_moving
    assert not rig.virtual.servo_on
    with GraspDataset(tmp_path / "real.h5") as data:
        assert data.ids == ()


def test_a_lost_skin_ends_the_campaign_with_a_one_line_error_and_without_torques(setup, plan, tmp_path):
    with open_rig(setup) as rig:
        settings = PhysicalSettings(SHORT_TIMELINE, lambda _: rig.station.skin.link._process.kill())
        with pytest.raises(TaxelError) as caught:
            run_physical(tmp_path / "real.h5", plan, rig.station, settings, setup)
        assert "\n" not in str(caught.value)
        assert is_eventually(lambda: not rig.virtual.torque_command.any())


def test_an_arm_that_does_not_reach_its_target_is_stopped_and_ends_the_campaign(setup, plan, tmp_path, monkeypatch):
    monkeypatch.setattr(planned_motion, "ARM_TIMEOUT_S", 0.2)
    stops = []

    class StuckArm(SimulatedArm):
        def stop(self) -> None:
            stops.append(1)

    with open_rig(setup) as rig:
        station = Workstation(
            StuckArm(UPRIGHT_RAD), rig.station.hand, rig.station.skin, lambda seconds: time.sleep(0.01)
        )
        with pytest.raises(ArmTimeoutError, match=r"^arm: expected to reach its target within 0.2 s, .*$"):
            run_physical(tmp_path / "real.h5", plan, station, PhysicalSettings(SHORT_TIMELINE), setup)
    assert stops


@pytest.mark.parametrize("arm", ["", "ur5e", "rtde", "rtde:", "simulated:", "simulated:x", "Simulated"])
def test_an_unknown_arm_is_rejected_before_a_device_is_opened(arm, setup):
    expected = f"^--arm: expected rtde:HOST or simulated, found '{arm}'$"
    with pytest.raises(TaxelError, match=expected), open_workstation(arm, "can:nothing", "nothing", setup.hand):
        raise AssertionError("a device was opened")


def test_a_missing_skin_leaves_the_hand_switched_off(setup, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    channel, stop = f"physical-test-{next(CHANNELS)}", threading.Event()
    with can.Bus(channel, "virtual") as hand_bus:
        virtual = VirtualAllegro(hand_bus, FreeJoints())
        thread = threading.Thread(target=virtual.run, args=(stop,))
        thread.start()
        try:
            station = open_workstation("simulated", f"can:virtual:{channel}", "serial:///dev/nothing", setup.hand)
            with pytest.raises(TaxelError, match="nothing") as caught, station:
                raise AssertionError("a device was opened")
            assert "\n" not in str(caught.value)
            assert is_eventually(lambda: not virtual.servo_on)
        finally:
            stop.set()
            thread.join()


@pytest.mark.parametrize(
    ("angles", "shift_m", "expected"),
    [
        (
            (0.0,) * 6,
            0.0,
            r"^object cylinder, approach side_\d: start posture in collision: .* and table overlap by .*$",
        ),
        (UPRIGHT_RAD, 1.2, r"^object cylinder, approach side_\d: unreachable: the arm cannot place the palm at .*$"),
    ],
    ids=["start posture in collision", "unreachable object"],
)
def test_an_infeasible_motion_is_reported_before_anything_moves(angles, shift_m, expected, plan, tmp_path):
    class ShiftedSetup(Setup):
        def object_pose(self, name: str) -> np.ndarray:
            """Return the planned pose, shifted away from the arm."""
            pose = super().object_pose(name).copy()
            pose[0, 3] += shift_m
            return pose

    setup, placements = ShiftedSetup(), []
    with open_rig(setup) as rig:
        arm = SimulatedArm(angles)
        station = Workstation(arm, rig.station.hand, rig.station.skin, arm.step)
        with pytest.raises(MotionPlanningError, match=expected) as caught:
            run_physical(
                tmp_path / "real.h5", plan, station, PhysicalSettings(SHORT_TIMELINE, placements.append), setup
            )
        assert arm.read_joint_angles() == pytest.approx(angles)
        assert not rig.virtual.torque_command.any()
    assert "\n" not in str(caught.value)
    assert placements == []
    with GraspDataset(tmp_path / "real.h5") as data:
        assert data.ids == ()
