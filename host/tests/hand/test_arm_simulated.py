"""The simulated arm moves exactly as told, in virtual time, and refuses what a UR5e would not do."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.errors import TaxelError
from taxel.hand.arm import Arm, ArmBusyError, ArmLimitError, SimulatedArm
from taxel.hand.arm.simulated import TrapezoidalProfile

TARGET = [0.5, -1.0, 1.5, -0.25, 0.0, 2.0]


def one_line(error: BaseException) -> str:
    text = str(error)
    assert isinstance(error, TaxelError)
    assert "\n" not in text
    assert str(pickle.loads(pickle.dumps(error))) == text
    return text


def duration_of(arm: SimulatedArm, dt_s: float = 0.01) -> int:
    steps = 0
    while arm.is_moving:
        arm.step(dt_s)
        steps += 1
        assert steps < 100_000
    return steps


def test_it_arrives_at_the_target_and_stands() -> None:
    arm: Arm = SimulatedArm()
    arm.move_joints(TARGET, 1.0)
    assert arm.is_moving
    assert isinstance(arm, SimulatedArm)
    duration_of(arm)
    np.testing.assert_allclose(arm.read_joint_angles(), TARGET, atol=1e-12)


def test_the_way_takes_the_time_of_the_trapezoid() -> None:
    arm = SimulatedArm(acceleration_rad_s2=2.0)
    arm.move_joints(TARGET, 1.0)  # 2 rad at 1 rad/s, half a second of ramp each: 2 / 1 + 1 / 2
    assert abs(duration_of(arm) - 250) <= 1


def test_all_joints_move_along_one_line_and_the_furthest_keeps_the_speed() -> None:
    arm = SimulatedArm(acceleration_rad_s2=2.0)
    arm.move_joints(TARGET, 1.0)
    path = []
    while arm.is_moving:
        arm.step(0.01)
        path.append(arm.read_joint_angles())
    share = np.array(path)[:, 5] / 2.0
    np.testing.assert_allclose(np.array(path), np.outer(share, TARGET), atol=1e-12)
    assert np.abs(np.diff(np.array(path)[:, 5])).max() == pytest.approx(0.01)


@settings(deadline=None)
@given(st.floats(1e-6, 10.0), st.floats(1e-3, 3.0), st.floats(0.1, 5.0), st.floats(0.0, 1.0))
def test_the_profile_is_continuous_and_keeps_speed_and_acceleration(
    distance: float, speed: float, acceleration: float, share: float
) -> None:
    profile = TrapezoidalProfile(distance, speed, acceleration)
    at_s = share * profile.duration_s
    after_s = at_s + 1e-3 * profile.duration_s
    (way, fast), (way_after, fast_after) = profile.at(at_s), profile.at(after_s)
    slack = 1e-9 * (1 + distance + speed)
    assert -slack <= way <= way_after + slack <= distance + 2 * slack
    assert -slack <= fast <= speed + slack
    assert abs(fast_after - fast) <= acceleration * (after_s - at_s) + slack
    assert way_after - way <= speed * (after_s - at_s) + slack


def test_a_stop_brakes_along_the_line_within_the_braking_distance() -> None:
    arm = SimulatedArm(acceleration_rad_s2=2.0)
    arm.move_joints(TARGET, 1.0)
    for _ in range(100):
        arm.step(0.01)
    before = arm.read_joint_angles()
    arm.stop()
    duration_of(arm, 0.003)
    after = arm.read_joint_angles()
    assert after[5] - before[5] == pytest.approx(1.0**2 / (2 * 2.0))
    np.testing.assert_allclose(after, after[5] / 2.0 * np.array(TARGET), atol=1e-12)
    arm.move_joints(TARGET, 1.0)
    duration_of(arm)
    np.testing.assert_allclose(arm.read_joint_angles(), TARGET, atol=1e-12)


def test_a_stop_before_the_first_step_leaves_it_where_it_is() -> None:
    arm = SimulatedArm()
    arm.move_joints(TARGET, 1.0)
    arm.stop()
    arm.step(0.01)
    assert not arm.is_moving
    assert arm.read_joint_angles().tolist() == [0.0] * 6


def test_a_target_where_it_stands_is_no_motion() -> None:
    arm = SimulatedArm(TARGET)
    arm.move_joints(TARGET, 1.0)
    assert not arm.is_moving


def test_a_second_motion_is_refused_while_one_is_under_way() -> None:
    arm = SimulatedArm()
    arm.move_joints(TARGET, 1.0)
    with pytest.raises(ArmBusyError, match=r"stop\(\) it first") as caught:
        arm.move_joints([0.0] * 6, 1.0)
    one_line(caught.value)


@pytest.mark.parametrize(
    ("target", "speed", "words"),
    [
        ([0, 0, 3.2, 0, 0, 0], 1.0, "elbow: expected -3.1416 to 3.1416 rad, found 3.2000"),
        ([6.3, 0, 0, 0, 0, 0], 1.0, "shoulder_pan: expected -6.2832 to 6.2832 rad"),
        ([0, 0, 0, 0, 0, math.nan], 1.0, "wrist_3"),
        ([0] * 5, 1.0, "expected 6 joint angles"),
        (TARGET, 0.0, "speed: expected above 0"),
        (TARGET, 4.0, "at most 3.1416 rad/s, found 4.0"),
        (TARGET, math.nan, "speed"),
    ],
)
def test_what_the_arm_will_not_do_is_refused_before_any_motion(target: list[float], speed: float, words: str) -> None:
    arm = SimulatedArm()
    with pytest.raises(ArmLimitError) as caught:
        arm.move_joints(target, speed)
    assert words in one_line(caught.value)
    assert "has not moved" in str(caught.value)
    assert not arm.is_moving


def test_a_start_outside_the_limits_and_a_step_back_in_time_are_refused() -> None:
    with pytest.raises(ArmLimitError):
        SimulatedArm([7.0] * 6)
    with pytest.raises(ValueError, match="dt_s"):
        SimulatedArm().step(-0.1)
    with pytest.raises(ValueError, match="acceleration"):
        SimulatedArm(acceleration_rad_s2=0.0)
