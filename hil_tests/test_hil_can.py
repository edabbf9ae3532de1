"""The Allegro hand on its CAN channel: joint angles, torques, and errors for faults of the hand and the channel."""

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
"""Control period of the hand, in which each of the four fingers sends a pose, seconds."""
SILENCE_LIMIT_S = 0.1
"""Time without a pose after which the hand is regarded as silent, seconds."""
MOVED_JOINT = 5
BUSY_S = 0.5  # longest pause of this process on a rig in real time


@pytest.fixture
def hand(rig: Rig) -> Iterator[AllegroHand]:
    """The Allegro hand of the rig, connected over CAN."""
    bus = rig.can.open_bus()
    try:
        limit_s = SILENCE_LIMIT_S if rig.description.is_virtual else BUSY_S
        with AllegroHand(bus, clock=rig.can.now_s, advance=rig.can.advance, silence_limit_s=limit_s) as hand:
            yield hand
    except AllegroBusError:
        pass  # some tests end with a broken channel
    finally:
        bus.shutdown()


def update_hand(rig: Rig, hand: AllegroHand, seconds: float) -> int:
    """Run the hand for a time with one update per control period. Returns the number of finger poses received."""
    n_poses = 0
    for _ in range(round(seconds / PERIOD_S)):
        rig.can.advance(PERIOD_S)
        n_poses += hand.update()
    return n_poses


def test_hand_reports_its_type_its_motor_state_and_its_serial_number(hand: AllegroHand) -> None:
    assert hand.get_info().hand_type == 0
    assert hand.get_info().servo_on
    assert len(hand.get_serial()) > 0


def test_joint_angles_arrive_every_three_milliseconds(rig: Rig, hand: AllegroHand) -> None:
    assert update_hand(rig, hand, 0.3) >= 4 * 90  # of the four fingers, in 90 % of 100 control periods
    assert hand.read_joint_angles().age_s <= (2 * PERIOD_S if rig.description.is_virtual else BUSY_S)


def test_torque_moves_its_joint_at_least_four_times_as_far_as_any_other_joint(rig: Rig, hand: AllegroHand) -> None:
    """A torque on one joint for 0.3 s moves this joint by more than 0.01 rad, and all others by less than a quarter."""
    update_hand(rig, hand, 0.05)
    angles_before = hand.read_joint_angles().angles
    torque = np.zeros(16)
    torque[MOVED_JOINT] = 0.2
    hand.set_torque(torque)
    update_hand(rig, hand, 0.3)
    change = hand.read_joint_angles().angles - angles_before
    assert change[MOVED_JOINT] > 0.01
    assert np.abs(np.delete(change, MOVED_JOINT)).max() < 0.25 * change[MOVED_JOINT]


def test_joint_angles_stay_within_the_joint_limits(rig: Rig, hand: AllegroHand) -> None:
    hand.set_torque(np.full(16, 0.5))
    update_hand(rig, hand, 1.0)
    angles = hand.read_joint_angles().angles
    assert (angles >= JOINT_MIN_RAD - 0.01).all()
    assert (angles <= JOINT_MAX_RAD + 0.01).all()


@pytest.mark.needs("can_faults")
def test_a_few_lost_can_frames_raise_no_error(rig: Rig, hand: AllegroHand) -> None:
    """Eight lost frames are two control periods of four fingers, far below the time after which a hand is silent."""
    for count in (1, 3, 8):
        rig.can_faults.lose_frames(count)
        update_hand(rig, hand, 0.1)
    assert hand.read_joint_angles().age_s <= 2 * PERIOD_S


@pytest.mark.needs("can_faults")
def test_channel_that_loses_all_frames_raises_an_error_that_names_the_fingers_within_0_12_s(
    rig: Rig, hand: AllegroHand
) -> None:
    """The limit of 0.1 s without a pose is detected at most 0.02 s late; the hand works again without the fault."""
    update_hand(rig, hand, 0.1)
    rig.can_faults.lose_frames(100000)
    start_s = rig.can.now_s()
    with pytest.raises(AllegroSilentError, match="no pose of index, middle"):
        update_hand(rig, hand, 1.0)
    assert rig.can.now_s() - start_s < SILENCE_LIMIT_S + 0.02
    rig.can_faults.lose_frames(0)
    hand.poll()
    rig.can.advance(PERIOD_S)
    update_hand(rig, hand, 0.1)


@pytest.mark.needs("can_faults")
@pytest.mark.parametrize("finger", range(4))
def test_finger_without_joint_angles_is_named_in_the_error(rig: Rig, hand: AllegroHand, finger: int) -> None:
    update_hand(rig, hand, 0.1)
    rig.can_faults.set_finger_silent(finger, True)
    with pytest.raises(AllegroSilentError, match=("index", "middle", "pinkie", "thumb")[finger]):
        update_hand(rig, hand, 1.0)


@pytest.mark.needs("can_faults")
def test_bus_off_controller_raises_an_error_at_the_next_command_until_it_returns_to_the_bus(
    rig: Rig, hand: AllegroHand
) -> None:
    update_hand(rig, hand, 0.1)
    rig.can_faults.set_bus_off(True)
    with pytest.raises(AllegroBusError, match="bus-off"):
        hand.set_torque(np.zeros(16))
    rig.can_faults.set_bus_off(False)
    hand.set_torque(np.zeros(16))
    rig.can.advance(PERIOD_S)
    hand.poll()
    update_hand(rig, hand, 0.1)


@pytest.mark.needs("can_faults")
def test_overtemperature_raises_an_error_within_0_6_s_until_the_motors_have_cooled(rig: Rig, hand: AllegroHand) -> None:
    """The host requests the temperature every 0.5 s; 80 degrees Celsius are too hot, 40 are permitted."""
    update_hand(rig, hand, 0.1)
    rig.can_faults.set_temperature(80)
    start_s = rig.can.now_s()
    with pytest.raises(AllegroTemperatureError, match="80 C"):
        update_hand(rig, hand, 2.0)
    assert rig.can.now_s() - start_s < 0.6
    rig.can_faults.set_temperature(40)
    for _ in range(400):  # the temperature is requested twice a second, also while it is too high
        rig.can.advance(PERIOD_S)
        try:
            hand.update()
        except AllegroTemperatureError:
            continue
    update_hand(rig, hand, 0.1)


@pytest.mark.needs("can_faults")
def test_motors_that_switch_off_raise_an_error(rig: Rig, hand: AllegroHand) -> None:
    update_hand(rig, hand, 0.1)
    rig.can_faults.set_servo_off(True)
    with pytest.raises(AllegroServoOffError, match="found them off"):
        update_hand(rig, hand, 2.0)


@pytest.mark.needs("can_faults")
def test_opening_a_hand_that_does_not_respond_raises_an_error(rig: Rig) -> None:
    rig.can_faults.set_silent(True)
    bus = rig.can.open_bus()
    with (
        pytest.raises(AllegroSilentError, match="no reply to HAND_INFO"),
        AllegroHand(bus, clock=rig.can.now_s, advance=rig.can.advance),
    ):
        pass
    bus.shutdown()
