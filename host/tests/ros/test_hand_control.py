"""Hand control from ROS: checks of joint commands, and the control of a virtual hand on CAN in lock step."""

import itertools
import math
from collections.abc import Iterator

import can
import numpy as np
import pytest

from taxel.hand.allegro import AllegroHand, FreeJoints, VirtualAllegro
from taxel.hand.joint_names import ROS_JOINT_NAMES
from taxel.ros.control_times import HOLD_AFTER_S, STOP_AFTER_S
from taxel.ros.hand_control import DEFAULT_LIMITS, ControlState, HandControl, JointTopicStoppedError
from taxel.ros.joint_command import JointCommandError, apply_original_rule, parse_command

TOPIC = "allegroHand_0/joint_cmd"
NAMES = list(ROS_JOINT_NAMES)
MIDDLE = (DEFAULT_LIMITS.lower + DEFAULT_LIMITS.upper) / 2
"""Angles in the middle of the permitted ranges, radians."""
PERIOD_S = 0.003
_channels = itertools.count()


class Bench:
    """A virtual hand on CAN, its driver and the control, which advance together in virtual time.

    The attribute `lines` contains the lines that the control has reported.
    """

    def __init__(self) -> None:
        name = f"hand-control-{next(_channels)}"
        self.buses = [can.Bus(name, "virtual"), can.Bus(name, "virtual")]
        self.virtual = VirtualAllegro(self.buses[1], FreeJoints())
        self.hand = AllegroHand(self.buses[0], clock=self.now_s, advance=self.virtual.step)
        self.lines: list[str] = []
        self.control = HandControl(self.hand, self.now_s, TOPIC, self.lines.append)

    def now_s(self) -> float:
        return self.virtual.time_s

    def run(self, seconds: float, commanded_angles: np.ndarray | None = None) -> None:
        """Run for some seconds of virtual time.

        commanded_angles: f64[16], radians, which a command contains in every period; None: no commands.
        """
        for _ in range(round(seconds / PERIOD_S)):
            if commanded_angles is not None:
                self.control.take(NAMES, commanded_angles.tolist(), [])
            self.virtual.step(PERIOD_S)
            self.control.tick()


@pytest.fixture
def bench() -> Iterator[Bench]:
    """A bench whose hand is open until the end of the test."""
    bench = Bench()
    with bench.hand:
        yield bench
    for bus in bench.buses:
        bus.shutdown()


def test_no_torque_and_no_time_limit_before_the_first_command(bench: Bench) -> None:
    bench.run(STOP_AFTER_S + 1.0)
    assert bench.control.state is ControlState.WAITING
    assert not bench.virtual.torque_command.any()


def test_hand_follows_commanded_positions(bench: Bench) -> None:
    commanded_angles = MIDDLE + 0.3
    bench.run(2.0, commanded_angles)
    # The control has no integral action, so the friction of the joints leaves an error.
    assert np.abs(bench.control.tick() - commanded_angles).max() < 0.12


def test_state_message_has_the_joint_names_the_measured_angles_and_the_time(bench: Bench) -> None:
    bench.run(0.1, MIDDLE)
    angles = bench.control.tick()
    message = bench.control.make_state_message("allegroHand_0/joint_states", angles, 5_000_000_007)
    assert message.message["name"] == NAMES
    np.testing.assert_array_equal(message.message["position"], angles)
    assert message.message["header"]["stamp"] == {"sec": 5, "nanosec": 7}


def test_effort_for_one_joint_changes_its_torque_and_leaves_the_position_command_of_another_joint(bench: Bench) -> None:
    bench.run(0.1, MIDDLE)
    bench.control.take(["joint_3.0"], [], [0.25])
    bench.run(0.06)
    assert bench.virtual.torque_command[3] == pytest.approx(0.25, abs=1e-3)
    assert abs(bench.virtual.torque_command[2]) < 0.05  # joint 2 is already at its commanded position


def test_stopped_topic_holds_the_position_and_then_switches_the_motors_off() -> None:
    bench = Bench()
    with pytest.raises(JointTopicStoppedError) as error, bench.hand:  # noqa: PT012  # the error ends the context
        bench.run(1.0, MIDDLE + 0.2)
        bench.run(HOLD_AFTER_S + 0.1)
        assert bench.control.state is ControlState.HOLDING
        hold_angles = bench.control.tick()
        bench.run(1.5)
        assert np.abs(bench.control.tick() - hold_angles).max() < 0.05
        bench.run(1.0)  # the time without a command exceeds STOP_AFTER_S
    assert str(error.value).startswith(f"{TOPIC}: no valid joint command for 2.0 s: the hand held its position")
    assert "\n" not in str(error.value)
    bench.virtual.step(PERIOD_S)
    assert not bench.virtual.servo_on
    assert not bench.virtual.torque_command.any()
    (line,) = bench.lines
    assert "the hand holds its position" in line
    for bus in bench.buses:
        bus.shutdown()


def test_holding_hand_follows_again_if_commands_return_before_the_stop(bench: Bench) -> None:
    bench.run(0.5, MIDDLE)
    bench.run(HOLD_AFTER_S + 0.3)
    assert bench.control.state is ControlState.HOLDING
    bench.run(0.1, MIDDLE)
    assert bench.control.state is ControlState.FOLLOWING


def test_rejected_commands_do_not_prevent_the_stop_and_equal_rejections_are_reported_once(bench: Bench) -> None:
    bench.run(0.5, MIDDLE)
    invalid_angles = MIDDLE.copy()
    invalid_angles[5] = math.nan
    with pytest.raises(JointTopicStoppedError):
        bench.run(STOP_AFTER_S + 1.0, invalid_angles)
    assert bench.control.rejected > 100
    (rejection,) = [line for line in bench.lines if "rejected" in line]
    assert "joint_5.0 (middle_1)" in rejection


@pytest.mark.parametrize(
    ("names", "position", "effort", "message"),
    [
        (["joint_5.0"], [math.inf], [], "joint_5.0 (middle_1): expected -0.196 to 1.61 rad, found inf"),
        (["joint_12.0"], [0.1], [], "joint_12.0 (thumb_0): expected 0.263 to 1.396 rad, found 0.1"),
        (["joint_0.0"], [], [1.5], "joint_0.0 (index_0): expected -1 to 1 of full PWM, found 1.5"),
        (["joint_0.0"], [], [math.nan], "joint_0.0 (index_0): expected -1 to 1 of full PWM, found nan"),
        (["elbow"], [0.0], [], "unknown joint 'elbow'; expected joint_0.0 to joint_15.0"),
        (["joint_0.0", "ff_j0"], [0.0, 0.0], [], "joint ff_j0 occurs twice"),
        (["joint_0.0", "joint_1.0"], [0.0], [], "expected 2 values of position, found 1"),
        ([], [0.0] * 15, [], "expected 16 values of position, found 15"),
        ([], [], [], "expected positions (rad) or efforts"),
    ],
)
def test_invalid_command_is_rejected_in_one_line_that_names_the_topic_and_the_problem(
    names: list[str], position: list[float], effort: list[float], message: str
) -> None:
    with pytest.raises(JointCommandError) as error:
        parse_command(TOPIC, names, position, effort, DEFAULT_LIMITS)
    assert str(error.value).startswith(f"{TOPIC}: command rejected: ")
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_original_rule_uses_positions_of_five_joints_and_torques_of_the_others() -> None:
    command = apply_original_rule(parse_command(TOPIC, [], MIDDLE.tolist(), [0.1] * 16, DEFAULT_LIMITS))
    assert np.flatnonzero(np.isfinite(command.position)).tolist() == [0, 4, 8, 12, 13]
    assert np.flatnonzero(np.isnan(command.torque)).tolist() == [0, 4, 8, 12, 13]
