"""The simulated arm follows its commands exactly in virtual time and applies the limits of the UR5e."""

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


def assert_one_line(error: BaseException) -> str:
    """Check that an error is a one-line TaxelError that can be pickled; return its text."""
    text = str(error)
    assert isinstance(error, TaxelError)
    assert "\n" not in text
    assert str(pickle.loads(pickle.dumps(error))) == text
    return text


def run_until_standstill(arm: SimulatedArm, dt_s: float = 0.01) -> int:
    """Advance an arm in steps of `dt_s` until it stands; return the number of steps."""
    steps = 0
    while arm.is_moving:
        arm.step(dt_s)
        steps += 1
        assert steps < 100_000
    return steps


def test_the_arm_reaches_its_target_and_stops() -> None:
    arm: Arm = SimulatedArm()
    arm.move_joints(TARGET, 1.0)
    assert arm.is_moving
    assert isinstance(arm, SimulatedArm)
    run_until_standstill(arm)
    np.testing.assert_allclose(arm.read_joint_angles(), TARGET, atol=1e-12)


def test_a_motion_takes_the_duration_of_the_trapezoidal_profile() -> None:
    arm = SimulatedArm(acceleration_rad_s2=2.0)
    arm.move_joints(TARGET, 1.0)  # 2 rad at 1 rad/s, half a second of ramp each: 2 / 1 + 1 / 2
    assert abs(run_until_standstill(arm) - 250) <= 1


def test_joints_move_along_a_line_and_the_largest_motion_has_the_requested_speed() -> None:
    arm = SimulatedArm(acceleration_rad_s2=2.0)
    arm.move_joints(TARGET, 1.0)
    path = []
    while arm.is_moving:
        arm.step(0.01)
        path.append(arm.read_joint_angles())
    # Joint 5 has the largest motion, 2 rad. At 1 rad/s it moves by at most 0.01 rad in a step of 0.01 s.
    fraction = np.array(path)[:, 5] / 2.0
    np.testing.assert_allclose(np.array(path), np.outer(fraction, TARGET), atol=1e-12)
    assert np.abs(np.diff(np.array(path)[:, 5])).max() == pytest.approx(0.01)


@settings(deadline=None)
@given(st.floats(1e-6, 10.0), st.floats(1e-3, 3.0), st.floats(0.1, 5.0), st.floats(0.0, 1.0))
def test_the_profile_is_continuous_within_its_speed_and_acceleration(
    distance: float, speed: float, acceleration: float, fraction: float
) -> None:
    profile = TrapezoidalProfile(distance, speed, acceleration)
    time_s = fraction * profile.duration_s
    later_s = time_s + 1e-3 * profile.duration_s
    (distance_1, speed_1), (distance_2, speed_2) = profile.evaluate(time_s), profile.evaluate(later_s)
    tolerance = 1e-9 * (1 + distance + speed)
    assert -tolerance <= distance_1 <= distance_2 + tolerance <= distance + 2 * tolerance
    assert -tolerance <= speed_1 <= speed + tolerance
    assert abs(speed_2 - speed_1) <= acceleration * (later_s - time_s) + tolerance
    assert distance_2 - distance_1 <= speed * (later_s - time_s) + tolerance


def test_a_stop_brakes_along_the_line_within_the_braking_distance() -> None:
    arm = SimulatedArm(acceleration_rad_s2=2.0)
    arm.move_joints(TARGET, 1.0)
    for _ in range(100):
        arm.step(0.01)
    before = arm.read_joint_angles()
    arm.stop()
    run_until_standstill(arm, 0.003)
    after = arm.read_joint_angles()
    assert after[5] - before[5] == pytest.approx(1.0**2 / (2 * 2.0))  # speed^2 / (2 acceleration)
    np.testing.assert_allclose(after, after[5] / 2.0 * np.array(TARGET), atol=1e-12)
    arm.move_joints(TARGET, 1.0)
    run_until_standstill(arm)
    np.testing.assert_allclose(arm.read_joint_angles(), TARGET, atol=1e-12)


def test_a_stop_before_the_first_step_causes_no_motion() -> None:
    arm = SimulatedArm()
    arm.move_joints(TARGET, 1.0)
    arm.stop()
    arm.step(0.01)
    assert not arm.is_moving
    assert arm.read_joint_angles().tolist() == [0.0] * 6


def test_a_target_equal_to_the_current_angles_causes_no_motion() -> None:
    arm = SimulatedArm(TARGET)
    arm.move_joints(TARGET, 1.0)
    assert not arm.is_moving


def test_a_second_motion_is_rejected_during_a_motion() -> None:
    arm = SimulatedArm()
    arm.move_joints(TARGET, 1.0)
    with pytest.raises(ArmBusyError, match=r"or call stop\(\) first") as caught:
        arm.move_joints([0.0] * 6, 1.0)
    assert_one_line(caught.value)


@pytest.mark.parametrize(
    ("target", "speed", "message"),
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
def test_a_target_outside_the_limits_is_rejected_before_any_motion(
    target: list[float], speed: float, message: str
) -> None:
    arm = SimulatedArm()
    with pytest.raises(ArmLimitError) as caught:
        arm.move_joints(target, speed)
    assert message in assert_one_line(caught.value)
    assert "has not moved" in str(caught.value)
    assert not arm.is_moving


def test_invalid_start_angles_and_negative_steps_are_rejected() -> None:
    with pytest.raises(ArmLimitError):
        SimulatedArm([7.0] * 6)
    with pytest.raises(ValueError, match="dt_s"):
        SimulatedArm().step(-0.1)
    with pytest.raises(ValueError, match="acceleration"):
        SimulatedArm(acceleration_rad_s2=0.0)
