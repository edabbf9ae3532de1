"""The Allegro hand on its CAN channel: what it says, and what is said of it when something fails."""

from collections.abc import Iterator

import numpy as np
import pytest

from hil_tests.harness.rig import Rig
from taxel.hand.allegro import (
    JOINT_MAX_RAD,
    JOINT_MIN_RAD,
    AllegroBusError,
    AllegroHand,
    AllegroServoOffError,
    AllegroSilentError,
    AllegroTemperatureError,
)

pytestmark = pytest.mark.needs("can")
PERIOD_S = 0.003
SILENCE_LIMIT_S = 0.1
BUSY_S = 0.5  # what a machine may be busy with something else, on a rig in real time


@pytest.fixture
def hand(rig: Rig) -> Iterator[AllegroHand]:
    bus = rig.can.open()
    try:
        limit_s = SILENCE_LIMIT_S if rig.description.is_virtual else BUSY_S
        with AllegroHand(bus, clock=rig.can.now_s, advance=rig.can.let_pass, silence_limit_s=limit_s) as hand:
            yield hand
    except AllegroBusError:
        pass  # a channel that a test has left broken
    finally:
        bus.shutdown()


def go_on(rig: Rig, hand: AllegroHand, seconds: float) -> int:
    taken = 0
    for _ in range(round(seconds / PERIOD_S)):
        rig.can.let_pass(PERIOD_S)
        taken += hand.update()
    return taken


def test_the_hand_says_what_it_is(hand: AllegroHand) -> None:
    assert hand.get_info().hand_type == 0
    assert hand.get_info().servo_on
    assert len(hand.get_serial()) > 0


def test_poses_come_every_three_milliseconds(rig: Rig, hand: AllegroHand) -> None:
    assert go_on(rig, hand, 0.3) >= 4 * 90
    assert hand.read_joint_angles().age_s <= (2 * PERIOD_S if rig.description.is_virtual else BUSY_S)


def test_a_torque_moves_the_joint_that_it_is_meant_for(rig: Rig, hand: AllegroHand) -> None:
    go_on(rig, hand, 0.05)
    before = hand.read_joint_angles().angles
    demand = np.zeros(16)
    demand[5] = 0.2
    hand.set_torque(demand)
    go_on(rig, hand, 0.3)
    moved = hand.read_joint_angles().angles - before
    assert moved[5] > 0.01
    assert np.abs(np.delete(moved, 5)).max() < 0.25 * moved[5]


def test_angles_stay_in_the_joints_range(rig: Rig, hand: AllegroHand) -> None:
    hand.set_torque(np.full(16, 0.5))
    go_on(rig, hand, 1.0)
    angles = hand.read_joint_angles().angles
    assert (angles >= JOINT_MIN_RAD - 0.01).all()
    assert (angles <= JOINT_MAX_RAD + 0.01).all()


@pytest.mark.needs("can_faults")
def test_a_few_lost_frames_are_no_fault(rig: Rig, hand: AllegroHand) -> None:
    for count in (1, 3, 8):
        rig.can_faults.lose_frames(count)
        go_on(rig, hand, 0.1)
    assert hand.read_joint_angles().age_s <= 2 * PERIOD_S


@pytest.mark.needs("can_faults")
def test_a_channel_that_loses_everything_is_silence_by_name(rig: Rig, hand: AllegroHand) -> None:
    go_on(rig, hand, 0.1)
    rig.can_faults.lose_frames(100000)
    begun_s = rig.can.now_s()
    with pytest.raises(AllegroSilentError, match="no pose of index, middle"):
        go_on(rig, hand, 1.0)
    assert rig.can.now_s() - begun_s < SILENCE_LIMIT_S + 0.02
    rig.can_faults.lose_frames(0)
    hand.poll()
    rig.can.let_pass(PERIOD_S)
    go_on(rig, hand, 0.1)


@pytest.mark.needs("can_faults")
@pytest.mark.parametrize("finger", range(4))
def test_a_finger_that_is_silent_is_named(rig: Rig, hand: AllegroHand, finger: int) -> None:
    go_on(rig, hand, 0.1)
    rig.can_faults.silence_finger(finger, True)
    with pytest.raises(AllegroSilentError, match=("index", "middle", "pinkie", "thumb")[finger]):
        go_on(rig, hand, 1.0)


@pytest.mark.needs("can_faults")
def test_a_controller_that_goes_bus_off_is_told_at_the_next_command(rig: Rig, hand: AllegroHand) -> None:
    go_on(rig, hand, 0.1)
    rig.can_faults.go_bus_off(True)
    with pytest.raises(AllegroBusError, match="bus-off"):
        hand.set_torque(np.zeros(16))
    rig.can_faults.go_bus_off(False)
    hand.set_torque(np.zeros(16))
    rig.can.let_pass(PERIOD_S)
    hand.poll()
    go_on(rig, hand, 0.1)


@pytest.mark.needs("can_faults")
def test_heat_is_told_within_half_a_second_and_passes(rig: Rig, hand: AllegroHand) -> None:
    go_on(rig, hand, 0.1)
    rig.can_faults.set_temperature(80)
    begun_s = rig.can.now_s()
    with pytest.raises(AllegroTemperatureError, match="80 C"):
        go_on(rig, hand, 2.0)
    assert rig.can.now_s() - begun_s < 0.6
    rig.can_faults.set_temperature(40)
    for _ in range(400):  # asked again twice a second, also while it fails
        rig.can.let_pass(PERIOD_S)
        try:
            hand.update()
        except AllegroTemperatureError:
            continue
    go_on(rig, hand, 0.1)


@pytest.mark.needs("can_faults")
def test_motors_that_go_off_are_told(rig: Rig, hand: AllegroHand) -> None:
    go_on(rig, hand, 0.1)
    rig.can_faults.switch_servo_off(True)
    with pytest.raises(AllegroServoOffError, match="found them off"):
        go_on(rig, hand, 2.0)


@pytest.mark.needs("can_faults")
def test_a_hand_that_does_not_answer_is_refused_when_it_is_opened(rig: Rig) -> None:
    rig.can_faults.silence(True)
    bus = rig.can.open()
    with (
        pytest.raises(AllegroSilentError, match="no reply"),
        AllegroHand(bus, clock=rig.can.now_s, advance=rig.can.let_pass),
    ):
        pass
    bus.shutdown()
