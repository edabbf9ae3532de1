"""A grasp of the emulated hand over CAN: encoder angles, commanded torques and faults."""

import itertools
from collections.abc import Iterator

import can
import numpy as np
import pytest

from taxel.campaign.free_object import FreeObject
from taxel.campaign.grasp_control import PERIOD_S, JointLog, control_grasp
from taxel.campaign.hand_in_contact import HandInContact
from taxel.campaign.motion import RECORD_PERIODS, SETTLE_S, simulate_grasp_motion
from taxel.emulated.contact import SkinContact
from taxel.emulated.scene import EmulatedScene, format_scene
from taxel.grasp.controller import GraspController
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand.allegro import AllegroHand, FreeJoints, VirtualAllegro
from taxel.hand.allegro.errors import AllegroSilentError, AllegroTemperatureError
from taxel.hand.allegro.protocol import FULL_PWM, RAD_PER_COUNT
from taxel.hand.allegro.virtual import MAX_TORQUE_NM

NM_PER_COUNT = MAX_TORQUE_NM / FULL_PWM
CHANNELS = itertools.count()
BRIEF = Timeline(baseline_s=0.1, closing_s=0.1, hold_s=0.1, release_s=0.1, recovery_s=0.0)
FULL_TORQUE = Timeline(baseline_s=0.4, closing_s=1.0, hold_s=0.5, release_s=0.4, recovery_s=0.2)
"""Timeline whose closing and hold phases are long enough for all fingers to reach their planned torques."""


class RecordingDynamics:
    """Joint dynamics that record the torque, the angles and the end time (seconds) of each step."""

    def __init__(self, inner) -> None:
        """Wrap the dynamics `inner`, which compute the motion."""
        self._inner = inner
        self.torques: list[np.ndarray] = []
        self.angle_log: list[np.ndarray] = []
        self.ends: list[float] = []

    def __getattr__(self, name: str):
        return getattr(self._inner, name)

    def select_steps(self, begin_s: float, log: JointLog) -> slice:
        """Select the recorded steps in the control period that begins `begin_s` seconds after the grasp's start.

        log: joint angles of the grasp; the last recorded step ends together with the last period of this log.
        """
        offset_s = self.ends[-1] - (log.time_s[-1] + PERIOD_S)
        ends = np.array(self.ends) - offset_s
        return slice(*np.searchsorted(ends, [begin_s + 1e-6, begin_s + PERIOD_S + 1e-6]).tolist())

    def step(self, torque_nm: np.ndarray, dt_s: float) -> np.ndarray:
        """Compute the motion of one step, record it and return the joint angles."""
        self.torques.append(torque_nm.copy())
        self.ends.append((self.ends[-1] if self.ends else 0.0) + dt_s)
        self.angle_log.append(self._inner.step(torque_nm, dt_s))
        return self.angle_log[-1]


class RecordingController(GraspController):
    """A controller that records its torques."""

    def compute_torque(self, t: float, angles: np.ndarray, velocities: np.ndarray) -> np.ndarray:
        """Compute the torques as the base class does, and append them to `commanded`."""
        torque_nm = super().compute_torque(t, angles, velocities)
        self.commanded.append(torque_nm)
        return torque_nm


@pytest.fixture(scope="module")
def timeline() -> Timeline:
    return FULL_TORQUE


@pytest.fixture(scope="module")
def controller(setup, plan, timeline):
    return GraspController(setup.approach(plan[0]), timeline)


@pytest.fixture(scope="module")
def grasp_motion(setup, plan, timeline):
    """Simulate one grasp; return its recording dynamics, its motion and its recording controller."""
    pose, approach = setup.object_pose("cylinder"), setup.approach(plan[0])
    with SkinContact(format_scene(setup.hand, EmulatedScene({"cylinder": setup.objects["cylinder"].shape}))) as contact:

        def compute_wrist_poses(times_s: np.ndarray) -> np.ndarray:
            """Compute the planned poses of the wrist at times since the start of the grasp, seconds."""
            return np.stack(
                [pose @ approach.compute_palm_pose_at(timeline.get_withdrawal(time)) for time in times_s.tolist()]
            )

        wrist = compute_wrist_poses(np.zeros(1))[0]
        item = FreeObject(setup.objects["cylinder"].shape, pose)
        hand = HandInContact(setup.hand, setup.wrist_robot, contact, 0, item, wrist, approach.open_angles)
        dynamics, controller = RecordingDynamics(hand), RecordingController(approach, timeline)
        controller.commanded = []
        return dynamics, simulate_grasp_motion(dynamics, controller, timeline, compute_wrist_poses), controller


def test_the_motion_is_recorded_every_three_periods_from_before_closing_to_the_end_of_the_release(
    grasp_motion, timeline
):
    _, motion, _ = grasp_motion
    assert motion.time_s[0] == pytest.approx(timeline.get_start_s(Phase.CLOSING) - SETTLE_S)
    assert timeline.get_end_s(Phase.RELEASE) - motion.time_s[-1] <= (RECORD_PERIODS + 0.5) * PERIOD_S
    assert np.diff(motion.time_s) == pytest.approx(RECORD_PERIODS * PERIOD_S)
    count = len(motion.time_s)
    assert motion.object_poses.shape == (count, 4, 4)
    assert motion.bracket_poses.shape == (count, 17, 4, 4)


def test_each_control_period_is_one_step_of_the_dynamics_that_ends_with_a_report(grasp_motion):
    dynamics, motion, _ = grasp_motion
    lengths = np.diff(dynamics.ends)[-len(motion.joints.time_s) + 1 :]
    assert lengths == pytest.approx(PERIOD_S)


def test_encoder_angles_match_the_true_angles_within_half_a_count_and_one_period(grasp_motion):
    dynamics, motion, _ = grasp_motion
    log = motion.joints
    for time_s, angles in zip(log.time_s[1:].tolist(), log.angles[1:], strict=True):
        true_angles = np.array(dynamics.angle_log[dynamics.select_steps(time_s - PERIOD_S, log)])
        assert np.abs(true_angles - angles).max(axis=1).min() < 0.51 * RAD_PER_COUNT  # 0.5 and rounding errors


def test_applied_torques_differ_from_the_commanded_torques_by_at_most_half_a_pwm_count(grasp_motion):
    dynamics, motion, controller = grasp_motion
    log = motion.joints
    assert len(controller.commanded) == len(log.time_s)
    for time_s, commanded in zip(log.time_s.tolist(), controller.commanded, strict=True):
        for torque in dynamics.torques[dynamics.select_steps(time_s, log)]:
            assert torque == pytest.approx(commanded, abs=0.51 * NM_PER_COUNT)  # 0.5 and rounding errors


def test_the_mean_commanded_torques_at_the_end_of_the_hold_are_those_of_the_plan(grasp_motion, timeline):
    """Joints that the plan holds at an angle (`is_held`) have no planned torque."""
    _, motion, controller = grasp_motion
    end_s = timeline.get_end_s(Phase.HOLD)
    hold = (motion.joints.time_s > end_s - 0.1) & (motion.joints.time_s < end_s)
    free = ~controller.approach.is_held
    mean = np.array(controller.commanded)[hold][:, free].mean(axis=0)
    assert mean == pytest.approx(controller.approach.torque[free], abs=0.05)


def test_the_grasp_displaces_the_object_by_less_than_50_mm(grasp_motion, setup):
    _, motion, _ = grasp_motion
    displacement_m = np.linalg.norm(motion.object_poses[:, :3, 3] - setup.object_pose("cylinder")[:3, 3], axis=1)
    assert 5e-5 < displacement_m.max() < 5e-2


def test_a_joint_log_interpolates_the_angles_and_is_constant_beyond_its_ends():
    log = JointLog(np.array([0.0, 1.0]), np.array([[0.0, 4.0], [1.0, 2.0]]))
    assert log.interpolate(np.array([-1.0, 0.5, 3.0])).tolist() == [[0.0, 4.0], [0.5, 3.0], [1.0, 2.0]]


@pytest.fixture
def free_hand() -> Iterator[tuple[VirtualAllegro, AllegroHand]]:
    """Yield a virtual hand that moves freely, and its driver."""
    channel = f"campaign-test-{next(CHANNELS)}"
    with can.Bus(channel, "virtual") as host_bus, can.Bus(channel, "virtual") as hand_bus:
        virtual = VirtualAllegro(hand_bus, FreeJoints())
        yield virtual, AllegroHand(host_bus, clock=lambda: virtual.time_s, advance=virtual.step)


def make_wait_for_period(virtual: VirtualAllegro, stride: int = 1):
    """Make a function that advances the virtual hand by `stride` control periods and returns the number of the period.

    A stride above 1 emulates missed periods.
    """
    number = itertools.count(step=stride)

    def wait() -> int:
        """Advance the virtual hand and return the number of the period."""
        virtual.step(stride * PERIOD_S)
        return next(number)

    return wait


def test_a_fault_of_the_hand_is_raised_clears_the_torques_and_closing_switches_the_servos_off(free_hand, controller):
    virtual, hand = free_hand

    def on_period(time_s: float) -> None:
        if time_s > 0.5:
            virtual.faults.temperature_c = 90

    with hand:
        with pytest.raises(AllegroTemperatureError, match="90 C"):
            control_grasp(hand, controller, 0.0, 3.0, make_wait_for_period(virtual), on_period)
        virtual.step(0.001)
        assert not virtual.torque_command.any()
    virtual.step(0.001)
    assert not virtual.servo_on


def test_a_hand_that_stops_responding_raises_the_error_of_the_driver(free_hand, controller):
    virtual, hand = free_hand

    def on_period(time_s: float) -> None:
        virtual.faults.is_silent = time_s > 0.5

    with hand, pytest.raises(AllegroSilentError, match="no pose of"):
        control_grasp(hand, controller, 0.0, 3.0, make_wait_for_period(virtual), on_period)


def test_any_exception_in_a_period_clears_the_torques(free_hand, controller):
    virtual, hand = free_hand

    def on_period(time_s: float) -> None:
        if time_s > 1.2:
            raise KeyboardInterrupt

    with hand:
        with pytest.raises(KeyboardInterrupt):
            control_grasp(hand, controller, 0.0, 3.0, make_wait_for_period(virtual), on_period)
        assert virtual.torque_command.any()  # the hand receives the command to clear the torques in its next step
        virtual.step(0.001)
        assert not virtual.torque_command.any()


def test_the_torques_are_zero_after_a_grasp(free_hand, controller):
    virtual, hand = free_hand
    with hand:
        control_grasp(hand, controller, 0.9, 1.4, make_wait_for_period(virtual))  # from 0.9 s to 1.4 s of a grasp
        virtual.step(0.001)
        assert not virtual.torque_command.any()


def test_missed_periods_do_not_lengthen_the_grasp(free_hand, setup, plan):
    """Each wait takes four control periods, so the controller misses three of them."""
    virtual, hand = free_hand
    controller = GraspController(setup.approach(plan[0]), BRIEF)
    times: list[float] = []
    with hand:
        start_s = virtual.time_s
        log = control_grasp(hand, controller, 0.0, BRIEF.duration_s, make_wait_for_period(virtual, 4), times.append)
        assert virtual.time_s - start_s == pytest.approx(BRIEF.duration_s, abs=8 * PERIOD_S)
    assert log.time_s.tolist() == times
    assert np.diff(log.time_s) == pytest.approx(4 * PERIOD_S)
    assert np.isfinite(log.angles).all()


def test_control_starts_when_every_finger_has_reported(free_hand, controller):
    virtual, hand = free_hand
    waits: list[int] = []

    def wait() -> int:
        """Return the number of the call; the hand reports no angles before the sixth call."""
        waits.append(len(waits))
        if len(waits) > 5:  # no time passes before the sixth call
            virtual.step(PERIOD_S)
        return waits[-1]

    with hand:
        log = control_grasp(hand, controller, 0.0, 0.03, wait)
    assert np.isfinite(log.angles).all()
    assert log.time_s == pytest.approx(PERIOD_S * np.arange(10))  # 0.03 s have ten periods of 3 ms
